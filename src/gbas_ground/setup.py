from setuptools import find_packages, setup

PACKAGE = "gbas_ground"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="The ground station: reference receivers, integrity monitors, corrections and the broadcast schedule.",
    license="Apache-2.0",
    maintainer="GBAS suite developers",
    maintainer_email="dev@example.org",
    python_requires=">=3.11",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["gbas_core", "gbas_vdb", "gbas_msgs_py", "gbas_node", "numpy", "pydantic", "scipy", "PyYAML"],
    zip_safe=True,
    entry_points={
        "console_scripts": [
            "receiver_replay = gbas_ground.nodes.receiver_replay:main",
            "integrity_monitor = gbas_ground.nodes.integrity_monitor:main",
            "correction_broadcast = gbas_ground.nodes.correction_broadcast:main",
        ]
    },
)

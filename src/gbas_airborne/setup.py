from setuptools import find_packages, setup

PACKAGE = "gbas_airborne"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="The airborne receiver: processing modes, position, protection levels, alert limits and guidance.",
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
    install_requires=[
        "gbas_core",
        "gbas_vdb",
        "gbas_msgs_py",
        "gbas_node",
        "embreex",
        "imagecodecs",
        "numpy",
        "PyYAML",
        "scipy",
        "tifffile",
        "trimesh",
    ],
    zip_safe=True,
    entry_points={
        "console_scripts": [
            "positioning = gbas_airborne.nodes.positioning:main",
            "protection_level = gbas_airborne.nodes.protection_level:main",
        ]
    },
)

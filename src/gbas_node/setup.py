from setuptools import find_packages, setup

PACKAGE = "gbas_node"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="What every node runs on: parameters, ports, start gate, deadlines, diagnostics, flow control.",
    license="Apache-2.0",
    maintainer="GBAS suite developers",
    maintainer_email="dev@example.org",
    python_requires=">=3.11",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed", "*.xml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["gbas_core", "gbas_vdb", "gbas_msgs_py"],
    zip_safe=True,
)

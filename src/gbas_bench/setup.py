from setuptools import find_packages, setup

PACKAGE = "gbas_bench"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="How fast the suite is: each figure against a bound or a peer.",
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
        "gbas_ground",
        "gbas_airborne",
        "gbas_sim",
        "gbas_siting",
        "gbas_bags",
        "gbas_bringup",
        "gbas_chain",
        "gbas_studies",
        "numpy",
        "rich",
        "PyYAML",
    ],
    extras_require={"peer": ["pyrtklib"]},  # compared with, where it is installed
    zip_safe=True,
)

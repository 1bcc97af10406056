from setuptools import find_packages, setup

PACKAGE = "gbas_cli"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="The gbas command.",
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
        "gbas_bench",
        "numpy",
        "rich",
        "typer",
        "PyYAML",
    ],
    zip_safe=True,
    entry_points={"console_scripts": ["gbas = gbas_cli.main:main"]},
)

from setuptools import find_packages, setup

PACKAGE = "gbas_studies"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Published results and campaigns, built from the packages of the suite.",
    license="Apache-2.0",
    maintainer="GBAS suite developers",
    maintainer_email="dev@example.org",
    python_requires=">=3.11",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed", "reproduction/templates/*.j2"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=[
        "gbas_core",
        "gbas_vdb",
        "gbas_msgs_py",
        "gbas_ground",
        "gbas_airborne",
        "gbas_sim",
        "gbas_siting",
        "gbas_chain",
        "distributed",
        "jinja2",
        "matplotlib",
        "numpy",
        "pydantic",
        "scipy",
    ],
    zip_safe=True,
)

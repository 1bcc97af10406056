from setuptools import find_packages, setup

PACKAGE = "gbas_vdb"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="The VHF data broadcast to the bit and back: messages, CRCs, FEC, scrambling, D8PSK, frame schedule.",
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
    install_requires=["gbas_core", "numpy", "reedsolo"],
    zip_safe=True,
)

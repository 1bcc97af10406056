from setuptools import find_packages, setup

PACKAGE = "gbas_core"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="GNSS algorithms both ends share: time, frames, orbits, smoothing, antennas, RINEX, RTCM 3.",
    license="Apache-2.0",
    maintainer="GBAS suite developers",
    maintainer_email="dev@example.org",
    python_requires=">=3.11",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed", "models/*.yaml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=["numba", "numpy", "pydantic", "PyYAML", "scipy", "sidereon"],
    zip_safe=True,
)

from glob import glob

from setuptools import find_packages, setup

PACKAGE = "gbas_bringup"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Launch files, site configurations, the gbas command, recorder and player.",
    license="Apache-2.0",
    maintainer="GBAS suite developers",
    maintainer_email="dev@example.org",
    python_requires=">=3.11",
    packages=find_packages(include=[PACKAGE, f"{PACKAGE}.*"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/launch", sorted(glob("launch/*.py"))),
        (f"share/{PACKAGE}/config", sorted(glob("config/*.yaml"))),
        (f"share/{PACKAGE}/config/scenarios", sorted(glob("config/scenarios/*.yaml"))),
    ],
    install_requires=[
        "gbas_core",
        "gbas_msgs_py",
        "gbas_ground",
        "gbas_airborne",
        "gbas_sim",
        "gbas_studies",
        "numpy",
        "matplotlib",
        "mcap",
        "lz4",
        "zstandard",
        "rosbags",
        "rich",
        "typer",
        "PyYAML",
    ],
    extras_require={"bench": ["pyrtklib"]},  # gbas bench compares with it
    zip_safe=True,
    entry_points={
        "console_scripts": [
            "gbas = gbas_bringup.cli:main",
            "recorder = gbas_bringup.recorder:main",
            "player = gbas_bringup.player:main",
        ]
    },
)

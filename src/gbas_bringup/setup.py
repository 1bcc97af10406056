from glob import glob

from setuptools import find_packages, setup

PACKAGE = "gbas_bringup"

setup(
    name=PACKAGE,
    version="0.1.0",
    description="Starting the nodes: launch files, site configurations and scenarios, launcher.",
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
        (f"share/{PACKAGE}/config/schema", sorted(glob("config/schema/*.json"))),
        (f"share/{PACKAGE}/config/scenarios", sorted(glob("config/scenarios/*.yaml"))),
    ],
    install_requires=["gbas_core", "gbas_msgs_py", "gbas_node", "gbas_sim", "rich", "PyYAML", "setproctitle"],
    zip_safe=True,
)

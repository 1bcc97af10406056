"""Packages as pip and colcon see them: manifests that agree, programs that exist, files that are not left behind."""

from __future__ import annotations

import ast
import sys
import xml.etree.ElementTree as ElementTree
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = sorted(path.parent for path in (ROOT / "src").glob("*/setup.py"))
NAMES = [path.name for path in PACKAGES]
# Distributions whose modules have another name.
DISTRIBUTION = {"yaml": "PyYAML", "pydantic_core": "pydantic"}
# Come with ROS: from its wheels (requirements.txt) or from a native installation.
ROS = {
    "ament_index_python",
    "builtin_interfaces",
    "diagnostic_msgs",
    "geometry_msgs",
    "launch",
    "launch_ros",
    "rcl_interfaces",
    "rclpy",
    "rosgraph_msgs",
    "sensor_msgs",
    "std_msgs",
}


def setup_arguments(package: Path) -> dict[str, Any]:
    """Arguments of a setup.py, run with a setup() that only keeps them."""
    import setuptools

    kept: dict[str, Any] = {}
    original = setuptools.setup
    setuptools.setup = kept.update
    try:
        code = (package / "setup.py").read_text(encoding="utf-8")
        exec(compile(code, str(package / "setup.py"), "exec"), {"__name__": "__main__"})
    finally:
        setuptools.setup = original
    return kept


def modules(package: Path) -> list[Path]:
    return sorted((package / package.name).rglob("*.py"))


def top_level_imports(path: Path) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names.add(node.module)
    return {name.split(".")[0] for name in names}


@pytest.mark.parametrize("package", PACKAGES, ids=NAMES)
def test_manifest_agrees_with_setup(package: Path) -> None:
    manifest = ElementTree.parse(package / "package.xml").getroot()
    arguments = setup_arguments(package)
    assert manifest.findtext("name") == arguments["name"] == package.name
    for key in ("version", "description", "license"):
        assert manifest.findtext(key) == arguments[key]
    maintainer = manifest.find("maintainer")
    assert maintainer is not None
    assert maintainer.get("email") == arguments["maintainer_email"] == "dev@example.org"
    assert manifest.findtext("export/build_type") == "ament_python"
    assert (package / "resource" / package.name).exists()


@pytest.mark.parametrize("package", PACKAGES, ids=NAMES)
def test_every_import_is_declared(package: Path) -> None:
    arguments = setup_arguments(package)
    imported = set().union(*(top_level_imports(path) for path in modules(package)))
    imported -= set(sys.stdlib_module_names) | {package.name, "__future__"}
    python = {DISTRIBUTION.get(name, name) for name in imported - ROS}
    optional = set().union(*arguments.get("extras_require", {}).values())
    assert python <= set(arguments["install_requires"]) | optional
    manifest = ElementTree.parse(package / "package.xml").getroot()
    declared = {item.text for item in manifest.findall("exec_depend")}
    assert imported & (ROS | set(NAMES)) <= declared


@pytest.mark.parametrize("package", PACKAGES, ids=NAMES)
def test_programs_exist(package: Path) -> None:
    for entry in setup_arguments(package).get("entry_points", {}).get("console_scripts", []):
        module, _, function = entry.partition("=")[2].strip().partition(":")
        path = package / (module.replace(".", "/") + ".py")
        assert path.exists(), entry
        tree = ast.parse(path.read_text(encoding="utf-8"))
        defined = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        assigned = {
            target.id
            for node in tree.body
            if isinstance(node, ast.Assign)
            for target in node.targets
            if isinstance(target, ast.Name)
        }
        assert function in defined | assigned, entry


@pytest.mark.parametrize("package", PACKAGES, ids=NAMES)
def test_no_file_is_left_behind(package: Path) -> None:
    patterns = setup_arguments(package)["package_data"][package.name]
    inner = package / package.name
    for path in inner.rglob("*"):
        if path.is_file() and path.suffix != ".py" and "__pycache__" not in path.parts:
            relative = path.relative_to(inner).as_posix()
            assert any(fnmatch(relative, pattern) for pattern in patterns), f"{relative} is not installed"
    folders = {path.parent for path in modules(package)}
    assert not [str(folder) for folder in folders if not (folder / "__init__.py").exists()]

"""House rules one could break without noticing: which package may import which, and no paths of one machine."""

from __future__ import annotations

import ast
import os
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "src"

# docs/architecture.md: imports point one way. Ground and airborne share only VDB bits, so neither may see the other.
MAY_IMPORT = {
    "gbas_core": set(),
    "gbas_msgs_py": {"gbas_core"},
    "gbas_ground": {"gbas_core", "gbas_msgs_py"},
    "gbas_airborne": {"gbas_core", "gbas_msgs_py"},
    "gbas_sim": {"gbas_core", "gbas_msgs_py"},
    "gbas_studies": {"gbas_core", "gbas_msgs_py", "gbas_ground", "gbas_airborne", "gbas_sim"},
    "gbas_bringup": {"gbas_core", "gbas_msgs_py", "gbas_ground", "gbas_airborne", "gbas_sim", "gbas_studies"},
}
ROS_MODULES = {
    "rclpy",
    "ament_index_python",
    "launch",
    "launch_ros",
    "std_msgs",
    "sensor_msgs",
    "diagnostic_msgs",
    "geometry_msgs",
    "builtin_interfaces",
    "rcl_interfaces",
    "rosgraph_msgs",
}
MODULES = sorted(path for path in SOURCE.glob("*/gbas_*/**/*.py") if "build" not in path.parts)


def imported_modules(source: str) -> set[str]:
    """Absolute names of all modules a source imports, wherever in it, also by name through importlib."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            found.add(node.module)
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if name in ("import_module", "__import__") and isinstance(node.args[0].value, str):
                found.add(node.args[0].value)
    return found


def may_touch_ros(path: Path) -> bool:
    package, *inner = path.relative_to(SOURCE).parts[1:]
    return (
        package == "gbas_bringup"
        or inner[0] == "nodes"
        or (package == "gbas_msgs_py" and inner in (["ros.py"], ["node.py"]))
    )


def wrong_arrows(path: Path) -> list[str]:
    package = path.relative_to(SOURCE).parts[1]
    roots = {name.split(".")[0] for name in imported_modules(path.read_text(encoding="utf-8"))}
    wrong = sorted((roots & set(MAY_IMPORT)) - MAY_IMPORT[package] - {package})
    if not may_touch_ros(path):
        wrong += sorted(roots & ROS_MODULES)
    return wrong


def test_every_package_has_a_place_in_the_order() -> None:
    assert {path.name for path in SOURCE.iterdir() if (path / "setup.py").exists()} == set(MAY_IMPORT)
    assert MODULES


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_imports_point_one_way(path: Path) -> None:
    wrong = wrong_arrows(path)
    assert not wrong, f"{path.relative_to(ROOT)} must not import {', '.join(wrong)}"


def test_simulated_world_uses_messages_only_in_its_nodes() -> None:
    offenders = [
        str(path.relative_to(SOURCE))
        for path in MODULES
        if path.parts[len(SOURCE.parts)] == "gbas_sim"
        and "nodes" not in path.parts
        and any(name.split(".")[0] == "gbas_msgs_py" for name in imported_modules(path.read_text(encoding="utf-8")))
    ]
    assert not offenders


def test_a_wrong_arrow_is_seen() -> None:
    source = "def late():\n    import gbas_ground.station\n    importlib.import_module('rclpy')\n"
    assert {"gbas_ground.station", "rclpy"} <= imported_modules(source)


# A path into somebody's home, or into the root of one machine, works for nobody else. System places that every
# Debian has (/usr, /etc, /bin, /tmp, /opt/ros) and ROS topic names do not match.
MACHINE_PATH = re.compile(r"(?<![\w./~$}\-<>*])/(?:home|root|work|Users|mnt|srv)/[\w.~]")
TEXT_SUFFIXES = {".py", ".md", ".yaml", ".yml", ".toml", ".cfg", ".xml", ".txt", ".sh", ".json", ".html", ""}
SKIPPED = {".git", ".venv", "build", "install", "log", "out", "resource", "__pycache__", "node_modules", "LICENSE"}


def project_texts() -> list[Path]:
    found = []
    for folder, inner, names in os.walk(ROOT):
        inner[:] = [n for n in inner if n not in SKIPPED and not n.endswith((".egg-info", "_cache", ".hypothesis"))]
        found += [Path(folder, name) for name in names if Path(name).suffix in TEXT_SUFFIXES and name not in SKIPPED]
    return [path for path in found if path != Path(__file__).resolve()]


def test_no_machine_paths() -> None:
    offenders = []
    for path in project_texts():
        try:
            lines = path.read_text(encoding="utf-8").splitlines()
        except UnicodeDecodeError:
            continue
        offenders += [f"{path.relative_to(ROOT)}:{n}" for n, line in enumerate(lines, 1) if MACHINE_PATH.search(line)]
    assert not offenders, "absolute paths of one machine: " + ", ".join(offenders)

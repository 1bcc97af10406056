"""House rules one could break without noticing: which package may import which, how large modules and functions may
be, and no paths of one machine."""

from __future__ import annotations

import ast
import os
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "src"

# docs/architecture.md: imports point one way. Ground and airborne share only VDB bits, so neither may see the other.
# Each package may import those named beside it and whatever they may import.
DIRECTLY = {
    "gbas_core": set(),
    "gbas_vdb": {"gbas_core"},
    "gbas_msgs_py": {"gbas_vdb"},
    "gbas_node": {"gbas_msgs_py"},
    "gbas_ground": {"gbas_node"},
    "gbas_airborne": {"gbas_node"},
    "gbas_sim": {"gbas_node"},
    "gbas_siting": {"gbas_ground"},
    "gbas_bags": {"gbas_node"},
    "gbas_bringup": {"gbas_node", "gbas_sim"},
    "gbas_chain": {"gbas_ground", "gbas_airborne", "gbas_bringup"},
    "gbas_studies": {"gbas_chain", "gbas_siting"},
    "gbas_bench": {"gbas_studies", "gbas_bags"},
    "gbas_cli": {"gbas_bench"},
}


def reach(package: str) -> set[str]:
    """All packages a package may import."""
    return DIRECTLY[package].union(*(reach(each) for each in DIRECTLY[package]))


MAY_IMPORT = {package: reach(package) for package in DIRECTLY}
# Rooms of a package (folders, and modules beside them), from the ground floor up: each may import those before it.
# Parameters, and a station prepared from them, are not a room: every room is given them.
ROOMS = {
    "gbas_core": (
        "satellites",
        "signals",
        "record",
        "errors",
        "parameters",
        "configuration",
        "compiled",
        "gnss",
        "ranging",
        "models",
        "positioning",
        "signal",
        "io",
    ),
    "gbas_vdb": ("errors", "coding", "messages", "transmission"),
    "gbas_ground": (
        "corrections",
        "monitors",
        "channels",
        "ionosphere",
        "claims",
        "exclusions",
        "consistency",
        "long_term",
        "broadcast",
        "stages",
        "station",
        "nodes",
    ),
    "gbas_airborne": (
        "modes",
        "reception",
        "ranging",
        "navigation",
        "report",
        "protection",
        "conditions",
        "service",
        "selection",
        "receiver",
        "abia",
        "nodes",
    ),
    "gbas_sim": (
        "random_processes",
        "satellites",
        "atmosphere",
        "faults",
        "receivers",
        "flight",
        "world_params",
        "simulated_epochs",
        "threat_checks",
        "instants",
        "world",
        "batches",
        "rinex_files",
        "scenario",
        "nodes",
    ),
}
NO_ROOMS = {"params", "param_checks", "sections", "prepared", "approaches"}
# Names of satellites and bands, and constants of nature.
AXES = ("gbas_core.satellites", "gbas_core.signals")
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
        package in ("gbas_node", "gbas_bringup", "gbas_bags", "gbas_bench", "gbas_cli")
        or inner[0] == "nodes"
        or (package == "gbas_msgs_py" and inner == ["ros.py"])
    )


def room_of(module: str) -> str:
    """Room of a module of a package with rooms: the name after the package's."""
    return module.split(".")[1] if "." in module else ""


def wrong_floors(path: Path, source: str) -> list[str]:
    """Imports of a room above one's own."""
    package, *inner = path.relative_to(SOURCE).with_suffix("").parts[1:]
    rooms = ROOMS.get(package, ())
    own = inner[0]
    if own not in rooms:
        return []
    above = set(rooms[rooms.index(own) + 1 :])
    return sorted(
        name for name in imported_modules(source) if name.startswith(f"{package}.") and room_of(name) in above
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


def test_imports_point_one_way() -> None:
    wrong = {str(path.relative_to(SOURCE)): arrows for path in MODULES if (arrows := wrong_arrows(path))}
    assert not wrong


def test_rooms_are_on_floors() -> None:
    wrong = {
        str(path.relative_to(SOURCE)): arrows
        for path in MODULES
        if (arrows := wrong_floors(path, path.read_text(encoding="utf-8")))
    }
    assert not wrong


@pytest.mark.parametrize("package", sorted(ROOMS))
def test_every_room_has_a_floor_and_a_sign(package: str) -> None:
    inner = SOURCE / package / package
    there = {path.stem for path in inner.iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()}
    assert there - {"__init__"} - NO_ROOMS == set(ROOMS[package])
    for room in (inner, *(path for path in inner.iterdir() if (path / "__init__.py").exists())):
        if room.name != "nodes":
            assert ast.get_docstring(ast.parse((room / "__init__.py").read_text(encoding="utf-8"))), room


def test_oracles_do_not_know_the_suite() -> None:
    """A second formulation that imports the first is none; what builds scenes with the suite is in tests/scenes."""
    for path in (ROOT / "tests" / "oracles").glob("*.py"):
        own = {n for n in imported_modules(path.read_text(encoding="utf-8")) if n.startswith("gbas_")}
        assert not {n for n in own if not n.startswith(AXES)}, path.name


def test_a_climb_is_seen() -> None:
    path = SOURCE / "gbas_ground" / "gbas_ground" / "monitors" / "made_up.py"
    assert wrong_floors(path, "from gbas_ground.station import GroundStation") == [
        "gbas_ground.station",
        "gbas_ground.station.GroundStation",
    ]


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


MOST_LINES = 400
"""Of a module, all of its lines: text, comments and docstrings too."""
MOST_LINES_OF_FUNCTION = 60
"""From its ``def`` to its end, without its docstring."""
MOST_PARAMETERS = 6
"""Of a function, ``self`` and ``cls`` not counted. Two kinds of function may have more: a command, whose parameters are
its options (every argument annotated for typer), and a compiled kernel, which takes arrays and numbers, no records."""
_RECORD = "open: its arguments want a record"
TOO_LARGE: dict[str, str] = {
    "gbas_core/ranging/divergence.py:_advanced": _RECORD,
    "gbas_ground/monitors/divergence_covariance.py:calibrate": _RECORD,
    "gbas_ground/monitors/divergence_covariance.py:measurement_covariance": _RECORD,
    "gbas_ground/monitors/ephemeris_residual.py:site_decorrelation": _RECORD,
    "gbas_ground/monitors/gradient_estimates.py:gradient_vectors": _RECORD,
    "gbas_studies/fronts/campaign.py:draw": _RECORD,
}
"""Module, or module and function: why it may be larger. Nothing else may, and nothing that need not."""


def parameters_of(function: ast.FunctionDef | ast.AsyncFunctionDef) -> list[ast.arg]:
    """Parameters that count."""
    given = function.args
    every = [*given.posonlyargs, *given.args, *given.kwonlyargs, *filter(None, (given.vararg, given.kwarg))]
    return [each for each in every if each.arg not in ("self", "cls")]


def is_kernel(function: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Whether it is compiled: under :func:`gbas_core.compiled.compiled`, alone or with arguments."""
    names = [each.func if isinstance(each, ast.Call) else each for each in function.decorator_list]
    return any(isinstance(each, ast.Name) and each.id == "compiled" for each in names)


COMMAND_TYPES = {
    "Json", "BagPath", "Verbose", "Speed", "SingleProcess", "Domain", "File", "Workers", "Scheduler", "Results",
}  # fmt: skip
"""Types with an option of typer that several commands share."""


def is_command(function: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Whether it is a command of typer: each of its arguments is annotated with an option or argument."""
    annotations = [ast.unparse(each.annotation) for each in parameters_of(function) if each.annotation is not None]
    options = [each in COMMAND_TYPES or "typer.Option(" in each or "typer.Argument(" in each for each in annotations]
    return bool(options) and len(options) == len(parameters_of(function)) and all(options)


def lines_of(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    text = function.body[0] if ast.get_docstring(function) is not None else None
    docstring = 0 if text is None else (text.end_lineno or 0) - text.lineno + 1
    return (function.end_lineno or 0) - function.lineno + 1 - docstring


def too_large(name: str, source: str) -> dict[str, str]:
    """What of a module is over a limit, and by what."""
    found = {}
    if (lines := len(source.splitlines())) > MOST_LINES:
        found[name] = f"{lines} lines"
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        many = 0 if is_kernel(node) or is_command(node) else len(parameters_of(node))
        wrong = [f"{lines} lines"] if (lines := lines_of(node)) > MOST_LINES_OF_FUNCTION else []
        wrong += [f"{many} parameters"] if many > MOST_PARAMETERS else []
        if wrong:
            found[f"{name}:{node.name}"] = ", ".join(wrong)
    return found


def test_modules_and_functions_are_small() -> None:
    found: dict[str, str] = {}
    for path in MODULES:
        found |= too_large("/".join(path.relative_to(SOURCE).parts[1:]), path.read_text(encoding="utf-8"))
    assert {name: size for name, size in found.items() if name not in TOO_LARGE} == {}
    assert set(TOO_LARGE) - set(found) == set(), "no longer needed"


def test_what_is_too_large_is_seen() -> None:
    many = ", ".join(f"p{k}: float" for k in range(7))
    function = f'def f(self, {many}):\n    """{"word" * 10}"""\n' + "    x = 1\n" * 60
    assert too_large("m.py", function) == {"m.py:f": "61 lines, 7 parameters"}
    assert too_large("m.py", f"@compiled\ndef f({many}): ...\n" + "\n" * 398) == {}
    assert too_large("m.py", "\n" * 401) == {"m.py": "401 lines"}
    options = ", ".join(f"p{k}: Annotated[int, typer.Option()] = 1" for k in range(7))
    assert too_large("m.py", f"def f({options}): ...") == {}
    assert too_large("m.py", f"def f({options}, plain: int = 1): ...") == {"m.py:f": "8 parameters"}


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

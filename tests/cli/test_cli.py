"""The gbas command: help, JSON, exit codes, and errors as one line that names what is wrong."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from gbas_cli.base import describe, position_of, speed_option, spread_lists
from gbas_cli.main import app

T3 = Path(__file__).resolve().parents[1] / "tables" / "vdb_vectors.yaml"
RUNNER = CliRunner()


def gbas(*arguments: object, **options: Any) -> Any:
    return RUNNER.invoke(app, [str(each) for each in arguments], prog_name="gbas", **options)


def fails(*arguments: object, code: int = 2) -> str:
    """The one line on standard error."""
    result = gbas(*arguments)
    assert result.exit_code == code, result.output
    (line,) = result.stderr.splitlines()
    assert line.startswith("gbas: ")
    return str(line)


@pytest.fixture
def bag(fake_bag: Any, tmp_path: Path) -> Path:
    fake_bag().write(tmp_path / "flight")
    return tmp_path / "flight"


# --- help


@pytest.mark.parametrize(
    "command",
    [(), ("demo",), ("run",), ("launch-list",), ("process",), ("replay",), ("bench",), ("bag",), ("bag", "info"),
     ("bag", "check"), ("bag", "recover"), ("config",), ("config", "show"), ("config", "check"), ("config", "schema"),
     ("vdb",), ("vdb", "decode"), ("vdb", "encode"), ("vdb", "budget")],
)  # fmt: skip
def test_help_of_every_command(command: tuple[str, ...]) -> None:
    result = gbas(*command, "--help")
    assert result.exit_code == 0
    assert "Usage: gbas" in result.stdout


def test_help_imports_none_of_the_heavy_packages() -> None:
    """They take longer than help may take; what is imported does not depend on how busy the machine is."""
    code = (
        "import sys\nfrom gbas_cli.main import app\n"
        "try: app(['--help'])\nexcept SystemExit: pass\n"
        "print(*{'numpy', 'rclpy', 'scipy', 'matplotlib', 'rosbags', 'mcap', 'yaml'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == ""


def test_help_loads_nothing_that_computes() -> None:
    """What makes a command slow to answer is what it imports; how long it takes is the machine's."""
    heavy = ("numpy", "scipy", "numba", "rclpy", "matplotlib", "sidereon", "yaml")
    program = (
        "import sys, gbas_cli.main as cli; cli.app(['--help'], standalone_mode=False); "
        f"print(sorted(set({heavy!r}) & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_output_nobody_reads_to_its_end_is_no_error() -> None:
    """``gbas config schema | head``."""
    command = [sys.executable, "-m", "gbas_cli.main", "config", "schema"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    with process.stderr as said:
        assert said.read() == ""
    assert process.wait() == 1


def test_version() -> None:
    assert gbas("--version").stdout.startswith("gbas ")


# --- errors


def test_unknown_command_and_missing_option_are_one_line() -> None:
    assert "No such command 'fly'" in fails("fly")
    assert "Missing option '--ground'" in fails("process")
    assert "gbas process --help" in fails("process")


@pytest.mark.parametrize("command", [("bag", "info"), ("bag", "check"), ("bag", "recover"), ("replay",)])
def test_missing_bag_is_named(command: tuple[str, ...], tmp_path: Path) -> None:
    path = tmp_path / "nowhere"
    assert fails(*command, path) == f"gbas: {path}: there is no such bag"


@pytest.mark.parametrize("options", [(), ("--play-only",)])
def test_damaged_bag_is_not_replayed(options: tuple[str, ...], bag: Path, tmp_path: Path) -> None:
    file = bag / "flight_0.mcap"
    file.write_bytes(file.read_bytes()[:-5000])
    line = fails("replay", bag, "--out", tmp_path / "out", *options)
    assert str(file) in line
    assert "gbas bag recover" in line


def test_bag_without_configuration_is_not_replayed(bag: Path, tmp_path: Path) -> None:
    assert "no configuration is stored in it" in fails("replay", bag, "--out", tmp_path / "out")


def test_unknown_configuration_is_named() -> None:
    line = fails("run", "atlantis")
    assert "atlantis: there is no such file" in line
    assert "braunschweig" in line


def test_bad_configuration_is_named(tmp_path: Path) -> None:
    path = tmp_path / "bad.yaml"
    path.write_text("/**:\n  ros__parameters:\n    ground: [\n")
    assert f"{path}: is not YAML: line 4" in fails("run", path)


@pytest.mark.parametrize("text", ["fast", "0", "-2", "nan", "1e9"])
def test_speed_is_checked(text: str) -> None:
    assert "neither 'max' nor a multiple of real time" in fails("run", "braunschweig", "--speed", text)


def test_errors_are_json_with_json(tmp_path: Path) -> None:
    result = gbas("bag", "info", tmp_path / "nowhere", "--json")
    assert result.exit_code == 2
    assert json.loads(result.stdout) == {"error": f"{tmp_path / 'nowhere'}: there is no such bag"}


def test_file_that_cannot_be_opened_is_named(tmp_path: Path) -> None:
    line = fails("vdb", "encode", tmp_path / "no.json")
    assert line == f"gbas: {tmp_path / 'no.json'}: No such file or directory"


def test_fault_of_ours_has_its_own_exit_code() -> None:
    text, code = describe(ZeroDivisionError("division by zero"))
    assert code == 1
    assert "internal error, ZeroDivisionError" in text


def test_interrupt_has_exit_code_130(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("gbas_bags.info.info", interrupt)
    fails("bag", "info", tmp_path, code=130)


# --- lists


@pytest.mark.parametrize(
    ("given", "spread"),
    [
        (["--ground", "A", "B", "--user", "U"], ["--ground", "A", "--ground", "B", "--user", "U"]),
        (["--ground", "A", "--ground", "B"], ["--ground", "A", "--ground", "B"]),
        (["--ground=A", "--json"], ["--ground=A", "--json"]),
        (["--xyz", "-1.5,2,3", "-4,5,6"], ["--xyz", "-1.5,2,3", "--xyz", "-4,5,6"]),
        (["--user", "U", "V"], ["--user", "U", "V"]),
        (["--ground", "A", "--", "B"], ["--ground", "A", "--", "B"]),
        (["--ground", "--user", "U"], ["--ground", "--user", "U"]),
    ],
)
def test_lists_are_spread(given: list[str], spread: list[str]) -> None:
    assert spread_lists(given, {"--ground", "--xyz"}) == spread


def test_process_takes_lists_in_both_ways(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    requests = []

    def stop(request: Any, **_: Any) -> None:
        requests.append(request)
        raise KeyboardInterrupt

    monkeypatch.setattr("gbas_chain.process.process", stop)
    common = ("--user", "u.obs", "--out", tmp_path)
    gbas("process", "--ground", "a.obs", "b.obs", "--nav", "n1", "n2", "--ground-xyz", "-1,2,3", "4,-5,6", *common)
    gbas("process", "--ground", "a.obs", "--ground", "b.obs", "--nav", "n1", "--nav", "n2",
         "--ground-xyz", "-1,2,3", "--ground-xyz", "4,-5,6", *common)  # fmt: skip
    assert requests[0] == requests[1]
    assert requests[0].ground == (Path("a.obs"), Path("b.obs"))
    assert requests[0].ground_xyz_m == ((-1.0, 2.0, 3.0), (4.0, -5.0, 6.0))
    assert requests[0].navigation == (Path("n1"), Path("n2"))


def test_values_are_parsed() -> None:
    assert speed_option("max") == 0.0
    assert speed_option("2.5") == 2.5
    assert position_of("1,-2.5,3e6") == (1.0, -2.5, 3e6)
    assert "is not X,Y,Z" in fails("process", "--ground", "a", "--user", "u", "--nav", "n", "--ground-xyz", "1,2")


# --- bags


def test_info_in_words_and_json(bag: Path, fake_bag: Any) -> None:
    document = json.loads(gbas("bag", "info", bag, "--json").stdout)
    assert document["messages"] == sum(len(messages) for messages in fake_bag().content.values())
    words = gbas("bag", "info", bag).stdout
    assert "simulated" in words
    assert "/gbas/airborne/protection_levels" in words


def test_check_in_words_and_json(bag: Path) -> None:
    result = gbas("bag", "check", bag, "--json")
    assert result.exit_code == 0
    assert json.loads(result.stdout)["ok"]
    assert "good" in gbas("bag", "check", bag).stdout


def test_check_of_a_damaged_bag_has_exit_code_2(fake_bag: Any, tmp_path: Path) -> None:
    fake = fake_bag()
    key, data = fake.content["/gbas/airborne/solution"][7]
    fake.content["/gbas/airborne/solution"][7] = (key, data[:-8] + b"\x00\x00\x00\x00\x00\x00\xf0\x7f")
    fake.write(tmp_path / "bag")
    result = gbas("bag", "check", tmp_path / "bag", "--json")
    assert result.exit_code == 2
    (problem,) = json.loads(result.stdout)["problems"]
    assert problem["topic"] == "/gbas/airborne/solution"
    assert problem["index"] == 7
    assert problem["file"].endswith("bag_0.mcap")
    assert "/gbas/airborne/solution message 7: " in gbas("bag", "check", tmp_path / "bag").stdout


def test_recover_says_what_was_kept_and_lost(bag: Path, tmp_path: Path) -> None:
    file = bag / "flight_0.mcap"
    file.write_bytes(file.read_bytes()[:-100])
    document = json.loads(gbas("bag", "recover", bag, "--out", tmp_path / "saved", "--json").stdout)
    assert document["lost"] == 0
    assert document["kept"] == json.loads(gbas("bag", "info", tmp_path / "saved", "--json").stdout)["messages"]
    assert gbas("bag", "check", tmp_path / "saved").exit_code == 0
    assert "already exists" in fails("bag", "recover", bag, "--out", tmp_path / "saved")


# --- VDB


@pytest.fixture(scope="module")
def published_block() -> str:
    """The type 4 message block of the published burst."""
    document = yaml.safe_load(T3.read_text())
    return next(text for text in _texts(document) if text.startswith("AAA0D20C045C"))


def _texts(value: Any) -> list[str]:
    if isinstance(value, dict):
        return [text for item in value.values() for text in _texts(item)]
    if isinstance(value, list):
        return [text for item in value for text in _texts(item)]
    return ["".join(value.split())] if isinstance(value, str) else []


def test_decode_published_message(published_block: str) -> None:
    (block,) = json.loads(gbas("vdb", "decode", "--hex", published_block, "--json").stdout)["blocks"]
    assert (block["message_type"], block["station_id"], block["crc_ok"]) == (4, "CMJ", True)


def test_encode_gives_back_the_bits(published_block: str, tmp_path: Path) -> None:
    (tmp_path / "block.json").write_text(gbas("vdb", "decode", "--hex", published_block).stdout)
    encoded = json.loads(gbas("vdb", "encode", tmp_path / "block.json", "--json").stdout)
    assert encoded == {"hex": published_block}
    assert gbas("vdb", "encode", "-", input=(tmp_path / "block.json").read_text()).stdout.strip() == published_block


def test_bad_crc_is_an_error_that_names_it(published_block: str) -> None:
    bad = published_block[:-2] + f"{int(published_block[-2:], 16) ^ 1:02X}"
    assert "CRC" in fails("vdb", "decode", "--hex", bad)
    result = gbas("vdb", "decode", "--hex", bad, "--json")
    assert result.exit_code == 2
    assert "CRC" in json.loads(result.stdout)["errors"][0]["reason"]


def test_launch_list() -> None:
    document = json.loads(gbas("launch-list", "--json").stdout)
    assert "braunschweig" in document["configurations"]
    assert "recorder" in document["nodes"]


# --- the VDB's budget


def test_budget_says_what_fits_and_what_does_not() -> None:
    """Two bands of 20 satellites: 254 + 168 bytes of types 1 and 11, and 250 of each private message (by hand in
    tests/vdb/transmission/test_budget.py)."""
    found = json.loads(gbas("vdb", "budget", "--satellites", "G:11,E:9", "--bands", "2", "--json").stdout)
    assert [each["bytes_per_frame"] for each in found["messages"] if each["message_type"] in (1, 8, 11)] == [
        254.0, 250.0, 250.0, 168.0,
    ]  # fmt: skip
    assert (found["satellites"], found["left_out"], found["second_left_out"]) == (20, 0, 0)
    text = gbas("vdb", "budget", "--satellites", "G:11,E:9", "--bands", "2", "--slots", "AB").stdout
    assert "18 of 20 fit" in text
    assert "second band: 0 of 18 fit" in text


@pytest.mark.parametrize(
    ("arguments", "wrong"),
    [
        (("--satellites", "R:4"), "'R:4' is not a system"),
        (("--satellites", "G:4,G:5"), "'G:5' is not a system (G, E), once"),
        (("--satellites", "G:33"), "33 is more than the 32"),
        (("--satellites", "G:4", "--slots", "BA"), "--slots 'BA'"),
        (("--satellites", "G:4", "--service", "E"), "--service 'E' is not C or D"),
        (("--satellites", "G:4", "--bands", "2", "--second", "60"), "--second '60'"),
    ],
)
def test_budget_refuses_in_one_line(arguments: tuple[str, ...], wrong: str) -> None:
    assert wrong in fails("vdb", "budget", *arguments)

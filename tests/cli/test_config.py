"""``gbas config``: what is refused and in which words, values and where they came from, the schema editors use."""

from __future__ import annotations

import dataclasses
import json
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml
from typer.testing import CliRunner

from gbas_bringup.node_kinds import NODE_KINDS
from gbas_bringup.resources import config_path, configurations, resources
from gbas_cli.config_schema import FILE, file_schema, section_schema, text_of
from gbas_cli.config_sections import SECTIONS, node_model
from gbas_cli.config_values import BY_RUN, DEFAULT, Effective, effective
from gbas_cli.main import app
from gbas_core.parameters import declared

STATION: dict[str, Any] = {
    "station": {"id": "TEST", "latitude_deg": 52.3, "longitude_deg": 10.5, "height_m": 131.9},
    "receivers": {
        "rr1_ecef_m": [3840619.039, 715604.228, 5024909.863],
        "rr2_ecef_m": [3840835.113, 714861.969, 5024848.587],
    },
}
APPROACH = {
    "ltp_latitude_deg": 52.3, "ltp_longitude_deg": 10.5, "ltp_height_m": 133.0, "course_deg": 264.7,
    "fpap_distance_m": 2300.0, "tch_m": 15.0, "gpa_deg": 3.0, "fasval_m": 10.0, "faslal_m": 40.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def validator() -> jsonschema.Draft202012Validator:
    schema = file_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def gbas(*arguments: str) -> Any:
    return CliRunner().invoke(app, ["config", *arguments])


# --- declarations


def models() -> Iterator[tuple[str, type[Any]]]:
    """Every class of parameters: of the sections, of the sections in these, and of the nodes."""
    todo = [(name, model) for name, section in SECTIONS.items() for model in section.models]
    todo += [(name, node_model(name)) for name in NODE_KINDS]
    seen = set()
    while todo:
        name, model = todo.pop()
        if model in seen:
            continue
        seen.add(model)
        yield name, model
        for key, hint in typing.get_type_hints(model).items():
            todo += [(f"{name}.{key}", inner) for inner in classes(hint) if hasattr(inner, "__pydantic_validator__")]


def classes(hint: Any) -> Iterator[type[Any]]:
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        yield hint
    for inner in typing.get_args(hint):
        yield from classes(inner)


def numbers(hint: Any) -> bool:
    """Whether a value may be a number that is not one of a few."""
    return hint in (int, float) or (
        typing.get_origin(hint) is not typing.Literal and any(numbers(inner) for inner in typing.get_args(hint))
    )


def test_every_parameter_has_a_description_a_unit_and_numbers_have_bounds() -> None:
    wanting = []
    checked = 0
    for name, model in models():
        for item in declared(model):
            checked += 1
            parameter = item.parameter
            bounded = parameter.low is not None and parameter.high is not None and parameter.low < parameter.high
            dimensional = item.key.rpartition("_")[2] in ("m", "s", "mps", "deg", "hz", "db", "dbhz")
            if not parameter.doc or (numbers(item.kind) and not bounded) or (dimensional and parameter.unit == "-"):
                wanting.append(f"{name}: {item.key}")
    assert wanting == []
    assert checked > 250


# --- schema


def test_the_schema_beside_the_shipped_files_is_the_one_that_is_printed() -> None:
    (shipped,) = resources("config/schema", "*.json")
    assert shipped.name == FILE
    assert shipped.read_text(encoding="utf-8") == text_of(file_schema()), "gbas config schema --out " + str(shipped)


@pytest.mark.parametrize("path", configurations(), ids=lambda path: path.stem)
def test_shipped_files_are_good_by_the_schema_they_name(path: Path, validator: Any) -> None:
    text = path.read_text(encoding="utf-8")
    (modeline,) = [line for line in text.splitlines() if line.startswith("# yaml-language-server:")]
    schema = path.parent / modeline.partition("$schema=")[2]
    assert schema.resolve() == resources("config/schema", FILE)[0].resolve()
    assert [error.message for error in validator.iter_errors(yaml.safe_load(text))] == []


def changed(section: str, key: str, value: Any) -> dict[str, Any]:
    """A good file with another value at a dotted key of a section."""
    document: dict[str, Any] = {
        "ground": {name: dict(keys) for name, keys in STATION.items()} | {"approaches": {"rwy26": dict(APPROACH)}},
        "airborne": {"aad": "B", "rpds": 5},
    }
    place: Any = document.setdefault(section, {})
    *above, last = key.split(".")
    for each in above:
        place = place.setdefault(each, {})
    place[last] = value
    return document


NAN, INFINITY = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("section", "key", "value", "words"),
    [
        ("ground", "station.latitude_deg", 91.0, "station.latitude_deg = 91 is not within -90 to 90 deg"),
        ("ground", "station.latitude_dg", 52.3, "station.latitude_dg is unknown; did you mean 'latitude_deg'?"),
        ("ground", "station.height_m", "high", "station.height_m = 'high' is not a number"),
        ("ground", "station.height_m", True, "station.height_m = True is not a number"),
        ("ground", "station.gcid", 5, "station.gcid = 5 is not one of 1, 2, 3, 4, 7"),
        ("ground", "station.rsds", 256, "station.rsds = 256 is not within 0 to 255"),
        ("ground", "station.rsds", 2.5, "station.rsds = 2.5 is not a whole number"),
        ("ground", "station.id", 1234, "station.id = 1234 is not a text"),
        ("ground", "station.max_use_distance_m", NAN, "station.max_use_distance_m = nan is not a finite number"),
        ("ground", "station.max_use_distance_m", INFINITY, "station.max_use_distance_m = inf is not a finite number"),
        ("ground", "station.max_use_distance_m", -1.0, "station.max_use_distance_m = -1 is not within 0 to 510000 m"),
        ("ground", "receivers.rr1_ecef_m", [1.0, 2.0], "receivers.rr1_ecef_m = (1.0, 2.0) has not the right number"),
        ("ground", "receivers.rr1_ecef_m", [1.0, None, 2.0], "receivers.rr1_ecef_m = None is not a number"),
        ("ground", "receivers.rr2_ecef_m", 3.0, "receivers.rr2_ecef_m = 3.0 is not a list"),
        ("ground", "receivers.rr5_ecef_m", [1.0, 2.0, 3.0], "receivers.rr5_ecef_m is unknown; did you mean 'rr"),
        ("ground", "receivers.minimum", 0, "receivers.minimum = 0 is not within 1 to 4"),
        ("ground", "accuracy.designator", "D", "accuracy.designator = 'D' is not one of 'A', 'B', 'C'"),
        ("ground", "accuracy.sigma_m", [0.3, -1.0], "accuracy.sigma_m = -1 is not within 0.001 to 100 m"),
        ("ground", "accuracy.sigma_m", 0.3, "accuracy.sigma_m = 0.3 is not a list"),
        ("ground", "atmosphere", 3, "atmosphere = 3 is not a section of keys"),
        ("ground", "ccd.exclude", 1, "ccd.exclude = 1 is not true or false"),
        ("ground", "ccd.tau", 30.0, "ccd.tau is unknown; did you mean 'tau_s'?"),
        ("ground", "cdc", {}, "cdc is unknown; did you mean 'ccd'?"),
        ("ground", "approaches.rwy26.gpa_deg", 91.0, "approaches.rwy26.gpa_deg = 91 is not within"),
        ("ground", "approaches.rwy26.ltp_latitude", 52.3, "approaches.rwy26.ltp_latitude is unknown; did you mean"),
        ("ground", "approaches.rwy26.runway", 26, "approaches.rwy26.runway = 26 is not a text"),
        ("ground", "vdb.slots", 5, "vdb.slots = 5 is not a text"),
        ("airborne", "aad", "C", "airborne.aad = 'C' is not one of 'A', 'B'"),
        ("airborne", "rpds", 49, "airborne.rpds = 49 is not within -1 to 48"),
        ("airborne", "elevation_mask_deg", NAN, "airborne.elevation_mask_deg = nan is not a finite number"),
        ("airborne", "elevation_mask_deg", 4.9, "airborne.elevation_mask_deg = 4.9 is not within 5 to 45 deg"),
        ("airborne", "elevation_mask", 5.0, "airborne.elevation_mask is unknown; did you mean 'elevation_mask_deg'?"),
        ("airborne", "smoothing_tau_s", "100", "airborne.smoothing_tau_s = '100' is not a number"),
        ("airborne", "inflate_unsettled", 1, "airborne.inflate_unsettled = 1 is not true or false"),
        ("airborne", "systems", "GR", "airborne.systems = 'GR' is not one of 'G', 'E', 'GE', 'EG'"),
        ("airborne", "max_iterations", 1, "airborne.max_iterations = 1 is not within 2 to 100"),
        ("airborne", "settle_s", [1.0], "airborne.settle_s = (1.0,) is not a number"),
        ("sim", "systems", "R", "sim.systems = 'R' is not one of G, E, GE, EG"),
        ("sim", "start_week", 1023, "sim.start_week = 1023 is not within 1024 to 8191 weeks"),
        ("sim", "start_tow_s", 604_800.0, "sim.start_tow_s = 604800 is not within 0 to 604799.999 s"),
        ("sim", "interval_s", NAN, "sim.interval_s = nan is not a finite number"),
        ("sim", "seed", 1.5, "sim.seed = 1.5 is not a whole number"),
        ("sim", "duration", 60.0, "sim.duration is unknown; did you mean 'duration_s'?"),
        ("sim", "aircraft", 1, "sim.aircraft = 1 is not true or false"),
        ("sim", "flight", ["climb"], "sim.flight = ['climb'] is not a section of keys"),
        ("sim", "flight", {"speed_mps": -70.0}, "sim.flight.speed_mps = -70 is not within"),
        ("sim", "flight", {"profile": "six_phase"}, "sim.flight.profile = 'six_phase' is not one of 'five_phase'"),
        ("sim", "constellation.navigation", 3, "sim.constellation.navigation = 3 is not a list"),
        ("sim", "troposphere.scale_height_m", "high", "sim.troposphere.scale_height_m = 'high' is not a number"),
        ("sim", "ionosphere.sigma_vig", INFINITY, "sim.ionosphere.sigma_vig = inf is not a finite number"),
        ("sim", "scintillation.equatorial_s4", 2.0, "sim.scintillation.equatorial_s4 = 2 is not within 0 to 1"),
        ("sim", "scene.ground", "marble", "sim.scene.ground = 'marble' is not one of metal, concrete"),
        ("sim", "ground_receiver", {"preset": "gad_z"}, "sim.ground_receiver.preset = 'gad_z' is not one of gad_a, "),
        ("sim", "airborne_receiver", {"preset": "aad_b", "cn0": {"antena": "patch"}},
         "sim.airborne_receiver.cn0.antena is unknown; did you mean 'antenna'?"),
        ("sim", "threats", 3, "sim.threats = 3 is not a section of keys"),
        ("sim", "threats.storm", {"kind": "fornt"}, "sim.threats.storm.kind = 'fornt' is not one of "),
    ],
)  # fmt: skip
def test_the_schema_refuses_what_the_command_refuses(
    section: str, key: str, value: Any, words: str, validator: Any, tmp_path: Path
) -> None:
    document = changed(section, key, value)
    (tmp_path / "wrong.yaml").write_text(yaml.safe_dump(document))
    done = gbas("check", str(tmp_path / "wrong.yaml"))
    assert done.exit_code == 2
    assert done.stderr.startswith(f"gbas: {tmp_path / 'wrong.yaml'}: {words}")
    wrapped = {"/**": {"ros__parameters": document}}
    for form in (document, wrapped):
        places = ["/".join(map(str, error.absolute_path)) for error in validator.iter_errors(form)]
        assert places, "the schema takes it"
        assert all(f"{section}/" in f"{place}/" for place in places)


@pytest.mark.parametrize(
    ("key", "value", "lacking"),
    [
        ("threats.storm", {"gradient": 1.0e-4}, "sim.threats.storm.kind is missing"),
        ("threats.hangar", {"kind": "building", "east_m": 90.0}, "sim.threats.hangar.north_m is missing"),
    ],
)
def test_a_threat_that_is_given_is_whole(key: str, value: Any, lacking: str, validator: Any, tmp_path: Path) -> None:
    """Other files add keys to sections, which the schema allows; the command does not wait for the rest of a threat."""
    document = changed("sim", key, value)
    (tmp_path / "wrong.yaml").write_text(yaml.safe_dump(document))
    done = gbas("check", str(tmp_path / "wrong.yaml"))
    assert done.exit_code == 2
    assert done.stderr.startswith(f"gbas: {tmp_path / 'wrong.yaml'}: {lacking}")
    assert list(validator.iter_errors(document)) == []


def test_the_good_file_of_these_tests_is_good(validator: Any, tmp_path: Path) -> None:
    document = changed("airborne", "rpds", 6)
    (tmp_path / "good.yaml").write_text(yaml.safe_dump(document))
    done = gbas("check", str(tmp_path / "good.yaml"))
    assert (done.exit_code, done.stdout.splitlines()[0]) == (0, f"good: {tmp_path / 'good.yaml'}")
    assert list(validator.iter_errors(document)) == []


@pytest.mark.parametrize(
    ("document", "words"),
    [
        ({"airbourne": {}, "ground": {}}, "airbourne: is no section; known are ground, airborne, sim"),
        ({"/**": {"ros__parameters": {"sim": {}, "ground": {}}}, "/gbas/positionning": {"ros__parameters": {}}},
         "/gbas/positionning: is no node of the suite; did you mean 'positioning'?"),
        ({"/gbas/receiver_replay": {"ros__parameters": {"speed": -1.0, "ground_files": ["a"], "nav_files": ["b"]}}},
         "/gbas/receiver_replay.speed = -1 is not within 0 to 1000000 times real time"),
        ({"/gbas/player": {"ros__parameters": {"bag": "a", "mode": "some"}}},
         "/gbas/player.mode = 'some' is not one of 'inputs', 'all'"),
        ({"/gbas/player": {"ros__parameters": {"bag": "a", "modes": "all"}}},
         "/gbas/player.modes is unknown; did you mean 'mode'?"),
    ],
)  # fmt: skip
def test_sections_and_nodes_are_those_of_the_suite(
    document: dict[str, Any], words: str, validator: Any, tmp_path: Path
) -> None:
    (tmp_path / "wrong.yaml").write_text(yaml.safe_dump(document))
    done = gbas("check", str(tmp_path / "wrong.yaml"))
    assert done.exit_code == 2
    assert done.stderr.startswith(f"gbas: {tmp_path / 'wrong.yaml'}: {words}")
    assert list(validator.iter_errors(document))


@pytest.mark.parametrize("name", SECTIONS)
def test_the_schema_of_a_section_is_part_of_that_of_the_file(name: str) -> None:
    printed = json.loads(gbas("schema", name).stdout)
    jsonschema.Draft202012Validator.check_schema(printed)
    assert printed == section_schema(name)
    assert printed.items() >= file_schema()["$defs"][name].items()


def test_the_schema_speaks_in_degrees_and_says_units() -> None:
    mask = section_schema("airborne")["properties"]["elevation_mask_deg"]
    assert (mask["minimum"], mask["maximum"], mask["default"]) == (5.0, 45.0, 5.0)
    assert mask["description"].endswith("[deg]")
    assert gbas("schema", "air").stderr == "gbas: 'air' is not one of ground, airborne, sim, file\n"


# --- values


def sources(found: Effective, section: str) -> dict[str, tuple[Any, str]]:
    return {each.declared.key: (each.declared.value, Path(each.source).name) for each in found.values[section]}


def test_values_say_where_they_came_from() -> None:
    found = effective(config_path("short_approach.yaml"))
    ground = sources(found, "ground")
    assert ground["station.systems"] == ("G", "short_approach.yaml")
    assert ground["station.latitude_deg"] == (52.3199737, "braunschweig.yaml")
    assert ground["station.rsds"] == (255, DEFAULT)
    assert ground["approaches.rwy26.course_deg"] == (264.73, "braunschweig.yaml")
    assert sources(found, "airborne")["elevation_mask_deg"] == (5.0, DEFAULT)
    assert sources(found, "/gbas/simulator")["recorders"] == (1, BY_RUN)
    assert [path.name for path in found.files] == ["short_approach.yaml", "braunschweig.yaml"]
    assert found.nodes[0] == "simulator"


@pytest.mark.parametrize("path", configurations(), ids=lambda path: path.stem)
def test_shipped_files_are_read_as_a_run_reads_them(path: Path) -> None:
    found = effective(path)
    if path.stem == "nominal_station":  # the site is the recording's
        assert (found.nodes, found.lacking) == ((), ("ground: station.latitude_deg is missing (reference point)",))
    else:
        assert (found.nodes[0], found.lacking) == ("simulator", ())
    assert not any(each.source == str(path) and each.declared.value is None for each in found.values["ground"])


def test_the_simulated_air_is_the_stations_unless_it_is_given(tmp_path: Path) -> None:
    shipped = effective(config_path("short_approach.yaml"))
    ground, sim = sources(shipped, "ground"), sources(shipped, "sim")
    for key, taken in (
        ("refractivity", "atmosphere.refractivity"),
        ("scale_height_m", "atmosphere.scale_height_m"),
        ("reference_height_m", "station.height_m"),
    ):
        assert sim[f"troposphere.{key}"] == ground[taken]
        assert sim[f"troposphere.{key}"][1] == "braunschweig.yaml"
    own = {
        "base": str(config_path("short_approach.yaml")),
        "/**": {"ros__parameters": {"sim": {"troposphere": {"refractivity": 7.0}}}},
    }
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(own))
    found = sources(effective(tmp_path / "own.yaml"), "sim")
    assert found["troposphere.refractivity"] == (7.0, "own.yaml")
    assert found["troposphere.scale_height_m"] == sim["troposphere.scale_height_m"]


def test_a_plain_section_above_a_wrapped_base_is_told_its_place(tmp_path: Path) -> None:
    plain = {"base": str(config_path("short_approach.yaml")), "sim": {"seed": 3}}
    (tmp_path / "plain.yaml").write_text(yaml.safe_dump(plain))
    done = gbas("check", str(tmp_path / "plain.yaml"))
    assert done.exit_code == 2
    assert done.stderr == (
        f"gbas: {tmp_path / 'plain.yaml'}: sim: stands at the top of the file, where nodes do not read it; "
        "put it below '/**: ros__parameters:'\n"
    )


def test_files_named_by_nodes_are_read_and_nodes_may_differ(tmp_path: Path) -> None:
    (tmp_path / "fleet.yaml").write_text("airborne: {aad: B, settle_s: 100, elevation_mask_deg: 7}\n")
    named = {"config": str(tmp_path / "fleet.yaml")}
    run = {
        "/gbas/receiver_replay": {"ros__parameters": {"ground_files": ["a.obs"], "nav_files": ["b.nav"]}},
        "/gbas/positioning": {"ros__parameters": {**named, "join_timeout_s": 2.0}},
        "/gbas/second/positioning": {"ros__parameters": {**named, "airborne": {"settle_s": 50.0}}},
    }
    path = tmp_path / "run.yaml"
    path.write_text(yaml.safe_dump(run))
    found = effective(path)
    first, second = sources(found, "airborne"), sources(found, "/gbas/second/positioning, airborne")
    assert first["settle_s"] == (100.0, "fleet.yaml")
    assert second["settle_s"] == (50.0, "run.yaml")
    assert first["elevation_mask_deg"] == second["elevation_mask_deg"] == (7.0, "fleet.yaml")
    assert sources(found, "/gbas/positioning")["join_timeout_s"] == (2.0, "run.yaml")
    done = gbas("check", str(path))
    assert done.exit_code == 2
    assert done.stderr == f"gbas: {path}: /gbas/receiver_replay: ground_files = 'a.obs' is no file\n"


def test_show_prints_what_is_given_first_and_defaults_when_asked() -> None:
    short = gbas("show", "nominal_station")
    assert short.exit_code == 0
    assert "station.id" in short.stdout
    assert "left to others: ground: station.latitude_deg is missing (reference point)" in short.stdout
    document = json.loads(gbas("show", "short_approach", "--json").stdout)
    mask = next(each for each in document["values"]["airborne"] if each["key"] == "elevation_mask_deg")
    assert (mask["value"], mask["unit"], mask["source"]) == (5.0, "deg", DEFAULT)


def test_check_says_what_is_good_and_what_would_start() -> None:
    done = gbas("check", "short_approach")
    assert done.exit_code == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0].startswith("good: ")
    assert lines[-1] == (
        "starts simulator, integrity_monitor, correction_broadcast, positioning, protection_level, recorder"
    )
    assert json.loads(gbas("check", "short_approach", "--json").stdout)["good"] is True


def test_a_key_that_stands_twice_is_refused(tmp_path: Path) -> None:
    (tmp_path / "twice.yaml").write_text("airborne: {aad: A, aad: B}\n")
    done = gbas("check", str(tmp_path / "twice.yaml"))
    assert done.exit_code == 2
    assert "key 'aad' stands twice in a section" in done.stderr

"""Flights from files: what is read, and what is refused with one message that names the key."""

from __future__ import annotations

import math
import textwrap

import pytest
import yaml

from gbas_core.parameters import from_mapping, nested
from gbas_core.positioning.approach import FinalApproach
from gbas_sim.flight import params
from gbas_sim.flight.dynamics import (
    AIRLINER,
    FIGHTER,
    Cruise,
    CurvedApproach,
    FlightPlan,
    MissedApproach,
    Start,
    StraightInApproach,
    Turn,
)
from gbas_sim.flight.params import flight_of
from gbas_sim.params import SimParams

APPROACH = FinalApproach.from_course(
    ltp_lat_rad=0.9,
    ltp_lon_rad=0.2,
    ltp_height_m=100.0,
    course_rad=1.0,
    fpap_distance_m=2300.0,
    tch_m=15.0,
    gpa_rad=0.05,
)
FILE = yaml.safe_load("""
aircraft: airliner
mass_kg: 60000
speed_mps: 95.0
wind: {height_m: [0.0, 1500.0], speed_mps: [5, 15.0], from_deg: [240.0, 270.0]}
segments:
  1: {kind: cruise, duration_s: 60.0}
  2: {kind: turn, heading_change_deg: -90.0, bank_deg: 25.0, roll_rate_degps: 5.0}
  3: {kind: curved, turn_deg: 90.0, radius_m: 3000.0, join_distance_m: 6000.0, speed_mps: 72.0,
      intercept_distance_m: 9000.0, level_time_s: 90.0}
  4: {kind: missed_approach, from_height_m: 60, height_gain_m: 600.0, vertical_speed_mps: 10.0, speed_mps: 85}
""")


def flight_from_mapping(mapping, approach=None):
    return flight_of(from_mapping(SimParams, {"flight": nested(mapping)}).flight, approach)


def changed(**changes):
    return {key: value for key, value in (FILE | changes).items() if value is not None}


def test_every_key_is_read() -> None:
    flight = flight_from_mapping(FILE, approach=APPROACH)
    assert flight.aircraft.name == "airliner"
    assert flight.aircraft.mass_kg == 60_000.0
    assert flight.wind.from_rad == (math.radians(240.0), math.radians(270.0))
    assert flight.plan.approach is APPROACH
    cruise, turn, curved, missed = flight.plan.segments
    assert cruise == Cruise(duration_s=60.0)
    assert turn == Turn(
        heading_change_rad=math.radians(-90.0), bank_rad=math.radians(25.0), roll_rate_radps=math.radians(5.0)
    )
    assert isinstance(curved, CurvedApproach)
    assert curved.turn_rad == math.radians(90.0)
    assert curved.radius_m == 3000.0
    assert isinstance(missed, MissedApproach)


def test_the_documented_example_can_be_flown() -> None:
    """The example in the module's description, but for the start, which goes with plans without an approach."""
    block = params.__doc__.split("::\n\n")[1].split("\n\nor,")[0]
    example = yaml.safe_load(textwrap.dedent(block))
    del example["start"]
    flight = flight_from_mapping(example, approach=APPROACH)
    assert [phase.kind for phase in flight.phases] == ["cruise", "turn", "curved"]
    assert flight.planned_wind is not None


def test_lists_and_dotted_keys_mean_the_same() -> None:
    flat: dict[str, object] = {}

    def flatten(prefix, value) -> None:
        if isinstance(value, dict):
            for key, each in value.items():
                flatten(f"{prefix}{key}.", each)
        else:
            flat[prefix[:-1]] = value

    flatten("", FILE)
    assert "segments.2.bank_deg" in flat
    nested = flight_from_mapping(FILE, approach=APPROACH)
    assert flight_from_mapping(flat, approach=APPROACH) == nested
    listed = changed(segments=list(FILE["segments"].values()))
    assert flight_from_mapping(listed, approach=APPROACH) == nested


def test_defaults_and_start() -> None:
    start = {"latitude_deg": 52.0, "longitude_deg": 10.5, "height_m": 600.0, "heading_deg": 90.0}
    flight = flight_from_mapping(
        {"speed_mps": 100.0, "start": start, "segments": [{"kind": "cruise", "duration_s": 5}]}, approach=APPROACH
    )
    assert flight.aircraft == AIRLINER
    assert flight.wind.calm
    assert flight.plan.approach is None
    assert flight.plan.start == Start(
        latitude_rad=math.radians(52.0), longitude_rad=math.radians(10.5), height_m=600.0, heading_rad=math.pi / 2.0
    )


def test_the_papers_flight_by_name() -> None:
    flight = flight_from_mapping({"profile": "five_phase"}, approach=APPROACH)
    assert flight.aircraft == FIGHTER
    assert [segment.kind for segment in flight.plan.segments] == ["climb", "cruise", "turn", "cruise", "straight_in"]


def segment(**keys):
    return changed(segments={**FILE["segments"], 2: keys})


@pytest.mark.parametrize(
    ("mapping", "message"),
    [
        (changed(colour="red"), "flight.colour is unknown; known are"),
        (changed(aircraft="zeppelin"), "aircraft = 'zeppelin' is not one of fighter, airliner, small_uav"),
        (changed(mass_kg=10.0), "mass_kg = 10.0 is less than empty_mass_kg"),
        (changed(mass_kg="heavy"), "mass_kg = 'heavy' is not a number"),
        (changed(speed_mps=True), "speed_mps = True is not a number"),
        (changed(speed_mps=1000.0), "flight.speed_mps = 1000 is not within 5 to 320 m/s"),
        (changed(speed_mps=None), "speed_mps is missing"),
        (changed(segments=None), "segments is missing"),
        (changed(segments=[]), "segments is empty"),
        (changed(segments=3), "flight.segments = 3 is not a list"),
        (changed(segments={1: FILE["segments"][1], 3: FILE["segments"][2]}), "flight.segments = keys 1, 3, not 1 to 2"),
        (changed(configuration="flaps"), "flight.configuration = 'flaps' is not one of 'clean', 'landing'"),
        (changed(turning_earth="no"), "turning_earth = 'no' is not true or false"),
        (
            changed(profile="five_phase"),
            "flight: speed_mps is given, but profile says what is flown",
        ),
        ({"profile": "six_phase"}, "flight.profile = 'six_phase' is not one of 'five_phase'"),
        (changed(start={"latitude_deg": 1.0}), "flight.start.longitude_deg is missing"),
        (
            changed(start={"latitude_deg": 1, "longitude_deg": 1, "height_m": 1, "heading_deg": 1}),
            "start is given, but the flight is laid out from its approach",
        ),
        (changed(wind={"speed_mps": 5.0}), "wind.speed_mps = 5.0 is not a list"),
        (
            changed(wind={"height_m": [0.0], "speed_mps": [-5.0], "from_deg": [0.0]}),
            "flight.wind.speed_mps = -5 is not within 0 to 150 m/s",
        ),
        (changed(wind={"gusts": 1}), "wind.gusts is unknown"),
        (segment(kind="loop"), "segments.2.kind = 'loop' is not one of cruise, climb"),
        (segment(kind="turn", bank_deg=20.0), "flight.segments.2.heading_change_deg is missing"),
        (segment(kind="turn", heading_change_deg=9.0, bank_deg="x"), "segments.2.bank_deg = 'x' is not a number"),
        (
            segment(kind="turn", heading_change_deg=9.0, bank_deg=89.0),
            "flight.segments.2.bank_deg = 89 is not within 1 to 80 deg",
        ),
        (segment(kind="turn", heading_change_deg=9.0), "neither is given, exactly one of bank_deg and duration_s"),
        (segment(kind="turn", heading_change_deg=9.0, bank_rad=0.1), "segments.2.bank_rad is unknown"),
        (segment(kind="cruise", duration_s=float("nan")), "flight.segments.2.duration_s = nan is not a finite number"),
        (changed(segments=[FILE["segments"][number] for number in (1, 3, 4, 4)]), "segment 4 is a missed approach"),
        (segment(kind="straight_in", speed_mps=70, duration_s=300), "segments 2 and 3 are both approaches"),
        (
            {"segments.1": 3, "segments.1.kind": "cruise"},
            "segments.1.kind is given, and a part of it is both a value and a section",
        ),
    ],
)  # fmt: skip
def test_refusals(mapping, message: str) -> None:
    with pytest.raises(ValueError) as error:
        flight_from_mapping(mapping, approach=APPROACH)
    assert message in str(error.value)


def test_approach_without_a_final_approach() -> None:
    with pytest.raises(ValueError, match="no final approach to fly it on"):
        flight_from_mapping(FILE)


def test_what_the_aircraft_cannot_do_is_refused_when_read() -> None:
    steep = {**FILE["segments"], 2: {"kind": "turn", "heading_change_deg": 90.0, "bank_deg": 60.0}}
    with pytest.raises(ValueError, match=r"^flight: segment 2 \(turn\), .* bank \[deg\] = .* \(airliner\)$"):
        flight_from_mapping(changed(segments=steep), approach=APPROACH)


def test_what_follows_an_approach() -> None:
    with pytest.raises(ValueError, match="segment 2 must be a missed approach"):
        FlightPlan(
            approach=APPROACH,
            speed_mps=70.0,
            segments=(StraightInApproach(speed_mps=70.0, intercept_distance_m=9000.0), Cruise(duration_s=10.0)),
        )

"""Recorded receivers through live nodes: nothing lost, and the same bits as offline.

The reference is the offline chain over the same recording; it is validated elsewhere (tests/bringup). Here equality is
exact: tables are compared by their bytes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sensor_msgs.msg import NavSatFix
from std_msgs.msg import Float64, UInt8

from gbas_airborne.params import AirborneParams
from gbas_chain.chain import AirborneOutput, Chain, GroundOutput
from gbas_core.io.recording import RecordedEpoch, Recording
from gbas_ground.params import GroundParams
from gbas_msgs_py import tables, topics
from gbas_msgs_py.codes import EventKind
from gbas_msgs_py.modes import MODES

pytestmark = pytest.mark.ros

SET = "static_pair_L1L2_1h_2010"
CHAIN = (
    "gbas_ground.nodes.integrity_monitor",
    "gbas_ground.nodes.correction_broadcast",
    "gbas_airborne.nodes.positioning",
    "gbas_airborne.nodes.protection_level",
)
REPLAY = "gbas_ground.nodes.receiver_replay"
SCALARS = {
    "vpl_m": topics.AIRBORNE_VPL,
    "lpl_m": topics.AIRBORNE_LPL,
    "val_m": topics.AIRBORNE_VAL,
    "lal_m": topics.AIRBORNE_LAL,
}
SECONDS = 60
"""Of data; the filters below settle in 20 s, so the last 20 s have positions."""
STATION: dict[str, Any] = {
    "station": {"id": "TEST", "gcid": 1, "latitude_deg": 41.3889, "longitude_deg": 2.112, "height_m": 166.0},
    "receivers": {
        "rr1_ecef_m": [4789013.0077, 176610.1555, 4195034.8091],
        "rr2_ecef_m": [4789031.3107, 176583.4025, 4195015.1106],
        "minimum": 1,
    },
    "smoothing": {"settle_time_s": 20.0},
    "signal_power": {"require_cn0": False},
    "vdb": {"slots": "AB"},
}
RECEIVER: dict[str, Any] = {"settle_s": 20.0, "max_speed_mps": 1.0}
WAITING = {"wait_for": ["protection_level", "probe"], "start_wait_s": 60.0}
PATIENT = {"join_timeout_s": 60.0, "start_wait_s": 60.0}
"""No deadline may pass because the machine is busy."""


@pytest.fixture
def files(data_dir: Path) -> dict[str, Any]:
    return {
        "ground_files": [str(data_dir / SET / "UPC10770.11o.gz"), str(data_dir / SET / "UPC20770.11o.gz")],
        "user_file": str(data_dir / SET / "UPC20770.11o.gz"),
        "nav_files": [str(data_dir / SET / "brdc0770.11n.gz")],
    }


def offline(
    files: dict[str, Any], epochs: slice, ground: dict[str, Any] = STATION, airborne: dict[str, Any] = RECEIVER
) -> list[GroundOutput | AirborneOutput]:
    recording = Recording.open(files["ground_files"], files["user_file"], files["nav_files"])
    chain = Chain(
        GroundParams.from_mapping(ground),
        AirborneParams.from_mapping(airborne),
        recording.ephemerides(),
        recording.user_ephemerides(),
    )
    first, last = recording.overlap
    chosen: list[RecordedEpoch] = list(recording.epochs(first=first, last=last))[epochs]
    return list(chain.run(chosen))


def start_chain(launcher: Any, own_ephemerides: bool, **more: Any) -> None:
    parameters: dict[str, Any] = {"ground": STATION, "airborne": RECEIVER, "start_wait_s": 60.0, **more}
    for module in CHAIN:
        joins = module.endswith(("integrity_monitor", "positioning"))
        remap = ("-r", "/gbas/ephemeris:=/gbas/airborne/ephemeris") if own_ephemerides else ()
        aboard = module.startswith("gbas_airborne")
        launcher.start(module, {**parameters, **(PATIENT if joins else {})}, remap if aboard else ())


def raw(schema: Any, records: list[Any]) -> list[bytes]:
    return [schema.encode(record).tobytes() for record in records]


@pytest.mark.parametrize(
    ("speed", "seconds", "own_ephemerides"),
    [(0.0, SECONDS, False), (20.0, 40, True), pytest.param(0.0, 3000, False, marks=pytest.mark.campaign)],
)
def test_live_nodes_give_the_bits_of_the_offline_chain(
    launcher: Any, probe: Any, files: dict[str, Any], speed: float, seconds: int, own_ephemerides: bool
) -> None:
    """At full speed, and paced with navigation files of the aircraft's own."""
    integrity, bursts = probe.listen(topics.GROUND_INTEGRITY), probe.bursts()
    monitors, channels = probe.listen(topics.GROUND_MONITORS), probe.listen(topics.GROUND_CHANNELS)
    details = probe.listen(topics.GROUND_MONITOR_DETAILS)
    solutions, protections = probe.listen(topics.AIRBORNE_SOLUTION), probe.listen(topics.AIRBORNE_PROTECTION)
    events, fixes = probe.events(), probe.listen(topics.AIRBORNE_FIX, NavSatFix)
    scalars = {name: probe.listen(topic, Float64) for name, topic in SCALARS.items()}
    services = probe.listen(topics.AIRBORNE_SERVICE, UInt8)
    # The probe is a recorder of all outputs of the chain. It is slower than the nodes, so the replay must wait for it.
    probe.report_progress(topics.AIRBORNE_PROTECTION)
    start_chain(launcher, own_ephemerides, recorders=1)
    if own_ephemerides:
        files = {**files, "user_nav_files": list(files["nav_files"])}
    replay = launcher.start(REPLAY, {**files, "speed": speed, "stop_s": float(seconds), **WAITING})
    expected = offline(files, slice(0, seconds + 1))
    ground = [each for each in expected if isinstance(each, GroundOutput)]
    airborne = [each for each in expected if isinstance(each, AirborneOutput)]

    probe.until(lambda: any(event.kind is EventKind.FINISHED for event in events), "the end of the replay", 300.0)
    assert replay.wait() == 0, replay.output
    of_air = (solutions, protections, fixes, services, *scalars.values())
    of_ground = (integrity, monitors, details, channels)
    probe.until(lambda: min(map(len, of_air)) >= len(airborne), "the last protection level")
    probe.until(lambda: min(map(len, of_ground)) >= len(ground), "the station's last tables")

    assert raw(tables.INTEGRITY, integrity) == raw(tables.INTEGRITY, [each.integrity for each in ground])
    assert raw(tables.MONITORS, monitors) == raw(tables.MONITORS, [each.monitored.statistics for each in ground])
    assert raw(tables.MONITOR_DETAILS, details) == raw(tables.MONITOR_DETAILS, [e.monitored.details for e in ground])
    assert raw(tables.CHANNELS, channels) == raw(tables.CHANNELS, [each.monitored.channels for each in ground])
    assert [b for b in bursts if b.bursts_in_frame] == [b for each in ground for b in each.bursts]
    assert raw(tables.SOLUTION, solutions) == raw(tables.SOLUTION, [each.solution for each in airborne])
    assert raw(tables.PROTECTION, protections) == raw(tables.PROTECTION, [each.protection for each in airborne])
    assert len(fixes) == len(airborne)
    assert [m.data for m in services] == [each.protection.service for each in airborne]
    for name, heard in scalars.items():
        np.testing.assert_array_equal([m.data for m in heard], [getattr(each.protection, name) for each in airborne])
    # The run is worth comparing only if it gives positions and protection levels.
    assert sum(each.protection.vpl_m > 0.0 for each in airborne) > seconds - 30
    expected_events = [event for each in expected for event in each.events]
    probe.until(lambda: len(events) > len(expected_events), "the last event")
    told = sorted((e.epoch, e.subject, e.cause) for e in events if e.kind is not EventKind.FINISHED)
    assert told == sorted((e.epoch, e.subject, e.cause) for e in expected_events)


TWO_BANDS = "static_pair_L1L5_2024"
STATION_OF_ALL: dict[str, Any] = {
    "station": {
        "id": "TEST", "gcid": 7, "latitude_deg": 35.1332, "longitude_deg": 136.9777, "height_m": 90.0, "systems": "GE",
    },
    "receivers": {"rr1_ecef_m": [-3817681.1213, 3562839.4311, 3650159.1593], "minimum": 1},
    "smoothing": {"settle_time_s": 20.0},
    "gast_d": {"enabled": True, "required": False},
    "second_band": {"products": ["l5_100", "l5_30"]},
    "vdb": {"slots": "ABCDEFGH"},
}  # fmt: skip
RECEIVER_OF_ALL: dict[str, Any] = {
    **RECEIVER,
    "service": "D",
    "modes": ["all"],
    "use_unhealthy": True,
    "gast_d": {"require_authentication": False, "divergence_settle_s": 20.0, "step_in_s": 2.0},
}


def test_all_modes_live_have_the_bits_of_the_offline_chain(launcher: Any, probe: Any, data_dir: Path) -> None:
    """Every mode beside GAST-D: one table an epoch, and still one solution and one protection."""
    folder = data_dir / TWO_BANDS
    files = {
        "ground_files": [str(folder / "base.obs.gz")],
        "user_file": str(folder / "rover.obs.gz"),
        "nav_files": [str(folder / "base.nav.gz")],
        "systems": "GE",
    }
    solutions, protections = probe.listen(topics.AIRBORNE_SOLUTION), probe.listen(topics.AIRBORNE_PROTECTION)
    modes, events = probe.listen(topics.AIRBORNE_MODES), probe.events()
    probe.report_progress(topics.AIRBORNE_PROTECTION)
    # every output waits for its recorder, this one; what is not looked at is heard all the same
    for topic in (
        topics.GROUND_INTEGRITY, topics.GROUND_MONITORS, topics.GROUND_MONITOR_DETAILS, topics.GROUND_CHANNELS,
    ):  # fmt: skip
        probe.listen(topic)
    probe.bursts()
    probe.listen(topics.AIRBORNE_FIX, NavSatFix)
    probe.listen(topics.AIRBORNE_SERVICE, UInt8)
    for topic in SCALARS.values():
        probe.listen(topic, Float64)
    start_chain(launcher, False, recorders=1, ground=STATION_OF_ALL, airborne=RECEIVER_OF_ALL)
    replay = launcher.start(REPLAY, {**files, "speed": 0.0, "stop_s": float(SECONDS), **WAITING})
    expected = offline(files, slice(0, SECONDS + 1), STATION_OF_ALL, RECEIVER_OF_ALL)
    airborne = [each for each in expected if isinstance(each, AirborneOutput)]
    probe.until(lambda: any(event.kind is EventKind.FINISHED for event in events), "the end of the replay", 300.0)
    assert replay.wait() == 0, replay.output
    probe.until(lambda: min(map(len, (solutions, protections, modes))) >= len(airborne), "the last table")
    assert raw(tables.MODES, modes) == raw(tables.MODES, [each.modes for each in airborne])
    assert raw(tables.SOLUTION, solutions) == raw(tables.SOLUTION, [each.solution for each in airborne])
    assert raw(tables.PROTECTION, protections) == raw(tables.PROTECTION, [each.protection for each in airborne])
    last = airborne[-1].modes
    assert last is not None
    assert len(last.mode) == len(MODES)
    assert np.isfinite(last.vpl_m).sum() >= 12  # of GPS alone, and of Galileo, there may be too few on L5
    assert {2.0, 3.0, 6.0} <= set(last.mode[np.isfinite(last.vpl_m)].tolist())

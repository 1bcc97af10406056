"""Something stops: a reference receiver, the radio, the aircraft's receiver, a node. What the user then sees.

The data are recorded (GPS, 1 Hz); the test itself plays the part of whatever it needs to stop, because it can then stop
in the middle. Whatever is lost, there is never a position without a valid protection level.
"""

from __future__ import annotations

import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sensor_msgs.msg import NavSatFix
from std_msgs.msg import Float64, UInt8, UInt8MultiArray

from gbas_airborne.params import AirborneParams
from gbas_chain.chain import Chain, GroundOutput
from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.io.recording import RecordedEpoch, Recording
from gbas_ground.params import GroundParams
from gbas_msgs_py import ros, tables, topics
from gbas_msgs_py.codes import EventKind, ServiceType
from gbas_msgs_py.records import ProtectionEpoch, SolutionEpoch

pytestmark = pytest.mark.ros

SET = "static_pair_L1L2_1h_2010"
STATION: dict[str, Any] = {
    "station": {"id": "TEST", "gcid": 1, "latitude_deg": 41.3889, "longitude_deg": 2.112, "height_m": 166.0},
    "receivers": {
        "rr1_ecef_m": [4789013.0077, 176610.1555, 4195034.8091],
        "rr2_ecef_m": [4789031.3107, 176583.4025, 4195015.1106],
        "minimum": 1,
    },
    "smoothing": {"settle_time_s": 10.0},
    "signal_power": {"require_cn0": False},
    "vdb": {"slots": "AB"},
    "ephemeris": {"k_md_e_c": 5.0},
    "atmosphere": {"sigma_vert_iono_gradient": 4e-6, "refractivity_uncertainty": 20.0},
}
RECEIVER: dict[str, Any] = {"settle_s": 10.0, "max_speed_mps": 1.0}
SETTLED = 25
"""Epochs after which the filters of both ends have settled and there is a service."""
QUICK = {"start_wait_s": 60.0, "join_timeout_s": 0.3}
RECORDED = {"start_wait_s": 60.0, "recorders": 1}
"""The test listens to all outputs beside the chain: nothing is sent before both are there."""


@pytest.fixture(scope="module")
def recording(data_dir: Path) -> Recording:
    folder = data_dir / SET
    files = [folder / "UPC10770.11o.gz", folder / "UPC20770.11o.gz"]
    return Recording.open(files, files[1], [folder / "brdc0770.11n.gz"])


@pytest.fixture(scope="module")
def epochs(recording: Recording) -> list[RecordedEpoch]:
    first, _ = recording.overlap
    return list(recording.epochs(first=first, last=first + 60_000))


@pytest.fixture(scope="module")
def frames(recording: Recording, epochs: list[RecordedEpoch]) -> list[tuple[Any, ...]]:
    """The station's bursts of each epoch, made offline."""
    chain = Chain(GroundParams.from_mapping(STATION), AirborneParams(), recording.ephemerides(), ())
    return [each.bursts for each in chain.run(epochs) if isinstance(each, GroundOutput)]


def send_ephemerides(probe: Any, ephemerides: tuple[Ephemeris, ...]) -> None:
    publisher = probe.publisher(topics.EPHEMERIS)
    for each in ephemerides:
        publisher.publish(ros.table_to_msg(tables.EPHEMERIS, each))


class Aircraft:
    """The two airborne nodes, fed by the test with observations and bursts."""

    def __init__(self, launcher: Any, probe: Any, recording: Recording, **protection: Any) -> None:
        self.probe, self.have = probe, 0
        self.solutions: list[SolutionEpoch] = probe.listen(topics.AIRBORNE_SOLUTION)
        self.protections: list[ProtectionEpoch] = probe.listen(topics.AIRBORNE_PROTECTION)
        self.services = probe.listen(topics.AIRBORNE_SERVICE, UInt8)
        probe.listen(topics.AIRBORNE_FIX, NavSatFix)
        for topic in (topics.AIRBORNE_VPL, topics.AIRBORNE_LPL, topics.AIRBORNE_VAL, topics.AIRBORNE_LAL):
            probe.listen(topic, Float64)
        self.events = probe.events()
        self.status = probe.diagnostics()
        launcher.start("gbas_airborne.nodes.positioning", {"airborne": RECEIVER, **QUICK, **RECORDED})
        launcher.start("gbas_airborne.nodes.protection_level", {"airborne": RECEIVER, **RECORDED, **protection})
        self.radio = probe.publisher(topics.VDB, UInt8MultiArray)
        send_ephemerides(probe, recording.user_ephemerides())

    def fly(self, epochs: list[RecordedEpoch], frames: list[tuple[Any, ...]]) -> list[ProtectionEpoch]:
        """Feed epochs and wait for their protection levels; a frame that is () is silence on the radio."""
        before = self.have
        for epoch, frame in zip(epochs, frames, strict=True):
            self.probe.send(topics.AIRBORNE_OBSERVATIONS, tables.OBSERVATIONS, epoch.user)
            for burst in frame:
                self.radio.publish(ros.burst_to_msg(burst))
            self.have += 1
            self.probe.until(lambda: len(self.solutions) == len(self.protections) == self.have, "a protection level")
        self.check_positions()
        return self.protections[before:]

    def check_positions(self) -> None:
        """A position that may be used has a finite protection level; without one there is an alert."""
        for solution, protection in zip(self.solutions, self.protections, strict=True):
            if protection.service != ServiceType.NONE:
                assert np.isfinite([solution.x_m, protection.vpl_m, protection.lpl_m]).all()
            else:
                assert protection.alert == 1.0


def test_radio_silent_for_four_seconds(
    launcher: Any, probe: Any, recording: Recording, epochs: list[RecordedEpoch], frames: list[tuple[Any, ...]]
) -> None:
    """Service until 3.5 s after the last type 1 message (RTCA DO-253), none after, and again when the radio is back."""
    aircraft = Aircraft(launcher, probe, recording)
    n = SETTLED
    before = aircraft.fly(epochs[:n], frames[:n])
    assert before[-1].service == ServiceType.C
    silent = aircraft.fly(epochs[n : n + 5], [()] * 5)
    assert [each.service for each in silent] == [1.0, 1.0, 1.0, 0.0, 0.0]
    assert [each.alert for each in silent] == [0.0, 0.0, 0.0, 1.0, 1.0]
    assert aircraft.services[-1].data == ServiceType.NONE
    probe.until(lambda: aircraft.status["positioning"][2].get("count of no VDB frame in time") == "5", "five time-outs")
    lost = [event for event in aircraft.events if event.kind is EventKind.SERVICE and event.value == ServiceType.NONE]
    assert lost
    after = aircraft.fly(epochs[n + 5 : n + 8], frames[n + 5 : n + 8])
    assert after[-1].service == ServiceType.C


def test_airborne_receiver_lost(
    launcher: Any, probe: Any, recording: Recording, epochs: list[RecordedEpoch], frames: list[tuple[Any, ...]]
) -> None:
    """No observations, no epochs: the service topic says so, with an event, and both nodes report an error."""
    aircraft = Aircraft(launcher, probe, recording, silence_s=1.0)
    assert aircraft.fly(epochs[:SETTLED], frames[:SETTLED])[-1].service == ServiceType.C
    probe.until(lambda: aircraft.services[-1].data == ServiceType.NONE, "the service withdrawn")
    probe.until(lambda: aircraft.events[-1].cause == "no_solution", "the event")
    assert aircraft.events[-1].kind is EventKind.SERVICE
    assert aircraft.events[-1].epoch == epochs[SETTLED - 1].key  # the last epoch there was
    probe.until(lambda: aircraft.status["protection_level"][1].startswith("no input for"), "the error")
    assert aircraft.status["protection_level"][0] == b"\x02"
    # It comes back with the data.
    assert aircraft.fly(epochs[SETTLED : SETTLED + 2], frames[SETTLED : SETTLED + 2])


def test_reference_receiver_lost(launcher: Any, probe: Any, recording: Recording, epochs: list[RecordedEpoch]) -> None:
    """The station goes on with the other one, an epoch later than usual, and says what is missing."""
    integrity, events, status = probe.listen(topics.GROUND_INTEGRITY), probe.events(), probe.diagnostics()
    launcher.start("gbas_ground.nodes.integrity_monitor", {"ground": STATION, **QUICK})
    send_ephemerides(probe, recording.ephemerides())

    def feed(part: list[RecordedEpoch], receivers: tuple[int, ...]) -> None:
        for epoch in part:
            for j in receivers:
                probe.send(topics.GROUND_OBSERVATIONS[j], tables.OBSERVATIONS, epoch.ground[j])
            wanted = len(integrity) + 1
            probe.until(lambda wanted=wanted: len(integrity) >= wanted, "the integrity of an epoch")

    feed(epochs[:SETTLED], (0, 1))
    assert integrity[-1].n_receivers == 2
    assert status.get("integrity_monitor", (b"\x00", "", {}))[2].get("problems", "0") == "0"
    feed(epochs[SETTLED : SETTLED + 3], (0,))
    assert [each.n_receivers for each in integrity[-3:]] == [1, 1, 1]
    probe.until(lambda: ("rr2", "missing") in {(e.subject, e.cause) for e in events}, "the event")
    count = "count of no epoch from rr2 in time"
    probe.until(lambda: status["integrity_monitor"][2].get(count) == "3", "the time-outs counted")
    # Late epochs are not believed: what was decided without them stands.
    probe.send(topics.GROUND_OBSERVATIONS[1], tables.OBSERVATIONS, epochs[SETTLED].ground[1])
    late = "count of late or repeated epoch of rr2"
    probe.until(lambda: status["integrity_monitor"][2].get(late) == "1", "the late epoch counted")
    feed(epochs[SETTLED + 3 : SETTLED + 5], (0, 1))
    probe.until(lambda: ("rr2", "back") in {(e.subject, e.cause) for e in events}, "the event")


# --- drivers

REPLAY = "gbas_ground.nodes.receiver_replay"


@pytest.fixture
def files(data_dir: Path) -> dict[str, Any]:
    folder = data_dir / SET
    return {
        "ground_files": [str(folder / "UPC10770.11o.gz"), str(folder / "UPC20770.11o.gz")],
        "user_file": str(folder / "UPC20770.11o.gz"),
        "nav_files": [str(folder / "brdc0770.11n.gz")],
        "speed": 0.0,
    }


def test_replay_names_the_readers_it_misses(launcher: Any, files: dict[str, Any]) -> None:
    replay = launcher.start(REPLAY, {**files, "start_wait_s": 1.0})
    assert replay.wait(60.0) == 3
    for name in (
        "ground/rr1/observations has 0 of 1",
        "airborne/observations has 0 of 1",
        "progress as protection_level",
    ):
        assert name in replay.output
    assert "Traceback" not in replay.output


def test_replay_says_who_stalls(launcher: Any, probe: Any, files: dict[str, Any]) -> None:
    """A reader that dies in the middle ends the replay with its name, not with a wait for ever."""
    readers = {"wait_for": [], "stall_s": 5.0, "start_wait_s": 60.0, "window_epochs": 4, "user_file": ""}
    monitor = launcher.start("gbas_ground.nodes.integrity_monitor", {"ground": STATION, "start_wait_s": 60.0})
    launcher.start("gbas_ground.nodes.correction_broadcast", {"ground": STATION, "start_wait_s": 60.0})
    bursts = probe.bursts()
    replay = launcher.start(REPLAY, {**files, **readers})
    probe.until(lambda: len(bursts) > 20, "the replay under way")
    monitor.send_signal(signal.SIGKILL)
    assert replay.wait(60.0) == 3
    assert "no progress of correction_broadcast for 5 s" in replay.output


def test_replay_of_a_station_alone_ends_in_order(launcher: Any, probe: Any, files: dict[str, Any]) -> None:
    events, bursts = probe.events(), probe.bursts()
    for node in ("integrity_monitor", "correction_broadcast"):
        launcher.start(f"gbas_ground.nodes.{node}", {"ground": STATION, "start_wait_s": 60.0})
    for topic in (topics.EPHEMERIS, *topics.GROUND_OBSERVATIONS[:2]):
        probe.listen(topic)
    replay = launcher.start(REPLAY, {**files, "user_file": "", "stop_s": 20.0, **RECORDED})
    assert replay.wait(60.0) == 0, replay.output
    probe.until(lambda: events and events[-1].kind is EventKind.FINISHED, "the event of the end")
    assert events[-1].value == 21
    probe.until(lambda: len({each.tow_s for each in bursts}) == 21, "a frame of each epoch")


def test_replay_stops_in_order_in_the_middle(launcher: Any, probe: Any, files: dict[str, Any]) -> None:
    bursts = probe.bursts()
    for node in ("integrity_monitor", "correction_broadcast"):
        launcher.start(f"gbas_ground.nodes.{node}", {"ground": STATION, "start_wait_s": 60.0})
    replay = launcher.start(REPLAY, {**files, "user_file": "", "speed": 1.0, "start_wait_s": 60.0})
    probe.until(lambda: bursts, "the replay under way")
    assert replay.end(signal.SIGINT)[0] == 0
    assert "Traceback" not in replay.output

"""Start, parameters, quality of service, names and end of the nodes."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter as RclpyParameter
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from std_msgs.msg import String

from gbas_airborne.nodes.positioning import Positioning
from gbas_airborne.nodes.protection_level import ProtectionLevel
from gbas_bringup.environment import process_environment
from gbas_core.gnss.observations import ObservationEpoch
from gbas_ground.nodes.correction_broadcast import CorrectionBroadcast
from gbas_ground.nodes.integrity_monitor import IntegrityMonitor
from gbas_ground.nodes.receiver_replay import ReceiverReplay
from gbas_msgs_py import tables, topics
from gbas_msgs_py.modes import L1_100
from gbas_msgs_py.records import IntegrityEpoch, SolutionEpoch

pytestmark = pytest.mark.ros

MONITOR = "gbas_ground.nodes.integrity_monitor"
BROADCAST = "gbas_ground.nodes.correction_broadcast"
POSITIONING = "gbas_airborne.nodes.positioning"
PROTECTION = "gbas_airborne.nodes.protection_level"
REPLAY = "gbas_ground.nodes.receiver_replay"
STATION = {
    "station": {"id": "TEST", "gcid": 1, "latitude_deg": 41.3889, "longitude_deg": 2.112, "height_m": 166.0},
    "receivers": {
        "rr1_ecef_m": [4789013.0077, 176610.1555, 4195034.8091],
        "rr2_ecef_m": [4789031.3107, 176583.4025, 4195015.1106],
    },
}
ALONE = {"start_wait_s": 0.0}
"""No reader is waited for: the node under test is the whole chain."""


def with_station(section: str, **changes: Any) -> dict[str, Any]:
    return {"ground": {**STATION, section: {**STATION.get(section, {}), **changes}}}


def flat(parameters: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Nested parameters as ROS names them."""
    for name, value in parameters.items():
        if isinstance(value, dict):
            yield from flat(value, f"{prefix}{name}.")
        else:
            yield prefix + name, value


@pytest.mark.parametrize(
    ("node", "parameters", "complaint"),
    [
        (IntegrityMonitor, {}, "no station: give its file"),
        (
            IntegrityMonitor,
            {"ground": STATION, "join_timeout_s": -1.0},
            "join_timeout_s = -1 is not within 0.001",
        ),
        (IntegrityMonitor, {"ground": STATION, "join_timeout_s": "soon"}, "join_timeout_s = 'soon' is not a number"),
        (IntegrityMonitor, {"ground": STATION, "recorders": 1.5}, "recorders = 1.5 is not a whole number"),
        (IntegrityMonitor, {"config": "missing.yaml"}, "missing.yaml: cannot be read"),
        (IntegrityMonitor, with_station("station", latitude_deg=91.0), "station.latitude_deg"),
        (CorrectionBroadcast, with_station("vdb", slots="Z"), "vdb.slots"),
        (CorrectionBroadcast, with_station("vdb", slot="A"), "vdb.slot"),
        (Positioning, {"airborne": {"aad": "C"}}, "airborne.aad = 'C' is not one of 'A', 'B'"),
        (Positioning, {"airborne": {"settle": 3.0}}, "airborne.settle is unknown; did you mean 'settle_s'?"),
        (ProtectionLevel, {"silence_s": 0.0}, "silence_s = 0 is not within 0.001 to 3600 s"),
        (ProtectionLevel, {"airborne": {"protection_probability": 1.0}}, "protection_probability"),
        (ReceiverReplay, {}, "ground_files is missing (observation files"),
        (
            ReceiverReplay,
            {"ground_files": ["a.obs"], "nav_files": ["b.nav"], "speed": -1.0},
            "speed = -1 is not",
        ),
        (ReceiverReplay, {"ground_files": ["a.obs"], "nav_files": ["b.nav"]}, "a.obs"),
    ],
)
def test_bad_parameters_are_refused_by_name(probe: Any, node: Any, parameters: dict[str, Any], complaint: str) -> None:
    overrides = [RclpyParameter(name, value=value) for name, value in flat(parameters)]
    with pytest.raises((ValueError, OSError)) as told:
        node(context=probe.context, parameter_overrides=overrides)
    assert complaint in str(told.value)
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("module", "parameters", "complaint"),
    [
        (
            MONITOR,
            {"ground": STATION, "join_timeut_s": 1.0},
            "'join_timeut_s' is unknown; did you mean 'join_timeout_s'",
        ),
        (REPLAY, {"ground_files": ["a.obs"], "nav_files": ["b.nav"]}, "a.obs"),
    ],
)
def test_bad_parameters_end_the_start_with_one_line(
    launcher: Any, module: str, parameters: dict[str, Any], complaint: str
) -> None:
    process = launcher.start(module, parameters)
    assert process.wait(60.0) == 2, process.output
    assert complaint in process.output
    assert len(process.output.strip().splitlines()) == 1, process.output
    assert process.output.startswith(module.rpartition(".")[2]), "the line begins with the program's name"


def test_a_file_that_is_not_yaml_is_named(launcher: Any, tmp_path: Path) -> None:
    for number, text in enumerate(("ground: [1, 2", "other: 1", "ground: 5")):
        path = tmp_path / f"bad{number}.yaml"
        path.write_text(text)
        process = launcher.start(MONITOR, {"config": str(path)})
        assert process.wait(60.0) == 2
        assert str(path) in process.output
        assert "Traceback" not in process.output


def test_a_broken_ros_parameter_file_ends_the_start(launcher: Any, tmp_path: Path) -> None:
    path = tmp_path / "broken.yaml"
    path.write_text("/**:\n  ros__parameters:\n    speed: [1, \n")
    process = launcher.start(PROTECTION, ros_args=("--params-file", str(path)))
    assert process.wait(60.0) == 2
    assert "broken.yaml" in process.output
    assert "Traceback" not in process.output


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_publishes_what_is_pending_and_ends_in_order(launcher: Any, probe: Any, number: int) -> None:
    """An epoch that still waits for a receiver is processed without it; exit code 0, no traceback."""
    integrity, status = probe.listen(topics.GROUND_INTEGRITY), probe.diagnostics()
    process = launcher.start(MONITOR, {"ground": STATION, "join_timeout_s": 3600.0, **ALONE})
    for tow_s in (10.0, 10.5):
        probe.send(topics.GROUND_OBSERVATIONS[0], tables.OBSERVATIONS, ObservationEpoch(gps_week=2300, tow_s=tow_s))
    probe.until(lambda: status.get("integrity_monitor", (0, "", {}))[2].get("epochs_waiting") == "2", "two epochs wait")
    assert integrity == []
    process.send_signal(number)
    assert process.wait() == 0, process.output
    probe.until(lambda: len(integrity) == 2, "the pending epochs")
    assert [each.tow_s for each in integrity] == [10.0, 10.5]
    assert "Traceback" not in process.output
    probe.until(lambda: status["integrity_monitor"][1] == "ended", "the last status")


def test_signal_during_the_start_ends_the_program(launcher: Any, probe: Any) -> None:
    process = launcher.start(PROTECTION)
    process.end(
        signal.SIGINT
    )  # until the node has taken over, Python may end by the signal or by an interrupted import
    assert not process.running


SIGNALLED_EARLY = """
import os, signal, time
from gbas_node.node import GbasNode
from gbas_node.serving import serve

class Early(GbasNode):
    def __init__(self):
        super().__init__("early")
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.3)  # the signal is taken by a thread

    def finish(self):
        print("finished", flush=True)

raise SystemExit(serve([Early]))
"""


def test_signal_while_a_node_is_made_ends_it_in_order(domain: int) -> None:
    """What it has received by then is not lost: a recorder reads before it is complete."""
    done = subprocess.run(
        [sys.executable, "-c", SIGNALLED_EARLY],
        env=process_environment(domain=domain, isolated=True), capture_output=True, text=True, timeout=60.0,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, "finished\n"), done.stderr


def test_parameters_are_visible_with_their_values_and_read_only(launcher: Any, probe: Any) -> None:
    launcher.start(MONITOR, {"ground": STATION, "join_timeout_s": 7})
    names = [
        "join_timeout_s",
        "start_wait_s",
        "ground.station.id",
        "ground.b_value.k_b",
        "ground.receivers.rr2_ecef_m",
    ]
    request = GetParameters.Request(names=names)
    values = probe.ask(GetParameters, "/gbas/integrity_monitor/get_parameters", request).values
    assert [v.double_value for v in values[:2]] == [7.0, 10.0]
    assert values[2].string_value == "TEST"
    assert values[3].double_value == 5.5  # the default of the dataclass
    assert list(values[4].double_array_value) == STATION["receivers"]["rr2_ecef_m"]

    value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=1.0)
    request = SetParameters.Request(parameters=[Parameter(name="join_timeout_s", value=value)])
    assert not probe.ask(SetParameters, "/gbas/integrity_monitor/set_parameters", request).results[0].successful


def test_configuration_file_with_parameters_over_it(launcher: Any, probe: Any, tmp_path: Path) -> None:
    path = tmp_path / "receiver.yaml"
    path.write_text("airborne:\n  settle_s: 50.0\n  rpds: 3\n")
    launcher.start(PROTECTION, {"config": str(path), "airborne": {"rpds": 5}})
    request = GetParameters.Request(names=["airborne.settle_s", "airborne.rpds"])
    values = probe.ask(GetParameters, "/gbas/protection_level/get_parameters", request).values
    assert values[0].double_value == 50.0
    assert values[1].integer_value == 5


def qos_seen(probe: Any, topic: str, what: str) -> Any:
    ask = getattr(probe.node, f"get_{what}_info_by_topic")
    probe.until(lambda: ask(topic), f"{what} of {topic}")
    return ask(topic)[0].qos_profile


def test_quality_of_service_on_the_wire(launcher: Any, probe: Any) -> None:
    launcher.start(MONITOR, {"ground": STATION})
    data = qos_seen(probe, "/gbas/ground/integrity", "publishers")
    assert (data.reliability, data.durability) == (ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE)
    latched = qos_seen(probe, "/gbas/schemas", "publishers")
    assert (latched.reliability, latched.durability) == (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL)
    ephemeris = qos_seen(probe, "/gbas/ephemeris", "subscriptions")
    assert ephemeris.durability == DurabilityPolicy.TRANSIENT_LOCAL


def test_quality_of_service_can_be_overridden(launcher: Any, probe: Any) -> None:
    override = {"/gbas/ground/integrity": {"publisher": {"reliability": "best_effort"}}}
    launcher.start(MONITOR, {"ground": STATION, "qos_overrides": override})
    assert qos_seen(probe, "/gbas/ground/integrity", "publishers").reliability == ReliabilityPolicy.BEST_EFFORT


def test_override_of_a_topic_that_is_not_there_is_refused(launcher: Any) -> None:
    override = {"/gbas/ground/integrty": {"publisher": {"depth": 5}}}
    process = launcher.start(MONITOR, {"ground": STATION, "qos_overrides": override})
    assert process.wait(60.0) == 2
    assert "did you mean 'qos_overrides./gbas/ground/integrity.publisher.depth'?" in process.output


def test_schemas_are_there_for_who_comes_late(launcher: Any, probe: Any) -> None:
    launcher.start(MONITOR, {"ground": STATION})
    probe.until(lambda: probe.node.count_publishers("/gbas/schemas"), "the node")
    heard = probe.listen(topics.SCHEMAS, String)
    probe.until(lambda: heard, "the dictionary")
    assert heard[0].data == tables.schema_dictionary()


def test_second_aircraft_is_a_second_namespace(launcher: Any, probe: Any) -> None:
    """Its own topics move with it; the station's radio, ephemerides and events are shared."""
    first, second = probe.listen("airborne/protection_levels"), probe.listen("/gbas/two/airborne/protection_levels")
    launcher.start(PROTECTION, ALONE)
    launcher.start(PROTECTION, ALONE, ("-r", "__ns:=/gbas/two"))
    probe.send(
        "/gbas/two/airborne/solution", tables.SOLUTION, SolutionEpoch(gps_week=2300, tow_s=2.0, mode=L1_100.number)
    )
    probe.send("airborne/solution", tables.SOLUTION, SolutionEpoch(gps_week=2300, tow_s=1.0, mode=L1_100.number))
    probe.until(lambda: first and second, "protection levels of both")
    assert ([each.tow_s for each in first], [each.tow_s for each in second]) == ([1.0], [2.0])

    launcher.start(POSITIONING, ros_args=("-r", "__ns:=/gbas/two"))
    probe.until(lambda: probe.node.count_subscribers("/gbas/vdb"), "a reader of the shared radio")
    probe.until(lambda: probe.node.count_subscribers("/gbas/two/airborne/observations"), "a reader of its own receiver")
    probe.until(lambda: probe.node.count_publishers("/gbas/two/progress/protection_level"), "its own progress")
    assert not probe.node.count_subscribers("/gbas/two/vdb")


def test_topics_can_be_remapped(launcher: Any, probe: Any) -> None:
    launcher.start(BROADCAST, {"ground": STATION, **ALONE}, ("-r", "/gbas/vdb:=/north/vdb"))
    probe.until(lambda: probe.node.count_publishers("/north/vdb"), "the remapped radio")


def test_first_epoch_waits_for_its_reader(launcher: Any, probe: Any) -> None:
    """Nothing is sent into the void: the frame is there for a reader that appears later."""
    status = probe.diagnostics()
    launcher.start(BROADCAST, {"ground": STATION, "start_wait_s": 3600.0})
    probe.send(topics.GROUND_INTEGRITY, tables.INTEGRITY, IntegrityEpoch(gps_week=2300, tow_s=1.0))
    waiting = "waiting: /gbas/vdb has 0 of 1 readers"
    probe.until(lambda: status.get("correction_broadcast", (0, ""))[1] == waiting, "the node says that it waits")
    bursts = probe.bursts()
    probe.until(lambda: bursts, "the first frame")
    assert bursts[0].tow_s == 1.0


def test_without_readers_it_goes_on_after_a_time_and_says_so(launcher: Any, probe: Any) -> None:
    status = probe.diagnostics()
    launcher.start(BROADCAST, {"ground": STATION, "start_wait_s": 0.5})
    probe.send(topics.GROUND_INTEGRITY, tables.INTEGRITY, IntegrityEpoch(gps_week=2300, tow_s=1.0))
    probe.until(lambda: status.get("correction_broadcast", (0, "", {}))[2].get("epochs") == "1", "the epoch")
    assert "/gbas/vdb has 0 of 1 readers" in status["correction_broadcast"][2]["last_problem"]

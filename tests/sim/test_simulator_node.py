"""The simulator node: every epoch of its world on the topics, in order, with nothing lost at any speed."""

from __future__ import annotations

import time

import numpy as np
import pytest
import yaml

rclpy = pytest.importorskip("rclpy")

from bag_fixtures import isolated_domain  # noqa: E402
from gbas_bringup.environment import process_environment  # noqa: E402
from gbas_core.gnss.gpstime import epoch_key  # noqa: E402
from gbas_core.gnss.observations import ObservationEpoch  # noqa: E402
from gbas_msgs_py import tables, topics  # noqa: E402
from gbas_node.node import GbasNode  # noqa: E402
from gbas_sim.nodes.simulator import Simulator  # noqa: E402
from gbas_sim.scenario import scenario_from_mapping  # noqa: E402
from gbas_sim.world import World  # noqa: E402
from started_nodes import LoggedNode  # noqa: E402

pytestmark = pytest.mark.ros

SITE = {
    "ground": {
        "receivers": {
            "rr1_ecef_m": [3840619.039, 715604.228, 5024909.863],
            "rr2_ecef_m": [3840835.113, 714861.969, 5024848.587],
        },
        "approaches": {
            "rwy26": {
                "ltp_latitude_deg": 52.3209, "ltp_longitude_deg": 10.567, "ltp_height_m": 133.0, "course_deg": 264.73,
                "fpap_distance_m": 2300.0, "tch_m": 15.0, "gpa_deg": 3.0, "fasval_m": 10.0, "faslal_m": 40.0,
            }
        },
    },
    "sim": {"seed": 5, "flight": {"level_time_s": 0.0, "intercept_distance_m": 2000.0}},
}  # fmt: skip


class Collector(GbasNode):
    """Keeps what the simulator sends and reports progress as the chain's last node would."""

    def __init__(self, **kwargs):
        super().__init__("collector", **kwargs)
        self.got = {}
        for topic, schema in (
            (topics.EPHEMERIS, tables.EPHEMERIS),
            (topics.GROUND_OBSERVATIONS[0], tables.OBSERVATIONS),
            (topics.GROUND_OBSERVATIONS[1], tables.OBSERVATIONS),
            (topics.TRUTH_AIRBORNE, tables.TRUTH),
            (topics.AIRBORNE_OBSERVATIONS, tables.OBSERVATIONS),
        ):
            self.got[topic] = []
            self.table_subscription(topic, schema, lambda record, topic=topic: self.keep(topic, record))

    def keep(self, topic, record):
        self.got[topic].append(record)
        if topic == topics.AIRBORNE_OBSERVATIONS:
            self.finished_epoch(record.gps_week, record.tow_s)


@pytest.fixture(scope="module")
def site_domain():
    """A domain for the module: nothing else runs in it, and it keeps to this machine."""
    with isolated_domain() as number:
        yield number


@pytest.fixture(scope="module")
def sent(tmp_path_factory, site_domain):
    """Everything sent in a short flight, by topic."""
    file = tmp_path_factory.mktemp("sim") / "site.yaml"
    file.write_text(yaml.safe_dump({"/**": {"ros__parameters": SITE}}))
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=site_domain)
    values = {"config": str(file), "speed": 0.0, "wait_for": ["collector"], "wait_for_ground": ["collector"]}
    overrides = [rclpy.Parameter(name, value=value) for name, value in {**values, "sim.systems": "G"}.items()]
    simulator = Simulator(context=context, parameter_overrides=overrides)
    collector = Collector(context=context)
    executor = rclpy.executors.SingleThreadedExecutor(context=context)
    for node in (simulator, collector):
        executor.add_node(node)
    deadline = time.monotonic() + 60.0
    while simulator.exit_code is None and time.monotonic() < deadline:
        executor.spin_once(timeout_sec=0.01)
        for node in (simulator, collector):
            node.poll(True)
    shown = simulator.get_parameter("sim.flight.speed_mps").value
    exit_code = simulator.exit_code
    executor.shutdown()
    for node in (simulator, collector):
        node.close(orderly=False)
    rclpy.shutdown(context=context)
    assert exit_code == 0
    assert shown == 70.0
    return collector.got


@pytest.fixture(scope="module")
def world():
    return World(scenario_from_mapping({**SITE, "sim.systems": "G"}))


def test_nothing_is_lost_and_everything_is_in_order(sent, world):
    expected = [epoch.key for epoch in world]
    assert len(expected) > 50
    for topic, records in sent.items():
        keys = [epoch_key(record.gps_week, record.tow_s) for record in records]
        assert keys == (expected if topic != topics.EPHEMERIS else [expected[0] - 3_600_000]), topic


def test_what_arrives_is_what_the_world_made(sent, world):
    def same(arrived: ObservationEpoch, made: ObservationEpoch) -> None:
        assert arrived.simulated == 1.0
        for name in ("code_m", "carrier_m", "doppler_hz", "cn0_dbhz", "lli"):
            np.testing.assert_array_equal(getattr(arrived, name), getattr(made, name))

    for number, made in enumerate(world):
        same(sent[topics.GROUND_OBSERVATIONS[0]][number], made.ground[0])
        same(sent[topics.GROUND_OBSERVATIONS[1]][number], made.ground[1])
        same(sent[topics.AIRBORNE_OBSERVATIONS][number], made.airborne)
        truth = sent[topics.TRUTH_AIRBORNE][number]
        np.testing.assert_array_equal([truth.x_m, truth.y_m, truth.z_m], made.truth.position_m)
        np.testing.assert_array_equal([truth.vx_mps, truth.vy_mps, truth.vz_mps], made.truth.velocity_mps)
        attitude = [made.truth.roll_rad, made.truth.pitch_rad, made.truth.heading_rad]
        np.testing.assert_array_equal([truth.roll_rad, truth.pitch_rad, truth.heading_rad], attitude)
        assert np.isfinite(attitude).all()
    np.testing.assert_array_equal(sent[topics.EPHEMERIS][0].af0_s, world.ephemeris.af0_s)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "section 'ground' is missing"),
        (["-p", "config:=nowhere.yaml"], "nowhere.yaml: cannot be read"),
        (["-p", "sim.seeed:=1"], "sim.seeed is unknown"),
        (["-p", "speeed:=1.0"], "did you mean 'speed'"),
    ],
)
def test_bad_parameters_end_the_program_with_one_line(tmp_path, domain, arguments, message):
    if arguments and "nowhere" not in arguments[1]:
        file = tmp_path / "site.yaml"
        file.write_text(yaml.safe_dump(SITE))
        arguments = ["-p", f"config:={file}", *arguments]
    environment = process_environment(domain=domain, isolated=True)
    node = LoggedNode("gbas_sim.nodes.simulator", ["--ros-args", *arguments], environment, tmp_path / "log")
    code, output = node.end()
    assert code == 2
    assert message in output
    assert len([line for line in output.splitlines() if line.startswith("simulator:")]) == 1
    assert "Traceback" not in output

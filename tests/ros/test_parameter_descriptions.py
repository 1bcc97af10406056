"""What ``ros2 param describe`` shows of running nodes: text with unit, range, and in words what has no range in ROS."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Annotated, Any, Literal

import pytest
from rcl_interfaces.msg import ParameterDescriptor, ParameterType
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters
from rclpy.parameter import Parameter as RclpyParameter

from gbas_airborne.nodes.positioning import Positioning
from gbas_core.parameters import Parameter, declared, parameters
from gbas_ground.nodes.receiver_replay import ReceiverReplayParams
from gbas_node.descriptors import descriptor_of
from gbas_node.driver import DriverNode

pytestmark = pytest.mark.ros

Answers = Callable[[type, str, Any], Any]


@pytest.fixture
def positioning(probe: Any) -> Iterator[Answers]:
    """Answers of the parameter services of a running node, whose parameters ROS gave."""
    overrides = [
        RclpyParameter("join_timeout_s", value=2),  # a whole number where a float is declared
        RclpyParameter("airborne.elevation_mask_deg", value=7.5),
        RclpyParameter("airborne.rpds", value=5),
    ]
    node = Positioning(context=probe.context, parameter_overrides=overrides)
    probe._executor.add_node(node)
    yield lambda kind, name, request: probe.ask(kind, f"/gbas/positioning/{name}", request)
    node.destroy_node()


def described(ask: Answers, *names: str) -> list[ParameterDescriptor]:
    request = DescribeParameters.Request(names=list(names))
    found: list[ParameterDescriptor] = ask(DescribeParameters, "describe_parameters", request).descriptors
    assert [each.name for each in found] == list(names)
    return found


def test_a_running_node_describes_its_parameters(positioning: Answers) -> None:
    mask, rpds, aad, unhealthy, timeout = described(
        positioning, "airborne.elevation_mask_deg", "airborne.rpds", "airborne.aad", "airborne.use_unhealthy",
        "join_timeout_s",
    )  # fmt: skip
    assert mask.description == "satellites below are not used; not below the 5 degrees of the standard [deg]"
    assert (mask.floating_point_range[0].from_value, mask.floating_point_range[0].to_value) == (5.0, 45.0)
    assert mask.floating_point_range[0].step == 0.0
    assert (rpds.integer_range[0].from_value, rpds.integer_range[0].to_value, rpds.integer_range[0].step) == (-1, 48, 1)
    assert aad.additional_constraints == "one of 'A', 'B'"
    assert not [*unhealthy.floating_point_range, *unhealthy.integer_range, *unhealthy.additional_constraints]
    assert timeout.floating_point_range[0].to_value == 3600.0
    assert timeout.description.endswith(" [s]")
    assert all(each.read_only for each in (mask, rpds, aad, unhealthy, timeout))


def test_values_are_those_of_a_file(positioning: Answers) -> None:
    names = ["airborne.elevation_mask_deg", "airborne.rpds", "join_timeout_s", "airborne.systems"]
    mask, rpds, timeout, systems = positioning(
        GetParameters, "get_parameters", GetParameters.Request(names=names)
    ).values
    assert (mask.double_value, rpds.integer_value, systems.string_value) == (7.5, 5, "GE")
    assert (timeout.type, timeout.double_value) == (ParameterType.PARAMETER_DOUBLE, 2.0)


def test_every_parameter_of_the_suite_has_a_description(positioning: Answers) -> None:
    listed = positioning(ListParameters, "list_parameters", ListParameters.Request()).result.names
    own = [name for name in listed if not name.startswith(("qos_overrides.", "use_sim_time", "start_type_"))]
    assert {"airborne.k_ffmd_single", "start_wait_s", "config"} <= set(own)
    assert all(each.description for each in described(positioning, *own))


@parameters
class Odd:
    """What ROS has no field for."""

    nodes_rad: Annotated[tuple[float, ...], Parameter("nodes", "deg", 0.0, 90.0)] = ()
    wait_s: Annotated[float, Parameter("wait", "s", 0.0)] = 0.0
    most: Annotated[int | None, Parameter("most", "-", 1, 9)] = None
    forms: Annotated[tuple[Literal["a", "b"], ...], Parameter("forms")] = ()
    limit_m: Annotated[float | None, Parameter("limit", "m", None, 9.0)] = None


def test_what_has_no_range_in_ros_is_said_in_words() -> None:
    found = {each.key: descriptor_of(each) for each in declared(Odd())}
    words = {key: each.additional_constraints for key, each in found.items()}
    assert words == {
        "nodes_deg": "each within 0 to 90 deg",
        "wait_s": "0 s or more",
        "most": "within 1 to 9; may be left out",
        "forms": "one of 'a', 'b'",
        "limit_m": "9 m or less; may be left out",
    }
    assert not any(each.floating_point_range or each.integer_range for each in found.values())


class Driver(DriverNode[Any]):
    """A driver of nothing."""

    params_type = ReceiverReplayParams

    def flies(self) -> bool:
        return bool(self.params.user_file)


def test_lists_and_empty_lists_come_as_given(probe: Any) -> None:
    values: dict[str, Any] = {
        "ground_files": ["a.obs"], "nav_files": ["n.nav"], "wait_for_ground": [""], "wait_for": ["one", "two"],
    }  # fmt: skip
    overrides = [RclpyParameter(name, value=value) for name, value in values.items()]
    overrides.append(RclpyParameter("user_nav_files", RclpyParameter.Type.NOT_SET))  # as ROS reads [] from a file
    node = Driver("driver", context=probe.context, parameter_overrides=overrides)
    try:
        assert (node.params.ground_files, node.params.wait_for_ground) == (("a.obs",), ())
        assert (node.params.wait_for, node.params.user_nav_files) == (("one", "two"), ())
        assert node.readers == ()
        assert node.get_parameter("wait_for_ground").value == [""]
    finally:
        node.destroy_node()

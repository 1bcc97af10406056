"""Parameters that nodes have beside those of their subject."""

from __future__ import annotations

from typing import Annotated, Final

from gbas_core.parameters import Parameter, parameters

_LEAST_S: Final = 1e-3
_MOST_S: Final = 3600.0

StartWait = Annotated[
    float,
    Parameter(
        "the first epoch is held until every output has its readers and every input was heard, at most this long",
        "s", 0.0, _MOST_S,
    ),
]  # fmt: skip


@parameters
class NodeParams:
    """Parameters every node has."""

    start_wait_s: StartWait = 10.0
    recorders: Annotated[
        int,
        Parameter(
            "readers on each output beside those of the chain, such as a recorder, waited for at the start", "-", 0, 100
        ),
    ] = 0
    silence_s: Annotated[
        float, Parameter("after this long without input the diagnostics report an error", "s", _LEAST_S, _MOST_S)
    ] = 3.0


@parameters
class ConfiguredParams(NodeParams):
    """Parameters of a node whose subject is configured in a file and in ROS parameters over it."""

    config: Annotated[
        str, Parameter("configuration file; ROS parameters count more; empty: everything is in ROS parameters")
    ] = ""


@parameters
class JoiningParams(ConfiguredParams):
    """Parameters of a node that joins several inputs by epoch."""

    join_timeout_s: Annotated[
        float,
        Parameter(
            "an epoch is processed without what is still missing this long after its first part arrived",
            "s", _LEAST_S, _MOST_S,
        ),
    ] = 1.0  # fmt: skip


@parameters
class DriverParams(NodeParams):
    """Parameters every driver of time has."""

    start_wait_s: StartWait = 20.0
    speed: Annotated[
        float, Parameter("multiple of real time; 0: as fast as the readers go", "times real time", 0.0, 1e6)
    ] = 1.0
    # With more of them each node does several at a time (16 are up to half as fast again as 8); above 16, the depth of
    # its queue, /clock may lose messages.
    window_epochs: Annotated[
        int, Parameter("most epochs sent that some reader has not finished with", "epochs", 1, 100)
    ] = 16
    wait_for: Annotated[
        tuple[str, ...],
        Parameter("readers that report on every epoch with airborne observations: node names, or full names of topics"),
    ] = ("protection_level",)
    wait_for_ground: Annotated[tuple[str, ...], Parameter("readers that report on every epoch")] = (
        "correction_broadcast",
    )
    stall_s: Annotated[
        float, Parameter("give up when no reader makes progress for this long", "s", _LEAST_S, _MOST_S)
    ] = 60.0

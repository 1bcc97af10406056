"""Threats of a world that would do nothing are refused: receivers that are not there, satellites that are not up."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gbas_core.satellites import SAT_INDEX
from gbas_sim.atmosphere.fronts import WedgeFront
from gbas_sim.faults.kinds import ReceiverFault
from gbas_sim.world_params import WorldParams

AboveMasks = Callable[[int], NDArray[np.bool_]]
"""Satellites above the receivers' masks at an epoch, ``(R, N_SATS)``, by its number."""


def check_threats(params: WorldParams, above_masks: AboveMasks) -> None:
    """Refuse what concerns a receiver that is not there, or a satellite that no receiver sees while it lasts.

    Raises
    ------
    ValueError
        Naming the threat and the receiver or satellite.
    """
    for fault in params.faults:
        names = (fault.receiver,) if isinstance(fault, ReceiverFault) else getattr(fault, "receivers", ())
        for name in names:
            if name not in params.receiver_names:
                there = ", ".join(params.receiver_names)
                raise ValueError(f"{fault.owner}: receiver {name!r} is not there; there are {there}")
        satellites = fault.satellites if isinstance(fault, ReceiverFault) else (fault.satellite,)
        for satellite in satellites:
            _check_up(params, above_masks, fault.owner, satellite, (fault.start_s, fault.end_s))
    for front in params.fronts:
        for satellite in front.satellites:
            _check_up(
                params, above_masks, "front" if isinstance(front, WedgeFront) else "bubble", satellite, (0.0, math.inf)
            )


def _check_up(
    params: WorldParams, above_masks: AboveMasks, owner: str, satellite: str, span_s: tuple[float, float]
) -> None:
    """Refuse a satellite that no receiver tracks at any of some forty times of a fault."""
    index, (start_s, end_s) = SAT_INDEX[satellite], span_s
    first = math.ceil(max(start_s, 0.0) / params.interval_s)
    last = min(params.n_epochs - 1, math.floor(min(end_s, params.length_s) / params.interval_s))
    if first > last:
        raise ValueError(f"{owner}: start_s = {start_s:g} is after the end of the run, {params.length_s:g} s")
    for number in range(first, last + 1, max(1, (last - first) // 40)):
        if bool(above_masks(number)[:, index].any()):
            return
    raise ValueError(f"{owner}: satellite = {satellite!r} is not up between {max(start_s, 0.0):g} and "
                     f"{min(end_s, params.length_s):g} s")  # fmt: skip

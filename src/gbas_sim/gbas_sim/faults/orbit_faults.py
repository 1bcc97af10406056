"""Satellites that are not where they say: away from their orbits, or broadcasting wrong ephemerides.

Both are ephemeris faults: the first is a manoeuvre nobody was told of, the second a wrong upload. Times as in
:mod:`gbas_sim.faults.fault_base`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Final, Literal

import numpy as np

from gbas_core.gnss.ephemeris import FIELDS, Ephemeris
from gbas_core.gnss.frames import EARTH_RATE_RADPS
from gbas_core.gnss.gpstime import add_seconds, seconds_between
from gbas_core.gnss.orbits import SatelliteState
from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray
from gbas_core.satellites import IS_GPS, N_SATS
from gbas_sim.faults.fault_base import SatelliteFault

_ACROSS: Final = "across it (towards the angular momentum)"


@parameters
class OrbitFault(SatelliteFault):
    """The satellite leaves the orbit it broadcasts: constant offsets and rates along its axes, from the start on."""

    kind: Annotated[Literal["orbit"], Parameter("kind of the fault")] = "orbit"
    along_m: Annotated[float, Parameter("along the track", "m", -1e6, 1e6)] = 0.0
    cross_m: Annotated[float, Parameter(_ACROSS, "m", -1e6, 1e6)] = 0.0
    radial_m: Annotated[float, Parameter("up", "m", -1e6, 1e6)] = 0.0
    along_mps: Annotated[float, Parameter("growth along the track", "m/s", -1e3, 1e3)] = 0.0
    cross_mps: Annotated[float, Parameter(f"growth {_ACROSS}", "m/s", -1e3, 1e3)] = 0.0
    radial_mps: Annotated[float, Parameter("growth up", "m/s", -1e3, 1e3)] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        offsets = ("along", "cross", "radial")
        if all(getattr(self, f"{each}_{unit}") == 0.0 for each in offsets for unit in ("m", "mps")):
            raise ValueError(f"{self.owner}: all offsets and rates are 0: nothing would happen")


def displaced(state: SatelliteState, faults: Sequence[SatelliteFault], since_s: FloatArray) -> SatelliteState:
    """Where satellites are when some have left the orbits they broadcast.

    Parameters
    ----------
    state : SatelliteState
        As broadcast, arrays (..., 3, N_SATS) and (..., N_SATS), ECEF.
    faults : sequence of SatelliteFault
        Those of orbits count.
    since_s : (..., N_SATS) array
        Times of transmission, since the start of the run [s].

    Notes
    -----
    The axes turn with the satellite in its plane, which is taken to stand still among the stars; the velocity has their
    rates. The clock stays as it is.
    """
    of_orbits = [fault for fault in faults if isinstance(fault, OrbitFault)]
    if not of_orbits:
        return state
    position_m, velocity_mps = np.array(state.position_m), np.array(state.velocity_mps)
    for fault in of_orbits:
        axes, turning = _orbit_axes(state.position_m[..., fault.index], state.velocity_mps[..., fault.index])
        time_s = since_s[..., fault.index]
        active, since = fault.active(time_s), time_s - fault.start_s
        for axis, name in enumerate(("along", "cross", "radial")):
            rate = np.where(active, getattr(fault, f"{name}_mps"), 0.0)[..., np.newaxis]
            start = np.where(active, getattr(fault, f"{name}_m"), 0.0)[..., np.newaxis]
            offset = start + rate * since[..., np.newaxis]
            position_m[..., fault.index] += offset * axes[axis]
            velocity_mps[..., fault.index] += rate * axes[axis] + offset * turning[axis]
    return replace(state, position_m=position_m, velocity_mps=velocity_mps)


def _orbit_axes(position_m: FloatArray, velocity_mps: FloatArray) -> tuple[list[FloatArray], list[FloatArray]]:
    """Unit vectors along, across and up, ``(..., 3)``, in rotating axes, and their rates [1/s]."""
    spin = np.array([0.0, 0.0, EARTH_RATE_RADPS])
    distance = np.sqrt((position_m**2).sum(axis=-1, keepdims=True))
    up = position_m / distance
    cross = np.cross(position_m, velocity_mps + np.cross(spin, position_m))
    cross = cross / np.sqrt((cross**2).sum(axis=-1, keepdims=True))
    up_rate = (velocity_mps - up * (up * velocity_mps).sum(axis=-1, keepdims=True)) / distance
    cross_rate = -np.cross(spin, cross)
    along_rate = np.cross(cross_rate, up) + np.cross(cross, up_rate)
    return [np.cross(cross, up), cross, up], [along_rate, cross_rate, up_rate]


BROADCAST_FIELDS: Final = (
    "sqrt_a", "e", "m0_rad", "delta_n_radps", "omega0_rad", "i0_rad", "omega_rad", "omega_dot_radps", "idot_radps",
    "cuc_rad", "cus_rad", "crc_m", "crs_m", "cic_rad", "cis_rad", "af0_s", "af1_sps", "group_delay_s",
)  # fmt: skip
"""Fields of an ephemeris a :class:`BroadcastFault` may change."""


@parameters
class BroadcastFault(SatelliteFault):
    """The satellite broadcasts a wrong value in a new ephemeris, while it stays where it was."""

    kind: Annotated[Literal["broadcast"], Parameter("kind of the fault")] = "broadcast"
    field: Annotated[str, Parameter("field of the ephemeris", choices=BROADCAST_FIELDS)]
    change: Annotated[float, Parameter("added to the field, in its unit", "-", -1e9, 1e9)]

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.change == 0.0:
            raise ValueError(f"{self.owner}: change is 0: nothing would happen")


def with_wrong_broadcasts(
    received: tuple[Ephemeris, ...], faults: Sequence[SatelliteFault], gps_week: int, tow_s: float
) -> tuple[Ephemeris, ...]:
    """What is broadcast, with wrong ephemerides from the start of each fault and right ones from its end.

    Parameters
    ----------
    received : tuple of Ephemeris
        In order of reception.
    faults : sequence of SatelliteFault
        Those of broadcasts count.
    gps_week, tow_s
        Start of the run.

    Returns
    -------
    tuple of Ephemeris
        In order of reception. An upload at the start, and one at the end, has its own issue of data; regular ones in
        between are wrong as well.

    Raises
    ------
    ValueError
        When nothing was received of the satellite before its fault.
    """
    for fault in faults:
        if isinstance(fault, BroadcastFault):
            received = _with_wrong_broadcast(received, fault, gps_week, tow_s)
    return received


def _with_wrong_broadcast(
    received: tuple[Ephemeris, ...], fault: BroadcastFault, gps_week: int, tow_s: float
) -> tuple[Ephemeris, ...]:
    def since(ephemeris: Ephemeris) -> float:
        return seconds_between(gps_week, tow_s, ephemeris.gps_week, ephemeris.tow_s)

    def latest(until_s: float) -> Ephemeris:
        there = [each for each in received if since(each) <= until_s and np.isfinite(each.message[fault.index])]
        if not there:
            raise ValueError(f"fault broadcast: no ephemeris of {fault.satellite} was received before {until_s:g} s")
        return there[-1]

    def upload(time_s: float, issue_step: int, change: float) -> Ephemeris:
        week, tow = add_seconds(gps_week, tow_s, time_s)
        alone = _only(latest(time_s), fault.index)
        return _changed(replace(alone, gps_week=week, tow_s=tow), fault, change, issue_step)

    uploads = [upload(fault.start_s, 128, fault.change)]
    if math.isfinite(fault.end_s):
        uploads.append(upload(fault.end_s, 64, 0.0))
    regular = [
        _changed(each, fault, fault.change, 0) if fault.start_s < since(each) < fault.end_s else each
        for each in received
    ]
    return tuple(sorted([*regular, *uploads], key=since))


def _only(ephemeris: Ephemeris, index: int) -> Ephemeris:
    """The ephemeris of one satellite alone."""
    place = np.arange(N_SATS) == index
    values = {name: np.where(place, getattr(ephemeris, name), np.nan) for name in FIELDS}
    return Ephemeris(gps_week=ephemeris.gps_week, tow_s=ephemeris.tow_s, simulated=ephemeris.simulated, **values)


def _changed(ephemeris: Ephemeris, fault: BroadcastFault, change: float, issue_step: int) -> Ephemeris:
    """An ephemeris with the faulty field changed, and another issue of data."""
    place = np.arange(N_SATS) == fault.index
    size = np.where(IS_GPS, 256.0, 1024.0)
    iod = np.where(place, np.mod(ephemeris.iod + issue_step, size), ephemeris.iod)
    iodc = np.where(place, 256.0 * np.floor(ephemeris.iodc / 256.0) + iod, ephemeris.iodc)
    values = {name: getattr(ephemeris, name) for name in FIELDS} | {"iod": iod, "iodc": iodc}
    values[fault.field] = np.where(place, values[fault.field] + change, values[fault.field])
    return Ephemeris(gps_week=ephemeris.gps_week, tow_s=ephemeris.tow_s, simulated=ephemeris.simulated, **values)

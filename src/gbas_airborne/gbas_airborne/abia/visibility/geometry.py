"""Dilution of precision of satellites in view, many instants at once, and the errors estimated from it.

Source: Kaplan and Hegarty, Understanding GPS, 2nd edition (2006), 7.3; Sabatini, Moore, Hill, WASET 7 (2013), eq (37).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import CLOCK_GROUPS

_WORST: Final = 1e4
"""Dilutions beyond this are no position: the geometry is as good as singular."""


class Dilution(NamedTuple):
    """Dilutions ``(...)`` [-], NaN where there is no position, and the number of satellites."""

    pdop: FloatArray
    hdop: FloatArray
    vdop: FloatArray
    satellites: FloatArray


def dilution(los_enu: FloatArray, used: BoolArray, clock_groups: BoolArray = CLOCK_GROUPS) -> Dilution:
    """Dilution of the satellites used.

    Parameters
    ----------
    los_enu : (..., 3, N) array
        Unit vectors to satellites, east, north, up.
    used : (..., N) bool array
    clock_groups : (k, N) bool array
        Satellites that share a receiver clock; a group of which none is used has none.
    """
    usable = used & np.isfinite(los_enu).all(axis=-2) & clock_groups.any(axis=0)
    count = usable.sum(axis=-1)
    design = np.concatenate(
        [
            np.where(usable[..., np.newaxis, :], -los_enu, 0.0),
            (usable[..., np.newaxis, :] & clock_groups).astype(np.float64),
        ],
        axis=-2,
    )
    normal = design @ np.swapaxes(design, -1, -2)
    groups = (usable[..., np.newaxis, :] & clock_groups).any(axis=-1)
    # A clock without satellites is an unknown with an equation of its own.
    spare = np.concatenate([np.zeros((*groups.shape[:-1], 3), dtype=bool), ~groups], axis=-1)
    normal = normal + np.eye(normal.shape[-1]) * spare[..., np.newaxis, :]
    enough = count >= 3 + groups.sum(axis=-1)
    normal = np.where(enough[..., np.newaxis, np.newaxis], normal, np.eye(normal.shape[-1]))
    regular = np.linalg.matrix_rank(normal, tol=1e-10, hermitian=True) == normal.shape[-1]
    normal = np.where(regular[..., np.newaxis, np.newaxis], normal, np.eye(normal.shape[-1]))
    variance = np.diagonal(np.linalg.inv(normal), axis1=-2, axis2=-1)[..., :3]
    there = enough & regular & (np.abs(variance).max(axis=-1) < _WORST**2)
    east, north, up = (np.where(there, variance[..., axis], np.nan) for axis in range(3))
    return Dilution(
        pdop=np.sqrt(east + north + up),
        hdop=np.sqrt(east + north),
        vdop=np.sqrt(up),
        satellites=count.astype(np.float64),
    )


class EstimatedErrors(NamedTuple):
    """One standard deviation of position, horizontal and vertical error ``(...)`` [m]; NaN without a position."""

    epe_m: FloatArray
    ehe_m: FloatArray
    eve_m: FloatArray


def estimated_errors(dilutions: Dilution, sigma_uere_m: float) -> EstimatedErrors:
    """Errors of the position with ranges of one standard deviation [m].

    Source: Sabatini et al., eq (37).
    """
    if not sigma_uere_m > 0.0:
        raise ValueError(f"sigma_uere_m = {sigma_uere_m!r} is not above 0")
    return EstimatedErrors(*(sigma_uere_m * each for each in dilutions[:3]))

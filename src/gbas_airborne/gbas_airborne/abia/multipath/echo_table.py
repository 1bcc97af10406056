"""Worst code error by the airframe's echoes, by direction in the body frame: for every satellite at every tick.

Source: Braasch, in Parkinson and Spilker, vol. 1 (1996), ch. 14, for echoes short against the chip.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from gbas_airborne.abia.airframe.aircraft import Antenna
from gbas_airborne.abia.airframe.mask_table import antenna_elevation_rad
from gbas_airborne.abia.airframe.mesh import Airframe
from gbas_airborne.abia.multipath.airframe_echoes import AirframeEchoes, airframe_echoes
from gbas_core.record import FloatArray
from gbas_core.signal.antenna import AntennaPattern

_CELLS: Final = (90, 45)
"""In azimuth and elevation, four degrees."""


def worst_code_error_m(echoes: AirframeEchoes, count: int) -> FloatArray:
    """Largest code error of each of `count` directions with all of its echoes at their worst phases [m].

    Of echoes short against chip and spacing the error is the mean of their delays weighted by their real amplitudes,
    the direct signal's being 1: at most ``sum(a d) / (1 - sum(a))``, whatever code and spacing. Infinite where the
    echoes together are as strong as the direct signal: the loop may follow either.
    """
    strength, moment = np.zeros(count), np.zeros(count)
    np.add.at(strength, echoes.direction, np.abs(echoes.amplitude))
    np.add.at(moment, echoes.direction, np.abs(echoes.amplitude) * echoes.delay_m)
    return np.where(strength < 1.0, moment / np.maximum(1.0 - strength, 1e-9), math.inf)


@dataclass(frozen=True, kw_only=True, eq=False)
class EchoTable:
    """Worst code error by direction.

    Attributes
    ----------
    code_error_m : (A, E) array
        In cells of equal size, as of a :class:`~gbas_airborne.abia.airframe.mask_table.MaskTable`; NaN below the
        antenna's plane [m].
    """

    code_error_m: FloatArray

    @classmethod
    def of_mesh(cls, mesh: Airframe, antenna: Antenna, pattern: AntennaPattern) -> EchoTable:
        """Table of an antenna on an airframe; some seconds, the last ones made are kept.

        Each cell has the largest of itself and its neighbours: facets send their echoes into narrow directions.

        Raises
        ------
        AirframeError
            For an antenna inside the body, or off it.
        """
        return cls(code_error_m=_errors_m(mesh, antenna, pattern))

    def at(self, azimuth_rad: ArrayLike, elevation_rad: ArrayLike) -> FloatArray:
        """Worst code error in directions of the body frame, any shape; NaN where it is not known [m]."""
        azimuth, elevation = np.broadcast_arrays(
            np.asarray(azimuth_rad, dtype=np.float64), np.asarray(elevation_rad, dtype=np.float64)
        )
        known = np.isfinite(azimuth) & (np.abs(elevation) <= 0.5 * math.pi)
        columns, rows = self.code_error_m.shape
        column = np.floor(np.where(known, azimuth, 0.0) * (columns / (2.0 * math.pi))).astype(np.intp) % columns
        row = np.minimum(((np.where(known, elevation, 0.0) / math.pi + 0.5) * rows).astype(np.intp), rows - 1)
        return np.where(known, self.code_error_m[column, row], np.nan)


@lru_cache(maxsize=8)
def _errors_m(mesh: Airframe, antenna: Antenna, pattern: AntennaPattern) -> FloatArray:
    columns, rows = _CELLS
    azimuth = np.repeat((np.arange(columns, dtype=np.float64) + 0.5) * (2.0 * math.pi / columns), rows)
    elevation = np.tile((np.arange(rows, dtype=np.float64) + 0.5) * (math.pi / rows) - 0.5 * math.pi, columns)
    above = np.flatnonzero(antenna_elevation_rad(azimuth, elevation, antenna.axis) > 0.0)
    echoes = airframe_echoes(mesh, antenna, pattern, (azimuth[above], elevation[above]))
    errors = np.full(columns * rows, np.nan)
    errors[above] = worst_code_error_m(echoes, len(above))
    table = errors.reshape(_CELLS)
    around = np.pad(np.concatenate([table[-1:], table, table[:1]]), ((0, 0), (1, 1)), constant_values=np.nan)
    shifted = [around[east : east + columns, north : north + rows] for east in range(3) for north in range(3)]
    largest = np.where(np.isnan(table), np.nan, np.fmax.reduce(shifted))
    largest.flags.writeable = False
    return largest

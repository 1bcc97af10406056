"""The second band of a station that corrects it: which products, and what their sigmas are made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from gbas_core.models.error_models import EDGE_DEG
from gbas_core.models.sigma_curves import CurveSignal, SigmaCurve, sigma_curves
from gbas_core.parameters import ParameterError
from gbas_core.record import FloatArray, IntArray
from gbas_core.satellites import N_SATS, SYSTEM_MASKS
from gbas_core.signals import L5
from gbas_msgs_py.codes import Signal
from gbas_msgs_py.products import L5_30, L5_100, PRODUCT_INDEX

if TYPE_CHECKING:
    from gbas_ground.params import GroundParams

BAND: Final = L5
SIGNAL: Final = Signal.L5
SUFFIX: Final = "/l5"
"""What subjects of events of this band end with: ``G05/l5``, ``rr2/G05/l5``."""
OF_CONSTANTS: Final = (L5_100, L5_30)
"""Its products in the order of the smoothing constants."""
_CURVE_SIGNAL: Final[CurveSignal] = "L5"
_CURVE_CONSTANTS_S: Final = (100.0, 30.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class SecondBandSettings:
    """What the second band of a station is made with.

    Attributes
    ----------
    products : (T,) int array
        Places of the products that are broadcast on the axis of :data:`~gbas_msgs_py.products.PRODUCTS`.
    constants : (T,) int array
        Places of their smoothing constants.
    steps_deg : (P, 2, N) array
        Elevations above which the pieces of the ground curves of each smoothing constant are used.
    curves : (4, P, 2, N) array
        Their a0, a1, theta0 and a2, scaled.
    min_cn0_dbhz : float
    """

    products: IntArray
    constants: IntArray
    steps_deg: FloatArray
    curves: FloatArray
    min_cn0_dbhz: float

    def sigma_parts_m(self, elevation_rad: FloatArray) -> FloatArray:
        """Own and shared part of one receiver's sigma for each smoothing constant, ``(4, N)`` [m].

        The error of M receivers is ``sqrt(own^2 / M + shared^2)``.
        """
        theta_deg = np.rad2deg(elevation_rad)
        parts = np.full((2, 2, len(theta_deg)), np.nan)
        for step_deg, a0_m, a1_m, theta0_deg, a2_m in zip(self.steps_deg, *self.curves, strict=True):
            above = theta_deg > step_deg
            parts[:, 0] = np.where(above, a0_m + a1_m * np.exp(-theta_deg / theta0_deg), parts[:, 0])
            parts[:, 1] = np.where(above, a2_m, parts[:, 1])
        return parts.reshape(4, -1)


def second_band_of(params: GroundParams) -> SecondBandSettings | None:
    """The second band of a station; None where it corrects one band only.

    Raises
    ------
    ParameterError
        When the table of curves has none for this band.
    """
    section = params.second_band
    if not section.products:
        return None
    places = sorted(PRODUCT_INDEX[name] for name in section.products)
    table, designator = sigma_curves(params.accuracy.curves), params.accuracy.designator
    chosen: dict[tuple[int, str], tuple[SigmaCurve, ...]] = {}
    for constant, smoothing_s in enumerate(_CURVE_CONSTANTS_S):
        for system in params.station.systems:
            pieces = table.pieces("ground", "all", _CURVE_SIGNAL, designator, smoothing_s, system)
            if not pieces or pieces[0].above_deg > np.rad2deg(params.monitors.elevation_mask_rad):
                raise ParameterError(
                    f"accuracy.curves = {params.accuracy.curves!r} has no ground curve of {_CURVE_SIGNAL} for "
                    f"accuracy.designator = {designator!r}, system {system}, {smoothing_s:g} s"
                )
            chosen[constant, system] = pieces
    steps_deg, curves = _coefficients(chosen)
    return SecondBandSettings(
        products=np.array(places, dtype=np.int64),
        constants=np.array([OF_CONSTANTS.index(place) for place in places], dtype=np.int64),
        steps_deg=steps_deg,
        curves=curves,
        min_cn0_dbhz=section.min_cn0_dbhz,
    )


def _coefficients(chosen: Mapping[tuple[int, str], tuple[SigmaCurve, ...]]) -> tuple[FloatArray, FloatArray]:
    """Steps ``(P, 2, N)`` and coefficients ``(4, P, 2, N)`` of pieces by smoothing constant and system.

    What a curve has fewer pieces than another never begins.
    """
    shape = max(map(len, chosen.values())), len(_CURVE_CONSTANTS_S), N_SATS
    steps_deg, curves = np.full(shape, np.inf), np.full((4, *shape), np.nan)
    for (constant, system), pieces in chosen.items():
        here = SYSTEM_MASKS[system]
        for number, piece in enumerate(pieces):
            steps_deg[number, constant, here] = piece.above_deg + EDGE_DEG if number else -np.inf
            curves[:, number, constant, here] = np.array([
                [piece.scale * piece.a0_m], [piece.scale * piece.a1_m], [piece.theta0_deg], [piece.scale * piece.a2_m]
            ])  # fmt: skip
    return steps_deg, curves

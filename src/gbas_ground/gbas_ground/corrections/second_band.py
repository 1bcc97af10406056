"""The second band of a station that corrects it: which products, and what their sigmas are made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from gbas_core.models.sigma_curves import CurveSignal, SigmaCurve, Wanted, ground_parts_m, sigma_curves
from gbas_core.parameters import ParameterError
from gbas_core.record import FloatArray, IntArray
from gbas_core.satellites import SYSTEM_MASKS
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

Pieces = tuple[SigmaCurve, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class SecondBandSettings:
    """What the second band of a station is made with.

    Attributes
    ----------
    products : (T,) int array
        Places of the products that are broadcast on the axis of :data:`~gbas_msgs_py.products.PRODUCTS`.
    constants : (T,) int array
        Places of their smoothing constants.
    curves : tuple
        Pieces of the ground curves of each smoothing constant, by system letter.
    min_cn0_dbhz : float
    """

    products: IntArray
    constants: IntArray
    curves: tuple[dict[str, Pieces], ...]
    min_cn0_dbhz: float

    def sigma_parts_m(self, elevation_rad: FloatArray, mask_rad: float) -> FloatArray:
        """Own and shared part of one receiver's sigma for each smoothing constant, ``(4, N)`` [m]."""
        parts = []
        for by_system in self.curves:
            own = np.full((2, len(elevation_rad)), np.nan)
            for system, pieces in by_system.items():
                here = SYSTEM_MASKS[system]
                own[:, here] = ground_parts_m(pieces, elevation_rad[here], mask_rad)
            parts.append(own)
        return np.concatenate(parts)


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
    curves = []
    for smoothing_s in _CURVE_CONSTANTS_S:
        by_system = {
            system: table.pieces(Wanted("ground", "all", _CURVE_SIGNAL, designator, smoothing_s, system))
            for system in params.station.systems
        }
        for system, pieces in by_system.items():
            if not pieces or pieces[0].above_deg > np.rad2deg(params.monitors.elevation_mask_rad):
                raise ParameterError(
                    f"accuracy.curves = {params.accuracy.curves!r} has no ground curve of {_CURVE_SIGNAL} for "
                    f"accuracy.designator = {designator!r}, system {system}, {smoothing_s:g} s"
                )
        curves.append(by_system)
    return SecondBandSettings(
        products=np.array(places, dtype=np.int64),
        constants=np.array([OF_CONSTANTS.index(place) for place in places], dtype=np.int64),
        curves=tuple(curves),
        min_cn0_dbhz=section.min_cn0_dbhz,
    )

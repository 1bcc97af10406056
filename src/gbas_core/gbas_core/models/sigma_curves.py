"""Ground and airborne error by signal and smoothing time constant, from one table that a file replaces.

The table (``sigma_curves.yaml`` beside this module) says of every curve where it comes from, and whether it is known,
published or a surrogate of ours. A curve that is not there is no error of zero: asking for it is refused.

Source: ICAO Annex 10 vol. I, App. B 3.6.7.1.1.1; Caamano et al., "Dual frequency dual constellation GBAS processing
modes", eq (7) to (10), figs. 1 and 2.
"""

from __future__ import annotations

from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Annotated, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.configuration import read_configuration
from gbas_core.models.error_models import (
    EDGE_DEG,
    MASK_RAD,
    AirborneAccuracy,
    AirborneCurve,
    GroundAccuracy,
    GroundCurve,
    airborne_curve_m,
    ground_curve_m,
    sigma_ionosphere_free_m,
)
from gbas_core.parameters import Numbered, Parameter, ParameterError, from_mapping, parameters
from gbas_core.record import FloatArray

CurveSignal = Literal["L1", "L5", "L1_L5"]
End = Literal["ground", "air"]
Part = Literal["all", "noise", "multipath"]
_AIR_PARTS: Final[tuple[Part, ...]] = ("noise", "multipath")


@parameters
class SigmaCurve:
    """One row of the table: ``scale * (a0 + a1 exp(-theta / theta0))``, of the ground with M receivers and a2."""

    end: Annotated[Literal["ground", "air"], Parameter("whose error")]
    part: Annotated[Literal["all", "noise", "multipath"], Parameter("of the air: which of two parts")] = "all"
    signal: Annotated[Literal["L1", "L5", "L1_L5"], Parameter("signal, or combination without ionosphere")]
    systems: Annotated[str, Parameter("satellite systems", choices=("G", "E", "GE"))] = "GE"
    designators: Annotated[str, Parameter("accuracy designators", choices=("A", "B", "C", "AB", "ABC"))] = "ABC"
    smoothing_s: Annotated[float, Parameter("time constant of the carrier smoothing", "s", 1.0, 1000.0)]
    above_deg: Annotated[float, Parameter("the curve is used above this elevation", "-", 0.0, 90.0)] = 0.0
    a0_m: Annotated[float, Parameter("at the zenith", "m", 0.0, 100.0)]
    a1_m: Annotated[float, Parameter("what is added low down", "m", 0.0, 100.0)]
    theta0_deg: Annotated[float, Parameter("elevation over which that falls to 1/e", "-", 0.1, 90.0)]
    a2_m: Annotated[float, Parameter("what receivers share; ground", "m", 0.0, 100.0)] = 0.0
    scale: Annotated[float, Parameter("factor on the whole curve", "-", 0.1, 100.0)] = 1.0
    tag: Annotated[Literal["known", "published", "surrogate"], Parameter("standard, published elsewhere, or ours")]
    source: Annotated[str, Parameter("where the numbers come from")]

    def __post_init__(self) -> None:
        if (self.end == "ground") != (self.part == "all"):
            raise ParameterError(f"part = {self.part!r}: 'all' of the ground, 'noise' and 'multipath' of the air")
        if self.end == "air" and self.a2_m != 0.0:
            raise ParameterError(f"a2_m = {self.a2_m:g} of the air: there is one receiver")
        if not self.source:
            raise ParameterError("source is empty")

    def error_m(self, elevation_rad: ArrayLike, n_receivers: ArrayLike, *, mask_rad: float = MASK_RAD) -> FloatArray:
        """The curve [m]; NaN below the mask, and of the ground for fewer than one receiver."""
        if self.end == "air":
            single = AirborneCurve(a0_m=self.a0_m, a1_m=self.a1_m, theta0_deg=self.theta0_deg)
            return self.scale * airborne_curve_m(single, elevation_rad, mask_rad=mask_rad)
        shared = GroundCurve(a0_m=self.a0_m, a1_m=self.a1_m, theta0_deg=self.theta0_deg, a2_m=self.a2_m)
        return self.scale * ground_curve_m(shared, elevation_rad, n_receivers, mask_rad=mask_rad)


class Wanted(NamedTuple):
    """Which curve."""

    end: End
    part: Part
    signal: CurveSignal
    designator: str
    smoothing_s: float
    system: str


@parameters
class SigmaCurves:
    """The table: what is used, and what could be instead."""

    curves: Annotated[tuple[SigmaCurve, ...], Numbered()]
    alternatives: Annotated[tuple[SigmaCurve, ...], Numbered()] = ()

    def __post_init__(self) -> None:
        keys: set[tuple[object, ...]] = set()
        for row in self.curves:
            for system in row.systems:
                for designator in row.designators:
                    key = (row.end, row.part, row.signal, system, designator, row.smoothing_s, row.above_deg)
                    if key in keys:
                        raise ParameterError(f"curves: two of {', '.join(map(str, key))}")
                    keys.add(key)

    def pieces(
        self, end: End, part: Part, signal: CurveSignal, designator: str, smoothing_s: float, system: str
    ) -> tuple[SigmaCurve, ...]:
        """The pieces of one curve, the lowest first; none when the table has none.

        A time constant that has no rows takes those of the longest one below it, whose errors are larger.
        """
        rows = [
            row
            for row in self.curves
            if (row.end, row.part, row.signal) == (end, part, signal)
            and designator in row.designators
            and system in row.systems
            and row.smoothing_s <= smoothing_s
        ]
        longest = max((row.smoothing_s for row in rows), default=0.0)
        return tuple(sorted((row for row in rows if row.smoothing_s == longest), key=lambda row: row.above_deg))


@lru_cache(maxsize=16)
def sigma_curves(path: str | Path = "") -> SigmaCurves:
    """The table of a file; that of the suite without one.

    Raises
    ------
    ParameterError
        Naming the file, the key, its value and the bound.
    """
    if path:
        return from_mapping(SigmaCurves, read_configuration(path).content(), source=str(path))
    with resources.as_file(resources.files(__package__) / "sigma_curves.yaml") as own:
        return from_mapping(SigmaCurves, read_configuration(own).content(), source=own.name)


def sigma_air_m(
    designator: AirborneAccuracy,
    signal: CurveSignal,
    smoothing_s: float,
    elevation_rad: ArrayLike,
    *,
    system: str = "G",
    table: SigmaCurves | None = None,
) -> FloatArray:
    """Airborne receiver noise and multipath of a smoothed range.

    Parameters
    ----------
    designator : {"A", "B"}
        Airborne accuracy designator.
    signal : {"L1", "L5", "L1_L5"}
        ``L1_L5`` is free of ionosphere.
    smoothing_s : float
        Time constant of the carrier smoothing [s].
    elevation_rad : array_like
    system : str
        ``"G"`` or ``"E"``.
    table : SigmaCurves
        Other curves than the suite's.

    Returns
    -------
    array
        Standard deviation [m]; NaN below 5 degrees.

    Raises
    ------
    ValueError
        For an unknown designator, or a signal, system and time constant without curves.

    Source: Caamano et al., eq (10); for L1 and 100 s or more equal to
    :func:`~gbas_core.models.error_models.sigma_air`.
    """
    if designator not in ("A", "B"):
        raise ValueError(f"airborne accuracy designator {designator!r} is not A or B")
    curves, place = table or sigma_curves(), Place(elevation_rad)
    return np.hypot(*(
        _curve_m(curves, Wanted("air", part, signal, designator, smoothing_s, system), place) for part in _AIR_PARTS
    ))  # fmt: skip


def sigma_gnd_m(
    designator: GroundAccuracy,
    signal: CurveSignal,
    smoothing_s: float,
    elevation_rad: ArrayLike,
    n_receivers: ArrayLike,
    *,
    system: str = "G",
) -> FloatArray:
    """Error of a correction that the mean of `n_receivers` reference receivers gives, by the suite's table.

    Parameters, exceptions as :func:`sigma_air_m`; the designators are A, B and C.

    Returns
    -------
    array
        Standard deviation [m]; NaN below 5 degrees and for fewer than one receiver.

    Source: for L1 and 100 s or more equal to :func:`~gbas_core.models.error_models.sigma_pr_gnd`.
    """
    if designator not in ("A", "B", "C"):
        raise ValueError(f"ground accuracy designator {designator!r} is not A, B or C")
    wanted = Wanted("ground", "all", signal, designator, smoothing_s, system)
    return _curve_m(sigma_curves(), wanted, Place(elevation_rad, n_receivers))


class Place(NamedTuple):
    """Where an error is wanted: elevation [rad], and receivers in the mean."""

    elevation_rad: ArrayLike
    n_receivers: ArrayLike = 1.0


def _curve_m(table: SigmaCurves, wanted: Wanted, place: Place) -> FloatArray:
    """One part of the error: a curve of the table, or the combination of those of L1 and L5."""
    pieces = table.pieces(*wanted)
    of_constant = bool(pieces) and pieces[0].smoothing_s == wanted.smoothing_s
    if wanted.signal == "L1_L5" and not of_constant:
        return sigma_ionosphere_free_m(
            _curve_m(table, wanted._replace(signal="L1"), place), _curve_m(table, wanted._replace(signal="L5"), place)
        )
    if not pieces or pieces[0].above_deg > np.rad2deg(MASK_RAD):
        raise ValueError(
            f"the table has no {wanted.end} curve ({wanted.part}) of {wanted.signal} for designator "
            f"{wanted.designator}, system {wanted.system}, {wanted.smoothing_s:g} s"
        )
    theta_deg = np.rad2deg(np.asarray(place.elevation_rad, dtype=np.float64))
    error_m = pieces[0].error_m(*place)
    for piece in pieces[1:]:
        error_m = np.where(theta_deg > piece.above_deg + EDGE_DEG, piece.error_m(*place), error_m)
    return error_m

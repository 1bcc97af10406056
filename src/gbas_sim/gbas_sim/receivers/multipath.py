"""Multipath and other errors with memory: correlated noise whose size goes with elevation.

Each error is a stationary first-order Gauss-Markov process of every receiver, band and satellite
(:class:`gbas_sim.random_processes.GaussMarkov`), times a standard deviation that is a function of elevation. It is a
statistical model: unlike reflections from a scene (:mod:`gbas_core.signal.rays`) it does not come back with the
constellation.

Source of the model: van Nee, "Multipath effects on GPS code phase measurements", NAVIGATION 39 (1992); the way a
smoothing filter passes it, from the filter of ICAO Annex 10 Vol. I, App. B 3.6.8.3.5.1.
"""

from __future__ import annotations

import math
from functools import cached_property
from itertools import pairwise
from typing import Annotated, Final

import numpy as np

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray
from gbas_core.satellites import N_GPS, N_SATS
from gbas_core.signals import L1, L5, N_BANDS
from gbas_sim.random_processes import EVERYONE, GaussMarkov, Normals, Stream

_BANDS: Final = 2  # drawn: L1 and L5


@parameters
class ElevationCurve:
    """A standard deviation by elevation, linear between the points given and constant beyond them."""

    elevation_deg: Annotated[tuple[float, ...], Parameter("ascending, in degrees", "-", 0.0, 90.0)] = (90.0,)
    sigma_m: Annotated[tuple[float, ...], Parameter("standard deviation there", "m", 0.0, 100.0)] = (0.0,)

    def __post_init__(self) -> None:
        elevations = self.elevation_deg
        if not elevations or len(elevations) != len(self.sigma_m):
            raise ValueError("sigma_m has not as many values as elevation_deg, or both are empty")
        if any(later <= earlier for earlier, later in pairwise(elevations)):
            raise ValueError(f"elevation_deg = {elevations!r} is not ascending")

    @classmethod
    def constant(cls, sigma_m: float) -> ElevationCurve:
        """The same at all elevations."""
        return cls(elevation_deg=(90.0,), sigma_m=(sigma_m,))

    @classmethod
    def exponential(cls, a0_m: float, a1_m: float, theta0_deg: float) -> ElevationCurve:
        """``a0 + a1 exp(-elevation / theta0)``, the form of the standards' curves, degree by degree."""
        degrees = np.arange(91.0)
        sigma = a0_m + a1_m * np.exp(-degrees / theta0_deg)
        return cls(elevation_deg=tuple(degrees.tolist()), sigma_m=tuple(sigma.tolist()))

    def at_m(self, elevation_rad: FloatArray) -> FloatArray:
        """Standard deviation [m]; NaN for a missing elevation."""
        return np.asarray(np.interp(np.degrees(elevation_rad), *self._nodes))

    @cached_property
    def _nodes(self) -> tuple[FloatArray, FloatArray]:
        return np.array(self.elevation_deg), np.array(self.sigma_m)


_NONE: Final = ElevationCurve()


@parameters
class CorrelatedError:
    """One kind of error with memory; triples are for L1 C/A, E1, and L5 with E5a.

    Code and carrier are the curves of their standard deviations, independent of each other.
    """

    name: Annotated[str, Parameter("for messages")]
    correlation_s: Annotated[
        float, Parameter("time in which the autocorrelation falls to 1/e; 0 is white noise", "s", 0.0, 100_000.0)
    ]
    code: tuple[ElevationCurve, ElevationCurve, ElevationCurve] = (_NONE, _NONE, _NONE)
    carrier: tuple[ElevationCurve, ElevationCurve, ElevationCurve] = (_NONE, _NONE, _NONE)
    shared: Annotated[bool, Parameter("all receivers of the kind have the same error, rather than each its own")] = (
        False
    )


def curves_m(curves: tuple[ElevationCurve, ElevationCurve, ElevationCurve], elevation_rad: FloatArray) -> FloatArray:
    """Standard deviations ``(..., N_BANDS, N_SATS)`` at elevations ``(..., N_SATS)`` [m]; 0 on L2."""
    sigma = np.zeros((*elevation_rad.shape[:-1], N_BANDS, N_SATS))
    sigma[..., L1, :N_GPS] = curves[0].at_m(elevation_rad[..., :N_GPS])
    sigma[..., L1, N_GPS:] = curves[1].at_m(elevation_rad[..., N_GPS:])
    sigma[..., L5, :] = curves[2].at_m(elevation_rad)
    return sigma


class CorrelatedErrors:
    """Errors with memory of receivers of one kind; any epoch by itself, with the same bits.

    Parameters
    ----------
    errors : tuple of CorrelatedError
        Each has its own random numbers, by its place.
    seed : int
    numbers : tuple of int
        Which receivers they are; a receiver's errors do not depend on which others there are.
    interval_s : float
        Between epochs [s].
    """

    def __init__(
        self, errors: tuple[CorrelatedError, ...], *, seed: int, numbers: tuple[int, ...], interval_s: float
    ) -> None:
        self._rows = len(numbers)
        self._parts: list[tuple[str, tuple[ElevationCurve, ElevationCurve, ElevationCurve], GaussMarkov]] = []
        for place, error in enumerate(errors):
            for offset, quantity in enumerate(("code", "carrier")):
                curves = getattr(error, quantity)
                if not any(any(curve.sigma_m) for curve in curves):
                    continue
                normals = Normals(seed, Stream.CORRELATED_ERRORS + 2 * place + offset)
                owners = (EVERYONE,) if error.shared else numbers
                process = GaussMarkov(normals, owners, (_BANDS, N_SATS), error.correlation_s / interval_s)
                self._parts.append((quantity, curves, process))

    def at(self, epoch: int, elevation_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Errors of code and carrier ``(R, N_BANDS, N_SATS)`` at an epoch and elevations ``(R, N_SATS)`` [m].

        0 on L2; NaN where the elevation is.
        """
        sums = {"code": np.zeros((self._rows, N_BANDS, N_SATS)), "carrier": np.zeros((self._rows, N_BANDS, N_SATS))}
        for quantity, curves, process in self._parts:
            sigma, unit = curves_m(curves, elevation_rad), process.at(epoch)
            for place, band in enumerate((L1, L5)):
                sums[quantity][:, band] += sigma[:, band] * unit[:, place]
        return sums["code"], sums["carrier"]


def smoothing_gain(correlation_s: float, *, tau_s: float, interval_s: float) -> float:
    """Standard deviation of a settled carrier-smoothed code over that of its Gauss-Markov error [-].

    Parameters
    ----------
    correlation_s : float
        Correlation time of the error [s]; 0 is white noise.
    tau_s : float
        Time constant of the smoothing filter [s].
    interval_s : float
        Between epochs [s].

    Notes
    -----
    The filter ``y_n = (1 - a) y_(n-1) + a x_n``, a = interval / tau, with an input of autocorrelation r^k, has the
    output variance ``a / (2 - a) (1 + r (1 - a)) / (1 - r (1 - a))``.
    """
    weight = interval_s / tau_s
    passed = (1.0 - weight) * (math.exp(-interval_s / correlation_s) if correlation_s > 0.0 else 0.0)
    return math.sqrt(weight / (2.0 - weight) * (1.0 + passed) / (1.0 - passed))

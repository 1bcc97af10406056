"""Deformed signals: how far a failure of a satellite's signal generator moves the codes of different receivers.

Threat model A is digital: falling edges of the chips come late or early. B is analogue: the signal rings like a
second-order system. C is both. Receivers differ by what their front ends leave of the correlation peak and where on it
their correlators sit: the same deformation gives them different biases, and the difference does not cancel.

Sources: ICAO Annex 10 Vol. I, Att. D 8.11 (threat models and their bounds, for GPS L1 C/A); Phelts, Multicorrelator
techniques for robust mitigation of threats to GPS signal quality, Stanford (2001), ch. 2 (correlation functions).
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Annotated, Final, NamedTuple

import numpy as np

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray
from gbas_core.signal.tracking_loops import MODULATIONS, SIGNALS, Modulation, TrackingParams

_SAMPLES_A_CHIP: Final = 512
_CHIPS: Final = 64
_FILTER_ORDER: Final = 6


@parameters
class Deformation:
    """A deformed signal; all zero but the damping is none.

    Known: lags up to 0.12 chips (models A and C), ringing of 4 to 17 MHz (B) or 7.3 to 13 MHz (C), damping of 0.8 to
    8.8 million.
    """

    lag_chips: Annotated[float, Parameter("how much later falling edges come, below 0 earlier", "chips", -0.5, 0.5)] = (
        0.0
    )
    ring_hz: Annotated[float, Parameter("frequency of the ringing; 0 is none", "Hz", 0.0, 50.0e6)] = 0.0
    damping_neperps: Annotated[float, Parameter("how fast it fades", "neper/s", 1.0e5, 1.0e8)] = 8.8e6


class Correlator(NamedTuple):
    """What of a receiver matters here.

    Attributes
    ----------
    spacing_chips : float
        Early to late [chips].
    front_end_hz : float
        Two-sided bandwidth of a sixth-order Butterworth filter with its phase taken out [Hz].
    """

    spacing_chips: float
    front_end_hz: float


def correlator_of(tracking: TrackingParams, signal: int) -> Correlator:
    """Correlator of a receiver for one of :data:`gbas_core.signal.tracking_loops.SIGNALS`."""
    return Correlator(tracking.spacing_chips[signal], tracking.front_end_hz[signal])


@lru_cache(maxsize=256)
def deformation_bias_m(deformation: Deformation, correlator: Correlator, signal: int = 0) -> float:
    """How much longer a deformed signal makes a receiver's pseudorange [m].

    Parameters
    ----------
    deformation : Deformation
    correlator : Correlator
    signal : int
        Number in :data:`gbas_core.signal.tracking_loops.SIGNALS`; the threat models are known for 0 (L1 C/A) only.
        Edges of E1's subcarrier have none.

    Raises
    ------
    ValueError
        For late edges on E1, or when the correlators find no balance within half a chip.

    Notes
    -----
    Ringing may leave several balances: the receiver is taken to be at the one nearest to the highest point.
    """
    modulation = MODULATIONS[signal]
    if modulation.boc and deformation.lag_chips != 0.0:
        raise ValueError(f"deformation: lag_chips = {deformation.lag_chips!r} has no model for {SIGNALS[signal]}")
    lag, peak = deformed_correlation(deformation, correlator.front_end_hz, modulation)
    half = 0.5 * correlator.spacing_chips
    near = np.flatnonzero(np.abs(lag) <= 0.5)
    excess = np.interp(lag[near] + half, lag, peak) - np.interp(lag[near] - half, lag, peak)
    balances = np.flatnonzero((excess[:-1] > 0.0) & (excess[1:] <= 0.0))
    if balances.size == 0:
        raise ValueError(f"deformation: {deformation!r} leaves {correlator!r} no balance within half a chip")
    places = lag[near][balances] + excess[balances] / (excess[balances] - excess[balances + 1]) / _SAMPLES_A_CHIP
    summit = lag[np.argmax(peak)]
    return float(places[np.argmin(np.abs(places - summit))]) * modulation.chip_m


def deformed_correlation(
    deformation: Deformation, front_end_hz: float, modulation: Modulation
) -> tuple[FloatArray, FloatArray]:
    """Lags [chips] and correlation of a deformed signal, through a front end, with an undeformed replica [-].

    Notes
    -----
    Late falling edges, a quarter as many as chips, each last twice the chip's height longer than the replica's; what
    this adds at a lag is half the mean of the replica around a falling edge over the time they are late. The ringing is
    the impulse response of a second-order system of unit gain, ``exp(-s t) sin(w t) (s^2 + w^2) / w``; like the
    front end's filter it acts on the correlation function as it does on the signal.
    """
    count = _SAMPLES_A_CHIP * _CHIPS
    lag = (np.arange(count) - count // 2) / _SAMPLES_A_CHIP
    peak = modulation.correlation(lag) + _late_edges(lag, deformation.lag_chips)
    spectrum = np.fft.rfft(np.fft.ifftshift(peak))
    frequency_hz = np.fft.rfftfreq(count, 1.0 / _SAMPLES_A_CHIP) * modulation.chip_rate_hz
    gain = 1.0 / np.sqrt(1.0 + (2.0 * frequency_hz / front_end_hz) ** (2 * _FILTER_ORDER))
    shaped = spectrum * gain * _ringing(deformation, np.asarray(frequency_hz, dtype=np.float64))
    return lag, np.fft.fftshift(np.fft.irfft(shaped, count))


def _late_edges(lag: FloatArray, late: float) -> FloatArray:
    """What falling edges that are `late` add to the correlation of random chips with an undeformed replica [-].

    Before a falling edge the replica is +1 for a chip, after it -1, on average over the random chips around.
    """

    def area(end: FloatArray) -> FloatArray:
        """Integral of the replica's mean from -infinity."""
        return np.asarray(np.clip(end + 1.0, 0.0, 1.0) - np.clip(end, 0.0, 1.0))

    return np.asarray(0.5 * (area(late - lag) - area(-lag)))


def _ringing(deformation: Deformation, frequency_hz: FloatArray) -> FloatArray | float:
    """Transfer function of the second-order system, complex; 1 without ringing."""
    if deformation.ring_hz == 0.0:
        return 1.0
    ring, damping = 2.0 * math.pi * deformation.ring_hz, deformation.damping_neperps
    square = ring**2 + damping**2
    return np.asarray(square / ((damping + 2j * math.pi * frequency_hz) ** 2 + ring**2))

"""The aeronautical multipath channel: echoes of wing, fuselage and ground that fade with given Doppler spectra.

``h(t, tau) = 1 + sum sqrt(P_i) n_i(t) delta(tau - tau_i)``, each ``n_i`` complex Gaussian noise of unit power with the
spectrum of its echo.

Sources: Steingass and Lehner, The high resolution aeronautical multipath navigation channel, DLR (2004), the structure;
Sabatini, Moore, Hill, WASET 7 (2013), eq (23), (24), (29) to (34).

Notes
-----
What the paper leaves out, and what it misprints:

- The fuselage's mean, b2 and b3 of eq (31), (32) are polynomials of elevation and azimuth whose coefficients it does
  not print: they are parameters here. Eq (31) is taken as ``P_dB = k + b2 exp(b3 |f|)`` with b3 below 0, its only
  consistent reading; its power comes from ``power_db``.
- Eq (29) of the wing and (33) of the ground are the same; a wing does not move against its antenna, so that its Doppler
  is the flexing of the structure: a parameter, narrow by default. Both print ``20 log`` of a density, a shape without a
  power: the power is a parameter.
- Eq (23) gives ``n_i`` "power i": unit power is meant.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray

ComplexArray = NDArray[np.complex128]
Source = Literal["wing", "fuselage", "ground"]
SOURCES: Final[tuple[Source, ...]] = ("wing", "fuselage", "ground")

_POWER: Final = Parameter("mean power over the direct signal's; -200 is none", "dB", -200.0, 0.0)


@parameters
class EchoSpectra:
    """Powers and Doppler spectra of the three echoes.

    Known: 3.8 Hz of the ground (Steingass and Lehner; Sabatini et al., eq (33)); the fuselage's -14.2 dB at 1.5 ns (the
    same model, fixed values). Uncertain, ours: the wing's, and the fuselage's b2 and b3.
    """

    wing_power_db: Annotated[float, _POWER] = -20.0
    wing_sigma_hz: Annotated[float, Parameter("of its Gaussian Doppler spectrum", "Hz", 0.001, 100.0)] = 0.5
    fuselage_power_db: Annotated[float, _POWER] = -14.2
    fuselage_b2_db: Annotated[float, Parameter("height of its spectrum over the floor, at 0 Hz", "dB", 0.0, 100.0)] = (
        30.0
    )
    fuselage_b3_s: Annotated[float, Parameter("fall of that height with frequency", "s", -100.0, -0.001)] = -1.0
    ground_power_db: Annotated[float, _POWER] = -15.0
    ground_sigma_hz: Annotated[float, Parameter("of its Gaussian Doppler spectrum", "Hz", 0.001, 100.0)] = 3.8
    bandwidth_hz: Annotated[float, Parameter("two-sided, beyond it there is nothing: eq (24)", "Hz", 0.1, 1000.0)] = (
        40.0
    )

    def power(self, source: Source) -> float:
        """Mean power over the direct signal's, as a ratio."""
        return float(10.0 ** (0.1 * float(getattr(self, f"{source}_power_db"))))

    def density_s(self, source: Source, frequency_hz: ArrayLike) -> FloatArray:
        """Spectrum of an echo of unit power [1/Hz]."""
        frequency = np.asarray(frequency_hz, dtype=np.float64)
        within = np.linspace(-0.5, 0.5, 4001) * self.bandwidth_hz
        total = np.trapezoid(self._shape(source, within), within)
        return np.where(np.abs(frequency) <= 0.5 * self.bandwidth_hz, self._shape(source, frequency) / total, 0.0)

    def _shape(self, source: Source, frequency_hz: FloatArray) -> FloatArray:
        if source == "fuselage":
            above = self.fuselage_b2_db * np.exp(self.fuselage_b3_s * np.abs(frequency_hz))
            return np.asarray(10.0 ** (0.1 * above))
        sigma = self.wing_sigma_hz if source == "wing" else self.ground_sigma_hz
        return np.asarray(np.exp(-0.5 * (frequency_hz / sigma) ** 2))


def fading(spectra: EchoSpectra, source: Source, count: int, interval_s: float, seed: int) -> ComplexArray:
    """A stretch of one echo's fading, of unit mean power, (count,).

    Parameters
    ----------
    spectra : EchoSpectra
    source : "wing", "fuselage" or "ground"
    count, interval_s
        Samples and their spacing [s]; the stretch does not repeat within them.
    seed : int

    Raises
    ------
    ValueError
        For samples too far apart for the bandwidth.

    Notes
    -----
    Independent Gaussian amplitudes at the frequencies of a transform twice as long, shaped by the spectrum.
    """
    if not 1.0 / interval_s >= spectra.bandwidth_hz:
        raise ValueError(f"interval_s = {interval_s!r} is too long for a bandwidth of {spectra.bandwidth_hz:g} Hz")
    random = np.random.default_rng([seed, SOURCES.index(source)])
    length = 2 * count
    density = spectra.density_s(source, np.fft.fftfreq(length, interval_s))
    share = density / density.sum()
    noise = random.standard_normal((2, length))
    amplitudes = np.sqrt(0.5 * share) * (noise[0] + 1j * noise[1])
    return np.asarray(length * np.fft.ifft(amplitudes)[:count])


class ChannelEcho(NamedTuple):
    """An echo along a flight, (T,): extra path [m], complex amplitude over the direct signal."""

    delay_m: FloatArray
    amplitude: ComplexArray


def channel_echo(
    spectra: EchoSpectra, source: Source, delay_m: ArrayLike, interval_s: float, *, seed: int, chip_m: float = 293.05
) -> ChannelEcho:
    """An echo with delays (T,) along a flight, fading; nothing where its delay is beyond 1.5 chips, or not known.

    Source: Sabatini et al., eq (23), (35).
    """
    delay = np.atleast_1d(np.asarray(delay_m, dtype=np.float64))
    there = (delay >= 0.0) & (delay < 1.5 * chip_m)
    faded = np.sqrt(spectra.power(source)) * fading(spectra, source, len(delay), interval_s, seed)
    return ChannelEcho(np.where(there, delay, np.nan), np.where(there, faded, 0.0))

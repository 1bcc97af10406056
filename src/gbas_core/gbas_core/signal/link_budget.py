"""C/N0 from what a satellite sends, term by term, and the criteria of signal-to-noise before and after correlation.

The budget by received power, which the simulator has, is :class:`gbas_core.signal.antenna.LinkBudget`.

Source: Sabatini, Moore, Hill, "A novel GNSS integrity augmentation system", WASET 7 (2013), eq (12) to (20), (57) to
(59), after Spilker in Parkinson and Spilker, vol. 1 (1996), ch. 13.
"""

from __future__ import annotations

import math
from typing import Annotated, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray
from gbas_core.satellites import IS_GPS, N_SATS
from gbas_core.signal.antenna import (
    ANTENNA,
    ANTENNAS,
    BOLTZMANN_DBWPKHZ,
    REFERENCE_K,
    oxygen_loss_db,
    paper_beam_db,
    slant_range_m,
)
from gbas_core.signals import FREQUENCY_HZ, L1, L5, N_BANDS, WAVELENGTH_M

TransmitBeam = Literal["paper", "flat"]

_BANDS: Final = (L1, L5)
_LOWEST_RAD: Final = math.radians(3.0)
"""Below, neither shells of air nor scintillation by the cosecant are good: the terms of 3 degrees hold."""


def free_space_loss_db(distance_m: ArrayLike, wavelength_m: ArrayLike) -> FloatArray:
    """Loss between isotropic antennas [dB]; Friis, Proc. IRE 34 (1946)."""
    return np.asarray(20.0 * np.log10(4.0 * math.pi * np.asarray(distance_m) / np.asarray(wavelength_m)))


def scintillation_db(elevation_rad: ArrayLike, frequency_hz: ArrayLike) -> FloatArray:
    """Standard deviation of the amplitude by turbulence of the troposphere [dB]; as at 3 degrees below that.

    Source: Sabatini et al., eq (17), (18), from CCIR.

    Notes
    -----
    The paper prints csc(E) to the power of -0.85, by which it would grow with the elevation, against its text.
    """
    sine = np.sin(np.maximum(elevation_rad, _LOWEST_RAD))
    gigahertz = 1e-9 * np.asarray(frequency_hz, dtype=np.float64)
    return np.asarray(0.025 * gigahertz ** (7.0 / 12.0) * sine**-0.85)


class LinkTerms(NamedTuple):
    """The terms of a budget ``(..., N_BANDS, N_SATS)``; NaN on L2 and where the direction is not known.

    Attributes
    ----------
    eirp_dbw : array
        Power sent, times the gain of the satellite's antenna where it is largest [dBW].
    beam_db, antenna_dbic : array
        Gain of the satellite's antenna less its largest, and of the receiver's.
    spread_db, oxygen_db, scintillation_db : array
        Losses: distance, air, and one standard deviation of tropospheric fading.
    noise_dbwphz : float
        Noise density.
    """

    eirp_dbw: FloatArray
    beam_db: FloatArray
    spread_db: FloatArray
    oxygen_db: FloatArray
    scintillation_db: FloatArray
    antenna_dbic: FloatArray
    noise_dbwphz: float

    @property
    def cn0_dbhz(self) -> FloatArray:
        """Carrier to noise density [dB-Hz]; Sabatini et al., eq (12), with the noise density it lacks."""
        gains = self.eirp_dbw + self.beam_db + self.antenna_dbic
        return np.asarray(gains - self.spread_db - self.oxygen_db - self.scintillation_db - self.noise_dbwphz)


@parameters
class TransmitBudget:
    """C/N0 from what satellites send; pairs are for L1 and L5.

    Known: GPS C/A, the paper's. The others are ours: what gives the guaranteed minimum at 5 degrees of elevation of
    each interface document the margin over it that C/A has (IS-GPS-200N, IS-GPS-705J, Galileo OS SIS ICD 2.1).

    Notes
    -----
    Rain is left out: below 0.01 dB/km at 100 mm/h (Sabatini et al., section IV.E). All of the noise is the noise
    figure, over 290 K, as in eq (12), (19), (20): an antenna that sees 290 K.
    """

    gps_eirp_dbw: Annotated[tuple[float, float], Parameter("power times largest gain, GPS", "dBW", 0.0, 60.0)] = (
        26.8,
        28.8,
    )
    galileo_eirp_dbw: Annotated[
        tuple[float, float], Parameter("power times largest gain, Galileo", "dBW", 0.0, 60.0)
    ] = (29.0, 28.5)
    beam: Annotated[
        TransmitBeam, Parameter("satellite's antenna: as the paper has it, 2.5 dB less at the horizon, or flat")
    ] = "paper"
    antenna: Annotated[str, ANTENNA] = "fighter"
    noise_figure_db: Annotated[float, Parameter("of receiver and cables, over 290 K", "dB", 0.0, 20.0)] = 3.0

    @property
    def noise_dbwphz(self) -> float:
        """Noise density [dBW/Hz]: -203.98 + noise figure."""
        return BOLTZMANN_DBWPKHZ + 10.0 * math.log10(REFERENCE_K) + self.noise_figure_db

    def terms(
        self,
        elevation_rad: FloatArray,
        antenna_elevation_rad: FloatArray | None = None,
        distance_m: FloatArray | None = None,
    ) -> LinkTerms:
        """All terms at elevations ``(..., N_SATS)``.

        Parameters
        ----------
        elevation_rad : (..., N_SATS) array
            Above the local horizon [rad]; the air is as at 3 degrees below that.
        antenna_elevation_rad : (..., N_SATS) array, optional
            Above the antenna's plane, of an aircraft that banks; the same as the others unless given [rad].
        distance_m : (..., N_SATS) array, optional
            To the satellites [m]; unless given, that of circular orbits seen from the ground.
        """
        seen = elevation_rad if antenna_elevation_rad is None else antenna_elevation_rad
        distance = slant_range_m(elevation_rad) if distance_m is None else distance_m
        shape = (*np.broadcast_shapes(elevation_rad.shape, seen.shape, distance.shape)[:-1], N_BANDS, N_SATS)
        eirp = np.full(shape, np.nan)
        for band, gps, galileo in zip(_BANDS, self.gps_eirp_dbw, self.galileo_eirp_dbw, strict=True):
            eirp[..., band, :] = np.where(IS_GPS, gps, galileo)
        above = np.maximum(elevation_rad, _LOWEST_RAD)[..., np.newaxis, :]
        beam = paper_beam_db(elevation_rad) if self.beam == "paper" else np.zeros(elevation_rad.shape)
        return LinkTerms(
            eirp_dbw=eirp,
            beam_db=beam[..., np.newaxis, :],
            spread_db=free_space_loss_db(distance[..., np.newaxis, :], WAVELENGTH_M[:, np.newaxis]),
            oxygen_db=oxygen_loss_db(above),
            scintillation_db=scintillation_db(above, FREQUENCY_HZ[:, np.newaxis]),
            antenna_dbic=ANTENNAS[self.antenna].gain_at_dbic(seen)[..., np.newaxis, :],
            noise_dbwphz=self.noise_dbwphz,
        )

    def cn0_dbhz(self, elevation_rad: FloatArray, antenna_elevation_rad: FloatArray | None = None) -> FloatArray:
        """C/N0 ``(..., N_BANDS, N_SATS)``, as :meth:`gbas_core.signal.antenna.LinkBudget.cn0_dbhz`."""
        return self.terms(elevation_rad, antenna_elevation_rad).cn0_dbhz


# --- criteria


@parameters
class SignalCriteria:
    """When a signal is too weak: by C/N0, and by signal to noise after correlation, each with its own name.

    Known: Sabatini et al., section IV.H. With the defaults, 10 and 12 dB after correlation are 30 and 32 dB-Hz: the
    criterion of C/N0 never binds.
    """

    warning_cn0_dbhz: Annotated[float, Parameter("lowest of use", "dB-Hz", 0.0, 60.0)] = 25.0
    caution_cn0_dbhz: Annotated[float, Parameter("lowest without a caution", "dB-Hz", 0.0, 60.0)] = 27.0
    warning_post_correlation_db: Annotated[float, Parameter("lowest of use", "dB", -20.0, 60.0)] = 10.0
    caution_post_correlation_db: Annotated[float, Parameter("lowest without a caution", "dB", -20.0, 60.0)] = 12.0
    bandwidth_hz: Annotated[float, Parameter("noise bandwidth before correlation", "Hz", 1e3, 1e8)] = 2.046e6
    chip_rate_hz: Annotated[float, Parameter("of the code", "Hz", 1e5, 1e8)] = 1.023e6
    data_period_s: Annotated[float, Parameter("of a bit", "s", 1e-4, 1.0)] = 0.02

    def __post_init__(self) -> None:
        for key in ("cn0_dbhz", "post_correlation_db"):
            warning, caution = getattr(self, f"warning_{key}"), getattr(self, f"caution_{key}")
            if caution < warning:
                raise ValueError(f"signal criteria: caution_{key} = {caution} is below warning_{key} = {warning}")

    @property
    def processing_gain_db(self) -> float:
        """Chips a bit [dB]; Sabatini et al., eq (58), which prints twice the rate over the period: 80 dB."""
        return 10.0 * math.log10(self.chip_rate_hz * self.data_period_s)

    def pre_correlation_db(self, cn0_dbhz: ArrayLike) -> FloatArray:
        """Signal to noise before correlation [dB]; Sabatini et al., eq (13)."""
        return np.asarray(np.asarray(cn0_dbhz, dtype=np.float64) - 10.0 * math.log10(self.bandwidth_hz))

    def post_correlation_db(self, cn0_dbhz: ArrayLike) -> FloatArray:
        """Signal to noise after correlation [dB]; Sabatini et al., eq (57): the sum, not "the difference"."""
        return self.pre_correlation_db(cn0_dbhz) + self.processing_gain_db

    @property
    def warning_dbhz(self) -> float:
        """C/N0 below which either criterion warns [dB-Hz]."""
        return max(self.warning_cn0_dbhz, self.warning_post_correlation_db - float(self.post_correlation_db(0.0)))

    @property
    def caution_dbhz(self) -> float:
        """C/N0 below which either criterion cautions [dB-Hz]."""
        return max(self.caution_cn0_dbhz, self.caution_post_correlation_db - float(self.post_correlation_db(0.0)))

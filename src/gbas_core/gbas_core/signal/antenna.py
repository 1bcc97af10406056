"""Antennas and link budget: C/N0 by elevation.

Gains are of circular polarisation, right-handed (that of the signals) and left-handed (that of most reflections), by
elevation in the antenna's frame from -90 to 90 degrees; patterns have no azimuth.

Sources: Sabatini, Moore, Hill, "A novel GNSS integrity augmentation system", WASET 7 (2013), eq (12) to (20); Lopez,
"LAAS/GBAS ground reference antenna with enhanced mitigation of ground multipath", ION NTM 2008, pp. 389-393; received
powers from IS-GPS-200N 3.3.1.6, IS-GPS-705J 3.3.1.6 and Galileo OS SIS ICD 2.1, 2.7.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray
from gbas_core.satellites import IS_GPS, N_SATS
from gbas_core.signals import L1, L2, L5, N_BANDS, WAVELENGTH_M

Beam = Literal["isoflux", "paper"]

REFERENCE_K: Final = 290.0
BOLTZMANN_DBWPKHZ: Final = 10.0 * math.log10(1.380649e-23)
# Uncertain, ours: from the antenna to the edge of the roof it is on.
_ROOF_EDGE_M: Final = 2.0
_WAVELENGTHS_M: Final[FloatArray] = np.where(np.arange(N_BANDS) == L2, np.nan, WAVELENGTH_M)
_EARTH_RADIUS_M: Final = 6_378_137.0
_ORBIT_RADIUS_M: Final[FloatArray] = np.where(IS_GPS, 26_559_700.0, 29_599_800.0)
# Known: oxygen, at the zenith, and the height of its shell over the Earth's radius. Source: Sabatini et al., eq (16),
# from Spilker in Parkinson and Spilker, vol. 1 (1996), ch. 13.
_OXYGEN_ZENITH_DB: Final = 0.035
_OXYGEN_HEIGHT: Final = 6.0 / 6378.0


@parameters
class AntennaPattern:
    """Gain by elevation, linear in dB between the points given."""

    name: Annotated[str, Parameter("name of the antenna")]
    elevation_deg: Annotated[tuple[float, ...], Parameter("elevations from -90 to 90 degrees, ascending")]
    gain_dbic: Annotated[tuple[float, ...], Parameter("right-handed gain", "dBic", -100.0, 30.0)]
    cross_dbic: Annotated[tuple[float, ...], Parameter("left-handed gain", "dBic", -100.0, 30.0)]

    def __post_init__(self) -> None:
        elevations = self.elevation_deg
        if len(elevations) < 2 or elevations[0] != -90.0 or elevations[-1] != 90.0:
            raise ValueError(f"antenna {self.name}: elevation_deg = {elevations!r} does not go from -90 to 90")
        if any(later <= earlier for earlier, later in pairwise(elevations)):
            raise ValueError(f"antenna {self.name}: elevation_deg = {elevations!r} is not ascending")
        for key in ("gain_dbic", "cross_dbic"):
            if len(getattr(self, key)) != len(elevations):
                raise ValueError(f"antenna {self.name}: {key} has not as many values as elevation_deg")

    def gain_at_dbic(self, elevation_rad: ArrayLike) -> FloatArray:
        """Right-handed gain [dBic]."""
        return np.asarray(np.interp(np.degrees(elevation_rad), self.elevation_deg, self.gain_dbic))

    def cross_at_dbic(self, elevation_rad: ArrayLike) -> FloatArray:
        """Left-handed gain [dBic]."""
        return np.asarray(np.interp(np.degrees(elevation_rad), self.elevation_deg, self.cross_dbic))


def _paper_gain_dbic(elevation_deg: float) -> float:
    """Gain of the paper's fighter antenna, -3 dB at 10 degrees and 3.5 dB at the zenith: Sabatini et al., eq (15)."""
    return 7.8659 * math.sin(math.radians(elevation_deg)) - 4.3659


_EVERY_FIVE_DEG: Final = tuple(float(each) for each in range(-90, 91, 5))

ANTENNAS: Final[dict[str, AntennaPattern]] = {
    pattern.name: pattern
    for pattern in (
        AntennaPattern(
            name="isotropic", elevation_deg=(-90.0, 90.0), gain_dbic=(0.0, 0.0), cross_dbic=(-100.0, -100.0)
        ),
        # Uncertain, ours: a multipath limiting antenna as Lopez describes it: full gain down to a few degrees, a sharp
        # cut-off at the horizon, 30 dB below it.
        AntennaPattern(
            name="mla",
            elevation_deg=(-90.0, -30.0, -10.0, -5.0, 0.0, 3.0, 5.0, 10.0, 20.0, 40.0, 90.0),
            gain_dbic=(-30.0, -30.0, -30.0, -29.0, -9.0, -3.0, -1.0, 1.0, 2.0, 3.0, 3.0),
            cross_dbic=(-30.0, -30.0, -32.0, -35.0, -25.0, -22.0, -20.0, -18.0, -16.0, -15.0, -17.0),
        ),
        # Uncertain, ours: a patch on a ground plane, as on an airframe.
        AntennaPattern(
            name="patch",
            elevation_deg=(-90.0, -30.0, -10.0, 0.0, 5.0, 10.0, 15.0, 30.0, 60.0, 90.0),
            gain_dbic=(-15.0, -13.0, -9.0, -6.0, -4.5, -3.0, -2.0, 1.0, 4.0, 5.0),
            cross_dbic=(-10.0, -9.0, -9.0, -9.0, -9.5, -10.0, -10.5, -12.0, -14.0, -15.0),
        ),
        # Known above the horizon; uncertain, ours, below it and in the other polarisation.
        AntennaPattern(
            name="fighter",
            elevation_deg=_EVERY_FIVE_DEG,
            gain_dbic=tuple(_paper_gain_dbic(each) for each in _EVERY_FIVE_DEG),
            cross_dbic=(-12.0,) * len(_EVERY_FIVE_DEG),
        ),
    )
}
ANTENNA: Final = Parameter("name of the antenna", choices=tuple(ANTENNAS))


def oxygen_loss_db(elevation_rad: ArrayLike) -> FloatArray:
    """Attenuation by the air at elevations of 0 and above [dB].

    Source: Sabatini et al., eq (16).

    Notes
    -----
    The whole expression at all elevations: the paper's branch below 10 degrees is 60 % too large where it begins.
    """
    sine = np.sin(np.asarray(elevation_rad, dtype=np.float64))
    height = _OXYGEN_HEIGHT
    path = sine + np.sqrt(sine**2 + 2.0 * height + height**2)
    return np.asarray(2.0 * _OXYGEN_ZENITH_DB * (1.0 + 0.5 * height) / path)


def paper_beam_db(elevation_rad: ArrayLike) -> FloatArray:
    """Gain of a satellite's antenna less that towards the zenith of the receiver [dB].

    Source: Sabatini et al., eq (14), E being the elevation.

    Notes
    -----
    Satellites shape their beams the other way, to favour the edge of the Earth.
    """
    return np.asarray(2.5413 * (np.sin(elevation_rad) - 1.0))


def airframe_loss_db(antenna_elevation_rad: FloatArray) -> FloatArray:
    """What an airframe takes from satellites below the antenna's plane, ``(..., N_BANDS, N_SATS)`` [dB]; NaN on L2.

    Diffraction over the edge of the roof the antenna is on, beyond what it is for a satellite in the antenna's plane,
    which the antenna's pattern has. On L1, 6.5 dB at 10 degrees below, 11 dB at 20, 17 dB at 45.

    Parameters
    ----------
    antenna_elevation_rad : (..., N_SATS) array
        Above the antenna's plane [rad].

    Source: Recommendation ITU-R P.526-15, 4.1, eq (26) and (31), with the satellite far away.
    """
    below = np.maximum(-antenna_elevation_rad, 0.0)[..., np.newaxis, :]
    depth = np.sin(below) * np.sqrt(2.0 * _ROOF_EDGE_M / _WAVELENGTHS_M[:, np.newaxis])
    return np.asarray(_knife_edge_db(depth) - _knife_edge_db(np.zeros(1)))


def _knife_edge_db(depth: FloatArray) -> FloatArray:
    """Loss behind a knife edge, the parameter of diffraction at least -0.7 [dB]."""
    return np.asarray(6.9 + 20.0 * np.log10(np.sqrt((depth - 0.1) ** 2 + 1.0) + depth - 0.1))


def slant_range_m(elevation_rad: FloatArray, orbit_radius_m: ArrayLike = _ORBIT_RADIUS_M) -> FloatArray:
    """Distance to satellites on circular orbits at elevations seen from the ground [m].

    Elevations are ``(..., N_SATS)``, or whatever goes with the radii given.
    """
    sine = np.sin(elevation_rad)
    from_centre = np.asarray(orbit_radius_m, dtype=np.float64) ** 2 - _EARTH_RADIUS_M**2 * (1.0 - sine**2)
    return np.asarray(np.sqrt(from_centre) - _EARTH_RADIUS_M * sine)


@parameters
class Cn0Curve:
    """C/N0 that goes with the sine of the elevation; pairs are for L1 and L5. Ours."""

    zenith_dbhz: Annotated[tuple[float, float], Parameter("at the zenith", "dB-Hz", 0.0, 80.0)] = (50.0, 52.0)
    horizon_dbhz: Annotated[tuple[float, float], Parameter("at the horizon", "dB-Hz", 0.0, 80.0)] = (37.0, 39.0)

    def cn0_dbhz(self, elevation_rad: FloatArray, antenna_elevation_rad: FloatArray | None = None) -> FloatArray:
        """C/N0 ``(..., N_BANDS, N_SATS)``, as :meth:`LinkBudget.cn0_dbhz`; NaN on L2."""
        sine = np.sin(elevation_rad if antenna_elevation_rad is None else antenna_elevation_rad)
        cn0 = np.full((*sine.shape[:-1], N_BANDS, N_SATS), np.nan)
        for band, zenith, horizon in zip((L1, L5), self.zenith_dbhz, self.horizon_dbhz, strict=True):
            cn0[..., band, :] = horizon + (zenith - horizon) * sine
        return cn0


_RECEIVED: Final = "at an isotropic right-handed antenna on the ground from the zenith"


@parameters
class LinkBudget:
    """C/N0 from received power, antenna gain and noise; pairs are for L1 and L5.

    The received powers are 2 dB above the guaranteed minimum of the interface documents: -158.5 (C/A), -154.0 (L5),
    -157.25 (E1), -155.25 (E5a). Beam ``isoflux``: the same power density on the ground at all elevations, as
    satellites' antennas are shaped to; ``paper``: the paper's eq (14), by which both distance and beam weaken it.

    Source: Sabatini et al., eq (12) to (20).

    Notes
    -----
    The paper's eq (12) lacks the noise density, and takes the noise figure for all of it; eq (19) is for the effective
    noise temperature of the receiver. Here N_0 = k (T_antenna + 290 K (F - 1)).
    """

    gps_dbw: Annotated[tuple[float, float], Parameter(f"power of GPS {_RECEIVED}", "dBW", -200.0, -100.0)] = (
        -156.5,
        -152.0,
    )
    galileo_dbw: Annotated[tuple[float, float], Parameter(f"power of Galileo {_RECEIVED}", "dBW", -200.0, -100.0)] = (
        -155.25,
        -153.25,
    )
    beam: Annotated[Beam, Parameter("what satellites send towards lower elevations")] = "isoflux"
    antenna: Annotated[str, ANTENNA] = "patch"
    noise_figure_db: Annotated[float, Parameter("of the receiver with its cables", "dB", 0.0, 20.0)] = 3.0
    antenna_temperature_k: Annotated[float, Parameter("sky and ground as the antenna sees them", "K", 1.0, 1000.0)] = (
        130.0
    )
    loss_db: Annotated[float, Parameter("of correlation, quantisation and band limits", "dB", 0.0, 20.0)] = 1.5

    @property
    def noise_dbwphz(self) -> float:
        """Noise density [dBW/Hz]."""
        receiver_k = REFERENCE_K * (10.0 ** (0.1 * self.noise_figure_db) - 1.0)
        return BOLTZMANN_DBWPKHZ + 10.0 * math.log10(self.antenna_temperature_k + receiver_k)

    def received_dbw(self, elevation_rad: FloatArray) -> FloatArray:
        """Power at an isotropic antenna on the ground, through the air, ``(..., N_BANDS, N_SATS)``; NaN on L2 [dBW]."""
        change = oxygen_loss_db(math.pi / 2.0) - oxygen_loss_db(elevation_rad)
        if self.beam == "paper":
            nearest = _ORBIT_RADIUS_M - _EARTH_RADIUS_M
            spread = 20.0 * np.log10(nearest / slant_range_m(elevation_rad))
            change = change + spread + paper_beam_db(elevation_rad)
        received = np.full((*change.shape[:-1], N_BANDS, N_SATS), np.nan)
        for band, gps, galileo in zip((L1, L5), self.gps_dbw, self.galileo_dbw, strict=True):
            received[..., band, :] = np.where(IS_GPS, gps, galileo) + change
        return received

    def cn0_dbhz(self, elevation_rad: FloatArray, antenna_elevation_rad: FloatArray | None = None) -> FloatArray:
        """C/N0 ``(..., N_BANDS, N_SATS)`` at elevations ``(..., N_SATS)``; NaN on L2.

        Parameters
        ----------
        elevation_rad : (..., N_SATS) array
            Above the local horizon [rad].
        antenna_elevation_rad : (..., N_SATS) array, optional
            Above the antenna's plane, of an aircraft that banks; the same as the others unless given [rad].
        """
        seen = elevation_rad if antenna_elevation_rad is None else antenna_elevation_rad
        gain_dbic = ANTENNAS[self.antenna].gain_at_dbic(seen)[..., np.newaxis, :]
        return np.asarray(self.received_dbw(elevation_rad) + gain_dbic - self.noise_dbwphz - self.loss_db)


Cn0Model = Cn0Curve | LinkBudget

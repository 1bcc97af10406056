"""Scintillation: how often satellites lose lock, and how deep they fade, by magnetic latitude and local time.

Two regions have it: belts on both sides of the magnetic equator in the evening, where the amplitude scintillates (S4),
and the auroral ovals around magnetic midnight, where the phase does (sigma_phi). Where and when it is evaluated is
each path's pierce point. Losses of lock arrive at random (Poisson) at a rate that grows with S4 and sigma_phi, and last
for times of an exponential distribution, reacquisition included; part of them strikes all receivers at once. Between
losses C/N0 follows a Nakagami distribution, correlated over a second or so.

Every draw is a function of the seed, the receiver, the satellite and a block of time: any epoch can be evaluated by
itself.

Sources: regions and hours after Aarons, "Global morphology of ionospheric scintillations", Proc. IEEE 70 (1982),
pp. 360-378; random losses of lock as a model for GBAS after Fujiwara and Tsujii, "GBAS availability assessment and
modeling of ionospheric scintillation effects", NAVIGATION 63 (2016), pp. 403-411; common losses and their short
durations after Seo, Walter, Enge, IEEE Trans. AES-47 (2011), pp. 1963-1973; Nakagami distribution, growth towards the
horizon and over frequency after Recommendation ITU-R P.531-16, 5.4 and 5.5. The shapes over latitude and time (bell
curves) and all default numbers are ours and uncertain: they are parameters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv, ndtr

from gbas_core.gnss.gpstime import epoch_key
from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray
from gbas_core.satellites import N_SATS
from gbas_core.signals import IONO_RATIO
from gbas_sim.atmosphere.paths import SignalPaths

_STREAM: Final = 21  # second word of the generator's key
_EVERYONE: Final = 2**32 - 1  # in place of a receiver's number: what strikes all of them
_BLOCK_MS: Final = 60_000
_BLOCK_S: Final = 0.001 * _BLOCK_MS
_DAY_S: Final = 86_400.0

# Known: pole of the centred dipole of 2020. Source: IGRF-13, Alken et al., Earth, Planets and Space 73 (2021) 49.
_POLE_LATITUDE_RAD: Final = math.radians(80.65)
_POLE_LONGITUDE_RAD: Final = math.radians(-72.68)
_POLE: Final[FloatArray] = np.array(
    [
        math.cos(_POLE_LATITUDE_RAD) * math.cos(_POLE_LONGITUDE_RAD),
        math.cos(_POLE_LATITUDE_RAD) * math.sin(_POLE_LONGITUDE_RAD),
        math.sin(_POLE_LATITUDE_RAD),
    ]
)

S4_RATIO: Final[FloatArray] = IONO_RATIO**0.75
"""S4 on each band over that on L1, (N_BANDS,): it goes with the frequency to the power -1.5."""

LARGEST_INDEX: Final = 1.0
"""S4 and sigma_phi saturate here: amplitudes have a Rayleigh distribution."""
_SMALLEST_S4: Final = 0.01  # below, the fading is 0.1 dB at most and left out
_DEEPEST: Final = 1e-4


_LATITUDE: Final = ("deg", 0.0, 90.0)
_BELL: Final = ("deg", math.degrees(1e-3), math.degrees(1e3))
_ZENITH: Final = "on L1 at the zenith"


@parameters
class ScintillationParams:
    """Climate of scintillation, and what it does to receivers.

    Crests (equatorial S4) and oval (auroral sigma_phi) have bell curves in magnetic latitude and in local solar time.
    Losses of lock go with S4^2 + sigma_phi^2.
    """

    equatorial_s4: Annotated[
        float, Parameter(f"S4 {_ZENITH}, on the crests at their hour; 0 switches them off", "-", 0.0, LARGEST_INDEX)
    ] = 0.7
    latitude_shift_rad: Annotated[
        float,
        Parameter(
            "added to the latitude in the dipole's field, north positive, to have the site's dip latitude",
            "deg",
            math.degrees(-0.5),
            math.degrees(0.5),
        ),
    ] = 0.0
    crest_latitude_rad: Annotated[float, Parameter("magnetic latitude of the crests north and south", *_LATITUDE)] = (
        math.radians(15.0)
    )
    crest_width_rad: Annotated[float, Parameter("standard deviation of the crests", *_BELL)] = math.radians(8.0)
    equatorial_local_s: Annotated[float, Parameter("local solar time of the crests", "s", 0.0, _DAY_S)] = 21.5 * 3600.0
    equatorial_width_s: Annotated[float, Parameter("standard deviation of that time", "s", 1.0, 1e9)] = 1.5 * 3600.0
    auroral_sigma_phi_rad: Annotated[
        float,
        Parameter(
            f"standard deviation of the phase {_ZENITH}, in the oval at its hour; 0 switches it off",
            "deg",
            0.0,
            math.degrees(LARGEST_INDEX),
        ),
    ] = 0.3
    oval_latitude_rad: Annotated[float, Parameter("magnetic latitude of the oval", *_LATITUDE)] = math.radians(67.0)
    oval_width_rad: Annotated[float, Parameter("standard deviation of the oval", *_BELL)] = math.radians(4.0)
    auroral_local_s: Annotated[float, Parameter("local solar time of the oval", "s", 0.0, _DAY_S)] = 0.0
    auroral_width_s: Annotated[float, Parameter("standard deviation of that time", "s", 1.0, 1e9)] = 4.0 * 3600.0
    loss_rate_hz: Annotated[
        float, Parameter("losses of lock a second and satellite at S4 = 1, or at sigma_phi = 1 rad", "1/s", 0.0, 1.0)
    ] = 0.02
    mean_loss_s: Annotated[float, Parameter("mean duration of a loss", "s", 0.01, 0.25 * _BLOCK_S)] = 3.0
    common_share: Annotated[
        float, Parameter("share of the losses that strike all receivers at once", "-", 0.0, 1.0)
    ] = 0.5
    correlation_s: Annotated[float, Parameter("time over which the fading becomes independent", "s", 0.1, _BLOCK_S)] = (
        1.0
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class ScintillationEpoch:
    """Scintillation at an epoch; arrays (R, N_SATS).

    Attributes
    ----------
    s4, sigma_phi_rad : arrays
        Indices on L1 [-], [rad]; 0 for satellites below the horizon.
    lost : bool array
        Where lock is lost, on all bands.
    deviate : array
        Standard normal number the fading follows from.
    """

    s4: FloatArray
    sigma_phi_rad: FloatArray
    lost: NDArray[np.bool_]
    deviate: FloatArray

    def fading_db(self, band: int = 0) -> FloatArray:
        """How far C/N0 on a band is below what it would be, (R, N_SATS) [dB]; an enhancement is negative."""
        return fading_db(np.minimum(self.s4 * S4_RATIO[band], LARGEST_INDEX), self.deviate)


@dataclass(frozen=True, kw_only=True)
class Scintillation:
    """The scintillation of one world.

    Attributes
    ----------
    params : ScintillationParams
    seed : int
    """

    params: ScintillationParams = ScintillationParams()
    seed: int = 0

    def indices(self, paths: SignalPaths) -> tuple[FloatArray, FloatArray]:
        """S4 and sigma_phi [rad] on L1, (..., R, N_SATS); 0 for satellites below the horizon."""
        params = self.params
        latitude = np.abs(magnetic_latitude_rad(paths.pierce_ecef_m) + params.latitude_shift_rad)
        local_s = paths.each(paths.tow_s) + paths.pierce_longitude[0] * (0.5 * _DAY_S / math.pi)
        evening = _bell(_around(local_s - params.equatorial_local_s) / params.equatorial_width_s)
        night = _bell(_around(local_s - params.auroral_local_s) / params.auroral_width_s)
        crest = _bell((latitude - params.crest_latitude_rad) / params.crest_width_rad)
        oval = _bell((latitude - params.oval_latitude_rad) / params.oval_width_rad)
        slant = np.sqrt(paths.shell.obliquity)
        s4 = np.minimum(params.equatorial_s4 * slant * crest * evening, LARGEST_INDEX)
        sigma_phi = np.minimum(params.auroral_sigma_phi_rad * slant * oval * night, LARGEST_INDEX)
        return np.nan_to_num(s4, nan=0.0), np.nan_to_num(sigma_phi, nan=0.0)

    def epoch(self, paths: SignalPaths, numbers: tuple[int, ...]) -> ScintillationEpoch:
        """Losses of lock and fading at one instant.

        Parameters
        ----------
        paths : SignalPaths
            Without leading axes.
        numbers : tuple of int
            Which receivers they are: another number, other losses.

        Raises
        ------
        ValueError
            When there are not as many numbers as receivers, or more than one instant.

        Notes
        -----
        Losses are drawn at the largest rate there can be and thinned to the rate of the epoch, so that a loss does not
        depend on how the indices came about, only on what they are.
        """
        if paths.position_m.ndim != 2 or len(paths.position_m) != len(numbers):
            raise ValueError(f"scintillation: {len(numbers)} receivers for paths of shape {paths.position_m.shape}")
        s4, sigma_phi = self.indices(paths)
        block, inside_ms = divmod(epoch_key(paths.gps_week, float(paths.tow_s)), _BLOCK_MS)
        inside_s = 0.001 * inside_ms
        window = _window(self.params, self.seed, numbers, block)
        share = (s4**2 + sigma_phi**2) / (2.0 * LARGEST_INDEX**2)
        lasting = (window.start_s <= inside_s) & (inside_s < window.end_s)
        place = window.place[lasting]
        lost = np.zeros(s4.shape, dtype=bool)
        lost.flat[place[window.mark[lasting] < share.flat[place]]] = True
        deviate = _between(window.deviate, inside_s / self.params.correlation_s)
        return ScintillationEpoch(s4=s4, sigma_phi_rad=sigma_phi, lost=lost, deviate=deviate)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Block:
    """What is drawn for a receiver and a block of time.

    Attributes
    ----------
    start_s, end_s, mark : (E,) arrays
        Losses: from the start of the block [s], and a number from 0 to 1 that says how easily it is suffered.
    satellite : (E,) array of int
        Whose they are.
    deviate : (L, N_SATS) array
        Independent standard normal numbers, one each correlation time.
    """

    start_s: FloatArray
    end_s: FloatArray
    mark: FloatArray
    satellite: NDArray[np.int64]
    deviate: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class _Window:
    """Losses that can last in a block, of several receivers: those of :class:`_Block`, flat; (L, R, N_SATS) deviates.

    ``place`` is the place in an array (R, N_SATS).
    """

    start_s: FloatArray
    end_s: FloatArray
    mark: FloatArray
    place: NDArray[np.int64]
    deviate: FloatArray


@lru_cache(maxsize=16)
def _window(params: ScintillationParams, seed: int, numbers: tuple[int, ...], block: int) -> _Window:
    start_s, end_s, mark, place = [], [], [], []
    for back in (0, 1):
        common = _block(params, seed, _EVERYONE, block - back)
        for row, number in enumerate(numbers):
            for losses in (common, _block(params, seed, number, block - back)):
                start_s.append(losses.start_s - back * _BLOCK_S)
                end_s.append(losses.end_s - back * _BLOCK_S)
                mark.append(losses.mark)
                place.append(row * N_SATS + losses.satellite)
    return _Window(
        start_s=np.concatenate(start_s),
        end_s=np.concatenate(end_s),
        mark=np.concatenate(mark),
        place=np.concatenate(place),
        deviate=np.stack([_block(params, seed, number, block).deviate for number in numbers], axis=1),
    )


@lru_cache(maxsize=64)
def _block(params: ScintillationParams, seed: int, number: int, block: int) -> _Block:
    """Draw one block.

    Notes
    -----
    No loss is longer than a block, so that an epoch needs its own block and the one before: with the longest mean
    allowed, one in 55 is cut short.
    """
    generator = np.random.Generator(np.random.Philox(key=[seed, _STREAM], counter=[0, 0, block, number]))
    share = params.common_share if number == _EVERYONE else 1.0 - params.common_share
    expected = 2.0 * LARGEST_INDEX**2 * params.loss_rate_hz * share * _BLOCK_S
    deviate = generator.standard_normal((math.ceil(_BLOCK_S / params.correlation_s) + 2, N_SATS))
    satellite = np.repeat(np.arange(N_SATS), generator.poisson(expected, N_SATS))
    start_s = generator.uniform(0.0, _BLOCK_S, satellite.size)
    lasting_s = np.minimum(generator.exponential(params.mean_loss_s, satellite.size), _BLOCK_S)
    return _Block(
        start_s=start_s,
        end_s=start_s + lasting_s,
        mark=generator.uniform(0.0, 1.0, satellite.size),
        satellite=satellite,
        deviate=deviate,
    )


def _between(deviates: FloatArray, place: float) -> FloatArray:
    """Standard normal numbers between those at whole places (L, ...), continuous within a block."""
    whole = int(place)
    angle = 0.5 * math.pi * (place - whole)
    return np.asarray(math.cos(angle) * deviates[whole] + math.sin(angle) * deviates[whole + 1])


def magnetic_latitude_rad(ecef_m: FloatArray) -> FloatArray:
    """Latitude ``(..., N)`` in the field of the centred dipole at ECEF positions ``(..., 3, N)`` [rad].

    The dip equator is where the dipole's is within a few degrees in Asia and South America, and up to 12 degrees north
    of it over the Atlantic and Africa: see ``latitude_shift_rad``.
    """
    radius_m = np.sqrt(np.sum(ecef_m**2, axis=-2))
    return np.asarray(np.arcsin(np.sum(ecef_m * _POLE[:, np.newaxis], axis=-2) / radius_m))


def fading_db(s4: FloatArray, deviate: FloatArray) -> FloatArray:
    """Depth of fading [dB] for an S4 and a standard normal number; 0 where S4 is below 0.01.

    The power is Nakagami's, a gamma distribution of mean 1 and shape m = 1 / S4^2, at the probability of the deviate;
    40 dB is the deepest.

    Source: Recommendation ITU-R P.531-16, 5.4.1; Fremouw, Livingston, Miller, J. Atmos. Terr. Phys. 42 (1980),
    pp. 717-731.
    """
    fading = np.zeros(np.broadcast_shapes(s4.shape, deviate.shape))
    there = s4 >= _SMALLEST_S4
    shape = 1.0 / s4[there] ** 2
    power = gammaincinv(shape, ndtr(deviate[there])) / shape
    fading[there] = -10.0 * np.log10(np.maximum(power, _DEEPEST))
    return fading


def _bell(deviation: FloatArray) -> FloatArray:
    return np.asarray(np.exp(-0.5 * deviation**2))


def _around(time_s: FloatArray) -> FloatArray:
    """A time within half a day of 0."""
    return np.asarray(time_s - _DAY_S * np.round(time_s / _DAY_S))

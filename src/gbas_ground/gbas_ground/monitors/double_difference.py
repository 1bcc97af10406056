"""Double differences of the carrier over the station's baselines, without the whole wavelengths in them.

What is left of a carrier when geometry, satellite clock and troposphere are taken off is the receiver's clock, an
unknown number of wavelengths, noise and multipath, and whatever the satellite does that it should not: a gradient of
the ionosphere over the site, an orbit that is not the broadcast one. Differences between receivers and satellites
remove the clocks; taking off the nearest multiple of the wavelength removes the unknown number, and every such multiple
of the rest with it.

Geometry is taken off receiver by receiver, with the range between the surveyed antenna and the satellite at the
transmission time of that receiver's own code, instead of the paper's product of the baseline and a difference of unit
vectors. That is exact for any baseline and for receivers that sample at different instants.

A double difference does not say which of its two satellites is the bad one. Each satellite is therefore compared with
several others, the reference satellites, and the middle one of its statistics counts: a gradient on one reference
shifts one statistic of every other satellite, but nearly all of its own.

Axes: baselines B, bands F, satellites N.

Source: Belabbas et al., A GBAS Testbed to Support New Monitoring Algorithms Development for CAT III Precision Approach,
eq (1) and (2); Khanafseh, Yang, Pervan, ION GNSS 2010. The choice of reference satellites is ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

import numpy as np

from gbas_core.gnss.frames import geodetic_from_ecef, rot_enu_ecef
from gbas_core.record import BoolArray, FloatArray, IntArray
from gbas_core.satellites import CLOCK_GROUPS, N_SATS
from gbas_core.signals import WAVELENGTH_M
from gbas_ground.monitors.carrier_noise import CarrierNoise
from gbas_ground.monitors.kernels import double_difference as kernels

Pairing = Literal["star", "all"]

NO_REFERENCE: Final = -1


@dataclass(frozen=True, kw_only=True, eq=False)
class Baselines:
    """Pairs of reference receivers and the vectors between them; made once, by :func:`baselines_of`.

    Attributes
    ----------
    first, second : (B,) int arrays
        Rows of the receivers.
    vector_m : (B, 3) array
        From the first to the second, east, north, up [m].
    place_m : (R, 3) array
        Receivers from the reference point, east, north, up [m].
    """

    first: IntArray
    second: IntArray
    vector_m: FloatArray
    place_m: FloatArray

    def __len__(self) -> int:
        return len(self.first)


def baselines_of(positions_m: FloatArray, reference_m: FloatArray, pairing: Pairing = "all") -> Baselines:
    """Baselines of a station.

    Parameters
    ----------
    positions_m : (R, 3) array
        Surveyed antennas, ECEF [m].
    reference_m : (3,) array
        Reference point, ECEF [m].
    pairing : {"all", "star"}
        Every pair of receivers, or the first receiver with each other one, as in the paper. A star ends with its first
        receiver.

    Returns
    -------
    Baselines
        None (B = 0) for a single receiver.

    Raises
    ------
    ValueError
        For another pairing.
    """
    if pairing not in ("all", "star"):
        raise ValueError(f"pairing is {pairing!r}: it must be all or star")
    latitude, longitude, _ = geodetic_from_ecef(reference_m)
    enu = (np.asarray(positions_m) - reference_m) @ rot_enu_ecef(latitude, longitude).T
    count = len(enu)
    pairs = [(i, j) for i in range(count) for j in range(i + 1, count) if pairing == "all" or i == 0]
    first, second = np.ascontiguousarray(np.array(pairs, dtype=np.int64).reshape(-1, 2).T)
    return Baselines(first=first, second=second, vector_m=enu[second] - enu[first], place_m=enu)


@dataclass(frozen=True, kw_only=True)
class Troposphere:
    """The air at the site, as in message type 2.

    Attributes
    ----------
    refractivity : float
        N_r [-].
    scale_height_m : float
        h_0 [m].
    """

    refractivity: float
    scale_height_m: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.refractivity) and self.refractivity >= 0.0):
            raise ValueError(f"troposphere: refractivity is {self.refractivity}: it must be finite and not negative")
        if not (np.isfinite(self.scale_height_m) and self.scale_height_m > 0.0):
            raise ValueError(f"troposphere: scale_height_m is {self.scale_height_m}: it must be above 0 m")

    def delay_m(self, elevation_rad: FloatArray, azimuth_rad: FloatArray, place_m: FloatArray) -> FloatArray:
        """Slant delay at each receiver, ``(R, N)`` [m].

        Parameters
        ----------
        elevation_rad, azimuth_rad : (N,) arrays
            At the reference point.
        place_m : (R, 3) array
            Receivers from the reference point, east, north, up [m].

        Notes
        -----
        The curvature of the Earth matters: a receiver 770 m nearer to the satellite sees it 0.007 degrees
        higher, mostly because its vertical is another, and at 8 degrees the delay is 15 mm less. Two metres of height
        make 4 mm there.

        Source: :func:`~gbas_ground.monitors.kernels.double_difference.slant_delays_m`.
        """
        delay = np.empty((len(place_m), len(elevation_rad)))
        kernels.slant_delays_m(
            elevation_rad, azimuth_rad, place_m, float(self.refractivity), float(self.scale_height_m), delay
        )
        return delay


def carrier_residual_m(
    carrier_m: FloatArray,
    range_m: FloatArray,
    clock_s: FloatArray,
    delay_m: FloatArray,
    bands: tuple[int, ...],
) -> FloatArray:
    """Carriers without geometry, satellite clock and troposphere.

    Parameters
    ----------
    carrier_m : (R, N_BANDS, N) array
        [m].
    range_m, clock_s : (R, N) arrays
        Expected range [m] and satellite clock [s].
    delay_m : (R, N) array
        Of the troposphere, :meth:`Troposphere.delay_m` [m].
    bands : tuple of int
        Bands kept.

    Returns
    -------
    (R, F, N) array
        Receiver clock, ambiguity and minus the ionosphere [m].
    """
    residual = np.empty((len(carrier_m), len(bands), carrier_m.shape[-1]))
    kernels.residuals_m(carrier_m, range_m, clock_s, delay_m, np.array(bands), residual)
    return residual


def reference_satellites(may_refer: BoolArray, elevation_rad: FloatArray, count: int) -> IntArray:
    """The highest satellites of each satellite's constellation, ``(N, count)``; -1 where there are fewer.

    Parameters
    ----------
    may_refer : (N,) bool array
        Satellites that are healthy and tracked.
    elevation_rad : (N,) array
    count : int
        Most reference satellites of one constellation.
    """
    found = np.empty((N_SATS, count), dtype=np.int64)
    kernels.highest(may_refer, elevation_rad, CLOCK_GROUPS, found)
    return found


class DoubleDifferences(NamedTuple):
    """One value a baseline, band and satellite: that against the middle one of its reference satellites.

    Attributes
    ----------
    residual_m : (B, F, N) array
        Within half a wavelength [m]; NaN where there is none.
    sigma_m : (B, F, N) array
        Its sigma [m].
    nominal_sigma_m : (B, F, N) array
        Sigma of the one that is the middle one without noise: for what can be detected [m].
    reference : (B, F, N) int array
        The reference satellite; -1 where there is none.
    """

    residual_m: FloatArray
    sigma_m: FloatArray
    nominal_sigma_m: FloatArray
    reference: IntArray


def double_differences(
    residual_m: FloatArray,
    baselines: Baselines,
    references: IntArray,
    elevation_rad: FloatArray,
    noise: CarrierNoise,
    bands: tuple[int, ...],
) -> DoubleDifferences:
    """Double differences of all satellites, each against its reference satellites.

    Parameters
    ----------
    residual_m : (R, F, N) array
        From :func:`carrier_residual_m`; NaN where a channel is not to be used [m].
    baselines : Baselines
    references : (N, P) int array
        From :func:`reference_satellites`.
    elevation_rad : (N,) array
    noise : CarrierNoise
    bands : tuple of int
        The F bands.

    Notes
    -----
    The middle of an even number is the smaller of the two in the middle. With P = 5, a gradient that two reference
    satellites share is found on both, and nobody else is blamed; in general with (P - 1) / 2. Fewer references than
    that, and it is the others that fail. A satellite with a single reference shares its verdict.
    """
    shape = (len(baselines), *residual_m.shape[1:])
    found, reference = np.empty((3, *shape)), np.empty(shape, dtype=np.int64)
    kernels.middle(
        np.ascontiguousarray(residual_m),
        baselines.first,
        baselines.second,
        noise.factors(len(residual_m)),
        noise.sigma_m(elevation_rad, bands),
        references,
        WAVELENGTH_M.take(bands),
        found,
        reference,
    )
    return DoubleDifferences(residual_m=found[0], sigma_m=found[1], nominal_sigma_m=found[2], reference=reference)

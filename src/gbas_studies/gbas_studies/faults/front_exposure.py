"""When does an ionospheric front cost an aircraft on approach more than its limit, before or after it has an antenna?

The front's leading edge moves along the approach at its own speed and overtakes the aircraft from behind, on its way to
the station: the aircraft is on the slope first, and nothing on the ground sees anything until the edge is over the
first antenna. Distances are along the approach, positive before the reference point; times count from that touch.

An aircraft on the slope has a slant delay that grows with r = g (v_front - v_aircraft); code is delayed and carrier
advanced, so that the smoothed range is off by ``r (2 s - t)``, with s the smoothed ramp of
:func:`gbas_studies.ccd.smoothed_error.smoothed_cmc_s`. Settled, that is the delay less 2 tau r. The station's own
smoothed range is off likewise from the touch on, and corrections take that away from the aircraft's error.

Source: limit of 2.75 m at every threshold, range domain, GAST D (known); error of smoothed ranges in a front, Pullen,
Park, Enge, Radio Science 44 (2009); closed forms ours.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from gbas_core.ranging.divergence import AIRBORNE, AIRBORNE_THRESHOLD_MPS, ramp_response
from gbas_core.record import FloatArray
from gbas_studies.ccd.smoothed_error import LONG_BEFORE, Smoothing, StudyError, smoothed_cmc_s

IONOSPHERE_LIMIT_M: Final = 2.75
SITE_RADIUS_M: Final = 450.0
"""Reference receivers are within this of the reference point [m]."""
THRESHOLD_M: Final = 5_000.0
"""Largest distance of a landing threshold from the reference point. Known, siting of GAST D [m]."""
APPROACH_M: Final = 1_200.0
"""From 200 ft on a path of 3 degrees to the threshold, where type D alone serves. Ours [m]."""
SPEEDS_MPS: Final = (55.0, 60.0, 65.0, 70.0, 75.0, 80.0, 85.0)
"""Of aircraft on approach, 107 to 165 kt over ground. Ours [m/s]."""
_LONGEST_S: Final = 900.0
_OLDER: Final = (0.0, 20.0, 60.0, 200.0)
"""Ages of air filters beyond the delay to incorporation, besides settled ones, in samples."""


@dataclass(frozen=True, kw_only=True)
class FrontLimit:
    """The first aircraft whose differential error passes the limit if nobody acts.

    Attributes
    ----------
    since_touch_s : float
        When, since the front touched the first antenna; negative: before; infinite: never [s].
    aircraft_mps, distance_m : float
        Its speed, and its distance from the reference point then.
    on_slope_s : float
        For how long the front has had it [s].
    filter_start_s : float
        Start of its filters since the front has had it; above 0: the satellite was acquired on the slope [s].
    airborne_alarm_s : float
        When its own divergence monitor (100 s filters, 0.0125 m/s) passes its threshold, since the touch [s]; infinite
        if never.
    """

    since_touch_s: float = math.inf
    aircraft_mps: float = math.nan
    distance_m: float = math.nan
    on_slope_s: float = math.nan
    filter_start_s: float = math.nan
    airborne_alarm_s: float = math.inf


def slope_error_s(start: FloatArray, sample: FloatArray, smoothing: Smoothing) -> FloatArray:
    """Error of a smoothed range over the rate of its slant delay.

    Parameters
    ----------
    start, sample : arrays of int
        Start of the filter and time, in samples since the slope has it; they broadcast.

    Returns
    -------
    array
        Metres for 1 m/s; NaN before the filter's start.
    """
    grown = smoothing.interval_s * np.maximum(np.asarray(sample, dtype=np.float64), 0.0)
    return 2.0 * smoothed_cmc_s(start, sample, smoothing) - grown


@dataclass(frozen=True, kw_only=True)
class Encounter:
    """Aircraft and site that a front may meet.

    Attributes
    ----------
    farthest_m : float
        The aircraft is within this distance of the reference point when its error passes the limit [m].
    speeds_mps : sequence of float
        Of aircraft [m/s].
    limit_m : float
    site_radius_m : float
        The first antenna is so far before the reference point, and no other farther behind it [m].
    acquiring : bool
        Aircraft may have acquired the satellite on the slope; otherwise their filters have settled before it.
    """

    farthest_m: float = THRESHOLD_M + APPROACH_M
    speeds_mps: Sequence[float] = SPEEDS_MPS
    limit_m: float = IONOSPHERE_LIMIT_M
    site_radius_m: float = SITE_RADIUS_M
    acquiring: bool = True


def front_limit(
    gradient: float,
    front_mps: float,
    smoothing: Smoothing,
    encounter: Encounter | None = None,
) -> FrontLimit:
    """The earliest passing of the limit over all aircraft within a distance, whenever the front met them.

    Parameters
    ----------
    gradient : float
        Slant gradient [m/m].
    front_mps : float
        Speed of the front along the approach; faster than all aircraft [m/s].
    smoothing : Smoothing
        Of both ends; users' filters are at least the delay to incorporation old.
    encounter : Encounter, optional

    Raises
    ------
    StudyError
        When an aircraft is not slower than the front: it is never overtaken.
    """
    encounter = Encounter() if encounter is None else encounter
    speeds_mps = encounter.speeds_mps
    if not (gradient > 0.0 and speeds_mps and front_mps > max(speeds_mps)):
        raise StudyError(
            f"front of {gradient:g} m/m at {front_mps:g} m/s: both above 0, and faster than every aircraft"
        )
    found = [_limit_of(gradient, front_mps, speed, smoothing, encounter) for speed in speeds_mps]
    return min(found, key=lambda each: each.since_touch_s)


def _limit_of(
    gradient: float, front_mps: float, speed_mps: float, smoothing: Smoothing, encounter: Encounter
) -> FrontLimit:
    """Of aircraft of one speed, over how long the front has had them and the starts of their filters."""
    interval_s, gain_mps = smoothing.interval_s, front_mps - speed_mps
    farthest_m, radius_m = encounter.farthest_m, encounter.site_radius_m
    older = _OLDER if encounter.acquiring else ()
    on_slope = np.arange(0.0, round(_LONGEST_S / interval_s) + 1.0)
    starts = np.array([on_slope - smoothing.updates - each for each in older] + [np.full_like(on_slope, LONG_BEFORE)])
    error_m = gradient * gain_mps * slope_error_s(starts, on_slope, smoothing)  # (starts, on_slope)
    # An aircraft that the front has had for so long is at the farthest place at this time, and nearer later.
    at_farthest_s = (radius_m - farthest_m + gain_mps * interval_s * on_slope) / front_mps
    station_m = _station_error_m(gradient * front_mps, 2.0 * radius_m / front_mps, smoothing)
    passing_s = np.minimum(
        *(
            _first_beyond_s(each, at_farthest_s, station_m, interval_s, encounter.limit_m)
            for each in (error_m.min(axis=0), error_m.max(axis=0))
        )
    )
    place = int(passing_s.argmin())
    since_touch_s = float(passing_s[place])
    if not math.isfinite(since_touch_s):
        return FrontLimit()
    which = int(np.abs(error_m[:, place]).argmax())
    met_s, start = since_touch_s - float(interval_s * on_slope[place]), float(starts[which, place])
    return FrontLimit(
        since_touch_s=since_touch_s,
        aircraft_mps=speed_mps,
        distance_m=farthest_m - front_mps * (since_touch_s - float(at_farthest_s[place])),
        on_slope_s=float(interval_s * on_slope[place]),
        filter_start_s=interval_s * start,
        airborne_alarm_s=met_s + _airborne_alarm_s(gradient * gain_mps, start, interval_s),
    )


def _station_error_m(rate_mps: float, crossing_s: float, smoothing: Smoothing) -> FloatArray:
    """Smallest and largest error of a receiver's settled smoothed range over time since the touch, (2, times) [m].

    The front reaches all receivers within `crossing_s` of the touch, so that any mean of them is between the two.
    """
    since = np.arange(0.0, round(_LONGEST_S / smoothing.interval_s) + 1.0)
    late = np.arange(0.0, math.ceil(crossing_s / smoothing.interval_s) + 1.0)[:, np.newaxis]
    error_m = rate_mps * slope_error_s(np.array(float(LONG_BEFORE)), since - late, smoothing)
    return np.array([error_m.min(axis=0), error_m.max(axis=0)])


def _first_beyond_s(
    error_m: FloatArray, from_s: FloatArray, station_m: FloatArray, interval_s: float, limit_m: float
) -> FloatArray:
    """First time from `from_s` on at which the error less the station's is beyond the limit [s]; infinite if never."""
    beyond = error_m[:, np.newaxis] - station_m[0] > limit_m
    beyond |= error_m[:, np.newaxis] - station_m[1] < -limit_m
    beyond &= interval_s * np.arange(station_m.shape[1]) >= from_s[:, np.newaxis]
    found = np.where(beyond.any(axis=1), interval_s * beyond.argmax(axis=1), np.inf)
    return np.where((np.abs(error_m) > limit_m) & (from_s < 0.0), from_s, found)


def _airborne_alarm_s(rate_mps: float, start: float, interval_s: float) -> float:
    """When the airborne divergence monitor alarms, since the slope has the aircraft [s]; filters start at `start`."""
    sample = np.arange(0.0, round(_LONGEST_S / interval_s) + 1.0)
    seen = 2.0 * rate_mps * ramp_response(sample - max(start, 0.0), interval_s / AIRBORNE.tau_s)  # CMC has it twice
    alarms = (seen > AIRBORNE_THRESHOLD_MPS) & (interval_s * (sample - start) >= AIRBORNE.settle_s)
    return float(interval_s * alarms.argmax()) if alarms.any() else math.inf

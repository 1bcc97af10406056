"""What fronts do to a quiet approach: ranges smoothed on both sides, the station's divergence monitor, positions.

Everything here is linear in the delays but for the monitor's verdict. A satellite it fails is taken out of the
aircraft's solution until the monitor has passed for the re-admission time. The station's other monitors are not
consulted: what they would exclude stays in.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from gbas_core.compiled import compiled
from gbas_core.positioning.wls import projection_matrix, vertical_lateral
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import SAT_INDEX, SYSTEM_MASKS
from gbas_ground.params import GroundParams
from gbas_sim.atmosphere.fronts import WedgeFront
from gbas_studies.fronts.quiet import Flight, Observed


def delay_m(front: WedgeFront, observed: Observed, satellite: int) -> FloatArray:
    """Slant delay of a satellite at all receivers, ``(T, R)`` [m]: as
    :meth:`gbas_sim.atmosphere.fronts.WedgeFront.delay`.

    Only of fronts whose distance is that of the rays.
    """
    along_m = (
        np.sin(front.direction_rad) * observed.east_m[..., satellite]
        + np.cos(front.direction_rad) * observed.north_m[..., satellite]
    )
    line_m = front.start_m + front.speed_mps * (observed.since_s - front.start_s)
    ahead_m = along_m - line_m[:, np.newaxis]
    slope = front.gradient if front.edge == "trailing" else -front.gradient
    return np.asarray(np.clip(slope * ahead_m, 0.0, front.deep_m))


def smoothed_m(delay: FloatArray, tracked: BoolArray, interval_s: float, tau_s: float) -> FloatArray:
    """Delays after the smoothing of code ``+ I`` by carrier ``- I``, ``(T, ...)`` [m].

    Parameters
    ----------
    delay, tracked : (T, ...) arrays
        Delays [m]; channels that are there: a filter starts with the first epoch, weighted 1/n while it fills.

    Source: as :func:`gbas_core.ranging.smoothing.smooth_step` ("variable").
    """
    shape = delay.shape
    columns = _smoothed(  # type: ignore[no-untyped-call]  # compiled
        delay.reshape(shape[0], -1), tracked.reshape(shape[0], -1), interval_s / tau_s
    )
    return np.asarray(columns).reshape(shape)


@compiled
def _smoothed(delay, tracked, weight):  # type: ignore[no-untyped-def]
    """Columns of :func:`smoothed_m`."""
    result = np.zeros(delay.shape)
    for column in range(delay.shape[1]):
        mean, count, before = 0.0, 0.0, delay[0, column]
        for row in range(delay.shape[0]):
            now = delay[row, column]
            count = count + 1.0 if tracked[row, column] else 0.0
            own = max(1.0 / max(count, 1.0), weight)
            mean = own * now + (1.0 - own) * (mean - (now - before))
            before = now
            result[row, column] = mean
    return result


def divergence_mps(delay: FloatArray, interval_s: float, tau_s: float) -> FloatArray:
    """Response of the divergence monitor's two filters, ``(T, ...)`` [m/s]: code less carrier is ``2 I``."""
    rate = np.zeros_like(delay)
    rate[1:] = 2.0 * np.diff(delay, axis=0) / interval_s
    weight = interval_s / tau_s
    once = lfilter([weight], [1.0, weight - 1.0], rate, axis=0)
    return np.asarray(lfilter([weight], [1.0, weight - 1.0], once, axis=0))


@dataclass(frozen=True, kw_only=True, eq=False)
class Response:
    """One set of fronts on one approach; T epochs.

    Attributes
    ----------
    error_m, level_m : (T, 2) arrays
        Position error and protection level, vertical and lateral [m].
    served : (T,) bool array
        Service without alert.
    range_error_m : (T, F) array
        Of the affected satellites [m].
    excluded : (T, F) bool array
    """

    error_m: FloatArray
    level_m: FloatArray
    served: BoolArray
    range_error_m: FloatArray
    excluded: BoolArray


@dataclass(frozen=True, kw_only=True, eq=False)
class RangeErrors:
    """What F fronts do to ranges and to the divergence monitor's statistic, whatever the station does about them.

    Attributes
    ----------
    satellites : tuple of int
        Of each front, on the satellite axis.
    smoothed_m : (T, R, F) array
        Share in the smoothed ranges, the aircraft's last [m].
    rate_mps : (T, R - 1, F) array
        Share in the filtered rates of the reference receivers [m/s].
    """

    satellites: tuple[int, ...]
    smoothed_m: FloatArray
    rate_mps: FloatArray


def range_errors(fronts: Sequence[WedgeFront], observed: Observed, station: GroundParams) -> RangeErrors:
    """Let fronts, each of one satellite, happen to the observations; of the station only the filters count."""
    satellites = tuple(SAT_INDEX[each.satellites[0]] for each in fronts)
    delay = np.stack([delay_m(each, observed, i) for each, i in zip(fronts, satellites, strict=True)], axis=-1)
    interval_s = observed.world.params.interval_s
    return RangeErrors(
        satellites=satellites,
        smoothed_m=smoothed_m(delay, observed.tracked[..., list(satellites)], interval_s, station.smoothing.tau_s[0]),
        rate_mps=divergence_mps(delay[:, :-1], interval_s, station.ccd.tau_s),
    )


def respond(
    errors: RangeErrors,
    observed: Observed,
    flight: Flight,
    station: GroundParams,
    *,
    looked_at: BoolArray | None = None,
    missing: Sequence[int] = (),
) -> Response:
    """What range errors do to an approach.

    Parameters
    ----------
    errors : RangeErrors
    observed, flight
        The observations, and the quiet approach with this station.
    station : GroundParams
    looked_at : (T,) bool array, optional
        Elsewhere satellites that are taken out stay in: it saves time.
    missing : sequence of int
        Satellites the aircraft does not use either.
    """
    satellites, interval_s = list(errors.satellites), observed.world.params.interval_s
    used = flight.used[..., satellites]
    behind = np.maximum(used.sum(axis=1), 1.0)
    correction = -(errors.smoothed_m[:, :-1] * used).sum(axis=1) / behind
    error = errors.smoothed_m[:, -1] + _latest(correction, flight.age_s, interval_s)
    quiet = np.nan_to_num(flight.divergence_mps[..., satellites])
    rate = ((errors.rate_mps + quiet) * used).sum(axis=1) / behind
    failed = (np.abs(rate) > station.ccd.threshold_mps) & station.ccd.exclude
    excluded = _excluded(failed, interval_s, station.monitors.readmission_time_s)
    out = np.zeros(flight.variance_m2.shape, dtype=bool)
    out[:, satellites] = excluded
    out[:, list(missing)] = True
    if looked_at is not None:
        out &= looked_at[:, np.newaxis]
    s, level, there = _without(flight, out)
    position = flight.error_m + (s[..., satellites] * error[:, np.newaxis]).sum(axis=-1)
    served = flight.served & there & (level <= flight.limit_m).all(axis=-1)
    return Response(error_m=position, level_m=level, served=served, range_error_m=error, excluded=excluded)


def _latest(correction: FloatArray, age_s: FloatArray, interval_s: float) -> FloatArray:
    """The corrections as the aircraft has them: of some epochs before, with their rate."""
    rate = np.zeros_like(correction)
    rate[1:] = np.diff(correction, axis=0) / interval_s
    age = np.nan_to_num(age_s)
    row = np.maximum(np.arange(len(age)) - np.rint(age / interval_s).astype(np.int64), 0)
    return np.asarray(correction[row] + rate[row] * age[:, np.newaxis])


def _excluded(failed: BoolArray, interval_s: float, readmission_s: float) -> BoolArray:
    """From the first failure until the monitor has passed for the re-admission time."""
    epochs = round(readmission_s / interval_s)
    last = np.where(failed, np.arange(len(failed))[:, np.newaxis], -10 * epochs - len(failed))
    return np.asarray(np.arange(len(failed))[:, np.newaxis] - np.maximum.accumulate(last, axis=0) <= epochs)


def _without(flight: Flight, out: BoolArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Projections, protection levels and whether there is a position, with satellites ``(T, N)`` out of the solution.

    Protection levels grow as the fault-free ones do. A station that screens anew without a satellite sends other
    sigmas: that is for flights through the whole chain.
    """
    s, level, there = flight.s, flight.level_m, np.ones(len(flight.s), dtype=bool)
    rows = np.flatnonzero((out & (flight.s[:, 0] != 0.0)).any(axis=-1) & flight.served)
    if not rows.size:
        return s, level, there
    s, level = s.copy(), level.copy()
    groups = np.stack([SYSTEM_MASKS[each] for each in "GE"])
    for row in rows:
        variance = np.where(out[row], np.nan, flight.variance_m2[row])
        projection = projection_matrix(flight.los[row], np.sqrt(variance), groups)
        if projection is None:
            there[row] = False
            continue
        new = np.stack(vertical_lateral(projection, flight.gpa_rad))
        before, after = (
            np.sqrt(np.nansum(each**2 * of, axis=-1))
            for each, of in ((flight.s[row], flight.variance_m2[row]), (new, variance))
        )
        s[row], level[row] = new, level[row] * after / before
    return s, level, there

"""C/N0 against what is expected at the satellite's elevation: low power.

A satellite that transmits with less power than it should is seen by all receivers; its C/N0, averaged over a short time
and over the receivers, is compared with a minimum that depends on the elevation. Beside the table of the configuration
a station can learn what its receivers see at each elevation; what it has learnt can raise a minimum but never lower it
below the table, so that power that fades slowly is still found in the end. A channel of its own is only compared with
the table less a margin; see also :mod:`~gbas_ground.monitors.signal_power` for the absolute minimum.

Axes: receivers R, bands F, satellites N, bins of elevation E.

Source: LAAS signal power monitor, average over receivers against a threshold by elevation (known as a principle,
numbers ours).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS
from gbas_core.signals import L1, L5, N_BANDS
from gbas_ground.monitors.false_alarm import EPOCH_S, FALSE_EXCLUSION, false_alarm_multiplier
from gbas_ground.monitors.result import MonitorResult, upper_limit

BIN_RAD: Final = float(np.radians(5.0))
"""Width of the bins of elevation a station learns in [rad]. Ours."""
N_BINS: Final = 18

# Uncertain, ours: what two geodetic receivers of 2024 never went below, less 2 dB, which is also about what the
# specified minimum powers give (-158.5 dBW on L1 over -201.5 dBW/Hz: 43 dB-Hz, less the gain lost towards the horizon
# and 5 dB for losses and fading). To be replaced by the site's own.
_ELEVATION_RAD: Final = tuple(float(each) for each in np.radians([5.0, 15.0, 30.0, 60.0, 90.0]))
_MINIMUM_DBHZ: Final = (
    (29.0, 32.0, 34.0, 37.0, 37.0),
    (25.0, 28.0, 30.0, 33.0, 33.0),
    (26.0, 28.0, 30.0, 33.0, 34.0),
)


@dataclass(frozen=True, kw_only=True)
class PowerExpectationParams:
    """Settings of the low power monitor.

    Attributes
    ----------
    bands : tuple of int
        Bands tested; the first one is due wherever a channel is, the others where they are measured.
    elevation_rad : tuple of float
        Nodes of the table, rising [rad].
    minimum_dbhz : tuple of tuple of float
        Minimum at the nodes, one row for each of the bands L1, L2, L5; constant outside the nodes [dB-Hz].
    channel_margin_db : float
        A single channel may be this much below the table: fading of one antenna [dB].
    average_s : float
        Time constant of the average [s]: at two epochs a second, a drop by twice the margin there is is found at once,
        and one by 1.07 of it in 1.5 s.
    learn : bool
        Let what the receivers saw raise the minimum.
    drop_db : float
        Then a satellite may be this much below what was learnt at its elevation: satellites differ [dB].
    learn_s : float
        Time constant of what is learnt [s].
    learnt_after_s : float
        Time a bin has to be learnt for before it counts [s].
    max_gap_s : float
        Longest gap an average goes across [s].
    """

    bands: tuple[int, ...] = (L1, L5)
    elevation_rad: tuple[float, ...] = _ELEVATION_RAD
    minimum_dbhz: tuple[tuple[float, ...], ...] = _MINIMUM_DBHZ
    channel_margin_db: float = 4.0
    average_s: float = 1.0
    learn: bool = False
    drop_db: float = 6.0
    learn_s: float = 86_400.0
    learnt_after_s: float = 3600.0
    max_gap_s: float = 3.5

    def __post_init__(self) -> None:
        nodes = np.array(self.elevation_rad)
        if nodes.size == 0 or not np.isfinite(nodes).all() or (np.diff(nodes) <= 0.0).any():
            raise ValueError(f"expected_power: elevation_rad is {self.elevation_rad}: at least one node, rising")
        if len(self.minimum_dbhz) != N_BANDS or any(len(row) != nodes.size for row in self.minimum_dbhz):
            raise ValueError(f"expected_power: minimum_dbhz is not {N_BANDS} rows of {nodes.size} nodes")
        if not np.isfinite(np.array(self.minimum_dbhz)).all():
            raise ValueError(f"expected_power: minimum_dbhz is {self.minimum_dbhz}: it must be finite")
        if not self.bands or len(set(self.bands)) != len(self.bands):
            raise ValueError(f"expected_power: bands is {self.bands}: at least one, each once")
        for name in ("average_s", "learn_s", "learnt_after_s", "max_gap_s", "drop_db"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise ValueError(f"expected_power: {name} is {getattr(self, name)}: it must be above 0")
        if not (np.isfinite(self.channel_margin_db) and self.channel_margin_db >= 0.0):
            raise ValueError(f"expected_power: channel_margin_db is {self.channel_margin_db}: it must not be negative")


def minimum_from_expectation(
    expected_dbhz: ArrayLike,
    sigma_db: float,
    n_receivers: int,
    *,
    probability: float = FALSE_EXCLUSION,
    interval_s: float = EPOCH_S,
) -> FloatArray:
    """Minimum for a table, from the C/N0 a site expects and how much the average of a receiver varies.

    Parameters
    ----------
    expected_dbhz : (...) array
        Mean of the weakest healthy satellite at each elevation [dB-Hz].
    sigma_db : float
        Sigma of one receiver's averaged C/N0 about it [dB].
    n_receivers : int
        Receivers whose fading is independent.
    probability, interval_s
        As of :func:`~gbas_ground.monitors.false_alarm.false_alarm_multiplier`; one-sided.
    """
    k = false_alarm_multiplier(probability, sides=1, interval_s=interval_s)
    return np.asarray(np.asarray(expected_dbhz, dtype=np.float64) - k * sigma_db / np.sqrt(n_receivers))


@dataclass(frozen=True, kw_only=True, eq=False)
class PowerExpectationState:
    """Averages, and what was learnt.

    Attributes
    ----------
    mean_dbhz : (R, F, N) array
        Averaged C/N0; NaN where there is none.
    unseen_s : (R, F, N) array
        Time since C/N0 was last there; NaN if it never was [s].
    learnt_dbhz : (R, F, E) array
        Mean C/N0 in each bin of elevation.
    learnt_s : (R, F, E) array
        Time learnt [s].
    """

    mean_dbhz: FloatArray
    unseen_s: FloatArray
    learnt_dbhz: FloatArray
    learnt_s: FloatArray


def initial_power_expectation(n_receivers: int, params: PowerExpectationParams) -> PowerExpectationState:
    """A monitor that has seen nothing."""
    shape, bins = (n_receivers, len(params.bands), N_SATS), (n_receivers, len(params.bands), N_BINS)
    return PowerExpectationState(
        mean_dbhz=np.full(shape, np.nan),
        unseen_s=np.full(shape, np.nan),
        learnt_dbhz=np.zeros(bins),
        learnt_s=np.zeros(bins),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class PowerExpectationResult:
    """Minus C/N0, so that larger is worse like everywhere, and minus the minimum [dB-Hz].

    Attributes
    ----------
    channels : MonitorResult
        ``(R, F, N)``.
    satellites : MonitorResult
        ``(F, N)``, averaged over the receivers.
    """

    channels: MonitorResult
    satellites: MonitorResult


def power_expectation_step(
    state: PowerExpectationState,
    cn0_dbhz: FloatArray,
    due: BoolArray,
    elevation_rad: FloatArray,
    dt_s: float,
    params: PowerExpectationParams,
) -> tuple[PowerExpectationState, PowerExpectationResult]:
    """Test one epoch.

    Parameters
    ----------
    state : PowerExpectationState
    cn0_dbhz : (R, N_BANDS, N) array
        NaN where a receiver gives none.
    due : (R, N) bool array
        Channels that must be monitored: without C/N0 they fail. Only these are learnt from.
    elevation_rad : (N,) array
    dt_s : float
        Time since the epoch before [s]; NaN at the first.
    params : PowerExpectationParams

    Returns
    -------
    state : PowerExpectationState
    result : PowerExpectationResult
        A channel that fails alone still has a part in the average: that its own power is low lowers the mean of four
        receivers by a quarter of it, and the table's margin has to pass that.
    """
    value = cn0_dbhz[:, list(params.bands)]
    there = np.isfinite(value)
    elapsed = state.unseen_s + dt_s
    goes_on = (elapsed > 0.0) & (elapsed <= params.max_gap_s)
    weight = np.where(goes_on, np.minimum(elapsed / params.average_s, 1.0), 1.0)
    before = np.where(goes_on, state.mean_dbhz, value)
    mean = before + weight * (value - before)  # NaN where there is no value
    minimum = np.array(
        [np.interp(elevation_rad, params.elevation_rad, params.minimum_dbhz[band]) for band in params.bands]
    )
    wanted = due[:, np.newaxis] & (there | (np.arange(len(params.bands)) == 0)[:, np.newaxis])
    result = _compared(mean, minimum, wanted, elevation_rad, state, params)
    learnt_dbhz, learnt_s = state.learnt_dbhz, state.learnt_s
    if params.learn and 0.0 < dt_s <= params.max_gap_s:
        taught = wanted & there & ~result.channels.failed & ~result.satellites.failed
        learnt_dbhz, learnt_s = _taught(state, value, taught, elevation_rad, dt_s, params)
    new = PowerExpectationState(
        mean_dbhz=np.where(there, mean, state.mean_dbhz),
        unseen_s=np.where(there, 0.0, elapsed),
        learnt_dbhz=learnt_dbhz,
        learnt_s=learnt_s,
    )
    return new, result


def _compared(
    mean_dbhz: FloatArray,
    minimum_dbhz: FloatArray,
    wanted: BoolArray,
    elevation_rad: FloatArray,
    state: PowerExpectationState,
    params: PowerExpectationParams,
) -> PowerExpectationResult:
    taken = wanted & np.isfinite(mean_dbhz)
    count = np.maximum(taken.sum(axis=0), 1)
    average = np.where(taken.any(axis=0), np.where(taken, mean_dbhz, 0.0).sum(axis=0) / count, np.nan)
    least = minimum_dbhz
    if params.learn:
        bins = _bins(elevation_rad)
        known = state.learnt_s[..., bins] >= params.learnt_after_s
        # the mean of what these very receivers see; without one of them known, the table alone
        expected = np.where(taken, state.learnt_dbhz[..., bins], 0.0).sum(axis=0) / count
        learnt = np.where((known | ~taken).all(axis=0), expected - params.drop_db, -np.inf)
        least = np.maximum(least, learnt)
    return PowerExpectationResult(
        channels=upper_limit(-mean_dbhz, -(minimum_dbhz - params.channel_margin_db), wanted),
        satellites=upper_limit(-average, -least, np.asarray(wanted.any(axis=0))),
    )


def _bins(elevation_rad: FloatArray) -> FloatArray:
    inside = np.where(np.isfinite(elevation_rad), elevation_rad, 0.0) / BIN_RAD
    return np.asarray(np.clip(inside.astype(np.int64), 0, N_BINS - 1))


def _taught(
    state: PowerExpectationState,
    value_dbhz: FloatArray,
    taught: BoolArray,
    elevation_rad: FloatArray,
    dt_s: float,
    params: PowerExpectationParams,
) -> tuple[FloatArray, FloatArray]:
    """What is known after this epoch: a mean at first, an exponential one later."""
    shape = state.learnt_s.shape
    row = np.arange(shape[0] * shape[1]).reshape(shape[:2])[..., np.newaxis] * N_BINS
    place = (row + _bins(elevation_rad))[taught]
    size = state.learnt_s.size
    number = np.bincount(place, minlength=size).reshape(shape)
    total = np.bincount(place, weights=value_dbhz[taught], minlength=size).reshape(shape)
    learnt_s = state.learnt_s + np.where(number > 0, dt_s, 0.0)
    weight = np.where(number > 0, np.maximum(dt_s / np.maximum(learnt_s, dt_s), dt_s / params.learn_s), 0.0)
    mean = total / np.maximum(number, 1)
    return state.learnt_dbhz + weight * (mean - state.learnt_dbhz), learnt_s

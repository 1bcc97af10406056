"""Divergence on two frequencies: the CCD monitor proposed for GAST F, which does not see the ionosphere.

From code and carrier of two bands each receiver forms the divergence-free code minus carrier of both bands (DF) and
the ionosphere-free carrier (IF), from which geometry, satellite clock, troposphere and its own clock are removed. The
rates are filtered as for GAST D and averaged over receivers, and a quadratic form of the means is compared with a
quantile of chi-square. Two forms run side by side:

- *published* (L1 and L5 only): four statistics, with ionosphere-free code minus carrier, the printed covariance and its
  pseudo-inverse, 4 degrees of freedom, threshold 47.8795. The fourth is a combination of the first two, and the printed
  covariance has a negative eigenvalue (-6.2e-11 (m/s)^2): the form is kept so that the paper can be reproduced.
- *full_rank*: DF, DF, IF carrier with a covariance of their own (:mod:`~.divergence_covariance`), 3 degrees of freedom,
  threshold 44.84.

A divergence like the ionosphere's, (1, gamma, -1, -gamma) on codes and carriers, is invisible to both, on purpose.

The receiver clock of a satellite is the mean over the *other* satellites of its constellation. Filters are linear, so
it is removed in two steps: the mean of all before the filters, and what the others have left of it behind them, which
comes to the same. A fault as large as d would appear on n others as -d/n, and pass the threshold there first if their
sigma is smaller. Behind the filters a satellite under suspicion is therefore taken out of the others' clock, together
with all it has done to it. When a satellite fails, suspicion falls on all whose carrier rate is beyond half the
threshold from the median of both constellations, whose clocks run alike; then on the largest carrier rate of its
constellation, and on the next, where that halves what is above the threshold. Where suspicion leaves too few satellites
of a constellation, the clock is that of both.

A channel that misses epochs bridges the gap with the mean accumulated meanwhile.

Source: Jiang, Milner, Macabiau, ENC 2015, eq (8) to (18).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Final, Literal

import numpy as np

from gbas_core.parameters import Derived, Parameter, ParameterError, parameters
from gbas_core.ranging.combinations import divergence_free_cmc, ionosphere_free
from gbas_core.ranging.divergence import (
    GROUND,
    DivergenceParams,
    DivergenceState,
    divergence_step,
    initial_divergence,
    rate_step,
    settled,
)
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import CLOCK_GROUPS, N_SATS, missing
from gbas_core.signals import BAND_INDEX, L1, L5, SPEED_OF_LIGHT_MPS
from gbas_ground.monitors.ccd import receiver_mean
from gbas_ground.monitors.divergence_classification import MODES, NO_FAULT, classify
from gbas_ground.monitors.divergence_covariance import (
    StatisticCovariance,
    Triangle,
    matrix_of,
    triangle,
)
from gbas_ground.monitors.divergence_forms import (
    DEGREES_OF_FREEDOM,
    Form,
    full_rank_form,
    published_form,
    threshold,
    with_iono_free_code,
)
from gbas_ground.monitors.expected_range import row_median
from gbas_ground.monitors.false_alarm import exposure_probability, least_correlation
from gbas_ground.monitors.interface import MonitoredEpoch, MonitorOutput, SignalMonitor, Verdict, verdicts
from gbas_ground.monitors.monitor_table import summarise
from gbas_ground.monitors.result import MonitorResult, upper_limit
from gbas_msgs_py.codes import Signal
from gbas_msgs_py.monitors import CCD_F

if TYPE_CHECKING:
    from gbas_ground.prepared import PreparedStation

# Known: obliquity 1 / sqrt(0.002 + sin^2 E). Source: ICAO Annex 10 Vol. I, App. B 3.6.5.3.
_OBLIQUITY: Final = 0.002
# Uncertain, ours: more satellites at once are no satellites' faults, and all of them fail.
_MOST_SUSPECTS: Final = 4
# Uncertain, ours: of the threshold; a satellite that is in no clock costs little, a faulty one that is in them much.
_SUSPICION: Final = 0.5
LARGEST_ZENITH_DELAY_M: Final = 5.0
"""Air has 2.2 to 2.8 m."""
_ALL: Final = np.ones((1, N_SATS), dtype=bool)


@parameters
class TwoFrequencyParams:
    """Code-carrier divergence on two bands (GAST-F).

    The filters are those of the single-band monitor. The troposphere at the station is removed from the carrier: at 5
    degrees its rate reaches 0.03 m/s.
    """

    exclude: Annotated[
        Literal["full_rank", "published", "none"], Parameter("form whose failures are excluded")
    ] = "full_rank"  # fmt: skip
    other_band: Annotated[Literal["L2", "L5"], Parameter("band beside L1")] = "L5"
    p_false_alarm: Annotated[float, Parameter("of a satellite and epoch", "-", 1e-12, 0.5)] = 1e-9
    min_clock_satellites: Annotated[
        int, Parameter("fewest others a receiver's clock is averaged from", "-", 1, 35)
    ] = 3  # fmt: skip
    receiver_covariance: Annotated[
        Triangle,
        Parameter(
            "of DF, DF other, IF carrier, upper triangle by rows: part of each receiver, divided by their number",
            "(m/s)^2", -1.0, 1.0,
        ),
    ] = (0.0,) * 6  # fmt: skip
    common_covariance: Annotated[
        Triangle,
        Parameter(
            "likewise: part that the receivers share, never divided; the default is the published bound",
            "(m/s)^2", -1.0, 1.0,
        ),
    ] = triangle(StatisticCovariance().common)  # fmt: skip
    elevation_rad: Annotated[
        tuple[float, ...],
        Parameter("nodes of the factors, rising; empty: no dependence on elevation", "deg", 0.0, 90.0),
    ] = ()
    factor_df: Annotated[
        tuple[float, ...], Parameter("on the standard deviation of DF at the nodes", "-", 0.01, 100.0)
    ] = ()
    factor_df_other: Annotated[tuple[float, ...], Parameter("of DF of the other band", "-", 0.01, 100.0)] = ()
    factor_if_carrier: Annotated[tuple[float, ...], Parameter("of the IF carrier", "-", 0.01, 100.0)] = ()
    filters: Annotated[DivergenceParams, Derived("those of the single-band monitor")] = GROUND
    zenith_delay_m: Annotated[float, Derived("troposphere at the station", "m", 0.0, LARGEST_ZENITH_DELAY_M)] = 2.4

    def __post_init__(self) -> None:
        for name in ("factor_df", "factor_df_other", "factor_if_carrier"):
            if len(getattr(self, name)) != len(self.elevation_rad):
                raise ParameterError(f"{name} = {getattr(self, name)} is not one number a node of elevation_deg")
        _ = self.covariance  # what is none is refused here

    @property
    def band(self) -> int:
        """First band: L1."""
        return L1

    @cached_property
    def other(self) -> int:
        """Second band: L5 (with it E5a), or L2."""
        return BAND_INDEX[self.other_band]

    @cached_property
    def covariance(self) -> StatisticCovariance:
        """Covariance of the statistics of the form of full rank."""
        factors = (self.factor_df, self.factor_df_other, self.factor_if_carrier)
        return StatisticCovariance(
            receiver=matrix_of(self.receiver_covariance),
            common=matrix_of(self.common_covariance),
            elevation_rad=self.elevation_rad,
            factor=tuple(zip(*factors, strict=True)),
        )

    def with_covariance(self, covariance: StatisticCovariance) -> TwoFrequencyParams:
        """The same with another covariance."""
        factors = [tuple(each) for each in zip(*covariance.factor, strict=True)] or [()] * 3
        return replace(
            self,
            receiver_covariance=triangle(covariance.receiver),
            common_covariance=triangle(covariance.common),
            elevation_rad=covariance.elevation_rad,
            factor_df=factors[0],
            factor_df_other=factors[1],
            factor_if_carrier=factors[2],
        )

    def p_false_exclusion(self, tau_s: float) -> float:
        """Of one source in 15 s, by the form that excludes: 1.9e-8 for 1e-9 an epoch and filters of 30 s."""
        if self.exclude == "none":
            return 0.0
        form: Form = "published" if self.exclude == "published" else "full_rank"
        limit = math.sqrt(threshold(form, self.p_false_alarm))
        return exposure_probability(limit, least_correlation(tau_s), freedom=DEGREES_OF_FREEDOM[form])


@dataclass(frozen=True, kw_only=True, eq=False)
class TwoFrequencyInput:
    """One epoch of all receivers; missing is NaN.

    Attributes
    ----------
    code_m, carrier_m : (R, N_BANDS, N) arrays
        Raw code and carrier ranges [m].
    restarted : (R, N_BANDS, N) bool array
        Cycle slips, code jumps and restarts; one on either band restarts all statistics of the channel.
    range_m, clock_s : (R, N) arrays
        Expected geometric range [m] and broadcast satellite clock [s].
    rebased : (N,) bool array
        Satellites whose expected range jumped now, because another ephemeris came into use.
    elevation_rad : (N,) array
    used : (R, N) bool array
        Receivers averaged for each satellite.
    clock_used : (R, N) bool array
        Satellites that may be in the receivers' clocks: not those a monitor has failed.
    """

    code_m: FloatArray
    carrier_m: FloatArray
    restarted: BoolArray
    range_m: FloatArray
    clock_s: FloatArray
    rebased: BoolArray
    elevation_rad: FloatArray
    used: BoolArray
    clock_used: BoolArray


@dataclass(frozen=True, kw_only=True, eq=False)
class TwoFrequencyState:
    """What the monitor remembers.

    Attributes
    ----------
    codes : DivergenceState
        ``(2, R, N)``: DF of both bands.
    carrier : DivergenceState
        ``(R, N)``: filters of the compensated IF carrier's rate, less the mean of all.
    residual_m : (R, N) array
        Last IF carrier less geometry, satellite clock and troposphere [m].
    clock_m : (R, N) array
        Mean of all accumulated since then [m].
    since_s : (R, N) array
        Time since then [s].
    rebased : (N,) bool array
        Of the last epoch.
    """

    codes: DivergenceState
    carrier: DivergenceState
    residual_m: FloatArray
    clock_m: FloatArray
    since_s: FloatArray
    rebased: BoolArray


@dataclass(frozen=True, kw_only=True, eq=False)
class TwoFrequencyEpoch:
    """Result of one epoch.

    Attributes
    ----------
    receiver_mps : (3, R, N) array
        Filtered DF, DF of the other band and IF carrier of each channel; the carrier only where enough other channels
        have settled to give the clock [m/s].
    settled : (R, N) bool array
        Where all three count.
    mean_mps : (4, N) array
        Means over the settled receivers in use, with IF code minus carrier in the paper's third place [m/s].
    receivers : (N,) array
        How many those are; 0: the satellite is not monitored.
    clock_satellites : (N,) array
        Fewest satellites behind the clock of a receiver averaged.
    covariance : (N, 3, 3) array
        Of the full-rank form's means [(m/s)^2].
    published, full_rank : MonitorResult
        ``(N,)``: quadratic form against its threshold [-].
    """

    receiver_mps: FloatArray
    settled: BoolArray
    mean_mps: FloatArray
    receivers: FloatArray
    clock_satellites: FloatArray
    covariance: FloatArray
    published: MonitorResult
    full_rank: MonitorResult


def initial_two_frequency(params: TwoFrequencyParams, n_receivers: int) -> TwoFrequencyState:
    """State of a monitor that has seen nothing."""
    shape = (n_receivers, N_SATS)
    return TwoFrequencyState(
        codes=initial_divergence(params.filters, 2, n_receivers),
        carrier=initial_divergence(params.filters, n_receivers),
        residual_m=np.full(shape, np.nan),
        clock_m=np.zeros(shape),
        since_s=np.zeros(shape),
        rebased=np.zeros(N_SATS, dtype=bool),
    )


def two_frequency_step(
    state: TwoFrequencyState, epoch: TwoFrequencyInput, dt_s: float, params: TwoFrequencyParams
) -> tuple[TwoFrequencyState, TwoFrequencyEpoch]:
    """Monitor one epoch.

    Parameters
    ----------
    state : TwoFrequencyState
        From :func:`initial_two_frequency` or the previous step.
    epoch : TwoFrequencyInput
    dt_s : float
        Time since the epoch before, NaN at the first [s].
    params : TwoFrequencyParams
    """
    restarted = epoch.restarted[:, params.band] | epoch.restarted[:, params.other]
    codes, _, code_rates = divergence_step(
        state.codes, _divergence_free(epoch, params), restarted, dt_s, params.filters
    )
    new, carrier_rate = _carrier(state, epoch, restarted, dt_s, params)
    counts = settled(codes, params.filters).all(axis=0) & settled(new.carrier, params.filters)
    suspect = np.zeros(N_SATS, dtype=bool)
    result = _judged(code_rates, carrier_rate, counts, suspect, epoch, params)
    in_clock = np.logical_or.reduce(epoch.clock_used, axis=0)  # what is in no clock disturbs none
    if (result.full_rank.failed & in_clock).any():
        apart = _apart(result, carrier_rate, counts, epoch, params)
        if apart.any():
            without = _judged(code_rates, carrier_rate, counts, apart, epoch, params)
            if _explains(without, result, ~apart, 1.0):
                suspect, result = apart, without
    for group in CLOCK_GROUPS & in_clock:
        for _ in range(_MOST_SUSPECTS):
            if not (result.full_rank.failed & group & ~suspect).any():
                break
            more = suspect | _most_deviant(result, group & ~suspect)
            without = _judged(code_rates, carrier_rate, counts, more, epoch, params)
            if not _explains(without, result, group & ~more, 0.5):
                break
            suspect, result = more, without
    return replace(new, codes=codes), result


def _apart(
    result: TwoFrequencyEpoch, rate_mps: FloatArray, counts: BoolArray, epoch: TwoFrequencyInput,
    params: TwoFrequencyParams,
) -> BoolArray:  # fmt: skip
    """Satellites in the clocks whose carrier rate is far from the median, which a minority does not move, ``(N,)``."""
    rate = np.where(counts & epoch.clock_used, rate_mps, np.nan)
    deviation = rate - row_median(rate)
    there = np.isfinite(deviation)
    mean = np.where(there, deviation, 0.0).sum(axis=0) / np.maximum(there.sum(axis=0), 1)
    variance = result.covariance[:, 2, 2]
    return np.asarray(mean**2 > _SUSPICION**2 * threshold("full_rank", params.p_false_alarm) * variance)


def _explains(without: TwoFrequencyEpoch, result: TwoFrequencyEpoch, rest: BoolArray, share: float) -> bool:
    """Whether it was the clock: all that failed can be judged, and of what the rest had too much a share is left."""
    judged = np.isfinite(without.full_rank.statistic[result.full_rank.failed]).all()
    return bool(judged and _excess(without, rest) <= share * _excess(result, rest))


def _most_deviant(result: TwoFrequencyEpoch, candidates: BoolArray) -> BoolArray:
    """The monitored candidate with the largest carrier rate, as a mask."""
    size = np.where(candidates & (result.receivers > 0), np.abs(result.mean_mps[3]), -1.0)
    found: BoolArray = (np.arange(N_SATS) == size.argmax()) & (size >= 0.0)
    return found


def _excess(result: TwoFrequencyEpoch, satellites: BoolArray) -> float:
    """Sum of the failed metrics of some satellites."""
    return float(result.full_rank.statistic[result.full_rank.failed & satellites].sum())


def _judged(
    code_rates: FloatArray,
    carrier_rate: FloatArray,
    counts: BoolArray,
    suspect: BoolArray,
    epoch: TwoFrequencyInput,
    params: TwoFrequencyParams,
) -> TwoFrequencyEpoch:
    """Statistics and verdicts with receiver clocks that do without the satellites under suspicion."""
    member, fewest = counts & epoch.clock_used & ~suspect, params.min_clock_satellites
    clock, others = _others_mean(carrier_rate, member, fewest)
    if suspect.any():
        both, of_both = _others_mean(carrier_rate, member, fewest, groups=_ALL)
        few = others < fewest
        clock, others = np.where(few, both, clock), np.where(few, of_both, others)
    receiver = np.concatenate([code_rates, (carrier_rate - clock)[np.newaxis]])
    counts = counts & np.isfinite(clock)
    averaged = counts & epoch.used
    rates, count = receiver_mean(receiver.swapaxes(0, 1), averaged[:, np.newaxis])
    receivers = count[0]
    n_clock = np.where(averaged, others, np.inf).min(axis=0)
    covariance = params.covariance.at(epoch.elevation_rad, receivers, n_clock)
    means = with_iono_free_code(rates, params.band, params.other)
    return TwoFrequencyEpoch(
        receiver_mps=receiver,
        settled=counts,
        mean_mps=means,
        receivers=receivers,
        clock_satellites=np.where(receivers > 0, n_clock, np.nan),
        covariance=covariance,
        published=_published(means, receivers, params),
        full_rank=upper_limit(
            full_rank_form(rates, covariance), threshold("full_rank", params.p_false_alarm), receivers > 0
        ),
    )


def _published(means_mps: FloatArray, receivers: FloatArray, params: TwoFrequencyParams) -> MonitorResult:
    """The paper's form, for L1 and L5 alone: its covariance is of these, and so singular only with their ratio."""
    applies = (receivers > 0) & ((params.band, params.other) == (L1, L5))
    statistic = np.where(applies, published_form(means_mps, receivers), np.nan)
    return upper_limit(statistic, threshold("published", params.p_false_alarm), applies)


def _divergence_free(epoch: TwoFrequencyInput, params: TwoFrequencyParams) -> FloatArray:
    """Divergence-free code minus carrier of both bands, (2, R, N) [m]."""
    code, carrier = epoch.code_m, epoch.carrier_m
    a, b = params.band, params.other
    return np.stack(
        [
            divergence_free_cmc(code[:, a], carrier[:, a], carrier[:, b], a, b),
            divergence_free_cmc(code[:, b], carrier[:, b], carrier[:, a], b, a),
        ]
    )


def _carrier(
    state: TwoFrequencyState, epoch: TwoFrequencyInput, restarted: BoolArray, dt_s: float, params: TwoFrequencyParams
) -> tuple[TwoFrequencyState, FloatArray]:
    """Filtered rate of the compensated IF carrier less the mean of all, ``(R, N)``."""
    a, b = params.band, params.other
    iono_free = ionosphere_free(epoch.carrier_m[:, a], epoch.carrier_m[:, b], a, b)
    troposphere = params.zenith_delay_m / np.sqrt(_OBLIQUITY + np.sin(epoch.elevation_rad) ** 2)
    residual = iono_free - epoch.range_m + SPEED_OF_LIGHT_MPS * epoch.clock_s - troposphere
    since_s = state.since_s + (dt_s if dt_s > 0.0 else np.inf)
    alive = np.isfinite(state.residual_m) & ~restarted & (since_s <= params.filters.max_gap_s)
    present = np.isfinite(residual)
    change = np.where(alive & present & ~epoch.rebased, residual - state.residual_m, np.nan)
    # Channels measured at the last epoch, too: what they have in common is the clock of this one interval.
    together = np.isfinite(change) & (state.since_s == 0.0)
    accumulated = state.clock_m + _mean_of_all(change, together & epoch.clock_used)
    rate = (change - accumulated) / since_s
    # The one epoch at which the expected range jumps tells nothing: the filter goes on with the rate it has.
    coasting = epoch.rebased & ~state.rebased & alive & present
    rate = np.where(coasting, state.carrier.f1_mps, rate)
    carrier, filtered = rate_step(state.carrier, rate, since_s, restarted, dt_s, params.filters)
    new = TwoFrequencyState(
        codes=state.codes,
        carrier=carrier,
        residual_m=np.where(present, residual, np.where(alive, state.residual_m, np.nan)),
        clock_m=np.where(present, 0.0, accumulated),
        since_s=np.where(present, 0.0, since_s),
        rebased=epoch.rebased,
    )
    return new, filtered


def _mean_of_all(values: FloatArray, member: BoolArray) -> FloatArray:
    """Mean over the members of each receiver ``(R, 1)``; NaN where there are none."""
    count = member.sum(axis=-1, keepdims=True)
    total = np.where(member, values, 0.0).sum(axis=-1, keepdims=True)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def _others_mean(
    values: FloatArray, member: BoolArray, fewest: int, *, groups: BoolArray = CLOCK_GROUPS
) -> tuple[FloatArray, FloatArray]:
    """Mean over the other members of the same group, and how many they are, ``(R, N)``; NaN below `fewest`.

    Source: ENC 2015, eq (13), with i for the first j.
    """
    own = np.where(member, values, 0.0)
    total, count = np.zeros_like(own), np.zeros_like(own)
    for group in groups:
        total += np.where(group, (own * group).sum(axis=-1, keepdims=True), 0.0)
        count += np.where(group, (member & group).sum(axis=-1, keepdims=True), 0)
    others = count - member
    mean = (total - own) / np.maximum(others, 1.0)
    return np.where(others >= fewest, mean, np.nan), others


# --- in the station


def _initial(station: PreparedStation) -> TwoFrequencyState:
    return initial_two_frequency(station.ccd_f, station.params.n_receivers)


def _step(state: TwoFrequencyState, epoch: MonitoredEpoch) -> tuple[TwoFrequencyState, MonitorOutput]:
    """Where a satellite has no second band there is nothing to judge: the single-band monitor has it."""
    inputs, params = epoch.inputs, epoch.inputs.station.ccd_f
    given = TwoFrequencyInput(
        code_m=inputs.code_m,
        carrier_m=inputs.carrier_m,
        restarted=inputs.slipped,
        range_m=inputs.predicted.range_m,
        clock_s=inputs.predicted.clock_s,
        rebased=inputs.rebased,
        elevation_rad=inputs.predicted.elevation_rad,
        used=inputs.ready,
        clock_used=inputs.usable,
    )
    state, found = two_frequency_step(state, given, inputs.dt_s, params)
    forms = {"full_rank": found.full_rank, "published": found.published}
    due = inputs.due & (found.receivers > 0)
    signal = Signal.L1_L5 if params.other == L5 else Signal.L1_L2
    satellites: tuple[Verdict, ...] = ()
    if params.exclude != "none":
        satellites = verdicts(True, CCD_F.test(params.exclude).cause, forms[params.exclude], due, power=2)
    return state, MonitorOutput(
        summaries={CCD_F.key(name): summarise(result, due, signal) for name, result in forms.items()},
        details={"divergence_mps": found.mean_mps, **_likeliest_mode(found, due, params)},
        satellites=satellites,
    )


def _likeliest_mode(epoch: TwoFrequencyEpoch, due: BoolArray, params: TwoFrequencyParams) -> dict[str, FloatArray]:
    """Mode and its probability of the satellites that fail; missing for the rest."""
    failed = due & epoch.full_rank.failed & np.isfinite(epoch.full_rank.statistic)
    if not failed.any():
        return {}
    found = classify(epoch.mean_mps[[0, 1, 3]][:, failed], epoch.covariance[failed], params.band, params.other)
    mode, probability = missing(), missing()
    number = found.posterior.argmax(axis=0)
    mode[failed] = np.where(number == MODES.index(NO_FAULT), 0, number + 1)
    probability[failed] = found.posterior.max(axis=0)
    return {"ccd_f_mode": mode, "ccd_f_mode_probability": probability}


MONITOR: Final = SignalMonitor(entry=CCD_F, parameters=TwoFrequencyParams, initial=_initial, step=_step)

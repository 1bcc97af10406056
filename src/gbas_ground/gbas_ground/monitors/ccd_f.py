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
comes to the same. There a satellite under suspicion is taken out of the others' clock, together with all it has done to
it (:mod:`~.divergence_suspects`).

A channel that misses epochs bridges the gap with the mean accumulated meanwhile.

Source: Jiang, Milner, Macabiau, ENC 2015, eq (8) to (18).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Final, Literal, NamedTuple

import numpy as np

from gbas_core.parameters import Derived, Parameter, ParameterError, parameters
from gbas_core.ranging.combinations import iono_free_weights, iono_ratio
from gbas_core.ranging.divergence import GROUND, DivergenceParams
from gbas_core.record import BoolArray, FloatArray, IntArray
from gbas_core.satellites import N_SATS, missing
from gbas_core.signals import BAND_INDEX, L1, L5
from gbas_ground.monitors.divergence_classification import MODES, NO_FAULT, classify
from gbas_ground.monitors.divergence_covariance import (
    StatisticCovariance,
    Triangle,
    matrix_of,
    triangle,
)
from gbas_ground.monitors.divergence_forms import DEGREES_OF_FREEDOM, PRINTED_INVERSE, Form, threshold
from gbas_ground.monitors.divergence_suspects import Judge, TwoFrequencyEpoch, without_suspects
from gbas_ground.monitors.false_alarm import exposure_probability, least_correlation
from gbas_ground.monitors.interface import MonitoredEpoch, MonitorOutput, SignalMonitor, Verdict, verdicts
from gbas_ground.monitors.kernels import ccd_f as kernels
from gbas_ground.monitors.kernels.divergence_filter import initial_memory
from gbas_ground.monitors.monitor_table import summarise
from gbas_msgs_py.codes import Signal
from gbas_msgs_py.monitors import CCD_F

if TYPE_CHECKING:
    from gbas_ground.prepared import PreparedStation

LARGEST_ZENITH_DELAY_M: Final = 5.0
"""Air has 2.2 to 2.8 m."""


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

    @cached_property
    def bands(self) -> IntArray:
        """Both bands."""
        return np.array([self.band, self.other])

    @cached_property
    def weights(self) -> FloatArray:
        """Gains of the divergence-free combinations of both bands, and coefficients of the ionosphere-free one."""
        a, b = self.band, self.other
        gains = [2.0 / (iono_ratio(*pair) - 1.0) for pair in ((a, b), (b, a))]
        return np.array([*gains, *iono_free_weights(a, b)])

    @cached_property
    def limits(self) -> FloatArray:
        """Thresholds of the published form and of that of full rank, for every satellite, ``(2, N)``."""
        limits = [[threshold(form, self.p_false_alarm)] for form in ("published", "full_rank")]
        return np.array(limits) * np.ones(N_SATS)

    @cached_property
    def published_inverse(self) -> FloatArray:
        """Of the published covariance; it is for L1 and L5 alone, and so singular only with their ratio."""
        applies = (self.band, self.other) == (L1, L5)
        return np.where(applies, PRINTED_INVERSE, np.nan)

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


class TwoFrequencyInput(NamedTuple):
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
    filters : (3, 5, R, N) array
        Memory of the filters (:mod:`~.kernels.divergence_filter`) of DF of both bands, and of the compensated IF
        carrier's rate, less the mean of all.
    carriers : (3, R, N) array
        Last IF carrier less geometry, satellite clock and troposphere [m]; mean of all accumulated since then [m]; time
        since then [s].
    rebased : (N,) bool array
        Of the last epoch.
    """

    filters: FloatArray
    carriers: FloatArray
    rebased: BoolArray


def initial_two_frequency(n_receivers: int) -> TwoFrequencyState:
    """State of a monitor that has seen nothing."""
    carriers = np.zeros((3, n_receivers, N_SATS))
    carriers[0] = np.nan
    filters = np.stack([initial_memory(n_receivers)] * 3)
    return TwoFrequencyState(filters=filters, carriers=carriers, rebased=np.zeros(N_SATS, dtype=bool))


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
    filters, shape = params.filters, epoch.used.shape
    memory, carriers = np.empty(state.filters.shape), np.empty(state.carriers.shape)
    rates, settled = np.empty((3, *shape)), np.empty(shape, dtype=bool)
    kernels.advanced(
        state.filters,
        state.carriers,
        state.rebased,
        epoch.code_m,
        epoch.carrier_m,
        epoch.restarted,
        epoch.range_m,
        epoch.clock_s,
        epoch.rebased,
        epoch.elevation_rad,
        epoch.clock_used,
        params.bands,
        params.weights,
        float(dt_s),
        float(filters.tau_s),
        float(filters.max_gap_s),
        float(filters.settle_s),
        float(params.zenith_delay_m),
        memory,
        carriers,
        rates,
        settled,
    )
    new = TwoFrequencyState(filters=memory, carriers=carriers, rebased=epoch.rebased)
    return new, without_suspects(Judge(rates, settled, epoch, params))


# --- in the station


def _initial(station: PreparedStation) -> TwoFrequencyState:
    return initial_two_frequency(station.params.n_receivers)


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
    if not epoch.full_rank.failed.any():
        return {}
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

# mypy: disable-error-code="no-untyped-call"
"""Third stage of an epoch: from smoothed ranges and what the station told to ranges a position may be made of.

Every rule that does not need the position is applied here; elevation, distance and the range test follow in
:mod:`gbas_airborne.navigation.position`.

Source: ICAO Annex 10 vol. I, App. B 3.6.5.2; RTCA DO-253 2.3.8.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gbas_airborne.modes import N_SIGNALS, air_model, bands_of, pair, processing_of
from gbas_airborne.params import OF_LEVELS, AirborneParams
from gbas_airborne.ranging.kernels.corrected_ranges import correct_ranges
from gbas_airborne.ranging.own_ranges import DIVERGENCE, SmoothedRanges, Tracked
from gbas_airborne.reception.columns import B_VALUES, SIGMA
from gbas_airborne.reception.receive import Received
from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.record import BoolArray, FloatArray, IntArray
from gbas_core.satellites import missing, satellites_of
from gbas_msgs_py.codes import Rejection
from gbas_msgs_py.modes import Mode
from gbas_msgs_py.records import MAX_REFERENCE_RECEIVERS
from gbas_vdb.messages.ephemeris_crc import ephemeris_crcs


@dataclass(frozen=True, kw_only=True, eq=False)
class OwnEphemerides:
    """Own ephemerides with the issue of data of a product's corrections.

    Attributes
    ----------
    ephemeris : Ephemeris
    crc : (N_SATS,) array
        Their CRCs; NaN where there is none.
    """

    ephemeris: Ephemeris = field(default_factory=lambda: Ephemeris(gps_week=0, tow_s=0.0))
    crc: FloatArray = field(default_factory=missing)


@dataclass(frozen=True, kw_only=True, eq=False)
class CorrectState:
    """Own ephemerides last matched with corrections, by product."""

    matched: Mapping[str, OwnEphemerides] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True, eq=False)
class RangingSources:
    """Satellites an epoch offers to a mode, on the satellite axis; what needs no position.

    Attributes
    ----------
    mode : Mode
    reason : (N_SATS,) int array
        :class:`Rejection`.
    range_m : (N_SATS,) array
        Smoothed range with corrections and satellite clock, without troposphere [m]; NaN where there is none.
    satellite_m : (3, N_SATS) array
        Satellite positions at transmission, ECEF of that time [m].
    applied : (rows, N_SATS) array
        Corrections as they are in the range, the sigma being that of the protection levels; rows of
        :mod:`gbas_airborne.reception.columns`. All NaN without corrections.
    weight_sigma_m : (N_SATS,) array
        Sigma of the correction for the weight [m].
    noise_factor : (2, signals, N_SATS) array
        Factors on airborne noise and multipath for levels and for weights, see
        :func:`gbas_airborne.ranging.kernels.corrected_ranges.settling_factor` [-].
    settled_s : (N_SATS,) array
        Time since the start of the smoothing filter, of the younger one of two signals [s].
    age_s : float
        Age of the corrections, of the older ones of two signals [s]; NaN without corrections.
    own_crc : (N_SATS,) array
        CRC of the ephemeris the receiver has for the correction; NaN where it has none.
    beside : RangingSources or None
        Those of the mode beside this one.
    divergence_mps : (N_SATS,) array
        Filtered rate of code minus carrier, where it is monitored [m/s].
    """

    mode: Mode
    reason: NDArray[np.int64]
    range_m: FloatArray
    satellite_m: FloatArray
    applied: FloatArray
    weight_sigma_m: FloatArray
    noise_factor: FloatArray
    settled_s: FloatArray
    age_s: float
    own_crc: FloatArray
    beside: RangingSources | None = None
    divergence_mps: FloatArray = field(default_factory=missing)

    @property
    def corrected(self) -> bool:
        """Whether there are corrections at all."""
        return math.isfinite(self.age_s)


@dataclass(frozen=True, kw_only=True, eq=False)
class Corrected:
    """What was received, and the ranging sources of each mode."""

    received: Received
    sources: tuple[RangingSources, ...]


def correct(
    state: CorrectState, tracked: Tracked, modes: tuple[Mode, ...], params: AirborneParams
) -> tuple[CorrectState, Corrected]:
    """Ranging sources of every mode.

    Ephemerides are those with the issue of data of the corrections; their CRCs are made once each.
    """
    received = tracked.received
    station, sets = received.station, received.corrections
    served = station is not None and (station.healthy or params.use_unhealthy)
    ranges = {mode.number: tracked.ranges(mode) for mode in modes}
    corrected = [mode for mode in modes if served and all(name in sets for name in _sets_of(mode))]
    products = tuple(dict.fromkeys(name for mode in corrected for name in _sets_of(mode)))
    matched = {name: _match(state.matched.get(name), name, received) for name in products}
    sources = {mode.number: _without_station(mode, ranges[mode.number]) for mode in modes if mode not in corrected}
    if corrected:
        sources |= _sources(corrected, ranges, products, matched, received, params)
    found = tuple(_without_divergence(_with_beside(sources[mode.number], sources, modes), tracked) for mode in modes)
    return CorrectState(matched={**state.matched, **matched}), Corrected(received=received, sources=found)


def _sets_of(mode: Mode) -> tuple[str, ...]:
    """Names of the sets of corrections a mode needs."""
    return (*mode.products, *mode.levels)


def _with_beside(
    sources: RangingSources, all_sources: Mapping[int, RangingSources], modes: tuple[Mode, ...]
) -> RangingSources:
    """The sources of a mode with another beside it: only satellites that both may use."""
    mode = sources.mode
    if not mode.beside:
        return sources
    beside = all_sources[next(each.number for each in modes if each.name == mode.same_systems(mode.beside))]
    reason = np.where(sources.reason == int(Rejection.NONE), beside.reason, sources.reason)
    return replace(sources, reason=reason, beside=beside)


def _without_divergence(sources: RangingSources, tracked: Tracked) -> RangingSources:
    """The sources of a mode that needs the divergence monitor: what it excludes, or cannot judge yet, is not used."""
    found = tracked.divergence
    if DIVERGENCE not in sources.mode.monitors or found is None:
        return sources
    bands = list(bands_of(sources.mode))
    excluded, counts = found.excluded[bands].any(axis=0), found.counts[bands].all(axis=0)
    why = np.where(excluded, int(Rejection.DIVERGENCE), int(Rejection.NOT_SETTLED))
    reason = np.where((sources.reason == int(Rejection.NONE)) & (excluded | ~counts), why, sources.reason)
    return replace(sources, reason=reason, divergence_mps=found.rate_mps[bands[0]])


def _match(before: OwnEphemerides | None, product: str, received: Received) -> OwnEphemerides:
    """Own ephemerides with an issue of data, and their CRCs; one that is as before has its CRC already."""
    iod = received.corrections[product].iod
    ephemeris = received.ephemerides.matching(iod, received.gps_week, received.tow_s)
    before = before or OwnEphemerides()
    if ephemeris is before.ephemeris:
        return before
    found = np.isfinite(ephemeris.iod)
    fresh = found & ~ephemeris.same_as(before.ephemeris)
    crc = np.where(found, before.crc, np.nan)
    if fresh.any():
        crc = np.where(fresh, ephemeris_crcs(ephemeris), crc)
    return OwnEphemerides(ephemeris=ephemeris, crc=crc)


def _without_station(mode: Mode, ranges: tuple[SmoothedRanges, ...]) -> RangingSources:
    """Nothing that can be used."""
    tracking = np.logical_and.reduce([np.isfinite(each.smoothed_m) for each in ranges])
    return RangingSources(
        mode=mode,
        reason=np.where(tracking, int(Rejection.NO_STATION), int(Rejection.NOT_TRACKED)),
        range_m=missing(),
        satellite_m=missing(3),
        applied=missing(B_VALUES + MAX_REFERENCE_RECEIVERS),
        weight_sigma_m=missing(),
        noise_factor=missing(2, N_SIGNALS),
        settled_s=_younger(ranges),
        age_s=math.nan,
        own_crc=missing(),
    )


def _younger(ranges: tuple[SmoothedRanges, ...]) -> FloatArray:
    return ranges[0].settled_s if len(ranges) == 1 else np.minimum(ranges[0].settled_s, ranges[1].settled_s)


class _Plan(NamedTuple):
    """What of a set of modes is the same at every epoch, as arrays; products by their place among those there are."""

    coefficient: FloatArray
    tau_s: FloatArray
    level_tau_s: FloatArray
    model_tau_s: FloatArray
    product: IntArray
    level_product: IntArray
    systems: BoolArray


@lru_cache(maxsize=16)
def _plan(modes: tuple[Mode, ...], products: tuple[str, ...], aad: str) -> _Plan:
    processing = [processing_of(mode) for mode in modes]
    return _Plan(
        coefficient=np.array([each.coefficient for each in processing]),
        tau_s=np.array([mode.smoothing_s for mode in modes]),
        level_tau_s=np.array([each.tau_s[0] for each in processing]),
        model_tau_s=np.array([air_model(mode, aad).tau_s for mode in modes]),
        product=np.array([[products.index(name) for name in pair(mode.products)] for mode in modes]),
        level_product=np.array([[products.index(name) for name in pair(mode.level_products)] for mode in modes]),
        systems=np.array([satellites_of(mode.systems) for mode in modes]),
    )


def _measured(signals: list[tuple[SmoothedRanges, ...]]) -> FloatArray:
    """Raw and smoothed code and age of the filter of each mode and signal, (M, 2, 3, N)."""
    places: dict[int, int] = {}
    rows: list[tuple[FloatArray, FloatArray, FloatArray]] = []
    for each in (each for of_mode in signals for each in of_mode):
        if id(each) not in places:
            places[id(each)] = len(rows)
            rows.append((each.code_m, each.smoothed_m, each.settled_s))
    measured: FloatArray = np.array(rows)[[[places[id(each)] for each in pair(of_mode)] for of_mode in signals]]
    return measured


def _sources(
    modes: list[Mode],
    ranges: Mapping[int, tuple[SmoothedRanges, ...]],
    products: tuple[str, ...],
    matched: Mapping[str, OwnEphemerides],
    received: Received,
    params: AirborneParams,
) -> dict[int, RangingSources]:
    """Corrected ranges of the modes that have corrections, and the reason where a satellite may not be used."""
    station, sets = received.station, [received.corrections[name] for name in products]
    assert station is not None
    own = [matched[name] for name in products]
    age_s = np.array([received.since_s((each.gps_week, each.tow_s)) for each in sets])
    plan, measured = _plan(tuple(modes), products, params.aad), [ranges[mode.number] for mode in modes]
    reason, range_m, weight_sigma_m, applied, satellite_m, factor = correct_ranges(
        _measured(measured),
        plan.coefficient,
        plan.tau_s,
        plan.level_tau_s,
        plan.model_tau_s,
        plan.product,
        plan.level_product,
        np.array([each.columns for each in sets]),
        age_s,
        np.array([each.ephemeris.values for each in own]),
        np.array([each.crc for each in own]),
        received.checks.columns,
        plan.systems,
        int(received.gps_week),
        float(received.tow_s),
        int(station.n_receivers),
        float(params.correction_timeout_s),
        float(params.settle_s),
        bool(params.inflate_unsettled),
    )
    for row, mode in enumerate(modes):
        if mode.levels and params.gast_d.weights == OF_LEVELS:
            weight_sigma_m[row], factor[row, 1] = applied[row, SIGMA], factor[row, 0]
    return {
        mode.number: RangingSources(
            mode=mode,
            reason=reason[row],
            range_m=range_m[row],
            satellite_m=satellite_m[row],
            applied=applied[row],
            weight_sigma_m=weight_sigma_m[row],
            noise_factor=factor[row],
            settled_s=_younger(measured[row]),
            age_s=float(age_s[plan.product[row]].max()),
            own_crc=own[plan.product[row, 0]].crc,
        )
        for row, mode in enumerate(modes)
    }

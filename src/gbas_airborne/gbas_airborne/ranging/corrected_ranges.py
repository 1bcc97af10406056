# mypy: disable-error-code="no-untyped-call"
"""Third stage of an epoch: from smoothed ranges and what the station told to ranges a position may be made of.

Every rule that does not need the position is applied here; elevation, distance and the range test follow in
:mod:`gbas_airborne.navigation.position`.

Source: ICAO Annex 10 vol. I, App. B 3.6.5.2; RTCA DO-253 2.3.8.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gbas_airborne.params import AirborneParams
from gbas_airborne.ranging.kernels.corrected_ranges import correct_ranges
from gbas_airborne.ranging.own_ranges import SmoothedRanges, Tracked
from gbas_airborne.reception.receive import Received
from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import missing, satellites_of
from gbas_msgs_py.codes import Rejection
from gbas_msgs_py.modes import Mode
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
    noise_factor : (N_SATS,) array
        Factor on airborne noise and multipath, see
        :func:`gbas_airborne.ranging.kernels.corrected_ranges.settling_factor` [-].
    settled_s : (N_SATS,) array
        Time since the start of the smoothing filter [s].
    age_s : float
        Age of the corrections [s].
    own_crc : (N_SATS,) array
        CRC of the ephemeris the receiver has for the correction; NaN where it has none.
    """

    mode: Mode
    reason: NDArray[np.int64]
    range_m: FloatArray
    satellite_m: FloatArray
    noise_factor: FloatArray
    settled_s: FloatArray
    age_s: float
    own_crc: FloatArray


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
    products = tuple(dict.fromkeys(mode.product for mode in modes if served and mode.product in sets))
    matched = {name: _match(state.matched.get(name), name, received) for name in products}
    ranges = {mode.number: tracked.ranges(mode) for mode in modes}
    corrected = [mode for mode in modes if mode.product in products]
    sources = {mode.number: _without_station(mode, ranges[mode.number]) for mode in modes if mode not in corrected}
    if corrected:
        sources |= _sources(corrected, ranges, products, matched, received, params)
    found = tuple(sources[mode.number] for mode in modes)
    return CorrectState(matched={**state.matched, **matched}), Corrected(received=received, sources=found)


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


def _without_station(mode: Mode, ranges: SmoothedRanges) -> RangingSources:
    """Nothing that can be used."""
    tracking = np.isfinite(ranges.smoothed_m)
    return RangingSources(
        mode=mode,
        reason=np.where(tracking, int(Rejection.NO_STATION), int(Rejection.NOT_TRACKED)),
        range_m=missing(),
        satellite_m=missing(3),
        noise_factor=missing(),
        settled_s=ranges.settled_s,
        age_s=math.nan,
        own_crc=missing(),
    )


def _sources(
    modes: list[Mode],
    ranges: Mapping[int, SmoothedRanges],
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
    place = np.array([products.index(mode.product) for mode in modes])
    measured = [ranges[mode.number] for mode in modes]
    reason, range_m, factor, satellite_m = correct_ranges(
        np.array([(each.code_m, each.smoothed_m, each.settled_s) for each in measured]),
        np.array([mode.smoothing_s for mode in modes]),
        place,
        np.array([each.columns for each in sets]),
        age_s,
        np.array([each.ephemeris.values for each in own]),
        np.array([each.crc for each in own]),
        received.checks.columns,
        _systems(params.systems),
        int(received.gps_week),
        float(received.tow_s),
        int(station.n_receivers),
        float(params.correction_timeout_s),
        float(params.settle_s),
        bool(params.inflate_unsettled),
    )
    return {
        mode.number: RangingSources(
            mode=mode,
            reason=reason[row],
            range_m=range_m[row],
            satellite_m=satellite_m[row],
            noise_factor=factor[row],
            settled_s=measured[row].settled_s,
            age_s=float(age_s[place[row]]),
            own_crc=own[place[row]].crc,
        )
        for row, mode in enumerate(modes)
    }


@lru_cache(maxsize=8)
def _systems(letters: str) -> BoolArray:
    return satellites_of(letters)

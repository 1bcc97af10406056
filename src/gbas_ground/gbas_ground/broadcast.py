"""From integrity to the air: one epoch's corrections as the bursts of one frame.

Nothing is broadcast that the integrity epoch does not call usable and complete. A station without corrections stays on
the air with an empty type 1 message and says that it is not healthy. Types 1 and 11 come first; corrections of a second
band have what these leave. What does not fit is left out from the lowest satellite up, and the station says so
(:func:`fitting`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from gbas_core.compiled import compiled
from gbas_core.gnss.epoch_order import Arrival, EpochOrder
from gbas_core.gnss.gpstime import epoch_key
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import IS_GALILEO, RANGING_SOURCE_ID
from gbas_ground.claims.limits import MAX_DECORRELATION
from gbas_ground.corrections.kernels.limits import MAX_B_VALUE_M
from gbas_ground.corrections.sigma import MAX_SIGMA_M
from gbas_ground.param_checks import MIN_SERVICE_SATELLITES
from gbas_ground.params import GroundParams
from gbas_ground.prepared import PreparedStation
from gbas_ground.sections import GCID_UNHEALTHY, MAX_SIGMA_VIG
from gbas_msgs_py.codes import ChannelState
from gbas_msgs_py.products import PRODUCTS
from gbas_msgs_py.records import MAX_REFERENCE_RECEIVERS, IntegrityEpoch
from gbas_vdb.messages.fixed_places import Items
from gbas_vdb.messages.tables import CORRECTION_ENTRIES, PRIVATE_ENTRIES
from gbas_vdb.messages.types import Type2
from gbas_vdb.transmission.burst import FRAME_DURATION_S, Burst
from gbas_vdb.transmission.frame import Frame, ScheduleState, Sources
from gbas_vdb.transmission.schedule import schedule_frame

_FRAME_MS: Final = round(1000 * FRAME_DURATION_S)
_IOD_MODULUS: Final = 256
_SOURCE_ID: Final[FloatArray] = RANGING_SOURCE_ID.astype(np.float64)
_WITH_B_VALUES: Final = frozenset(
    kind
    for kind, layout in CORRECTION_ENTRIES.items()
    if any(getattr(entry, "name", None) == "b_values_m" for entry in layout.entries)
)
"""Types of messages that carry B values."""
_HAS_B_VALUES: Final[BoolArray] = np.array([product.message_type in _WITH_B_VALUES for product in PRODUCTS])
_USABLE: Final = float(ChannelState.USABLE)
_MAX_CRC: Final = float(0xFFFF)
_MAX_IOD: Final[FloatArray] = np.where(IS_GALILEO, 1023.0, 255.0)  # Known: IODnav has 10 bits, IODE 8


@dataclass(frozen=True, kw_only=True, eq=False)
class BroadcastState:
    """What the broadcast remembers.

    Attributes
    ----------
    schedule : ScheduleState
    order : EpochOrder
        Of the frames.
    """

    schedule: ScheduleState = field(default_factory=ScheduleState)
    order: EpochOrder = field(default_factory=EpochOrder)


def empty_integrity(gps_week: int, tow_s: float) -> IntegrityEpoch:
    """An epoch at which nothing is known, so nothing is used."""
    return IntegrityEpoch(gps_week=gps_week, tow_s=tow_s, n_receivers=0.0)


def broadcastable(integrity: IntegrityEpoch, params: GroundParams) -> BoolArray:
    """Satellites whose corrections are usable, complete and within what the messages can carry, ``(N,)``."""
    return _carried(
        integrity.state, integrity.iod, integrity.ephemeris_crc, integrity.sigma_pr_gnd_d_m, integrity.p_ephemeris,
        integrity.prc_m, integrity.rrc_mps, integrity.sigma_pr_gnd_m, integrity.b_m, len(params.smoothing.tau_s),
        float(params.correction_limits.max_prc_m), float(params.correction_limits.max_rrc_mps), _MAX_IOD,
        _HAS_B_VALUES,
    )  # fmt: skip


@compiled
def _carried(
    state: FloatArray,
    iod: FloatArray,
    ephemeris_crc: FloatArray,
    sigma_d_m: FloatArray,
    decorrelation: FloatArray,
    prc_m: FloatArray,
    rrc_mps: FloatArray,
    sigma_m: FloatArray,
    b_m: FloatArray,
    n_made: int,
    max_prc_m: float,
    max_rrc_mps: float,
    max_iod: FloatArray,
    has_b_values: BoolArray,
) -> BoolArray:
    """The same of the fields; all that the station makes must be whole, whether a message carries it or not."""
    result = np.zeros(len(state), dtype=np.bool_)
    for i in range(len(state)):
        ok = state[i] == _USABLE and _is_count(iod[i], max_iod[i]) and _is_count(ephemeris_crc[i], _MAX_CRC)
        ok = ok and 0.0 < sigma_d_m[i] <= MAX_SIGMA_M
        for t in range(n_made):
            ok = ok and 0.0 <= decorrelation[t, i] <= MAX_DECORRELATION and 0.0 < sigma_m[t, i] <= MAX_SIGMA_M
            ok = ok and abs(prc_m[t, i]) <= max_prc_m and abs(rrc_mps[t, i]) <= max_rrc_mps
        for t in range(n_made):
            for m in range(b_m.shape[1]):
                ok = ok and not (has_b_values[t] and abs(b_m[t, m, i]) > MAX_B_VALUE_M)
        result[i] = ok
    return result


@compiled
def _is_count(value: float, largest: float) -> bool:
    """Whether a value is a whole number from 0 to a largest."""
    return 0.0 <= value <= largest and value == math.floor(value)


def second_broadcastable(integrity: IntegrityEpoch, usable: BoolArray, station: PreparedStation) -> BoolArray:
    """Those of the satellites whose corrections of the second band are whole and within what the messages carry."""
    second, limits = station.second, station.params.correction_limits
    if second is None:
        return np.zeros_like(usable)
    places = second.products
    sigma_m, b_m = integrity.sigma_pr_gnd_m[places], integrity.b_m[places]
    fits = (sigma_m > 0.0) & (sigma_m <= MAX_SIGMA_M)
    fits &= np.abs(integrity.prc_m[places]) <= limits.max_prc_m
    fits &= np.abs(integrity.rrc_mps[places]) <= limits.max_rrc_mps
    fits &= ~(np.abs(b_m) > MAX_B_VALUE_M).any(axis=1)
    return usable & fits.all(axis=0)


class Fitting(NamedTuple):
    """What of the corrections is sent.

    Attributes
    ----------
    satellites, second : tuple of int
        Places of the satellites that are sent, and of those with corrections of the second band.
    room, second_room : int
        How many would fit; -1 for the second band where not even a message without satellites does.
    left_out, second_left_out : int
        Satellites that there is no room for.
    """

    satellites: tuple[int, ...]
    second: tuple[int, ...]
    room: int
    second_room: int
    left_out: int
    second_left_out: int


def fitting(integrity: IntegrityEpoch, station: PreparedStation) -> Fitting:
    """The satellites that are sent, the highest where there is not room for all."""
    usable, settings = broadcastable(integrity, station.params), station.frames
    satellites = _highest(usable, integrity.elevation_rad, settings.room)
    left_out = int(np.count_nonzero(usable)) - len(satellites)
    if station.second is None:
        return Fitting(satellites, (), settings.room, 0, left_out, 0)
    sent = np.zeros_like(usable)
    sent[list(satellites)] = True
    of_second = second_broadcastable(integrity, sent, station)
    room = settings.second_rooms[len(satellites)]
    second = _highest(of_second, integrity.elevation_rad, max(room, 0))
    return Fitting(satellites, second, settings.room, room, left_out, int(np.count_nonzero(of_second)) - len(second))


def broadcast_frame(
    state: BroadcastState, integrity: IntegrityEpoch, station: PreparedStation
) -> tuple[BroadcastState, tuple[Burst, ...]]:
    """Bursts of the frame that begins at the integrity's epoch.

    An epoch that is not later than the last frame, or is not at the start of a frame, gives no bursts; time that goes
    on from an earlier epoch is believed in the end.
    """
    key = epoch_key(integrity.gps_week, integrity.tow_s)
    if key % _FRAME_MS:
        return state, ()
    order, arrival = state.order.step(key)
    if arrival is Arrival.REFUSED:
        return replace(state, order=order), ()
    params, settings = station.params, station.frames
    chosen = fitting(integrity, station)
    sigma_vig = integrity.sigma_vert_iono_gradient
    enough = params.receivers.minimum <= integrity.n_receivers <= MAX_REFERENCE_RECEIVERS
    serves = bool(enough and 0.0 <= sigma_vig <= MAX_SIGMA_VIG)
    satellites = chosen.satellites if serves else ()
    serves = len(satellites) >= MIN_SERVICE_SATELLITES
    # a station that does not serve says so, and claims the least it can of the ionosphere
    gcid, sigma_vig = (params.station.gcid, sigma_vig) if serves else (GCID_UNHEALTHY, MAX_SIGMA_VIG)
    frame = Frame(
        gps_week=integrity.gps_week,
        tow_s=integrity.tow_s,
        sources=_sources(integrity, satellites, settings.schedule.message_types),
        station=_station_data(settings.station, gcid, sigma_vig),
        further=_further(integrity, chosen, station) if satellites else {},
        approaches=settings.approaches,
    )
    scheduled, bursts = schedule_frame(state.schedule, frame, settings.schedule)
    return BroadcastState(schedule=scheduled, order=order), bursts


@lru_cache(maxsize=64)
def _station_data(station: Type2, gcid: int, sigma_vig: float) -> Type2:
    return replace(station, gcid=gcid, sigma_vert_iono_gradient=sigma_vig)


def highest_sent(usable: BoolArray, elevation_rad: FloatArray, room: int) -> BoolArray:
    """Of satellites that are usable those that the slots hold, ``(N,)``."""
    sent = np.zeros(usable.shape, dtype=bool)
    sent[list(_highest(usable, elevation_rad, room))] = True
    return sent


def _highest(usable: BoolArray, elevation_rad: FloatArray, room: int) -> tuple[int, ...]:
    """The satellites to send, in their order on the axis."""
    satellites = np.flatnonzero(usable)
    if len(satellites) > room:
        order = np.argsort(-elevation_rad[satellites], kind="stable")
        satellites = np.sort(satellites[order[:room]])
    return tuple(satellites.tolist())


def _sources(integrity: IntegrityEpoch, satellites: tuple[int, ...], types: tuple[int, ...]) -> Sources:
    """All there is to send of the satellites."""
    chosen = np.array(satellites, dtype=np.int64)
    sent = [(index, product.message_type) for index, product in enumerate(PRODUCTS) if product.message_type in types]
    return Sources(
        numbers=RANGING_SOURCE_ID[chosen].tolist(),
        iods=(integrity.iod[chosen] % _IOD_MODULUS).astype(np.int64).tolist(),
        ephemeris_crcs=integrity.ephemeris_crc[chosen].astype(np.int64).tolist(),
        corrections={
            kind: Items(CORRECTION_ENTRIES[kind], _COLUMNS[kind](integrity, index)[:, chosen].T.copy())
            for index, kind in sent
        },
        decorrelation={kind: integrity.p_ephemeris[index, chosen].tolist() for index, kind in sent},
        availability_s=(None,) * len(satellites),
    )


def _further(integrity: IntegrityEpoch, chosen: Fitting, station: PreparedStation) -> dict[int, Items]:
    """Corrections of the second band by the measurement type of their messages; none where no message fits."""
    if station.second is None or chosen.second_room < 0:
        return {}
    rows, found = np.array(chosen.second, dtype=np.int64), {}
    for place in station.second.products.tolist():
        kind = PRODUCTS[place].measurement_type
        found[kind] = Items(PRIVATE_ENTRIES[kind], _columns_1(integrity, place)[:, rows].T.copy())
    return found


def _columns_1(integrity: IntegrityEpoch, product: int) -> FloatArray:
    """Fields of the measurement blocks of a type 1 message, and of ours, ``(F, N)``."""
    return np.vstack([
        _SOURCE_ID, integrity.iod % _IOD_MODULUS, integrity.prc_m[product], integrity.rrc_mps[product],
        integrity.sigma_pr_gnd_m[product], integrity.b_m[product],
    ])  # fmt: skip


def _columns_11(integrity: IntegrityEpoch, product: int) -> FloatArray:
    """Fields of the measurement blocks of a type 11 message; the first sigma belongs to the type 1 correction."""
    return np.vstack([
        _SOURCE_ID, integrity.prc_m[product], integrity.rrc_mps[product], integrity.sigma_pr_gnd_d_m,
        integrity.sigma_pr_gnd_m[product],
    ])  # fmt: skip


_COLUMNS: Final[dict[int, Callable[[IntegrityEpoch, int], FloatArray]]] = {1: _columns_1, 11: _columns_11}
"""What each type of message takes of a product, in the order of its layout."""

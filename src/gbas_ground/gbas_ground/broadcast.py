"""From integrity to the air: one epoch's corrections as the bursts of one frame.

Nothing is broadcast that the integrity epoch does not call usable and complete. A station without corrections stays on
the air with an empty type 1 message and says that it is not healthy.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Final

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
from gbas_vdb.messages.tables import CORRECTION_ENTRIES
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
        for t in range(len(b_m)):
            for m in range(b_m.shape[1]):
                ok = ok and not (has_b_values[t] and abs(b_m[t, m, i]) > MAX_B_VALUE_M)
        result[i] = ok
    return result


@compiled
def _is_count(value: float, largest: float) -> bool:
    """Whether a value is a whole number from 0 to a largest."""
    return 0.0 <= value <= largest and value == math.floor(value)


def broadcast_frame(
    state: BroadcastState, integrity: IntegrityEpoch, station: PreparedStation
) -> tuple[BroadcastState, tuple[Burst, ...]]:
    """Bursts of the frame that begins at the integrity's epoch.

    An epoch that is not later than the last frame, or is not at the start of a frame, gives no bursts; time that goes
    on from an earlier epoch is believed in the end. When more satellites are usable than the slots hold, the lowest are
    left out.
    """
    key = epoch_key(integrity.gps_week, integrity.tow_s)
    if key % _FRAME_MS:
        return state, ()
    order, arrival = state.order.step(key)
    if arrival is Arrival.REFUSED:
        return replace(state, order=order), ()
    params, settings = station.params, station.frames
    usable = broadcastable(integrity, params)
    sigma_vig = integrity.sigma_vert_iono_gradient
    enough = params.receivers.minimum <= integrity.n_receivers <= MAX_REFERENCE_RECEIVERS
    serves = bool(enough and 0.0 <= sigma_vig <= MAX_SIGMA_VIG)
    satellites = _highest(usable, integrity.elevation_rad, settings.room) if serves else ()
    serves = len(satellites) >= MIN_SERVICE_SATELLITES
    # a station that does not serve says so, and claims the least it can of the ionosphere
    gcid, sigma_vig = (params.station.gcid, sigma_vig) if serves else (GCID_UNHEALTHY, MAX_SIGMA_VIG)
    frame = Frame(
        gps_week=integrity.gps_week,
        tow_s=integrity.tow_s,
        sources=_sources(integrity, satellites, settings.schedule.message_types),
        station=_station_data(settings.station, gcid, sigma_vig),
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


def _columns_1(integrity: IntegrityEpoch, product: int) -> FloatArray:
    """Fields of the measurement blocks of a type 1 message, ``(F, N)``."""
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

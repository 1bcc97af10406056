"""From integrity to the air: one epoch's corrections as the bursts of one frame.

Nothing is broadcast that the integrity epoch does not call usable and complete. A station without corrections stays on
the air with an empty type 1 message and says that it is not healthy.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

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
from gbas_vdb.messages.tables import CORRECTION_ENTRIES
from gbas_vdb.messages.types import Correction30, Correction100
from gbas_vdb.transmission.burst import FRAME_DURATION_S, Burst
from gbas_vdb.transmission.frame import Frame, ScheduleState, SourceCorrection
from gbas_vdb.transmission.schedule import schedule_frame

_FRAME_MS: Final = round(1000 * FRAME_DURATION_S)
_IOD_MODULUS: Final = 256
_WITH_B_VALUES: Final = frozenset(
    kind
    for kind, layout in CORRECTION_ENTRIES.items()
    if any(getattr(entry, "name", None) == "b_values_m" for entry in layout.entries)
)
"""Types of messages that carry B values."""
_MAX_CRC: Final = 0xFFFF
_MAX_IOD: Final = np.where(IS_GALILEO, 1023, 255)  # Known: IODnav has 10 bits, IODE 8


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
    ok = (integrity.state == ChannelState.USABLE) & _counts(integrity.iod) & _counts(integrity.ephemeris_crc)
    ok = ok & (integrity.ephemeris_crc <= _MAX_CRC) & (integrity.iod <= _MAX_IOD)
    # all that the station makes must be whole, whether a message carries it or not
    for product in range(len(params.smoothing.tau_s)):
        decorrelation, sigma = integrity.p_ephemeris[product], integrity.sigma_pr_gnd_m[product]
        ok = ok & (decorrelation >= 0.0) & (decorrelation <= MAX_DECORRELATION)
        ok = ok & (np.abs(integrity.prc_m[product]) <= params.correction_limits.max_prc_m)
        ok = ok & (np.abs(integrity.rrc_mps[product]) <= params.correction_limits.max_rrc_mps)
        ok = ok & (sigma > 0.0) & (sigma <= MAX_SIGMA_M)
    ok = ok & (integrity.sigma_pr_gnd_d_m > 0.0) & (integrity.sigma_pr_gnd_d_m <= MAX_SIGMA_M)
    b_m = integrity.b_m[[index for index, product in enumerate(PRODUCTS) if product.message_type in _WITH_B_VALUES]]
    b = np.where(np.isnan(b_m), 0.0, np.abs(b_m)).max(axis=(0, 1))
    return np.asarray(ok & (b <= MAX_B_VALUE_M))


def _counts(values: FloatArray) -> BoolArray:
    """Where the values are whole numbers that are not negative."""
    return np.asarray((values >= 0.0) & (values == np.floor(values)) & np.isfinite(values))


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
        sources=_sources(integrity, satellites, params),
        station=replace(settings.station, gcid=gcid, sigma_vert_iono_gradient=sigma_vig),
        approaches=settings.approaches,
    )
    scheduled, bursts = schedule_frame(state.schedule, frame, settings.schedule)
    return BroadcastState(schedule=scheduled, order=order), bursts


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


def _sources(
    integrity: IntegrityEpoch, satellites: tuple[int, ...], params: GroundParams
) -> tuple[SourceCorrection, ...]:
    """All there is to send of the satellites."""
    chosen, types = list(satellites), params.schedule().message_types
    sent = [(index, product) for index, product in enumerate(PRODUCTS) if product.message_type in types]
    corrections = {
        product.message_type: _ENTRIES[product.message_type](integrity, index, chosen) for index, product in sent
    }
    decorrelation = {product.message_type: integrity.p_ephemeris[index, chosen].tolist() for index, product in sent}
    return tuple(
        SourceCorrection(
            corrections={kind: entries[place] for kind, entries in corrections.items()},
            ephemeris_crc=int(crc),
            decorrelation={kind: values[place] for kind, values in decorrelation.items()},
        )
        for place, crc in enumerate(integrity.ephemeris_crc[chosen].tolist())
    )


def _entries_1(integrity: IntegrityEpoch, product: int, chosen: list[int]) -> list[Correction100]:
    """Measurement blocks of a type 1 message."""
    of_product = (integrity.prc_m, integrity.rrc_mps, integrity.sigma_pr_gnd_m)
    columns = [values[product, chosen].tolist() for values in of_product]
    b_values, iods = integrity.b_m[product][:, chosen].T.tolist(), integrity.iod[chosen].tolist()
    return [
        Correction100(
            ranging_source_id=number,
            iod=int(iod) % _IOD_MODULUS,
            prc_m=prc,
            rrc_mps=rrc,
            sigma_pr_gnd_m=sigma,
            b_values_m=tuple(b),
        )
        for number, iod, prc, rrc, sigma, b in zip(
            RANGING_SOURCE_ID[chosen].tolist(), iods, *columns, b_values, strict=True
        )
    ]


def _entries_11(integrity: IntegrityEpoch, product: int, chosen: list[int]) -> list[Correction30]:
    """Measurement blocks of a type 11 message; the first sigma belongs to the type 1 correction."""
    of_product = (integrity.prc_m[product], integrity.rrc_mps[product], integrity.sigma_pr_gnd_m[product])
    columns = [values[chosen].tolist() for values in (*of_product, integrity.sigma_pr_gnd_d_m)]
    return [
        Correction30(
            ranging_source_id=number, prc_30_m=prc, rrc_30_mps=rrc, sigma_pr_gnd_30_m=sigma, sigma_pr_gnd_d_m=sigma_d
        )
        for number, prc, rrc, sigma, sigma_d in zip(RANGING_SOURCE_ID[chosen].tolist(), *columns, strict=True)
    ]


_ENTRIES: Final[dict[int, Callable[[IntegrityEpoch, int, list[int]], Sequence[Correction100 | Correction30]]]] = {
    1: _entries_1,
    11: _entries_11,
}
"""What each type of message takes of a product."""

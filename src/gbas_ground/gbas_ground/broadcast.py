"""From integrity to the air: one epoch's corrections as the bursts of one frame.

Nothing is broadcast that the integrity epoch does not call usable and complete. A station without corrections stays on
the air with an empty type 1 message and says that it is not healthy.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Final

import numpy as np

from gbas_core.gnss.gpstime import epoch_key
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import IS_GALILEO, RANGING_SOURCE_ID
from gbas_ground.claims.limits import MAX_DECORRELATION
from gbas_ground.corrections.sigma import MAX_SIGMA_M
from gbas_ground.monitors.multiple_reference import MAX_B_VALUE_M
from gbas_ground.param_checks import MIN_SERVICE_SATELLITES
from gbas_ground.params import GroundParams
from gbas_ground.sections import GCID_UNHEALTHY, MAX_SIGMA_VIG
from gbas_msgs_py.records import MAX_REFERENCE_RECEIVERS, ChannelState, IntegrityEpoch
from gbas_vdb.messages.types import Correction30, Correction100, FasDataSet, Type2
from gbas_vdb.transmission.burst import FRAME_DURATION_S, Burst
from gbas_vdb.transmission.schedule import (
    Frame,
    ScheduleParams,
    ScheduleState,
    SourceCorrection,
    schedule_frame,
    sources_that_fit,
)

_FRAME_MS: Final = round(1000 * FRAME_DURATION_S)
_IOD_MODULUS: Final = 256
_MAX_CRC: Final = 0xFFFF
_MAX_IOD: Final = np.where(IS_GALILEO, 1023, 255)  # Known: IODnav has 10 bits, IODE 8
RESTART_AFTER_REFUSED: Final = 10
"""Epochs refused, each later than the one before, after which the station believes them and starts anew. Ours."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BroadcastState:
    """What the broadcast remembers.

    Attributes
    ----------
    schedule : ScheduleState
    key : int or None
        Epoch of the last frame [ms since the start of GPS time].
    refused, refused_key : int
        Epochs refused in a row because they were not later than that, and the last of them.
    """

    schedule: ScheduleState = field(default_factory=ScheduleState)
    key: int | None = None
    refused: int = 0
    refused_key: int = 0


def refused_in_a_row(refused: int, refused_key: int, key: int) -> int:
    """How many epochs were refused in a row with this one, of which each is later than the one before."""
    return refused + 1 if refused > 0 and key > refused_key else 1


def empty_integrity(gps_week: int, tow_s: float) -> IntegrityEpoch:
    """An epoch at which nothing is known, so nothing is used."""
    return IntegrityEpoch(gps_week=gps_week, tow_s=tow_s, n_receivers=0.0)


def broadcastable(integrity: IntegrityEpoch, params: GroundParams) -> BoolArray:
    """Satellites whose corrections are usable, complete and within what the messages can carry, ``(N,)``."""
    b = np.where(np.isnan(integrity.b_m), 0.0, np.abs(integrity.b_m)).max(axis=0)
    ok = (integrity.state == ChannelState.USABLE) & _counts(integrity.iod) & _counts(integrity.ephemeris_crc)
    ok = ok & (integrity.ephemeris_crc <= _MAX_CRC) & (integrity.iod <= _MAX_IOD)
    for decorrelation in (integrity.p_ephemeris, integrity.p_ephemeris_d):
        ok = ok & (decorrelation >= 0.0) & (decorrelation <= MAX_DECORRELATION)
    for prc, rrc in (
        (integrity.prc_100_m, integrity.rrc_100_mps),
        (integrity.prc_30_m, integrity.rrc_30_mps),
    ):
        ok = (
            ok
            & (np.abs(prc) <= params.correction_limits.max_prc_m)
            & (np.abs(rrc) <= params.correction_limits.max_rrc_mps)
        )
    for sigma in (integrity.sigma_pr_gnd_m, integrity.sigma_pr_gnd_d_m, integrity.sigma_pr_gnd_30_m):
        ok = ok & (sigma > 0.0) & (sigma <= MAX_SIGMA_M)
    return np.asarray(ok & (b <= MAX_B_VALUE_M))


def _counts(values: FloatArray) -> BoolArray:
    """Where the values are whole numbers that are not negative."""
    return np.asarray((values >= 0.0) & (values == np.floor(values)) & np.isfinite(values))


@lru_cache(maxsize=8)
def _constants(params: GroundParams) -> tuple[Type2, tuple[FasDataSet, ...], ScheduleParams, int]:
    """Station data, approaches, schedule settings and how many satellites fit."""
    station, approaches, schedule = params.station_message(), params.approach_messages(), params.schedule()
    return station, approaches, schedule, sources_that_fit(station, approaches, schedule)


def broadcast_frame(
    state: BroadcastState, integrity: IntegrityEpoch, params: GroundParams
) -> tuple[BroadcastState, tuple[Burst, ...]]:
    """Bursts of the frame that begins at the integrity's epoch.

    An epoch that is not later than the last frame, or is not at the start of a frame, gives no bursts; time that goes
    on from an earlier epoch is believed in the end. When more satellites are usable than the slots hold, the lowest are
    left out.
    """
    key = epoch_key(integrity.gps_week, integrity.tow_s)
    if key % _FRAME_MS:
        return state, ()
    if state.key is not None and key <= state.key:
        refused = refused_in_a_row(state.refused, state.refused_key, key)
        if refused < RESTART_AFTER_REFUSED:
            return replace(state, refused=refused, refused_key=key), ()
    station, approaches, schedule, room = _constants(params)
    usable = broadcastable(integrity, params)
    sigma_vig = integrity.sigma_vert_iono_gradient
    enough = params.receivers.minimum <= integrity.n_receivers <= MAX_REFERENCE_RECEIVERS
    serves = bool(enough and 0.0 <= sigma_vig <= MAX_SIGMA_VIG)
    satellites = _highest(usable, integrity.elevation_rad, room) if serves else ()
    serves = len(satellites) >= MIN_SERVICE_SATELLITES
    # a station that does not serve says so, and claims the least it can of the ionosphere
    gcid, sigma_vig = (params.station.gcid, sigma_vig) if serves else (GCID_UNHEALTHY, MAX_SIGMA_VIG)
    frame = Frame(
        gps_week=integrity.gps_week,
        tow_s=integrity.tow_s,
        sources=_sources(integrity, satellites, params),
        station=replace(station, gcid=gcid, sigma_vert_iono_gradient=sigma_vig),
        approaches=approaches,
    )
    scheduled, bursts = schedule_frame(state.schedule, frame, schedule)
    return BroadcastState(schedule=scheduled, key=key), bursts


def highest_sent(usable: BoolArray, elevation_rad: FloatArray, params: GroundParams) -> BoolArray:
    """Of satellites that are usable those that the slots hold, ``(N,)``."""
    sent = np.zeros(usable.shape, dtype=bool)
    sent[list(_highest(usable, elevation_rad, _constants(params)[3]))] = True
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
    chosen = list(satellites)
    names = ("iod", "ephemeris_crc", "prc_100_m", "rrc_100_mps", "sigma_pr_gnd_m", "p_ephemeris", "p_ephemeris_d")
    columns = [getattr(integrity, name)[chosen].tolist() for name in names]
    b_values = integrity.b_m[:, chosen].T.tolist()
    thirty = _corrections_30(integrity, chosen) if params.gast_d.enabled else [None] * len(chosen)
    return tuple(
        SourceCorrection(
            correction=Correction100(
                ranging_source_id=number,
                iod=int(iod) % _IOD_MODULUS,
                prc_m=prc,
                rrc_mps=rrc,
                sigma_pr_gnd_m=sigma,
                b_values_m=tuple(b),
            ),
            correction_30=correction_30,
            ephemeris_crc=int(crc),
            ephemeris_decorrelation=p,
            ephemeris_decorrelation_d=p_d,
        )
        for number, iod, crc, prc, rrc, sigma, p, p_d, b, correction_30 in zip(
            RANGING_SOURCE_ID[chosen].tolist(), *columns, b_values, thirty, strict=True
        )
    )


def _corrections_30(integrity: IntegrityEpoch, chosen: list[int]) -> list[Correction30]:
    names = ("prc_30_m", "rrc_30_mps", "sigma_pr_gnd_d_m", "sigma_pr_gnd_30_m")
    columns = [getattr(integrity, name)[chosen].tolist() for name in names]
    return [
        Correction30(
            ranging_source_id=number, prc_30_m=prc, rrc_30_mps=rrc, sigma_pr_gnd_d_m=sigma_d, sigma_pr_gnd_30_m=sigma_30
        )
        for number, prc, rrc, sigma_d, sigma_30 in zip(RANGING_SOURCE_ID[chosen].tolist(), *columns, strict=True)
    ]

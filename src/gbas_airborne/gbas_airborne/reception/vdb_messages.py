"""From VDB bursts to what the station has told: corrections, station data, approach, ephemeris CRCs.

What arrives is used only when its FEC and CRC hold, it comes from the one station listened to, it is no test, its slot
is authentic where that is asked for, and its time is plausible. Everything else is discarded and counted. Data time
only: an age is the time of an epoch less the start of the frame the message came in.

Source: ICAO Annex 10 vol. I, App. B 3.6.4 and 3.6.5; RTCA DO-253 2.3.6 to 2.3.8.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from typing import Final

import numpy as np

from gbas_airborne.params import NO_FAS, AirborneParams
from gbas_core.gnss.frames import ecef_from_geodetic
from gbas_core.gnss.gpstime import add_seconds, epoch_key, resolve_modified_z_count, seconds_between
from gbas_core.positioning.approach import FinalApproach
from gbas_core.record import FloatArray
from gbas_core.satellites import SOURCE_ID_INDEX, missing
from gbas_msgs_py.codes import EventKind
from gbas_msgs_py.events import Event
from gbas_msgs_py.records import MAX_REFERENCE_RECEIVERS
from gbas_vdb.messages.block import MessageBlock
from gbas_vdb.messages.types import Correction100, FasDataSet, Type1, Type2, Type4, Type11
from gbas_vdb.transmission.burst import FRAME_DURATION_S, SLOT_NAMES, Burst
from gbas_vdb.transmission.receive import decode_burst

SOURCE: Final = "positioning"
# Known (RTCA DO-246E): first letter of the RPI by the lowest slot of the station, A to H.
RPI_LETTERS: Final = "AXZJCVPT"
# Known (ICAO Annex 10 vol. I, App. B 3.6.4.5): 14 is GBAS only, 15 is any provider.
GBAS_PROVIDERS: Final = (14, 15)
# Known (ICAO Annex 10 vol. I, table B-65): 1 to 4 are healthy, 7 is unhealthy; 0, 5 and 6 mean nothing and give no
# service.
HEALTHY_GCID: Final = (1, 2, 3, 4)
L1_CA_MEASUREMENT: Final = 0
GUIDANCE_TYPES: Final = (1, 2, 4, 11)
_KEY_TOLERANCE_MS: Final = 1


@dataclass(frozen=True, kw_only=True, eq=False)
class StationData:
    """Type 2 message in the units of the position; NaN where the station does not provide a value."""

    reference_ecef_m: FloatArray
    reference_height_m: float
    n_receivers: int
    gcid: int
    sigma_vig: float
    refractivity: float
    refractivity_uncertainty: float
    scale_height_m: float
    d_max_m: float
    k_md_e: float
    rsds: int | None
    slots: tuple[int, ...] | None

    @property
    def healthy(self) -> bool:
        """Whether the station's continuity/integrity designator allows any service."""
        return self.gcid in HEALTHY_GCID


@dataclass(frozen=True, kw_only=True, eq=False)
class Corrections:
    """A complete set of type 1 corrections (one message, or a linked pair) on the satellite axis.

    `gps_week`, `tow_s` are the modified Z-count, resolved; `sigma_m` NaN where the correction is invalid, `listed` 1
    where there is one at all, `b_m` is (4, N_SATS).
    """

    gps_week: int
    tow_s: float
    listed: FloatArray
    iod: FloatArray
    prc_m: FloatArray
    rrc_mps: FloatArray
    sigma_m: FloatArray
    b_m: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class EphemerisChecks:
    """What type 1 messages said about ephemerides, per satellite: the last issue of data, its CRC and P."""

    iod: FloatArray = field(default_factory=missing)
    crc: FloatArray = field(default_factory=missing)
    p: FloatArray = field(default_factory=missing)


@dataclass(frozen=True, kw_only=True)
class Counts:
    """What became of bursts and message blocks since the start."""

    bursts: int = 0
    blocks: int = 0
    corrected_bytes: int = 0
    failed: int = 0
    test: int = 0
    other_station: int = 0
    not_authentic: int = 0
    unusable: int = 0
    unpaired: int = 0


@dataclass(frozen=True, kw_only=True, eq=False)
class ReceptionState:
    """All the receiver knows from the VDB.

    Attributes
    ----------
    station_id : str or None
        Station listened to; None before its station data.
    heard : (week, tow_s) or None
        Frame of the last good block of that station.
    type2 : Type2 or None
        The message `station` was made of.
    type2_received, type4_received, type1_received : (week, tow_s) or None
        Frames of the last station data, of the last data of the selected approach, and of the last complete set of
        corrections.
    pending_pair, pending_frame
        First half of a linked pair, and the frame it came in.
    type11, type11_frame
        The 30 s corrections of one frame, and which.
    """

    station_id: str | None = None
    heard: tuple[int, float] | None = None
    station: StationData | None = None
    type2: Type2 | None = None
    type2_received: tuple[int, float] | None = None
    approach: FinalApproach | None = None
    type4_received: tuple[int, float] | None = None
    corrections: Corrections | None = None
    type1_received: tuple[int, float] | None = None
    checks: EphemerisChecks = field(default_factory=EphemerisChecks)
    pending_pair: Type1 | None = None
    pending_frame: tuple[int, float] | None = None
    type11: tuple[Type11, ...] = ()
    type11_frame: tuple[int, float] | None = None
    waiting: tuple[Burst, ...] = ()
    counts: Counts = field(default_factory=Counts)


def reception_step(
    state: ReceptionState, bursts: tuple[Burst, ...], gps_week: int, tow_s: float, params: AirborneParams
) -> tuple[ReceptionState, tuple[Event, ...]]:
    """Take in the bursts of the frames an epoch may use; later frames wait for a later epoch.

    Parameters
    ----------
    state : ReceptionState
    bursts : tuple of Burst
        Newly arrived.
    gps_week, tow_s
        Epoch of the observations.
    params : AirborneParams

    Returns
    -------
    state : ReceptionState
    events : tuple of Event
    """
    limit = epoch_key(*add_seconds(gps_week, tow_s, params.correction_wait_s - FRAME_DURATION_S)) + _KEY_TOLERANCE_MS
    ready, waiting, malformed = [], [], 0
    for burst in (*state.waiting, *bursts):
        if not (math.isfinite(burst.tow_s) and 0 <= burst.slot < len(SLOT_NAMES)):
            malformed += 1
        elif epoch_key(burst.gps_week, burst.tow_s) <= limit:
            ready.append(burst)
        else:
            waiting.append(burst)
    ready.sort(key=lambda burst: (epoch_key(burst.gps_week, burst.tow_s), burst.slot))
    intake = _VdbMessageProcessor(replace(state, waiting=tuple(waiting)), gps_week, tow_s, params)
    intake.count(failed=malformed)
    for burst in ready:
        intake.take(burst)
    intake.expire()
    return intake.finished(), tuple(intake.events)


class _VdbMessageProcessor:
    """Works through the bursts of one epoch; the state it hands back is frozen as ever."""

    def __init__(self, state: ReceptionState, gps_week: int, tow_s: float, params: AirborneParams) -> None:
        self.state = state
        self.params = params
        self.events: list[Event] = []
        self._epoch = (gps_week, tow_s)
        self._counts = {item.name: getattr(state.counts, item.name) for item in fields(Counts)}

    def finished(self) -> ReceptionState:
        return replace(self.state, counts=Counts(**self._counts))

    def count(self, **increments: int) -> None:
        for name, increment in increments.items():
            self._counts[name] += increment

    def expire(self) -> None:
        """Forget station and approach data that were not repeated for too long: they may have been withdrawn."""
        limit_s = self.params.station_data_timeout_s
        age_s = self._age_of(self.state.type2_received)
        if age_s > limit_s:
            self._forget("station_data_timeout", age_s, limit_s)
        age_s = self._age_of(self.state.type4_received)
        if age_s > limit_s:
            self._event(EventKind.STATION, f"rpds{self.params.rpds}", "approach_timeout", age_s, limit_s)
            self.state = replace(self.state, approach=None, type4_received=None)

    def _age_of(self, received: tuple[int, float] | None) -> float:
        return math.nan if received is None else seconds_between(*received, *self._epoch)

    def take(self, burst: Burst) -> None:
        """One burst: its good blocks, in order. One of a frame before the last of our station comes too late."""
        heard = self.state.heard
        if heard is not None and _age_s(heard, burst) < 0.0:
            self.count(bursts=1, unusable=1)
            self._event(EventKind.INPUT, "vdb", "burst_out_of_order", _age_s(heard, burst), 0.0)
            return
        decoded = decode_burst(burst)
        self.count(bursts=1, failed=len(decoded.errors), corrected_bytes=decoded.corrected_bytes)
        if decoded.errors:
            self._event(EventKind.INPUT, "vdb", "block_discarded", float(len(decoded.errors)))
        for block in decoded.blocks:
            self._take_block(block, burst)

    def _take_block(self, block: MessageBlock, burst: Burst) -> None:
        self.count(blocks=1)
        if not self._is_our_station(block, burst):
            self.count(other_station=1)
        elif block.test:
            self._test_block(block)
        elif not self._is_authentic(block, burst):
            self.count(not_authentic=1)
        else:
            self._take_message(block, burst)

    def _take_message(self, block: MessageBlock, burst: Burst) -> None:
        message = block.message
        if isinstance(message, Type2):
            self._take_type2(message, block.station_id, burst)
        elif self.state.station_id is None:
            # Nothing is used before station data selected the station.
            self.count(unusable=1)
            return
        elif isinstance(message, Type1):
            self._take_type1(message, burst)
        elif isinstance(message, Type4):
            self._take_type4(message, burst)
        elif isinstance(message, Type11):
            self._take_type11(message, burst)
        heard = (burst.gps_week, burst.tow_s)
        if self.state.station_id == block.station_id and self.state.heard != heard:
            self.state = replace(self.state, heard=heard)

    # --- whose message, and may it be used

    def _is_our_station(self, block: MessageBlock, burst: Burst) -> bool:
        if self.params.station_id and block.station_id != self.params.station_id.strip():
            return False
        known = self.state.station_id
        if known is None or block.station_id == known:
            return True
        # Another station replaces ours only by its station data, and only once ours is silent.
        heard = self.state.heard
        silent = heard is None or _age_s(heard, burst) > self.params.mt1_timeout_s
        return silent and isinstance(block.message, Type2) and not block.test

    def _is_authentic(self, block: MessageBlock, burst: Burst) -> bool:
        if not self.params.authentication:
            return True
        if isinstance(block.message, Type2):
            group = block.message.adb4.slots if block.message.adb4 else ()
            expected = tuple(sorted(SLOT_NAMES.index(letter) for letter in self.params.slot_group)) or group
            if not group or group != expected:
                self._event(EventKind.STATION, block.station_id, "slot_group", _bits(group), _bits(expected))
                return False
            return burst.slot in group
        station = self.state.station
        return station is None or (station.slots is not None and burst.slot in station.slots)

    def _test_block(self, block: MessageBlock) -> None:
        """A station that tests what guidance is made of guides no longer, by nothing it said before either."""
        self.count(test=1)
        if self.state.station_id is not None and block.message_type in GUIDANCE_TYPES:
            self._forget("test_mode")

    def _forget(self, cause: str, value: float = math.nan, threshold: float = math.nan) -> None:
        self._event(EventKind.STATION, self.state.station_id or "", cause, value, threshold)
        self.state = ReceptionState(waiting=self.state.waiting, counts=self.state.counts)

    # --- messages

    def _take_type2(self, message: Type2, station_id: str, burst: Burst) -> None:
        known = self.state.station_id
        if known is not None and station_id != known:
            self._forget("station_changed")
        received = (burst.gps_week, burst.tow_s)
        if known == station_id and message == self.state.type2:
            self.state = replace(self.state, type2_received=received)
            return
        station = _station_data(message)
        old = self.state.station
        if old is not None and old.rsds != station.rsds:
            self._forget("rsds_changed", _number(station.rsds), _number(old.rsds))
            old = None
        if old is None:
            self._event(EventKind.STATION, station_id, "station_selected", float(station.gcid))
        elif old.gcid != station.gcid:
            self._event(EventKind.STATION, station_id, "gcid_changed", float(station.gcid), float(old.gcid))
        self.state = replace(self.state, station_id=station_id, station=station, type2=message, type2_received=received)

    def _take_type1(self, message: Type1, burst: Burst) -> None:
        if message.measurement_type != L1_CA_MEASUREMENT:
            self.count(unusable=1)
            return
        self._take_ephemeris_check(message)
        if message.additional_message_flag == 0:
            self._drop_pending()
            self._take_corrections(message.modified_z_count_s, message.measurements, burst)
            return
        frame, pending = (burst.gps_week, burst.tow_s), self.state.pending_pair
        flags = (pending.additional_message_flag, message.additional_message_flag) if pending else ()
        # Both are sent in one frame. The Z-count alone does not tell: it is the same again after 20 minutes.
        matches = self.state.pending_frame == frame and sorted(flags) == [1, 3]
        if pending and matches and pending.modified_z_count_s == message.modified_z_count_s:
            self.state = replace(self.state, pending_pair=None, pending_frame=None)
            self._take_corrections(message.modified_z_count_s, pending.measurements + message.measurements, burst)
            return
        self._drop_pending()
        self.state = replace(self.state, pending_pair=message, pending_frame=frame)

    def _take_type11(self, message: Type11, burst: Burst) -> None:
        """The 30 s corrections of one frame: a message, or a linked pair."""
        frame = (burst.gps_week, burst.tow_s)
        kept = self.state.type11[-1:] if self.state.type11_frame == frame else ()
        kept = tuple(m for m in kept if m.modified_z_count_s == message.modified_z_count_s)
        self.state = replace(self.state, type11=(*kept, message), type11_frame=frame)

    def _drop_pending(self) -> None:
        """Half of a linked pair whose other half did not come is never used."""
        if self.state.pending_pair is not None:
            self.count(unpaired=1)
            self.state = replace(self.state, pending_pair=None, pending_frame=None)

    def _take_ephemeris_check(self, message: Type1) -> None:
        if not message.measurements or message.ephemeris_crc is None:
            return
        first = message.measurements[0]
        index = SOURCE_ID_INDEX.get(first.ranging_source_id)
        if index is None:
            return
        told = (float(first.iod), float(message.ephemeris_crc), message.ephemeris_decorrelation)
        checks = self.state.checks
        if told != (checks.iod[index], checks.crc[index], checks.p[index]):
            columns = np.array([checks.iod, checks.crc, checks.p])
            columns[:, index] = told
            self.state = replace(self.state, checks=EphemerisChecks(iod=columns[0], crc=columns[1], p=columns[2]))

    def _take_corrections(self, z_count_s: float, measurements: tuple[Correction100, ...], burst: Burst) -> None:
        try:
            week, tow_s = resolve_modified_z_count(z_count_s, burst.gps_week, burst.tow_s)
        except ValueError:
            self.count(unusable=1)
            return
        age_s = seconds_between(week, tow_s, burst.gps_week, burst.tow_s)
        newest = self.state.corrections
        # A Z-count is that of the frame or a little before; one from the future, or older than what we have, is wrong.
        late = newest is not None and seconds_between(newest.gps_week, newest.tow_s, week, tow_s) < 0.0
        if late or not -0.5 * FRAME_DURATION_S <= age_s <= self.params.correction_timeout_s:
            self.count(unusable=1)
            self._event(EventKind.INPUT, "type1", "z_count", age_s, self.params.correction_timeout_s)
            return
        corrections = correction_set(week, tow_s, measurements)
        received = (burst.gps_week, burst.tow_s)
        self.state = replace(self.state, corrections=corrections, type1_received=received)

    def _take_type4(self, message: Type4, burst: Burst) -> None:
        if self.params.rpds == NO_FAS:
            return
        for data_set in message.data_sets:
            if isinstance(data_set, FasDataSet) and data_set.fas.reference_path_data_selector == self.params.rpds:
                approach, refused = self._approach(data_set)
                subject = f"rpds{self.params.rpds}"
                if refused:
                    self.count(unusable=1)
                    self._event(EventKind.INPUT, subject, refused, math.nan)
                elif not _same(approach, self.state.approach):
                    self._event(EventKind.STATION, subject, "approach_received", float(self.params.rpds))
                received = (burst.gps_week, burst.tow_s) if approach is not None else None
                self.state = replace(self.state, approach=approach, type4_received=received)

    def _approach(self, data_set: FasDataSet) -> tuple[FinalApproach | None, str]:
        """The approach of a FAS data set, or None and why not."""
        fas = data_set.fas
        if fas.operation_type != 0:
            return None, "fas_not_straight_in"
        if fas.sbas_provider not in GBAS_PROVIDERS:
            return None, "fas_not_for_gbas"
        station = self.state.station
        if self.params.authentication:
            slots = station.slots if station is not None else None
            if not slots or not fas.reference_path_identifier.startswith(RPI_LETTERS[min(slots)]):
                return None, "fas_not_authentic"
        try:
            return final_approach(data_set), ""
        except ValueError:
            return None, "fas_out_of_bounds"

    def _event(self, kind: EventKind, subject: str, cause: str, value: float, threshold: float = math.nan) -> None:
        week, tow_s = self._epoch
        self.events.append(
            Event(
                gps_week=week,
                tow_s=tow_s,
                kind=kind,
                subject=subject,
                cause=cause,
                value=value,
                threshold=threshold,
                source=SOURCE,
            )
        )


def correction_set(week: int, tow_s: float, measurements: tuple[Correction100, ...]) -> Corrections:
    """Corrections on the satellite axis; sources the suite does not know are left out.

    A source listed twice contradicts itself: its sigma becomes NaN, so that it is not used.
    """
    known = [(SOURCE_ID_INDEX[m.ranging_source_id], m) for m in measurements if m.ranging_source_id in SOURCE_ID_INDEX]
    columns = missing(5 + MAX_REFERENCE_RECEIVERS)
    if known:
        index = [number for number, _ in known]
        rows = [(1.0, m.iod, m.prc_m, m.rrc_mps, m.sigma_pr_gnd_m, *m.b_values_m) for _, m in known]
        columns[:, index] = np.array(rows, dtype=np.float64).T
        if len(set(index)) != len(index):
            columns[4, [number for number in index if index.count(number) > 1]] = np.nan
    columns.flags.writeable = False
    return Corrections(
        gps_week=week,
        tow_s=tow_s,
        listed=columns[0],
        iod=columns[1],
        prc_m=columns[2],
        rrc_mps=columns[3],
        sigma_m=columns[4],
        b_m=columns[5:],
    )


def _station_data(message: Type2) -> StationData:
    adb1 = message.adb1
    # A multiplier of zero would bound nothing: the station does not provide it. The message has none for Galileo; the
    # suite's stations mean both constellations by the GPS one.
    k_md_e = adb1.k_md_e_c_gps if adb1 is not None and adb1.k_md_e_c_gps > 0.0 else math.nan
    return StationData(
        reference_ecef_m=ecef_from_geodetic(message.latitude_rad, message.longitude_rad, message.ellipsoid_height_m),
        reference_height_m=message.ellipsoid_height_m,
        n_receivers=message.n_reference_receivers or 1,
        gcid=message.gcid,
        sigma_vig=message.sigma_vert_iono_gradient,
        refractivity=message.refractivity_index,
        refractivity_uncertainty=message.refractivity_uncertainty,
        scale_height_m=message.scale_height_m,
        d_max_m=adb1.d_max_m if adb1 is not None else math.inf,
        k_md_e=k_md_e,
        rsds=adb1.reference_station_data_selector if adb1 is not None else None,
        slots=message.adb4.slots if message.adb4 is not None else None,
    )


def final_approach(data_set: FasDataSet) -> FinalApproach:
    """The approach a FAS data set describes.

    Raises
    ------
    ValueError
        When a number is out of the approach's bounds.
    """
    fas = data_set.fas
    runway = f"{fas.runway_number:02d}{fas.runway_letter}" if fas.runway_number else ""
    return FinalApproach(
        ltp_lat_rad=fas.ltp_latitude_rad,
        ltp_lon_rad=fas.ltp_longitude_rad,
        ltp_height_m=fas.ltp_height_m,
        delta_fpap_lat_rad=fas.delta_fpap_latitude_rad,
        delta_fpap_lon_rad=fas.delta_fpap_longitude_rad,
        tch_m=fas.tch_m,
        gpa_rad=fas.gpa_rad,
        course_width_m=fas.semi_width_m,
        delta_length_offset_m=fas.delta_length_offset_m,
        fasval_m=data_set.fasval_m,
        faslal_m=data_set.faslal_m,
        apd=fas.approach_performance_designator,
        airport_id=fas.airport_id,
        runway=runway,
        route=fas.route_indicator,
        rpi=fas.reference_path_identifier,
        rpds=fas.reference_path_data_selector,
    )


def _same(approach: FinalApproach | None, other: FinalApproach | None) -> bool:
    """Whether two approaches say the same; a number neither gives (NaN) is the same."""
    if approach is None or other is None:
        return approach is other
    pairs = ((getattr(approach, item.name), getattr(other, item.name)) for item in fields(FinalApproach))
    return all(a == b or (a != a and b != b) for a, b in pairs)


def _age_s(instant: tuple[int, float], burst: Burst) -> float:
    return seconds_between(*instant, burst.gps_week, burst.tow_s)


def _bits(slots: tuple[int, ...]) -> float:
    return float(sum(1 << slot for slot in slots))


def _number(value: int | None) -> float:
    return math.nan if value is None else float(value)

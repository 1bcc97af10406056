"""From VDB bursts to what the station has told: corrections, station data, approach, ephemeris CRCs.

What arrives is used only when its FEC and CRC hold, it comes from the one station listened to, it is no test, its slot
is authentic where that is asked for, and its time is plausible. Everything else is discarded and counted. Data time
only: an age is the time of an epoch less the start of the frame the message came in.

Source: ICAO Annex 10 vol. I, App. B 3.6.4 and 3.6.5; RTCA DO-253 2.3.6 to 2.3.8.
"""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Final

from gbas_airborne.modes import PRODUCT_OF_MEASUREMENT
from gbas_airborne.params import NO_FAS, AirborneParams
from gbas_airborne.reception.second_frequency import PRODUCT_OF_PRIVATE, whole_set
from gbas_airborne.reception.service_d import joined, with_decorrelation, without_decorrelation
from gbas_airborne.reception.station_data import (
    EphemerisChecks,
    correction_set,
    final_approach,
    same_approach,
    station_data,
)
from gbas_airborne.reception.vdb_state import Counts, ReceptionState
from gbas_core.gnss.gpstime import add_seconds, epoch_key, resolve_modified_z_count, seconds_between
from gbas_core.positioning.approach import FinalApproach
from gbas_core.satellites import SOURCE_ID_INDEX
from gbas_msgs_py.codes import EventKind
from gbas_msgs_py.events import Event, EventLog
from gbas_vdb.messages.block import MessageBlock
from gbas_vdb.messages.types import Correction100, FasDataSet, Type1, Type2, Type4, Type8, Type11
from gbas_vdb.transmission.burst import FRAME_DURATION_S, SLOT_NAMES, Burst
from gbas_vdb.transmission.receive import decode_burst

SOURCE: Final = "positioning"
# Known (RTCA DO-246E): first letter of the RPI by the lowest slot of the station, A to H.
RPI_LETTERS: Final = "AXZJCVPT"
# Known (ICAO Annex 10 vol. I, App. B 3.6.4.5): 14 is GBAS only, 15 is any provider.
GBAS_PROVIDERS: Final = (14, 15)
GUIDANCE_TYPES: Final = (1, 2, 4, 11)
_KEY_TOLERANCE_MS: Final = 1


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
    intake = _VdbMessageProcessor(state, gps_week, tow_s, params)
    intake.state.waiting = tuple(waiting)
    intake.count(failed=malformed)
    for burst in ready:
        intake.take(burst)
        intake.join_type11()
    intake.expire()
    return intake.finished(), intake.events.all()


class _VdbMessageProcessor:
    """Works through the bursts of one epoch, on a state in work; the one it hands back is frozen as ever."""

    def __init__(self, state: ReceptionState, gps_week: int, tow_s: float, params: AirborneParams) -> None:
        self.state = SimpleNamespace(**vars(state))
        self.params = params
        self.events = EventLog(gps_week, tow_s, SOURCE)
        self._epoch = (gps_week, tow_s)
        self._counts = dict(vars(state.counts))

    def finished(self) -> ReceptionState:
        return ReceptionState(**{**vars(self.state), "counts": Counts(**self._counts)})

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
            self.events.add(EventKind.STATION, f"rpds{self.params.rpds}", "approach_timeout", age_s, limit_s)
            self.state.approach = None
            self.state.type4_received = None

    def _age_of(self, received: tuple[int, float] | None) -> float:
        return math.nan if received is None else seconds_between(*received, *self._epoch)

    def take(self, burst: Burst) -> None:
        """One burst: its good blocks, in order. One of a frame before the last of our station comes too late."""
        heard = self.state.heard
        if heard is not None and _age_s(heard, burst) < 0.0:
            self.count(bursts=1, unusable=1)
            self.events.add(EventKind.INPUT, "vdb", "burst_out_of_order", _age_s(heard, burst), 0.0)
            return
        decoded = decode_burst(burst)
        self.count(bursts=1, failed=len(decoded.errors), corrected_bytes=decoded.corrected_bytes)
        if decoded.errors:
            self.events.add(EventKind.INPUT, "vdb", "block_discarded", float(len(decoded.errors)))
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
        elif isinstance(message, Type8):
            self._take_type8(message, burst)
        heard = (burst.gps_week, burst.tow_s)
        if self.state.station_id == block.station_id and self.state.heard != heard:
            self.state.heard = heard

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
                self.events.add(EventKind.STATION, block.station_id, "slot_group", _bits(group), _bits(expected))
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
        self.events.add(EventKind.STATION, self.state.station_id or "", cause, value, threshold)
        nothing = ReceptionState(waiting=self.state.waiting, counts=self.state.counts)
        self.state = SimpleNamespace(**vars(nothing))

    # --- messages

    def _take_type2(self, message: Type2, station_id: str, burst: Burst) -> None:
        known = self.state.station_id
        if known is not None and station_id != known:
            self._forget("station_changed")
        received = (burst.gps_week, burst.tow_s)
        if known == station_id and message == self.state.type2:
            self.state.type2_received = received
            return
        station = station_data(message)
        old = self.state.station
        if old is not None and old.rsds != station.rsds:
            self._forget("rsds_changed", _number(station.rsds), _number(old.rsds))
            old = None
        if old is None:
            self.events.add(EventKind.STATION, station_id, "station_selected", float(station.gcid))
        elif old.gcid != station.gcid:
            self.events.add(EventKind.STATION, station_id, "gcid_changed", float(station.gcid), float(old.gcid))
        self.state.station_id = station_id
        self.state.station = station
        self.state.type2 = message
        self.state.type2_received = received

    def _take_type1(self, message: Type1, burst: Burst) -> None:
        if message.measurement_type not in PRODUCT_OF_MEASUREMENT:
            self.count(unusable=1)
            return
        self._take_ephemeris_check(message)
        if message.additional_message_flag == 0:
            self._drop_pending()
            self._take_corrections(message, message.measurements, burst)
            return
        frame, pending = (burst.gps_week, burst.tow_s), self.state.pending_pair
        flags = (pending.additional_message_flag, message.additional_message_flag) if pending else ()
        # Both are sent in one frame. The Z-count alone does not tell: it is the same again after 20 minutes.
        matches = self.state.pending_frame == frame and sorted(flags) == [1, 3]
        if pending and matches and _same_set(pending, message):
            self.state.pending_pair = None
            self.state.pending_frame = None
            self._take_corrections(message, pending.measurements + message.measurements, burst)
            return
        self._drop_pending()
        self.state.pending_pair = message
        self.state.pending_frame = frame

    def _take_type11(self, message: Type11, burst: Burst) -> None:
        """The 30 s corrections of one frame: a message, or a linked pair."""
        frame = (burst.gps_week, burst.tow_s)
        kept = self.state.type11[-1:] if self.state.type11_frame == frame else ()
        kept = tuple(m for m in kept if m.modified_z_count_s == message.modified_z_count_s)
        self.state.type11 = (*kept, message)
        self.state.type11_frame = frame
        self.state.p_d = with_decorrelation(self.state.p_d, message)

    def join_type11(self) -> None:
        """Corrections of GAST-D, where messages of both types of one instant are there."""
        self.state.corrections = joined(self.state.corrections, self.state.type11, self.state.type11_frame)

    def _take_type8(self, message: Type8, burst: Burst) -> None:
        """Corrections of a second frequency: a message, or a linked pair in one frame."""
        kind = message.measurement_type
        if kind not in PRODUCT_OF_PRIVATE:
            self.count(unusable=1)
            return
        before = self.state.pending_private.get(kind)
        waiting, measurements = whole_set(before, message, burst)
        paired = measurements is not None and message.additional_message_flag != 0
        self.count(unpaired=int(before is not None and not paired))
        pending = {other: half for other, half in self.state.pending_private.items() if other != kind}
        self.state.pending_private = pending if waiting is None else {**pending, kind: waiting}
        if measurements is not None:
            self._take_set(PRODUCT_OF_PRIVATE[kind], "type8", message.modified_z_count_s, measurements, burst)

    def _drop_pending(self) -> None:
        """Half of a linked pair whose other half did not come is never used."""
        if self.state.pending_pair is not None:
            self.count(unpaired=1)
            self.state.pending_pair = None
            self.state.pending_frame = None

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
            if first.iod != checks.iod[index]:
                self.state.p_d = without_decorrelation(self.state.p_d, index)
            columns = checks.columns.copy()
            columns[:, index] = told
            self.state.checks = EphemerisChecks(columns=columns)

    def _take_corrections(self, message: Type1, measurements: tuple[Correction100, ...], burst: Burst) -> None:
        """A complete set of corrections of the message's product."""
        product = PRODUCT_OF_MEASUREMENT[message.measurement_type]
        self._take_set(product, "type1", message.modified_z_count_s, measurements, burst)

    def _take_set(
        self, product: str, subject: str, z_count_s: float, measurements: tuple[Correction100, ...], burst: Burst
    ) -> None:
        """A complete set of corrections of a product; `subject` is what an event is about."""
        try:
            week, tow_s = resolve_modified_z_count(z_count_s, burst.gps_week, burst.tow_s)
        except ValueError:
            self.count(unusable=1)
            return
        age_s = seconds_between(week, tow_s, burst.gps_week, burst.tow_s)
        newest = self.state.corrections.get(product)
        # A Z-count is that of the frame or a little before; one from the future, or older than what we have, is wrong.
        late = newest is not None and seconds_between(newest.gps_week, newest.tow_s, week, tow_s) < 0.0
        if late or not -0.5 * FRAME_DURATION_S <= age_s <= self.params.correction_timeout_s:
            self.count(unusable=1)
            self.events.add(EventKind.INPUT, subject, "z_count", age_s, self.params.correction_timeout_s)
            return
        corrections = correction_set((week, tow_s), (burst.gps_week, burst.tow_s), measurements)
        self.state.corrections = {**self.state.corrections, product: corrections}

    def _take_type4(self, message: Type4, burst: Burst) -> None:
        if self.params.rpds == NO_FAS:
            return
        for data_set in message.data_sets:
            if isinstance(data_set, FasDataSet) and data_set.fas.reference_path_data_selector == self.params.rpds:
                approach, refused = self._approach(data_set)
                subject = f"rpds{self.params.rpds}"
                if refused:
                    self.count(unusable=1)
                    self.events.add(EventKind.INPUT, subject, refused)
                elif not same_approach(approach, self.state.approach):
                    self.events.add(EventKind.STATION, subject, "approach_received", float(self.params.rpds))
                received = (burst.gps_week, burst.tow_s) if approach is not None else None
                self.state.approach = approach
                self.state.type4_received = received

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


def _same_set(one: Type1, other: Type1) -> bool:
    """Whether two messages are of the same product and instant."""
    return (one.measurement_type, one.modified_z_count_s) == (other.measurement_type, other.modified_z_count_s)


def _age_s(instant: tuple[int, float], burst: Burst) -> float:
    return seconds_between(*instant, burst.gps_week, burst.tow_s)


def _bits(slots: tuple[int, ...]) -> float:
    return float(sum(1 << slot for slot in slots))


def _number(value: int | None) -> float:
    return math.nan if value is None else float(value)

"""What a station's messages take of its slots: bytes, slots and update times, counted in frames that are really made.

Nothing is estimated: the frames of two periods are scheduled with corrections of so many satellites, and looked into.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Final

from gbas_core.satellites import GALILEO_SOURCE_ID_OFFSET
from gbas_vdb.coding.fec import MAX_APPLICATION_BYTES
from gbas_vdb.messages import tables
from gbas_vdb.messages.block import MessageBlock
from gbas_vdb.messages.fixed_places import Items
from gbas_vdb.messages.types import (
    AdditionalBlock1,
    AdditionalBlock3,
    Correction30,
    Correction100,
    FasBlock,
    FasDataSet,
    Type1,
    Type2,
    Type8,
)
from gbas_vdb.transmission.burst import FRAME_DURATION_S
from gbas_vdb.transmission.capacity import MAX_SOURCES
from gbas_vdb.transmission.frame import Frame, ScheduleParams, ScheduleState, SourceCorrection, Sources
from gbas_vdb.transmission.receive import decode_burst
from gbas_vdb.transmission.schedule import further_sources_that_fit, schedule_frame, sources_that_fit

FIRST_SOURCE: Final = {"G": 1, "E": GALILEO_SOURCE_ID_OFFSET + 1}
"""Ranging source identifier of the first satellite of each system."""
MOST: Final = {"G": 32, "E": 36}
"""Satellites of each system."""
_KINDS_WORDS: Final = {0: "L5/E5a, 100 s", 1: "L5/E5a, 30 s"}
_WORDS: Final = {1: "L1/E1, 100 s", 2: "station data", 3: "filler", 4: "approaches", 11: "L1/E1, 30 s"}
_Blocks = dict[int, tuple[MessageBlock, ...]]
"""Message blocks of a frame by slot."""


@dataclass(frozen=True, kw_only=True)
class MessageBudget:
    """What messages of one type take.

    Attributes
    ----------
    message_type : int
    what : str
    satellites : int
        With corrections in them.
    messages_per_frame, bytes_per_frame : float
        Means; with headers and CRCs.
    update_s : float
        Longest time from one to the next [s].
    """

    message_type: int
    what: str
    satellites: int
    messages_per_frame: float
    bytes_per_frame: float
    update_s: float


@dataclass(frozen=True, kw_only=True)
class FrameBudget:
    """What a station's messages take of its slots.

    Attributes
    ----------
    messages : tuple of MessageBudget
    slot_bytes : tuple of int
        Most bytes of application data in each slot assigned.
    bytes_per_frame : int
        Of application data, in the fullest frame.
    capacity_bytes : int
        Of the slots assigned.
    satellites, room : int
        Asked for, and that fit in types 1 and 11.
    second_room : int
        That fit with the second band too, beside those that are sent; -1 where not even an empty message does.
    first_s : float
        Longest time until every satellite was first in a type 1 message, which alone has its ephemeris CRC and P [s].
    """

    messages: tuple[MessageBudget, ...]
    slot_bytes: tuple[int, ...]
    bytes_per_frame: int
    capacity_bytes: int
    satellites: int
    room: int
    second_room: int
    first_s: float

    @property
    def left_out(self) -> int:
        """Satellites that there is no room for."""
        return max(self.satellites - self.room, 0)

    @property
    def second_left_out(self) -> int:
        """Satellites sent that there is no room for on the second band."""
        return min(self.satellites, self.room) - max(self.second_room, 0)


def frame_budget(
    numbers: Sequence[int], kinds: Sequence[int], params: ScheduleParams, *, n_approaches: int = 1
) -> FrameBudget:
    """Count what is in the frames of a station.

    Parameters
    ----------
    numbers : sequence of int
        Ranging source identifiers of the satellites.
    kinds : sequence of int
        Measurement types of the second band's messages; none for one band.
    params : ScheduleParams
    n_approaches : int

    Raises
    ------
    ScheduleError
        When the slots do not hold what is not about satellites.
    """
    station = _station(service_d=11 in params.message_types)
    approaches = tuple(_approach(number) for number in range(n_approaches))
    room = sources_that_fit(station, approaches, params)
    sent = list(numbers[:room])
    second_room = further_sources_that_fit(len(sent), kinds, station, approaches, params) if kinds else len(sent)
    second = sent[: max(second_room, 0)]
    frames = _frames(sent, second if second_room >= 0 else None, kinds, station, approaches, params)
    sizes = [{slot: sum(block.length for block in blocks) for slot, blocks in bursts.items()} for bursts in frames]
    return FrameBudget(
        messages=_messages(frames),
        slot_bytes=tuple(max(each.get(slot, 0) for each in sizes) for slot in params.slots),
        bytes_per_frame=max(sum(each.values()) for each in sizes),
        capacity_bytes=MAX_APPLICATION_BYTES * len(params.slots),
        satellites=len(numbers),
        room=min(room, MAX_SOURCES),
        second_room=second_room,
        first_s=_first_s(frames, sent),
    )


def _frames(
    sent: Sequence[int], second: Sequence[int] | None, kinds: Sequence[int], station: Type2,
    approaches: tuple[FasDataSet, ...], params: ScheduleParams,
) -> list[_Blocks]:  # fmt: skip
    """Two periods of frames."""
    sources = Sources.of([_source(number) for number in sent])
    further = {} if second is None else {
        kind: Items.of(tables.PRIVATE_ENTRIES[kind], [_source(number).type1 for number in second]) for kind in kinds
    }  # fmt: skip
    state, frames = ScheduleState(), list[_Blocks]()
    for number in range(2 * params.period_frames):
        frame = Frame(
            gps_week=0, tow_s=number * FRAME_DURATION_S, sources=sources, station=station, further=further,
            approaches=approaches,
        )  # fmt: skip
        state, bursts = schedule_frame(state, frame, params)
        frames.append({burst.slot: decode_burst(burst).blocks for burst in bursts})
    return frames


def _messages(frames: Sequence[_Blocks]) -> tuple[MessageBudget, ...]:
    lengths: dict[tuple[int, int], list[int]] = defaultdict(list)
    satellites: dict[tuple[int, int], int] = defaultdict(int)
    seen: dict[tuple[int, int], list[int]] = defaultdict(list)
    for number, bursts in enumerate(frames):
        counts: dict[tuple[int, int], int] = defaultdict(int)
        for block in chain.from_iterable(bursts.values()):
            kind = block.message.measurement_type if isinstance(block.message, Type8) else 0
            key = block.message_type, kind
            lengths[key].append(block.length)
            counts[key] += len(getattr(block.message, "measurements", ()))
            if number not in seen[key]:
                seen[key].append(number)
        for key, count in counts.items():
            satellites[key] = max(satellites[key], count)
    return tuple(
        MessageBudget(
            message_type=key[0],
            what=_KINDS_WORDS[key[1]] if key[0] == tables.PRIVATE_TYPE else _WORDS[key[0]],
            satellites=satellites[key],
            messages_per_frame=len(lengths[key]) / len(frames),
            bytes_per_frame=sum(lengths[key]) / len(frames),
            update_s=_longest_s(seen[key], len(frames)),
        )
        for key in sorted(lengths)
    )


def _longest_s(seen: Sequence[int], n_frames: int) -> float:
    """Longest time between frames, from before the first one and to behind the last."""
    places = [-1, *seen]
    return max(after - before for before, after in zip(places, [*seen, n_frames], strict=True)) * FRAME_DURATION_S


def _first_s(frames: Sequence[_Blocks], sent: Sequence[int]) -> float:
    missing = set(sent)
    for number, bursts in enumerate(frames, start=1):
        for message in (block.message for block in chain.from_iterable(bursts.values())):
            if isinstance(message, Type1) and message.measurements:
                missing.discard(message.measurements[0].ranging_source_id)
        if not missing:
            return number * FRAME_DURATION_S
    return math.inf


# --- something to send


def _source(number: int) -> SourceCorrection:
    correction = Correction100(
        ranging_source_id=number, iod=0, prc_m=0.0, rrc_mps=0.0, sigma_pr_gnd_m=1.0, b_values_m=(0.0,) * 4
    )
    of_30 = Correction30(
        ranging_source_id=number, prc_30_m=0.0, rrc_30_mps=0.0, sigma_pr_gnd_d_m=1.0, sigma_pr_gnd_30_m=1.0
    )
    return SourceCorrection(
        corrections={1: correction, 11: of_30}, ephemeris_crc=number, decorrelation={1: 0.0, 11: 0.0}
    )


def _station(*, service_d: bool) -> Type2:
    return Type2(
        n_reference_receivers=4, ground_accuracy_designator="C", gcid=1, magnetic_variation_rad=0.0,
        sigma_vert_iono_gradient=4e-6, refractivity_index=400.0, scale_height_m=7900.0, refractivity_uncertainty=20.0,
        latitude_rad=0.0, longitude_rad=0.0, ellipsoid_height_m=0.0,
        adb1=AdditionalBlock1(k_md_e_pos_gps=5.0, k_md_e_c_gps=5.0),
        adb3=AdditionalBlock3(k_md_e_d_gps=5.0, sigma_vert_iono_gradient_d=4e-6, y_eig_m=1.0, m_eig=1e-4)
        if service_d
        else None,
    )  # fmt: skip


def _approach(number: int) -> FasDataSet:
    return FasDataSet(
        fas=FasBlock(
            airport_id="XXXX", runway_number=1 + number % 36, approach_performance_designator=1,
            reference_path_data_selector=number, reference_path_identifier="GXXX", ltp_latitude_rad=0.0,
            ltp_longitude_rad=0.0, ltp_height_m=0.0, delta_fpap_latitude_rad=0.0, delta_fpap_longitude_rad=1e-4,
            tch_m=15.0, gpa_rad=math.radians(3.0), course_width_m=105.0,
        ),
        fasval_m=10.0,
        faslal_m=40.0,
    )  # fmt: skip

"""What a 0.5 s frame is made of, and what is remembered from frame to frame.

:class:`Frame` is what a station wants to send, :class:`ScheduleParams` how much it may, :class:`ScheduleState` what it
has sent before; :mod:`gbas_vdb.transmission.schedule` makes bursts of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from gbas_vdb.errors import ScheduleError
from gbas_vdb.messages import tables
from gbas_vdb.messages.fixed_places import Items
from gbas_vdb.messages.types import Correction30, Correction100, FasDataSet, Type2, Type5, UnknownDataSet
from gbas_vdb.transmission.rotation import SourceHistory


@dataclass(frozen=True, kw_only=True)
class ScheduleParams:
    """How a station broadcasts.

    Attributes
    ----------
    station_id : str
        GBAS identification.
    slots : tuple of int
        Assigned slots, 0 (A) to 7 (H), ascending; the station slot identifier is the first.
    message_types : tuple of int
        Messages with corrections, type 1 first; every source needs a correction for each.
    test : bool
        Mark every block as a test.
    period_frames : int
        Frames within which station data and every approach must be sent.
    occupancy_min : float
        Part of a burst's application data that must be filled when authentication (ADB4) is broadcast. Uncertain: 0.95
        in published flight trials, 0.89 may be the value of the 2018 amendment.
    """

    station_id: str
    slots: tuple[int, ...] = (0,)
    message_types: tuple[int, ...] = (1,)
    test: bool = False
    period_frames: int = 20
    occupancy_min: float = 0.95

    def __post_init__(self) -> None:
        """Check the parameters.

        Raises
        ------
        ValueError
            Naming the parameter, its value and the bound.
        """
        tables.STATION_ID.to_raw(self.station_id)
        if not self.slots or list(self.slots) != sorted(set(self.slots)) or not set(self.slots) <= set(range(8)):
            raise ValueError(f"slots = {self.slots!r}: ascending numbers of 0 (A) to 7 (H) are wanted")
        types, known = self.message_types, tables.CORRECTION_ENTRIES
        if types[:1] != (1,) or len(set(types)) != len(types) or not set(types) <= set(known):
            raise ValueError(f"message_types = {types!r}: 1 and then others of {', '.join(map(str, known))} are wanted")
        if not 1 <= self.period_frames <= 20:
            raise ValueError(f"period_frames = {self.period_frames!r} outside 1 to 20")
        if not 0.0 <= self.occupancy_min <= 1.0:
            raise ValueError(f"occupancy_min = {self.occupancy_min!r} outside 0 to 1")

    @property
    def ssid(self) -> int:
        """Station slot identifier: the first assigned slot."""
        return self.slots[0]


@dataclass(frozen=True, kw_only=True, slots=True)
class SourceCorrection:
    """All there is to broadcast of one ranging source in a frame.

    Attributes
    ----------
    corrections : mapping of int to Correction100 or Correction30
        By the type of the message that carries it.
    ephemeris_crc : int
    decorrelation : mapping of int to float
        P of each message [m/m].
    source_availability_s : float or None
        None: not provided.
    """

    corrections: Mapping[int, Correction100 | Correction30]
    ephemeris_crc: int
    decorrelation: Mapping[int, float]
    source_availability_s: float | None = None

    @property
    def type1(self) -> Correction100:
        """The correction that every station sends.

        Raises
        ------
        ScheduleError
            When there is none.
        """
        correction = self.corrections.get(1)
        if not isinstance(correction, Correction100):
            raise ScheduleError("a ranging source has no correction for message type 1")
        return correction

    @property
    def number(self) -> int:
        """The ranging source identifier."""
        return self.type1.ranging_source_id


class Sources(NamedTuple):
    """All there is to broadcast of the ranging sources in a frame, as columns of one length.

    Attributes
    ----------
    numbers, iods, ephemeris_crcs : list of int
    corrections : mapping of int to Items
        By the type of the message that carries them.
    decorrelation : mapping of int to list of float
        P of each message [m/m].
    availability_s : list of float or None
    """

    numbers: Sequence[int]
    iods: Sequence[int]
    ephemeris_crcs: Sequence[int]
    corrections: Mapping[int, Items]
    decorrelation: Mapping[int, Sequence[float]]
    availability_s: Sequence[float | None]

    @classmethod
    def of(cls, sources: Sequence[SourceCorrection]) -> Sources:
        """Columns of single sources.

        Raises
        ------
        ScheduleError
            When a source has no correction of its own for message type 1, or for one that another has.
        """
        first = [source.type1 for source in sources]
        kinds = sorted({kind for source in sources for kind in source.corrections})
        for kind in kinds:
            for source in sources:
                correction = source.corrections.get(kind)
                if correction is None or correction.ranging_source_id != source.number:
                    raise ScheduleError(no_correction(source.number, kind))
        return cls(
            numbers=[each.ranging_source_id for each in first],
            iods=[each.iod for each in first],
            ephemeris_crcs=[source.ephemeris_crc for source in sources],
            corrections={
                kind: Items.of(tables.CORRECTION_ENTRIES[kind], [source.corrections[kind] for source in sources])
                for kind in kinds
            },
            decorrelation={kind: [source.decorrelation.get(kind, math.nan) for source in sources] for kind in kinds},
            availability_s=[source.source_availability_s for source in sources],
        )


def no_correction(number: int, kind: int) -> str:
    return f"ranging source {number} has no correction of its own for message type {kind}"


@dataclass(frozen=True, kw_only=True, slots=True)
class Frame:
    """What a station has to say in one frame; the epoch of the corrections is the start of the frame.

    `further` are corrections in messages of ours, by their measurement type, of those sources that have them.
    """

    gps_week: int
    tow_s: float
    sources: Sources
    station: Type2
    further: Mapping[int, Items] = field(default_factory=dict)
    approaches: tuple[FasDataSet | UnknownDataSet, ...] = ()
    predictions: Type5 | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class ItemHistory:
    """Last frame in which something periodic may next be sent, and whether it ever was."""

    due: int
    sent: bool


@dataclass(frozen=True, kw_only=True, slots=True)
class ScheduleState:
    """What was sent and when; the initial state is ``ScheduleState()``.

    Attributes
    ----------
    frame : int
        Frames sent so far.
    sources : mapping
        History of each ranging source.
    items : mapping of bytes to ItemHistory
        History of station data, approaches and predictions, each by its bits.
    """

    frame: int = 0
    sources: Mapping[int, SourceHistory] = field(default_factory=dict)
    items: Mapping[bytes, ItemHistory] = field(default_factory=dict)

"""What the receiver remembers of the VDB between epochs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from gbas_airborne.reception.second_frequency import Half
from gbas_airborne.reception.station_data import Corrections, EphemerisChecks, StationData
from gbas_core.positioning.approach import FinalApproach
from gbas_core.record import FloatArray
from gbas_vdb.messages.types import Type1, Type2, Type11
from gbas_vdb.transmission.burst import Burst


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
    type2_received, type4_received : (week, tow_s) or None
        Frames of the last station data, and of the last data of the selected approach.
    corrections : mapping from a product's name to Corrections
        The last complete set of each product received.
    pending_pair, pending_frame
        First half of a linked pair, and the frame it came in.
    pending_private
        First halves of linked pairs of private messages, by their measurement type.
    type11, type11_frame
        The 30 s corrections of one frame, and which.
    p_d : (N_SATS,) array or None
        P_D as type 11 messages sent it [m/m].
    """

    station_id: str | None = None
    heard: tuple[int, float] | None = None
    station: StationData | None = None
    type2: Type2 | None = None
    type2_received: tuple[int, float] | None = None
    approach: FinalApproach | None = None
    type4_received: tuple[int, float] | None = None
    corrections: Mapping[str, Corrections] = field(default_factory=dict)
    checks: EphemerisChecks = field(default_factory=EphemerisChecks)
    pending_pair: Type1 | None = None
    pending_frame: tuple[int, float] | None = None
    pending_private: Mapping[int, Half] = field(default_factory=dict)
    type11: tuple[Type11, ...] = ()
    type11_frame: tuple[int, float] | None = None
    p_d: FloatArray | None = None
    waiting: tuple[Burst, ...] = ()
    counts: Counts = field(default_factory=Counts)

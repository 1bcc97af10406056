"""What a simulated world gives of an epoch: observations of all receivers, and where the aircraft is."""

from __future__ import annotations

from dataclasses import dataclass

from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.record import FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Truth:
    """The aircraft's antenna at the instant of its observations: the time tag less the receiver's clock error.

    Attributes
    ----------
    gps_week, tow_s
        Time tag of the epoch.
    position_m, velocity_mps : (3,) arrays
        ECEF [m], [m/s].
    roll_rad, pitch_rad, heading_rad : float
        Attitude: right wing down, nose up, true heading clockwise from north.
    """

    gps_week: int
    tow_s: float
    position_m: FloatArray
    velocity_mps: FloatArray
    roll_rad: float
    pitch_rad: float
    heading_rad: float


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedEpoch:
    """What all receivers observe at one time tag, and where the aircraft is.

    Attributes
    ----------
    key : int
        Epoch key of the time tag, see :func:`gbas_core.gnss.gpstime.epoch_key`.
    ground : tuple of ObservationEpoch
        One a reference receiver.
    airborne : ObservationEpoch or None
        None without an aircraft.
    truth : Truth or None
    """

    key: int
    ground: tuple[ObservationEpoch, ...]
    airborne: ObservationEpoch | None
    truth: Truth | None

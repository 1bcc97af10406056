"""Parameters of the airborne receiver: everything a site, an aircraft or a study may choose.

All fields are plain numbers, booleans or strings, so that a ROS parameter file can carry them. Angles are in degrees
here because this is where files enter; everything behind uses radians.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import yaml

from gbas_core.parameters import ParameterError, field_types, parameters_from, require
from gbas_core.ranging.slips import NORMAL_MANOEUVRE_JERK_MPS3
from gbas_core.satellites import SYSTEM_MASKS
from gbas_vdb.transmission.burst import SLOT_NAMES

NO_FAS: Final = -1
MAX_RPDS: Final = 48

# name: (lower bound, upper bound), both allowed.
_BOUNDS: Final[dict[str, tuple[float, float]]] = {
    "rpds": (NO_FAS, MAX_RPDS),
    "elevation_mask_deg": (5.0, 45.0),
    "smoothing_tau_s": (0.0, 1000.0),
    "settle_s": (0.0, 3600.0),
    "max_gap_s": (0.1, 120.0),
    "receiver_jerk_mps3": (0.0, 100.0),
    "correction_wait_s": (0.0, 10.0),
    "correction_timeout_s": (0.0, 10.0),
    "mt1_timeout_s": (0.0, 3.5),
    "station_data_timeout_s": (10.0, 3600.0),
    "max_speed_mps": (0.0, 1000.0),
    "speed_history_s": (0.0, 120.0),
    "range_test_sigma": (1.0, 20.0),
    "range_test_floor_m": (0.0, 1000.0),
    "range_test_max_exclusions": (0, 10),
    "range_test_hold_s": (0.0, 3600.0),
    "max_condition": (1.0, 1e12),
    "max_iterations": (2, 100),
    "protection_probability": (1e-15, 1e-3),
    "receiver_fault_prior": (1e-12, 1.0),
    "k_ffmd_single": (1.0, 20.0),
}


@dataclass(frozen=True, kw_only=True)
class AirborneParams:
    """Choices of the airborne receiver; the defaults are GAST-C as published, on the safe side where that is open.

    Attributes
    ----------
    service : str
        Service type asked for: ``"C"``.
    aad : str
        Airborne accuracy designator, ``"A"`` or ``"B"``.
    systems : str
        Satellite systems used, letters as in RINEX; a satellite without corrections is not used anyway.
    rpds : int
        Reference path data selector of the approach, 0 to 48; -1 for no approach: protection levels are then vertical
        and lateral about a north heading and there are no alert limits.
    authentication : bool
        Require ADB4: only bursts in its slot group are used, and the approach's RPI must name the group's first slot.
    slot_group : str
        Slots expected from ADB4 when `authentication` is on, such as ``"AB"``; empty takes what ADB4 says.
    station_id : str
        GBAS ID of the only station listened to; empty listens to the first that sends station data.
    elevation_mask_deg : float
        Satellites below are not used [deg]; not below the 5 degrees of the standard.
    smoothing_tau_s : float
        Time constant of the carrier smoothing [s]; 100 for GAST-C, 0 switches smoothing off (for comparisons).
    settle_s : float
        A satellite is used once its filter has run this long [s]; see docs/decisions/0002.
    inflate_unsettled : bool
        Scale airborne noise and multipath while the filter settles, and for a time constant below 100 s.
    max_gap_s : float
        After a longer pause between two epochs all filters start anew [s]. It must be above the interval of the data.
    receiver_jerk_mps3 : float
        Jerk of the aircraft the slip detection allows for [m/s^3]; the default is a normal manoeuvre.
    correction_wait_s : float
        How long after its own epoch the receiver waits for corrections [s]: observations of t use frames that begin at
        t - 0.5 s + wait or before. 0.5 waits for the frame of its own epoch, 0 emulates output at once.
    correction_timeout_s : float
        Corrections older than this are not used [s]. Not above the standard's 10 s.
    mt1_timeout_s : float
        Guidance is lost without a valid type 1 message for this long [s]. Not above the standard's 3.5 s.
    station_data_timeout_s : float
        Station data and the approach are forgotten when they were not repeated for this long [s]. The standard has them
        sent at least every 20 frames (10 s); ours is the rule to forget, so that what a station withdraws or changes is
        not used for ever by an aircraft that misses the message. Data of another rate than 2 Hz have longer frames.
    max_speed_mps : float
        Speed taken for the ionospheric sigma while the own speed is not known [m/s]; 82 m/s is 160 kt.
    speed_history_s : float
        The own speed is estimated from positions at most this far apart [s]; a turn hides speed over a longer time.
    require_ephemeris_bound : bool
        Without K_md_e (ADB1) there is no protection level. The standard allows stations without; then it is for the
        operator to switch this off.
    use_unhealthy : bool
        Positions and protection levels from a station that says it is not healthy as well: for recorded data and test
        beds. There is never a service from it, and always an alert.
    range_test_sigma, range_test_floor_m : float
        A residual beyond this many sigmas and beyond this floor [m] excludes the satellite.
    range_test_max_exclusions : int
        Satellites the range test may have excluded at one time; more means no position.
    range_test_hold_s : float
        A satellite the range test excluded is not tried again for this long [s].
    max_condition : float
        Largest condition number of the geometry matrix that still gives a position [-].
    max_iterations : int
        Gauss-Newton steps before the position counts as not found.
    protection_probability : float
        Probability p the protection level multipliers are made from, 2.5e-8 for GAST-C [-].
    receiver_fault_prior : float
        Prior probability of a reference receiver fault [-].
    k_ffmd_single : float
        K_ffmd with one reference receiver [-].

    Notes
    -----
    Sources: ICAO Annex 10 vol. I, App. B 3.6.5; RTCA DO-253. `settle_s`, `max_gap_s`, `max_speed_mps`,
    `station_data_timeout_s` and the range test are the suite's own.
    """

    service: str = "C"
    aad: str = "A"
    systems: str = "GE"
    rpds: int = NO_FAS
    station_id: str = ""
    authentication: bool = False
    slot_group: str = ""
    elevation_mask_deg: float = 5.0
    smoothing_tau_s: float = 100.0
    settle_s: float = 230.0
    inflate_unsettled: bool = True
    max_gap_s: float = 3.5
    receiver_jerk_mps3: float = NORMAL_MANOEUVRE_JERK_MPS3
    correction_wait_s: float = 0.5
    correction_timeout_s: float = 10.0
    mt1_timeout_s: float = 3.5
    station_data_timeout_s: float = 60.0
    max_speed_mps: float = 82.0
    speed_history_s: float = 3.5
    require_ephemeris_bound: bool = True
    use_unhealthy: bool = False
    range_test_sigma: float = 6.0
    range_test_floor_m: float = 10.0
    range_test_max_exclusions: int = 3
    range_test_hold_s: float = 60.0
    max_condition: float = 1e4
    max_iterations: int = 10
    protection_probability: float = 2.5e-8
    receiver_fault_prior: float = 1e-5
    k_ffmd_single: float = 6.86

    def __post_init__(self) -> None:
        """Check every field.

        Raises
        ------
        ParameterError
            Naming the field, its value and the bound it breaks.
        """
        for name, kind in field_types(AirborneParams).items():
            value = getattr(self, name)
            good = type(value) is kind or (kind is float and type(value) is int)
            require(name, value, good, f"a {kind.__name__}")
        for name, (lower, upper) in _BOUNDS.items():
            value = getattr(self, name)
            require(name, value, math.isfinite(value) and lower <= value <= upper, f"{lower:g} to {upper:g}")
        require("service", self.service, self.service == "C", "C")
        require("aad", self.aad, self.aad in ("A", "B"), "A or B")
        require(
            "systems", self.systems, _distinct(self.systems, "".join(SYSTEM_MASKS)) and bool(self.systems), "G, E or GE"
        )
        require("slot_group", self.slot_group, _distinct(self.slot_group, SLOT_NAMES), "distinct letters A to H")
        require(
            "slot_group", self.slot_group, self.authentication or not self.slot_group, "none without authentication"
        )
        require("station_id", self.station_id, len(self.station_id) <= 4, "at most 4 characters")

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> AirborneParams:
        """Make parameters from names and values, as a file or a node has them.

        Raises
        ------
        ParameterError
            For a name that is not a parameter, or a value out of bounds.
        """
        return parameters_from(cls, mapping)

    @classmethod
    def from_yaml(cls, path: str | Path) -> AirborneParams:
        """Read parameters from a YAML file: plain names, below ``airborne:``, or a ROS parameter file of either.

        Raises
        ------
        ParameterError
            Naming the file and what is wrong in it.
        """
        try:
            document = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
            return cls.from_mapping(_section(document))
        except (OSError, UnicodeDecodeError, yaml.YAMLError, ValueError) as error:
            raise ParameterError(f"{path}: {error}") from error


def _section(document: Any) -> Mapping[str, Any]:
    for key in ("/**", "ros__parameters", "airborne"):
        if isinstance(document, Mapping) and key in document:
            document = document[key]
    if document is None:
        return {}
    if not isinstance(document, Mapping):
        raise ParameterError(f"airborne parameters are names and values, not {document!r:.40}")
    return document


def _distinct(value: str, letters: str) -> bool:
    return len(set(value)) == len(value) and not set(value) - set(letters)

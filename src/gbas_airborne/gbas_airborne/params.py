"""Parameters of the airborne receiver: everything a site, an aircraft or a study may choose.

The defaults are GAST-C as published, on the safe side where that is open. Sources: ICAO Annex 10 vol. I, App. B 3.6.5;
RTCA DO-253. ``settle_s``, ``max_gap_s``, ``max_speed_mps``, ``station_data_timeout_s`` and the range test are the
suite's own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from gbas_core.configuration import read_configuration
from gbas_core.parameters import Parameter, ParameterError, from_mapping, parameters
from gbas_core.ranging.divergence import AIRBORNE, AIRBORNE_THRESHOLD_MPS
from gbas_core.ranging.slips import NORMAL_MANOEUVRE_JERK_MPS3
from gbas_msgs_py import modes
from gbas_vdb.transmission.burst import SLOT_NAMES

SECTION: Final = "airborne"
NO_FAS: Final = -1
MAX_RPDS: Final = 48
ALL_MODES: Final = "all"
OF_LEVELS: Final = "100 s"
_MAX_STATION_ID: Final = 4


@parameters
class ServiceDParams:
    """GAST-D: what its protection levels and monitors are set to.

    Sources: RTCA DO-253D by way of published descriptions; time constant and limit of the divergence are those of
    Jiang, Milner, Macabiau, ENC 2015. Known are 2 m, 200 m and the time-outs; uncertain are K_fd_B, the limits of
    projections (ceilings recommended to aircraft), the gate, and all times of holding and clearing, which are ours.
    """

    protection_probability: Annotated[
        float, Parameter("probability the protection level multipliers of GAST-D are made from", "-", 1e-15, 1e-3)
    ] = 1.25e-10
    weights: Annotated[
        Literal["30 s", "100 s"],
        Parameter("sigmas the positions are weighted with: those of the 30 s corrections, or those of the levels"),
    ] = "30 s"
    low_timeout_s: Annotated[
        float, Parameter("guidance is lost without messages for this long below 200 ft", "s", 0.0, 3.5)
    ] = 1.5
    require_authentication: Annotated[
        bool, Parameter("no GAST-D without authentication of the station's slots (see authentication)")
    ] = True
    divergence_mps: Annotated[
        float, Parameter("a satellite whose code and carrier drift apart faster is not used", "m/s", 0.0, 1.0)
    ] = AIRBORNE_THRESHOLD_MPS
    divergence_tau_s: Annotated[float, Parameter("time constant of both filters of that rate", "s", 1.0, 1000.0)] = (
        AIRBORNE.tau_s
    )
    divergence_settle_s: Annotated[
        float, Parameter("time these filters have to run before a satellite is used", "s", 0.0, 3600.0)
    ] = AIRBORNE.settle_s
    divergence_clear_s: Annotated[
        float, Parameter("an excluded satellite is used again when the rate was small for this long", "s", 0.0, 3600.0)
    ] = 100.0
    dual_solution_m: Annotated[
        float, Parameter("largest difference of 30 s and 100 s solutions, vertically and laterally", "m", 0.0, 100.0)
    ] = 2.0
    k_fd_b: Annotated[
        float, Parameter("threshold of the B values in the position over their sigma (RRFM)", "-", 1.0, 20.0)
    ] = 5.26
    exclusions: Annotated[int, Parameter("satellites that may be left out so that both of these pass", "-", 0, 3)] = 1
    exclusion_hold_s: Annotated[
        float, Parameter("a satellite left out is not tried again for this long", "s", 0.0, 3600.0)
    ] = 60.0
    correction_shift_m: Annotated[
        float, Parameter("most that the 100 s corrections may move the position horizontally", "m", 0.0, 10000.0)
    ] = 200.0
    s_vert: Annotated[
        float, Parameter("largest vertical projection of a satellite that the aircraft allows", "-", 0.1, 100.0)
    ] = 4.0
    s_vert_pair: Annotated[float, Parameter("largest sum of those of two satellites", "-", 0.1, 100.0)] = 6.0
    s_lat: Annotated[
        float, Parameter("largest lateral projection of a satellite that the aircraft allows", "-", 0.1, 100.0)
    ] = 4.0
    s_lat_pair: Annotated[float, Parameter("largest sum of those of two satellites", "-", 0.1, 100.0)] = 6.0
    step_in_s: Annotated[
        float, Parameter("a satellite is used when it has been usable for this long", "s", 0.0, 3600.0)
    ] = 50.0
    upgrade_gate_m: Annotated[
        float,
        Parameter("nearer to the threshold no better service is taken up again", "m", 0.0, 100000.0),
    ] = 7500.0


@parameters
class AirborneParams:
    """Choices of the airborne receiver."""

    service: Annotated[
        Literal["C", "D", "L5-100", "L5-30", "IF-100", "IF-30"],
        Parameter("approach service type asked for: C, D, or one of two bands that no standard has yet"),
    ] = "C"
    fallback: Annotated[
        bool,
        Parameter(
            "where the service asked for cannot be given, the next one guides: D or L5, then C; IF, then L5, then C"
        ),
    ] = True
    modes: Annotated[
        tuple[str, ...],
        Parameter(
            "processing modes that run beside it for /gbas/airborne/modes, by their names in docs/contract.md; "
            "'all' is every mode of the systems used"
        ),
    ] = ()
    aad: Annotated[Literal["A", "B"], Parameter("airborne accuracy designator")] = "A"
    systems: Annotated[
        Literal["G", "E", "GE", "EG"],
        Parameter("satellite systems used; a satellite without corrections is not used anyway"),
    ] = "GE"
    rpds: Annotated[
        int,
        Parameter(
            "reference path data selector of the approach; -1: none, protection levels are then vertical and lateral "
            "about a north heading, and there are no alert limits",
            "-", NO_FAS, MAX_RPDS,
        ),
    ] = NO_FAS  # fmt: skip
    station_id: Annotated[
        str, Parameter("GBAS ID of the only station listened to; empty: the first that sends station data")
    ] = ""
    authentication: Annotated[
        bool,
        Parameter(
            "require ADB4: only bursts in its slot group are used, and the approach's RPI must name the group's first "
            "slot"
        ),
    ] = False
    slot_group: Annotated[
        str, Parameter("slots expected from ADB4 under authentication, such as 'AB'; empty: what ADB4 says")
    ] = ""
    elevation_mask_rad: Annotated[
        float, Parameter("satellites below are not used; not below the 5 degrees of the standard", "deg", 5.0, 45.0)
    ] = math.radians(5.0)
    smoothing_tau_s: Annotated[
        float,
        Parameter(
            "time constant of the carrier smoothing of GAST-C where that guides: 100, or 0 for none (comparisons); the "
            "other modes have their own",
            "s", 0.0, 1000.0,
        ),
    ] = 100.0  # fmt: skip
    settle_s: Annotated[
        float,
        Parameter("a satellite is used once its filter has run for this (docs/decisions/0002)", "s", 0.0, 3600.0),
    ] = 230.0
    inflate_unsettled: Annotated[
        bool,
        Parameter("scale airborne noise and multipath while the filter settles, and for no smoothing"),
    ] = True
    max_gap_s: Annotated[
        float,
        Parameter(
            "after a longer pause between two epochs all filters start anew; above the interval of the data",
            "s", 0.1, 120.0,
        ),
    ] = 3.5  # fmt: skip
    receiver_jerk_mps3: Annotated[
        float,
        Parameter(
            "jerk of the aircraft the slip detection allows for; the default is a normal manoeuvre",
            "m/s^3", 0.0, 100.0,
        ),
    ] = NORMAL_MANOEUVRE_JERK_MPS3  # fmt: skip
    correction_wait_s: Annotated[
        float,
        Parameter(
            "how long after its own epoch the receiver waits for corrections: observations of t use frames that begin "
            "at t - 0.5 s + this or before; 0.5 waits for the frame of its own epoch, 0 is output at once",
            "s", 0.0, 10.0,
        ),
    ] = 0.5  # fmt: skip
    correction_timeout_s: Annotated[
        float, Parameter("older corrections are not used; not above the standard's 10 s", "s", 0.0, 10.0)
    ] = 10.0
    mt1_timeout_s: Annotated[
        float,
        Parameter(
            "guidance is lost without a valid type 1 message for this long; not above the standard's 3.5 s",
            "s", 0.0, 3.5,
        ),
    ] = 3.5  # fmt: skip
    # The standard has station data sent at least every 20 frames (10 s). To forget them is our rule: what a station
    # withdraws or changes is not used for ever by an aircraft that misses the message.
    station_data_timeout_s: Annotated[
        float,
        Parameter(
            "station data and the approach are forgotten when not repeated for this long; data of another rate than "
            "2 Hz have longer frames and need more",
            "s", 10.0, 3600.0,
        ),
    ] = 60.0  # fmt: skip
    max_speed_mps: Annotated[
        float,
        Parameter(
            "speed taken for the ionospheric sigma while the own is not known; 82 m/s is 160 kt", "m/s", 0.0, 1000.0
        ),
    ] = 82.0
    speed_history_s: Annotated[
        float,
        Parameter(
            "the own speed is from positions at most this far apart; a turn hides speed over longer", "s", 0.0, 120.0
        ),
    ] = 3.5
    require_ephemeris_bound: Annotated[
        bool,
        Parameter(
            "no protection level without K_md_e (ADB1); the standard allows stations without, then it is for the "
            "operator to switch this off"
        ),
    ] = True
    use_unhealthy: Annotated[
        bool,
        Parameter(
            "positions and protection levels also from a station that says it is not healthy, for recorded data and "
            "test beds; there is never a service from it, and always an alert"
        ),
    ] = False
    range_test_sigma: Annotated[
        float,
        Parameter("a residual beyond this many sigmas, and the floor, excludes the satellite", "sigma", 1.0, 20.0),
    ] = 6.0
    range_test_floor_m: Annotated[float, Parameter("a residual below this excludes no satellite", "m", 0.0, 1000.0)] = (
        10.0
    )
    range_test_max_exclusions: Annotated[
        int, Parameter("satellites the range test may have excluded at a time; more: no position", "-", 0, 10)
    ] = 3
    range_test_hold_s: Annotated[
        float, Parameter("a satellite the range test excluded is not tried again for this long", "s", 0.0, 3600.0)
    ] = 60.0
    max_condition: Annotated[
        float, Parameter("largest condition number of the geometry that still gives a position", "-", 1.0, 1e12)
    ] = 1e4
    max_iterations: Annotated[
        int, Parameter("Gauss-Newton steps before the position counts as not found", "-", 2, 100)
    ] = 10
    protection_probability: Annotated[
        float, Parameter("probability the protection level multipliers are made from", "-", 1e-15, 1e-3)
    ] = 2.5e-8
    receiver_fault_prior: Annotated[
        float, Parameter("prior probability of a reference receiver fault", "-", 1e-12, 1.0)
    ] = 1e-5
    k_ffmd_single: Annotated[float, Parameter("K_ffmd with one reference receiver", "-", 1.0, 20.0)] = 6.86

    gast_d: ServiceDParams = ServiceDParams()

    def __post_init__(self) -> None:
        if not _distinct(self.slot_group, SLOT_NAMES):
            raise ParameterError(f"slot_group = {self.slot_group!r} is not of distinct letters A to H")
        if self.slot_group and not self.authentication:
            raise ParameterError(f"slot_group = {self.slot_group!r} is given without authentication")
        known = {mode.name for mode in modes.MODES} | {ALL_MODES}
        if unknown := [name for name in self.modes if name not in known]:
            raise ParameterError(f"modes = {unknown[0]!r} is not one of {', '.join(sorted(known))}")
        if len(self.station_id) > _MAX_STATION_ID:
            raise ParameterError(f"station_id = {self.station_id!r} has more than {_MAX_STATION_ID} characters")

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any], *, source: str = "") -> AirborneParams:
        """Make parameters from keys and values of the section ``airborne``, as a file or a node has them.

        Raises
        ------
        ParameterError
            Naming the source, what is unknown, or the value and its bound.
        """
        return from_mapping(cls, mapping, source=source, section=SECTION)

    @classmethod
    def from_yaml(cls, path: str | Path) -> AirborneParams:
        """Read parameters from a configuration file, see :func:`airborne_section`.

        Raises
        ------
        ParameterError
            Naming the file and what is wrong in it.
        """
        return cls.from_mapping(airborne_section(path), source=str(path))


def airborne_section(path: str | Path) -> dict[str, Any]:
    """Keys and values of a file, below ``airborne:`` or at its top, with or without the wrapping of ROS parameters.

    Raises
    ------
    ParameterError
        When the file cannot be read or is not of that form.
    """
    configuration = read_configuration(path)
    sections = configuration.sections()
    if SECTION in sections:
        return configuration.section(SECTION)
    return {} if configuration.origin(SECTION) else sections


def _distinct(value: str, letters: str) -> bool:
    return len(set(value)) == len(value) and not set(value) - set(letters)

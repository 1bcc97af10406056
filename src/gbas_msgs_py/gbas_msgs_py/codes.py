"""Every enumeration of the contract: numbers and words that tables, events and messages carry, and what they mean.

A number is never given a second meaning, and one that is no longer used is not given again. Readers need nothing else
to print a word: :func:`enumerations` is also what the schemas topic and every bag carry.
"""

from __future__ import annotations

from enum import IntEnum, StrEnum
from typing import Any, Final, Self

from gbas_core.gnss.ephemeris import NavigationMessage


class Code(IntEnum):
    """A number with a word and a meaning; a table carries it as a float.

    Members are declared as ``NAME = number, "meaning"``.

    Attributes
    ----------
    doc : str
        What it means.
    """

    doc: str

    def __new__(cls, number: int, doc: str = "") -> Self:
        member = int.__new__(cls, number)
        member._value_ = number
        member.doc = doc
        return member

    @property
    def word(self) -> str:
        """The code as it stands in an event."""
        return self.name.lower()


class Signal(Code):
    """What a statistic, a correction or a processing mode is of."""

    NONE = 0, "No single signal: it holds for the satellite or for all its signals."
    L1 = 1, "GPS L1 C/A, Galileo E1."
    L2 = 2, "GPS L2."
    L5 = 5, "GPS L5, Galileo E5a."
    L1_L2 = 12, "A combination of L1 and L2."
    L1_L5 = 15, "A combination of L1 and L5."


class ChannelState(Code):
    """State of a satellite at the ground station, or of one receiver's channel; only USABLE is broadcast as valid."""

    NOT_TRACKED = 0, "No measurement of it."
    SETTLING = 1, "Its filters have not run long enough."
    USABLE = 2, "It may be used."
    EXCLUDED = 3, "A monitor fails, or what is needed for its use is not there."
    RECOVERING = 4, "Excluded by a monitor that passes again: used after the re-admission time without a failure."


class MonitorState(Code):
    """What a ground monitor says of a satellite at one epoch."""

    NOT_DUE = 0, "It does not apply: the satellite is not tracked, or the station lacks what the monitor needs; no row."
    NOT_MONITORED = 1, "It applies, and could not look, or not yet: not used where the monitor is required."
    PASSED = 2, "Within its threshold."
    FAILED = 3, "Above its threshold, or a value that cannot be."


class ServiceType(Code):
    """GBAS approach service type in use; NONE means no guidance."""

    NONE = 0, "No guidance."
    C = 1, "GAST-C."
    D = 2, "GAST-D."
    L5_100 = 3, "L5/E5a smoothed over 100 s; no standard has it."
    L5_30 = 4, "L5/E5a smoothed over 30 s; no standard has it."
    IF_100 = 5, "L1/E1 and L5/E5a without ionosphere, smoothed over 100 s; no standard has it."
    IF_30 = 6, "L1/E1 and L5/E5a without ionosphere, smoothed over 30 s; no standard has it."

    @property
    def option(self) -> str:
        """The service as options and parameters name it: ``L5-30``."""
        return self.name.replace("_", "-")


class ServiceCause(Code):
    """Why a processing mode gives no service: the first condition that does not hold."""

    NONE = 0, "It gives its service."
    NO_SIGNAL = 1, "No message of a station."
    NO_STATION_DATA = 2, "No station data (type 2)."
    STATION_UNHEALTHY = 3, "The station's designator (GCID) allows no service."
    STATION_NOT_FOR_SERVICE = 4, "The station's designator (GCID) does not allow this one."
    NO_CORRECTIONS = 5, "No corrections that this mode needs."
    MT1_TIMEOUT = 6, "No valid type 1 message for too long."
    MT11_TIMEOUT = 7, "No valid type 11 message for too long."
    MESSAGE_TIMEOUT = 8, "No valid message with this mode's corrections for too long."
    NO_APPROACH_DATA = 9, "The selected approach was not received (type 4)."
    APPROACH_NOT_FOR_SERVICE = 10, "The approach is not designated for this service (APD)."
    NO_SERVICE_D_DATA = 11, "No station data of GAST-D (additional data block 3)."
    NOT_AUTHENTICATED = 12, "The station does not say which slots are its own (additional data block 4)."
    CORRECTION_AGE = 13, "The corrections are too old, or of the future."
    NO_POSITION = 14, "Too few satellites, too weak a geometry, or the range test cannot be passed."
    MODE_WITHOUT_SERVICE = 15, "The receiver is not set to this mode."
    NO_EPHEMERIS_BOUND = 16, "No K_md_e, so no bound on the ephemeris error."
    NOT_PROTECTED = 17, "A satellite used lacks something that a protection level needs."
    VPL_ABOVE_VAL = 18, "Vertical protection level above the alert limit."
    LPL_ABOVE_LAL = 19, "Lateral protection level above the alert limit."
    VEB_ABOVE_VAL = 20, "Vertical ephemeris error bound above the alert limit."
    LEB_ABOVE_LAL = 21, "Lateral ephemeris error bound above the alert limit."
    D_VERT = 22, "The 30 s and 100 s solutions differ vertically by more than they may."
    D_LAT = 23, "The 30 s and 100 s solutions differ laterally by more than they may."
    B_VERT = 24, "B values of a reference receiver add up to more vertically than they may."
    B_LAT = 25, "B values of a reference receiver add up to more laterally than they may."
    CORRECTION_SHIFT = 26, "The corrections move the position horizontally by more than they may."
    S_VERT = 27, "The position rests vertically too much on one satellite."
    S_VERT_PAIR = 28, "The position rests vertically too much on two satellites."
    S_LAT = 29, "The position rests laterally too much on one satellite."
    S_LAT_PAIR = 30, "The position rests laterally too much on two satellites."
    FINAL_SEGMENT = 31, "A better service is not taken up again inside the final segment."


class ExclusionCause(Code):
    """Why the ground station does not use something.

    Below 32: states of affairs, which end when they end. From 32 on: a monitor failed; use begins again only after the
    re-admission time without a failure.
    """

    NONE = 0, "Nothing is against its use."
    NOT_TRACKED = 1, "No reference receiver tracks the satellite."
    SETTLING = 2, "The smoothing filters have not run long enough."
    BELOW_MASK = 3, "Lower than the elevation mask."
    NO_EPHEMERIS = 4, "No settled, healthy, valid ephemeris."
    TOO_FEW_RECEIVERS = 5, "Fewer channels than the station needs behind a correction."
    TOO_FEW_COMMON_SATELLITES = 6, "Receiver clocks of the constellation cannot be removed."
    SIGMA_TOO_LARGE = 7, "The sigma does not fit in the message."
    NO_RATE = 8, "No previous epoch to form a range rate correction with."
    UNMONITORED = 9, "A required monitor cannot judge it, or not yet."
    IONOSPHERE_UNPROTECTED = (
        10,
        "No inflation of the sigmas protects against a front of the ionospheric threat model.",
    )
    # A monitor failed.
    B_VALUE = 32, "A B value above its threshold (multiple reference consistency check)."
    RECEIVER_FAULT = 33, "Several channels of one receiver failed by B values, or against their expected ranges."
    PRC_LIMIT = 34, "Pseudorange correction above its limit."
    RRC_LIMIT = 35, "Range rate correction above its limit."
    RANGE_RESIDUAL = 36, "Raw pseudorange far from the expected one."
    SIGNAL_POWER = 37, "C/N0 below the minimum, or not given."
    CODE_CARRIER_DIVERGENCE = 38, "Code and carrier drift apart on one band (GAST-D)."
    TWO_FREQUENCY_DIVERGENCE = (
        39,
        "Codes and carriers of two bands drift apart unlike the ionosphere (GAST-F).",
    )
    IONOSPHERE_GRADIENT = 40, "The ionosphere differs over the station's baselines."
    CARRIER_ACCELERATION = 41, "The carrier accelerates as no orbit and no clock in order does."
    CARRIER_RATE = 42, "The carrier's rate is not the expected one."
    CARRIER_STEP = 43, "The carrier stepped."
    EXPECTED_POWER = 44, "C/N0 below what is expected at the satellite's elevation."
    EPHEMERIS_RESIDUAL = 45, "Carriers over the baselines do not fit the broadcast orbit."
    SIGMA_MEAN = 46, "The mean of a receiver's B values over time does not fit the broadcast sigma."
    SIGMA_SPREAD = 47, "The spread of B values over time does not fit the broadcast sigma."
    COMMON_SLIP = 48, "Several receivers lost count of the carrier at one epoch."
    RECEIVER_BASELINES = (
        49,
        "Carriers do not fit, on several satellites, over the baselines of this receiver alone.",
    )
    FURTHER_MONITOR = 50, "A monitor failed that has no cause of its own: the monitors table says which."


FIRST_LATCHED: Final = 32
"""From this number on a cause is a monitor's failure."""


class Rejection(Code):
    """Why the aircraft does not use a satellite, in the order of the rules; the first that holds is the reason."""

    NONE = 0, "It is used."
    NOT_TRACKED = 1, "No smoothed range."
    NO_STATION = 2, "Something is wrong with the station itself: none received, no corrections, or unhealthy."
    SYSTEM = 3, "Its constellation is not used."
    NO_CORRECTION = 4, "The station sends no correction of it."
    CORRECTION_INVALID = 5, "The station marks the correction as invalid."
    CORRECTION_AGE = 6, "The correction is too old, or of the future."
    B_VALUES = 7, "The B values do not support a protection level."
    EPHEMERIS_IOD = 8, "No ephemeris of the correction's issue of data."
    EPHEMERIS_CRC_MISSING = 9, "The station has not sent the ephemeris CRC of this issue of data yet."
    EPHEMERIS_CRC_MISMATCH = 10, "The ephemeris is not the one the station uses."
    NOT_SETTLED = 11, "The smoothing filter has not run long enough."
    DISTANCE = 12, "The aircraft is beyond the station's distance of use."
    ELEVATION = 13, "Lower than the elevation mask."
    SIGMA = 14, "Its error model gives no number."
    RANGE_TEST = 15, "The range is far from where the other satellites put the aircraft."
    DIVERGENCE = 16, "Code and carrier drift apart at the aircraft."
    STEP_IN = 17, "It is too new for this mode."
    DUAL_SOLUTION = 18, "Without it the 30 s and 100 s solutions agree."
    RECEIVER_FAULT = 19, "Without it the B values of a reference receiver are as small as they have to be."


class ApproachState(Code):
    """Where the airborne receiver is between silence and guidance."""

    NO_SIGNAL = 0, "No valid message of the station."
    VDB_ACQUIRED = (
        1,
        "Messages arrive, but not all that are needed (types 1, 2 and 4), or it is not healthy.",
    )
    DATA_VALID = 2, "All messages are there; no protected position yet."
    DIFFERENTIAL = 3, "Protected position, not on an approach: none selected, outside its volume, or limits exceeded."
    APPROACH = 4, "Within the service volume of the selected approach, protection levels within the alert limits."
    LOSS = 5, "Service was given and is lost."


class EventKind(StrEnum):
    """What sort of thing happened; members are declared as ``NAME = "word", "meaning"``."""

    doc: str

    def __new__(cls, word: str, doc: str = "") -> Self:
        member = str.__new__(cls, word)
        member._value_ = word
        member.doc = doc
        return member

    EXCLUSION = "exclusion", "A channel, satellite or receiver was taken out of use."
    READMISSION = "readmission", "It was taken back into use."
    ALERT = "alert", "Navigation must not be trusted from here on, or may be again (value 0)."
    SERVICE = "service", "The approach service type in use changed."
    STATION = "station", "The ground station changed what it broadcasts."
    INPUT = "input", "A message, stream or file did not come, came late, or could not be used."
    FINISHED = "finished", "A driver has sent its last epoch and every reader has finished with it."


ENUMERATIONS: Final = (
    Signal,
    ChannelState,
    MonitorState,
    ServiceType,
    ServiceCause,
    ExclusionCause,
    Rejection,
    ApproachState,
    EventKind,
    NavigationMessage,
)


def enumerations() -> dict[str, list[dict[str, Any]]]:
    """All enumerations as JSON-able data, by their names."""
    return {
        kind.__name__: [
            {"value": member.value, "name": member.name.lower(), "doc": getattr(member, "doc", "")} for member in kind
        ]
        for kind in ENUMERATIONS
    }

"""Why the ground station does not use something."""

from __future__ import annotations

from enum import IntEnum
from typing import Final


class ExclusionCause(IntEnum):
    """Cause of an exclusion, as carried in the integrity table; numbers are never given a second meaning.

    Below 32: states of affairs, which end when they end. From 32 on: a monitor failed; use begins again only after the
    re-admission time without a failure.
    """

    NONE = 0
    NOT_TRACKED = 1
    """No reference receiver tracks the satellite."""
    SETTLING = 2
    """The smoothing filters have not run long enough."""
    BELOW_MASK = 3
    """Lower than the elevation mask."""
    NO_EPHEMERIS = 4
    """No settled, healthy, valid ephemeris."""
    TOO_FEW_RECEIVERS = 5
    """Fewer channels than the station needs behind a correction."""
    TOO_FEW_COMMON_SATELLITES = 6
    """Receiver clocks of the constellation cannot be removed."""
    SIGMA_TOO_LARGE = 7
    """The sigma does not fit in the message."""
    NO_RATE = 8
    """No previous epoch to form a range rate correction with."""
    UNMONITORED = 9
    """A required monitor cannot judge it, or not yet."""
    IONOSPHERE_UNPROTECTED = 10
    """No inflation of the sigmas protects its users against an ionospheric front of the threat model."""
    B_VALUE = 32
    """A B value above its threshold (multiple reference consistency check)."""
    RECEIVER_FAULT = 33
    """Several channels of one receiver failed by B values, or against their expected ranges."""
    PRC_LIMIT = 34
    """Pseudorange correction above its limit."""
    RRC_LIMIT = 35
    """Range rate correction above its limit."""
    RANGE_RESIDUAL = 36
    """Raw pseudorange far from the expected one."""
    SIGNAL_POWER = 37
    """C/N0 below the minimum, or not given."""

    CODE_CARRIER_DIVERGENCE = 38
    """Code and carrier drift apart on one band (GAST-D monitor)."""
    TWO_FREQUENCY_DIVERGENCE = 39
    """Codes and carriers of two bands drift apart in a way the ionosphere does not (GAST-F monitor)."""
    IONOSPHERE_GRADIENT = 40
    """The ionosphere differs over the station's baselines."""
    CARRIER_ACCELERATION = 41
    """The carrier accelerates as no orbit and no clock in order does."""
    CARRIER_RATE = 42
    """The carrier's rate is not the expected one."""
    CARRIER_STEP = 43
    """The carrier stepped."""
    EXPECTED_POWER = 44
    """C/N0 below what is expected at the satellite's elevation."""
    EPHEMERIS_RESIDUAL = 45
    """Carriers over the baselines do not fit the broadcast orbit."""
    SIGMA_MEAN = 46
    """The mean of a receiver's B values over time does not fit the broadcast sigma."""
    SIGMA_SPREAD = 47
    """The spread of B values over time does not fit the broadcast sigma."""

    COMMON_SLIP = 48
    """Several receivers lost count of the carrier at one epoch."""
    RECEIVER_BASELINES = 49
    """Carriers over the baselines of one receiver do not fit, on several satellites, and over the others they do."""

    @property
    def word(self) -> str:
        """The cause as it stands in an event."""
        return self.name.lower()


FIRST_LATCHED: Final = 32


SATELLITE_MONITORS: Final[dict[str, tuple[str, ...]]] = {
    ExclusionCause.CODE_CARRIER_DIVERGENCE.word: ("ccd",),
    ExclusionCause.TWO_FREQUENCY_DIVERGENCE.word: ("ccd_f", "ccd_f_paper"),
    ExclusionCause.IONOSPHERE_GRADIENT.word: ("gradient",),
    ExclusionCause.CARRIER_ACCELERATION.word: ("acceleration",),
    ExclusionCause.CARRIER_RATE.word: ("carrier_rate",),
    ExclusionCause.CARRIER_STEP.word: ("carrier_step",),
    ExclusionCause.COMMON_SLIP.word: ("common_slip",),
    ExclusionCause.EPHEMERIS_RESIDUAL.word: ("ephemeris",),
    ExclusionCause.EXPECTED_POWER.word: ("expected_power",),
}
"""Monitors that exclude a satellite, by the word of the cause: their statistic stands in the monitors table."""

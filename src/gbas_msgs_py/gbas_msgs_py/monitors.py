"""The monitors of the ground station: one table of their numbers, names, tests and causes.

Every place that names a monitor uses these names: its module, its section in a station's file, the monitors table,
events and documentation. Numbers stand in bags and are never given a second meaning.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Literal

from gbas_msgs_py.codes import ExclusionCause

Judged = Literal["satellite", "channel"]
TestKey = tuple[int, int]
"""Numbers of a monitor and of one of its tests."""


@dataclass(frozen=True, kw_only=True)
class MonitorTest:
    """One statistic of a monitor, compared with one threshold.

    Attributes
    ----------
    number : int
        Within the monitor, from 1.
    name : str
    cause : ExclusionCause
        Of an exclusion by this test.
    unit : str
        Of statistic and threshold.
    doc : str
        What the statistic is.
    """

    number: int
    name: str
    cause: ExclusionCause
    unit: str
    doc: str


@dataclass(frozen=True, kw_only=True)
class Monitor:
    """A monitor of the ground station.

    Attributes
    ----------
    number : int
    name : str
    judges : tuple of {"satellite", "channel"}
        What is excluded when it fails.
    tests : tuple of MonitorTest
    doc : str
        What it looks for.
    traced : bool
        Whether value and threshold of a satellite's exclusion stand in the table of the same epoch; not where what is
        left is formed and judged again without it.
    """

    number: int
    name: str
    judges: tuple[Judged, ...]
    tests: tuple[MonitorTest, ...]
    doc: str
    traced: bool = True

    @property
    def causes(self) -> tuple[ExclusionCause, ...]:
        """Causes of the exclusions it makes, each once."""
        return tuple(dict.fromkeys(test.cause for test in self.tests))

    def test(self, name: str) -> MonitorTest:
        """One of its tests.

        Raises
        ------
        KeyError
            When it has none of that name.
        """
        for test in self.tests:
            if test.name == name:
                return test
        raise KeyError(f"monitor {self.name} has no test {name!r}, only {', '.join(test.name for test in self.tests)}")

    def key(self, name: str) -> TestKey:
        """Numbers that stand in the table for one of its tests."""
        return self.number, self.test(name).number


EXPECTED_RANGE: Final = Monitor(
    number=1,
    name="expected_range",
    judges=("channel",),
    tests=(
        MonitorTest(
            number=1,
            name="residual",
            cause=ExclusionCause.RANGE_RESIDUAL,
            unit="m",
            doc="size of raw pseudorange less the expected one, less the median of the receiver's constellation",
        ),
    ),
    doc="pseudoranges far from what orbit and clock make expected",
)
SIGNAL_POWER: Final = Monitor(
    number=2,
    name="signal_power",
    judges=("channel",),
    tests=(
        MonitorTest(
            number=1,
            name="cn0",
            cause=ExclusionCause.SIGNAL_POWER,
            unit="dB-Hz",
            doc="minus C/N0 of the weakest channel; the threshold is minus the least",
        ),
    ),
    doc="signals too weak to be used, or without C/N0",
)
EXPECTED_POWER: Final = Monitor(
    number=3,
    name="expected_power",
    judges=("satellite", "channel"),
    tests=(
        MonitorTest(
            number=1,
            name="satellite",
            cause=ExclusionCause.EXPECTED_POWER,
            unit="dB-Hz",
            doc="minus C/N0, mean over time and receivers; the threshold is minus the least at the elevation",
        ),
    ),
    doc="signals weaker than receiver and elevation make expected",
)
CCD: Final = Monitor(
    number=4,
    name="ccd",
    judges=("satellite",),
    tests=(
        MonitorTest(
            number=1,
            name="rate",
            cause=ExclusionCause.CODE_CARRIER_DIVERGENCE,
            unit="m/s",
            doc="size of the filtered rate of code less carrier on L1, mean over the receivers",
        ),
    ),
    doc="divergence of code and carrier on one band (GAST-D)",
)
CCD_F: Final = Monitor(
    number=5,
    name="ccd_f",
    judges=("satellite",),
    tests=(
        MonitorTest(
            number=1,
            name="full_rank",
            cause=ExclusionCause.TWO_FREQUENCY_DIVERGENCE,
            unit="-",
            doc="chi-square of the three independent rates of two bands",
        ),
        MonitorTest(
            number=2,
            name="published",
            cause=ExclusionCause.TWO_FREQUENCY_DIVERGENCE,
            unit="-",
            doc="chi-square of the four published rates with the printed covariance",
        ),
    ),
    doc="divergence of codes and carriers of two bands that no ionosphere makes (proposed for GAST-F)",
)
CARRIER_ACCELERATION: Final = Monitor(
    number=6,
    name="carrier_acceleration",
    judges=("satellite", "channel"),
    tests=(
        MonitorTest(
            number=1,
            name="acceleration",
            cause=ExclusionCause.CARRIER_ACCELERATION,
            unit="m/s2",
            doc="size of the second derivative of the carrier over some seconds",
        ),
        MonitorTest(
            number=2,
            name="rate",
            cause=ExclusionCause.CARRIER_RATE,
            unit="m/s",
            doc="size of the slope of the carrier over some seconds",
        ),
        MonitorTest(
            number=3,
            name="step",
            cause=ExclusionCause.CARRIER_STEP,
            unit="m",
            doc="newest carrier against the line through those before",
        ),
    ),
    doc="carriers that step, ramp or accelerate as no orbit and no clock in order does",
)
IONOSPHERE_GRADIENT: Final = Monitor(
    number=7,
    name="ionosphere_gradient",
    judges=("satellite",),
    tests=(
        MonitorTest(
            number=1,
            name="gradient",
            cause=ExclusionCause.IONOSPHERE_GRADIENT,
            unit="m",
            doc="size of the double-difference carrier to the nearest wavelength, of the baseline and band that decide",
        ),
    ),
    doc="ionosphere that differs over the station's baselines",
)
EPHEMERIS_RESIDUAL: Final = Monitor(
    number=8,
    name="ephemeris_residual",
    judges=("satellite",),
    tests=(
        MonitorTest(
            number=1,
            name="residual",
            cause=ExclusionCause.EPHEMERIS_RESIDUAL,
            unit="m",
            doc="size of the double-difference carrier followed over time, of the baseline and band that decide",
        ),
    ),
    doc="carriers over the baselines that do not fit the broadcast orbit",
)
COMMON_SLIP: Final = Monitor(
    number=9,
    name="common_slip",
    judges=("satellite",),
    tests=(
        MonitorTest(
            number=1,
            name="slips",
            cause=ExclusionCause.COMMON_SLIP,
            unit="-",
            doc="receivers that lost count of the carrier at this epoch",
        ),
    ),
    doc="carriers that several receivers lose at one epoch",
)
B_VALUE: Final = Monitor(
    number=10,
    name="b_value",
    judges=("satellite", "channel"),
    tests=(
        MonitorTest(
            number=1,
            name="b",
            cause=ExclusionCause.B_VALUE,
            unit="m",
            doc="size of the B value that is worst against its threshold",
        ),
    ),
    doc="reference receivers that disagree (multiple reference consistency check)",
    traced=False,
)
CORRECTION_LIMITS: Final = Monitor(
    number=11,
    name="correction_limits",
    judges=("satellite",),
    tests=(
        MonitorTest(number=1, name="prc", cause=ExclusionCause.PRC_LIMIT, unit="m", doc="size of the correction"),
        MonitorTest(number=2, name="rrc", cause=ExclusionCause.RRC_LIMIT, unit="m/s", doc="size of its rate"),
    ),
    doc="corrections larger than a correction may be",
    traced=False,
)
SIGMA_MONITOR: Final = Monitor(
    number=12,
    name="sigma_monitor",
    judges=("channel",),
    tests=(
        MonitorTest(
            number=1,
            name="mean",
            cause=ExclusionCause.SIGMA_MEAN,
            unit="-",
            doc="size of the mean of the B values over their sigma, over minutes and hours",
        ),
        MonitorTest(
            number=2,
            name="spread",
            cause=ExclusionCause.SIGMA_SPREAD,
            unit="-",
            doc="mean square of the B values over their sigma, over minutes and hours",
        ),
    ),
    doc="B values that do not fit the broadcast sigma over time",
)

MONITORS: Final[tuple[Monitor, ...]] = (
    EXPECTED_RANGE,
    SIGNAL_POWER,
    COMMON_SLIP,
    CCD,
    CCD_F,
    CARRIER_ACCELERATION,
    IONOSPHERE_GRADIENT,
    EPHEMERIS_RESIDUAL,
    EXPECTED_POWER,
    B_VALUE,
    CORRECTION_LIMITS,
    SIGMA_MONITOR,
)
"""In the order in which the station runs them."""
TESTS: Final[dict[TestKey, tuple[Monitor, MonitorTest]]] = {
    (monitor.number, test.number): (monitor, test) for monitor in MONITORS for test in monitor.tests
}
"""Every test by its numbers, in the order of the tables."""


def monitor_named(name: str) -> Monitor:
    """The monitor of a name.

    Raises
    ------
    KeyError
        When there is none.
    """
    for monitor in MONITORS:
        if monitor.name == name:
            return monitor
    raise KeyError(f"there is no monitor {name!r}, only {', '.join(monitor.name for monitor in MONITORS)}")


def traced_causes() -> frozenset[str]:
    """Words of the causes whose exclusions of satellites have their values in the table of their epoch."""
    return frozenset(
        cause.word
        for monitor in MONITORS
        if monitor.traced and "satellite" in monitor.judges
        for cause in monitor.causes
    )


def monitor_dictionary() -> list[dict[str, Any]]:
    """The monitors as JSON-able data."""
    return [
        {
            "number": monitor.number,
            "name": monitor.name,
            "judges": list(monitor.judges),
            "doc": monitor.doc,
            "tests": [
                {
                    "number": test.number,
                    "name": test.name,
                    "cause": test.cause.word,
                    "unit": test.unit,
                    "doc": test.doc,
                }
                for test in monitor.tests
            ],
        }
        for monitor in MONITORS
    ]

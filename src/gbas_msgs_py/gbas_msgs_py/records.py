"""The records that pass between nodes beside observations and ephemerides: each is declared here once.

Satellite states and service types are small integers carried as floats (a table is all float64).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np

from gbas_core.record import FloatArray, Record, columns_of, per_row, per_satellite, scalar
from gbas_core.satellites import N_SATS, RANGING_SOURCE_ID, SAT_IDS, SAT_INDEX, SOURCE_ID_INDEX
from gbas_msgs_py.codes import MonitorState, ServiceCause, ServiceType, Signal
from gbas_msgs_py.modes import MODES
from gbas_msgs_py.monitors import MONITORS, TESTS, monitor_named
from gbas_msgs_py.products import PRODUCTS

MAX_REFERENCE_RECEIVERS = 4
_RECEIVERS = range(1, MAX_REFERENCE_RECEIVERS + 1)
BASELINES = tuple((i, j) for i in _RECEIVERS for j in _RECEIVERS if i < j)
"""Pairs of reference receivers, in the order in which tables have them."""


def by_product(columns: str, unit: str, doc: str) -> Any:
    """Declare a field ``(product, satellite)``; `columns` is the pattern of the columns' names."""
    names = tuple(columns.format(product=product.name) for product in PRODUCTS)
    optional = tuple(columns.format(product=product.name) for product in PRODUCTS if product.optional)
    return per_satellite(unit, doc, columns=names, optional=optional)


def by_receiver(columns: str, unit: str, doc: str) -> Any:
    """Declare a field ``(product, reference receiver, satellite)``; `columns` is the pattern of the columns' names."""
    every = [(product, columns.format(product=product.name, receiver=j)) for product in PRODUCTS for j in _RECEIVERS]
    names = tuple(name for _, name in every)
    optional = tuple(name for product, name in every if product.optional)
    leading = (len(PRODUCTS), MAX_REFERENCE_RECEIVERS)
    return per_satellite(unit, doc, columns=names, leading=leading, optional=optional)


@dataclass(frozen=True, kw_only=True, eq=False)
class IntegrityEpoch(Record):
    """Ground corrections of one epoch after monitoring: what may be broadcast, and why the rest may not.

    Corrections are NaN unless `state` is USABLE. Fields of corrections have the products of
    :data:`~gbas_msgs_py.products.PRODUCTS` as their first axis; those that a station does not make are NaN. Those of
    a second frequency may be missing of a satellite that is USABLE; they are there or not as a whole.
    """

    n_receivers: float = scalar("-", "reference receivers in use")
    sigma_vert_iono_gradient: float = scalar("m/m", "sigma_vig as broadcast in the type 2 message")
    state: FloatArray = per_satellite("-", "ChannelState")
    cause: FloatArray = per_satellite("-", "ExclusionCause, 0 when none")
    elevation_rad: FloatArray = per_satellite("rad", "elevation at the reference point")
    p_ephemeris: FloatArray = by_product("p_ephemeris_{product}", "m/m", "ephemeris decorrelation parameter")
    iod: FloatArray = per_satellite("-", "issue of data of the ephemeris used")
    ephemeris_crc: FloatArray = per_satellite("-", "16-bit ephemeris CRC")
    prc_m: FloatArray = by_product("prc_{product}_m", "m", "pseudorange correction")
    rrc_mps: FloatArray = by_product("rrc_{product}_mps", "m/s", "range rate correction")
    sigma_pr_gnd_m: FloatArray = by_product("sigma_pr_gnd_{product}_m", "m", "broadcast sigma of the correction")
    sigma_pr_gnd_d_m: FloatArray = per_satellite("m", "sigma of the L1 100 s correction without ionospheric inflation")
    b_m: FloatArray = by_receiver(
        "b{receiver}_{product}_m", "m", "B value of a reference receiver, NaN where it was not used"
    )
    receiver_used: FloatArray = by_receiver(
        "rr{receiver}_{product}_used", "-", "1 where the receiver's channel was used"
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class ChannelEpoch(Record):
    """The ground station's executive at one epoch: state, cause and its duration of satellites and their channels.

    A row for every satellite that is tracked, in view or excluded. Channels of an excluded receiver carry its cause.
    """

    state: FloatArray = per_satellite("-", "ChannelState of the satellite")
    cause: FloatArray = per_satellite("-", "ExclusionCause of the satellite, 0 when none")
    since_s: FloatArray = per_satellite("s", "time in this state with this cause")
    channel_state: FloatArray = per_satellite("-", "ChannelState", columns=tuple(f"rr{j}_state" for j in _RECEIVERS))
    channel_cause: FloatArray = per_satellite("-", "ExclusionCause", columns=tuple(f"rr{j}_cause" for j in _RECEIVERS))
    channel_since_s: FloatArray = per_satellite(
        "s", "time in this state with this cause", columns=tuple(f"rr{j}_since_s" for j in _RECEIVERS)
    )


class MonitorRow(NamedTuple):
    """One row of the monitors table in words."""

    monitor: str
    test: str
    sat: str
    signal: Signal
    statistic: float
    threshold: float
    state: MonitorState


# Whether a monitor has a test, by the number of the one times this and the number of the other.
_TEST_BASE: Final = 1 + max(number for _, number in TESTS)
_IS_TEST: Final = np.isin(
    np.arange(_TEST_BASE * (1 + max(number for number, _ in TESTS))), [_TEST_BASE * key[0] + key[1] for key in TESTS]
)


@dataclass(frozen=True, kw_only=True, eq=False)
class MonitorEpoch(Record):
    """What the ground monitors said at one epoch: a row for each test, satellite and signal that was due.

    Where a test has several values of a satellite (receivers, baselines, smoothing constants, bands), its row is the
    one that is worst against its threshold.
    """

    monitor: FloatArray = per_row(
        "-", "number of the monitor", key=True, codes=(monitor.number for monitor in MONITORS)
    )
    test: FloatArray = per_row("-", "number of its test", key=True, codes=(number for _, number in TESTS))
    sat: FloatArray = per_row("-", "ranging source identifier", key=True, codes=RANGING_SOURCE_ID.tolist())
    signal: FloatArray = per_row("-", "Signal; 0 when it is of no single one", key=True, codes=Signal)
    statistic: FloatArray = per_row("*", "statistic, in the unit of the test; NaN when there was none")
    threshold: FloatArray = per_row("*", "threshold of the statistic")
    state: FloatArray = per_row(
        "-", "MonitorState", codes=(state for state in MonitorState if state is not MonitorState.NOT_DUE)
    )

    def check(self) -> None:
        """Refuse a test that its monitor does not have."""
        numbers = self.monitor * _TEST_BASE + self.test
        if not _IS_TEST[numbers.astype(np.int64)].all():
            unknown = set(zip(self.monitor.tolist(), self.test.tolist(), strict=True)).difference(TESTS)
            raise ValueError("monitor {:g} has no test {:g}".format(*min(unknown)))

    def __len__(self) -> int:
        return len(self.monitor)

    def select(self, *, monitor: str = "", test: str = "", sat: str = "") -> MonitorEpoch:
        """The rows of a monitor, of one of its tests, of a satellite (``"G05"``), or of all that are given.

        Raises
        ------
        KeyError
            When there is no such monitor, test or satellite.
        """
        rows = np.ones(len(self), dtype=bool)
        if monitor:
            entry = monitor_named(monitor)
            rows &= self.monitor == entry.number
            if test:
                rows &= self.test == entry.test(test).number
        elif test:
            raise KeyError(f"test {test!r} of which monitor?")
        if sat:
            rows &= self.sat == RANGING_SOURCE_ID[SAT_INDEX[sat]]
        return replace(self, **{item.name: getattr(self, item.name)[rows] for item, _ in columns_of(MonitorEpoch)})

    def states(self, monitor: str, test: str = "") -> FloatArray:
        """MonitorState by satellite, ``(N,)``: NOT_DUE without a row, the largest number of several rows."""
        chosen, states = self.select(monitor=monitor, test=test), np.full(N_SATS, float(MonitorState.NOT_DUE))
        index = [SOURCE_ID_INDEX[int(sat)] for sat in chosen.sat.tolist()]
        np.maximum.at(states, index, chosen.state)
        return states

    def rows(self) -> Iterator[MonitorRow]:
        """The rows in words."""
        columns = (self.monitor, self.test, self.sat, self.signal, self.statistic, self.threshold, self.state)
        for number, test_number, sat, signal, statistic, threshold, state in zip(
            *(column.tolist() for column in columns), strict=True
        ):
            monitor, test = TESTS[number, test_number]
            yield MonitorRow(
                monitor.name,
                test.name,
                SAT_IDS[int(SOURCE_ID_INDEX[int(sat)])],
                Signal(int(signal)),
                statistic,
                threshold,
                MonitorState(int(state)),
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class MonitorDetailEpoch(Record):
    """What is behind the ground monitors' statistics: the vectors by receiver, combination and baseline."""

    ccd_receiver_mps: FloatArray = per_satellite(
        "m/s", "divergence rate of one receiver, L1", columns=tuple(f"rr{j}_ccd_mps" for j in _RECEIVERS)
    )
    divergence_mps: FloatArray = per_satellite(
        "m/s",
        "filtered rate of a two-band combination, averaged over the receivers",
        columns=("df_mps", "df_other_mps", "if_code_mps", "if_carrier_mps"),
    )
    ccd_f_mode: FloatArray = per_satellite("-", "likeliest of the 15 divergence modes, 1 to 15; 0 is no fault")
    ccd_f_mode_probability: FloatArray = per_satellite("-", "of that mode")
    gradient: FloatArray = per_satellite("m/m", "smallest gradient along the runway that explains the carriers")
    gradient_coverage: FloatArray = per_satellite("-", "share of the gradients to be detected that are detectable")
    double_difference_m: FloatArray = per_satellite(
        "m", "double-difference carrier of a baseline on L1", columns=tuple(f"dd{i}{j}_m" for i, j in BASELINES)
    )
    double_difference_l5_m: FloatArray = per_satellite(
        "m", "double-difference carrier of a baseline on L5", columns=tuple(f"dd{i}{j}_l5_m" for i, j in BASELINES)
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class SolutionEpoch(Record):
    """Airborne position of one epoch and all a protection level needs; per-satellite rows are the satellites used.

    Without a valid position the scalars are NaN and no satellite has a row. The lateral direction is to the left of
    the final course; without a FAS it is to the left of north (west).
    """

    mode: float = scalar("-", "number of the processing mode, of MODES")
    x_m: float = scalar("m", "ECEF position")
    y_m: float = scalar("m", "ECEF position")
    z_m: float = scalar("m", "ECEF position")
    clock_m: float = scalar("m", "receiver clock against the corrections, GPS")
    n_sats: float = scalar("-", "satellites used")
    n_receivers: float = scalar("-", "M: the largest number of reference receivers behind a used correction")
    correction_age_s: float = scalar("s", "epoch less modified Z-count time of the corrections")
    message_age_s: float = scalar("s", "time since the last valid type 1 message")
    gcid: float = scalar("-", "GBAS continuity/integrity designator, NaN before a type 2 message")
    k_md_e: float = scalar("-", "ephemeris missed detection multiplier, NaN where not provided")
    distance_to_ltp_m: float = scalar("m", "horizontal distance to the LTP along the final course, NaN without FAS")
    height_above_ltp_m: float = scalar("m", "height above the LTP, NaN without FAS")
    lateral_m: float = scalar("m", "lateral deviation, positive to the left of course, NaN without FAS")
    vertical_m: float = scalar("m", "vertical deviation from the path, positive above, NaN without FAS")
    lateral_ddm: float = scalar("DDM", "ILS-like lateral deviation, full scale 0.155")
    vertical_ddm: float = scalar("DDM", "ILS-like vertical deviation, full scale 0.175")
    fasval_m: float = scalar("m", "FAS vertical alert limit, NaN without FAS or vertical guidance")
    faslal_m: float = scalar("m", "FAS lateral alert limit, NaN without FAS")
    apd: float = scalar("-", "approach performance designator, NaN without FAS")
    d_vert_m: float = scalar("m", "|30 s less 100 s| vertical position, 0 for GAST-C")
    d_lat_m: float = scalar("m", "|30 s less 100 s| lateral position, 0 for GAST-C")
    elevation_rad: FloatArray = per_satellite("rad", "elevation at the aircraft")
    azimuth_rad: FloatArray = per_satellite("rad", "azimuth at the aircraft, clockwise from north")
    s_vert: FloatArray = per_satellite("-", "projection of a range error on the vertical error (with the path angle)")
    s_lat: FloatArray = per_satellite("-", "projection of a range error on the lateral error")
    sigma_gnd_m: FloatArray = per_satellite("m", "ground sigma for the protection level")
    sigma_air_m: FloatArray = per_satellite("m", "airborne noise and multipath")
    sigma_tropo_m: FloatArray = per_satellite("m", "residual troposphere")
    sigma_iono_m: FloatArray = per_satellite("m", "residual ionosphere")
    b_m: FloatArray = per_satellite(
        "m", "B value as broadcast, NaN where not used", columns=tuple(f"b{j}_m" for j in _RECEIVERS)
    )
    ephemeris_error_m: FloatArray = per_satellite("m", "x_air times P: ephemeris decorrelation")
    residual_m: FloatArray = per_satellite("m", "corrected pseudorange less its estimate")


@dataclass(frozen=True, kw_only=True, eq=False)
class ProtectionEpoch(Record):
    """Protection levels, alert limits and the service of one airborne epoch."""

    mode: float = scalar("-", "number of the processing mode of the solution, of MODES")
    service: float = scalar("-", "ServiceType in use")
    alert: float = scalar("-", "1 when navigation must not be trusted, 0 when it may")
    vpl_m: float = scalar("m", "vertical protection level")
    lpl_m: float = scalar("m", "lateral protection level")
    vpl_h0_m: float = scalar("m", "fault-free part")
    lpl_h0_m: float = scalar("m", "fault-free part")
    vpl_h1_m: float = scalar("m", "single reference receiver fault part, NaN with one receiver")
    lpl_h1_m: float = scalar("m", "single reference receiver fault part, NaN with one receiver")
    veb_m: float = scalar("m", "vertical ephemeris error bound, NaN where not provided")
    leb_m: float = scalar("m", "lateral ephemeris error bound, NaN where not provided")
    val_m: float = scalar("m", "vertical alert limit, NaN without a FAS")
    lal_m: float = scalar("m", "lateral alert limit, NaN without a FAS")
    state: float = scalar("-", "ApproachState")


@dataclass(frozen=True, kw_only=True, eq=False)
class ModesEpoch(Record):
    """All processing modes of one airborne epoch beside one another: a row for each mode that runs."""

    mode: FloatArray = per_row("-", "number of the mode", key=True, codes=(mode.number for mode in MODES))
    guides: FloatArray = per_row("-", "1 for the mode whose solution is that of the aircraft", codes=(0, 1))
    service: FloatArray = per_row("-", "ServiceType the mode could give, 0 when none", codes=ServiceType)
    cause: FloatArray = per_row("-", "ServiceCause: why it could not", codes=ServiceCause)
    value: FloatArray = per_row("*", "what did not hold, in the unit of the cause; NaN where it has none")
    threshold: FloatArray = per_row("*", "its bound")
    x_m: FloatArray = per_row("m", "ECEF position")
    y_m: FloatArray = per_row("m", "ECEF position")
    z_m: FloatArray = per_row("m", "ECEF position")
    n_sats: FloatArray = per_row("-", "satellites used")
    vpl_m: FloatArray = per_row("m", "vertical protection level")
    lpl_m: FloatArray = per_row("m", "lateral protection level")
    veb_m: FloatArray = per_row("m", "vertical ephemeris error bound, NaN where not provided")
    leb_m: FloatArray = per_row("m", "lateral ephemeris error bound, NaN where not provided")
    val_m: FloatArray = per_row("m", "vertical alert limit, NaN without a FAS")
    lal_m: FloatArray = per_row("m", "lateral alert limit, NaN without a FAS")
    d_vert_m: FloatArray = per_row("m", "|30 s less 100 s| vertical position, 0 for modes without")
    d_lat_m: FloatArray = per_row("m", "|30 s less 100 s| lateral position, 0 for modes without")

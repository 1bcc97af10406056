"""The records that pass between nodes beside observations and ephemerides: each is declared here once.

Satellite states and service types are small integers carried as floats (a table is all float64).
"""

from __future__ import annotations

from dataclasses import dataclass

from gbas_core.record import FloatArray, Record, per_satellite, scalar

MAX_REFERENCE_RECEIVERS = 4
_RECEIVERS = range(1, MAX_REFERENCE_RECEIVERS + 1)
BASELINES = tuple((i, j) for i in _RECEIVERS for j in _RECEIVERS if i < j)
"""Pairs of reference receivers, in the order in which tables have them."""
GROUND_MONITORS = (
    "range",
    "power",
    "expected_power",
    "ccd",
    "ccd_f",
    "ccd_f_paper",
    "gradient",
    "acceleration",
    "carrier_rate",
    "carrier_step",
    "common_slip",
    "ephemeris",
    "b_value",
    "prc",
    "rrc",
    "sigma_mean",
    "sigma_spread",
)
"""Monitors of the ground station, in the order in which tables have them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class IntegrityEpoch(Record):
    """Ground corrections of one epoch after monitoring: what may be broadcast, and why the rest may not.

    Corrections are NaN unless `state` is USABLE.
    """

    n_receivers: float = scalar("-", "reference receivers in use")
    sigma_vert_iono_gradient: float = scalar("m/m", "sigma_vig as broadcast in the type 2 message")
    state: FloatArray = per_satellite("-", "ChannelState")
    cause: FloatArray = per_satellite("-", "ExclusionCause, 0 when none")
    elevation_rad: FloatArray = per_satellite("rad", "elevation at the reference point")
    p_ephemeris: FloatArray = per_satellite("m/m", "ephemeris decorrelation parameter of the 100 s correction")
    p_ephemeris_d: FloatArray = per_satellite("m/m", "the same of the 30 s correction")
    iod: FloatArray = per_satellite("-", "issue of data of the ephemeris used")
    ephemeris_crc: FloatArray = per_satellite("-", "16-bit ephemeris CRC")
    prc_100_m: FloatArray = per_satellite("m", "pseudorange correction, 100 s smoothing")
    rrc_100_mps: FloatArray = per_satellite("m/s", "range rate correction, 100 s smoothing")
    prc_30_m: FloatArray = per_satellite("m", "pseudorange correction, 30 s smoothing")
    rrc_30_mps: FloatArray = per_satellite("m/s", "range rate correction, 30 s smoothing")
    sigma_pr_gnd_m: FloatArray = per_satellite("m", "broadcast sigma of the 100 s correction")
    sigma_pr_gnd_d_m: FloatArray = per_satellite("m", "sigma of the 100 s correction without ionospheric inflation")
    sigma_pr_gnd_30_m: FloatArray = per_satellite("m", "sigma of the 30 s correction")
    b_m: FloatArray = per_satellite(
        "m", "B value of a reference receiver, NaN where it was not used", columns=tuple(f"b{j}_m" for j in _RECEIVERS)
    )
    receiver_used: FloatArray = per_satellite(
        "-", "1 where the receiver's channel was used", columns=tuple(f"rr{j}_used" for j in _RECEIVERS)
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


@dataclass(frozen=True, kw_only=True, eq=False)
class MonitorEpoch(Record):
    """What every ground monitor measured at one epoch: statistic, threshold and state by satellite, and what is behind.

    Where a monitor tests several values of a satellite (receivers, baselines, smoothing constants), its statistic is
    the one that is worst against its threshold. Statistics and thresholds have the unit of the monitor's documentation.
    """

    statistic: FloatArray = per_satellite(
        "*", "statistic", columns=tuple(f"{name}_statistic" for name in GROUND_MONITORS)
    )
    threshold: FloatArray = per_satellite(
        "*", "threshold of the statistic", columns=tuple(f"{name}_threshold" for name in GROUND_MONITORS)
    )
    state: FloatArray = per_satellite("-", "MonitorState", columns=tuple(f"{name}_state" for name in GROUND_MONITORS))
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

    mode: float = 1.0
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

    mode: float = 1.0
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

"""What the monitors are set to, as it stands in a configuration file; each section makes the parameters of one monitor.

``exclude`` says whether what a monitor fails is excluded. A monitor always runs and its statistics are published, so
that two forms of one monitor, or a monitor under trial, can be watched beside the others. ``required`` says whether a
satellite that the monitor ought to judge and cannot may be used.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from gbas_core.parameters import ParameterError
from gbas_core.ranging.divergence import (
    GROUND_SIGMA_MPS,
    GROUND_THRESHOLD_MPS,
    DivergenceParams,
    white_noise_correlation,
)
from gbas_core.signals import BAND_INDEX, BANDS
from gbas_ground.declared import Declared, nested, parameter
from gbas_ground.monitors.carrier_acceleration import STATISTICS, CarrierAccelerationParams
from gbas_ground.monitors.carrier_noise import CarrierNoise
from gbas_ground.monitors.ccd import CcdParams
from gbas_ground.monitors.ccd_f import DEGREES_OF_FREEDOM, Form, TwoFrequencyParams, threshold
from gbas_ground.monitors.divergence_covariance import Matrix3, StatisticCovariance
from gbas_ground.monitors.ephemeris_residual import EphemerisResidualParams
from gbas_ground.monitors.expected_power import PowerExpectationParams
from gbas_ground.monitors.false_alarm import EPOCH_S, FALSE_EXCLUSION, exposure_probability
from gbas_ground.monitors.gradient_detectability import GRADIENT_RANGE, P_MISSED_DETECTION
from gbas_ground.monitors.ionosphere_gradient import IonosphereGradientParams
from gbas_ground.monitors.sigma_monitor import SigmaMonitorParams

_DEGREE: Final = math.pi / 180.0
_PROBABILITY: Final = {"low": 1e-12, "high": 0.1}
FALSE_EXCLUSION_OF_ALL: Final = 2e-7
"""Budget of false exclusions of one source in 15 s by all monitors together. Known: a twentieth of it for each, which
the published threshold of the single-band divergence monitor does not keep; it has nine of the twentieths."""
_BUDGET_PARAMETERS: Final = "ccd.threshold_mps over ccd.sigma_mps, and p_false_alarm of the others,"
LARGEST_ZENITH_DELAY_M: Final = 5.0  # what the two-band monitor takes; air has 2.2 to 2.8 m
_TRIANGLE: Final = 6
_UPPER: Final = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def _triangle(matrix: Matrix3) -> tuple[float, ...]:
    return tuple(matrix[row][column] for row, column in _UPPER)


def _matrix(values: tuple[float, ...]) -> Matrix3:
    a, b, c, d, e, f = values
    return ((a, b, c), (b, d, e), (c, e, f))


def _correlation(tau_s: float) -> float:
    """Least correlation of a filtered rate between a station's epochs: that of noise without memory."""
    return white_noise_correlation(min(1.0, EPOCH_S / tau_s))


@dataclass(frozen=True, kw_only=True)
class CcdSection(Declared):
    """Single-band code-carrier divergence (GAST-D)."""

    exclude: bool = parameter("ccd", "exclude", True, "-", "satellites that fail are excluded")
    tau_s: float = parameter("ccd", "tau_s", 30.0, "s", "time constant of both filters", low=1.0, high=1000.0)
    settle_s: float = parameter(
        "ccd", "settle_s", 0.0, "s", "time a filter has to run, where that is more than smoothing.settle_time_s",
        low=0.0, high=3600.0,
    )  # fmt: skip
    threshold_mps: float = parameter(
        "ccd", "threshold_mps", GROUND_THRESHOLD_MPS, "m/s", "of the mean over receivers", low=1e-4, high=10.0
    )
    sigma_mps: float = parameter(
        "ccd", "sigma_mps", GROUND_SIGMA_MPS, "m/s",
        "bound on the standard deviation of that mean, ionosphere included: with the threshold, the false exclusions",
        low=1e-5, high=1.0,
    )  # fmt: skip

    def p_false_exclusion(self) -> float:
        """Of one source in 15 s: 9.1e-8 for the published threshold and sigma, as of 17 independent samples."""
        return exposure_probability(self.threshold_mps / self.sigma_mps, _correlation(self.tau_s))

    def params(self, smoothing_settle_s: float, max_gap_s: float) -> CcdParams:
        """Parameters of the monitor.

        The filters settle with those of the smoothing: after 207 s both have forgotten their start to 1 %
        (:mod:`gbas_core.ranging.divergence`), less than the 230 s of docs/decisions/0002.
        """
        settle_s = max(self.settle_s, smoothing_settle_s)
        filters = DivergenceParams(tau_s=self.tau_s, settle_s=settle_s, max_gap_s=max_gap_s)
        return CcdParams(filters=filters, threshold_mps=self.threshold_mps, sigma_mps=self.sigma_mps)


@dataclass(frozen=True, kw_only=True)
class TwoFrequencySection(Declared):
    """Code-carrier divergence on two bands (GAST-F)."""

    exclude: str = parameter(
        "ccd_f", "exclude", "sound", "-", "form whose failures are excluded", choices=("sound", "paper", "none")
    )
    other: str = parameter("ccd_f", "other_band", "L5", "-", "band beside L1", choices=("L2", "L5"))
    p_false_alarm: float = parameter("ccd_f", "p_false_alarm", 1e-9, "-", "of a satellite and epoch", **_PROBABILITY)
    min_clock_satellites: int = parameter(
        "ccd_f", "min_clock_satellites", 3, "-", "others a receiver's clock is averaged from", low=1, high=35
    )
    receiver_covariance: tuple[float, ...] = parameter(
        "ccd_f", "receiver_covariance", (0.0,) * 6, "(m/s)^2",
        "of DF, DF other, IF carrier, upper triangle by rows: part of each receiver, divided by their number",
        low=-1.0, high=1.0,
    )  # fmt: skip
    common_covariance: tuple[float, ...] = parameter(
        "ccd_f", "common_covariance", _triangle(StatisticCovariance().common), "(m/s)^2",
        "likewise: part that the receivers share, never divided; the default is the published bound",
        low=-1.0, high=1.0,
    )  # fmt: skip
    elevation_rad: tuple[float, ...] = parameter(
        "ccd_f", "elevation_deg", (), "deg", "nodes of the factors, rising; empty: no dependence on elevation",
        low=0.0, high=90.0, per_unit=_DEGREE,
    )  # fmt: skip
    factor_df: tuple[float, ...] = parameter(
        "ccd_f", "factor_df", (), "-", "on the standard deviation of DF at the nodes", low=0.01, high=100.0
    )
    factor_df_other: tuple[float, ...] = parameter(
        "ccd_f", "factor_df_other", (), "-", "of DF of the other band", low=0.01, high=100.0
    )
    factor_if_carrier: tuple[float, ...] = parameter(
        "ccd_f", "factor_if_carrier", (), "-", "of the IF carrier", low=0.01, high=100.0
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("receiver_covariance", "common_covariance"):
            if len(getattr(self, name)) != _TRIANGLE:
                raise ParameterError(f"ccd_f.{name} = {getattr(self, name)} is not {_TRIANGLE} numbers")
        for name in ("factor_df", "factor_df_other", "factor_if_carrier"):
            if len(getattr(self, name)) != len(self.elevation_rad):
                raise ParameterError(f"ccd_f.{name} = {getattr(self, name)} is not one number a node of elevation_deg")
        try:
            self._covariance()
        except ValueError as error:
            raise ParameterError(f"ccd_f: {error}") from None

    def p_false_exclusion(self, tau_s: float) -> float:
        """Of one source in 15 s, by the form that excludes: 1.9e-8 for 1e-9 an epoch and filters of 30 s."""
        if self.exclude == "none":
            return 0.0
        form: Form = "paper" if self.exclude == "paper" else "sound"
        limit = math.sqrt(threshold(form, self.p_false_alarm))
        return exposure_probability(limit, _correlation(tau_s), freedom=DEGREES_OF_FREEDOM[form])

    def params(self, filters: DivergenceParams, zenith_delay_m: float) -> TwoFrequencyParams:
        """Parameters of the monitor; its filters are those of the single-band one, its troposphere the station's."""
        return TwoFrequencyParams(
            other=BAND_INDEX[self.other],
            filters=filters,
            p_false_alarm=self.p_false_alarm,
            min_clock_satellites=self.min_clock_satellites,
            zenith_delay_m=min(zenith_delay_m, LARGEST_ZENITH_DELAY_M),
            covariance=self._covariance(),
        )

    def _covariance(self) -> StatisticCovariance:
        factors = (self.factor_df, self.factor_df_other, self.factor_if_carrier)
        return StatisticCovariance(
            receiver=_matrix(self.receiver_covariance),
            common=_matrix(self.common_covariance),
            elevation_rad=self.elevation_rad,
            factor=tuple(zip(*factors, strict=True)),
        )


@dataclass(frozen=True, kw_only=True)
class AccelerationSection(Declared):
    """Step, rate and acceleration of the carriers."""

    exclude: bool = parameter("acceleration", "exclude", True, "-", "satellites and channels that fail are excluded")
    window_s: float = parameter("acceleration", "window_s", 5.0, "s", "oldest epoch in the fit", low=1.0, high=600.0)
    points: int = parameter("acceleration", "points", 10, "-", "most epochs in the fit", low=4, high=120)
    least_points: int = parameter("acceleration", "least_points", 5, "-", "fewest epochs in it", low=4, high=120)
    min_satellites: int = parameter(
        "acceleration",
        "min_satellites",
        CarrierAccelerationParams.min_satellites,
        "-",
        "others a receiver's clock is taken from",
        low=2,
        high=35,
    )
    common: tuple[float, float, float] = parameter(
        "acceleration", "common", CarrierAccelerationParams.common, "m, m/s, m/s2",
        "sigma of step, rate and acceleration that all receivers share", low=0.0, high=1.0,
    )  # fmt: skip
    natural: tuple[float, float, float] = parameter(
        "acceleration", "natural", CarrierAccelerationParams.natural, "m, m/s, m/s2",
        "largest step, rate and acceleration that are no fault", low=0.0, high=10.0,
    )  # fmt: skip
    p_false_alarm: float = parameter(
        "acceleration", "p_false_alarm", FALSE_EXCLUSION, "-", "of one source in 15 s", **_PROBABILITY
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("common", "natural"):
            if len(getattr(self, name)) != len(STATISTICS):
                raise ParameterError(f"acceleration.{name} = {getattr(self, name)} is not {len(STATISTICS)} numbers")
        if self.least_points > self.points:
            raise ParameterError(
                f"acceleration.least_points = {self.least_points} is more than acceleration.points = {self.points}"
            )

    def params(self, max_gap_s: float, receiver_factor: tuple[float, ...] = (1.0,)) -> CarrierAccelerationParams:
        """Parameters of the monitor; its noise within seconds is its own, how receivers compare is the station's."""
        return CarrierAccelerationParams(
            noise=replace(CarrierAccelerationParams.noise, receiver_factor=receiver_factor),
            points=self.points,
            window_s=self.window_s,
            least_points=self.least_points,
            min_satellites=self.min_satellites,
            max_gap_s=max_gap_s,
            common=self.common,
            natural=self.natural,
            p_false_alarm=self.p_false_alarm,
        )


@dataclass(frozen=True, kw_only=True)
class PowerSection(Declared):
    """C/N0 against one limit for all elevations, ``monitors.min_cn0_dbhz``."""

    exclude: bool = parameter("power", "exclude", True, "-", "channels that fail are excluded")


@dataclass(frozen=True, kw_only=True)
class ExpectedPowerSection(Declared):
    """C/N0 against what is expected at the elevation."""

    exclude: bool = parameter("expected_power", "exclude", True, "-", "satellites and channels that fail are excluded")
    elevation_rad: tuple[float, ...] = parameter(
        "expected_power", "elevation_deg", PowerExpectationParams.elevation_rad, "deg", "nodes of the table, rising",
        low=0.0, high=90.0, per_unit=_DEGREE,
    )  # fmt: skip
    minimum_l1_dbhz: tuple[float, ...] = parameter(
        "expected_power",
        "minimum_l1_dbhz",
        PowerExpectationParams.minimum_dbhz[0],
        "dB-Hz",
        "at the nodes",
        low=0.0,
        high=70.0,
    )
    minimum_l2_dbhz: tuple[float, ...] = parameter(
        "expected_power",
        "minimum_l2_dbhz",
        PowerExpectationParams.minimum_dbhz[1],
        "dB-Hz",
        "at the nodes",
        low=0.0,
        high=70.0,
    )
    minimum_l5_dbhz: tuple[float, ...] = parameter(
        "expected_power",
        "minimum_l5_dbhz",
        PowerExpectationParams.minimum_dbhz[2],
        "dB-Hz",
        "at the nodes",
        low=0.0,
        high=70.0,
    )
    channel_margin_db: float = parameter(
        "expected_power", "channel_margin_db", 4.0, "dB", "a single channel may be this much lower", low=0.0, high=40.0
    )
    average_s: float = parameter(
        "expected_power",
        "average_s",
        PowerExpectationParams.average_s,
        "s",
        "time constant of the average",
        low=0.1,
        high=600.0,
    )
    learn: bool = parameter("expected_power", "learn", False, "-", "let what the receivers saw raise the minimum")

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            self.params(1.0)
        except ValueError as error:
            raise ParameterError(str(error)) from None

    def params(self, max_gap_s: float) -> PowerExpectationParams:
        """Parameters of the monitor."""
        return PowerExpectationParams(
            elevation_rad=self.elevation_rad,
            minimum_dbhz=(self.minimum_l1_dbhz, self.minimum_l2_dbhz, self.minimum_l5_dbhz),
            channel_margin_db=self.channel_margin_db,
            average_s=self.average_s,
            learn=self.learn,
            max_gap_s=max_gap_s,
        )


@dataclass(frozen=True, kw_only=True)
class SigmaSection(Declared):
    """Mean and spread of the B values over time."""

    exclude: bool = parameter("sigma_monitor", "exclude", True, "-", "channels and receivers that fail are excluded")
    window_s: tuple[float, ...] = parameter(
        "sigma_monitor", "window_s", SigmaMonitorParams.window_s, "s", "time constants", low=60.0, high=86_400.0
    )
    correlation_s: tuple[float, float] = parameter(
        "sigma_monitor", "correlation_s", SigmaMonitorParams.correlation_s, "s",
        "correlation time of the B values of each smoothing constant", low=1.0, high=3600.0,
    )  # fmt: skip
    sample_s: float = parameter(
        "sigma_monitor", "sample_s", SigmaMonitorParams.sample_s, "s", "between the values taken", low=0.5, high=600.0
    )
    p_false_alarm: float = parameter(
        "sigma_monitor", "p_false_alarm", FALSE_EXCLUSION, "-", "of one source in 15 s", **_PROBABILITY
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.correlation_s) != 2:
            raise ParameterError(f"sigma_monitor.correlation_s = {self.correlation_s} is not 2 numbers")
        try:
            self.params()
        except ValueError as error:
            raise ParameterError(str(error)) from None

    def params(self) -> SigmaMonitorParams:
        """Parameters of the monitor."""
        return SigmaMonitorParams(
            window_s=self.window_s,
            correlation_s=self.correlation_s,
            sample_s=self.sample_s,
            p_false_alarm=self.p_false_alarm,
        )


@dataclass(frozen=True, kw_only=True)
class EphemerisSection(Declared):
    """Broadcast orbits against double-difference carriers."""

    exclude: bool = parameter("ephemeris_residual", "exclude", True, "-", "satellites that fail are excluded")
    required: bool = parameter(
        "ephemeris_residual", "required", False, "-",
        "satellites whose orbits it does not bound within the largest P are not used; always so with gast_d.enabled",
    )  # fmt: skip
    p_false_alarm: float = parameter(
        "ephemeris_residual", "p_false_alarm", FALSE_EXCLUSION, "-", "of one source in 15 s", **_PROBABILITY
    )
    p_missed_detection: float = parameter(
        "ephemeris_residual", "p_missed_detection", 1e-4, "-", "of an orbit error P is claimed for", **_PROBABILITY
    )

    def params(self, bands: tuple[int, ...]) -> EphemerisResidualParams:
        """Parameters of the monitor; its double differences are those of the gradient monitor."""
        return EphemerisResidualParams(
            bands=bands,
            p_false_alarm=self.p_false_alarm,
            p_missed_detection=self.p_missed_detection,
            required=False,
        )


@dataclass(frozen=True, kw_only=True)
class CarrierNoiseSection(Declared):
    """Noise and multipath of one reference receiver's carriers."""

    floor_m: tuple[float, ...] = parameter(
        "carrier_noise", "floor_m", CarrierNoise.floor_m, "m", "at the zenith, by band L1, L2, L5", low=1e-5, high=1.0
    )
    low_m: tuple[float, ...] = parameter(
        "carrier_noise",
        "low_m",
        CarrierNoise.low_m,
        "m",
        "added at the horizon, by band L1, L2, L5",
        low=1e-5,
        high=1.0,
    )
    scale_rad: float = parameter(
        "carrier_noise",
        "scale_deg",
        math.degrees(CarrierNoise.scale_rad),
        "deg",
        "elevation over which it falls",
        low=1.0,
        high=90.0,
        per_unit=_DEGREE,
    )

    receiver_factor: tuple[float, ...] = parameter(
        "carrier_noise",
        "receiver_factor",
        CarrierNoise.receiver_factor,
        "-",
        "on the sigma of rr1, rr2, ..., or one for all; r_ij is the ratio of two of them",
        low=0.1,
        high=10.0,
    )

    def params(self) -> CarrierNoise:
        """Parameters of the model."""
        return CarrierNoise(
            floor_m=self.floor_m, low_m=self.low_m, scale_rad=self.scale_rad, receiver_factor=self.receiver_factor
        )

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("floor_m", "low_m"):
            if len(getattr(self, name)) != len(BANDS):
                raise ParameterError(f"carrier_noise.{name} = {getattr(self, name)} is not {len(BANDS)} numbers")
        if not self.receiver_factor:
            raise ParameterError("carrier_noise.receiver_factor = () is not one number for all receivers, or one each")


@dataclass(frozen=True, kw_only=True)
class GradientSection(Declared):
    """Absolute slant ionosphere gradient."""

    exclude: bool = parameter("gradient", "exclude", True, "-", "satellites that fail are excluded")
    required: bool = parameter(
        "gradient", "required", False, "-", "satellites it cannot judge are not used; always so with gast_d.enabled"
    )
    bands: str = parameter("gradient", "bands", "L1 L5", "-", "carriers used", choices=("L1", "L5", "L1 L5"))
    pairing: str = parameter("gradient", "baselines", "all", "-", "all, or from rr1 only", choices=("all", "star"))
    fuse: str = parameter("gradient", "fuse", "any", "-", "baselines that have to fail", choices=("any", "all"))
    references: int = parameter(
        "gradient", "references", 5, "-", "reference satellites of a constellation", low=1, high=12
    )
    p_false_alarm: float = parameter(
        "gradient", "p_false_alarm", FALSE_EXCLUSION, "-", "of one source in 15 s", **_PROBABILITY
    )
    p_missed_detection: float = parameter(
        "gradient", "p_missed_detection", P_MISSED_DETECTION, "-", "of a gradient counted as detectable", **_PROBABILITY
    )
    gradient_range: tuple[float, float] = parameter(
        "gradient", "range", GRADIENT_RANGE, "m/m", "gradients to be detected", low=0.0, high=0.1
    )
    min_coverage: float = parameter(
        "gradient", "min_coverage", 0.0, "-", "share of them a satellite has to be monitored for", low=0.0, high=1.0
    )
    runway_bearing_rad: tuple[float, ...] = parameter(
        "gradient", "runway_bearing_deg", (), "deg", "true bearings; empty: the courses of the approaches",
        low=0.0, high=360.0, per_unit=_DEGREE,
    )  # fmt: skip

    def params(self, courses_rad: tuple[float, ...], noise: CarrierNoise) -> IonosphereGradientParams:
        """Parameters of the monitor; a station without approaches is monitored along and across.

        What a satellite that is not monitored may be used for is the station's business.
        """
        return IonosphereGradientParams(
            runway_bearing_rad=self.runway_bearing_rad or courses_rad or (0.0, 0.5 * math.pi),
            bands=tuple(BAND_INDEX[band] for band in self.bands.split()),
            pairing=self.pairing,  # type: ignore[arg-type]  # checked by the declaration
            fuse=self.fuse,  # type: ignore[arg-type]
            references=self.references,
            noise=noise,
            p_false_alarm=self.p_false_alarm,
            p_missed_detection=self.p_missed_detection,
            gradient_range=self.gradient_range,
            min_coverage=self.min_coverage,
            required=False,
        )


@dataclass(frozen=True, kw_only=True)
class MonitorParams(Declared):
    """All of them."""

    carrier_noise: CarrierNoiseSection = nested(CarrierNoiseSection())
    ccd: CcdSection = nested(CcdSection())
    ccd_f: TwoFrequencySection = nested(TwoFrequencySection())
    acceleration: AccelerationSection = nested(AccelerationSection())
    gradient: GradientSection = nested(GradientSection())
    ephemeris: EphemerisSection = nested(EphemerisSection())
    power: PowerSection = nested(PowerSection())
    expected_power: ExpectedPowerSection = nested(ExpectedPowerSection())
    sigma: SigmaSection = nested(SigmaSection())

    def __post_init__(self) -> None:
        super().__post_init__()
        shares = self.false_exclusions()
        if sum(shares.values()) > FALSE_EXCLUSION_OF_ALL:
            given = ", ".join(f"{name} {share:.2g}" for name, share in shares.items())
            raise ParameterError(
                f"false exclusions of one source in 15 s ({given}) are together more than the budget of "
                f"{FALSE_EXCLUSION_OF_ALL:g}: {_BUDGET_PARAMETERS} decide"
            )

    def false_exclusions(self) -> dict[str, float]:
        """Probability that each monitor that excludes does so to a sound source in 15 s, by its name [-]."""
        shares = {
            "ccd": (self.ccd.exclude, self.ccd.p_false_exclusion()),
            "ccd_f": (True, self.ccd_f.p_false_exclusion(self.ccd.tau_s)),
            "gradient": (self.gradient.exclude, self.gradient.p_false_alarm),
            "acceleration": (self.acceleration.exclude, self.acceleration.p_false_alarm),
            "ephemeris_residual": (self.ephemeris.exclude, self.ephemeris.p_false_alarm),
            "power": (self.power.exclude, FALSE_EXCLUSION),
            "sigma_monitor": (self.sigma.exclude, self.sigma.p_false_alarm),
        }
        return {name: share if excludes else 0.0 for name, (excludes, share) in shares.items()}

    def watching(self) -> MonitorParams:
        """The same, with no monitor of signals or of B values over time that excludes."""
        return replace(
            self,
            ccd=replace(self.ccd, exclude=False),
            ccd_f=replace(self.ccd_f, exclude="none"),
            acceleration=replace(self.acceleration, exclude=False),
            gradient=replace(self.gradient, exclude=False),
            ephemeris=replace(self.ephemeris, exclude=False),
            power=replace(self.power, exclude=False),
            expected_power=replace(self.expected_power, exclude=False),
            sigma=replace(self.sigma, exclude=False),
        )

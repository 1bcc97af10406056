"""What the monitors are set to, as it stands in a configuration file; each section makes the parameters of one monitor.

``exclude`` says whether what a monitor fails is excluded. A monitor always runs and its statistics are published, so
that two forms of one monitor, or a monitor under trial, can be watched beside the others. ``required`` says whether a
satellite that the monitor ought to judge and cannot may be used.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from gbas_core.divergence import GROUND_SIGMA_MPS, GROUND_THRESHOLD_MPS, DivergenceParams
from gbas_core.signals import BAND_INDEX, BANDS
from gbas_ground.declared import Declared, nested, parameter
from gbas_ground.gradient_detectability import GRADIENT_RANGE, P_MISSED_DETECTION
from gbas_ground.monitors.carrier_noise import CarrierNoise
from gbas_ground.monitors.code_carrier_divergence import CcdParams
from gbas_ground.monitors.false_alarm import FALSE_EXCLUSION
from gbas_ground.monitors.ionosphere_gradient import IonosphereGradientParams
from gbas_msgs_py.parameters import ParameterError

_DEGREE: Final = math.pi / 180.0
_SETTLE_S: Final = 230.0
"""As the smoothing filters (docs/decisions/0002): both CCD filters have forgotten their start to 1 % after 207 s."""
_PROBABILITY: Final = {"low": 1e-12, "high": 0.1}


@dataclass(frozen=True, kw_only=True)
class CcdSection(Declared):
    """Single-band code-carrier divergence (GAST-D)."""

    exclude: bool = parameter("ccd", "exclude", True, "-", "satellites that fail are excluded")
    tau_s: float = parameter("ccd", "tau_s", 30.0, "s", "time constant of both filters", low=1.0, high=1000.0)
    settle_s: float = parameter(
        "ccd", "settle_s", _SETTLE_S, "s", "time a filter has to run before it counts", low=0.0, high=3600.0
    )
    threshold_mps: float = parameter(
        "ccd", "threshold_mps", GROUND_THRESHOLD_MPS, "m/s", "of the mean over receivers", low=1e-4, high=10.0
    )

    def params(self, max_gap_s: float) -> CcdParams:
        """Parameters of the monitor."""
        filters = DivergenceParams(tau_s=self.tau_s, settle_s=self.settle_s, max_gap_s=max_gap_s)
        return CcdParams(filters=filters, threshold_mps=self.threshold_mps, sigma_mps=GROUND_SIGMA_MPS)


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
        "carrier_noise", "scale_deg", 17.0, "deg", "elevation over which it falls", low=1.0, high=90.0, per_unit=_DEGREE
    )

    def params(self) -> CarrierNoise:
        """Parameters of the model."""
        return CarrierNoise(floor_m=self.floor_m, low_m=self.low_m, scale_rad=self.scale_rad)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("floor_m", "low_m"):
            if len(getattr(self, name)) != len(BANDS):
                raise ParameterError(f"carrier_noise.{name} = {getattr(self, name)} is not {len(BANDS)} numbers")


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
    gradient: GradientSection = nested(GradientSection())

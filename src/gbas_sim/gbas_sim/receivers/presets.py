"""Receivers that are as good as the standards' accuracy designators say: sigma_pr_gnd and sigma_air from the output.

Each preset is a receiver of which the thermal noise follows from its C/N0 and loops, and errors with memory make up
what is missing to the curve once the code is carrier smoothed. Names: ``gad_a``, ``gad_b``, ``gad_c`` for reference
receivers, ``aad_a`` and ``aad_b`` for the aircraft, ``ideal`` for a receiver without errors.

For reference receivers the curve's first part, divided by the number of receivers, is every receiver's own; its second
part, a_2, which does not average out, is an error all receivers have in common.

Sources: ICAO Annex 10 Vol. I, App. B 3.6.7.1.1.1 (ground accuracy designators); Caamano et al., "Dual frequency dual
constellation GBAS processing modes", eq (8) to (10) (airborne designators and airframe multipath). E1, and L5 with E5a:
the surrogates of :mod:`gbas_core.models.error_models`. Correlation times are ours and uncertain: parameters.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Final, Literal, NamedTuple, get_args

import numpy as np
from pydantic import Field

from gbas_core.models.error_models import (
    AAD_A,
    AAD_B,
    AIRFRAME_MULTIPATH,
    E1_GROUND_FACTOR_SURROGATE,
    GAD_A,
    GAD_B,
    GAD_C_HIGH,
    GAD_C_LOW,
    GAD_C_STEP_DEG,
    L5_GROUND_SURROGATE,
    L5_MULTIPATH_SURROGATE,
    L5_NOISE_SURROGATE,
    AirborneAccuracy,
    AirborneCurve,
    GroundAccuracy,
    GroundCurve,
)
from gbas_core.parameters import Parameter, parameters
from gbas_core.record import FloatArray
from gbas_core.satellites import IS_GALILEO, IS_GPS, N_SATS
from gbas_core.signal.antenna import ANTENNA, LinkBudget
from gbas_core.signal.tracking_loops import CARRIER_BANDWIDTH, CODE_BANDWIDTH, NOISE_SCALE, TrackingParams, noise_sigmas
from gbas_core.signals import L1, L5
from gbas_sim.receivers.multipath import CorrelatedError, ElevationCurve, smoothing_gain
from gbas_sim.receivers.oscillators import BAND_DELAY, CODE_CARRIER_DELAY, OSCILLATORS, SYSTEM_DELAY, HardwareParams
from gbas_sim.receivers.receiver_model import CN0_SIGMA, ELEVATION_MASK, IDEAL, RINEX_STEPS, ReceiverModel

PRESETS: Final = ("ideal", "gad_a", "gad_b", "gad_c", "aad_a", "aad_b")
TAU_S: Final = 100.0
"""Smoothing time constant the curves are for [s]. Known."""
LOWEST_DEG: Final = 5.0
"""Lowest elevation the curves are for [deg]. Known."""

# Uncertain, ours: correlation times. Reflections at a site change as the satellite moves, those at an airframe with
# every movement of the aircraft; what noise there is beyond thermal noise is filtered by the code loop.
_SITE_MULTIPATH_S: Final = 60.0
_SITE_COMMON_S: Final = 300.0
_AIRFRAME_MULTIPATH_S: Final = 20.0
_AIRBORNE_NOISE_S: Final = 10.0
# Uncertain, ours: multipath of the carrier over that of the code.
_CARRIER_SHARE: Final = 0.003


@parameters
class SiteLink(LinkBudget):
    """Link budget at a reference station, whose antennas limit multipath."""

    antenna: Annotated[str, ANTENNA] = "mla"


@parameters
class AirborneTracking(TrackingParams):
    """Loops of a receiver that moves."""

    code_bandwidth_hz: Annotated[float, CODE_BANDWIDTH] = 0.5
    carrier_bandwidth_hz: Annotated[float, CARRIER_BANDWIDTH] = 18.0


@parameters
class NoiselessTracking(TrackingParams):
    """Loops without noise."""

    noise_scale: Annotated[float, NOISE_SCALE] = 0.0


@parameters
class NoHardware(HardwareParams):
    """Hardware without delays."""

    band_m: Annotated[float, BAND_DELAY] = 0.0
    system_m: Annotated[float, SYSTEM_DELAY] = 0.0
    code_carrier_m: Annotated[float, CODE_CARRIER_DELAY] = 0.0


@parameters
class PresetParams:
    """What sections of receivers with a preset have beside the name and what is the preset's own."""

    oscillator: Annotated[
        str | None, Parameter("kind of the clock; the preset's unless given", choices=tuple(OSCILLATORS))
    ] = None
    hardware: HardwareParams = HardwareParams()
    elevation_mask_rad: Annotated[float, ELEVATION_MASK] = IDEAL.elevation_mask_rad
    cn0_sigma_db: Annotated[float, CN0_SIGMA] = 0.2
    rinex_steps: Annotated[bool, RINEX_STEPS] = False


@parameters
class GroundPresetParams(PresetParams):
    """A reference receiver of a ground accuracy designator."""

    preset: Annotated[Literal["gad_a", "gad_b", "gad_c"], Parameter("accuracy designator")]
    cn0: SiteLink = SiteLink()
    tracking: TrackingParams = TrackingParams()


@parameters
class AirbornePresetParams(PresetParams):
    """An airborne receiver of an airborne accuracy designator."""

    preset: Annotated[Literal["aad_a", "aad_b"], Parameter("accuracy designator")]
    cn0: LinkBudget = LinkBudget()
    tracking: AirborneTracking = AirborneTracking()


@parameters
class IdealPresetParams(PresetParams):
    """A receiver without errors; without a link budget C/N0 goes with the sine of the elevation."""

    preset: Annotated[Literal["ideal"], Parameter("without errors")]
    cn0: LinkBudget | None = None
    tracking: NoiselessTracking = NoiselessTracking()
    hardware: NoHardware = NoHardware()
    cn0_sigma_db: Annotated[float, CN0_SIGMA] = 0.0


AnyPreset = Annotated[GroundPresetParams | AirbornePresetParams | IdealPresetParams, Field(discriminator="preset")]


def preset_receiver(params: AnyPreset, *, interval_s: float) -> ReceiverModel:
    """The receiver of a section with a preset; its errors are those of the preset's own loops.

    Raises
    ------
    ValueError
        As :func:`receiver_preset`.
    """
    preset = receiver_preset(params.preset, interval_s=interval_s, cn0=params.cn0)
    own = {key: getattr(params, key) for key in ("hardware", "elevation_mask_rad", "cn0_sigma_db", "rinex_steps")}
    if params.oscillator is not None:
        own["oscillator"] = OSCILLATORS[params.oscillator]
    return replace(preset, tracking=params.tracking, **own)


_SITE_LINK: Final = SiteLink()
_AIRBORNE_LINK: Final = LinkBudget()
_DEGREES: Final[FloatArray] = np.arange(91.0)
_Targets = tuple[FloatArray, FloatArray, FloatArray]


def receiver_preset(name: str, *, interval_s: float = 0.5, cn0: LinkBudget | None = None) -> ReceiverModel:
    """The receiver of a name in :data:`PRESETS`.

    Parameters
    ----------
    name : str
    interval_s : float
        Between epochs [s]: the smoothing filter averages more of them when it is shorter.
    cn0 : LinkBudget, optional
        Another antenna or other powers than the preset's; the curves stay the same.

    Raises
    ------
    ValueError
        For an unknown name, or when thermal noise alone is above the curve.
    """
    if name not in PRESETS:
        raise ValueError(f"receiver: preset = {name!r} is not one of {', '.join(PRESETS)}")
    kind, _, letter = name.partition("_")
    designator = letter.upper()
    if kind == "ideal":
        return IDEAL if cn0 is None else replace(IDEAL, cn0=cn0)
    link = default_link(name) if cn0 is None else cn0
    if kind == "gad":
        return ground_receiver(designator, interval_s=interval_s, cn0=link)  # type: ignore[arg-type]  # from PRESETS
    return airborne_receiver(designator, interval_s=interval_s, cn0=link)  # type: ignore[arg-type]


def default_link(name: str) -> LinkBudget:
    """The link budget of a preset: antennas of reference stations limit multipath, the aircraft has a patch."""
    return _SITE_LINK if name.startswith("gad") else _AIRBORNE_LINK


def ground_receiver(
    designator: GroundAccuracy,
    *,
    interval_s: float = 0.5,
    multipath_s: float = _SITE_MULTIPATH_S,
    common_s: float = _SITE_COMMON_S,
    cn0: LinkBudget = _SITE_LINK,
) -> ReceiverModel:
    """A reference receiver of a ground accuracy designator.

    Parameters
    ----------
    designator : {"A", "B", "C"}
    interval_s : float
        Between epochs [s].
    multipath_s, common_s : float
        Correlation times of the receiver's own error and of the common one [s].
    cn0 : LinkBudget

    Raises
    ------
    ValueError
        For another designator, or when thermal noise alone is above the curve.
    """
    _known("reference receiver", designator, get_args(GroundAccuracy))
    model = ReceiverModel(
        tracking=TrackingParams(),
        cn0=cn0,
        oscillator=OSCILLATORS["ocxo"],
    )
    own, common = _ground_targets(designator)
    thermal = _smoothed_thermal_m(model, interval_s)
    errors = (
        _error("site multipath", own, thermal, _Times(multipath_s, interval_s), carrier_share=_CARRIER_SHARE),
        _error("site", common, None, _Times(common_s, interval_s), shared=True),
    )
    return ReceiverModel(tracking=model.tracking, cn0=model.cn0, oscillator=model.oscillator, errors=errors)


def airborne_receiver(
    designator: AirborneAccuracy,
    *,
    interval_s: float = 0.5,
    noise_s: float = _AIRBORNE_NOISE_S,
    multipath_s: float = _AIRFRAME_MULTIPATH_S,
    cn0: LinkBudget = _AIRBORNE_LINK,
) -> ReceiverModel:
    """An airborne receiver of an airborne accuracy designator, on an airframe.

    Parameters
    ----------
    designator : {"A", "B"}
    interval_s : float
        Between epochs [s].
    noise_s, multipath_s : float
        Correlation times of noise beyond thermal noise and of airframe multipath [s].
    cn0 : LinkBudget

    Raises
    ------
    ValueError
        For another designator, or when thermal noise alone is above the curve.
    """
    _known("airborne receiver", designator, get_args(AirborneAccuracy))
    model = ReceiverModel(
        tracking=AirborneTracking(),
        cn0=cn0,
        oscillator=OSCILLATORS["tcxo_good"],
    )
    noise = _airborne_sigma(AAD_A if designator == "A" else AAD_B)
    thermal = _smoothed_thermal_m(model, interval_s)
    multipath = (_airborne_sigma(AIRFRAME_MULTIPATH),) * 2 + (_airborne_sigma(L5_MULTIPATH_SURROGATE),)
    errors = (
        _error(
            "receiver noise", (noise, noise, _airborne_sigma(L5_NOISE_SURROGATE)), thermal, _Times(noise_s, interval_s)
        ),
        _error("airframe multipath", multipath, None, _Times(multipath_s, interval_s), carrier_share=_CARRIER_SHARE),
    )
    return ReceiverModel(tracking=model.tracking, cn0=model.cn0, oscillator=model.oscillator, errors=errors)


def _known(kind: str, designator: str, known: tuple[str, ...]) -> None:
    if designator not in known:
        raise ValueError(f"{kind}: designator = {designator!r} is not one of {', '.join(known)}")


def _airborne_sigma(curve: AirborneCurve) -> FloatArray:
    return np.asarray(curve.a0_m + curve.a1_m * np.exp(-_DEGREES / curve.theta0_deg))


def _ground_targets(designator: GroundAccuracy) -> tuple[_Targets, _Targets]:
    """What smoothed codes are to have by degree: each receiver's own and the common part, by signal [m]."""
    if designator == "C":
        low = _DEGREES <= GAD_C_STEP_DEG
        own = np.where(low, _ground_sigma(GAD_C_LOW), _ground_sigma(GAD_C_HIGH))
        common = np.where(low, GAD_C_LOW.a2_m, GAD_C_HIGH.a2_m)
    else:
        curve = GAD_A if designator == "A" else GAD_B
        own, common = _ground_sigma(curve), np.full(_DEGREES.size, curve.a2_m)
    e1 = E1_GROUND_FACTOR_SURROGATE
    l5_common = np.full(_DEGREES.size, L5_GROUND_SURROGATE.a2_m)
    return (own, e1 * own, _ground_sigma(L5_GROUND_SURROGATE)), (common, e1 * common, l5_common)


def _ground_sigma(curve: GroundCurve) -> FloatArray:
    return np.asarray(curve.a0_m + curve.a1_m * np.exp(-_DEGREES / curve.theta0_deg))


def _smoothed_thermal_m(model: ReceiverModel, interval_s: float) -> _Targets:
    """Thermal noise of smoothed codes by degree and signal [m]."""
    elevation = np.radians(_DEGREES)[:, np.newaxis] * np.ones(N_SATS)
    sigma = noise_sigmas(model.tracking, model.cn0.cn0_dbhz(elevation)).code_m
    gain = smoothing_gain(model.tracking.code_correlation_s, tau_s=TAU_S, interval_s=interval_s)
    gps, galileo = int(np.argmax(IS_GPS)), int(np.argmax(IS_GALILEO))
    # The weaker of L5 and E5a stands for both.
    l5 = sigma[:, L5].max(axis=-1)
    return gain * sigma[:, L1, gps], gain * sigma[:, L1, galileo], gain * l5


class _Times(NamedTuple):
    """Correlation time of an error, and between epochs [s]."""

    correlation_s: float
    interval_s: float


def _error(
    name: str,
    targets: _Targets,
    thermal: _Targets | None,
    times: _Times,
    *,
    shared: bool = False,
    carrier_share: float = 0.0,
) -> CorrelatedError:
    """The error that makes up, once smoothed, what thermal noise is short of the target."""
    gain = smoothing_gain(times.correlation_s, tau_s=TAU_S, interval_s=times.interval_s)
    curves = []
    for place, target in enumerate(targets):
        rest = target**2 - (0.0 if thermal is None else thermal[place] ** 2)
        if bool((rest[_DEGREES >= LOWEST_DEG] < 0.0).any()):
            raise ValueError(f"error {name}: thermal noise alone is above the curve it is to reach")
        curves.append(np.sqrt(np.clip(rest, 0.0, None)) / gain)
    code, carrier = (
        tuple(
            ElevationCurve(elevation_deg=tuple(_DEGREES.tolist()), sigma_m=tuple((share * each).tolist()))
            for each in curves
        )
        for share in (1.0, carrier_share)
    )
    return CorrelatedError(
        name=name,
        correlation_s=times.correlation_s,
        code=(code[0], code[1], code[2]),
        carrier=(carrier[0], carrier[1], carrier[2]),
        shared=shared,
    )

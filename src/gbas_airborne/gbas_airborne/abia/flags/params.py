"""Parameters of the integrity flags."""

from __future__ import annotations

import math
from typing import Annotated

from gbas_airborne.abia.prediction.params import PredictionParams
from gbas_airborne.abia.visibility.requirements import GeometryCriteria
from gbas_core.parameters import Parameter, parameters
from gbas_core.signal.link_budget import SignalCriteria
from gbas_core.signal.loop_thresholds import LoopParams

_DEFAULT_PREDICTION = PredictionParams()
_DEFAULT_SIGNAL = SignalCriteria()
_DEFAULT_GEOMETRY = GeometryCriteria()
_DEFAULT_LOOPS = LoopParams()


@parameters
class FlagParams:
    """Thresholds of the flags and how they are kept from flickering.

    Known: Sabatini et al., IV.H. Its 42.25 degrees and 0.05 d are misprints of what a margin of 5 % on 45 degrees and
    the spacing d gives: 42.75 degrees, 0.95 d. Holding is ours.
    """

    prediction: PredictionParams = _DEFAULT_PREDICTION
    signal: SignalCriteria = _DEFAULT_SIGNAL
    geometry: GeometryCriteria = _DEFAULT_GEOMETRY
    loops: LoopParams = _DEFAULT_LOOPS
    loop_caution_share: Annotated[
        float, Parameter("of a loop's threshold from which there is caution", "-", 0.1, 1.0)
    ] = 0.95
    warning_elevation_rad: Annotated[
        float,
        Parameter(
            "with as many satellites as are required, antenna elevation below which there is a warning",
            "deg",
            0.0,
            45.0,
        ),
    ] = math.radians(5.0)
    early_late_caution_rad: Annotated[
        float, Parameter("early-late phase above which there is caution of multipath", "rad", 0.001, 1.6)
    ] = 0.1
    multipath_warning_m: Annotated[
        float, Parameter("range error by multipath above which there is a warning", "m", 0.01, 100.0)
    ] = 1.0
    caution_wait_s: Annotated[
        float, Parameter("how long a cause must last for a caution, unless a loss is near", "s", 0.0, 5.0)
    ] = 0.0
    urgent_s: Annotated[float, Parameter("a loss sooner than this is cautioned of at once", "s", 0.0, 60.0)] = 3.0
    caution_hold_s: Annotated[float, Parameter("a caution stays for this after its cause", "s", 0.0, 60.0)] = 1.0
    warning_hold_s: Annotated[float, Parameter("a warning stays for this after its cause", "s", 0.0, 60.0)] = 0.5
    max_gap_s: Annotated[float, Parameter("after a longer pause between epochs flags start anew", "s", 0.1, 60.0)] = 1.0

    def __post_init__(self) -> None:
        if self.urgent_s + self.caution_wait_s > self.prediction.horizon_s:
            raise ValueError(
                f"flags: urgent_s + caution_wait_s = {self.urgent_s + self.caution_wait_s!r} is above the horizon, "
                f"{self.prediction.horizon_s!r}: cautions would wait for losses that are nearer"
            )

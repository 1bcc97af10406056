"""What the flags are made of at one time, and what comes out."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gbas_airborne.abia.flags.causes import Cause, Level
from gbas_airborne.abia.prediction.predictors import Prediction, PredictionEpoch
from gbas_core.record import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, kw_only=True)
class Approach:
    """GBAS on an approach; what is missing (NaN) is not protected.

    Attributes
    ----------
    vpl_m, lpl_m, val_m, lal_m : float
        Protection levels and alert limits.
    served : bool
        Whether the approach service is given.
    course_rad, glide_path_rad : float
        True course and angle of the final approach, about which the levels are.
    """

    vpl_m: float
    lpl_m: float
    val_m: float
    lal_m: float
    served: bool
    course_rad: float
    glide_path_rad: float = math.radians(3.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class FlagEpoch:
    """What is known at one time; arrays (N,), NaN what is not known of a satellite.

    Attributes
    ----------
    ahead : PredictionEpoch
        Attitude, plan, lines of sight, and what hides them.
    cn0_dbhz : array
        Measured; of a satellite that should be seen, missing is not tracked.
    acceleration_mps2, jerk_mps3 : arrays
        Along the lines of sight, of the flown path.
    clock_groups : (k, N) bool array
        Satellites that share a receiver clock.
    early_late_rad, multipath_m : array or None
        Early-late phase and range error by multipath; None: the receiver has no such thing, which is reported.
    sigma_m : array or None
        Standard deviations of corrected ranges, with which levels ahead are predicted on an approach.
    approach : Approach or None
        None: no approach is flown.
    """

    ahead: PredictionEpoch
    cn0_dbhz: FloatArray
    acceleration_mps2: FloatArray
    jerk_mps3: FloatArray
    clock_groups: BoolArray
    early_late_rad: FloatArray | None = None
    multipath_m: FloatArray | None = None
    sigma_m: FloatArray | None = None
    approach: Approach | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Flags:
    """Flags of one epoch.

    Attributes
    ----------
    time_s : float
    system : (8,) int array
        Level of each :class:`Cause` for the aircraft.
    satellites : (4, N) int array
        Level of each of the first causes for each satellite that is to be seen.
    unmonitored : tuple of Cause
        What was not looked at, for there is nothing to look at.
    time_to_warning_s : (8,) array
        Predicted time to a warning of each cause: 0 with one, infinite when none is predicted within the horizon, NaN
        when nothing is predicted.
    satellite_time_to_warning_s : (N,) array
        The same of the masking of each satellite.
    predicted_vpl_m, predicted_lpl_m : float
        Largest protection levels over the horizon, PVPL and PLPL; NaN without.
    prediction : Prediction
    """

    time_s: float
    system: IntArray
    satellites: IntArray
    unmonitored: tuple[Cause, ...]
    time_to_warning_s: FloatArray
    satellite_time_to_warning_s: FloatArray
    predicted_vpl_m: float
    predicted_lpl_m: float
    prediction: Prediction

    @property
    def level(self) -> Level:
        """The highest of all causes."""
        return Level(int(self.system.max()))

    def time_to_caution_s(self, lead_s: float) -> FloatArray:
        """How long a caution of each cause may wait to come that long before its warning, (8,) [s]."""
        result: FloatArray = (self.time_to_warning_s - lead_s).clip(min=0.0)
        return result

"""What the monitors make of a fault mode: direction of the statistic, size, threshold.

Source: ENC 2015, 2.1 (GAST D), eq (15) to (18) (GAST F, the form "published"); the form "full_rank" has three
statistics.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, cast, get_args

import numpy as np
from scipy.special import ndtri

from gbas_core.ranging.combinations import combination_matrix
from gbas_core.ranging.divergence import GROUND, GROUND_SIGMA_MPS, GROUND_THRESHOLD_MPS
from gbas_core.ranging.fault_modes import FAULT_MODES, fault_direction
from gbas_core.record import FloatArray
from gbas_core.signals import L1, L5
from gbas_ground.monitors.divergence_covariance import INDEPENDENT, PRINTED_COVARIANCE, published_by_origin
from gbas_ground.monitors.divergence_forms import threshold
from gbas_studies.ccd.smoothed_error import StudyError

MonitorName = Literal["gast-d", "gast-f-paper", "gast-f-sound"]
MONITORS: Final[tuple[MonitorName, ...]] = ("gast-d", "gast-f-paper", "gast-f-sound")
ErrorOn = Literal["L1", "L5", "IF"]
P_FALSE_ALARM: Final = 1e-9
TAU_S: Final = GROUND.tau_s
# Known, misleading: ENC 2015, eq (17) rounds the coefficients to two digits.
ROUNDED_EQ_17: Final[FloatArray] = np.array(
    [[1.0, 0.0, -3.53, 2.53], [0.0, 1.0, -4.53, 3.53], [2.26, -1.26, -2.26, 1.26], [0.0, 0.0, 2.26, -1.26]]
)


@dataclass(frozen=True, kw_only=True)
class Monitor:
    """A monitor that looks at one fault mode.

    Attributes
    ----------
    name : str
    gain : float
        Steady-state statistic for a divergence of 1 m/s: ``|F2|`` [-] for GAST D, the square root of the
        non-centrality ``delta`` [s/m] for GAST F. It grows with d and with the filters' response.
    threshold : float
        Of the same quantity: [m/s], or the square root of the chi-square quantile [-].
    freedom : int
        Degrees of freedom; 0 for the GAST D monitor, which compares one Gaussian on both sides.
    sigma_mps : float
        Of the GAST D statistic; 1 for GAST F [m/s].
    """

    name: MonitorName
    gain: float
    threshold: float
    freedom: int
    sigma_mps: float = 1.0


def monitor_for(
    name: str, mode: str, *, error_on: ErrorOn | None = None, rounded: bool = False,
    threshold_mps: float = GROUND_THRESHOLD_MPS, receivers: int = 1,
) -> Monitor:  # fmt: skip
    """The monitor `name` as it sees `mode`.

    Parameters
    ----------
    name : {"gast-d", "gast-f-paper", "gast-f-sound"}
    mode : str
        One of :data:`gbas_core.ranging.fault_modes.FAULT_MODES`.
    error_on : {"L1", "L5", "IF"}, optional
        What the error is of; the GAST D monitor watches that band (both for IF, and the more sensitive one counts).
    rounded : bool
        Use the paper's rounded coefficients of eq (17) in the form "published".
    threshold_mps : float
        Of the GAST D monitor, whose sigma and threshold are those of the mean over receivers [m/s].
    receivers : int
        M, averaged by the GAST F monitors: the form "published" divides all of its covariance, the form "full_rank"
        only what is each receiver's own (:func:`gbas_ground.monitors.divergence_covariance.published_by_origin`).

    Raises
    ------
    StudyError
        For an unknown name or mode, and without receivers.
    """
    if receivers < 1:
        raise StudyError(f"receivers is {receivers}: at least one is needed")
    if name not in MONITORS:
        raise StudyError(f"monitor {name!r} is not one of {', '.join(MONITORS)}")
    direction = direction_of(mode)
    if name == "gast-d":
        rates = np.abs(direction[:2] - direction[2:])  # code less carrier of both bands
        seen = {"L1": rates[0], "L5": rates[1], "IF": rates.max()}[error_on or error_band(mode)]
        return Monitor(name="gast-d", gain=float(seen), threshold=threshold_mps, freedom=0, sigma_mps=GROUND_SIGMA_MPS)
    matrix = ROUNDED_EQ_17 if rounded else combination_matrix(L1, L5)
    means, covariance, freedom = matrix @ direction, PRINTED_COVARIANCE / receivers, 4
    if name == "gast-f-sound":
        means, covariance, freedom = means[list(INDEPENDENT)], _sound_covariance(receivers), 3
    delta = float(means @ np.linalg.pinv(covariance) @ means)
    form: Literal["published", "full_rank"] = "published" if freedom == 4 else "full_rank"
    limit = float(np.sqrt(threshold(form, P_FALSE_ALARM)))
    return Monitor(
        name="gast-f-paper" if freedom == 4 else "gast-f-sound",
        gain=float(np.sqrt(max(delta, 0.0))), threshold=limit, freedom=freedom,
    )  # fmt: skip


def _sound_covariance(receivers: int) -> FloatArray:
    """Of the mean over receivers, with a known receiver clock [(m/s)^2]."""
    one = np.ones(1)
    return np.asarray(published_by_origin().at(one, receivers * one, np.inf * one)[0])


def direction_of(mode: str) -> FloatArray:
    """Rates of code L1, code L5, carrier L1, carrier L5 for 1 m/s.

    Raises
    ------
    StudyError
        For an unknown mode.
    """
    try:
        return fault_direction(mode)
    except ValueError as error:
        raise StudyError(str(error)) from None


def error_band(mode: str) -> ErrorOn:
    """The band whose error a mode is judged by when nobody says: L1, unless only L5 is at fault."""
    members = FAULT_MODES[mode]
    return "L1" if members[0] or members[2] else "L5"


def error_on_of(text: str | None) -> ErrorOn | None:
    """What the error is of, by its name.

    Raises
    ------
    StudyError
        For another name.
    """
    if text is None:
        return None
    for each in get_args(ErrorOn):
        if text == each:
            return cast(ErrorOn, each)
    raise StudyError(f"error on {text!r} is not one of {', '.join(get_args(ErrorOn))}")


def cmc_rate(mode: str, error_on: ErrorOn) -> float:
    """Rate of code minus carrier of what the user smooths, for 1 m/s [-]."""
    direction = direction_of(mode)
    first, second = direction[:2] - direction[2:]
    if error_on == "IF":
        near, far = combination_matrix(L1, L5)[3, 2:]
        return float(near * first + far * second)
    return float(first if error_on == "L1" else second)


def one_sided_threshold_mps(sigma_mps: float = GROUND_SIGMA_MPS, p_false_alarm: float = P_FALSE_ALARM) -> float:
    """Threshold of a Gaussian statistic on one side [m/s]; 0.02393 for the paper's sigma and 1e-9."""
    return float(-ndtri(p_false_alarm) * sigma_mps)

"""Whether each monitor keeps each user within the range-domain requirement of GAST D, for each of the fifteen modes.

Error and expected statistic are both proportional to the rate of the divergence. At each time since the onset the
ratio of the statistic to the error of the worst user (any start of the air filter, at least the delay to incorporation
ago) is therefore a number of the mode alone; the smallest over all times is the mapping function. A monitor whose
missed detection falls with its statistic meets the requirement at every rate exactly if the mapping function is at
least the critical one. Its ratio to that is the margin, and 1 is just met.

Two users of a mode: *equal sizes*, as in the paper (+d on codes, -d on carriers), and *any sizes*: the combination of
the mode's measurements that gives the least statistic for its error. The paper says that rates are arbitrary, but
analyses equal ones only.

Source: ENC 2015, 5; requirement, GAST D range domain, ICAO NSP.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Final, get_args

import numpy as np

from gbas_core.ranging.combinations import combination_matrix, iono_free_weights
from gbas_core.ranging.divergence import ramp_response
from gbas_core.ranging.fault_modes import FAULT_MODES
from gbas_core.record import FloatArray
from gbas_core.signals import L1, L5
from gbas_ground.monitors.divergence_covariance import INDEPENDENT, PRINTED_COVARIANCE
from gbas_studies.ccd.missed_detection import critical_mapping_gast_d, critical_mapping_gast_f, p_md
from gbas_studies.ccd.monitors import (
    MONITORS,
    P_FALSE_ALARM,
    TAU_S,
    ErrorOn,
    MonitorName,
    cmc_rate,
    monitor_for,
)
from gbas_studies.ccd.smoothed_error import Smoothing, Start, largest_error_s

USERS: Final[tuple[ErrorOn, ...]] = get_args(ErrorOn)
TIME_TO_ALERT_S: Final = 1.5
"""From the statistic's passing of its threshold to the satellite's exclusion at the user. Known, GAST D."""
MALFUNCTION_M: Final = 1.6
P_INTEGRITY: Final = 1e-9
"""Malfunction of a ranging source with an error above :data:`MALFUNCTION_M` that is not told, a landing. Known."""
P_PRIOR: Final = 1e-4
"""Malfunctions of a satellite in a landing. Uncertain, ours, and cautious: GPS promises 1e-5 in an hour."""
_WATCH_S: Final = 400.0
_SPAN: Final = 1e-9  # of the largest eigenvalue: smaller ones are no statistic


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One mode, user and monitor.

    Attributes
    ----------
    mode, user, monitor : str
    mapping : float
        Smallest statistic over error [1/s] for GAST D, square root of the non-centrality over error [1/m] for GAST F;
        infinite where there is no error.
    critical : float
        The mapping that just meets the limit case.
    p_missed : float
        Largest probability that an error of :data:`MALFUNCTION_M` is missed [-].
    """

    mode: str
    user: ErrorOn
    monitor: MonitorName
    mapping: float
    critical: float
    p_missed: float

    @property
    def margin(self) -> float:
        """Mapping over the critical one [-]."""
        return self.mapping / self.critical

    @property
    def limit_case(self) -> bool:
        """Whether the curve of missed detection is kept at every rate and time."""
        return self.margin >= 1.0

    @property
    def malfunction_case(self) -> bool:
        """Whether an error above 1.6 m that is not told is improbable enough."""
        return self.p_missed * P_PRIOR <= P_INTEGRITY

    @property
    def met(self) -> bool:
        """Both."""
        return self.limit_case and self.malfunction_case


@cache
def response_over_error() -> float:
    """Smallest response of the filters over the worst user's error, for a rate of 1 m/s, over all times [1/s].

    Both starts of the air filter; the alert takes its time.
    """
    smallest = np.inf
    since_s = np.arange(0.0, _WATCH_S, Smoothing().interval_s)
    for start in get_args(Start):
        smoothing = Smoothing(start=start)
        error = largest_error_s(since_s, smoothing)
        seen = ramp_response((since_s - TIME_TO_ALERT_S) / smoothing.interval_s, smoothing.interval_s / TAU_S)
        some = error > _SPAN * error.max()
        smallest = min(smallest, float((seen[some] / error[some]).min()))
    return smallest


@cache
def critical_mapping(monitor: MonitorName) -> float:
    """Mapping that just meets the limit case, as :class:`Cell` has it."""
    if monitor == "gast-d":
        single = monitor_for(monitor, "Code L1")
        return critical_mapping_gast_d(single.sigma_mps, single.threshold)[0]
    squared, _ = critical_mapping_gast_f(
        "published" if monitor == "gast-f-paper" else "full_rank", P_FALSE_ALARM, power=2
    )
    return float(np.sqrt(squared))


def cell(mode: str, user: ErrorOn, name: MonitorName, *, any_sizes: bool = False) -> Cell:
    """Compliance of one user under one mode and monitor.

    Parameters
    ----------
    mode : str
    user : {"L1", "L5", "IF"}
    name : str
        Of the monitor; that of GAST D watches the user's band, and both bands for the ionosphere-free user.
    any_sizes : bool
        Let the mode's rates have the sizes that hide it best.
    """
    monitor = monitor_for(name, mode, error_on=user)
    if any_sizes:
        per_error = _least_statistic(mode, user, name)
    else:
        rate = abs(cmc_rate(mode, user))
        per_error = monitor.gain / rate if rate > _SPAN else np.inf
    mapping = per_error * response_over_error()
    missed = 0.0 if np.isinf(mapping) else float(p_md(monitor, mapping * MALFUNCTION_M))
    return Cell(mode=mode, user=user, monitor=name, mapping=mapping, critical=critical_mapping(name), p_missed=missed)


def cells(*, any_sizes: bool = False) -> list[Cell]:
    """All of them: modes, then monitors, then users."""
    return [
        cell(mode, user, monitor, any_sizes=any_sizes) for mode in FAULT_MODES for monitor in MONITORS for user in USERS
    ]


def _user_row(user: ErrorOn) -> FloatArray:
    """Rate of code minus carrier of what the user smooths, from the rates of the four measurements."""
    weights = {"L1": (1.0, 0.0), "L5": (0.0, 1.0), "IF": iono_free_weights(L1, L5)}[user]
    return np.array([*weights, *(-weight for weight in weights)])


def _least_statistic(mode: str, user: ErrorOn, name: MonitorName) -> float:
    """Smallest statistic in steady state over all sizes of the mode's rates with an error rate of 1 m/s.

    Returns
    -------
    float
        [-] for GAST D, [s/m] for GAST F; infinite where there is no error, 0 where it can be hidden altogether.
    """
    members = list(FAULT_MODES[mode])
    row = _user_row(user)[members]
    if not np.abs(row).max() > 0.0:
        return float("inf")
    if name == "gast-d":
        return _least_largest(row, np.array([_user_row("L1"), _user_row("L5")])[:, members]) if user == "IF" else 1.0
    matrix, covariance = combination_matrix(L1, L5)[:, members], PRINTED_COVARIANCE
    if name == "gast-f-sound":
        matrix, covariance = matrix[list(INDEPENDENT)], covariance[np.ix_(INDEPENDENT, INDEPENDENT)]
    form = matrix.T @ np.linalg.pinv(covariance) @ matrix
    values, vectors = np.linalg.eigh(form)
    along = vectors.T @ row
    silent = values <= _SPAN * values[-1]
    if (np.abs(along[silent]) > _SPAN).any():
        return 0.0
    return float(1.0 / np.sqrt((along[~silent] ** 2 / values[~silent]).sum()))


def _least_largest(row: FloatArray, bands: FloatArray) -> float:
    """Smallest of the larger rate of two bands where the user's is 1: at its corners, equal sizes or one alone."""
    seen = np.abs(bands).sum(axis=1) > 0.0  # bands the mode acts on
    first, second = (abs(weight) for weight in iono_free_weights(L1, L5))
    return float(1.0 / (seen @ np.array([first, second])))

"""What the phases of flight require of a position: accuracy, alert limits, time to alert.

Two tables: the paper's (Tables II and III), and the present one. Precision approaches of categories II and III have no
accuracy of their own in the present standards: the service is GAST-D, whose limits are those of the final approach
segment.

Sources: Sabatini, Moore, Hill, WASET 7 (2013), Tables II and III; ICAO Annex 10 Vol. I, 3.7.2.4 (known; the limits of
category I there are 35 to 10 m since Amendment 85), and the usual FASLAL 40 or 17 m and FASVAL 10 m (uncertain).
"""

from __future__ import annotations

import math
from typing import Annotated, Final, Literal, NamedTuple

import numpy as np

from gbas_airborne.abia.visibility.geometry import EstimatedErrors
from gbas_core.parameters import Parameter, parameters
from gbas_core.record import BoolArray

Phase = Literal["oceanic", "en_route", "terminal", "npa", "apv_1", "apv_2", "cat_1", "cat_2", "cat_3"]
Table = Literal["paper", "current"]

PAPER_SIGMA_UERE_M: Final = 33.3
"""The paper's, of the time of selective availability: no precision approach could be flown with it."""
_SIGMAS_OF_95: Final = 1.959964
"""Two-sided, of a normal error."""


class Requirement(NamedTuple):
    """What a phase requires; NaN where it requires nothing.

    Attributes
    ----------
    horizontal_m, vertical_m : float
        Accuracy, 95 % [m].
    hal_m, val_m : float
        Alert limits [m].
    time_to_alert_s : float
    """

    horizontal_m: float
    vertical_m: float
    hal_m: float
    val_m: float
    time_to_alert_s: float


_NONE: Final = math.nan
REQUIREMENTS: Final[dict[Table, dict[Phase, Requirement]]] = {
    # Where the paper gives a range (category I: 6 to 4 m, 15 to 10 m), the tighter end.
    "paper": {
        "oceanic": Requirement(3700.0, _NONE, 7400.0, _NONE, 300.0),
        "en_route": Requirement(3700.0, _NONE, 3700.0, _NONE, 15.0),
        "terminal": Requirement(740.0, _NONE, 1850.0, _NONE, 10.0),
        "npa": Requirement(220.0, _NONE, 556.0, _NONE, 10.0),
        "apv_1": Requirement(16.0, 20.0, 40.0, 50.0, 6.0),
        "apv_2": Requirement(16.0, 8.0, 40.0, 20.0, 6.0),
        "cat_1": Requirement(16.0, 4.0, 40.0, 10.0, 6.0),
        "cat_2": Requirement(6.9, 2.0, 17.3, 5.3, 1.0),
        "cat_3": Requirement(6.2, 2.0, 15.5, 5.3, 1.0),
    },
    "current": {
        "oceanic": Requirement(3700.0, _NONE, 7400.0, _NONE, 300.0),
        "en_route": Requirement(3700.0, _NONE, 3700.0, _NONE, 300.0),
        "terminal": Requirement(740.0, _NONE, 1850.0, _NONE, 15.0),
        "npa": Requirement(220.0, _NONE, 556.0, _NONE, 10.0),
        "apv_1": Requirement(16.0, 20.0, 40.0, 50.0, 10.0),
        "apv_2": Requirement(16.0, 8.0, 40.0, 20.0, 6.0),
        "cat_1": Requirement(16.0, 4.0, 40.0, 10.0, 6.0),
        "cat_2": Requirement(16.0, 4.0, 17.0, 10.0, 2.0),
        "cat_3": Requirement(16.0, 4.0, 17.0, 10.0, 2.0),
    },
}


@parameters
class GeometryCriteria:
    """When a geometry is too weak for a phase.

    Known: a range error of 7.1 m, one sigma, is that of single-frequency GPS without selective availability (Kaplan and
    Hegarty, 2nd edition, 7.2.9).
    """

    sigma_uere_m: Annotated[float, Parameter("of each range; the paper's is 33.3", "m", 0.01, 100.0)] = 7.1
    table: Annotated[Table, Parameter("of requirements")] = "current"
    phase: Annotated[Phase, Parameter("of flight")] = "terminal"

    @property
    def requirement(self) -> Requirement:
        """What the phase requires."""
        return REQUIREMENTS[self.table][self.phase]


def accuracy_missed(errors: EstimatedErrors, requirement: Requirement) -> BoolArray:
    """Whether the accuracy of 95 % is not met, horizontally or vertically; without a position it is not.

    Source: Sabatini et al., section IV.H, caution.

    Notes
    -----
    The paper compares one standard deviation with the accuracy of 95 %, and says "EHE exceeds the HA or the VA".
    """
    return _beyond(errors, _SIGMAS_OF_95, requirement.horizontal_m, requirement.vertical_m)


def alert_limit_exceeded(errors: EstimatedErrors, requirement: Requirement) -> BoolArray:
    """Whether the estimated error, 95 %, is beyond an alert limit; without a position it is.

    Source: Sabatini et al., section IV.H, warning.
    """
    return _beyond(errors, _SIGMAS_OF_95, requirement.hal_m, requirement.val_m)


def _beyond(errors: EstimatedErrors, factor: float, horizontal_m: float, vertical_m: float) -> BoolArray:
    """A comparison with a missing error never holds; one with a missing requirement is none."""
    within = factor * errors.ehe_m <= horizontal_m
    if not math.isnan(vertical_m):
        within = within & (factor * errors.eve_m <= vertical_m)
    return np.asarray(~within)

"""What phases of flight require: Tables II and III, equation (37)."""

from __future__ import annotations

import numpy as np

from gbas_airborne.abia.visibility.geometry import EstimatedErrors
from gbas_airborne.abia.visibility.requirements import (
    PAPER_SIGMA_UERE_M,
    REQUIREMENTS,
    GeometryCriteria,
    accuracy_missed,
)
from gbas_studies.reproduction.items import Claim, Section

_BEST_HDOP, _BEST_VDOP = 0.8, 1.1


def requirement_section() -> Section:
    """Accuracy and alert limits against range errors."""
    return Section(
        title="Accuracy and alert limits: Tables II and III, equation (37)",
        text="Both tables are in the suite as printed (the tighter end of ranges) beside the present requirements.",
        items=[
            _flyable("with the paper's range error", PAPER_SIGMA_UERE_M, "paper"),
            _flyable("with a present range error", GeometryCriteria().sigma_uere_m, "current"),
        ],
    )


def _flyable(name: str, sigma_m: float, table: str) -> Claim:
    errors = EstimatedErrors(
        *(np.array(sigma_m * each) for each in (np.hypot(_BEST_HDOP, _BEST_VDOP), _BEST_HDOP, _BEST_VDOP))
    )
    phases = REQUIREMENTS[table]  # type: ignore[index]
    met = [phase for phase, requirement in phases.items() if not accuracy_missed(errors, requirement)]
    precise = [phase for phase in met if phase.startswith(("apv", "cat"))]
    return Claim(
        name=f"precision approaches can be flown {name}",
        holds=bool(precise),
        paper_text="range errors of 33.3 m, and criteria up to category III",
        ours_text=f"{sigma_m:g} m: accuracy met for {', '.join(met)}",
        definition=f"1.96 sigma at the best dilution (HDOP {_BEST_HDOP:g}, VDOP {_BEST_VDOP:g}) against 95 % accuracy",
        why=(
            "33.3 m is of the time of selective availability: every precision approach would be flagged."
            if sigma_m > 10.0
            else "Single-frequency positions without augmentation do not reach them: that is what GBAS is for."
        ),
        new=sigma_m < 10.0,
    )

"""The 25-minute flight of the paper: climb, cruise, turn and descend, cruise, straight descent, five minutes each.

The paper gives the order and the times, an aircraft (a Tornado), and that the turn is a spiral of constant radius; its
flags in the turn come about 90 s apart. Speeds, heights and the number of turns are ours: three and a third turns in
the five minutes, which is one in 90 s.

Source: papers/abia.txt, section V and tables IV and V; the turn is from 600 to 900 s.
"""

from __future__ import annotations

import math
from typing import Final

from gbas_core.positioning.approach import FinalApproach
from gbas_sim.flight.dynamics.plan import FlightPlan, Start
from gbas_sim.flight.dynamics.segments import Climb, Cruise, Descent, Segment, StraightInApproach, Turn

PHASE_S: Final = 300.0
"""Duration of every phase [s]."""
_APPROACH_SPEED_MPS: Final = 85.0
# Turning through 360 degrees in 90 s.
_TURN_RAD: Final = math.radians(1200.0)


def five_phase_plan(*, start: Start | None = None, approach: FinalApproach | None = None) -> FlightPlan:
    """The flight of the paper, for the fighter.

    Parameters
    ----------
    start : Start, optional
        Where it begins, a few hundred metres above the ground. The last phase is then a descent to about that height.
    approach : FinalApproach, optional
        Where it ends. The last phase is then a straight-in approach to the threshold.

    Returns
    -------
    FlightPlan
        Of exactly 1500 s, laid out from whichever of the two is given.

    Raises
    ------
    ValueError
        When both or neither are given.
    """
    descent: Segment = Descent(height_loss_m=1300.0, duration_s=PHASE_S, blend_s=10.0)
    if approach is not None:
        descent = StraightInApproach(speed_mps=_APPROACH_SPEED_MPS, duration_s=PHASE_S, level_time_s=0.0)
    return FlightPlan(
        start=start,
        approach=approach,
        speed_mps=140.0,
        segments=(
            Climb(height_gain_m=4800.0, duration_s=PHASE_S, speed_mps=165.0),
            Cruise(duration_s=PHASE_S, speed_mps=150.0),
            Turn(
                heading_change_rad=_TURN_RAD,
                duration_s=PHASE_S,
                height_change_m=-3500.0,
                roll_rate_radps=math.radians(20.0),
                speed_mps=140.0,
            ),
            Cruise(duration_s=PHASE_S, speed_mps=_APPROACH_SPEED_MPS, configuration="landing"),
            descent,
        ),
    )

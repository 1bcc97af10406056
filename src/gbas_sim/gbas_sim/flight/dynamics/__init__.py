"""Flights by the equations of motion: an aircraft, a plan of manoeuvres, and what comes of flying it.

:class:`Flight` answers where the aircraft is and how it is turned at any time, as flown and as planned. How it comes
about, one subject a module: :mod:`segments` and :mod:`plan` say what is to be flown; :mod:`legs`, :mod:`approach_legs`
and :mod:`reference` lay it out in time and space; :mod:`trim` finds the controls this takes and refuses what the
aircraft cannot do; :mod:`guidance` steers along it and :mod:`motion` integrates the equations (:mod:`equations`) of an
aircraft (:mod:`aircraft`, :mod:`fleet`) in the standard atmosphere (:mod:`atmosphere`), the wind (:mod:`wind`) and over
the ellipsoid (:mod:`earth`); :mod:`gbas_core.gnss.attitude` turns motion and controls into attitude.

Times are since the start of the flight. Vectors are ``(..., 3)``. Angles are radians; headings are true, clockwise from
north; bank and roll are positive with the right wing down.
"""

from gbas_sim.flight.dynamics.aircraft import Aircraft
from gbas_sim.flight.dynamics.five_phase import five_phase_plan
from gbas_sim.flight.dynamics.fleet import AIRLINER, FIGHTER, FLEET, SMALL_UAV
from gbas_sim.flight.dynamics.flight import Flight, FlightState
from gbas_sim.flight.dynamics.plan import FlightPlan, Start
from gbas_sim.flight.dynamics.reference import Phase
from gbas_sim.flight.dynamics.segments import (
    Climb,
    Cruise,
    CurvedApproach,
    Descent,
    MissedApproach,
    Segment,
    StraightInApproach,
    Turn,
)
from gbas_sim.flight.dynamics.wind import Wind

__all__ = [
    "AIRLINER",
    "Aircraft",
    "Climb",
    "Cruise",
    "CurvedApproach",
    "Descent",
    "FIGHTER",
    "FLEET",
    "Flight",
    "FlightPlan",
    "FlightState",
    "MissedApproach",
    "Phase",
    "SMALL_UAV",
    "Segment",
    "Start",
    "StraightInApproach",
    "Turn",
    "Wind",
    "five_phase_plan",
]

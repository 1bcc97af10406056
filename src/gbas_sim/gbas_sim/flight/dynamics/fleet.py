"""Three aircraft to fly: a fighter of the paper's kind, an airliner, a small unmanned aircraft.

They are generic: their numbers come from public sources where there are any and are ours where there are none, which
each says. None is a performance model of the type it resembles.
"""

from __future__ import annotations

import math
from typing import Final

from gbas_sim.flight.dynamics.aircraft import Aircraft, Jet, Limits, Polar, Propeller, Response

# 1 lb/(lbf h).
_PER_HOUR_KGPNS: Final = 0.453_592_37 / (4.448_221_615_260_5 * 3600.0)

FIGHTER: Final = Aircraft(
    name="fighter",
    mass_kg=19_500.0,
    empty_mass_kg=14_400.0,
    wing_area_m2=26.6,
    brake_drag=0.06,
    clean=Polar(lift_zero=0.1, lift_slope_prad=4.45, lift_max=1.6, drag_zero=0.025, drag_induced=0.0584),
    landing=Polar(lift_zero=0.9, lift_slope_prad=4.45, lift_max=2.4, drag_zero=0.09, drag_induced=0.0584),
    engine=Jet(
        thrust_n=81_000.0,
        mach_square=0.7,
        density_exponent=1.235,
        idle=0.05,
        consumption_kgpns=0.9 * _PER_HOUR_KGPNS,
        consumption_mach_kgpns=0.3 * _PER_HOUR_KGPNS,
    ),
    response=Response(
        bank_s=0.5, roll_s=0.15, lift_s=0.3, thrust_s=2.0, lateral_radps=0.3, vertical_radps=0.4, along_radps=0.12
    ),
    limits=Limits(
        bank_rad=math.radians(75.0),
        roll_rate_radps=math.radians(90.0),
        load_factor_max=6.0,
        load_factor_min=-2.0,
        mach=0.85,
        height_m=15_000.0,
    ),
)
"""A swing-wing fighter-bomber with its wings forward, as the Tornado of the paper.

Wing area and span: papers/abia.txt, table I (26.6 m2, 13.91 m). Empty mass 14 091 kg (techno-science.net, Panavia
Tornado), rounded up for crew and pylons; 5100 kg of fuel (Graphic News GN38133, after Aviation Week); two engines of
40.5 kN without reheat (Deutsches Museum, Tornado). Thrust with pressure and ram, and fuel (0.9 + 0.3 M) sqrt(theta)
lb/(lbf h): Mattingly, Heiser and Pratt, 2nd edition, 2.3.2 and 3.3.2, low bypass, no reheat; the pressure ratio is the
density ratio to the power 1.235 below the tropopause. Ours: the polars (k from an Oswald factor of 0.75, lift slope of
a wing of aspect ratio 7.27 swept by 25 degrees), air brakes, idle, response, limits.
"""

AIRLINER: Final = Aircraft(
    name="airliner",
    mass_kg=62_000.0,
    empty_mass_kg=42_600.0,
    wing_area_m2=124.0,
    brake_drag=0.03,
    clean=Polar(lift_zero=0.2, lift_slope_prad=4.8, lift_max=1.5, drag_zero=0.018, drag_induced=0.039),
    landing=Polar(lift_zero=1.15, lift_slope_prad=4.8, lift_max=2.6, drag_zero=0.0396, drag_induced=0.035),
    engine=Jet(
        thrust_n=235_800.0,
        mach_linear=-1.0814,
        mach_square=0.6915,
        density_exponent=0.955,
        idle=0.07,
        consumption_kgpns=9.89e-6,
        consumption_mach_kgpns=9.73e-6,
    ),
    response=Response(
        bank_s=1.0, roll_s=0.3, lift_s=0.5, thrust_s=3.0, lateral_radps=0.2, vertical_radps=0.3, along_radps=0.1
    ),
    limits=Limits(
        bank_rad=math.radians(45.0),
        roll_rate_radps=math.radians(15.0),
        load_factor_max=2.5,
        load_factor_min=-1.0,
        mach=0.82,
        height_m=12_500.0,
    ),
)
"""A twin-jet of the A320's size.

Empty mass, wing area, limiting Mach number, ceiling, clean polar (0.018, 0.039), drag of the gear (0.017) and of flaps
at 35 degrees by the formulas of its drag module, idle (7 %): OpenAP 2.6 (Sun, Hoekstra and Ellerbroek, OpenAP: An
open-source aircraft performance model for air transportation studies and simulations, Aerospace 7 (2020) 104), A320
with CFM56-5B4. Thrust over Mach number: Bartel and Young, Simplified thrust and fuel consumption models for modern
two-shaft turbofan engines, J. Aircraft 45 (2008) 1450, equation (11) at sea level with a bypass ratio of 5.9 as OpenAP
has it; the density exponent meets the engine's published 22 241 N at Mach 0.8 and 35 000 ft. Fuel: through the
published 1.166 kg/s at 117.9 kN static (ICAO engine emissions databank, 2CM014) and 15.4 mg/(N s) at Mach 0.8 and
35 000 ft. Load factors: CS-25.337. Roll rate: that of the type's normal control law. Ours: the lift curves, air brakes,
mass, bank limit, response.
"""

SMALL_UAV: Final = Aircraft(
    name="small_uav",
    mass_kg=13.5,
    empty_mass_kg=9.4,
    wing_area_m2=0.55,
    clean=Polar(lift_zero=0.23, lift_slope_prad=5.61, lift_max=1.4, drag_zero=0.043, drag_induced=0.0232),
    landing=Polar(lift_zero=0.23, lift_slope_prad=5.61, lift_max=1.4, drag_zero=0.043, drag_induced=0.0232),
    engine=Propeller(power_w=1000.0, efficiency=0.7, static_thrust_n=45.0, consumption_kgpj=0.35 / 3.6e6),
    response=Response(
        bank_s=0.4, roll_s=0.1, lift_s=0.15, thrust_s=0.5, lateral_radps=0.5, vertical_radps=0.6, along_radps=0.3
    ),
    limits=Limits(
        bank_rad=math.radians(60.0),
        roll_rate_radps=math.radians(90.0),
        load_factor_max=3.5,
        load_factor_min=-1.0,
        mach=0.15,
        height_m=6000.0,
    ),
)
"""A small unmanned aircraft of the Aerosonde's kind, without flaps.

Wing, lift curve and drag (C_L0 0.23, C_L_alpha 5.61, C_D0 0.043, span 2.8956 m and Oswald factor 0.9): Beard and
McLain, Small Unmanned Aircraft (2012), appendix E, as revised in their mavsim. Mass 13 to 14 kg and 1 kW: table of the
Aerosonde Mark 2 (tomw.net.au/travel/ara, 1999). Fuel: 1.5 US gallons of petrol (press reports on NOAA's, 2008). Ours:
propeller and consumption (0.7, 350 g/(kW h), usual for small four-stroke engines), largest lift, response, limits.
"""

FLEET: Final = {aircraft.name: aircraft for aircraft in (FIGHTER, AIRLINER, SMALL_UAV)}
"""The three by name."""

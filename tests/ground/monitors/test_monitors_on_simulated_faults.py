"""Faults of the simulator on the four-receiver site: which monitor finds them, how soon, and who is blamed."""

from __future__ import annotations

import numpy as np
import pytest

from gbas_core.gnss.frames import geodetic_from_ecef, rot_enu_ecef
from gbas_core.satellites import SAT_INDEX
from gbas_core.signals import L1, L5
from gbas_ground.monitors.carrier_acceleration import (
    Carriers,
    carrier_acceleration_step,
    initial_carrier_acceleration,
)
from gbas_ground.monitors.double_difference import (
    Troposphere,
    carrier_residual_m,
    double_differences,
    reference_satellites,
)
from gbas_ground.monitors.ephemeris_residual import (
    Orbits,
    ephemeris_residual_step,
    initial_ephemeris_residual,
    site_decorrelation,
)
from gbas_ground.monitors.expected_power import (
    initial_power_expectation,
    power_expectation_step,
)
from gbas_ground.monitors.gradient_coverage import gradient_site
from gbas_ground.monitors.ionosphere_gradient import check_ionosphere_gradient
from gbas_sim.atmosphere.fronts import WedgeFront
from gbas_sim.atmosphere.troposphere import Troposphere as SimulatedTroposphere
from gbas_sim.faults.kinds import ExcessiveAcceleration, LowPower, OrbitFault
from gbas_sim.receivers.presets import receiver_preset
from gbas_sim.world import World, WorldParams
from monitor_scenes import BRAUNSCHWEIG_M, RUNWAY_RAD, STATION, simulated, station_gradient, station_of

AIR = Troposphere(refractivity=330.0, scale_height_m=7900.0)
BANDS, T, SETTLED, TIME_TO_ALERT_S = (L1, L5), 0.5, 12, 1.5
MONITORS = ("gradient", "acceleration", "power", "ephemeris")
FAULT_S = 8.0


def verdicts(*, seconds=12.0, seed=1, **threats):
    """Failed satellites of every monitor at every epoch, {monitor: (epochs, N)}, and the epochs."""
    world = World(
        WorldParams(
            receiver_ecef_m=tuple(map(tuple, BRAUNSCHWEIG_M.tolist())), flight=None, duration_s=seconds, seed=seed,
            ground=receiver_preset("gad_c"),
            troposphere=SimulatedTroposphere(
                refractivity=AIR.refractivity, scale_height_m=AIR.scale_height_m,
                reference_height_m=float(geodetic_from_ecef(BRAUNSCHWEIG_M[0])[2]),
            ),
            **threats,
        )
    )  # fmt: skip
    epochs = simulated(world, world.ephemeris, station_of(BRAUNSCHWEIG_M, "GE"))
    gradient = station_gradient()
    site = gradient_site(BRAUNSCHWEIG_M, BRAUNSCHWEIG_M[0], gradient)
    settings = (
        STATION.carrier_acceleration_monitor(),
        STATION.expected_power_monitor(),
        STATION.ephemeris_monitor(),
    )
    moved = initial_carrier_acceleration(4, settings[0])
    power = initial_power_expectation(4, settings[1])
    orbit = initial_ephemeris_residual(len(site.baselines), settings[2])
    found = {name: [] for name in MONITORS}
    for number, epoch in enumerate(epochs):
        dt, high = np.nan if number == 0 else T, epoch.elevation_rad
        due = np.isfinite(epoch.carrier_m[:, L1]) & (high >= np.radians(5.0)) & (number >= SETTLED)
        delay = AIR.delay_m(high, epoch.azimuth_rad, site.baselines.place_m)
        residual = carrier_residual_m(epoch.carrier_m, epoch.range_m, epoch.clock_s, delay, BANDS)
        references = reference_satellites(due.any(axis=0), high, gradient.references)
        made = double_differences(residual, site.baselines, references, high, gradient.noise, BANDS)
        result = check_ionosphere_gradient(made, due.any(axis=0), site, gradient)
        found["gradient"].append(result.verdict.failed & result.monitored)
        restarted = epoch.restarted[:, list(BANDS)]
        moved, each = carrier_acceleration_step(moved, Carriers(residual, restarted, due, high), dt, settings[0])
        found["acceleration"].append(each.failed_satellites)
        power, low = power_expectation_step(power, epoch.cn0_dbhz, due, high, dt, settings[1])
        found["power"].append(low.satellites.failed.any(axis=0))
        orbit, away = ephemeris_residual_step(orbit, Orbits(made, due.any(axis=0)), site.baselines, dt, settings[2])
        found["ephemeris"].append(away.failed)
    return {name: np.array(each) for name, each in found.items()}, epochs


def delay_s(failed, satellite):
    """From the onset of the fault to the epoch that fails; infinite if none does."""
    onset = round(FAULT_S / T)
    return failed[onset:, SAT_INDEX[satellite]].argmax() * T if failed[onset:, SAT_INDEX[satellite]].any() else np.inf


def only(failed, satellite):
    """Nobody before the fault, and nobody else."""
    onset = round(FAULT_S / T)
    return not failed[:onset].any() and not np.delete(failed, SAT_INDEX[satellite], axis=1).any()


def test_a_quiet_minute_has_no_alarm():
    found, _ = verdicts(seconds=30.0)
    assert not any(each.any() for each in found.values())


@pytest.mark.parametrize(
    ("growth", "seconds"),
    [
        ({"acceleration_mps2": 0.05}, 1.5),  # 56 mm in 1.5 s
        ({"acceleration_mps2": 0.4}, 1.0),  # what is 0.75 m off after two seconds
        ({"ramp_mps": 0.3}, 0.5),
        ({"step_m": 0.08}, 0.0),  # less than the slip detector's 0.1 m
    ],
)
@pytest.mark.parametrize("satellite", ["G06", "E14"])
def test_a_satellite_that_moves_is_found_in_time(growth, seconds, satellite):
    fault = ExcessiveAcceleration(satellite=satellite, start_s=FAULT_S, **growth)
    found, _ = verdicts(faults=(fault,))
    assert delay_s(found["acceleration"], satellite) <= seconds <= TIME_TO_ALERT_S
    assert only(found["acceleration"], satellite)
    # What all receivers see alike is no gradient.
    assert not found["gradient"].any()
    assert not found["ephemeris"].any()


def test_low_power_is_found_in_time():
    found, _ = verdicts(faults=(LowPower(satellite="G06", start_s=FAULT_S, drop_db=15.0),))
    assert delay_s(found["power"], "G06") <= TIME_TO_ALERT_S
    assert only(found["power"], "G06")


@pytest.mark.parametrize("edge", ["leading", "trailing"])
def test_a_front_that_moves_over_the_site(edge):
    """400 mm/km at 100 m/s along the runway, first seen by a receiver at FAULT_S: found when it has gone 200 m."""
    places = BRAUNSCHWEIG_M - BRAUNSCHWEIG_M[0]
    latitude, longitude, _ = geodetic_from_ecef(BRAUNSCHWEIG_M[0])
    along = (places @ rot_enu_ecef(latitude, longitude).T)[:, :2] @ [np.sin(RUNWAY_RAD), np.cos(RUNWAY_RAD)]
    first = float(along.min())
    front = WedgeFront(
        gradient=400e-6, width_m=25_000.0, direction_rad=float(RUNWAY_RAD), speed_mps=100.0, reference="baseline",
        start_m=first if edge == "leading" else first - 25_000.0, start_s=FAULT_S, edge=edge, satellites=("G06",),
    )  # fmt: skip
    found, _ = verdicts(fronts=(front,), seconds=20.0)
    assert delay_s(found["gradient"], "G06") <= 2.0 + TIME_TO_ALERT_S
    assert only(found["gradient"], "G06")
    assert delay_s(found["ephemeris"], "G06") <= 2.0 + TIME_TO_ALERT_S


def test_an_orbit_beyond_the_minimum_detectable_error():
    """Across the line of sight by a little more than P times the range that the site claims, in two directions."""
    found, epochs = verdicts(seconds=7.0)
    satellite = SAT_INDEX["E08"]
    elevation, azimuth = (each[[satellite]] for each in (epochs[-1].elevation_rad, epochs[-1].azimuth_rad))
    gradient = station_gradient()
    baselines = gradient_site(BRAUNSCHWEIG_M, BRAUNSCHWEIG_M[0], gradient).baselines
    p = site_decorrelation(baselines, elevation, azimuth, gradient.noise, STATION.ephemeris_monitor())
    error_m = 1.3 * float(p[0]) * float(epochs[-1].range_m[0, satellite])
    # along and cross are not quite across the line of sight: 1.3 allows for 40 degrees
    assert 1000.0 < error_m < 5000.0
    for direction in ("along_m", "cross_m"):
        fault = OrbitFault(satellite="E08", start_s=FAULT_S, **{direction: error_m})
        found, _ = verdicts(faults=(fault,))
        assert delay_s(found["ephemeris"], "E08") <= TIME_TO_ALERT_S
        assert only(found["ephemeris"], "E08")

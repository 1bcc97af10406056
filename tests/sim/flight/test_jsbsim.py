"""The equations of motion and the atmosphere against JSBSim, where that is installed.

JSBSim flies its own aircraft with six degrees of freedom. The forces it finds are given to our equations, which must
then follow its trajectory: same gravity, ellipsoid, Coriolis acceleration and axes, different code and formulation.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from gbas_core.gnss.frames import ecef_from_geodetic
from gbas_sim.flight.dynamics.atmosphere import standard_air
from gbas_sim.flight.dynamics.equations import (
    Surroundings,
    air_velocity,
    along_path,
    path_rates,
    place,
    position_rates,
)

jsbsim = pytest.importorskip("jsbsim", reason="jsbsim is not installed (pip install jsbsim); an optional cross-check")

FOOT_M, POUND_N, SLUG_KG, SLUG_FT3 = 0.3048, 4.4482216152605, 14.593902937206, 515.3788184
RATE_HZ = 240
COLUMNS = (
    *("simulation/sim-time-sec", "position/lat-geod-rad", "position/long-gc-rad", "position/geod-alt-ft"),
    *("velocities/v-east-fps", "velocities/v-north-fps", "velocities/v-down-fps"),
    *("attitude/phi-rad", "attitude/theta-rad", "attitude/psi-rad"),
    *("forces/fbx-total-lbs", "forces/fby-total-lbs", "forces/fbz-total-lbs", "inertia/mass-slugs"),
)


def flown(model: str, airspeed_mps: float, seconds: float) -> np.ndarray:
    """COLUMNS of a flight with a touch of aileron, at RATE_HZ."""
    jsbsim.FGJSBBase().debug_lvl = 0
    simulation = jsbsim.FGFDMExec(None)
    simulation.set_debug_level(0)
    assert simulation.load_model(model)
    simulation.set_dt(1.0 / RATE_HZ)
    start = {"lat-geod-deg": 52.0, "long-gc-deg": 10.0, "h-sl-ft": 3000.0 / FOOT_M, "psi-true-deg": 60.0}
    start |= {"vt-fps": airspeed_mps / FOOT_M, "gamma-deg": 0.0, "alpha-deg": 2.0}
    for key, value in start.items():
        simulation[f"ic/{key}"] = value
    simulation.run_ic()
    rows = [[simulation[name] for name in COLUMNS]]
    for _ in range(round(seconds * RATE_HZ)):
        simulation["fcs/aileron-cmd-norm"] = 0.1 if 2.0 < simulation.get_sim_time() < 5.0 else 0.0
        simulation["fcs/throttle-cmd-norm[0]"] = simulation["fcs/throttle-cmd-norm[1]"] = 0.7
        simulation.run()
        rows.append([simulation[name] for name in COLUMNS])
    return np.array(rows)


def specific_force_enu(rows: np.ndarray) -> CubicSpline:
    """Force per mass without gravity, east, north, up, over time."""
    roll, pitch, yaw = rows[:, 7:10].T
    zero, one = np.zeros_like(roll), np.ones_like(roll)

    def turn(*elements: np.ndarray) -> np.ndarray:
        return np.stack(elements, axis=-1).reshape(-1, 3, 3)

    about_x = turn(one, zero, zero, zero, np.cos(roll), -np.sin(roll), zero, np.sin(roll), np.cos(roll))
    about_y = turn(np.cos(pitch), zero, np.sin(pitch), zero, one, zero, -np.sin(pitch), zero, np.cos(pitch))
    about_z = turn(np.cos(yaw), -np.sin(yaw), zero, np.sin(yaw), np.cos(yaw), zero, zero, zero, one)
    force = (about_z @ about_y @ about_x @ rows[:, 10:13, np.newaxis])[..., 0] * POUND_N
    north_east_down = force / (rows[:, 13] * SLUG_KG)[:, np.newaxis]
    return CubicSpline(rows[:, 0], north_east_down[:, [1, 0, 2]] * [1.0, 1.0, -1.0])


def integrated(rows: np.ndarray, surroundings: Surroundings) -> np.ndarray:
    """Positions (n, 3) in ECEF, once a second, of our equations under JSBSim's forces."""
    force = specific_force_enu(rows)
    east, north, down = rows[0, 4:7] * FOOT_M
    speed = np.linalg.norm(rows[0, 4:7]) * FOOT_M
    begin = [speed, np.arcsin(-down / speed), np.arctan2(east, north), rows[0, 1], rows[0, 2], rows[0, 3] * FOOT_M]

    def rates(seconds: float, state: np.ndarray) -> list[np.ndarray]:
        velocity, climb, heading, lat, _, height = state
        here = place(surroundings, lat, height, air_velocity(velocity, climb, heading))
        push = along_path(tuple(force(seconds)), climb, heading)
        return [*path_rates(velocity, climb, heading, push, here), *position_rates(here, height)]

    solved = solve_ivp(
        rates, (0.0, rows[-1, 0]), begin, method="DOP853", rtol=1e-11, atol=1e-12, t_eval=rows[::RATE_HZ, 0]
    )
    return ecef_from_geodetic(solved.y[3], solved.y[4], solved.y[5])


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its aircraft write their own output files where they are started."""
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(("model", "airspeed_mps"), [("737", 150.0), ("A320", 150.0), ("c172x", 55.0)])
def test_our_equations_follow_jsbsim(model: str, airspeed_mps: float) -> None:
    rows = flown(model, airspeed_mps, 40.0)
    theirs = ecef_from_geodetic(rows[::RATE_HZ, 1], rows[::RATE_HZ, 2], rows[::RATE_HZ, 3] * FOOT_M)
    off = np.linalg.norm(integrated(rows, Surroundings()) - theirs, axis=1)
    # JSBSim steps by a low-order rule: half a step of 1/240 s at a few m/s^2 is 1 cm/s, some of it for long.
    assert off.max() < 0.15
    # Without the Earth's turning, as the paper has it, w V t^2 is 5 to 15 m: the test sees what it is to see.
    assert np.linalg.norm(integrated(rows, Surroundings(turning_earth=False)) - theirs, axis=1).max() > 1.0


def test_standard_air_is_jsbsims() -> None:
    simulation = jsbsim.FGFDMExec(None)
    simulation.set_debug_level(0)
    simulation.load_model("737")
    for height_m in (0.0, 3000.0, 9000.0, 13_000.0):
        simulation["ic/lat-geod-deg"] = 45.0
        simulation["ic/h-sl-ft"] = height_m / FOOT_M
        simulation.run_ic()
        air = standard_air(np.array(simulation["position/geod-alt-ft"] * FOOT_M))
        # JSBSim has the US standard atmosphere of 1976, whose gas constant and radius differ in the fifth digit.
        assert simulation["atmosphere/rho-slugs_ft3"] * SLUG_FT3 == pytest.approx(float(air.density_kgpm3), rel=1e-4)
        assert simulation["atmosphere/T-R"] / 1.8 == pytest.approx(float(air.temperature_k), rel=1e-5)

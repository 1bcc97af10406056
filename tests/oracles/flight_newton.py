"""Second formulation of a flight: Newton's law in turning Cartesian axes, by classical Runge-Kutta steps.

No climb angle, heading or local axes enter the integration: position and velocity are ECEF vectors, gravity is the
gradient of the closed formula of the normal potential, the wind is taken off the velocity, and lift stands on the
motion through the air. Only the three controls over time, and an aircraft's numbers, are given.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

A_M, F, GM, RATE = 6378137.0, 1.0 / 298.257223563, 3.986004418e14, 7.292115e-5
B_M = A_M * (1.0 - F)
E_M = np.sqrt(A_M**2 - B_M**2)


def normal_potential(xyz):
    """Normal gravity potential of WGS 84, closed formula (Heiskanen and Moritz 1967, equation 2-62)."""
    x, y, z = xyz
    r2 = x * x + y * y + z * z - E_M**2
    u2 = 0.5 * r2 * (1.0 + np.sqrt(1.0 + 4.0 * E_M**2 * z * z / r2**2))
    u = np.sqrt(u2)
    sin2_beta = z * z / u2
    q = 0.5 * ((1.0 + 3.0 * u2 / E_M**2) * np.arctan2(E_M, u) - 3.0 * u / E_M)
    q0 = 0.5 * ((1.0 + 3.0 * B_M**2 / E_M**2) * np.arctan2(E_M, B_M) - 3.0 * B_M / E_M)
    turning = 0.5 * RATE**2 * (x * x + y * y)
    return GM / E_M * np.arctan2(E_M, u) + 0.5 * RATE**2 * A_M**2 * q / q0 * (sin2_beta - 1.0 / 3.0) + turning


def gravity(xyz):
    """Gradient of the normal potential by central differences over 500 m (error below 1e-7 m/s2)."""
    step = 500.0
    steps = step * np.eye(3)
    return np.array([(normal_potential(xyz + s) - normal_potential(xyz - s)) / (2.0 * step) for s in steps])


def geodetic(xyz):
    """Latitude, longitude, height by plain iteration."""
    x, y, z = xyz
    e2 = F * (2.0 - F)
    p, lat = np.hypot(x, y), np.arctan2(z, np.hypot(x, y) * (1.0 - e2))
    for _ in range(8):
        n = A_M / np.sqrt(1.0 - e2 * np.sin(lat) ** 2)
        height = p * np.cos(lat) + z * np.sin(lat) - n * (1.0 - e2 * np.sin(lat) ** 2)
        lat = np.arctan2(z, p * (1.0 - e2 * n / (n + height)))
    return lat, np.arctan2(y, x), height


def density(height_m):
    """Standard density: the hydrostatic law in geopotential height, as ratios."""
    h = 6356766.0 * height_m / (6356766.0 + height_m)
    if h <= 11000.0:
        return 1.225 * (1.0 - h / 44330.76923) ** 4.2558797
    return 0.36391765 * np.exp(-(h - 11000.0) / 6341.6156)


def acceleration(xyz, velocity, mass, controls, aircraft, wind_enu):
    """Acceleration in turning axes, for controls (alpha, bank, pull, landing) and a wind(height) -> (east, north)."""
    alpha, bank, pull, landing = controls
    lat, lon, height = geodetic(xyz)
    east = np.array([-np.sin(lon), np.cos(lon), 0.0])
    up = np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])
    north = np.cross(up, east)
    w_east, w_north = wind_enu(height)
    through_air = velocity - w_east * east - w_north * north
    speed = np.linalg.norm(through_air)
    ahead = through_air / speed
    right = np.cross(ahead, up)
    right /= np.linalg.norm(right)
    above = np.cross(right, ahead)
    lift_way = np.cos(bank) * above + np.sin(bank) * right

    def blend(name):
        return (1.0 - landing) * getattr(aircraft.clean, name) + landing * getattr(aircraft.landing, name)

    push = 0.5 * density(height) * speed**2 * aircraft.wing_area_m2
    lift = blend("lift_zero") + blend("lift_slope_prad") * alpha
    drag = blend("drag_zero") + blend("drag_induced") * lift**2
    # The pull is above idling in what this is used for: all of it is thrust, along the fuselage.
    force = push * (lift * lift_way - drag * ahead) + pull * (np.cos(alpha) * ahead + np.sin(alpha) * lift_way)
    coriolis = 2.0 * RATE * np.array([velocity[1], -velocity[0], 0.0])
    return force / mass + gravity(xyz) + coriolis


def fly(
    position,
    velocity,
    times,
    controls: Callable[[np.ndarray], np.ndarray],
    mass,
    aircraft,
    wind_enu=lambda height: (0.0, 0.0),
):
    """Positions and velocities (n, 3) at evenly spaced times, one Runge-Kutta step from each to the next.

    ``controls(times)`` gives (n, 4) alpha, bank, pull, landing; ``mass(times)`` the mass.
    """
    step = times[1] - times[0]
    halves = np.arange(2 * len(times) - 1) * 0.5 * step + times[0]
    control, masses = controls(halves), mass(halves)
    state = np.concatenate([position, velocity])
    states = [state]

    def rate(state, index):
        pull = acceleration(state[:3], state[3:], masses[index], control[index], aircraft, wind_enu)
        return np.concatenate([state[3:], pull])

    for index in range(0, len(halves) - 1, 2):
        k1 = rate(state, index)
        k2 = rate(state + 0.5 * step * k1, index + 1)
        k3 = rate(state + 0.5 * step * k2, index + 1)
        k4 = rate(state + step * k3, index + 2)
        state = state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        states.append(state)
    states = np.array(states)
    return states[:, :3], states[:, 3:]

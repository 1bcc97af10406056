"""Is it the receiver or the satellites? Double differences made by hand, on the site of four receivers."""

from __future__ import annotations

import numpy as np
import pytest

from gbas_core.satellites import N_SATS
from gbas_core.signals import IONO_RATIO, L1, L5, WAVELENGTH_M
from gbas_ground.monitors.double_difference import DoubleDifferences, baselines_of
from gbas_ground.monitors.shared_receiver import across_m, planes_of, seen_quiet, shared_receiver
from monitor_scenes import DEMO_SITE_M

SITE = baselines_of(DEMO_SITE_M, DEMO_SITE_M.mean(axis=0))
BANDS = (L1, L5)
PLANES = planes_of(SITE, BANDS)
SIGMA_M, K = np.array([0.006, 0.011])[:, np.newaxis], 6.4
SEEN = np.arange(16)
DUE = np.isin(np.arange(N_SATS), SEEN)
AZIMUTH = 2.4 * np.arange(N_SATS)  # all around
ELEVATION = np.full(N_SATS, 0.7) + 0.4 * np.sin(np.arange(N_SATS))


def wrapped(value_m):
    wave = WAVELENGTH_M[list(BANDS)][:, np.newaxis]
    return value_m - wave * np.rint(value_m / wave)


def made(at_receivers_m, rng=None, baselines=SITE):
    """Double differences ``(B, F, N)`` of what each receiver sees on each satellite, ``(R, F, N)`` [m]."""
    noise = 0.0 if rng is None else rng.normal(0.0, 1.0, at_receivers_m.shape) * SIGMA_M / np.sqrt(2.0)
    seen = at_receivers_m + noise
    value = wrapped(seen[baselines.second] - seen[baselines.first])
    value = np.where(DUE, value, np.nan)
    sigma = np.broadcast_to(SIGMA_M, value.shape)
    return DoubleDifferences(
        residual_m=value, sigma_m=sigma, nominal_sigma_m=sigma, reference=np.zeros(value.shape, dtype=np.int64)
    )


def found(differences, planes=PLANES, least=3):
    return shared_receiver(differences, K * differences.sigma_m, planes, DUE, (ELEVATION, AZIMUTH), least)


def plane(gradient_enu, satellites):
    """Slant delays of a gradient (east, north) [m/m] on some satellites, carriers' sign."""
    at = np.zeros((4, 2, N_SATS))
    at[:, :, satellites] = -(SITE.place_m[:, :2] @ gradient_enu)[:, None, None] * IONO_RATIO[list(BANDS)][None, :, None]
    return at


def test_gains_bound_what_a_plane_can_do():
    """By trial: planes in all directions; the least of a receiver's baselines over the most of the others."""
    for receiver, planes in enumerate(PLANES):
        own = (SITE.first == receiver) | (SITE.second == receiver)
        largest = 0.0
        for turn in np.linspace(0.0, np.pi, 2000):
            size = np.abs(SITE.vector_m[:, 0] * np.sin(turn) + SITE.vector_m[:, 1] * np.cos(turn))
            largest = max(largest, size[own].min() / size[~own].max())
        assert largest <= planes.gain
    line = DEMO_SITE_M[0] + np.arange(4.0)[:, None] * (DEMO_SITE_M[1] - DEMO_SITE_M[0])
    for places in (DEMO_SITE_M[:3], line):
        assert all(np.isinf(each.gain) for each in planes_of(baselines_of(places, places[0]), BANDS))


@pytest.mark.parametrize("receiver", range(4))
def test_what_one_receiver_has_on_many_satellites_names_it(receiver):
    rng = np.random.default_rng(receiver)
    at = np.zeros((4, 2, N_SATS))
    at[receiver] = rng.uniform(-0.12, 0.12, N_SATS)  # as of a wrong survey: another one to each satellite
    result = found(made(at, rng))
    assert np.flatnonzero(result.receivers.failed).tolist() == [receiver]
    assert result.receivers.statistic[receiver] >= 3
    assert (np.delete(result.receivers.statistic, receiver) == 0).all()


def test_three_satellites_name_the_receiver_and_half_of_all_are_judged_without_it():
    for count, named, most in ((2, False, False), (3, True, False), (7, True, False), (8, True, True)):
        at = np.zeros((4, 2, N_SATS))
        at[1, :, SEEN[:count]] = 0.07
        result = found(made(at))
        assert result.receivers.failed.any() == named
        assert result.most == most


@pytest.mark.parametrize("bands", [1, 2])
def test_gradients_and_orbits_never_name_a_receiver(bands):
    """Planes through the receivers on 3, 8 and all satellites: 40 to 600 mm/km, every direction, with noise.

    The least size that a baseline of 700 m shows over 38 mm is 55 mm/km; whole wavelengths begin at 280 mm/km.
    """
    rng = np.random.default_rng(7)
    named = seen = 0
    for size in np.geomspace(100e-6, 600e-6, 12):
        for turn in np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False):
            for count in (3, 8, 16):
                scale = rng.uniform(0.4, 1.0, N_SATS)  # obliquity
                at = plane(size * np.array([np.sin(turn), np.cos(turn)]), SEEN[:count]) * scale
                differences = made(at, rng)
                differences.residual_m[:, bands:] = np.nan
                seen += bool((np.abs(differences.residual_m) > K * SIGMA_M).any())
                named += bool(found(differences).receivers.failed.any())
    assert seen > 2000
    assert named == 0


def test_independent_orbit_faults_name_nobody():
    rng = np.random.default_rng(8)
    for _ in range(500):
        at = np.zeros((4, 2, N_SATS))
        for satellite in SEEN[:6]:
            angle = rng.normal(0.0, 1e-4, 2)  # 2 km at 20 000 km
            at[:, :, satellite] = (SITE.place_m[:, :2] @ angle)[:, None]
        assert not found(made(at, rng)).receivers.failed.any()


def test_an_edge_at_one_antenna_hits_satellites_along_a_line_and_names_nobody():
    at = np.zeros((4, 2, N_SATS))
    at[2, :, SEEN[:4]] = 0.07
    differences = made(at)
    east = 0.6 * np.ones(N_SATS)
    args = (differences, K * differences.sigma_m, PLANES, DUE)
    along = np.where(np.arange(N_SATS) % 2, np.radians(60.0), np.radians(240.0))  # one vertical plane through the site
    assert not shared_receiver(*args, (east, along), 3).receivers.failed.any()
    assert shared_receiver(*args, (ELEVATION, AZIMUTH), 3).receivers.failed[2]


def test_width_of_pierce_points():
    """At 30 degrees the pierce point is 526 km away (350 km up, by the sine rule): a square of them."""
    four, turns = np.full(4, np.radians(30.0)), np.radians([0.0, 90.0, 180.0, 270.0])
    angle = np.pi / 2 - four[0] - np.arcsin(np.cos(four[0]) * 6371.0 / 6721.0)
    side = np.sqrt(2.0) * 6721e3 * angle
    assert across_m(four, turns) == pytest.approx(side, rel=1e-3)
    assert across_m(four[:2], turns[:2]) == 0.0


def test_with_two_or_three_receivers_nobody_is_named():
    for count in (1, 2, 3):
        site = baselines_of(DEMO_SITE_M[:count], DEMO_SITE_M[0])
        at = np.zeros((count, 2, N_SATS))
        at[-1] = 0.07
        assert not found(made(at, baselines=site), planes_of(site, BANDS)).receivers.failed.any()


def test_missing_is_neither_quiet_nor_wrong():
    at = np.zeros((4, 2, N_SATS))
    at[1, :, SEEN[:6]] = 0.07
    differences = made(at)
    differences.residual_m[5, :, SEEN] = np.nan  # rr3 with rr4: nobody knows whether they agree
    assert not found(differences).receivers.failed.any()


def test_quiet_is_seen_on_the_receivers_own_baselines():
    least = 3
    at = np.zeros((4, 2, N_SATS))
    at[0, :, 4] = 0.07
    quiet = [seen_quiet(made(at), K * made(at).sigma_m, SITE, receiver, least) for receiver in range(4)]
    # the satellite is wrong without rr2, rr3 and rr4 too, so it says nothing of them
    assert quiet == [False, True, True, True]
    nothing = made(np.full_like(at, np.nan))
    assert seen_quiet(nothing, K * nothing.sigma_m, SITE, 0, least) is None

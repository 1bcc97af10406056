"""Scintillation: where and when it is, how often and how long lock is lost, how deep satellites fade."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import ndtri
from scipy.stats import chi2, norm

from atmosphere_scene import moving, paths, satellites_at, spiral
from gbas_core.gnss.frames import ecef_from_geodetic
from gbas_core.gnss.gpstime import from_epoch_key
from gbas_core.satellites import N_SATS
from gbas_core.signals import FREQUENCY_HZ, L1, L5
from gbas_sim.atmosphere import scintillation
from gbas_sim.atmosphere.paths import SignalPaths, Station
from gbas_sim.atmosphere.scintillation import Scintillation, ScintillationParams, fading_db, magnetic_latitude_rad

HOUR_S = 3600.0
# The same everywhere and at all hours.
FLAT = {"crest_width_rad": 1e3, "equatorial_width_s": 1e9, "oval_width_rad": 1e3, "auroral_width_s": 1e9}
FALSE_ALARM = 1e-6
OVERHEAD = satellites_at(np.zeros(N_SATS), np.full(N_SATS, 0.5 * math.pi))
PLACES = [[0.0, 0.0, 0.0], [300.0, 0.0, 0.0]]


def at(key_ms: int, satellite_m=OVERHEAD) -> SignalPaths:
    """Paths of two receivers to satellites overhead at an epoch key."""
    week, tow_s = from_epoch_key(key_ms)
    now = paths(PLACES, satellite_m=satellite_m, tow_s=tow_s)
    assert week == now.gps_week
    return now


START_MS = 2400 * 604_800_000 + 100_000_000


def lost_at(times_ms, params: ScintillationParams, seed: int = 1) -> np.ndarray:
    """Losses (T, 2, N_SATS) at times after the start."""
    world = Scintillation(params=params, seed=seed)
    return np.array([world.epoch(at(START_MS + int(time)), (0, 1)).lost for time in times_ms])


# --- where and when


def test_magnetic_latitude():
    """A right angle from the pole less the great circle to it, by haversines; Boulder has 47.8 degrees (IGRF 2020)."""
    latitude, longitude = np.radians([40.0, -12.0, 67.9, 80.65, 5.0]), np.radians([-105.3, -77.0, 21.1, -72.68, 100.0])
    pole_latitude, pole_longitude = math.radians(80.65), math.radians(-72.68)
    haversine = np.sin(0.5 * (latitude - pole_latitude)) ** 2
    haversine = haversine + np.cos(latitude) * math.cos(pole_latitude) * np.sin(0.5 * (longitude - pole_longitude)) ** 2
    sphere = np.stack([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)])
    result = magnetic_latitude_rad(6.7e6 * sphere)
    np.testing.assert_allclose(result, 0.5 * math.pi - 2.0 * np.arcsin(np.sqrt(haversine)), atol=1e-7)
    assert math.degrees(result[0]) == pytest.approx(47.8, abs=0.5)
    assert math.degrees(result[3]) == pytest.approx(90.0, abs=1e-5)


def climate(latitude_deg: float, local_h: float) -> tuple[float, float]:
    """S4 and sigma_phi at the zenith of a place on the meridian of Greenwich, at the default parameters."""
    place = ecef_from_geodetic(math.radians(latitude_deg), 0.0, 0.0)
    station = Station(ecef_m=tuple(place.tolist()))
    overhead = satellites_at(np.zeros(N_SATS), np.full(N_SATS, 0.5 * math.pi), station)
    now = paths([[0.0, 0.0, 0.0]], satellite_m=overhead, tow_s=local_h * HOUR_S, station=station)
    s4, sigma_phi = Scintillation().indices(now)
    return float(s4[0, 0]), float(sigma_phi[0, 0])


def test_climate():
    """Aarons (1982): evenings at the crests, nights in the ovals; neither at middle latitudes or in the morning."""
    evening = [climate(latitude, 21.5)[0] for latitude in np.arange(-60.0, 61.0, 1.0)]
    # On this meridian the dipole's equator is 2.8 degrees south, sin(lat) = -cot(80.65 deg) cos(72.68 deg) of it.
    north, south = int(np.argmax(evening[60:])), int(np.argmax(evening[:60])) - 60
    assert (north, south) == (pytest.approx(12.2, abs=1.0), pytest.approx(-17.8, abs=1.0))
    assert max(evening) == pytest.approx(0.7, abs=0.01)
    assert climate(12.0, 9.0)[0] < 1e-6
    assert climate(50.0, 21.5)[0] < 0.01
    assert climate(65.0, 0.0)[1] > 0.25 > 0.1 > climate(65.0, 12.0)[1]
    assert climate(12.0, 0.0)[1] < 1e-6


def test_dip_latitude_of_a_site():
    """A shift of 12 degrees to the south moves the crests there: over Africa the dip equator is that far north."""
    now = paths([[0.0, 0.0, 0.0]], satellite_m=OVERHEAD, tow_s=20.8 * HOUR_S)
    params = ScintillationParams(crest_latitude_rad=math.radians(40.0))
    shifted = ScintillationParams(crest_latitude_rad=math.radians(40.0), latitude_shift_rad=math.radians(-12.0))
    latitude = math.degrees(magnetic_latitude_rad(now.pierce_ecef_m)[0, 0])
    ratio = Scintillation(params=shifted).indices(now)[0] / Scintillation(params=params).indices(now)[0]
    expected = math.exp(0.5 * ((latitude - 40.0) ** 2 - (latitude - 52.0) ** 2) / 8.0**2)
    assert ratio[0, 0] == pytest.approx(expected, rel=1e-9)


def test_towards_the_horizon():
    """S4 goes with the root of the obliquity until it saturates (ITU-R P.531-16, 5.5.1)."""
    params = ScintillationParams(equatorial_s4=0.4, auroral_sigma_phi_rad=0.9, **FLAT)
    azimuth, elevation = spiral()
    now = paths([[0.0, 0.0, 0.0]], satellite_m=satellites_at(azimuth, elevation))
    s4, sigma_phi = Scintillation(params=params).indices(now)
    slant = np.sqrt(now.shell.obliquity)
    # The curves are flat to the square of 1.6 rad over 1000.
    np.testing.assert_allclose(s4, 0.4 * slant, rtol=1e-5)
    np.testing.assert_allclose(sigma_phi, np.minimum(0.9 * slant, 1.0), rtol=1e-5)
    below = paths([[0.0, 0.0, 0.0]], satellite_m=satellites_at(azimuth, -elevation))
    epoch = Scintillation(params=params).epoch(below, (0,))
    assert not epoch.s4.any()
    assert not epoch.lost.any()
    assert not epoch.fading_db().any()


# --- losses of lock


@pytest.mark.parametrize(
    ("s4", "sigma_phi", "common_share"), [(1.0, 0.0, 0.0), (0.5, 0.0, 0.3), (0.6, 0.8, 0.5), (0.0, 0.7, 1.0)]
)
def test_share_of_time_lost(s4, sigma_phi, common_share):
    """Losses that come at rate r and last for d on average: lock is held with probability exp(-r d).

    Times are 11 mean durations apart, so that 17 in a million of a sample is left in the next. For receivers with
    common losses the sample is as large as one receiver's, at least.
    """
    rate_hz, mean_s = 0.3, 1.0
    params = ScintillationParams(
        equatorial_s4=s4,
        auroral_sigma_phi_rad=sigma_phi,
        loss_rate_hz=rate_hz,
        mean_loss_s=mean_s,
        common_share=common_share,
        **FLAT,
    )
    lost = lost_at(np.arange(600) * 11_000, params)
    share = 1.0 - math.exp(-rate_hz * (s4**2 + sigma_phi**2) * mean_s)
    deviation = math.sqrt(share * (1.0 - share) / (600 * N_SATS))
    for receiver in range(2):
        assert lost[:, receiver].mean() == pytest.approx(share, abs=norm.isf(0.5 * FALSE_ALARM) * deviation)


@pytest.mark.parametrize("mean_s", [0.5, 3.0])
def test_how_often_lock_is_lost_and_how_long(mean_s):
    """Epochs in lock before and not after, for pairs of epochs T apart and many durations from the next pair.

    With rho = r d losses under way on average, lock is held with exp(-rho), and no loss comes within T with
    exp(-rho (1 - exp(-T / d))) more that would not have lasted; so too the other way round.
    """
    rate_hz, apart_ms = 0.2, 500
    params = ScintillationParams(
        equatorial_s4=1.0, auroral_sigma_phi_rad=0.0, loss_rate_hz=rate_hz, mean_loss_s=mean_s, **FLAT
    )
    times = np.arange(400) * int(mean_s * 12_000) + 7
    before, after = lost_at(times, params)[:, 0], lost_at(times + apart_ms, params)[:, 0]
    rho = rate_hz * mean_s
    both_held = math.exp(-rho * (2.0 - math.exp(-0.001 * apart_ms / mean_s)))
    changed = math.exp(-rho) - both_held
    tolerance = norm.isf(0.5 * FALSE_ALARM) * math.sqrt(changed * (1.0 - changed) / before.size)
    assert (~before & after).mean() == pytest.approx(changed, abs=tolerance)
    assert (before & ~after).mean() == pytest.approx(changed, abs=tolerance)


@pytest.mark.parametrize("common_share", [0.0, 0.6, 1.0])
def test_common_losses(common_share):
    """Two receivers are in lock at once with exp(-r d (2 - q)), q being the share that strikes both."""
    params = ScintillationParams(
        equatorial_s4=1.0,
        auroral_sigma_phi_rad=0.0,
        loss_rate_hz=0.3,
        mean_loss_s=1.0,
        common_share=common_share,
        **FLAT,
    )
    lost = lost_at(np.arange(400) * 11_000, params)
    held = math.exp(-0.3 * (2.0 - common_share))
    tolerance = norm.isf(0.5 * FALSE_ALARM) * math.sqrt(held * (1.0 - held) / (400 * N_SATS))
    assert (~lost).all(axis=1).mean() == pytest.approx(held, abs=tolerance)
    if common_share == 1.0:
        np.testing.assert_array_equal(lost[:, 0], lost[:, 1])


def test_satellites_and_blocks_are_independent():
    """Counts of losses in 600 epochs over satellites: as scattered as a binomial distribution's."""
    params = ScintillationParams(
        equatorial_s4=1.0, auroral_sigma_phi_rad=0.0, loss_rate_hz=0.3, mean_loss_s=1.0, common_share=0.0, **FLAT
    )
    lost = lost_at(np.arange(600) * 11_000, params)
    for sample in (lost[:, 0], lost[:, 0].T):
        count, size = sample.sum(axis=0), sample.shape[0]
        share = count.mean() / size
        statistic = ((count - count.mean()) ** 2).sum() / (size * share * (1.0 - share))
        low, high = chi2.ppf([0.5 * FALSE_ALARM, 1.0 - 0.5 * FALSE_ALARM], count.size - 1)
        assert low < statistic < high


def test_no_scintillation_no_loss():
    params = ScintillationParams(equatorial_s4=0.0, auroral_sigma_phi_rad=0.0, loss_rate_hz=1.0, **FLAT)
    assert not lost_at(range(0, 200_000, 1000), params).any()


# --- any epoch by itself


def test_any_epoch_by_itself():
    """The same bits in any order, from anew, and for a receiver whatever others there are."""
    params = ScintillationParams(equatorial_s4=0.8, loss_rate_hz=0.5, **FLAT)
    world = Scintillation(params=params, seed=9)
    times = [0, 59_999, 61_000, 500, 3_600_000, 119_500]
    first = [world.epoch(at(START_MS + time), (0, 100)) for time in times]
    for index in reversed(range(len(times))):
        scintillation._block.cache_clear()
        scintillation._window.cache_clear()
        again = Scintillation(params=params, seed=9).epoch(at(START_MS + times[index]), (100, 3))
        np.testing.assert_array_equal(again.lost[0], first[index].lost[1])
        np.testing.assert_array_equal(again.deviate[0], first[index].deviate[1])
    assert any(epoch.lost.any() for epoch in first)
    other = Scintillation(params=params, seed=10).epoch(at(START_MS), (0, 100))
    assert not np.array_equal(other.deviate, first[0].deviate)


def test_blocks_join():
    """A millisecond before a block and at its start: 136 paths at 1 loss a second and 3 s are one change in 4."""
    params = ScintillationParams(equatorial_s4=1.0, loss_rate_hz=0.5, mean_loss_s=3.0, **FLAT)
    boundary = 60_000 - START_MS % 60_000
    lost = lost_at([boundary - 1, boundary], params)
    assert lost[0].any()
    assert (lost[0] != lost[1]).sum() <= 4  # a Poisson number of mean 0.27: 1e-5


# --- fading


@pytest.mark.parametrize("s4", [0.2, 0.5, 0.8, 1.0])
def test_fading_has_the_s4_asked_for(s4):
    """Mean power 1 and its standard deviation S4, of epochs two correlation times apart.

    With m = 1 / S4^2 the variance of a squared deviation from the mean is (2 + 6 / m) / m^2.
    """
    params = ScintillationParams(equatorial_s4=s4, auroral_sigma_phi_rad=0.0, correlation_s=0.5, **FLAT)
    world = Scintillation(params=params, seed=4)
    fading = np.array([world.epoch(at(START_MS + 1000 * k), (0, 1)).fading_db() for k in range(300)])
    power = 10.0 ** (-0.1 * fading)
    size, limit = power.size, norm.isf(0.5 * FALSE_ALARM)
    assert power.mean() == pytest.approx(1.0, abs=limit * s4 / math.sqrt(size))
    assert ((power - 1.0) ** 2).mean() == pytest.approx(
        s4**2, abs=limit * s4**2 * math.sqrt((2.0 + 6.0 * s4**2) / size)
    )


def test_fading_at_known_probabilities():
    """Rayleigh: power below p with probability 1 - exp(-p). S4^2 = 1/2: 1 - (1 + 2p) exp(-2p)."""
    power = np.array([0.01, 0.1, 1.0, 3.0])
    deviate = ndtri(-np.expm1(-power))
    np.testing.assert_allclose(fading_db(np.ones(4), deviate), [20.0, 10.0, 0.0, -4.771212547], atol=1e-6)
    deviate = ndtri(1.0 - (1.0 + 2.0 * power) * np.exp(-2.0 * power))
    expected = -10.0 * np.log10(power)
    np.testing.assert_allclose(fading_db(np.full(4, math.sqrt(0.5)), deviate), expected, atol=1e-6)
    assert (fading_db(np.ones(3), np.array([-30.0, -9.0, -40.0])) == 40.0).all()
    assert not fading_db(np.full(3, 0.009), np.array([-3.0, 0.0, 3.0])).any()


def test_fading_is_continuous():
    """Deviates turn by a right angle in a correlation time: 1.6 % in 10 ms of 1 s, of numbers of up to 5."""
    world = Scintillation(params=ScintillationParams(**FLAT), seed=4)
    start = START_MS - START_MS % 60_000
    deviates = np.array([world.epoch(at(start + 10 * k), (0, 1)).deviate for k in range(300)])
    assert np.abs(np.diff(deviates, axis=0)).max() < 0.5 * math.pi * 0.01 * 5.0 * math.sqrt(2.0)


def test_other_frequencies():
    """S4 goes with the frequency to the power -1.5: 1.55 times as much on L5."""
    params = ScintillationParams(equatorial_s4=0.4, auroral_sigma_phi_rad=0.0, **FLAT)
    epoch = Scintillation(params=params, seed=4).epoch(at(START_MS), (0, 1))
    scaled = 0.4 * (FREQUENCY_HZ[L1] / FREQUENCY_HZ[L5]) ** 1.5
    np.testing.assert_allclose(epoch.fading_db(L5), fading_db(np.full((2, N_SATS), scaled), epoch.deviate), rtol=1e-4)


def test_losses_are_of_the_paths_there_are():
    """Five receivers, one each row; numbers out of order do not matter."""
    now = moving()
    params = ScintillationParams(equatorial_s4=1.0, loss_rate_hz=1.0, mean_loss_s=10.0, **FLAT)
    epoch = Scintillation(params=params, seed=2).epoch(now, (3, 1, 0, 2, 100))
    assert epoch.lost.shape == epoch.s4.shape == epoch.deviate.shape == (5, N_SATS)
    assert epoch.lost.mean() > 0.9
    with pytest.raises(ValueError, match="2 receivers for paths of shape \\(5, 3\\)"):
        Scintillation(params=params).epoch(now, (0, 1))


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("equatorial_s4", 1.5),
        ("loss_rate_hz", -1.0),
        ("mean_loss_s", 0.0),
        ("common_share", 1.1),
        ("correlation_s", 0.0),
    ],
)
def test_refusals(key, value):
    with pytest.raises(ValueError, match=f"^{key} = "):
        ScintillationParams(**{key: value})

"""The quiet ionosphere: its day, its gradients as drawn, its obliquity, and what two receivers make of them."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.stats import chi2, norm

from atmosphere_scene import STATION, derivative, moving, paths, satellites_at, spiral
from gbas_core.models.error_models import iono_obliquity, sigma_iono_m
from gbas_core.satellites import N_SATS
from gbas_sim.atmosphere.ionosphere import Ionosphere, IonosphereParams
from gbas_sim.atmosphere.paths import Station

AZIMUTH, ELEVATION = spiral()
NOTHING = IonosphereParams(night_delay_m=0.0, day_delay_m=0.0, sigma_vig=0.0)
GRADIENT_ONLY = IonosphereParams(night_delay_m=0.0, day_delay_m=0.0, sigma_vig=4e-6)
DAY_ONLY = IonosphereParams(sigma_vig=0.0)


# --- day


def klobuchar_m(local_s: np.ndarray, params: IonosphereParams) -> np.ndarray:
    """Vertical delay of IS-GPS-200N 20.3.3.5.2.5, figure 20-4, with a constant amplitude and period."""
    x = 2.0 * math.pi * ((local_s - params.peak_local_s + 43_200.0) % 86_400.0 - 43_200.0) / params.period_s
    series = 1.0 - x**2 / 2.0 + x**4 / 24.0
    return params.night_delay_m + np.where(np.abs(x) < 1.57, params.day_delay_m * series, 0.0)


def test_day_is_klobuchars():
    """The message's series is 0.0200 too high where it ends, at 1.57; elsewhere less."""
    overhead = satellites_at(np.zeros(N_SATS), np.full(N_SATS, 0.5 * math.pi))
    for tow_s in np.arange(0.0, 86_400.0, 1800.0):
        now = paths([[0.0, 0.0, 0.0]], satellite_m=overhead, tow_s=tow_s)
        delay_m = Ionosphere(params=DAY_ONLY).delay(now).delay_m[0, 0]
        local_s = tow_s + math.degrees(now.pierce_longitude[0][0, 0]) * 240.0
        expected = klobuchar_m(np.array(local_s), DAY_ONLY)
        assert delay_m == pytest.approx(float(expected), abs=0.0201 * DAY_ONLY.day_delay_m)


def test_height_of_the_day_and_night():
    """At 45 degrees east it is 14 h local time at 11 h, and at 23 h deep in the night."""
    east = Station(ecef_m=(4.0e6, 4.0e6, 3.0e6))
    overhead = satellites_at(np.zeros(N_SATS), np.full(N_SATS, 0.5 * math.pi), east)
    for hours, expected in ((11.0, 6.0), (23.0, 1.5)):
        now = paths([[0.0, 0.0, 0.0]], satellite_m=overhead, tow_s=3600.0 * hours, station=east)
        # The satellite on the ellipsoid's vertical pierces the shell a few kilometres beside the meridian.
        assert Ionosphere(params=DAY_ONLY).delay(now).delay_m[0, 0] == pytest.approx(expected, abs=1e-6)


def test_obliquity_at_each_receiver():
    params = IonosphereParams(night_delay_m=2.0, day_delay_m=0.0, sigma_vig=0.0)
    delay_m = Ionosphere(params=params).delay(paths([[0.0, 0.0, 0.0]])).delay_m[0]
    np.testing.assert_allclose(delay_m, 2.0 * iono_obliquity(ELEVATION), rtol=1e-12)


# --- gradient


def differences(seed: int, enu_m: tuple[float, float, float], params=GRADIENT_ONLY) -> np.ndarray:
    """Differential carrier of two receivers, less what obliquity makes of the vertical, over the obliquity."""
    now = paths([[0.0, 0.0, 0.0], list(enu_m)])
    carrier_m = -Ionosphere(params=params, seed=seed).delay(now).delay_m
    return (carrier_m[0] - carrier_m[1]) / now.shell.obliquity[1]


@pytest.mark.parametrize("direction_deg", [0.0, 90.0, 37.0])
def test_gradient_has_the_sigma_asked_for(direction_deg):
    """Between two receivers, in any direction; bounds of the variance and the mean for a false alarm of 1e-6."""
    distance_m, seeds = 5000.0, range(100)
    direction = math.radians(direction_deg)
    enu_m = (distance_m * math.sin(direction), distance_m * math.cos(direction), 0.0)
    sample = np.concatenate([differences(seed, enu_m) for seed in seeds]) / distance_m
    assert sample.size == 6800
    low, high = chi2.ppf([5e-7, 1.0 - 5e-7], sample.size) / sample.size
    assert low < (sample**2).mean() / 4e-6**2 < high
    assert abs(sample.mean()) < norm.isf(5e-7) * 4e-6 / math.sqrt(sample.size)


def test_gradients_towards_east_and_north_are_independent():
    """Correlation of 6800 pairs, for a false alarm of 1e-6."""
    gradient = np.concatenate([Ionosphere(params=GRADIENT_ONLY, seed=seed).gradient for seed in range(100)], axis=1)
    assert abs(np.corrcoef(gradient)[0, 1]) < norm.isf(5e-7) / math.sqrt(gradient.shape[1])


def test_difference_is_what_protection_levels_allow_for():
    """F_pp sigma_vig x of RTCA DO-253 2.3.12.3, satellite by satellite, for a distance of 20 km.

    The aircraft sees satellites 3.1 mrad lower or higher than the station, 20 km over the radius of the Earth. The
    obliquity changes by F^2 (Re / (Re + h))^2 sin(E) cos(E) of itself a radian: by 1.5 at most, at 17 degrees.
    """
    now = paths([[0.0, 0.0, 0.0], [20_000.0, 0.0, 0.0]])
    iono = Ionosphere(params=GRADIENT_ONLY, seed=3)
    delay_m = iono.delay(now).delay_m
    expected = iono.gradient[0] / 4e-6 * sigma_iono_m(4e-6, ELEVATION, 20_000.0, 0.0, 100.0, mask_rad=0.0)
    np.testing.assert_allclose(delay_m[1] - delay_m[0], expected, rtol=4.8e-3)


def test_gradient_over_pierce_points():
    """With "pierce" two receivers on one path to a satellite have one vertical delay, whatever their heights."""
    params = IonosphereParams(night_delay_m=1.0, day_delay_m=0.0, sigma_vig=4e-6, gradient_reference="pierce")
    ground = paths([[0.0, 0.0, 0.0]])
    above = STATION.axes @ (6000.0 * ground.los[0, :, 9])
    now = paths([[0.0, 0.0, 0.0], above])
    delay_m = Ionosphere(params=params, seed=5).delay(now).delay_m
    assert delay_m[1, 9] == pytest.approx(delay_m[0, 9], abs=1e-10)
    assert np.abs(delay_m[1] - delay_m[0]).max() > 1e-3


def test_seeds():
    assert (Ionosphere(seed=7).gradient == Ionosphere(seed=7).gradient).all()
    assert not (Ionosphere(seed=7).gradient == Ionosphere(seed=8).gradient).any()
    assert not Ionosphere(params=NOTHING, seed=7).delay(moving()).delay_m.any()


# --- rates


@pytest.mark.parametrize("reference", ["baseline", "ray", "pierce"])
@pytest.mark.parametrize("tow_s", [20_000.0, 45_000.0, 80_000.0])
def test_rate(reference, tow_s):
    params = IonosphereParams(sigma_vig=50e-6, gradient_reference=reference)
    now = dataclasses.replace(moving(), tow_s=tow_s)
    iono = Ionosphere(params=params, seed=2)
    expected = derivative(lambda p: iono.delay(p).delay_m, now)
    np.testing.assert_allclose(iono.delay(now).rate_mps, expected, rtol=1e-8, atol=1e-11)


@pytest.mark.parametrize(
    ("key", "value"),
    [("night_delay_m", -1.0), ("period_s", 0.0), ("sigma_vig", math.nan), ("gradient_reference", "earth")],
)
def test_refusals(key, value):
    with pytest.raises(ValueError, match=f"^{key} = "):
        IonosphereParams(**{key: value})

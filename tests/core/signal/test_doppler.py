"""Doppler: differences of ranges, the carrier-phase rate and Doppler of recorded data, and recorded C/N0."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from gbas_core.gnss.ephemeris import Ephemeris, EphemerisStore
from gbas_core.gnss.frames import azimuth_elevation, ecef_from_geodetic, geodetic_from_ecef, rot_enu_ecef
from gbas_core.gnss.orbits import predicted_state, rotated_range, transmit_state
from gbas_core.io.rinex import ObservationFile, read_navigation, read_observations
from gbas_core.signal.doppler import doppler_hz, range_rate_mps
from gbas_core.signal.link_budget import TransmitBudget
from gbas_core.signals import FREQUENCY_HZ, L1, L2, L5, SPEED_OF_LIGHT_MPS, WAVELENGTH_M

WAVELENGTHS_M = WAVELENGTH_M[:, np.newaxis]


class Recorded(NamedTuple):
    """A still receiver: its observations, and Doppler and elevations computed for it."""

    observed: ObservationFile
    ephemeris: Ephemeris
    place_m: np.ndarray
    doppler_hz: np.ndarray
    elevation_rad: np.ndarray


@pytest.fixture(scope="module")
def recorded(data_dir: Path) -> Recorded:
    folder = data_dir / "static_pair_L1L5_2024"
    observed = read_observations(folder / "base.obs.gz")
    week, tow_s = observed.first
    store = EphemerisStore()
    for ephemeris in read_navigation(folder / "base.nav.gz").received(week, tow_s):
        store = store.add(ephemeris)
    ephemeris = store.usable(week, tow_s, 0.0)
    lat_deg, lon_deg, height_m = (float(each) for each in (folder / "base_position.txt").read_text().split())
    place = ecef_from_geodetic(np.radians(lat_deg), np.radians(lon_deg), height_m)
    places = np.broadcast_to(place, (len(observed), 3))
    state = transmit_state(ephemeris, week, observed.tow_s[:, np.newaxis], observed.code_m[:, L1])
    lat, lon, _ = geodetic_from_ecef(place)
    _, los = rotated_range(places, state.position_m)
    return Recorded(
        observed=observed,
        ephemeris=ephemeris,
        place_m=place,
        doppler_hz=doppler_hz(places, np.zeros((len(observed), 3)), state),
        elevation_rad=azimuth_elevation(rot_enu_ecef(lat, lon) @ los)[1],
    )


def after_clock(residual_hz: np.ndarray) -> np.ndarray:
    """The receiver's clock drift is common to all satellites of an epoch."""
    return residual_hz - np.nanmedian(residual_hz, axis=1, keepdims=True)


@pytest.mark.parametrize("band", [L1, L2, L5])
def test_recorded_doppler(recorded, band):
    """All satellites the receiver reports, down to 1.3 degrees of elevation: below 0.5 Hz rms."""
    residual = after_clock((recorded.observed.doppler_hz - recorded.doppler_hz)[:, band])
    assert np.isfinite(residual).any(axis=0).sum() >= 8
    assert np.sqrt(np.nanmean(residual**2)) < 0.5


@pytest.mark.parametrize("band", [L1, L2, L5])
def test_rate_of_the_recorded_carrier(recorded, band):
    """Differences over a second, with the mean of both ends computed. What is above 5 degrees is below 0.1 Hz."""
    steps_s = np.diff(recorded.observed.tow_s)[:, np.newaxis, np.newaxis]
    rate_hz = -np.diff(recorded.observed.carrier_m, axis=0) / WAVELENGTHS_M / steps_s
    middle = 0.5 * (recorded.doppler_hz[1:] + recorded.doppler_hz[:-1])
    residual = after_clock((rate_hz - middle)[:, band])
    assert np.sqrt(np.nanmean(residual**2)) < 0.5
    high = recorded.elevation_rad[0] > np.radians(5.0)
    assert np.sqrt(np.nanmean(residual[:, high] ** 2)) < 0.1


def test_rate_is_the_difference_of_ranges(recorded):
    """Of an aircraft at 250 m/s; over 0.2 s, whose second differences leave 1 mm/s."""
    week, tow_s = recorded.observed.first
    velocity = np.array([150.0, -100.0, 170.0])
    step_s = 0.1
    times = tow_s + step_s * np.array([-1.0, 0.0, 1.0])
    places = recorded.place_m + velocity * step_s * np.array([[-1.0], [0.0], [1.0]])
    state = predicted_state(recorded.ephemeris, week, times[:, np.newaxis], places, None)
    range_m, _ = rotated_range(places, state.position_m)
    middle = predicted_state(recorded.ephemeris, week, times[1], places[1], None)
    rate = range_rate_mps(middle, *rotated_range(places[1], middle.position_m), places[1], velocity)
    known = np.isfinite(rate)
    assert known.sum() >= 15
    np.testing.assert_allclose(rate[known], ((range_m[2] - range_m[0]) / (2 * step_s))[known], atol=1e-3)


def test_bands_and_clocks(recorded):
    """Doppler goes with the frequency; a fast receiver's clock makes all satellites recede."""
    week, tow_s = recorded.observed.first
    state = predicted_state(recorded.ephemeris, week, tow_s, recorded.place_m)
    still = doppler_hz(recorded.place_m, np.zeros(3), state)
    ratio = still[L5] / still[L1]
    np.testing.assert_allclose(ratio[np.isfinite(ratio)], 115.0 / 154.0, rtol=1e-12)
    fast = doppler_hz(recorded.place_m, np.zeros(3), state, clock_drift=1e-7)
    known = np.isfinite(still[L1])
    np.testing.assert_allclose((fast - still)[L1, known], -1e-7 * FREQUENCY_HZ[L1], atol=1e-6)
    assert SPEED_OF_LIGHT_MPS / WAVELENGTH_M[L1] == FREQUENCY_HZ[L1]


@pytest.mark.parametrize("band", [L1, L5])
def test_cn0_rises_with_elevation_as_recorded(recorded, band):
    """The level depends on antenna and cables, which are not known; the trend with elevation is the budget's.

    After one offset 3 dB rms: antennas' patterns differ by that, and satellites' powers by up to 4 dB.
    """
    measured = np.ma.masked_invalid(recorded.observed.cn0_dbhz[:, band])
    recorded_dbhz = measured.mean(axis=0).filled(np.nan)
    expected_dbhz = TransmitBudget(antenna="patch", beam="flat").cn0_dbhz(recorded.elevation_rad[0])[band]
    used = np.isfinite(recorded_dbhz) & (recorded.elevation_rad[0] > np.radians(5.0))
    difference = (recorded_dbhz - expected_dbhz)[used]
    assert used.sum() >= 8
    assert np.std(difference) < 3.0
    slope = np.polyfit(expected_dbhz[used], recorded_dbhz[used], 1)[0]
    assert 0.4 < slope < 1.6

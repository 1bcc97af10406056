"""Antennas and link budget: the paper's numbers, geometry by another route, one budget by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gbas_core.satellites import IS_GPS, N_SATS
from gbas_core.signal.antenna import ANTENNAS, AntennaPattern, Cn0Curve, LinkBudget, oxygen_loss_db, slant_range_m
from gbas_core.signals import L1, L2, L5


def at(*elevation_deg: float) -> np.ndarray:
    return np.radians(np.array(elevation_deg))[:, np.newaxis] * np.ones(N_SATS)


def test_fighter_antenna_is_the_papers():
    gains = ANTENNAS["fighter"].gain_at_dbic(np.radians([10.0, 90.0]))
    np.testing.assert_allclose(gains, [-3.0, 3.5], atol=1e-3)  # Sabatini et al., figure 11


def test_limiting_antenna_keeps_the_ground_out():
    """Lopez: 30 dB between what comes from above 5 degrees and from as far below, of both polarisations."""
    pattern = ANTENNAS["mla"]
    for elevation_deg in (10.0, 20.0, 40.0):
        above = pattern.gain_at_dbic(math.radians(elevation_deg))
        below = max(
            pattern.gain_at_dbic(-math.radians(elevation_deg)), pattern.cross_at_dbic(-math.radians(elevation_deg))
        )
        assert above - below >= 30.0


def test_oxygen_is_the_path_through_a_shell():
    height, radius = 6.0, 6378.0
    elevation = np.radians([0.0, 3.0, 5.0, 10.0, 40.0, 90.0])
    # From the triangle of centre, receiver and top of the shell.
    path = -radius * np.sin(elevation) + np.sqrt((radius * np.sin(elevation)) ** 2 + height**2 + 2.0 * height * radius)
    np.testing.assert_allclose(oxygen_loss_db(elevation), 0.035 * path / height, rtol=1e-9)


def test_distances():
    """Law of sines in the triangle of centre, receiver and satellite."""
    elevation = at(5.0, 30.0, 90.0)
    orbit = np.where(IS_GPS, 26_559_700.0, 29_599_800.0)
    nadir = np.arcsin(6_378_137.0 / orbit * np.cos(elevation))
    at_centre = 0.5 * math.pi - elevation - nadir
    expected = np.sqrt(orbit**2 + 6_378_137.0**2 - 2.0 * orbit * 6_378_137.0 * np.cos(at_centre))
    np.testing.assert_allclose(slant_range_m(elevation), expected, rtol=1e-9)
    # Sabatini et al.: distance alone makes 2.1 dB between zenith and edge.
    edge, zenith = slant_range_m(at(0.0, 90.0))
    assert 20.0 * math.log10(edge[0] / zenith[0]) == pytest.approx(2.1, abs=0.1)


def test_budget_by_hand():
    budget = LinkBudget(antenna="patch")
    # N0: 10 log10(1.380649e-23 (130 + 290 (10^0.3 - 1))) = -228.599 + 10 log10(418.6) = -202.381 dBW/Hz.
    assert budget.noise_dbwphz == pytest.approx(-202.381, abs=1e-3)
    zenith = budget.cn0_dbhz(at(90.0))[0]
    assert zenith[L1, 0] == pytest.approx(-156.5 + 5.0 + 202.381 - 1.5, abs=1e-3)
    assert zenith[L5, 0] == pytest.approx(-152.0 + 5.0 + 202.381 - 1.5, abs=1e-3)
    assert zenith[L1, 40] == pytest.approx(-155.25 + 5.0 + 202.381 - 1.5, abs=1e-3)
    assert zenith[L5, 40] == pytest.approx(-153.25 + 5.0 + 202.381 - 1.5, abs=1e-3)
    assert np.isnan(zenith[L2]).all()
    # At 5 degrees: the antenna's -4.5 dBic for 5, and air 0.035 (10.3 - 1) dB more.
    low = budget.cn0_dbhz(at(5.0))[0]
    assert zenith[L1, 0] - low[L1, 0] == pytest.approx(9.5 + 0.035 * 9.3, abs=0.02)


def test_beam_of_the_paper():
    """Eq (14): 2.54 dB less at the horizon, and the distance on top."""
    shaped, paper = (
        LinkBudget(antenna="isotropic", beam=beam).cn0_dbhz(at(0.0, 90.0)) for beam in ("isoflux", "paper")
    )
    np.testing.assert_allclose(paper[1, L1], shaped[1, L1])
    assert shaped[0, L1, 0] - paper[0, L1, 0] == pytest.approx(2.5413 + 2.1, abs=0.1)


def test_a_banking_antenna_loses_gain_not_power():
    budget = LinkBudget(antenna="patch")
    level, banked = budget.cn0_dbhz(at(40.0)), budget.cn0_dbhz(at(40.0), at(10.0))
    pattern = ANTENNAS["patch"]
    expected = float(pattern.gain_at_dbic(math.radians(40.0)) - pattern.gain_at_dbic(math.radians(10.0)))
    np.testing.assert_allclose((level - banked)[:, L1], expected)


def test_curve():
    cn0 = Cn0Curve(zenith_dbhz=(50.0, 52.0), horizon_dbhz=(37.0, 39.0)).cn0_dbhz(at(0.0, 30.0, 90.0))
    np.testing.assert_allclose(cn0[:, L1, 5], [37.0, 43.5, 50.0])
    np.testing.assert_allclose(cn0[:, L5, 50], [39.0, 45.5, 52.0])
    assert np.isnan(cn0[:, L2]).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: LinkBudget(antenna="dish"),
            "antenna = 'dish' is not one of isotropic, mla, patch, fighter",
        ),
        (lambda: LinkBudget(noise_figure_db=-1.0), "noise_figure_db = -1 is not within 0 to 20 dB"),
        (lambda: LinkBudget(gps_dbw=(-160.0,)), "gps_dbw = (-160.0,) has not the right number of values"),
        (lambda: Cn0Curve(zenith_dbhz=(50.0, 99.0)), "zenith_dbhz = 99 is not within 0 to 80 dB-Hz"),
        (
            lambda: AntennaPattern(name="x", elevation_deg=(0.0, 90.0), gain_dbic=(0.0, 0.0), cross_dbic=(0.0, 0.0)),
            "antenna x: elevation_deg = (0.0, 90.0) does not go from -90 to 90",
        ),
    ],
)
def test_bad_parameters_are_refused(make, message):
    with pytest.raises(ValueError) as error:
        make()
    assert message in str(error.value)

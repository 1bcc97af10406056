"""Y_EIG and M_EIG: what a site's gradient monitor supports, and nothing smaller."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gbas_core.parameters import ParameterError
from gbas_ground.claims.gradient_claim import coverage_by_elevation, gradient_claim
from gbas_ground.claims.limits import MAX_M_EIG, MAX_Y_EIG_M
from gbas_ground.monitors.carrier_noise import CarrierNoise
from gbas_ground.monitors.gradient_coverage import gradient_site
from gbas_ground.monitors.gradient_detectability import BaselineMonitor, coverage_percent
from gbas_ground.monitors.ionosphere_gradient import IonosphereGradientParams
from monitor_scenes import BRAUNSCHWEIG_M, RUNWAY_RAD, braunschweig_station, station_of

QUIET = {"carrier_noise": {"floor_m": [0.0004] * 3, "low_m": [0.003] * 3}}  # antennas that limit multipath
FULL = {"min_coverage": 1.0, "runway_bearing_deg": [84.73]}
TYPE_D = {"enabled": True, "y_eig_m": 1.3, "m_eig": 0.3e-3}


def site_of(count: int, params: IonosphereGradientParams):
    station = station_of(BRAUNSCHWEIG_M[:count], "G")
    return gradient_site(station.receiver_positions_m(), station.reference_point_m(), params)


def test_the_published_bound_follows_from_300_mm_per_km() -> None:
    """ICAO: E_IG of 2.75 m at 5 km; 300 mm/km x (5 km + 2 x 30 s x 70 m/s) = 2.76 m. Fields in steps of 0.1."""
    params = IonosphereGradientParams(
        runway_bearing_rad=(RUNWAY_RAD,), min_coverage=1.0, noise=CarrierNoise(floor_m=(3e-4,) * 3, low_m=(1e-3,) * 3)
    )
    claim = gradient_claim(site_of(4, params), params, excludes=True, tau_s=30.0)
    assert claim.largest_undetected == 300e-6
    assert (claim.y_eig_m, claim.m_eig) == (pytest.approx(1.3), pytest.approx(0.3e-3))
    assert 2.75 <= claim.y_eig_m + claim.m_eig * 5000.0 <= 2.81  # 1.26 m rounded up to 1.3 m


@pytest.mark.parametrize("elevation_deg", [20.0, 45.0, 90.0])
def test_coverage_is_that_of_the_intervals(elevation_deg: float) -> None:
    """One band and one runway, from projected lengths and sigmas written out."""
    params = IonosphereGradientParams(runway_bearing_rad=(RUNWAY_RAD,), carriers=("L1",))
    site = site_of(3, params)
    along = site.baselines.vector_m[:, :2] @ [np.sin(RUNWAY_RAD), np.cos(RUNWAY_RAD)]
    one, other = (0.0012 + 0.010 * np.exp(-each / 20.0) for each in (elevation_deg, 30.0))
    # 5 %: the monitor rounds sigmas up by at most this factor
    shares = [
        0.01
        * coverage_percent(
            [
                BaselineMonitor(length_m=abs(float(each)), sigma_m=factor * float(np.sqrt(2.0 * (one**2 + other**2))))
                for each in along
            ],
            site.k_ffd + site.k_md,
        )
        for factor in (1.05, 1.0)
    ]
    ours = float(coverage_by_elevation(site, params, np.radians([elevation_deg]))[0])
    assert shares[0] <= ours <= shares[1]


@pytest.mark.parametrize(
    ("count", "sections", "expected"),
    [
        (2, {"gast_d": TYPE_D}, "gast_d.y_eig_m = 1.3 is below what the site's gradient monitor supports (nothing: "),
        (
            4,
            {"gast_d": TYPE_D},
            "with ionosphere_gradient.min_coverage = 0, gradients up to 2000 mm/km may go undetected",
        ),
        (2, {"gast_d": TYPE_D, "ionosphere_gradient": FULL}, "the baselines detect at most 5"),
        (
            4,
            {"gast_d": TYPE_D, "ionosphere_gradient": {**FULL, "exclude": False}, **QUIET},
            "ionosphere_gradient.exclude is false",
        ),
        (
            4,
            {"gast_d": {**TYPE_D, "y_eig_m": 1.2}, "ionosphere_gradient": FULL, **QUIET},
            "y_eig_m = 1.2 is below what the site's",
        ),
        (
            4,
            {"gast_d": {**TYPE_D, "y_eig_m": 1.2}, "ionosphere_gradient": FULL, **QUIET},
            "(1.3 m: all of 300 to 2000 mm/km",
        ),
        (
            4,
            {"gast_d": {**TYPE_D, "m_eig": 0.2e-3}, "ionosphere_gradient": FULL, **QUIET},
            "gast_d.m_eig = 0.0002 is below",
        ),
        (4, {"gast_d": {**TYPE_D, "y_eig_m": 3.0}}, "gast_d.m_eig = 0.0003 is below"),
        (
            4,
            {"gast_d": TYPE_D, "ionosphere_gradient": {**FULL, "gradient_range": [500e-6, 2000e-6]}, **QUIET},
            "(2.1 m: all of 500 to 2000 mm/km",
        ),
        (4, {"station": {"gcid": 2}}, "station.gcid = 2 claims service type D"),
    ],
)
def test_smaller_bounds_are_refused_by_name(count: int, sections: dict, expected: str) -> None:
    with pytest.raises(ParameterError) as caught:
        braunschweig_station(count, **sections)
    assert str(caught.value).startswith("site.yaml: ")
    assert expected in str(caught.value)


@pytest.mark.parametrize(
    ("count", "sections"),
    [
        (2, {"gast_d": {"enabled": True}}),  # the largest values claim nothing
        (4, {"gast_d": TYPE_D, "ionosphere_gradient": FULL, **QUIET}),
        (
            4,
            {
                "gast_d": {**TYPE_D, "y_eig_m": 2.1, "m_eig": 0.5e-3},
                "ionosphere_gradient": {**FULL, "gradient_range": [5e-4, 2e-3]},
                **QUIET,
            },
        ),
        (
            2,
            {
                "gast_d": {**TYPE_D, "y_eig_m": 2.6, "m_eig": 0.6e-3},
                "ionosphere_gradient": {"gradient_range": [3e-4, 6e-4]},
            },
        ),
    ],
    ids=["largest", "full coverage", "range begins at 500", "range ends at 600"],
)
def test_supported_bounds_are_accepted_as_given(count: int, sections: dict) -> None:
    station = braunschweig_station(count, **sections)
    given = sections["gast_d"]
    assert station.gast_d.y_eig_m == given.get("y_eig_m", MAX_Y_EIG_M)
    assert station.gast_d.m_eig == given.get("m_eig", MAX_M_EIG)


def test_claims_without_type_d_are_not_looked_at() -> None:
    """They are not broadcast either."""
    station = braunschweig_station(1, gast_d={"enabled": False, "y_eig_m": 0.5, "m_eig": 0.1e-3})
    assert station.station_message().adb3 is None


def test_longer_filters_and_faster_aircraft_need_more() -> None:
    params = replace(IonosphereGradientParams(runway_bearing_rad=(RUNWAY_RAD,)), gradient_range=(3e-4, 3.1e-4))
    site = site_of(4, params)
    slow, fast, long = (
        gradient_claim(site, params, excludes=True, tau_s=tau, speed_mps=speed).y_eig_m
        for tau, speed in ((30.0, 70.0), (30.0, 82.0), (100.0, 40.0))
    )
    # 310 mm/km over 2 tau v of 4.2, 4.92 and 8 km, in steps of 0.1 m
    assert (slow, fast, long) == (pytest.approx(1.4), pytest.approx(1.6), pytest.approx(2.5))

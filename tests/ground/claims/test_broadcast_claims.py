"""What a station's claims rest on, told in words, and the designator its monitors support."""

from __future__ import annotations

import pytest

from gbas_core.parameters import replaced
from gbas_ground.claims.broadcast_claims import orbit_claim, statements, supported_gcid, unsupported
from gbas_ground.sections import GCID_UNHEALTHY
from monitor_scenes import braunschweig_station

FULL = {
    "gast_d": {"enabled": True, "y_eig_m": 1.3, "m_eig": 0.3e-3},
    "ionosphere_gradient": {"min_coverage": 1.0, "runway_bearing_deg": [84.73]},
    "carrier_noise": {"floor_m": [0.0004] * 3, "low_m": [0.003] * 3},
}


def test_a_station_that_knows_nothing_says_so() -> None:
    station = braunschweig_station(1, station={"gcid": GCID_UNHEALTHY})
    assert statements(station) == (
        "designator A (assumed)",
        "sigma_vig 25.5 mm/km (largest)",
        "P 0.001275 (not monitored)",
        "no threat model of ionospheric fronts: protection levels do not bound errors in a front",
        "1 receiver: no B values",
        "gcid 7: no service",
    )


def test_a_monitored_station_says_by_what() -> None:
    station = braunschweig_station(4, atmosphere={"sigma_vert_iono_gradient": 4.0e-6}, accuracy={"designator": "C"})
    told = statements(station)
    assert told[0] == "designator C (by the sigma monitor)"
    assert told[1] == "sigma_vig 4 mm/km (declared)"
    assert told[2].endswith("to 0.00036 (ephemeris monitor)")
    assert told[-1] == "gcid 1 (by the monitors)"


def test_an_external_monitor_is_named() -> None:
    station = braunschweig_station(2, ephemeris={"p": 1.5e-4, "external_monitor": "network of Europe"})
    assert "P 0.00015 (network of Europe)" in statements(station)
    assert orbit_claim(station).source == "external"


def test_type_d_says_what_bounds_gradients() -> None:
    assert "Y_EIG 1.3 m, M_EIG 0.3 m/km (gradient monitor)" in statements(braunschweig_station(4, **FULL))
    largest = braunschweig_station(4, gast_d={"enabled": True})
    assert "Y_EIG 3 m, M_EIG 0.7 m/km (largest)" in statements(largest)


@pytest.mark.parametrize(
    ("count", "sections", "gcid"),
    [
        (4, {}, 1),
        (3, {}, 1),
        (4, FULL, 2),
        (4, {"gast_d": {"enabled": True}}, 1),  # no bound on gradients
        (2, {}, 7),  # orbits in one direction only
        (2, {"ephemeris": {"p": 1.5e-4, "external_monitor": "SBAS"}}, 1),
        (1, {"ephemeris": {"p": 1.5e-4, "external_monitor": "SBAS"}}, 7),  # no B values
        (4, {"receivers": {"minimum": 1}}, 7),
        (4, {"ephemeris_residual": {"exclude": False}}, 7),
        (4, {"ccd": {"exclude": False}}, 7),
        (4, {"carrier_acceleration": {"exclude": False}}, 7),
        (4, {"ionosphere_gradient": {"exclude": False}}, 7),
        (4, {"sigma_monitor": {"exclude": False}}, 7),
        (4, {"signal_power": {"require_cn0": False}}, 7),
    ],
)
def test_designator_follows_from_the_monitors(count: int, sections: dict, gcid: int) -> None:
    assert supported_gcid(braunschweig_station(count, **sections)) == gcid


def test_a_designator_that_is_only_declared_is_called_so() -> None:
    one = braunschweig_station(1)
    assert list(unsupported(one)) == [
        "no B values: receivers.minimum is 1", "ionosphere_gradient does not exclude", "orbits are not monitored",
    ]  # fmt: skip
    assert statements(one)[-1].startswith("gcid 1 (declared; no B values: receivers.minimum is 1; ")
    no_bound = replaced(braunschweig_station(4, gast_d={"enabled": True}), {"station.gcid": 2})
    assert statements(no_bound)[-1] == "gcid 2 (declared; no bound on gradients)"

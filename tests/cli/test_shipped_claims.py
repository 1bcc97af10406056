"""Every configuration the suite ships claims what its monitors support, and the document says the same."""

from __future__ import annotations

from pathlib import Path

import pytest

from claims_table import row, shipped_files, shipped_stations, table
from gbas_ground.claims.broadcast_claims import orbit_claim, supported_gcid
from gbas_ground.claims.limits import MAX_DECORRELATION, MAX_M_EIG, MAX_Y_EIG_M
from gbas_ground.params import GroundParams
from gbas_ground.sections import GCID_UNHEALTHY, MAX_SIGMA_VIG

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "validation.md"
NOMINAL_SIGMA_VIG = 4.0e-6
"""Of ordinary days at mid-latitudes. Source: papers of the modes (DLR), L1."""

STATIONS = tuple(shipped_stations())
IDS = [f"{name}-{station.n_receivers}" for name, station in STATIONS]


def test_all_configurations_are_looked_at() -> None:
    assert {path.stem for path in shipped_files()} == {name for name, _ in STATIONS}
    assert len(shipped_files()) >= 14


@pytest.mark.parametrize(("name", "station"), STATIONS, ids=IDS)
def test_nothing_is_claimed_that_is_not_monitored(name: str, station: GroundParams) -> None:
    claim = orbit_claim(station)
    if claim.source == "none":
        assert claim.at_zenith == claim.at_mask == pytest.approx(MAX_DECORRELATION)
    assert claim.source != "external"  # none is known of any site the suite ships
    assert station.station.gcid in (GCID_UNHEALTHY, supported_gcid(station))
    if not station.gast_d.enabled:
        assert (station.gast_d.y_eig_m, station.gast_d.m_eig) == (MAX_Y_EIG_M, MAX_M_EIG)
    assert station.atmosphere.sigma_vert_iono_gradient in (NOMINAL_SIGMA_VIG, MAX_SIGMA_VIG), name


@pytest.mark.parametrize("count", [1, 2, 3])
def test_station_of_recorded_data_claims_no_service(count: int) -> None:
    station = next(each for name, each in STATIONS if name == "nominal_station" and each.n_receivers == count)
    message = station.station_message()
    # the largest values the fields can carry: ICAO Annex 10 vol. I, tables B-62 to B-66
    assert (message.gcid, message.sigma_vert_iono_gradient) == (GCID_UNHEALTHY, 25.5e-6)
    assert (message.refractivity_uncertainty, message.adb1.k_md_e_c_gps) == (255.0, 12.75)


def test_document_has_the_table() -> None:
    """Printed by ``python tests/scenes/claims_table.py``; not typed."""
    assert table() in DOCUMENT.read_text(encoding="utf-8")


def test_table_tells_claims_apart() -> None:
    rows = {row(name, station).split(" | ", 1)[1] for name, station in STATIONS}
    assert len(rows) >= 4  # a monitored site, and one, two and three receivers of an unknown one

"""Prints the table of broadcast claims in docs/validation.md: ``python tests/scenes/claims_table.py``."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from gbas_bringup.resources import config_path
from gbas_chain.process import NOMINAL_STATION
from gbas_core.gnss.frames import geodetic_from_ecef
from gbas_ground.claims.broadcast_claims import orbit_claim, supported_gcid
from gbas_ground.params import GroundParams
from gbas_ground.sections import MAX_SIGMA_VIG
from gbas_sim.scenario import read_sections
from monitor_scenes import BRAUNSCHWEIG_M

HEADER = (
    "| configuration | receivers | P, zenith to mask | rests on | σ_vig | Y_EIG, M_EIG | gcid | supported |",
    "|---|---|---|---|---|---|---|---|",
)
SOURCES = {"monitor": "ephemeris monitor", "external": "declared monitor", "none": "not monitored"}


def shipped_files() -> list[Path]:
    """All configurations of the suite, the scenarios last."""
    folder = config_path(NOMINAL_STATION).parent
    return sorted(folder.glob("*.yaml")) + sorted(folder.glob("scenarios/*.yaml"))


def nominal_station(count: int) -> GroundParams:
    """The station of recorded data with some receivers of the demo's site, as ``gbas process`` makes it."""
    sections: dict[str, Any] = {
        name: dict(values) for name, values in read_sections(config_path(NOMINAL_STATION))["ground"].items()
    }
    latitude, longitude, height = geodetic_from_ecef(BRAUNSCHWEIG_M[0])
    sections["station"] |= {
        "latitude_deg": math.degrees(latitude),
        "longitude_deg": math.degrees(longitude),
        "height_m": float(height),
    }
    sections["receivers"] = {f"rr{row + 1}_ecef_m": place for row, place in enumerate(BRAUNSCHWEIG_M[:count].tolist())}
    sections["receivers"]["minimum"] = min(2, count)
    return GroundParams.from_mapping(sections, source=NOMINAL_STATION)


def shipped_stations() -> Iterator[tuple[str, GroundParams]]:
    """Name and parameters of every station the suite ships."""
    for path in shipped_files():
        if path.name == NOMINAL_STATION:
            for count in (1, 2, 3):
                yield path.stem, nominal_station(count)
        else:
            yield path.stem, GroundParams.from_mapping(read_sections(path)["ground"], source=path.name)


def row(name: str, station: GroundParams) -> str:
    """One line of the table."""
    claim, sigma = orbit_claim(station), station.atmosphere.sigma_vert_iono_gradient
    gradients = (
        f"{station.gast_d.y_eig_m:g} m, {1e3 * station.gast_d.m_eig:g} m/km" if station.gast_d.enabled else "no type D"
    )
    cells = (
        name,
        str(station.n_receivers),
        f"{claim.at_zenith:.3g} to {claim.at_mask:.3g}" if claim.source == "monitor" else f"{claim.at_mask:.4g}",
        SOURCES[claim.source],
        f"{1e6 * sigma:g} mm/km, {'largest' if sigma >= MAX_SIGMA_VIG else 'declared'}",
        gradients,
        str(station.station.gcid),
        str(supported_gcid(station)),
    )
    return f"| {' | '.join(cells)} |"


def table() -> str:
    """The table as it stands in the document."""
    return "\n".join([*HEADER, *(row(name, station) for name, station in shipped_stations())])


if __name__ == "__main__":
    print(table())

"""Small things that run at every epoch or ephemeris, each against its own bound."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from gbas_bench.figures import Figure, Part
from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.satellites import N_SATS, missing
from gbas_core.signal.antenna import ANTENNAS
from gbas_core.signal.rays import Scene, ray_errors
from gbas_core.signal.surfaces import box
from gbas_core.signals import N_BANDS
from gbas_msgs_py import tables
from gbas_vdb.messages.ephemeris_crc import GPS_FIELDS, ephemeris_crcs

TABLE_BUDGET_S: Final = 150e-6
CRC_BUDGET_S: Final = 3e-3
RAYS_BUDGET_S: Final = 10e-3
_SATELLITES: Final = 30
_ANTENNAS: Final = 5


def measure_pieces(repeats: int) -> Part:
    """The least of so many runs of each: other programs make it longer, nothing makes it shorter."""
    measured = (
        (f"observations of {_SATELLITES} satellites to a table and back", _table(), TABLE_BUDGET_S),
        ("ephemeris CRCs of all GPS satellites", _crcs(), CRC_BUDGET_S),
        (f"reflections of a building at {_ANTENNAS} antennas, {N_SATS - 8} satellites", _rays(), RAYS_BUDGET_S),
    )
    figures = tuple(
        Figure(
            part="pieces", name=name, value=1e3 * _least_s(work, repeats), unit="ms",
            against=f"bound {1e3 * budget_s:g} ms", reference=1e3 * budget_s, better="less",
        )
        for name, work, budget_s in measured
    )  # fmt: skip
    return Part(name="pieces", about=f"The least of {repeats} runs.", figures=figures)


def _least_s(work: Callable[[], object], repeats: int) -> float:
    taken = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        taken.append(time.perf_counter() - begin)
    return min(taken)


def _table() -> Callable[[], object]:
    values = missing(N_BANDS)
    values[:, :_SATELLITES] = 1.0
    epoch = ObservationEpoch(
        gps_week=2400, tow_s=0.0, code_m=values, carrier_m=values, doppler_hz=values, cn0_dbhz=values, lli=values
    )
    schema = tables.OBSERVATIONS
    return lambda: schema.decode(schema.label, schema.encode(epoch))


def _crcs() -> Callable[[], object]:
    fields: dict[str, Any] = {item.name: np.full(N_SATS, 5 * item.lsb) for item in GPS_FIELDS}
    ephemeris = Ephemeris(gps_week=2300, tow_s=0.0, **fields)
    return lambda: ephemeris_crcs(ephemeris)


def _rays() -> Callable[[], object]:
    scene = Scene(facets=box(center_m=(60.0, 40.0), size_m=(80.0, 30.0, 15.0), heading_rad=0.4))
    generator = np.random.default_rng(2)
    azimuth, elevation = np.radians(generator.uniform((0.0, 3.0), (360.0, 85.0), (N_SATS, 2))).T
    level = np.cos(elevation)
    los = np.array([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(elevation)])
    los[:, N_SATS - 8 :] = np.nan
    antenna = np.column_stack([generator.uniform(-300.0, 300.0, (_ANTENNAS, 2)), np.full(_ANTENNAS, 3.0)])
    every = np.broadcast_to(los, (_ANTENNAS, 3, N_SATS))
    spacing = (0.1, 0.1, 1.0)
    return lambda: ray_errors(scene.trace(antenna, every, ANTENNAS["mla"]), spacing)

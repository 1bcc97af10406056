"""A world's observations as arrays over time, for studies: no files, no records of single epochs.

Axes are (epochs, receivers, bands, satellites), the aircraft's receiver last. An epoch of four receivers takes a
millisecond or two, and each quantity 6.5 kB: hours fit in memory as one batch, days as several. Epochs are functions of
the parameters and their number, so that batches can be made by as many processes as there are::

    for batch in batches(world, ("code_m", "carrier_m"), length=7200):
        cmc_m = batch.code_m[:, :, L1] - batch.carrier_m[:, :, L1]
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from gbas_core.record import FloatArray
from gbas_core.satellites import N_SATS
from gbas_core.signals import N_BANDS
from gbas_sim.world import World

QUANTITIES: Final = ("code_m", "carrier_m", "doppler_hz", "cn0_dbhz", "lli")
"""What receivers observe, by the names of :class:`gbas_core.gnss.observations.ObservationEpoch`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Batch:
    """Observations of some epochs; arrays (T, R, N_BANDS, N_SATS), NaN where there is none, None if not asked for.

    Attributes
    ----------
    numbers : (T,) array of int
        Of the epochs.
    since_start_s : (T,) array
        Their time tags since the start of the run [s].
    receivers : tuple of str
        Names of the R receivers.
    elevation_rad : (T, R, N_SATS) array
        True elevations, also of satellites that are not tracked [rad].
    code_m, carrier_m, doppler_hz, cn0_dbhz, lli : arrays or None
    """

    numbers: np.ndarray[Any, np.dtype[np.int64]]
    since_start_s: FloatArray
    receivers: tuple[str, ...]
    elevation_rad: FloatArray
    code_m: FloatArray | None = None
    carrier_m: FloatArray | None = None
    doppler_hz: FloatArray | None = None
    cn0_dbhz: FloatArray | None = None
    lli: FloatArray | None = None


def observed(world: World, numbers: Sequence[int], quantities: Sequence[str] = ("code_m", "carrier_m")) -> Batch:
    """Some epochs of a world.

    Parameters
    ----------
    world : World
    numbers : sequence of int
        Of the epochs, such as ``range(len(world))`` or every fourth.
    quantities : sequence of str
        Which of :data:`QUANTITIES`.

    Raises
    ------
    ValueError
        For an unknown quantity.
    IndexError
        For epochs that do not exist.
    """
    for name in quantities:
        if name not in QUANTITIES:
            raise ValueError(f"quantity {name!r} is not one of {', '.join(QUANTITIES)}")
    names = world.params.receiver_names
    arrays = {name: np.empty((len(numbers), len(names), N_BANDS, N_SATS)) for name in quantities}
    elevation_rad = np.empty((len(numbers), len(names), N_SATS))
    for row, number in enumerate(numbers):
        epoch = world.epoch(number)
        elevation_rad[row] = world.elevations_rad(number)
        receivers = epoch.ground if epoch.airborne is None else (*epoch.ground, epoch.airborne)
        for name, values in arrays.items():
            for place, receiver in enumerate(receivers):
                values[row, place] = getattr(receiver, name)
    at = np.array(numbers, dtype=np.int64)
    return Batch(
        numbers=at,
        since_start_s=np.asarray(world.params.interval_s * at, dtype=np.float64),
        receivers=names,
        elevation_rad=elevation_rad,
        **arrays,
    )


def batches(
    world: World, quantities: Sequence[str] = ("code_m", "carrier_m"), *, length: int = 7200
) -> Iterator[Batch]:
    """All epochs of a world, so many at a time; the last batch may be shorter."""
    for first in range(0, len(world), length):
        yield observed(world, range(first, min(first + length, len(world))), quantities)

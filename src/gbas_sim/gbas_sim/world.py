"""A simulated world: satellites, reference receivers and at most one aircraft, an epoch at a time.

An epoch is a function of the parameters and its number: epochs can be made in any order, in any process, with the same
bits.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.gpstime import epoch_key
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.gnss.orbits import group_delay_s
from gbas_core.record import FloatArray, IntArray
from gbas_core.satellites import N_SATS, satellites_of
from gbas_core.signals import L2, N_BANDS
from gbas_sim.atmosphere.ionosphere import Ionosphere
from gbas_sim.atmosphere.paths import Delay, SignalPaths
from gbas_sim.faults.kinds import FrozenOutput, SatelliteFault, source_epochs, with_wrong_broadcasts
from gbas_sim.instants import Instant, Instants
from gbas_sim.receivers.arcs import Breaks, Passes, arc_numbers
from gbas_sim.receivers.oscillators import ClockState
from gbas_sim.receivers.receiver import Arrivals
from gbas_sim.satellites.broadcast import Orbits, almanac_orbits, nominal_orbits, recorded_orbits
from gbas_sim.satellites.sightlines import sightlines
from gbas_sim.simulated_epochs import SimulatedEpoch, Truth
from gbas_sim.threat_checks import check_threats
from gbas_sim.world_params import WorldParams

_PASSES_S: Final = 300.0
"""Satellites that set for less may be found with the carrier they had."""


def open_orbits(params: WorldParams) -> Orbits:
    """The satellites of a world.

    Raises
    ------
    AlmanacError, RinexError
        When a file cannot be used.
    """
    span = (params.start_week, params.start_tow_s, params.length_s)
    systems = satellites_of(params.systems)
    if params.navigation:
        return recorded_orbits([Path(each) for each in params.navigation], *span, systems=systems)
    if params.almanac:
        return almanac_orbits(params.almanac, *span, seed=params.seed, systems=systems)
    return nominal_orbits(*span, seed=params.seed, systems=systems)


class World:
    """A world with given parameters.

    Parameters
    ----------
    params : WorldParams
    orbits : Orbits, optional
        The satellites, in place of those the parameters say.

    Attributes
    ----------
    params : WorldParams
    orbits : Orbits
    ephemerides : tuple of Ephemeris
        What the satellites broadcast, in order of reception.
    """

    def __init__(self, params: WorldParams, *, orbits: Orbits | None = None) -> None:
        self.params = params
        self.orbits = open_orbits(params) if orbits is None else orbits
        self._instants = Instants(params, self.orbits)
        satellite_faults = [fault for fault in params.faults if isinstance(fault, SatelliteFault)]
        self.ephemerides: tuple[Ephemeris, ...] = with_wrong_broadcasts(
            self.orbits.received, satellite_faults, params.start_week, params.start_tow_s
        )
        self._group_delay_s = _group_delays_s(self.orbits)
        self._ionosphere = None if params.ionosphere is None else Ionosphere(params=params.ionosphere, seed=params.seed)
        self._passes = Passes(self.above_masks, max(1, round(_PASSES_S / params.interval_s)))
        check_threats(params, self.above_masks)

    @functools.cached_property
    def _breaks(self) -> Breaks | None:
        first = self._instants.first_break
        return None if first is None else Breaks(lambda number: self._instants.at(number).unbroken, first)

    def _arcs(self, number: int) -> IntArray:
        """Numbers of the carriers' arcs, (R, N_BANDS, N_SATS)."""
        breaks = None if self._breaks is None else self._breaks.at(number)
        return arc_numbers(self._passes.at(number), breaks)

    @property
    def ephemeris(self) -> Ephemeris:
        """What the satellites broadcast at the start."""
        return self.ephemerides[0]

    def __len__(self) -> int:
        return self.params.n_epochs

    def __iter__(self) -> Iterator[SimulatedEpoch]:
        return map(self.epoch, range(len(self)))

    def epoch(self, number: int) -> SimulatedEpoch:
        """One epoch.

        Raises
        ------
        IndexError
            For a number that is not from 0 to ``len(world) - 1``.
        """
        if not 0 <= number < len(self):
            raise IndexError(f"epoch {number} is not within 0 to {len(self) - 1}")
        now = self._instants.at(number)
        observations = self._with_frozen(number, self._observations(number))
        count = len(self._instants.sites_m)
        return SimulatedEpoch(
            key=epoch_key(now.gps_week, now.tow_s),
            ground=observations[:count],
            airborne=observations[count] if len(observations) > count else None,
            truth=self._truth(number, now),
        )

    def _truth(self, number: int, now: Instant) -> Truth | None:
        if self.params.flight is None:
            return None
        since_s = self._instants.since_s(number) - now.clock.offset_s[-1]
        roll, pitch, heading = self.params.flight.attitude(np.array(since_s))
        return Truth(
            gps_week=now.gps_week,
            tow_s=now.tow_s,
            position_m=now.paths.position_m[-1],
            velocity_mps=now.paths.velocity_mps[-1],
            roll_rad=float(roll),
            pitch_rad=float(pitch),
            heading_rad=float(heading),
        )

    def _observations(self, number: int) -> tuple[ObservationEpoch, ...]:
        """What receivers would observe that are not frozen."""
        before, now = self._instants.at(number - 1), self._instants.at(number)
        arrivals = self._arrivals(now, before.tracked, self._arcs(number))
        observations: list[ObservationEpoch] = []
        for bank, rows in zip(self._instants.banks, self._instants.rows, strict=True):
            observations += bank.observe(
                gps_week=now.gps_week,
                tow_s=now.tow_s,
                epoch=number,
                clock=ClockState(now.clock.offset_s[rows], now.clock.drift[rows]),
                group_delay_s=self._group_delay_s,
                seen=_of(arrivals, rows),
            )
        return tuple(observations)

    def _with_frozen(self, number: int, observations: tuple[ObservationEpoch, ...]) -> tuple[ObservationEpoch, ...]:
        """Observations with those of earlier epochs where outputs are frozen."""
        if not any(isinstance(fault, FrozenOutput) for fault in self._instants.receiver_faults):
            return observations
        sources = source_epochs(self._instants.receiver_faults, self._instants.moment(number), number)
        mixed = list(observations)
        for source in sorted(set(sources[sources != number].tolist())):
            earlier = self._observations(source) if source >= 0 else None
            for row in np.flatnonzero((sources == source).any(axis=1)):
                mixed[row] = _mixed(mixed[row], None if earlier is None else earlier[row], sources[row] == source)
        return tuple(mixed)

    def elevations_rad(self, number: int) -> FloatArray:
        """Elevations ``(R, N_SATS)`` of the satellites at an epoch, the aircraft's last [rad]."""
        return self._instants.at(number).elevation_rad

    def above_masks(self, number: int) -> NDArray[np.bool_]:
        """Satellites above the receivers' masks at an epoch, (R, N_SATS)."""
        return self._instants.above_masks(number)

    def paths(self, number: int) -> SignalPaths:
        """Signal paths at an epoch, the aircraft's last."""
        return self._instants.at(number).paths

    def _arrivals(self, now: Instant, tracked_before: NDArray[np.bool_], arcs: IntArray) -> Arrivals:
        paths = now.paths
        lines = sightlines(now.arc, now.tow_s, now.clock.offset_s, now.seen, paths.position_m, paths.velocity_mps)
        air = self.params.troposphere.delay(paths)
        for box in self.params.weather:
            air = air + box.delay(paths)
        nothing = np.zeros_like(air.delay_m)
        dispersive = Delay(delay_m=nothing, rate_mps=nothing)
        for effect in (*(() if self._ionosphere is None else (self._ionosphere,)), *self.params.fronts):
            dispersive = dispersive + effect.delay(paths)
        effect = now.effect
        return Arrivals(
            lines=lines.delayed(air.delay_m, air.rate_mps),
            dispersive=dispersive,
            code_m=0.0 if effect is None else effect.code_m,
            carrier_m=0.0 if effect is None else effect.carrier_m,
            rate_mps=0.0 if effect is None else effect.rate_mps,
            cn0_dbhz=now.cn0_dbhz,
            elevation_rad=now.elevation_rad,
            tracked=now.tracked,
            tracked_before=tracked_before if effect is None else tracked_before & ~effect.slipped,
            arcs=arcs,
        )


def _mixed(now: ObservationEpoch, earlier: ObservationEpoch | None, satellites: NDArray[np.bool_]) -> ObservationEpoch:
    """An epoch with the observations of some satellites from an earlier one, or without them if there is none."""
    arrays = {name: value for name, value in vars(now).items() if isinstance(value, np.ndarray)}
    values: dict[str, Any] = {
        name: np.where(satellites, np.nan if earlier is None else getattr(earlier, name), value)
        for name, value in arrays.items()
    }
    return replace(now, **values)


def _group_delays_s(orbits: Orbits) -> FloatArray:
    """Group delays (N_BANDS, N_SATS) of the first ephemeris each satellite has; NaN on L2, which is not simulated."""
    delays = np.full((N_BANDS, N_SATS), np.nan)
    for truth in orbits.truth:
        own = np.array([group_delay_s(truth, band) for band in range(N_BANDS)])
        delays = np.where(np.isnan(delays), own, delays)
    delays[L2] = np.nan
    return delays


def _of(arrivals: Arrivals, rows: slice) -> Arrivals:
    """The signals at some of the receivers."""
    lines = arrivals.lines.of(rows)
    delay = Delay(**{item.name: getattr(arrivals.dispersive, item.name)[rows] for item in fields(Delay)})
    parts = {name: value[rows] for name, value in arrivals._asdict().items() if isinstance(value, np.ndarray)}
    return arrivals._replace(lines=lines, dispersive=delay, **parts)

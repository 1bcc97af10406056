"""A quiet approach through the whole chain, kept for the fronts that come after."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from gbas_airborne.params import AirborneParams
from gbas_chain.chain import AirborneOutput, Chain, GroundOutput
from gbas_core.gnss.gpstime import epoch_key
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.io.recording import RecordedEpoch
from gbas_core.positioning.approach import FinalApproach
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS
from gbas_core.signals import IONO_RATIO
from gbas_ground.params import GroundParams
from gbas_msgs_py.codes import ServiceType
from gbas_msgs_py.products import L1_100
from gbas_sim.atmosphere.fronts import WedgeFront
from gbas_sim.atmosphere.paths import SignalPaths
from gbas_sim.simulated_epochs import SimulatedEpoch
from gbas_sim.world import World
from gbas_sim.world_params import WorldParams

_SCALARS: Final = ("vpl_m", "lpl_m", "val_m", "lal_m", "service", "alert")


@dataclass(frozen=True, kw_only=True, eq=False)
class Observed:
    """What the receivers of a world observe, and where the signals come through; made once.

    Attributes
    ----------
    world : World
        Without fronts.
    epochs : tuple of SimulatedEpoch
    east_m, north_m : (T, R, N) arrays
        Where the paths meet the station's plane, from the station [m]: reference receivers first, the aircraft last.
    elevation_rad : (T, N) array
        At the aircraft [rad].
    tracked : (T, R, N) bool array
        Channels with code and carrier on L1.
    """

    world: World
    epochs: tuple[SimulatedEpoch, ...]
    east_m: FloatArray
    north_m: FloatArray
    elevation_rad: FloatArray
    tracked: BoolArray

    @property
    def since_s(self) -> FloatArray:
        """Times of the epochs since the start, (T,) [s]."""
        return np.asarray(np.arange(len(self.epochs)) * self.world.params.interval_s, dtype=np.float64)


def observe(params: WorldParams) -> Observed:
    """Make all observations of a world once, without its threats."""
    world = World(replace(params, faults=(), fronts=()))
    east, north, elevation, tracked, epochs = [], [], [], [], []
    for number in range(len(world)):
        made = world.epoch(number)
        paths: SignalPaths = world.paths(number)
        east.append(paths.along(0.5 * np.pi, "ray")[0])
        north.append(paths.along(0.0, "ray")[0])
        elevation.append(world.elevations_rad(number)[-1])
        receivers = (*made.ground, made.airborne)
        tracked.append([np.isfinite(each.code_m[0] + each.carrier_m[0]) for each in receivers if each is not None])
        epochs.append(made)
    return Observed(
        world=world,
        epochs=tuple(epochs),
        east_m=np.array(east),
        north_m=np.array(north),
        elevation_rad=np.array(elevation),
        tracked=np.array(tracked),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Flight:
    """An approach through station and aircraft; T epochs.

    Attributes
    ----------
    used : (T, R, N) array
        1 where a reference receiver is behind a correction.
    divergence_mps : (T, R, N) array
        Filtered rate of code less carrier of each reference receiver, L1 [m/s].
    s : (T, 2, N) array
        Projections on the vertical and lateral error; 0 where not used.
    variance_m2 : (T, N) array
        Of the ranges, as the aircraft takes it; NaN where not used.
    los : (T, 3, N) array
        Unit vectors in the approach frame.
    error_m, level_m, limit_m : (T, 2) arrays
        Position error, protection level and alert limit, vertical and lateral [m].
    age_s : (T,) array
        Of the corrections [s].
    served : (T,) bool array
        Service without alert.
    distance_m : (T,) array
        True distance to the threshold along the course [m].
    sigma_vig : (T,) array
        As broadcast [m/m].
    gpa_rad : float
        Glide path angle [rad].
    """

    used: FloatArray
    divergence_mps: FloatArray
    s: FloatArray
    variance_m2: FloatArray
    los: FloatArray
    error_m: FloatArray
    level_m: FloatArray
    limit_m: FloatArray
    age_s: FloatArray
    served: BoolArray
    distance_m: FloatArray
    sigma_vig: FloatArray
    gpa_rad: float


def fly(
    observed: Observed, station: GroundParams, aircraft: AirborneParams, fronts: Sequence[WedgeFront] = ()
) -> Flight:
    """Step station and aircraft through the epochs, with fronts added to the observations."""
    ephemerides = observed.world.ephemerides
    chain = Chain(station, aircraft, ephemerides, ephemerides)
    places = {each.key: row for row, each in enumerate(observed.epochs)}
    count, receivers = len(observed.epochs), station.n_receivers
    approach = next(each for each in station.approaches if each.rpds == aircraft.rpds)
    truth = [each.truth.position_m for each in observed.epochs if each.truth is not None]
    position = approach.approach_from_ecef(np.array(truth))
    rows: dict[str, FloatArray] = {name: np.full(count, np.nan) for name in (*_SCALARS, "age_s", "sigma_vig")}
    used, divergence = np.zeros((count, receivers, N_SATS)), np.full((count, receivers, N_SATS), np.nan)
    s, variance = np.zeros((count, 2, N_SATS)), np.full((count, N_SATS), np.nan)
    los, found = np.zeros((count, 3, N_SATS)), np.full((count, 3), np.nan)
    for output in chain.run(_recorded(observed, fronts)):
        if isinstance(output, GroundOutput):
            row = places[epoch_key(output.integrity.gps_week, output.integrity.tow_s)]
            used[row] = np.nan_to_num(output.integrity.receiver_used[L1_100, :receivers])
            divergence[row] = output.monitored.details.ccd_receiver_mps[:receivers]
            rows["sigma_vig"][row] = output.integrity.sigma_vert_iono_gradient
        elif isinstance(output, AirborneOutput):
            solution, protection = output.solution, output.protection
            row = places[epoch_key(solution.gps_week, solution.tow_s)]
            for name in _SCALARS:
                rows[name][row] = getattr(protection, name)
            rows["age_s"][row] = solution.correction_age_s
            found[row] = approach.approach_from_ecef([solution.x_m, solution.y_m, solution.z_m])
            s[row] = np.nan_to_num([solution.s_vert, solution.s_lat])
            parts = (solution.sigma_gnd_m, solution.sigma_air_m, solution.sigma_tropo_m, solution.sigma_iono_m)
            variance[row] = sum(each**2 for each in parts)
            los[row] = _los(solution.azimuth_rad, solution.elevation_rad, approach)
    wrong = found - position
    return Flight(
        used=used,
        divergence_mps=divergence,
        s=s,
        variance_m2=variance,
        los=los,
        error_m=np.stack([wrong[:, 2] + wrong[:, 0] * np.tan(approach.gpa_rad), wrong[:, 1]], axis=-1),
        level_m=np.stack([rows["vpl_m"], rows["lpl_m"]], axis=-1),
        limit_m=np.stack([rows["val_m"], rows["lal_m"]], axis=-1),
        age_s=rows["age_s"],
        served=(rows["service"] == ServiceType.C) & (rows["alert"] == 0.0),
        distance_m=-position[:, 0],
        sigma_vig=rows["sigma_vig"],
        gpa_rad=approach.gpa_rad,
    )


def _los(azimuth_rad: FloatArray, elevation_rad: FloatArray, approach: FinalApproach) -> FloatArray:
    """Unit vectors, forward, left and up, (3, N); 0 where there is none."""
    turn, level = azimuth_rad - approach.course_rad, np.cos(elevation_rad)
    return np.asarray(np.nan_to_num(np.stack([level * np.cos(turn), -level * np.sin(turn), np.sin(elevation_rad)])))


def _recorded(observed: Observed, fronts: Sequence[WedgeFront]) -> Iterator[RecordedEpoch]:
    """The epochs as the chain takes them."""
    for number, each in enumerate(observed.epochs):
        ground, user = each.ground, each.airborne
        if fronts and user is not None:
            paths = observed.world.paths(number)
            delay_m = sum(front.delay(paths).delay_m for front in fronts)
            *ground_seen, user = (
                _delayed(seen, own) for seen, own in zip((*ground, user), np.asarray(delay_m), strict=True)
            )
            ground = tuple(ground_seen)
        yield RecordedEpoch(key=each.key, ground=ground, user=user)


def _delayed(seen: ObservationEpoch, delay_m: FloatArray) -> ObservationEpoch:
    """Observations with a slant delay on L1 more: codes later, carriers earlier, by the square of the wavelength."""
    added = IONO_RATIO[:, np.newaxis] * np.nan_to_num(delay_m)
    return replace(seen, code_m=seen.code_m + added, carrier_m=seen.carrier_m - added)

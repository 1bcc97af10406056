"""What the station hands its monitors at each epoch, from recorded pairs of receivers and from simulated worlds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.frames import azimuth_elevation, geodetic_from_ecef, rot_enu_ecef
from gbas_core.gnss.gpstime import epoch_key, from_epoch_key
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.gnss.orbits import predicted_state, rotated_range
from gbas_core.io.recording import Recording
from gbas_core.parameters import made_of
from gbas_core.record import FloatArray
from gbas_core.satellites import satellites_of
from gbas_core.signals import L1, SPEED_OF_LIGHT_MPS
from gbas_ground.channels import ephemerides
from gbas_ground.channels.predicted_ranges import predict_ranges, site_of
from gbas_ground.channels.tracking import TrackGroup, filter_params, initial_tracking, stack, track
from gbas_ground.monitors.ionosphere_gradient import IonosphereGradientParams
from gbas_ground.params import GroundParams
from gbas_msgs_py.joining import ReceptionQueue
from gbas_sim.simulated_epochs import SimulatedEpoch
from ground_runs import receiver_values
from recorded_sets import recorded_sets

BRAUNSCHWEIG_M = np.array(
    [
        [3840619.039, 715604.228, 5024909.863],
        [3840835.113, 714861.969, 5024848.587],
        [3841202.939, 715429.959, 5024488.675],
        [3840640.493, 715530.528, 5024903.779],
    ]
)
"""Table 1 of the test bed's paper, and its fourth receiver: 77 m from the first towards the second."""
DEMO_SITE_M = np.vstack([BRAUNSCHWEIG_M[:3], [3840882.0, 715289.0, 5024753.0]])
"""The same three, and the fourth of the shipped configurations, about 440 m from each of them."""
RUNWAY_RAD = np.radians(84.73)


class MonitorEpoch(NamedTuple):
    """One epoch of R receivers."""

    key: int
    code_m: FloatArray  # (R, N_BANDS, N)
    carrier_m: FloatArray
    cn0_dbhz: FloatArray
    restarted: np.ndarray  # as the filters of L1 say, for all bands
    range_m: FloatArray  # (R, N)
    clock_s: FloatArray
    elevation_rad: FloatArray  # (N,)
    azimuth_rad: FloatArray
    shift_m: FloatArray  # (R, N), what a new ephemeris makes of a residual


def station_of(positions_m: FloatArray, systems: str) -> GroundParams:
    """A station with its reference point at the first receiver."""
    latitude, longitude, height = (float(value) for value in geodetic_from_ecef(np.array(positions_m[0])))
    return made_of(GroundParams, {
        "station.id": "TEST", "station.latitude_rad": latitude, "station.longitude_rad": longitude,
        "station.height_m": height, "station.systems": systems, "station.gcid": 1,
        **receiver_values(np.array(positions_m)), "receivers.minimum": 1, "signal_power.require_cn0": False,
        "vdb.slots": "AB", "ephemeris.settle_s": 0.0,
    })  # fmt: skip


def braunschweig_station(count: int = 4, **sections: Mapping[str, Any]) -> GroundParams:
    """The demo's site with its first receivers, from a file's sections: what they say is added or replaced."""
    station = {"id": "EDVE", "latitude_deg": 52.3199737, "longitude_deg": 10.5494973, "height_m": 131.9, "gcid": 1}
    receivers = {f"rr{row + 1}_ecef_m": place for row, place in enumerate(BRAUNSCHWEIG_M[:count].tolist())}
    mapping: dict[str, Mapping[str, Any]] = {
        "station": station, "receivers": {**receivers, "minimum": min(2, count)}, "vdb": {"slots": "ABC"},
    }  # fmt: skip
    mapping |= {name: {**mapping.get(name, {}), **values} for name, values in sections.items()}
    return GroundParams.from_mapping(mapping, source="site.yaml")


def monitor_epochs(
    observed: Iterable[tuple[int, Sequence[ObservationEpoch | None], Sequence[Ephemeris]]], params: GroundParams
) -> Iterator[MonitorEpoch]:
    """Epochs as the station sees them: key, observations, ephemerides received since the epoch before."""
    site, known = site_of(params), ephemerides.initial_ephemerides()
    filters = filter_params(params)
    groups: tuple[TrackGroup, ...] = initial_tracking(filters, params.n_receivers)
    for key, observations, received in observed:
        week, tow_s = from_epoch_key(key)
        before = known.current
        for each in received:
            known, _ = ephemerides.receive(known, each, week, tow_s, params)
        known, changed, _ = ephemerides.choose(known, week, tow_s, params)
        raw = stack(observations, satellites_of(params.station.systems))
        predicted = predict_ranges(known.current, week, tow_s, raw.code_m[:, L1], site)
        less_clock = predicted.range_m - SPEED_OF_LIGHT_MPS * predicted.clock_s
        old = predict_ranges(before, week, tow_s, raw.code_m[:, L1], site)
        shift = np.where(changed, old.range_m - SPEED_OF_LIGHT_MPS * old.clock_s - less_clock, 0.0)
        less_clock = np.where(changed, np.nan, less_clock)
        groups, tracks = track(groups, raw, key, less_clock, filters)
        _, los = rotated_range(
            site.positions_m[-1], predicted_state(known.current, week, tow_s, site.positions_m[-1]).position_m
        )
        azimuths, _ = azimuth_elevation(rot_enu_ecef(params.station.latitude_rad, params.station.longitude_rad) @ los)
        yield MonitorEpoch(
            key, raw.code_m, raw.carrier_m, raw.cn0_dbhz,
            np.repeat((tracks.age_of(L1) == 0.0)[:, np.newaxis], raw.code_m.shape[1], axis=1),
            predicted.range_m, predicted.clock_s, predicted.elevation_rad, azimuths, shift,
        )  # fmt: skip


def recorded_pair(name: str, data: Path, count: int | None = None) -> tuple[GroundParams, list[MonitorEpoch]]:
    """The receivers of a recorded set, ground and user alike, as the receivers of one station."""
    chosen = recorded_sets()[name]
    files = [data / path for path in (*chosen["ground"], chosen["user"])]
    recording = Recording.open(files, None, [data / path for path in chosen["navigation"]])
    params = station_of(np.array([*chosen["ground_xyz_m"], chosen["user_xyz_m"]]), chosen["systems"])
    queue = ReceptionQueue()
    for each in recording.ephemerides():
        queue.add(epoch_key(each.gps_week, each.tow_s), each)
    rows = (
        (each.key, each.ground, queue.take(each.key))
        for number, each in enumerate(recording.epochs())
        if count is None or number < count
    )
    return params, list(monitor_epochs(rows, params))


def simulated(epochs: Iterable[SimulatedEpoch], ephemeris: Ephemeris, params: GroundParams) -> list[MonitorEpoch]:
    """Epochs of a simulated world; its broadcast is known from the start."""
    rows = ((each.key, each.ground, (ephemeris,) if number == 0 else ()) for number, each in enumerate(epochs))
    return list(monitor_epochs(rows, params))


STATION = braunschweig_station()
"""A station that sets nothing of its monitors."""


def station_gradient() -> IonosphereGradientParams:
    """The station's gradient monitor, along the runway; its carrier noise is that of the station."""
    return replace(STATION.gradient_monitor(), runway_bearing_rad=(float(RUNWAY_RAD),))

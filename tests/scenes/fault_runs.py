"""Faults put into the whole chain, and what must hold whatever they are.

A scene is a chain that has already settled, the epochs that follow and the truth. A run copies it, so that a fault
costs the epochs it takes and not the time to settle. The filters of the scenes settle in 30 s: how long it takes is
tested elsewhere, and so are the published numbers.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from gbas_airborne.params import AirborneParams
from gbas_bringup.resources import config_path
from gbas_chain.chain import AirborneOutput, Chain, Channel, GroundOutput
from gbas_chain.process import prepare
from gbas_chain.results import Row
from gbas_core.gnss.ephemeris import Ephemeris
from gbas_core.gnss.frames import geodetic_from_ecef, rot_enu_ecef
from gbas_core.gnss.gpstime import epoch_key, from_epoch_key
from gbas_core.gnss.observations import ObservationEpoch
from gbas_core.io.recording import RecordedEpoch
from gbas_core.parameters import replaced
from gbas_core.record import FloatArray
from gbas_core.satellites import N_SATS, SAT_IDS
from gbas_core.signals import SPEED_OF_LIGHT_MPS, WAVELENGTH_M
from gbas_ground.params import GroundParams
from gbas_msgs_py import tables
from gbas_msgs_py.events import Event
from gbas_msgs_py.records import ChannelState
from gbas_sim.scenario import read_sections, scenario_from_mapping
from gbas_sim.world import World
from gbas_vdb.coding.fec import encode_fec
from gbas_vdb.messages.block import encode_block
from gbas_vdb.messages.types import Message
from gbas_vdb.transmission.burst import Burst
from gbas_vdb.transmission.receive import decode_burst
from recorded_sets import request, truth_ecef_m

SETTLE_S = 30.0
QUANTITIES = ("code_m", "carrier_m", "doppler_hz", "cn0_dbhz", "lli")

Epochs = list[RecordedEpoch]
Fault = Callable[[Epochs], Epochs]
"""Makes the epochs a chain gets out of those it would get without the fault."""


@dataclass(repr=False)
class Outcome:
    """What came out of a run.

    Attributes
    ----------
    rows, airborne
        One an airborne epoch.
    ground
        One an epoch.
    truth : dict
        True position by epoch key.
    course_rad
        Course the lateral protection level is about.
    first_key
        Key of the first epoch.
    """

    truth: dict[int, FloatArray]
    course_rad: float
    first_key: int
    rows: list[Row] = field(default_factory=list)
    airborne: list[AirborneOutput] = field(default_factory=list)
    ground: list[GroundOutput] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)

    def causes(self, subject: str | None = None) -> set[str]:
        """Causes of the events, of all subjects or of one."""
        return {event.cause for event in self.events if subject in (None, event.subject)}

    def seconds(self, of: Iterable[Row] | None = None) -> FloatArray:
        """Times since the first epoch."""
        return np.array([(_key(row) - self.first_key) / 1000.0 for row in (self.rows if of is None else of)])

    def alerts(self) -> FloatArray:
        """Alert of each airborne epoch."""
        return np.array([float(row.alert) for row in self.rows])

    def error_and_level_m(self) -> FloatArray:
        """Vertical error, VPL, lateral error, LPL of each airborne epoch; NaN without a position or a truth."""
        return np.array([self._row_error(row) for row in self.rows]).reshape(-1, 4)

    def _row_error(self, row: Row) -> tuple[float, float, float, float]:
        true_m = self.truth.get(_key(row))
        if row.position_m is None or true_m is None:
            return (np.nan,) * 4
        latitude, longitude, _ = geodetic_from_ecef(true_m)
        east, north, up = rot_enu_ecef(latitude, longitude) @ (row.position_m - true_m)
        lateral = east * np.cos(self.course_rad) - north * np.sin(self.course_rad)
        return abs(up), row.vpl_m, abs(lateral), row.lpl_m

    def violations(self) -> list[str]:
        """What must never be and was."""
        return [*self._unprotected(), *self._unbounded(), *self._uncorrected(), *self._unspeakable()]

    def _unprotected(self) -> list[str]:
        found = []
        for row in self.rows:
            levels = bool(np.isfinite([row.vpl_m, row.lpl_m]).all() and row.vpl_m > 0.0 and row.lpl_m > 0.0)
            if row.position_m is not None and not (levels and np.isfinite(row.position_m).all()):
                found.append(f"{row.tow_s}: position with levels {row.vpl_m}, {row.lpl_m}")
            if not row.alert and (row.position_m is None or row.service == "none"):
                found.append(f"{row.tow_s}: no alert without position or service")
        return found

    def _unbounded(self) -> list[str]:
        """Errors outside the protection levels: with and without alert, for a level that is given has to hold."""
        errors = self.error_and_level_m()
        bad = (errors[:, 0] > errors[:, 1]) | (errors[:, 2] > errors[:, 3])
        return [
            f"{self.rows[k].tow_s}: {errors[k].round(2).tolist()} alert {self.rows[k].alert}"
            for k in np.flatnonzero(bad)
        ]

    def _uncorrected(self) -> list[str]:
        """Satellites in a position that the station did not call usable when it made the corrections."""
        usable: dict[int, FloatArray] = {}
        for made_at in self.ground:  # of an epoch that comes twice the first counts; the second is refused
            key = epoch_key(made_at.integrity.gps_week, made_at.integrity.tow_s)
            usable.setdefault(key, made_at.integrity.state == ChannelState.USABLE)
        found = []
        for each in self.airborne:
            solution = each.solution
            used = np.isfinite(solution.s_vert)
            if not used.any():
                continue
            made = usable.get(round(epoch_key(solution.gps_week, solution.tow_s) - 1000.0 * solution.correction_age_s))
            if made is not None and (used & ~made).any():
                found.append(f"{solution.tow_s}: {[SAT_IDS[k] for k in np.flatnonzero(used & ~made)]} not usable")
        return found

    def _unspeakable(self) -> list[str]:
        """Everything must be fit to send: tables without infinities, events in JSON."""
        for station in self.ground:
            tables.INTEGRITY.encode(station.integrity)
        for each in self.airborne:
            tables.SOLUTION.encode(each.solution)
            tables.PROTECTION.encode(each.protection)
        for event in self.events:
            event.to_json()
        return []


@dataclass(repr=False)
class Scene:
    """A settled chain, what it gets next, and the truth."""

    chain: Chain
    epochs: Epochs
    truth: dict[int, FloatArray]
    course_rad: float = 0.0

    def run(
        self,
        fault: Fault | None = None,
        *,
        channel: Channel | None = None,
        count: int | None = None,
        ground_ephemerides: Sequence[Ephemeris] = (),
        user_ephemerides: Sequence[Ephemeris] = (),
    ) -> Outcome:
        """Go on from the settled chain, through `count` epochs; the ephemerides are received besides."""
        chain = copy.deepcopy(self.chain)
        for queue, received in (
            (chain._ground_ephemerides, ground_ephemerides),
            (chain._airborne_ephemerides, user_ephemerides),
        ):
            for ephemeris in received:
                queue.add(epoch_key(ephemeris.gps_week, ephemeris.tow_s), ephemeris)
        epochs = self.epochs[:count]
        return _run(chain, epochs if fault is None else fault(epochs), self, channel)

    def satellites(self) -> FloatArray:
        """Places of the satellites the user tracks at the start."""
        user = self.epochs[0].user
        assert user is not None
        return np.flatnonzero(np.isfinite(user.code_m[0]))


def _run(chain: Chain, epochs: Epochs, scene: Scene, channel: Channel | None) -> Outcome:
    outcome = Outcome(truth=scene.truth, course_rad=scene.course_rad, first_key=scene.epochs[0].key)
    for output in chain.run(epochs, channel=channel):
        outcome.events += output.events
        if isinstance(output, AirborneOutput):
            outcome.airborne.append(output)
            outcome.rows.append(Row.of(output.solution, output.protection))
        else:
            outcome.ground.append(output)
    return outcome


def _key(row: Row) -> int:
    return epoch_key(row.gps_week, row.tow_s)


_QUICK = {"smoothing.settle_time_s": SETTLE_S, "ephemeris.settle_s": 5.0, "monitors.readmission_time_s": 10.0}


def _settled(chain: Chain, epochs: Epochs, truth: dict[int, FloatArray], course_rad: float, warm: int) -> Scene:
    """The scene after `warm` epochs without a fault; all of them must be behind the chain."""
    begin = Scene(chain=chain, epochs=epochs, truth=truth, course_rad=course_rad)
    _run(chain, epochs[:warm], begin, None)
    return replace(begin, epochs=epochs[warm:])


def recorded_scene(data: Path, name: str = "mosaic_base_rover", *, warm: int = 70) -> Scene:
    """A recorded set: one reference receiver, GPS and Galileo, nobody moves."""
    prepared = prepare(request(name, data))
    epochs = prepared.epochs()
    true_m = truth_ecef_m(name, data, np.array([from_epoch_key(epoch.key)[1] for epoch in epochs]))
    chain = Chain(
        # healthy, so that there is a service to lose; the station file claims none for recorded data
        replaced(prepared.ground, {"station.gcid": 1, **_QUICK}),
        replace(prepared.airborne, settle_s=SETTLE_S, use_unhealthy=False),
        prepared.recording.ephemerides(),
        prepared.recording.user_ephemerides(),
    )
    return _settled(chain, epochs, {e.key: t for e, t in zip(epochs, true_m, strict=True)}, 0.0, warm)


def site(receivers: int = 4, systems: str = "GE", **station: Any) -> dict[str, Any]:
    """Sections of the simulated site with fewer receivers or systems; `station` are dotted keys of it."""
    sections = copy.deepcopy(dict(read_sections(config_path("braunschweig.yaml"))))
    ground = sections["ground"]
    for number in range(receivers + 1, 5):
        del ground["receivers"][f"rr{number}_ecef_m"]
    ground["receivers"]["minimum"] = min(2, receivers)
    ground["station"]["systems"] = sections["sim"]["systems"] = systems
    for key, value in {**_QUICK, **station}.items():
        section, _, name = key.partition(".")
        ground.setdefault(section, {})[name] = value
    return sections


def simulated_scene(
    receivers: int = 4,
    systems: str = "GE",
    *,
    warm: int = 120,
    epochs: int = 160,
    station: dict[str, Any] | None = None,
    airborne: dict[str, Any] | None = None,
    only: Sequence[int] | None = None,
    **sim: Any,
) -> Scene:
    """An aircraft on its last 6 km to the threshold; `only` these satellites are ever tracked.

    `station` and `airborne` change the parameters of the two ends, `sim` those of the world.
    """
    sections = site(receivers, systems, **(station or {}))
    flight = {**sections["sim"]["flight"], "level_time_s": 60.0, "intercept_distance_m": 6000.0}
    sections["sim"] |= {"flight": flight, **sim}
    world = World(scenario_from_mapping(sections))
    parameters = {**sections["airborne"], "systems": systems, "settle_s": SETTLE_S, **(airborne or {})}
    chain = Chain(
        GroundParams.from_mapping(sections["ground"]),
        AirborneParams.from_mapping(parameters),
        [world.ephemeris],
        [world.ephemeris],
    )
    made, truth = [], {}
    for number in range(min(warm + epochs, len(world))):
        epoch = world.epoch(number)
        made.append(RecordedEpoch(key=epoch.key, ground=epoch.ground, user=epoch.airborne))
        truth[epoch.key] = epoch.truth.position_m
    if only is not None:
        made = tracking_only(only)(made)
    return _settled(chain, made, truth, world.params.flight.approach.course_rad, warm)


# --- faults of observations


def changed(
    epoch: RecordedEpoch, who: int | str, change: Callable[[ObservationEpoch], ObservationEpoch | None]
) -> RecordedEpoch:
    """An epoch with the observations of a receiver changed: its number, ``"user"`` or ``"ground"`` for all of them."""
    if who == "user":
        return epoch if epoch.user is None else replace(epoch, user=change(epoch.user))
    ground = tuple(
        change(each) if each is not None and who in ("ground", row) else each for row, each in enumerate(epoch.ground)
    )
    return replace(epoch, ground=ground)


def during(
    start: int, count: int, who: int | str, change: Callable[[ObservationEpoch], ObservationEpoch | None]
) -> Fault:
    """The change at `count` epochs from number `start`."""
    return lambda epochs: [
        changed(epoch, who, change) if start <= k < start + count else epoch for k, epoch in enumerate(epochs)
    ]


def put(
    quantity: str, value: float, satellites: Any = slice(None), bands: Any = slice(None)
) -> Callable[[ObservationEpoch], ObservationEpoch]:
    """Overwrite a quantity."""

    def change(observed: ObservationEpoch) -> ObservationEpoch:
        values = getattr(observed, quantity).copy()
        values[bands, satellites] = value
        return replace(observed, **{quantity: values})

    return change


def added(
    code_m: float = 0.0, carrier_m: float = 0.0, satellites: Any = slice(None)
) -> Callable[[ObservationEpoch], ObservationEpoch]:
    """Add to codes and carriers of all bands."""

    def change(observed: ObservationEpoch) -> ObservationEpoch:
        code, carrier = observed.code_m.copy(), observed.carrier_m.copy()
        code[:, satellites] += code_m
        carrier[:, satellites] += carrier_m
        return replace(observed, code_m=code, carrier_m=carrier)

    return change


def clock_step(milliseconds: float, *, carrier: bool) -> Callable[[ObservationEpoch], ObservationEpoch]:
    """A receiver whose clock is ahead: it samples earlier than its tag says, its codes (and carriers) are longer."""
    step_s = 1e-3 * milliseconds

    def change(observed: ObservationEpoch) -> ObservationEpoch:
        moved_m = WAVELENGTH_M[:, np.newaxis] * observed.doppler_hz * step_s  # minus the range rate, times the step
        code = observed.code_m + moved_m + SPEED_OF_LIGHT_MPS * step_s
        phase = observed.carrier_m + moved_m + SPEED_OF_LIGHT_MPS * step_s * carrier
        return replace(observed, code_m=code, carrier_m=phase)

    return change


def lost(observed: ObservationEpoch) -> None:
    """The receiver gives nothing."""


def tracking_only(satellites: Sequence[int]) -> Fault:
    """Everybody tracks these satellites alone."""
    away = ~np.isin(np.arange(N_SATS), satellites)

    def change(observed: ObservationEpoch) -> ObservationEpoch:
        return replace(observed, **{name: np.where(away, np.nan, getattr(observed, name)) for name in QUANTITIES})

    return lambda epochs: [changed(changed(epoch, "ground", change), "user", change) for epoch in epochs]


def without_doppler(epochs: Epochs) -> Epochs:
    """Nobody measures Doppler: one test less."""
    change = put("doppler_hz", np.nan)
    return [changed(changed(epoch, "ground", change), "user", change) for epoch in epochs]


def frozen(start: int, who: int | str, quantities: Sequence[str] = QUANTITIES) -> Fault:
    """From epoch `start` on the receiver goes on sending what it sent then, under new time tags."""

    def of(epoch: RecordedEpoch, row: int | None) -> ObservationEpoch | None:
        return epoch.user if row is None else epoch.ground[row]

    def fault(epochs: Epochs) -> Epochs:
        result = list(epochs)
        rows: list[int | None] = (
            [None] if who == "user" else [*range(len(epochs[0].ground))] if who == "ground" else [who]
        )
        for row in rows:
            held = of(epochs[start], row)
            assert held is not None
            kept = {name: getattr(held, name) for name in quantities}
            name = "user" if row is None else row
            result = during(start, len(epochs), name, lambda observed, kept=kept: replace(observed, **kept))(result)
        return result

    return fault


def retimed(epoch: RecordedEpoch, shift_ms: int) -> RecordedEpoch:
    """An epoch under another time tag, at both ends."""
    week, tow_s = from_epoch_key(epoch.key + shift_ms)
    change = lambda observed: replace(observed, gps_week=week, tow_s=tow_s)  # noqa: E731
    moved = changed(changed(epoch, "ground", change), "user", change)
    return replace(moved, key=epoch.key + shift_ms)


def both(*faults: Fault) -> Fault:
    """One fault after the other."""

    def fault(epochs: Epochs) -> Epochs:
        for each in faults:
            epochs = each(epochs)
        return epochs

    return fault


# --- faults of the broadcast


def rewritten(
    change: Callable[[Message], Message], *, station_id: str | None = None, test: bool = False
) -> Callable[[Burst], Burst]:
    """A burst with its messages changed, or from another station, or marked as a test; correct in every check."""

    def rewrite(burst: Burst) -> Burst:
        blocks = decode_burst(burst).blocks
        data = b"".join(encode_block(change(b.message), station_id or b.station_id, test=test) for b in blocks)
        return replace(burst, payload=data + encode_fec(data))

    return rewrite


def each_burst(change: Callable[[Burst], Burst | None], start_key: int = 0, stop_key: int | None = None) -> Channel:
    """A channel that changes or swallows every burst of the epochs from one key to another."""

    def channel(key: int, bursts: tuple[Burst, ...]) -> tuple[Burst, ...]:
        if key < start_key or (stop_key is not None and key >= stop_key):
            return bursts
        return tuple(arrived for arrived in map(change, bursts) if arrived is not None)

    return channel

"""Where satellites are and what they broadcast, from one of three sources: nominal orbits, an almanac, a recording.

Nominal orbits and almanacs are taken as the truth for the whole run; every two hours the satellites broadcast a new
ephemeris of it, whose fields are multiples of their scale factors: it differs from the truth by centimetres, as one
ephemeris does from the next. Of recorded ephemerides the orbit itself is the truth; where one follows another, the
satellite passes from the old orbit to the new one within ten minutes, so that no carrier steps.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from gbas_core.gnss.almanac import AlmanacError, ephemeris_from_almanac, read_almanac
from gbas_core.gnss.ephemeris import FIELDS, VALIDITY_S, Ephemeris, NavigationMessage
from gbas_core.gnss.frames import EARTH_RATE_RADPS
from gbas_core.gnss.gpstime import SECONDS_PER_WEEK, epoch_key, from_epoch_key
from gbas_core.gnss.orbits import GM_M3PS2, SatelliteState, satellite_state
from gbas_core.io.rinex import NavigationFile, RinexError, read_navigation
from gbas_core.record import FloatArray
from gbas_core.satellites import IS_GPS, N_SATS
from gbas_sim.satellites.constellation import (
    group_delays_s,
    issue_of,
    nominal_ephemeris,
    quantised_fields,
    time_of_ephemeris,
)

RENEWAL_S: Final = 7200.0
"""Time between ephemerides of one satellite [s]: GPS renews them every 2 h (IS-GPS-200N 20.3.4.4)."""
RECEIVED_BEFORE_S: Final = 3600.0
"""How long before its time of ephemeris a set is received [s]: each is used around the middle of its validity."""
BLEND_S: Final = 600.0
"""Time in which a satellite passes from one recorded orbit to the next [s]."""
# An epoch's times of transmission and reception, and the epoch before, lie within this of its time tag.
_NEAR_S: Final = 61.0
_ACCURACY_M: Final = (2.0, 3.12)

Arc = Callable[[FloatArray], SatelliteState]
"""State of all satellites at times of transmission ``(..., N_SATS)`` in seconds of one week."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Orbits:
    """The satellites of one world.

    Attributes
    ----------
    truth : tuple of Ephemeris
        Orbits and clocks as they are, one after the other; a satellite that is in none does not exist then.
    switch_s : tuple of float
        When each passes to the next, seconds since the start of GPS time; one fewer.
    received : tuple of Ephemeris
        What is broadcast, in order of reception.
    """

    truth: tuple[Ephemeris, ...]
    switch_s: tuple[float, ...]
    received: tuple[Ephemeris, ...]

    def arc(self, gps_week: int, tow_s: float) -> Arc:
        """The satellites around a time."""
        at_s = gps_week * SECONDS_PER_WEEK + tow_s
        place = int(np.searchsorted(self.switch_s, at_s))
        for switch in (place - 1, place):
            if 0 <= switch < len(self.switch_s) and abs(at_s - self.switch_s[switch]) < 0.5 * BLEND_S + _NEAR_S:
                middle_s = self.switch_s[switch] - gps_week * SECONDS_PER_WEEK
                return _Blend(self.truth[switch], self.truth[switch + 1], gps_week, middle_s).state
        truth = self.truth[place]
        return lambda times: satellite_state(truth, gps_week, times, None)

    def transmitting(self, gps_week: int, tow_s: float) -> NDArray[np.bool_]:
        """Satellites ``(N_SATS,)`` that exist at a time."""
        place = int(np.searchsorted(self.switch_s, gps_week * SECONDS_PER_WEEK + tow_s))
        return np.isfinite(self.truth[place].sqrt_a)


@dataclass(frozen=True, kw_only=False, eq=False)
class _Blend:
    """From one orbit to the next, along a curve whose rate is continuous; a satellite in one only stays on it."""

    before: Ephemeris
    after: Ephemeris
    gps_week: int
    middle_s: float

    def state(self, times_s: FloatArray) -> SatelliteState:
        """State at times in seconds of the week; the velocity is the derivative of the position."""
        old, new = (satellite_state(each, self.gps_week, times_s, None) for each in (self.before, self.after))
        passed = np.clip((times_s - self.middle_s) / BLEND_S + 0.5, 0.0, 1.0)
        share = passed**2 * (3.0 - 2.0 * passed)
        rate = 6.0 * passed * (1.0 - passed) / BLEND_S
        position = _between(old.position_m, new.position_m, share[..., np.newaxis, :])
        velocity = _between(old.velocity_mps, new.velocity_mps, share[..., np.newaxis, :])
        clock = _between(old.clock_s, new.clock_s, share)
        drift = _between(old.clock_drift, new.clock_drift, share)
        return SatelliteState(
            position_m=position,
            velocity_mps=velocity + _zero_if_missing(rate[..., np.newaxis, :] * (new.position_m - old.position_m)),
            clock_s=clock,
            clock_drift=drift + _zero_if_missing(rate * (new.clock_s - old.clock_s)),
        )


def _between(old: FloatArray, new: FloatArray, share: FloatArray) -> FloatArray:
    blended = old + share * (new - old)
    return np.where(np.isnan(blended), np.where(np.isnan(old), new, old), blended)


def _zero_if_missing(values: FloatArray) -> FloatArray:
    return np.where(np.isnan(values), 0.0, values)


# --- sources


def nominal_orbits(gps_week: int, tow_s: float, duration_s: float, *, seed: int, systems: NDArray[np.bool_]) -> Orbits:
    """The nominal constellations; the first ephemeris broadcast is the truth itself.

    Parameters
    ----------
    gps_week, tow_s, duration_s
        Start and duration of the run [s].
    seed : int
        Of clocks and group delays.
    systems : (N_SATS,) bool array
        Satellites wanted.
    """
    return _kept(nominal_ephemeris(gps_week, tow_s, seed=seed, systems=systems), gps_week, tow_s, duration_s)


def almanac_orbits(
    path: str | Path, gps_week: int, tow_s: float, duration_s: float, *, seed: int, systems: NDArray[np.bool_]
) -> Orbits:
    """The healthy satellites of a YUMA or SEM almanac, with group delays drawn from the seed.

    Raises
    ------
    AlmanacError
        When the file cannot be used.
    """
    almanac = ephemeris_from_almanac(read_almanac(path, near_week=gps_week))
    present = np.isfinite(almanac.sqrt_a) & (almanac.health == 0.0) & systems
    if not present.any():
        raise AlmanacError(f"{path}: has no healthy satellite of the systems wanted")
    delays = {name: np.where(present, values, np.nan) for name, values in group_delays_s(seed).items()}
    kept: dict[str, Any] = {
        name: np.where(present, getattr(almanac, name), np.nan) for name in FIELDS if name not in delays
    }
    first = renewed(replace(almanac, **kept | delays), *time_of_ephemeris(gps_week, tow_s))
    week, tow = from_epoch_key(epoch_key(gps_week, tow_s) - round(RECEIVED_BEFORE_S * 1000.0))
    return _kept(replace(first, gps_week=week, tow_s=tow), gps_week, tow_s, duration_s)


def recorded_orbits(
    paths: Sequence[str | Path], gps_week: int, tow_s: float, duration_s: float, *, systems: NDArray[np.bool_]
) -> Orbits:
    """The orbits of RINEX navigation files; ephemerides are received when they were sent.

    Raises
    ------
    RinexError
        When a file cannot be used, or holds nothing that is valid at the start.
    """
    navigation = read_navigation(list(paths))
    if not (navigation.valid_at(gps_week, tow_s) & systems).any():
        start = f"week {gps_week}, {tow_s:g} s"
        raise RinexError(navigation.paths[0], f"{navigation.describe()}; nothing is valid at the start, {start}")
    start_s = gps_week * SECONDS_PER_WEEK + tow_s
    # Satellites change over at even hours, when GPS begins to send the ephemeris of the end of the two hours to come.
    slots = range(int(start_s // RENEWAL_S), int((start_s + duration_s) // RENEWAL_S) + 1)
    truth = tuple(_of_slot(navigation, RENEWAL_S * slot, systems) for slot in slots)
    last_key = epoch_key(gps_week, tow_s) + round(duration_s * 1000.0)
    heard = navigation.received(gps_week, tow_s)
    received = [each for each in heard if epoch_key(each.gps_week, each.tow_s) <= last_key]
    return Orbits(
        truth=truth,
        switch_s=tuple(RENEWAL_S * slot for slot in slots[1:]),
        received=tuple(_only(replace(each, simulated=1.0), systems) for each in received),
    )


def _of_slot(navigation: NavigationFile, start_s: float, systems: NDArray[np.bool_]) -> Ephemeris:
    """The record of each satellite that is in use in the two hours from a time on, if there is a valid one.

    GPS satellites send an ephemeris before its time. Galileo satellites send theirs after it, and new ones every ten
    minutes, of which that of the start is taken: they describe what comes after them, and badly what was before.
    """
    middle_s = start_s + 0.5 * RENEWAL_S
    wanted_s = np.where(IS_GPS[navigation.satellite], start_s + RENEWAL_S, start_s)
    away_s = np.abs(navigation.toe_s - wanted_s)
    values = np.full((len(FIELDS), N_SATS), np.nan)
    for row in np.argsort(-away_s, kind="stable"):
        satellite = navigation.satellite[row]
        if systems[satellite] and away_s[row] <= VALIDITY_S[satellite]:
            values[:, satellite] = navigation.values[row]
    week, tow_s = from_epoch_key(round(middle_s * 1000.0))
    columns: dict[str, Any] = dict(zip(FIELDS, values, strict=True))
    return Ephemeris(gps_week=week, tow_s=tow_s, simulated=1.0, **columns)


def _only(ephemeris: Ephemeris, satellites: NDArray[np.bool_]) -> Ephemeris:
    kept: dict[str, Any] = {name: np.where(satellites, getattr(ephemeris, name), np.nan) for name in FIELDS}
    return replace(ephemeris, **kept)


def _kept(truth: Ephemeris, gps_week: int, tow_s: float, duration_s: float) -> Orbits:
    """An orbit that is the truth throughout, and the sets broadcast of it."""
    toe_week, toe_s = time_of_ephemeris(gps_week, tow_s)
    received = [truth]
    for number in range(1, int((duration_s + RECEIVED_BEFORE_S) / RENEWAL_S) + 1):
        week, tow = from_epoch_key(epoch_key(toe_week, toe_s) + round(number * RENEWAL_S * 1000.0))
        received.append(renewed(truth, week, tow))
    return Orbits(truth=(truth,), switch_s=(), received=tuple(received))


def renewed(truth: Ephemeris, toe_week: int, toe_tow_s: float) -> Ephemeris:
    """An orbit without harmonic terms as the ephemeris of another time; every field a multiple of its scale factor.

    Received :data:`RECEIVED_BEFORE_S` before. Source: IS-GPS-200N table 20-IV, whose angles are linear in time.
    """
    since_s = (toe_week - truth.toe_week) * SECONDS_PER_WEEK + (toe_tow_s - truth.toe_tow_s)
    since_clock_s = (toe_week - truth.toc_week) * SECONDS_PER_WEEK + (toe_tow_s - truth.toc_tow_s)
    motion = np.sqrt(GM_M3PS2) / truth.sqrt_a**3 + truth.delta_n_radps
    # The longitude of the node counts from the start of its week.
    node = truth.omega_dot_radps * since_s - EARTH_RATE_RADPS * SECONDS_PER_WEEK * (toe_week - truth.toe_week)
    fields = {
        "m0_rad": truth.m0_rad + motion * since_s,
        "omega0_rad": truth.omega0_rad + node,
        "i0_rad": truth.i0_rad + truth.idot_radps * since_s,
        "af0_s": truth.af0_s + truth.af1_sps * since_clock_s,
    }
    present = np.isfinite(truth.sqrt_a)
    issue = np.where(present, issue_of(toe_week, toe_tow_s), np.nan)
    times: dict[str, Any] = {f"{which}_{part}": np.where(present, value, np.nan) for which in ("toe", "toc")
             for part, value in (("week", float(toe_week)), ("tow_s", toe_tow_s))}  # fmt: skip
    elements: dict[str, Any] = quantised_fields({name: getattr(truth, name) for name in FIELDS} | fields)
    week, tow = from_epoch_key(epoch_key(toe_week, toe_tow_s) - round(RECEIVED_BEFORE_S * 1000.0))
    return replace(
        truth,
        gps_week=week,
        tow_s=tow,
        message=np.where(present, _messages(), np.nan),
        iod=issue,
        iodc=np.where(IS_GPS, issue, np.nan),
        health=np.where(present, 0.0, np.nan),
        accuracy_m=np.where(present, np.where(IS_GPS, *_ACCURACY_M), np.nan),
        **times,
        **elements,
    )


def _messages() -> FloatArray:
    return np.where(IS_GPS, float(NavigationMessage.GPS_LNAV), float(NavigationMessage.GALILEO_INAV))

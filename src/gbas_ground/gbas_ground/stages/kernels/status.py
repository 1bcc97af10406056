"""States of satellites and channels, reason by reason, and for how long they have been."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from gbas_core.compiled import compiled
from gbas_core.record import BoolArray, FloatArray, IntArray
from gbas_ground.corrections.sigma import MAX_SIGMA_M
from gbas_msgs_py.codes import FIRST_LATCHED, ChannelState, ExclusionCause

_NOT_TRACKED: Final = float(ChannelState.NOT_TRACKED)
_SETTLING: Final = float(ChannelState.SETTLING)
USABLE: Final = float(ChannelState.USABLE)
_EXCLUDED: Final = float(ChannelState.EXCLUDED)
_RECOVERING: Final = float(ChannelState.RECOVERING)
_CAUSE_NONE: Final = float(ExclusionCause.NONE)
_CAUSE_NOT_TRACKED: Final = float(ExclusionCause.NOT_TRACKED)
_CAUSE_SETTLING: Final = float(ExclusionCause.SETTLING)
_BELOW_MASK: Final = float(ExclusionCause.BELOW_MASK)
_NO_EPHEMERIS: Final = float(ExclusionCause.NO_EPHEMERIS)
_TOO_FEW_RECEIVERS: Final = float(ExclusionCause.TOO_FEW_RECEIVERS)
_TOO_FEW_COMMON: Final = float(ExclusionCause.TOO_FEW_COMMON_SATELLITES)
_SIGMA_TOO_LARGE: Final = float(ExclusionCause.SIGMA_TOO_LARGE)
_NO_RATE: Final = float(ExclusionCause.NO_RATE)
_UNMONITORED: Final = float(ExclusionCause.UNMONITORED)


class Channels(NamedTuple):
    """What is known of channels ``(R, N)`` before their satellites are decided on.

    Attributes
    ----------
    tracked, settled, used : (R, N) bool arrays
    age_s : (R, N) array
        Time that the filters have run; NaN where they do not.
    cause, receiver_cause : (R, N), (R,) int arrays
        Of exclusions, 0 where there is none.
    clear_s, receiver_clear_s : (R, N), (R,) arrays
        Time that these are clear.
    """

    tracked: BoolArray
    settled: BoolArray
    used: BoolArray
    age_s: FloatArray
    cause: IntArray
    clear_s: FloatArray
    receiver_cause: IntArray
    receiver_clear_s: FloatArray


class Satellites(NamedTuple):
    """What is known of satellites ``(N,)`` before they are decided on.

    Attributes
    ----------
    judged : (N,) bool array
        Those that every required monitor of signals could judge.
    cause : (N,) int array
        Of exclusions, clear for `clear_s`.
    clear_s, elevation_rad, ephemeris_crc : (N,) arrays
    receivers : (N,) array
        How many are behind each correction.
    prc_m, rrc_mps : (tau, N) arrays
    sigmas_m : (3, N) array
    """

    judged: BoolArray
    cause: IntArray
    clear_s: FloatArray
    elevation_rad: FloatArray
    ephemeris_crc: FloatArray
    receivers: FloatArray
    prc_m: FloatArray
    rrc_mps: FloatArray
    sigmas_m: FloatArray


@compiled
def state_of_exclusion(clear_s: float) -> float:
    """RECOVERING where the clear time counts, else EXCLUDED."""
    return _RECOVERING if clear_s > 0.0 else _EXCLUDED


@compiled
def satellite_states(
    channels: Channels, satellites: Satellites, min_receivers: int, mask_rad: float
) -> tuple[FloatArray, FloatArray]:
    """State and cause of every satellite, each ``(N,)``: of several reasons against its use the first."""
    n_sats = len(satellites.receivers)
    state, cause = np.empty(n_sats), np.empty(n_sats)
    for i in range(n_sats):
        judged, elevation_rad = satellites.judged[i], satellites.elevation_rad[i]
        seen, ready, settled, settling, of_channels = False, 0, 0, 0, 0
        for m in range(len(channels.tracked)):
            seen = seen or channels.tracked[m, i]
            own, of_receiver = channels.cause[m, i], channels.receiver_cause[m]
            of_channels = max(of_channels, of_receiver if channels.tracked[m, i] and of_receiver != 0 else own)
            if own == 0 and of_receiver == 0:
                settled += channels.settled[m, i]
                if channels.settled[m, i] and judged:
                    ready += 1
                elif math.isfinite(channels.age_s[m, i]):
                    settling += 1
        visible = elevation_rad >= mask_rad
        if not seen or not visible or math.isnan(satellites.ephemeris_crc[i]):
            known = not math.isnan(elevation_rad + satellites.ephemeris_crc[i])
            state[i], cause[i] = state_of_unseen(seen, visible, known)
        elif satellites.cause[i] != 0:
            state[i], cause[i] = state_of_exclusion(satellites.clear_s[i]), float(satellites.cause[i])
        elif satellites.receivers[i] < min_receivers:
            unmonitored = not judged and settled >= min_receivers
            state[i], cause[i] = state_of_few(ready, settling, unmonitored, of_channels, min_receivers)
        else:
            sigma_fits, has_rate = True, True
            for each in range(len(satellites.sigmas_m)):
                sigma_fits = sigma_fits and 0.0 < satellites.sigmas_m[each, i] <= MAX_SIGMA_M
            for t in range(len(satellites.prc_m)):
                has_rate = has_rate and math.isfinite(satellites.prc_m[t, i] + satellites.rrc_mps[t, i])
            state[i], cause[i] = state_of_corrected(sigma_fits, has_rate)
    return state, cause


@compiled
def state_of_unseen(seen: bool, visible: bool, known: bool) -> tuple[float, float]:
    """Of a satellite that is not seen, not visible, or whose orbit is not known."""
    if not seen:
        return _NOT_TRACKED, _CAUSE_NOT_TRACKED if visible else _CAUSE_NONE
    return _EXCLUDED, _BELOW_MASK if known else _NO_EPHEMERIS


@compiled
def state_of_few(
    ready: int, settling: int, unmonitored: bool, of_channels: int, min_receivers: int
) -> tuple[float, float]:
    """Of a satellite with fewer receivers behind its correction than the station needs.

    So many channels are ready and so many settling; `of_channels` is the largest cause of exclusions of its channels.
    """
    if ready < min_receivers <= ready + settling:
        return _SETTLING, _UNMONITORED if unmonitored else _CAUSE_SETTLING
    if of_channels >= FIRST_LATCHED:
        return _EXCLUDED, float(of_channels)
    return _EXCLUDED, _TOO_FEW_COMMON if ready >= min_receivers else _TOO_FEW_RECEIVERS


@compiled
def state_of_corrected(sigma_fits: bool, has_rate: bool) -> tuple[float, float]:
    """Of a satellite with enough receivers behind its correction."""
    if not sigma_fits:
        return _EXCLUDED, _SIGMA_TOO_LARGE
    return (USABLE, _CAUSE_NONE) if has_rate else (_EXCLUDED, _NO_RATE)


@compiled
def has_row(state: float, cause: float) -> bool:
    """Whether there is anything to say of a satellite."""
    return state != _NOT_TRACKED or cause != _CAUSE_NONE


@compiled
def state_of_free(tracked: bool, used: bool, settling: bool, state: float, cause: float) -> tuple[float, float]:
    """Of a channel that nothing excludes, of a satellite in a state with a cause."""
    if not tracked:
        return _NOT_TRACKED, _CAUSE_NOT_TRACKED
    if used and state == USABLE:
        return USABLE, _CAUSE_NONE
    if settling and cause != _BELOW_MASK:
        return _SETTLING, _CAUSE_SETTLING
    # a channel that is ready and not used has its satellite's reason, or its receiver is not in use
    return _EXCLUDED if state == USABLE else state, _TOO_FEW_COMMON if cause == _CAUSE_NONE else cause


@compiled
def enter(
    table: FloatArray, before: FloatArray, row: int, i: int, state: float, cause: float, elapsed_s: float
) -> None:
    """Enter a state with a cause, and how long it has been so [s]."""
    table[0, row, i], table[1, row, i], table[2, row, i] = state, cause, 0.0
    if state == before[0, row, i] and cause == before[1, row, i] and not math.isnan(before[2, row, i]):
        table[2, row, i] = before[2, row, i] + elapsed_s


@compiled
def channel_table(
    channels: Channels, state: FloatArray, cause: FloatArray, before: FloatArray, elapsed_s: float, n_rows: int
) -> FloatArray:
    """The executive's table: state, cause and their time [s] of satellites and channels.

    Parameters
    ----------
    channels : Channels
    state, cause : (N,) arrays
    before : (3, 1 + n_rows, N) array
        Of the epoch before.
    elapsed_s : float
        Since then.
    n_rows : int
        Receivers that the table has room for.

    Returns
    -------
    (3, 1 + n_rows, N) array
        The satellites, then the channels of each receiver; NaN where there is nothing to say.
    """
    table = np.full((3, 1 + n_rows, len(state)), np.nan)
    for i in range(len(state)):
        if not has_row(state[i], cause[i]):
            continue
        enter(table, before, 0, i, state[i], cause[i], elapsed_s)
        shown = False
        for m in range(len(channels.tracked)):
            shown = shown or channels.tracked[m, i] or channels.cause[m, i] != 0
        for m in range(len(channels.tracked) if shown else 0):
            # what is wrong with a channel itself comes before what is wrong with its satellite
            own, of_receiver = channels.cause[m, i], channels.receiver_cause[m]
            if own != 0:
                its_state, its_cause = state_of_exclusion(channels.clear_s[m, i]), float(own)
            elif of_receiver != 0:
                its_state, its_cause = state_of_exclusion(channels.receiver_clear_s[m]), float(of_receiver)
            else:
                settling = math.isfinite(channels.age_s[m, i]) and not channels.settled[m, i]
                its_state, its_cause = state_of_free(
                    channels.tracked[m, i], channels.used[m, i], settling, state[i], cause[i]
                )
            enter(table, before, 1 + m, i, its_state, its_cause, elapsed_s)
    return table


@compiled
def used_of_usable(used: BoolArray, state: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Channels ``(R, N)`` behind the corrections of usable satellites, and receivers ``(R,)`` that have one."""
    channels, receivers = np.zeros(used.shape, dtype=np.bool_), np.zeros(len(used), dtype=np.bool_)
    for m in range(used.shape[0]):
        for i in range(used.shape[1]):
            channels[m, i] = used[m, i] and state[i] == USABLE
            receivers[m] = receivers[m] or channels[m, i]
    return channels, receivers

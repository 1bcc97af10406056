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
    """State and cause of every satellite, each ``(N,)``."""
    n_sats = len(satellites.receivers)
    state, cause = np.empty(n_sats), np.empty(n_sats)
    for i in range(n_sats):
        state[i], cause[i] = satellite_state(channels, satellites, i, min_receivers, mask_rad)
    return state, cause


@compiled
def satellite_state(
    channels: Channels, satellites: Satellites, i: int, min_receivers: int, mask_rad: float
) -> tuple[float, float]:
    """State and cause of one satellite: of several reasons against its use the first."""
    seen, ready, settled, settling, of_channels = False, 0, 0, 0, 0
    for m in range(len(channels.tracked)):
        seen = seen or channels.tracked[m, i]
        cause, of_receiver = channels.cause[m, i], channels.receiver_cause[m]
        of_channels = max(of_channels, of_receiver if channels.tracked[m, i] and of_receiver != 0 else cause)
        if cause == 0 and of_receiver == 0:
            settled += channels.settled[m, i]
            if channels.settled[m, i] and satellites.judged[i]:
                ready += 1
            elif math.isfinite(channels.age_s[m, i]):
                settling += 1
    visible = satellites.elevation_rad[i] >= mask_rad
    short = satellites.receivers[i] < min_receivers
    waiting = short and ready < min_receivers <= ready + settling
    if not seen:
        return _NOT_TRACKED, _CAUSE_NOT_TRACKED if visible else _CAUSE_NONE
    if math.isnan(satellites.elevation_rad[i] + satellites.ephemeris_crc[i]):
        return _EXCLUDED, _NO_EPHEMERIS
    if not visible:
        return _EXCLUDED, _BELOW_MASK
    if satellites.cause[i] != 0:
        return state_of_exclusion(satellites.clear_s[i]), float(satellites.cause[i])
    if waiting:
        monitors = not satellites.judged[i] and settled >= min_receivers
        return _SETTLING, _UNMONITORED if monitors else _CAUSE_SETTLING
    if short and of_channels >= FIRST_LATCHED:
        return _EXCLUDED, float(of_channels)
    if short:
        return _EXCLUDED, _TOO_FEW_COMMON if ready >= min_receivers else _TOO_FEW_RECEIVERS
    for each in range(len(satellites.sigmas_m)):
        if not 0.0 < satellites.sigmas_m[each, i] <= MAX_SIGMA_M:
            return _EXCLUDED, _SIGMA_TOO_LARGE
    for t in range(len(satellites.prc_m)):
        if not math.isfinite(satellites.prc_m[t, i] + satellites.rrc_mps[t, i]):
            return _EXCLUDED, _NO_RATE
    return USABLE, _CAUSE_NONE


@compiled
def has_row(state: float, cause: float) -> bool:
    """Whether there is anything to say of a satellite."""
    return state != _NOT_TRACKED or cause != _CAUSE_NONE


@compiled
def channel_state(channels: Channels, m: int, i: int, state: float, cause: float) -> tuple[float, float]:
    """State and cause of one channel, of a satellite in a state with a cause.

    What is wrong with a channel itself comes before what is wrong with its satellite.
    """
    if channels.cause[m, i] != 0:
        return state_of_exclusion(channels.clear_s[m, i]), float(channels.cause[m, i])
    if channels.receiver_cause[m] != 0:
        return state_of_exclusion(channels.receiver_clear_s[m]), float(channels.receiver_cause[m])
    if not channels.tracked[m, i]:
        return _NOT_TRACKED, _CAUSE_NOT_TRACKED
    if channels.used[m, i] and state == USABLE:
        return USABLE, _CAUSE_NONE
    if math.isfinite(channels.age_s[m, i]) and not channels.settled[m, i] and cause != _BELOW_MASK:
        return _SETTLING, _CAUSE_SETTLING
    # a channel that is ready and not used has its satellite's reason, or its receiver is not in use
    return _EXCLUDED if state == USABLE else state, _TOO_FEW_COMMON if cause == _CAUSE_NONE else cause


@compiled
def time_in_state(state: float, cause: float, before: FloatArray, elapsed_s: float) -> float:
    """Time in a state with a cause; `before` are those of the epoch before and their time [s]."""
    if state == before[0] and cause == before[1] and not math.isnan(before[2]):
        return float(before[2]) + elapsed_s
    return 0.0


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
        table[0, 0, i], table[1, 0, i] = state[i], cause[i]
        table[2, 0, i] = time_in_state(state[i], cause[i], before[:, 0, i], elapsed_s)
        shown = False
        for m in range(len(channels.tracked)):
            shown = shown or channels.tracked[m, i] or channels.cause[m, i] != 0
        if shown:
            for m in range(len(channels.tracked)):
                its_state, its_cause = channel_state(channels, m, i, state[i], cause[i])
                table[0, 1 + m, i], table[1, 1 + m, i] = its_state, its_cause
                table[2, 1 + m, i] = time_in_state(its_state, its_cause, before[:, 1 + m, i], elapsed_s)
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

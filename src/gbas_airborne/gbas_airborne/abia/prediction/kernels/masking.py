# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""Which satellites an antenna sees at an attitude; one formula for the flags, the prediction and the studies."""

from __future__ import annotations

import math

import numpy as np

from gbas_core.compiled import compiled

SIN_HORIZON, SIN_TOP = 3, 4
"""Places in the vector of an antenna, after its axis (forward, right, down): sines of its horizon, and of the elevation
in the body frame above which the airframe hides nothing."""


@compiled
def rotation(bank, pitch, heading, antenna, rot):
    """Rotation from east, north, up to the body frame (forward, right, down) into ``rot`` (4, 3).

    The last row is the antenna's axis in local axes.

    Source: Stevens, Lewis and Johnson (2016), eq (1.3-10), with east and north changed over and up for down.
    """
    sb, cb = math.sin(bank), math.cos(bank)
    sp, cp = math.sin(pitch), math.cos(pitch)
    sh, ch = math.sin(heading), math.cos(heading)
    rot[0, 0], rot[0, 1], rot[0, 2] = cp * sh, cp * ch, sp
    rot[1, 0], rot[1, 1], rot[1, 2] = sb * sp * sh + cb * ch, sb * sp * ch - cb * sh, -sb * cp
    rot[2, 0], rot[2, 1], rot[2, 2] = cb * sp * sh - sb * ch, cb * sp * ch + sb * sh, -cb * cp
    for k in range(3):
        rot[3, k] = antenna[0] * rot[0, k] + antenna[1] * rot[1, k] + antenna[2] * rot[2, k]


@compiled
def sees(rot, los, i, blocked, antenna):
    """Whether satellite i is seen: above the antenna's horizon, and the airframe is not in the way, as
    :class:`~gbas_airborne.abia.airframe.mask_table.MaskTable` has it; one without a line of sight (NaN) is not.
    """
    east, north, up = los[0, i], los[1, i], los[2, i]
    if not rot[3, 0] * east + rot[3, 1] * north + rot[3, 2] * up >= antenna[SIN_HORIZON]:
        return False
    down = rot[2, 0] * east + rot[2, 1] * north + rot[2, 2] * up
    if -down > antenna[SIN_TOP]:
        return True
    forward = rot[0, 0] * east + rot[0, 1] * north + rot[0, 2] * up
    right = rot[1, 0] * east + rot[1, 1] * north + rot[1, 2] * up
    columns, rows = blocked.shape
    elevation = math.asin(min(max(-down, -1.0), 1.0))
    column = math.floor(math.atan2(right, forward) * (columns / (2.0 * math.pi))) % columns
    row = min(int((elevation / math.pi + 0.5) * rows), rows - 1)
    return not blocked[column, row]


@compiled
def count_seen(rot, los, blocked, antenna):
    """How many satellites are seen with that rotation."""
    count = 0
    for i in range(los.shape[1]):
        count += sees(rot, los, i, blocked, antenna)
    return count


@compiled
def all_seen(attitudes, los, blocked, antenna):
    """Satellites seen at attitudes (M, 3) of bank, pitch and heading, (M, N) bool; one not finite sees none."""
    seen = np.zeros((attitudes.shape[0], los.shape[1]), np.bool_)
    rot = np.empty((4, 3))
    for m in range(attitudes.shape[0]):
        rotation(attitudes[m, 0], attitudes[m, 1], attitudes[m, 2], antenna, rot)
        for i in range(los.shape[1]):
            seen[m, i] = sees(rot, los, i, blocked, antenna)
    return seen


@compiled
def first_lost(attitudes, step, los, blocked, antenna, required):
    """When too few satellites are seen first, (H,), and each is first not seen, (H, N), infinite when never [s].

    attitudes are (H, K, 3); K of them a step apart.
    """
    n_ways, n_steps, _ = attitudes.shape
    short = np.full(n_ways, math.inf)
    lost = np.full((n_ways, los.shape[1]), math.inf)
    rot = np.empty((4, 3))
    for h in range(n_ways):
        for k in range(n_steps):
            rotation(attitudes[h, k, 0], attitudes[h, k, 1], attitudes[h, k, 2], antenna, rot)
            count = 0
            for i in range(los.shape[1]):
                seen = sees(rot, los, i, blocked, antenna)
                count += seen
                if not seen and lost[h, i] == math.inf:
                    lost[h, i] = k * step
            if count < required and short[h] == math.inf:
                short[h] = k * step
    return short, lost


@compiled
def harmless_tilts(los, sin_horizon, required, sectors):
    """Tilt up to which an antenna on top without an airframe keeps the required satellites, by where it tilts to [rad].

    For each of so many sectors of azimuth, from north clockwise, the worst direction of it.

    A satellite's elevation in the frame of an antenna tilted by t towards it at an angle a is that of
    sin(elevation) cos(t) + cos(elevation) cos(a) sin(t) = r cos(t - phi): it is seen up to phi + acos(sin_horizon / r).
    That is below pi; a satellite that is not seen without tilt counts as never seen.
    """
    tilts = np.empty(sectors)
    bounds = np.empty(los.shape[1])
    half = math.pi / sectors
    for sector in range(sectors):
        towards = (sector + 0.5) * 2.0 * half
        for i in range(los.shape[1]):
            bounds[i] = -1.0
            up = los[2, i]
            if not up >= sin_horizon:
                continue
            apart = (math.atan2(los[0, i], los[1, i]) - towards) % (2.0 * math.pi)
            apart = min(apart, 2.0 * math.pi - apart)
            along = math.cos(min(apart + half, math.pi)) * math.sqrt(max(1.0 - up * up, 0.0))
            size = math.hypot(up, along)
            if size > sin_horizon:
                bounds[i] = math.atan2(along, up) + math.acos(sin_horizon / size)
        tilts[sector] = -1.0
        if los.shape[1] >= required:
            ordered = np.sort(bounds)
            tilts[sector] = ordered[los.shape[1] - required]
    return tilts


@compiled
def is_harmless(bank, pitch, heading, harmless):
    """Whether an attitude tilts an antenna on top less than costs a required satellite; False without tilts."""
    sectors = harmless.shape[0]
    if sectors == 0:
        return False
    if pitch == 0.0:
        tilt, towards = abs(bank), heading + math.copysign(0.5 * math.pi, bank)
    else:
        right, forward = math.sin(bank), -math.cos(bank) * math.sin(pitch)
        tilt = math.atan2(math.hypot(right, forward), math.cos(bank) * math.cos(pitch))
        towards = heading + math.atan2(right, forward)
    return tilt < harmless[math.floor(towards * (sectors / (2.0 * math.pi))) % sectors]

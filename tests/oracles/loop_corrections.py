"""Corrections and B values by explicit loops over satellites and receivers: the equations word by word."""

from __future__ import annotations

import math


def corrections(pr_sc, used, constellations):
    """PRC and B values of one smoothing constant.

    Parameters
    ----------
    pr_sc : list of lists
        pr_sc[m][i]: correction of receiver m for satellite i with the receiver clock in it; None where not tracked.
    used : list of lists of bool
        Channels that may be used. Every receiver with a usable channel in a constellation counts as in use there.
    constellations : list of lists of int
        Satellites of each constellation.

    Returns
    -------
    prc : dict of satellite to float
    b : dict of (satellite, receiver) to float; satellites with one receiver have none
    """
    prc, b = {}, {}
    for satellites in constellations:
        receivers = [m for m in range(len(pr_sc)) if any(used[m][i] for i in satellites)]
        common = [i for i in satellites if receivers and all(used[m][i] for m in receivers)]
        if not common:
            continue
        adjusted = {}
        for m in receivers:
            clock = math.fsum(pr_sc[m][j] for j in common) / len(common)
            for i in satellites:
                if used[m][i]:
                    adjusted[i, m] = pr_sc[m][i] - clock
        for i in satellites:
            mine = [m for m in receivers if used[m][i]]
            if not mine:
                continue
            prc[i] = math.fsum(adjusted[i, m] for m in mine) / len(mine)
            for m in mine:
                others = [adjusted[i, k] for k in mine if k != m]
                if others:
                    b[i, m] = prc[i] - math.fsum(others) / len(others)
    return prc, b

"""Corrections of ranges that still have the receiver's clock in them.

Sign: a correction is *added* by the user to the range it measured. The clocks are removed, and receivers averaged, in
:mod:`gbas_ground.corrections.kernels.formation`.
"""

from __future__ import annotations

from gbas_core.record import FloatArray
from gbas_core.signals import SPEED_OF_LIGHT_MPS


def range_correction_m(geometric_range_m: FloatArray, range_m: FloatArray, satellite_clock_s: FloatArray) -> FloatArray:
    """Correction of a range that still has the receiver's clock in it: R - P - c dt_sv.

    Parameters
    ----------
    geometric_range_m : (..., R, N) array
        Range from the known antenna position to the broadcast orbit, with Earth rotation [m].
    range_m : (..., R, N) array
        Smoothed (or raw) pseudorange [m].
    satellite_clock_s : (..., R, N) array
        Broadcast satellite clock with relativity and group delay [s].

    Returns
    -------
    (..., R, N) array
        PR_sc [m].

    Notes
    -----
    Neither troposphere nor ionosphere is modelled: user and station share them.

    Source: ICAO Annex 10 vol. I, att. D 7.5 (form); RTCA DO-245A 3.2 (PR_sc).
    """
    return geometric_range_m - range_m - SPEED_OF_LIGHT_MPS * satellite_clock_s

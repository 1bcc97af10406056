"""The aircraft's divergence monitor: a satellite whose code and carrier drift apart is not used for a while.

Source: RTCA DO-253D (airborne CCD of GAST-D); Jiang, Milner, Macabiau, ENC 2015, 2.1 (filters, 100 s, 0.0125 m/s). The
rule of re-admission is ours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gbas_airborne.params import AirborneParams
from gbas_core.ranging.divergence import DivergenceParams, DivergenceState, divergence_step, initial_divergence, settled
from gbas_core.record import BoolArray, FloatArray
from gbas_core.satellites import N_SATS
from gbas_core.signals import N_BANDS


@dataclass(frozen=True, kw_only=True, eq=False)
class DivergenceMemory:
    """Filters of all bands ``(N_BANDS, N_SATS)``, and how long each rate has been small since it was not [s]."""

    filters: DivergenceState
    small_s: FloatArray

    @classmethod
    def initial(cls, params: AirborneParams) -> DivergenceMemory:
        """Filters that have seen nothing."""
        filters = initial_divergence(_filter_params(params), N_BANDS)
        return cls(filters=filters, small_s=np.full((N_BANDS, N_SATS), np.inf))


@dataclass(frozen=True, kw_only=True, eq=False)
class Divergence:
    """Verdicts ``(N_BANDS, N_SATS)``: the filtered rate [m/s], whether it counts, and whether it excludes."""

    rate_mps: FloatArray
    counts: BoolArray
    excluded: BoolArray


def monitor_divergence(
    memory: DivergenceMemory,
    code_m: FloatArray,
    carrier_m: FloatArray,
    slipped: BoolArray,
    dt_s: float,
    params: AirborneParams,
) -> tuple[DivergenceMemory, Divergence]:
    """Filter the rate of code minus carrier of every channel ``(N_BANDS, N_SATS)``.

    An excluded channel that is lost stays so: the time of small rates goes on only while there are some.
    """
    settings = _filter_params(params)
    filters, _, rate_mps = divergence_step(memory.filters, code_m - carrier_m, slipped, dt_s, settings)
    counts = settled(filters, settings) & np.isfinite(rate_mps)
    large = counts & (np.abs(rate_mps) > params.gast_d.divergence_mps)
    small_s = np.where(large, 0.0, np.where(counts, memory.small_s + dt_s, memory.small_s))
    excluded = small_s < params.gast_d.divergence_clear_s
    return DivergenceMemory(filters=filters, small_s=small_s), Divergence(
        rate_mps=rate_mps, counts=counts, excluded=excluded | large
    )


def _filter_params(params: AirborneParams) -> DivergenceParams:
    return DivergenceParams(
        tau_s=params.gast_d.divergence_tau_s,
        max_gap_s=params.max_gap_s,
        settle_s=params.gast_d.divergence_settle_s,
    )

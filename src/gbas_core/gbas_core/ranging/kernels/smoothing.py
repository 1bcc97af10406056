# mypy: disable-error-code="no-untyped-call"
"""The filter of :mod:`gbas_core.ranging.smoothing`, compiled."""

from __future__ import annotations

import numpy as np

from gbas_core.compiled import compiled

VARIABLE, ELAPSED, INVARIANT = 0, 1, 2


@compiled
def hatch_step(smoothed_m, code_m, delta_phase_m, weight):  # type: ignore[no-untyped-def]
    """Carrier-smoothed code range one epoch later [m].

    Previous smoothed range, raw code range and carrier-range change since then [m]; weight T/tau, or 1/n while the
    filter fills [-].

    Source: Jiang, Milner, Macabiau, ENC 2015, eq (19).
    """
    return weight * code_m + (1.0 - weight) * (smoothed_m + delta_phase_m)


@compiled
def filter_weight(tau_s, dt_s, count, elapsed_s, start):  # type: ignore[no-untyped-def]
    """Weight of the new code of a filter that goes on [-]; ``start`` is VARIABLE, ELAPSED or INVARIANT.

    With a time constant of 0, or an interval above it, the filter is the raw code.
    """
    steady = dt_s / tau_s if tau_s > dt_s else 1.0
    if start == VARIABLE:
        return max(1.0 / max(count, 1.0), steady)
    if start == ELAPSED:
        return max(dt_s / elapsed_s if elapsed_s > 0.0 else 0.0, steady)
    return steady


@compiled
def smooth(  # type: ignore[no-untyped-def]
    code_m, carrier_m, slipped, bands, before_m, before_carrier_m, before_count, before_s, dt_s, max_gap_s, tau_s, start
):
    """Smoothed ranges ``(tau, R, bands, N)``; carriers, counts and ages ``(3, R, bands, N)``.

    ``code_m``, ``carrier_m`` and ``slipped`` are of all bands, ``bands`` those that are smoothed, the rest the state
    before; see :func:`gbas_core.ranging.smoothing.smooth_step`.
    """
    smoothed_m = np.full(before_m.shape, np.nan)
    memory = np.full((3, *before_s.shape), np.nan)
    last_m, count, age_s = memory[0], memory[1], memory[2]
    count[:] = 0.0
    goes_on = 0.0 < dt_s <= max_gap_s
    for r in range(before_s.shape[0]):
        for place, band in enumerate(bands):
            for s in range(before_s.shape[2]):
                code, carrier = code_m[r, band, s], carrier_m[r, band, s]
                if not np.isfinite(code + carrier):
                    continue
                last_m[r, place, s] = carrier
                if not (goes_on and before_count[r, place, s] > 0.0) or slipped[r, band, s]:
                    count[r, place, s], age_s[r, place, s] = 1.0, 0.0
                    smoothed_m[:, r, place, s] = code
                    continue
                count[r, place, s] = before_count[r, place, s] + 1.0
                age_s[r, place, s] = before_s[r, place, s] + dt_s
                delta_m = carrier - before_carrier_m[r, place, s]
                for t in range(tau_s.shape[0]):
                    weight = filter_weight(tau_s[t], dt_s, count[r, place, s], age_s[r, place, s], start)
                    smoothed_m[t, r, place, s] = hatch_step(before_m[t, r, place, s], code, delta_m, weight)
    return smoothed_m, memory

# mypy: disable-error-code="no-untyped-call, no-untyped-def"
"""The filters of divergence rates, as a formula of single numbers."""

from __future__ import annotations

from gbas_core.compiled import compiled


@compiled
def cascaded(f1, f2, rate, alpha):
    """Both filters one epoch later: ``F1 = (1 - a) F1 + a r`` and ``F2 = (1 - a) F2 + a F1``.

    Source: Jiang, Milner, Macabiau, ENC 2015, eq (3) and (4).
    """
    f1 = f1 + alpha * (rate - f1)
    return f1, f2 + alpha * (f1 - f2)

"""What the paper says about its statistics: noise after the filters, rank, null space, eq (16) to (18)."""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np

from gbas_core.ranging.combinations import combination_matrix, iono_ratio
from gbas_core.ranging.divergence import (
    GROUND,
    divergence_step,
    initial_divergence,
    settled,
    white_noise_gain,
    white_rate_gain,
)
from gbas_core.record import FloatArray
from gbas_core.signals import L1, L5
from gbas_ground.monitors.divergence_covariance import PRINTED_COVARIANCE
from gbas_studies.reproduction.items import Claim, Item, Section, Value

_EQ_7: Final = 1.0 / 120.0
"""Sigma after the filters over sigma before them, at 1 Hz and 30 s, as the paper has it."""
_RANK_TOLERANCE: Final = 1e-12
"""Of the largest singular value: a dependent row of coefficients near 5 leaves 1e-16 of rounding."""
# Known, misleading: eq (16) of ENC 2015. Coefficients as printed on the variances of (rho1, rho5, phi1, phi5); "" where
# there is none. The entries with 1/n are those of a known clock.
_EQ_16: Final[dict[tuple[int, int], tuple[str, str, str, str]]] = {
    (0, 0): ("2", "", "24.9", "12.8"),
    (1, 1): ("", "2", "41.0", "24.9"),
    (2, 2): ("10.2", "3.2", "10.2", "3.2"),
    (3, 3): ("10.2", "3.2", "", ""),
    (0, 1): ("", "", "32", "17.9"),
    (0, 2): ("4.52", "", "15.9", "6.4"),
    (0, 3): ("", "", "-15.9", "-6.4"),
    (1, 2): ("", "-2.5", "20.5", "8.9"),
    (1, 3): ("", "", "-20.5", "-8.9"),
    (2, 3): ("-2.26", "", "", "-3.2"),
}
_MEASUREMENTS: Final = ("code L1", "code L5", "carrier L1", "carrier L5")
_MISPRINTS: Final = {
    (3, 3): "Misprint: the carrier statistic has no code in it; its own carriers stand where the codes are printed, "
    "10.2 and 3.2 times (1 + 1/n).",
    (2, 3): "Misprint: the product has the carriers of both bands, -10.22 and -3.18, and no code.",
}


def algebra() -> Section:
    """Noise after the filters, rank and null space of the statistics, eq (16) and eq (18)."""
    matrix = combination_matrix(L1, L5)
    items: list[Item] = [
        _noise_after_filters(),
        _rank(matrix),
        _null_space(matrix),
        Value(
            name="Smallest eigenvalue of Q, eq (18)", ours=float(np.linalg.eigvalsh(PRINTED_COVARIANCE)[0]),
            unit="(m/s)²",
            definition="Of the printed matrix. It is negative: Q has no Cholesky factor, and eq (15) no meaning there.",
        ),
        *_coefficients(matrix),
        *_diagonal(),
    ]  # fmt: skip
    return Section(
        title="Structure of the GAST F statistics, eq (7) and (15) to (18)", items=items,
        text="Ours are exact coefficients; the paper rounds 3.5212, 2.5212 and 4.5212 to 3.53, 2.53 and 4.53 before it "
        "multiplies, which hides the singularity.",
    )  # fmt: skip


@cache
def noise_ratio(white: str, *, channels: int = 400, epochs: int = 400, seed: int = 7) -> float:
    """Sigma after the filters over that of the rate before them, of white noise that goes through the filters.

    Parameters
    ----------
    white : {"range", "rate"}
        What is white; a white rate is the difference of a random walk.
    channels, epochs : int
        Independent channels, and epochs of 1 s that count in each; neighbours are correlated over some 60 s.
    seed : int
    """
    rng = np.random.default_rng(seed)
    state = initial_divergence(GROUND, n_sats=channels)
    walk, before, after = np.zeros(channels), [], []
    slipped = np.zeros(channels, dtype=bool)
    for number in range(round(GROUND.settle_s) + epochs):
        noise = rng.standard_normal(channels)
        walk = walk + noise
        value = noise if white == "range" else walk
        state, rate, filtered = divergence_step(state, value, slipped, 1.0 if number else np.nan, GROUND)
        if settled(state, GROUND).all():
            before.append(rate)
            after.append(filtered)
    return float(np.sqrt(np.mean(np.square(after)) / np.mean(np.square(before))))


def _noise_after_filters() -> Claim:
    """Both whitenesses there can be, exact and through the filters themselves."""
    alpha = 1.0 / GROUND.tau_s
    exact = {"rate": white_rate_gain(alpha), "range": white_noise_gain(alpha) / np.sqrt(2.0)}
    ours = {name: f"1/{1.0 / gain:.2f} for white {name}s" for name, gain in exact.items()}
    simulated = ", ".join(f"1/{1.0 / noise_ratio(name):.2f}" for name in exact)
    return Claim(
        name="Noise after the filters, eq (7)", paper_text="σ(F2) = σ(dCMC) / 120 at 1 Hz",
        holds=any(abs(gain / _EQ_7 - 1.0) < 0.01 for gain in exact.values()), ours_text=", ".join(ours.values()),
        definition=f"Exact gains of the discrete filters at T = 1 s, to 1 %; {simulated} in 400 simulated channels.",
        why=f"α/4 = 1/120 is the ratio of variances ({exact['rate'] ** 2 * 120.0:.3f}/120 exactly), and of a white "
        "rate. The rate of white measurement noise is blue, and the filters reduce it more. Sigmas have to come from "
        "data.",
    )  # fmt: skip


def _rank(matrix: FloatArray) -> Claim:
    """Of the coefficients, and of the covariance that independent noise on the four measurements gives."""
    covariance = matrix @ matrix.T
    ranks = [
        int(np.linalg.matrix_rank(each, tol=_RANK_TOLERANCE * np.abs(each).max())) for each in (matrix, covariance)
    ]
    values = np.linalg.eigvalsh(covariance)
    weights = np.linalg.lstsq(matrix[[0, 1, 3]].T, matrix[2], rcond=None)[0]
    return Claim(
        name="Four statistics, 4 degrees of freedom", paper_text="4 independent statistics", holds=min(ranks) == 4,
        ours_text=f"rank {ranks[0]}, of the covariance {ranks[1]}",
        definition="Exact combination matrix, and the covariance of equal independent noise on all four measurements, "
        f"whose smallest eigenvalue is {values[0] / values[-1]:.0e} of the largest.",
        why=f"CMC_IF = {weights[0]:.4f} CMC_DF1 - {-weights[1]:.4f} CMC_DF5 exactly. The sound form of the monitor has "
        "three statistics.",
    )  # fmt: skip


def _null_space(matrix: FloatArray) -> Claim:
    """Rates of the four measurements with four zero means."""
    _, sizes, rows = np.linalg.svd(matrix)
    null = rows[sizes < _RANK_TOLERANCE * sizes[0]]
    found = [vector / vector[0] for vector in null]
    gamma = iono_ratio(L1, L5)
    is_ionosphere = len(found) == 1 and np.allclose(found[0], (1.0, gamma, -1.0, -gamma), atol=1e-12)
    texts = [f"({', '.join(f'{rate:.4g}' for rate in vector)}) has zero means" for vector in found]
    return Claim(
        name="Zero means only without fault", paper_text="means are zero only if all four rates are",
        holds=not found, ours_text="; ".join(texts) or "so",
        definition="Null space of the exact combination matrix; rates of code L1, code L5, carrier L1, carrier L5 for "
        "1 m/s of the first.",
        why="That is (1, γ, -1, -γ), how an ionosphere looks: invisible on purpose." if is_ionosphere
        else "These faults are invisible.",
    )  # fmt: skip


def _coefficients(matrix: np.ndarray) -> list[Item]:
    items: list[Item] = []
    for (row, column), printed in _EQ_16.items():
        for place, text in enumerate(printed):
            ours = float(2.0 * matrix[row, place] * matrix[column, place])
            if not text and abs(ours) < 1e-12:
                continue
            misprint = _MISPRINTS.get((row, column), "")
            items.append(
                Value(
                    name=f"Eq (16), Q({row + 1},{column + 1}), {_MEASUREMENTS[place]}", paper=text or "0", ours=ours,
                    unit="α/4T² σ²", tolerance=0.2 if not misprint else None,
                    kind="coefficient", definition="Twice the product of the two statistics' coefficients.",
                    why=misprint or "The paper multiplies rounded factors.",
                )
            )  # fmt: skip
    return items


def _diagonal() -> list[Item]:
    printed = {"DF1": "0.0012", "DF5": "0.0012", "IF code": "0.0031", "IF carrier": "0.00085"}
    return [
        Value(
            name=f"Eq (18) against table 2, {name}", paper=text, ours=float(np.sqrt(PRINTED_COVARIANCE[place, place])),
            unit="m/s", kind="input",
            definition="Root of the printed matrix's diagonal; table 2 gives it in m, which should be m/s.",
        )
        for place, (name, text) in enumerate(printed.items())
    ]  # fmt: skip

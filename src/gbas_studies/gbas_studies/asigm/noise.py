"""The statistic under noise: false alarms and missed detections, exactly, and by Monte Carlo.

Carriers of all receivers have independent Gaussian errors. The double differences of a star share the errors of the
first receiver, so their correlation is one half. Given those errors the baselines are independent, which makes the
probability that none of them detects one integral over the first receiver's error.

The paper assumes independent monitors and counts a gradient as detectable when its statistic is ``k sigma`` or more
away from a multiple: then one baseline alone misses it with 1e-4 at most, whatever the others do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from gbas_core.parameters import ParameterError
from gbas_core.record import FloatArray
from gbas_ground.monitors.gradient_detectability import (
    GRADIENT_RANGE,
    P_FALSE_ALARM,
    P_MISSED_DETECTION,
    BaselineMonitor,
    coverage_percent,
    wrap_m,
)
from gbas_siting.problem import SitingProblem
from gbas_siting.search import best_siting
from gbas_studies.asigm.detectability import WAVELENGTH, K
from gbas_studies.asigm.testbed import Testbed
from gbas_studies.campaign import Campaign, Execution, run
from gbas_studies.reproduction.drawing import LIMIT_COLOUR, new_figure
from gbas_studies.reproduction.items import Claim, Picture, Section, Value

_LOW, _HIGH = GRADIENT_RANGE
_MM_PER_KM: Final = 1e6
_CHUNK: Final = 250_000
# Gauss-Legendre over 8.5 standard deviations of the first receiver's error: what is outside has 2e-17.
_REACH: Final = 8.5
_NODES: Final = 200
MAX_SIGMA_M: Final = 0.02
_FARTHEST: Final = 5.0
"""Standard deviations by which a count of a Monte Carlo run may be off."""


def _require(name: str, value: object, condition: bool, expected: str) -> None:
    if not condition:
        raise ParameterError(f"{name} = {value!r} is not {expected}")


@dataclass(frozen=True, kw_only=True)
class Star:
    """Baselines from one receiver with equal noise, and their threshold.

    Attributes
    ----------
    lengths_m : tuple of float
        Along the runway [m].
    sigma_m : float
        Of the double difference; each receiver's part, between two satellites, has ``sigma / sqrt(2)`` [m].
    p_false_alarm : float
        Of one baseline.

    Raises
    ------
    ParameterError
        For values out of bounds.
    """

    lengths_m: tuple[float, ...]
    sigma_m: float
    p_false_alarm: float = P_FALSE_ALARM

    def __post_init__(self) -> None:
        lengths = self.lengths_m
        _require("baselines", lengths, bool(lengths) and all(0.0 < each <= 1e5 for each in lengths), "0 to 100 km each")
        # Above, the multiples that are left out of the sums count.
        _require("sigma_m", self.sigma_m, 0.0 < self.sigma_m <= MAX_SIGMA_M, f"above 0, at most {MAX_SIGMA_M} m")
        _require("p_false_alarm", self.p_false_alarm, 0.0 < self.p_false_alarm < 1.0, "between 0 and 1")

    @property
    def threshold_m(self) -> float:
        """Distance to the nearest multiple above which a baseline alerts, ``k_ffd sigma`` [m]."""
        return float(-ndtri(0.5 * self.p_false_alarm) * self.sigma_m)


def silent_probability(star: Star, gradients: FloatArray) -> FloatArray:
    """Probability that no baseline alerts, for each gradient ``(n,)``: P_md of the fused monitor.

    At gradient zero it is one minus P_fa.
    """
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    error = _REACH * nodes
    density = _REACH * weights * np.exp(-0.5 * error**2) / np.sqrt(2.0 * np.pi)
    own = star.sigma_m / np.sqrt(2.0)
    silent = np.ones((gradients.size, _NODES))
    for length_m in star.lengths_m:
        centre = gradients[:, np.newaxis] * length_m - own * error
        silent *= _near_a_multiple(centre, own, star.threshold_m)
    result: FloatArray = silent @ density
    return result


def baseline_silent_probability(star: Star, length_m: float, gradients: FloatArray) -> FloatArray:
    """Probability that one baseline does not alert, for each gradient ``(n,)``: its P_md."""
    return _near_a_multiple(gradients * length_m, star.sigma_m, star.threshold_m)


def _near_a_multiple(centre_m: FloatArray, sigma_m: float, threshold_m: float) -> FloatArray:
    """Probability that a Gaussian is within the threshold of any multiple of the wavelength."""
    wrapped = wrap_m(centre_m, WAVELENGTH)
    total = np.zeros_like(wrapped)
    for multiple in (-1.0, 0.0, 1.0):  # the next are 1.5 wavelengths away: 14 times a sigma of 20 mm
        offset = multiple * WAVELENGTH - wrapped
        total += ndtr((offset + threshold_m) / sigma_m) - ndtr((offset - threshold_m) / sigma_m)
    return np.minimum(total, 1.0)


def count_silent(star: Star, gradient: float, n_trials: int, random: np.random.Generator) -> int:
    """In how many of so many trials with noise no baseline alerts."""
    delay_m = gradient * np.asarray(star.lengths_m)
    return sum(
        int(_silent(star, delay_m, min(_CHUNK, n_trials - begin), random).sum()) for begin in range(0, n_trials, _CHUNK)
    )


def _silent(star: Star, delay_m: FloatArray, size: int, random: np.random.Generator) -> NDArray[np.bool_]:
    """Whether no baseline alerts, in so many trials with noise; delays are one for each baseline, or rows of them."""
    # Two satellites at each receiver: what is left between them has sqrt(2) times the carrier's sigma.
    between = star.sigma_m / np.sqrt(2.0) * random.standard_normal((size, len(star.lengths_m) + 1))
    statistic = np.abs(wrap_m(delay_m + between[:, 1:] - between[:, :1], WAVELENGTH))
    return np.asarray((statistic <= star.threshold_m).all(axis=1), dtype=np.bool_)


# --- the study


def noise_section(testbed: Testbed, *, quick: bool, seed: int, progress: Callable[[str], None]) -> Section:
    """False alarms and missed detections at the optimum for three receivers and at the test bed."""
    best = best_siting(SitingProblem(n_receivers=3))
    optimum = Star(lengths_m=tuple(best.baselines_m.tolist()), sigma_m=best.sigma_m)
    bed = Star(lengths_m=(testbed.along_m(1, 2), testbed.along_m(1, 3)), sigma_m=0.002)
    random = np.random.default_rng(seed)
    progress("statistic under noise")
    n_trials = 400_000 if quick else 4_000_000
    farthest, rows = _monte_carlo(optimum, best.worst_gradient, n_trials, random)
    swept = np.linspace(_LOW, _HIGH, 4_001)
    worst_fused = float(silent_probability(optimum, swept).max())
    shortest = min(optimum.lengths_m)
    edge = np.array([K * optimum.sigma_m / shortest])
    items: list[Value | Claim] = [
        Value(
            name="P_md of one baseline at the end of an interval",
            ours=float(baseline_silent_probability(optimum, shortest, edge)[0]),
            unit="",
            definition="statistic k sigma from a multiple; by definition 1e-4",
        ),
        Value(
            name="P_md of three receivers at the optimum, worst gradient",
            ours=worst_fused,
            unit="",
            definition="both baselines silent, with the noise they share; largest of 4001 gradients",
        ),
        Claim(
            name="100 % detected means P_md of 1e-4 or less",
            holds=worst_fused <= P_MISSED_DETECTION * (1.0 + 1e-6),
            paper_text="100 % detectability in 300-2000 mm/km",
            ours_text=f"largest P_md over the range {worst_fused:.3g}",
            definition="as above",
        ),
        Value(
            name="P_fa of the fused monitor",
            ours=1.0 - float(silent_probability(optimum, np.zeros(1))[0]),
            unit="",
            definition="no gradient, at least one of two baselines alerts; each has 1e-4, so k_ffd should be that of "
            "half of the budget for each",
        ),
        Claim(
            name="Monte Carlo agrees with the integral",
            holds=farthest <= _FARTHEST,
            paper_text="–",
            ours_text=f"largest distance {farthest:.1f} standard deviations of the count",
            definition=f"{rows.shape[0]} gradients with {n_trials} trials each, three receivers at the optimum; "
            f"{_FARTHEST:g} or less agree",
            new=True,
        ),
        *_bed_items(bed, 100_000 if quick else 1_000_000, seed),
    ]
    return Section(
        title="The statistic under noise",
        text="Simulated: Gaussian carrier errors, equal for all receivers, independent between receivers and "
        "satellites.",
        items=items,
        pictures=[_picture(optimum, rows)],
    )


def _monte_carlo(star: Star, worst: float, n_trials: int, random: np.random.Generator) -> tuple[float, FloatArray]:
    """Largest distance between counts and the integral in standard deviations; gradient, share and integral of each."""
    gradients = np.concatenate([[0.0], np.linspace(_LOW, _HIGH, 12), [worst], 200e-6 + 25e-6 * np.arange(4)])
    expected = silent_probability(star, gradients)
    counts = np.array([count_silent(star, gradient, n_trials, random) for gradient in gradients], dtype=np.float64)
    # A count of rare events is Poisson; the variance is that of the expectation, at least one event.
    deviation = np.sqrt(np.maximum(n_trials * expected * (1.0 - expected), 1.0))
    farthest = float((np.abs(counts - n_trials * expected) / deviation).max())
    return farthest, np.stack([gradients, counts / n_trials, expected], axis=-1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sweep:
    """What a star detects over a range of gradients.

    Attributes
    ----------
    gradients, missed : (n,) arrays
        Gradients, in the middles of equal steps [m/m], and P_md of each.
    p_false_alarm : float
        That any baseline alerts without a gradient.
    detected_percent : float
        Mean of 1 - P_md [%].
    simulated_percent : float
        Share that is detected of random gradients, anywhere in the range, with random noise [%].
    deviation_percent : float
        Standard deviation of `simulated_percent` [%].
    """

    gradients: FloatArray
    missed: FloatArray
    p_false_alarm: float
    detected_percent: float
    simulated_percent: float
    deviation_percent: float


def sweep(
    star: Star,
    gradient_range: tuple[float, float],
    steps: int,
    n_trials: int,
    seed: int,
    execution: Execution | None = None,
) -> Sweep:
    """Sweep a range of gradients, by the integral and by Monte Carlo.

    Parameters
    ----------
    star : Star
    gradient_range : tuple of float
        Lowest and highest [m/m].
    steps : int
        Of the integral.
    n_trials, seed : int
        Of the Monte Carlo run.
    execution : Execution, optional
        Where: the result does not depend on it.
    """
    low, high = gradient_range
    gradients = low + (np.arange(steps) + 0.5) * (high - low) / steps
    missed = silent_probability(star, gradients)
    share = 1.0 - float(missed.mean())
    campaign = Campaign(
        study="gradient",
        settings=RandomGradients(star=star, gradient_range=gradient_range),
        trials=[min(_CHUNK, n_trials - begin) for begin in range(0, n_trials, _CHUNK)],
        prepare=_as_they_are,
        run_trial=count_detected,
        result=int,
        seed=seed,
        batch=16,
    )
    detected: list[int] = run(campaign, execution)
    return Sweep(
        gradients=gradients,
        missed=missed,
        p_false_alarm=1.0 - float(silent_probability(star, np.zeros(1))[0]),
        detected_percent=100.0 * share,
        simulated_percent=100.0 * sum(detected) / n_trials,
        deviation_percent=100.0 * float(np.sqrt(max(share * (1.0 - share), 1.0 / n_trials) / n_trials)),
    )


@dataclass(frozen=True, kw_only=True)
class RandomGradients:
    """Gradients anywhere in a range, before a star."""

    star: Star
    gradient_range: tuple[float, float]


def _as_they_are(gradients: RandomGradients) -> RandomGradients:
    return gradients


def count_detected(gradients: RandomGradients, size: int, seed: np.random.SeedSequence) -> int:
    """How many of so many random gradients with noise are detected."""
    random, star = np.random.default_rng(seed), gradients.star
    delay_m = random.uniform(*gradients.gradient_range, size)[:, np.newaxis] * np.asarray(star.lengths_m)
    return size - int(_silent(star, delay_m, size, random).sum())


def _bed_items(bed: Star, n_trials: int, seed: int) -> list[Value | Claim]:
    """How often gradients anywhere in the range are detected at the test bed, against the coverage of the intervals."""
    swept = sweep(bed, GRADIENT_RANGE, 4000, n_trials, seed)
    detected, expected = swept.simulated_percent, swept.detected_percent
    monitors = [BaselineMonitor(length_m=length, sigma_m=bed.sigma_m) for length in bed.lengths_m]
    coverage = coverage_percent(monitors, K)
    allowed = _FARTHEST * swept.deviation_percent
    return [
        Value(
            name="Test bed, gradients detected",
            ours=detected,
            unit="%",
            definition=f"{n_trials} gradients anywhere in 300 to 2000 mm/km, sigma 2 mm, at least one of two baselines",
        ),
        Value(name="Test bed, the same by the integral", ours=expected, unit="%", definition="mean of 1 - P_md"),
        Value(name="Test bed, coverage of the intervals", ours=coverage, unit="%", definition="detected with 1 - 1e-4"),
        Claim(
            name="Test bed: detected as the integral says, and no less than the intervals",
            holds=abs(detected - expected) <= allowed and expected >= coverage * (1.0 - P_MISSED_DETECTION),
            paper_text="–",
            ours_text=f"{detected:.3f} %, integral {expected:.3f} %, intervals {coverage:.3f} %",
            definition=f"within {_FARTHEST:g} standard deviations, {allowed:.3f} %; inside blind intervals detection "
            "is less likely, not impossible",
            new=True,
        ),
    ]


def _picture(star: Star, rows: FloatArray) -> Picture:
    gradients = np.linspace(1e-6, _HIGH, 2000)
    fused = silent_probability(star, gradients)
    figure = new_figure(height=4.2)
    axis = figure.axes[0]
    for length_m in star.lengths_m:
        alone = baseline_silent_probability(star, length_m, gradients)
        axis.plot(gradients * _MM_PER_KM, alone, linewidth=0.9, label=f"{length_m:.1f} m alone")
    axis.plot(gradients * _MM_PER_KM, fused, color="black", linewidth=1.4, label="at least one of both")
    seen = rows[:, 1] > 0.0
    axis.plot(rows[seen, 0] * _MM_PER_KM, rows[seen, 1], "o", color="black", markersize=4, label="Monte Carlo")
    axis.axhline(P_MISSED_DETECTION, color=LIMIT_COLOUR, linestyle="--", linewidth=1.2, label="1e-4")
    axis.axvspan(_LOW * _MM_PER_KM, _HIGH * _MM_PER_KM, color="grey", alpha=0.1, linewidth=0.0)
    axis.set(yscale="log", ylim=(1e-9, 2.0), xlim=(0.0, _HIGH * _MM_PER_KM))
    axis.set(xlabel="gradient along the runway [mm/km]", ylabel="probability of no alert")
    axis.set_title(f"Three receivers at the optimum, sigma {star.sigma_m * 1e3:.3f} mm")
    axis.legend(loc="lower left", fontsize="small", framealpha=0.95)
    return Picture(
        name="missed-detection",
        title="Missed detection over the gradient",
        caption="Grey: the range to be detected, in which the fused monitor stays at or below 1e-4. Points without "
        "an event are left out.",
        figure=figure,
        data={"gradient_mm_per_km": gradients * _MM_PER_KM, "no_alert_fused": fused},
    )

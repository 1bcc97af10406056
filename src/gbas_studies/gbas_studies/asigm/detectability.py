"""Figures 4, 5, 9 and 11: which gradients are detected, over the noise of the carriers."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gbas_core.record import FloatArray
from gbas_core.signals import L1, WAVELENGTH_M
from gbas_ground.monitors.gradient_detectability import (
    GRADIENT_RANGE,
    BaselineMonitor,
    Fuse,
    coverage_percent,
    double_difference_sigma_m,
    k_factor,
    statistic_m,
)
from gbas_siting.worst_gradient import worst_gradient
from gbas_studies.asigm.testbed import Testbed
from gbas_studies.reproduction.drawing import LIMIT_COLOUR, new_figure
from gbas_studies.reproduction.items import Claim, Picture, Section, Value

WAVELENGTH: Final = float(WAVELENGTH_M[L1])
K: Final = k_factor()
_MM_PER_KM: Final = 1e6
_LOW, _HIGH = GRADIENT_RANGE
_FUSIONS: Final[tuple[Fuse, ...]] = ("all", "any")
_PAPERS: Final = "beta taken as 0"
"""Definition under which figure 4d has both of its printed figures, 1 mm and 500 mm/km, with baselines projected."""
_NOT_PAPERS: Final = {
    "projected, b13 by theta + beta": "; rounds to 1 mm too, but with another limiting gradient than the paper's",
    "not projected": "; has both printed figures too, but the paper projects",
}
_RECEIVER_SIGMAS_MM: Final = (0.5, 1.0, 2.0, 3.0)


def largest_sigma_m(lengths_m: Sequence[float]) -> float:
    """Largest double-difference sigma with which every gradient is detected by at least one baseline [m]."""
    return float(worst_gradient(lengths_m, WAVELENGTH, GRADIENT_RANGE).statistic_m) / K


def gradients_to_draw(lengths_m: Sequence[float]) -> FloatArray:
    """A fine grid, and every gradient at which a tent has its foot or its top."""
    kinks = [
        np.arange(1.0, 2.0 * _HIGH * length / WAVELENGTH + 1.0) * WAVELENGTH / (2.0 * length) for length in lengths_m
    ]
    every = np.unique(np.concatenate([np.linspace(_LOW, _HIGH, 3401), *kinks]))
    result: FloatArray = every[(every >= _LOW) & (every <= _HIGH)]
    return result


def sigma_limit_m(gradients: FloatArray, lengths_m: Sequence[float], fuse: Fuse) -> FloatArray:
    """Largest sigma at which each gradient is detected [m]."""
    each = np.array([statistic_m(gradients, BaselineMonitor(length_m=length, sigma_m=0.0)) for length in lengths_m])
    result: FloatArray = (each.max(axis=0) if fuse == "any" else each.min(axis=0)) / K
    return result


def draw_area(
    axis: Axes, lengths_m: Sequence[float], fuse: Fuse, title: str, top_mm: float = 13.0
) -> dict[str, FloatArray]:
    """Shade what is not detected; return the limit that was drawn."""
    gradients = gradients_to_draw(lengths_m)
    limit_mm = sigma_limit_m(gradients, lengths_m, fuse) * 1e3
    axis.fill_between(gradients * _MM_PER_KM, limit_mm, top_mm, color=LIMIT_COLOUR, alpha=0.55, linewidth=0.0)
    axis.plot(gradients * _MM_PER_KM, limit_mm, color=LIMIT_COLOUR, linewidth=0.8)
    axis.set(xlim=(_LOW * _MM_PER_KM, _HIGH * _MM_PER_KM), ylim=(0.0, top_mm), title=title)
    axis.set_xlabel("gradient along the runway [mm/km]")
    axis.set_ylabel("sigma, double difference [mm]")
    return {"gradient_mm_per_km": gradients * _MM_PER_KM, "sigma_limit_mm": limit_mm}


def figure_4_section(testbed: Testbed) -> Section:
    """Figures 4a to 4d."""
    straight = (testbed.length_m(1, 2), testbed.length_m(1, 3))
    along = (testbed.along_m(1, 2), testbed.along_m(1, 3))
    panels: list[tuple[str, str, tuple[float, ...], Fuse]] = [
        ("fig-4a", "Figure 4a: baseline RR1-RR2", along[:1], "any"),
        ("fig-4b", "Figure 4b: baseline RR1-RR3", along[1:], "any"),
        ("fig-4c", "Figure 4c: detected by both", along, "all"),
        ("fig-4d", "Figure 4d: detected by at least one", along, "any"),
        ("fig-4d-unprojected", "Figure 4d, baselines not projected", straight, "any"),
    ]
    pictures = []
    for name, title, lengths, fuse in panels:
        figure = new_figure(height=3.6)
        data = draw_area(figure.axes[0], lengths, fuse, title)
        shown = ", ".join(f"{length:.1f} m" for length in lengths)
        caption = f"Red: not detected at that sigma. Length{'s' * (len(lengths) > 1)} along the runway: {shown}."
        if name.endswith("unprojected"):
            caption = f"The same with the lengths as they are, {shown}: as if both baselines lay along the runway."
        pictures.append(Picture(name=name, title=title, caption=caption, figure=figure, data=data))
    return Section(
        title="Figure 4: detectable gradients at the test bed",
        text="Sigma is that of the double difference. Exact intervals; no grid of gradients.",
        items=_figure_4_items(testbed, straight, along),
        pictures=pictures,
    )


def _figure_4_items(testbed: Testbed, straight: tuple[float, float], along: tuple[float, float]) -> list[Value | Claim]:
    theta_rad, beta_rad = testbed.theta_rad, testbed.angle_rad(1, 2)
    as_printed = (along[0], straight[1] * math.cos(theta_rad - beta_rad))
    along_12 = (straight[0], straight[1] * math.cos(theta_rad))
    both = {
        "projected, b13 by theta + beta": (along, "lengths along the runway from the vectors"),
        _PAPERS: (along_12, "b12 as along the runway, b13 by theta"),
        "not projected": (straight, "lengths as they are"),
    }
    items: list[Value | Claim] = [_sigma_for_all(name, lengths, how) for name, (lengths, how) in both.items()]
    items.append(
        Value(
            name="Figure 4d, sigma for 100 %, b13 by theta - beta as in eq (4)",
            paper="1",
            ours=largest_sigma_m(as_printed) * 1e3,
            unit="mm",
            definition="the printed angle, 58.69 degrees",
            why="At this angle RR1-RR3 comes out as nearly half of RR1-RR2, so that both are blind together near "
            "492 mm/km. The paper's figure was not drawn with its eq (4) and beta = 1.99 degrees.",
        )
    )
    shares: dict[str, tuple[tuple[float, ...], Fuse]] = {
        "Figure 4a": (along[:1], "any"),
        "Figure 4b": (along[1:], "any"),
        "Figure 4c": (along, "all"),
        "Figure 4d": (along, "any"),
    }
    coverage = {name: _coverage(lengths, 0.002, fuse) for name, (lengths, fuse) in shares.items()}
    items += [_worst_gradient(name, lengths) for name, (lengths, _) in both.items()]
    items.append(_longest_sees_most(straight, along))
    items += [
        Value(name=f"{name}, coverage at 2 mm", ours=share, unit="%", definition="share of 300 to 2000 mm/km")
        for name, share in coverage.items()
    ]
    items.append(
        Claim(
            name="Figure 4: at least one detects more than both",
            holds=coverage["Figure 4d"] > max(coverage["Figure 4a"], coverage["Figure 4b"]) > coverage["Figure 4c"],
            paper_text="the availability area is better in figure 4d than in figure 4c",
            ours_text=", ".join(f"{name[-2:]} {share:.1f} %" for name, share in coverage.items()),
            definition="coverage at sigma = 2 mm",
        )
    )
    return items


def _sigma_for_all(name: str, lengths: tuple[float, ...], how: str) -> Value:
    """The printed millimetre is one number and gets one verdict, under the definition that has the gradient too."""
    return Value(
        name=f"Figure 4d, sigma for 100 %, {name}",
        paper="1" if name == _PAPERS else None,
        ours=largest_sigma_m(lengths) * 1e3,
        unit="mm",
        definition=f"smallest over 300 to 2000 mm/km of the larger tent, over k; {how}{_NOT_PAPERS.get(name, '')}",
    )


def _worst_gradient(name: str, lengths: tuple[float, ...]) -> Value:
    worst = worst_gradient(lengths, WAVELENGTH, GRADIENT_RANGE)
    return Value(
        name=f"Figure 4d, gradient that limits sigma, {name}",
        paper=None if name == "not projected" else "5e2",
        ours=float(worst.gradient) * _MM_PER_KM,
        unit="mm/km",
        definition=f"where the larger tent is lowest{_NOT_PAPERS.get(name, '')}",
        why="The paper sees the limit around 500 mm/km: its figure has beta = 0, or baselines that are not projected.",
    )


def _longest_sees_most(straight: tuple[float, float], along: tuple[float, float]) -> Claim:
    """Whether RR1-RR2 alone detects more than RR1-RR3 alone."""
    shares = {
        (what, sigma_mm): tuple(_coverage([length], sigma_mm * 1e-3, "any") for length in lengths)
        for what, lengths in (("as they are", straight), ("along the runway", along))
        for sigma_mm in (1.0, 2.0, 4.0)
    }
    return Claim(
        name="Figure 4: the longest baseline detects most",
        holds=all(longest > other for longest, other in shares.values()),
        paper_text="the largest baseline b12 provides the largest availability",
        ours_text="; ".join(
            f"{what}, {sigma:g} mm: b12 {longest:.1f} %, b13 {other:.1f} %"
            for (what, sigma), (longest, other) in shares.items()
        ),
        definition="coverage by one baseline alone",
        why="Each multiple of the wavelength blinds the share 2 k sigma / lambda of a period. How many of them fall "
        "into the range, and where its ends cut them, decides between baselines; length alone does not.",
    )


def _coverage(lengths_m: Sequence[float], sigma_m: float, fuse: Fuse) -> float:
    return coverage_percent([BaselineMonitor(length_m=length, sigma_m=sigma_m) for length in lengths_m], K, fuse=fuse)


# --- figure 5


def figure_5_section(testbed: Testbed, points: int) -> Section:
    """Figure 5: coverage over the noise of the second and third receiver, for four noises of the first."""
    ratios = np.geomspace(0.1, 10.0, points)
    lengths = (testbed.along_m(1, 2), testbed.along_m(1, 3))
    maps = {
        (fuse, sigma_mm): coverage_map(lengths, sigma_mm * 1e-3, ratios, fuse)
        for fuse in _FUSIONS
        for sigma_mm in _RECEIVER_SIGMAS_MM
    }
    best = {key: float(values.max()) for key, values in maps.items()}
    mean = {key: float(values.mean()) for key, values in maps.items()}
    asymmetry = max(float(np.abs(values - values.T).max()) for values in maps.values())
    falls = all(
        mean[fuse, quiet] > mean[fuse, noisy]
        for fuse in _FUSIONS
        for quiet, noisy in itertools.pairwise(_RECEIVER_SIGMAS_MM)
    )
    means = {fuse: ", ".join(f"{mean[fuse, sigma]:.0f} %" for sigma in _RECEIVER_SIGMAS_MM) for fuse in ("any", "all")}
    items: list[Value | Claim] = [
        Claim(
            name="Figure 5: sensitivity to the reference receiver",
            holds=falls,
            paper_text="the sensitivity to sigma_1 is very high for both configurations",
            ours_text=f"mean coverage of at least one: {means['any']}; of both: {means['all']}",
            definition="mean over the panel, sigma_1 = 0.5, 1, 2, 3 mm",
        ),
        Claim(
            name="Figure 5: symmetry",
            holds=asymmetry < 5.0,
            paper_text="the curves are symmetric with respect to the line sigma_3 = sigma_2",
            ours_text=f"exchanging the ratios changes the coverage by up to {asymmetry:.1f} %",
            definition="largest change over all panels, in percent of the range; below 5 % is not seen by eye",
            why="Exact symmetry needs equal baselines; these are 775 and 340 m along the runway.",
        ),
    ]
    items += [
        Value(
            name=f"Figure 5, {'at least one' if fuse == 'any' else 'both'}, sigma_1 = {sigma_mm:g} mm",
            ours=value,
            unit="%",
            definition="largest coverage in the panel: ratios of 0.1",
        )
        for (fuse, sigma_mm), value in best.items()
    ]
    columns = {f"{fuse}_sigma1_{sigma_mm:g}mm_percent": values.ravel() for (fuse, sigma_mm), values in maps.items()}
    picture = Picture(
        name="fig-5",
        title="Figure 5: coverage over the noise of the receivers",
        caption="Percentage of 300 to 2000 mm/km that is detected; upper row by both baselines, lower row by at least "
        "one. Baselines along the runway.",
        figure=_draw_figure_5(maps, ratios),
        data={
            "ratio_2": np.repeat(ratios, points),
            "ratio_3": np.tile(ratios, points),
            **columns,
        },
    )
    return Section(title="Figure 5: noise of each receiver", items=items, pictures=[picture])


def coverage_map(lengths_m: tuple[float, float], sigma_m: float, ratios: FloatArray, fuse: Fuse) -> FloatArray:
    """Coverage ``(n, n)`` over the ratio of the second receiver (rows) and of the third (columns) [%]."""
    sigmas = double_difference_sigma_m(sigma_m, ratios)
    return np.array(
        [
            [
                coverage_percent(
                    [
                        BaselineMonitor(length_m=lengths_m[0], sigma_m=float(second)),
                        BaselineMonitor(length_m=lengths_m[1], sigma_m=float(third)),
                    ],
                    K,
                    fuse=fuse,
                )
                for third in sigmas
            ]
            for second in sigmas
        ]
    )


def _draw_figure_5(maps: dict[tuple[Fuse, float], FloatArray], ratios: FloatArray) -> Figure:
    figure = new_figure(2, 4, width=10.5, height=5.2, sharex=True, sharey=True)
    for axis, ((fuse, sigma_mm), values) in zip(figure.axes, maps.items(), strict=True):
        mesh = axis.pcolormesh(ratios, ratios, values.T, vmin=0.0, vmax=100.0, cmap="viridis", rasterized=True)
        axis.set(xscale="log", yscale="log")
        axis.grid(False)
        if fuse == "all":
            axis.set_title(f"σ₁ = {sigma_mm:g} mm", fontsize="medium")
        else:
            axis.set_xlabel("σ₂ / σ₁")
    for axis, name in ((figure.axes[0], "both"), (figure.axes[4], "at least one")):
        axis.set_ylabel(f"{name}\nσ₃ / σ₁")
    figure.colorbar(mesh, ax=figure.axes, label="detected [%]", shrink=0.8)
    return figure


# --- figures 9 and 11


def optimum_picture(name: str, title: str, lengths_m: Sequence[float]) -> Picture:
    """Detection area of a line of receivers, and the sigma up to which it is whole."""
    figure = new_figure(height=3.6)
    axis = figure.axes[0]
    data = draw_area(axis, lengths_m, "any", title)
    sigma_mm = largest_sigma_m(lengths_m) * 1e3
    axis.axhline(sigma_mm, color="black", linewidth=1.0, linestyle="--", label=f"{sigma_mm:.3f} mm")
    axis.legend(loc="lower right")
    caption = (
        f"Red: not detected at that sigma. Baselines from the first receiver: "
        f"{', '.join(f'{length:.1f}' for length in lengths_m)} m. Dashed: every gradient is detected below."
    )
    return Picture(name=name, title=title, caption=caption, figure=figure, data=data)

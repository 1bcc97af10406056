"""``gbas reproduce asigm``: every table and figure of the paper, and what goes beyond it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from gbas_studies.asigm.detectability import WAVELENGTH, K, figure_4_section, figure_5_section
from gbas_studies.asigm.extensions import extensions_section
from gbas_studies.asigm.noise import noise_section
from gbas_studies.asigm.optima import (
    four_receivers_section,
    fourth_receiver_section,
    grids_section,
    three_receivers_section,
)
from gbas_studies.asigm.projection import projection_section
from gbas_studies.asigm.recorded import recorded_section
from gbas_studies.asigm.testbed import braunschweig, geometry_section
from gbas_studies.reproduction.items import Claim, Reproduction, Section, Value
from gbas_studies.reproduction.registry import Options

SOURCE: Final = (
    "B. Belabbas, T. Dautermann, M. Felux, M. Rippl, S. Schlüter, V. Wilken, A. Hornbostel, M. Meurer, A GBAS "
    "Testbed to Support New Monitoring Algorithms Development for CAT III Precision Approach, German Aerospace "
    "Center (DLR)."
)
_ABOUT: Final = (
    "Detectability is computed as exact intervals of gradients, and optima are found by branch and bound over the "
    "places of the receivers, with a proof of how much better any others could be; the paper uses grids of both. "
    "Gradients are along the runway. Sigma is that of the double-difference carrier, twice a receiver's. Figures 1 "
    "to 3 and 6 are drawings; there is no figure 8."
)


def reproduce(options: Options) -> Reproduction:
    """The study.

    Parameters
    ----------
    options : Options
        Recordings are for what the paper has not: it has no measurements.
    """
    testbed = braunschweig()
    steps: dict[str, Callable[[], Section]] = {
        "geometry": lambda: geometry_section(testbed),
        "constants": constants_section,
        "figure 4": lambda: figure_4_section(testbed),
        "figure 5": lambda: figure_5_section(testbed, 20 if options.quick else 60),
        "three receivers": lambda: three_receivers_section(150 if options.quick else 300),
        "four receivers": lambda: four_receivers_section(120 if options.quick else 240),
        "grids": lambda: grids_section(options.quick),
        "fourth receiver": lambda: fourth_receiver_section(testbed),
        "beyond the paper": lambda: extensions_section(options.quick),
        "noise": lambda: noise_section(testbed, quick=options.quick, seed=options.seed, progress=options.progress),
        "fronts from elsewhere": lambda: projection_section(testbed, quick=options.quick, seed=options.seed),
        "recorded pairs": lambda: recorded_section(options),
    }
    return Reproduction(
        study="asigm",
        title="Absolute slant ionosphere gradient monitor and receiver siting",
        source=SOURCE,
        about=_ABOUT,
        sections=options.made(steps),
    )


def constants_section() -> Section:
    """What the paper needs and does not print."""
    return Section(
        title="Constants, and equations of the paper that are misprinted",
        items=[
            Value(
                name="k_ffd + k_md",
                ours=K,
                unit="",
                kind="coefficient",
                definition="3.8906 for false alarms of 1e-4, two-sided, and 3.7190 for missed detections of 1e-4. "
                "The paper prints neither; with these its optima come out. k scales sigma and moves no optimum",
            ),
            Value(
                name="sigma-hat, no baseline sees anything above",
                ours=0.5 * WAVELENGTH / K * 1e3,
                unit="mm",
                definition="lambda / (2 k)",
            ),
            _misprint(),
        ],
    )


def _misprint() -> Claim:
    """Eq (6) at the foot of a tent, where sigma(alpha) must be zero, in units of sigma-hat."""
    foot, top = 0.0, 0.5  # gradients in units of lambda / b: a multiple, and half way to the next
    printed = 1.0 / (foot - top) * (foot - top) + 1.0
    corrected = (foot - foot) / (top - foot)
    return Claim(
        name="Eq (6) as printed",
        holds=abs(printed) < 1e-12,
        paper_text="sigma(alpha) = sigma-hat / (foot - top) (alpha - top) + sigma-hat",
        ours_text=f"as printed {printed:g} sigma-hat at the foot of a tent, where it must be {corrected:g}",
        kind="coefficient",
        definition="evaluated at the foot, where the gradient's delay is a multiple of the wavelength",
        why="The sign of the slope is wrong, and eq (7) has its indices exchanged. A tent rises from 0 at the foot "
        "to sigma-hat at the top, half way to the next multiple; the paper's figures are drawn so.",
    )

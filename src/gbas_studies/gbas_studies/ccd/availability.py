"""How many satellites have to transmit on L5 for the two-frequency monitor and its ionosphere-free user.

The receiver clock in the compensated carrier is the mean over the *other* satellites with both bands, of which the
station wants three. So a satellite is monitored only when four are in view, and the fewer there are, the noisier is its
statistic: by ``1 + 1/n`` in variance. Satellites are the 24 nominal slots of GPS over Braunschweig; which of them
transmit on L5 is any choice with equal probability, so that their number in view is hypergeometric.

Source: ENC 2015, 3 and 6: eight satellites had L5 in 2015, too few "to remove the receiver clock with high precision".
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
from scipy.stats import hypergeom

from gbas_core.gnss.frames import azimuth_elevation, ecef_from_geodetic, los_and_range, rot_enu_ecef
from gbas_core.models.error_models import sigma_air, sigma_pr_gnd
from gbas_core.ranging.combinations import ionosphere_free_sigma
from gbas_core.record import FloatArray
from gbas_core.signals import L1, L5
from gbas_ground.monitors.ccd_f import TwoFrequencyParams
from gbas_sim.satellites.constellation import nominal_slots
from gbas_studies.reproduction.drawing import LIMIT_COLOUR, new_figure
from gbas_studies.reproduction.items import Claim, Item, Picture, Section, Value

SLOTS: Final = 24
MASK_RAD: Final = float(np.radians(5.0))
RECEIVERS: Final = 4
LIMIT_M: Final = 10.0
"""Vertical alert limit at the decision height [m]. Known."""
_MULTIPLIER: Final = 5.847  # Known: fault-free missed detection, four receivers
_STEP_S: Final = 600.0
_SIDEREAL_DAY_S: Final = 86_164.0
_PLACE: Final = (np.radians(52.3), np.radians(10.6), 130.0)
_GPS_WEEK: Final = 2300


@dataclass(frozen=True, kw_only=True)
class Availability:
    """Over a day and all choices of satellites with L5.

    Attributes
    ----------
    in_view : float
        Mean number in view.
    monitored : float
        Share of their time in view in which they are monitored [-].
    position : float
        Share of time with four monitored ones: an ionosphere-free position exists [-].
    carrier_sigma : float
        Mean factor on the carrier statistic's standard deviation while monitored, ``sqrt(1 + 1/n)`` [-].
    """

    in_view: float
    monitored: float
    position: float
    carrier_sigma: float


@cache
def lines_of_sight() -> tuple[FloatArray, FloatArray]:
    """Elevation (E, 24) [rad] and unit vectors east, north, up (E, 24, 3) over a sidereal day."""
    times = np.arange(0.0, _SIDEREAL_DAY_S, _STEP_S)
    place = ecef_from_geodetic(*_PLACE)
    rotation = rot_enu_ecef(*_PLACE[:2])
    elevations, units = [], []
    for tow_s in times:
        slots = nominal_slots(_GPS_WEEK, float(tow_s))
        node, argument = slots.node_longitude_rad[:SLOTS], slots.latitude_argument_rad[:SLOTS]
        tilt, size = slots.inclination_rad[:SLOTS], slots.semi_major_m[:SLOTS]
        along, across = size * np.cos(argument), size * np.sin(argument)
        where = np.stack(
            [
                along * np.cos(node) - across * np.cos(tilt) * np.sin(node),
                along * np.sin(node) + across * np.cos(tilt) * np.cos(node),
                across * np.sin(tilt),
            ],
        )
        enu = rotation @ los_and_range(place, where)[0]
        elevations.append(azimuth_elevation(enu)[1])
        units.append(enu.T)
    return np.array(elevations), np.array(units)


def availability(count: int, *, fewest: int = TwoFrequencyParams.min_clock_satellites) -> Availability:
    """Of the monitor with `count` of 24 satellites that have L5, over all choices of them.

    Parameters
    ----------
    count : int
        0 to 24.
    fewest : int
        Others that the receiver clock is averaged from.
    """
    in_sight = (lines_of_sight()[0] >= MASK_RAD).sum(axis=1)
    number = np.arange(count + 1.0)
    chance = hypergeom.pmf(number, SLOTS, in_sight[:, np.newaxis], count).mean(axis=0)
    watched = number >= fewest + 1
    time_watched = float((chance * number)[watched].sum())
    spread = np.sqrt(1.0 + 1.0 / np.maximum(number - 1.0, 1.0))
    mean = float((chance * number).sum())
    return Availability(
        in_view=mean,
        monitored=time_watched / mean if mean > 0.0 else 0.0,
        position=float(chance[number >= max(fewest + 1, 4)].sum()),
        carrier_sigma=float((chance * number * spread)[watched].sum() / time_watched) if time_watched else float("nan"),
    )


def protected(count: int, *, choices: int = 40, seed: int = 1) -> float:
    """Share of time and choices in which the ionosphere-free user's fault-free VPL is within 10 m.

    Ground accuracy designator C with four receivers, airborne designator B, both on both bands; all monitored
    satellites are used.

    Parameters
    ----------
    count : int
        Satellites with L5.
    choices : int
        Drawn of them.
    seed : int
    """
    elevation, units = lines_of_sight()
    rng = np.random.default_rng(seed)
    ground = sigma_pr_gnd("C", elevation, RECEIVERS)
    air = sigma_air("B", elevation)
    variance = ionosphere_free_sigma(ground, ground, L1, L5) ** 2 + ionosphere_free_sigma(air, air, L1, L5) ** 2
    design = np.concatenate([-units, np.ones((*units.shape[:2], 1))], axis=-1)
    good = 0
    for _ in range(choices):
        has = np.zeros(SLOTS, dtype=bool)
        has[rng.choice(SLOTS, count, replace=False)] = True
        used = has & (elevation >= MASK_RAD)
        enough = used.sum(axis=1) >= 4
        weight = np.where(used, 1.0 / variance, 0.0)[enough]
        normal = np.einsum("esi,es,esj->eij", design[enough], weight, design[enough])
        fine = np.linalg.cond(normal) < 1e12
        up = np.linalg.inv(normal[fine])[:, 2, 2]
        good += int((_MULTIPLIER * np.sqrt(up) <= LIMIT_M).sum())
    return good / (choices * len(elevation))


def section(*, quick: bool) -> Section:
    """Against the number of satellites with L5."""
    counts = np.arange(1, SLOTS + 1)
    found = {int(count): availability(int(count)) for count in counts}
    choices = 10 if quick else 40
    shown = (4, 6, 8, 10, 12, 16, 20, 24)
    within = {count: protected(count, choices=choices) for count in shown}
    items: list[Item] = [
        Value(
            name=f"{count} satellites with L5, monitored", ours=100.0 * found[count].monitored, unit="%",
            definition=f"Share of their time in view; {found[count].in_view:.2f} in view, four of them in "
            f"{100.0 * found[count].position:.2f} % of the time, fault-free vertical protection level within "
            f"{LIMIT_M:g} m in {100.0 * within[count]:.1f} %. Carrier statistic {found[count].carrier_sigma:.3f} times "
            "as wide as with a known clock.",
        )
        for count in shown
    ]  # fmt: skip
    eight = found[8].monitored
    items.append(
        Claim(
            name="Eight satellites are too few", holds=eight < found[SLOTS].monitored - 0.01,
            paper_text="availability reduced",
            ours_text=f"{100.0 * eight:.1f} % against {100.0 * found[SLOTS].monitored:.1f} % with all",
            definition="Share of time in view in which the monitor works; any eight of 24 slots.",
            why="" if eight < found[SLOTS].monitored - 0.01 else "Eight would do.",
        )
    )  # fmt: skip
    figure = new_figure(height=3.8)
    axis = figure.axes[0]
    data: dict[str, FloatArray] = {"satellites_with_l5": counts.astype(np.float64)}
    lines = {
        "monitored while in view": np.array([found[int(count)].monitored for count in counts]),
        "four monitored: a position": np.array([found[int(count)].position for count in counts]),
    }
    for label, line in lines.items():
        axis.plot(counts, 100.0 * line, label=label)
        data[f"{label} [%]"] = 100.0 * line
    axis.plot(list(within), [100.0 * each for each in within.values()], "o", label=f"VPL within {LIMIT_M:g} m")
    axis.axvline(8, color=LIMIT_COLOUR, linestyle="--", linewidth=1.0)
    axis.set_xlabel("satellites with L5, of 24")
    axis.set_ylabel("share [%]")
    axis.legend(fontsize="small")
    return Section(
        title="Availability against the number of satellites with L5", items=items,
        text="Nominal slots of GPS over Braunschweig, mask 5°, a sidereal day in steps of 10 minutes; which slots have "
        "L5 is any choice with equal probability. The monitor wants three others for the receiver clock. Protection "
        f"levels of the ionosphere-free user: designators C (four receivers) and B on both bands, {choices} choices.",
        pictures=(
            Picture(
                name="availability", title="Availability against the number of satellites with L5", figure=figure,
                data=data, caption="The dashed line is the paper's eight satellites of 2015.",
            ),
        ),
    )  # fmt: skip

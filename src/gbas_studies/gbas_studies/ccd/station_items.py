"""The station's side of the worst case: age of its smoothing filters, and how many receivers it averages."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from gbas_core.record import FloatArray
from gbas_studies.ccd.monitors import MonitorName, monitor_for
from gbas_studies.ccd.smoothed_error import Smoothing, stepped_error_m, unit_error_s
from gbas_studies.ccd.worst_case import Grid, response, worst_error_any_rate
from gbas_studies.reproduction.drawing import COLOURS, new_figure
from gbas_studies.reproduction.items import Claim, Item, Picture, Section, Value

SETTLE_S: Final = 230.0
"""From the start of the station's filters to the first use of a range, by the suite's station [s]."""
_AGES_S: Final = (0.0, 5.0, 10.0, 30.0, 60.0, 360.0)
_GRID: Final = Grid(onset_step_s=0.5, onset_max_s=400.0)
_D_MAX_MPS: Final = 0.1
_MODES: Final = ("Code L1", "Code+Carrier L1")


def largest_error_m(mode: str, monitor: str, smoothing: Smoothing, *, receivers: int = 1) -> tuple[float, float]:
    """Largest undetected error over all rates up to 0.1 m/s [m], and when the air filter starts after the onset [s]."""
    watched = monitor_for(monitor, mode, receivers=receivers)
    found = worst_error_any_rate(response(mode, watched, smoothing, _GRID.offsets(smoothing.interval_s)), _D_MAX_MPS)
    return found.value, found.onset_s


def sections() -> list[Section]:
    """Both."""
    return [ground_age(), receivers()]


def ground_age() -> Section:
    """Young ground filters: the paper names t_g among what decides, and shows 360 s only."""
    items: list[Item] = []
    for age_s in _AGES_S:
        young = Smoothing(ground_age_s=age_s)
        error_m, onset_s = largest_error_m("Code L1", "gast-d", young)
        kept_m, _ = largest_error_m("Code L1", "gast-d", replace(young, ground_settle_s=SETTLE_S))
        items.append(
            Value(
                name=f"Ground filter {age_s:g} s old at the onset", ours=error_m, unit="m",
                definition=f"Code L1, GAST D, all rates up to {_D_MAX_MPS:g} m/s; air filter started at {onset_s:+g} "
                f"s. {kept_m:.5g} m when the station releases the range {SETTLE_S:g} s after its filter's start.",
            )
        )  # fmt: skip
    items += [_agreement(), _no_worse_than_settled()]
    return Section(
        title="Age of the ground filter, t_g", items=items, pictures=(_age_picture(),),
        text="The tables take the ground filter as settled. A range that is used while the ground filter is young has "
        "a larger undetected error, because the ground then lags less than it will; a station that waits for its "
        "filters has none of that.",
    )  # fmt: skip


def _agreement() -> Claim:
    """Closed form and the suite's smoothing filter, stepped."""
    largest = 0.0
    for age_s in _AGES_S:
        smoothing = Smoothing(ground_age_s=age_s)
        for start in (-60, -10, 0, 60, 126):
            stepped = stepped_error_m(
                1.0, 0.0, start, start + smoothing.updates, smoothing, ground_start=smoothing.ground_start
            )
            closed = float(unit_error_s(start, smoothing))
            largest = max(largest, abs(float(stepped[-1]) - closed)) if np.isfinite(closed) else largest
    return Claim(
        name="Closed form and stepped filters", new=True, holds=largest < 1e-9, paper_text="–",
        ours_text=f"differ by at most {largest:.0e} m", why="" if largest < 1e-9 else "They disagree.",
        definition="Code ramp of 1 m/s, ground filters of these ages, air filters from 30 s before to 63 s after the "
        "onset, each 50 s after its start.",
    )  # fmt: skip


def _no_worse_than_settled() -> Claim:
    settled_m = {mode: largest_error_m(mode, "gast-d", Smoothing())[0] for mode in _MODES}
    worst = max(
        largest_error_m(mode, "gast-d", Smoothing(ground_age_s=age_s, ground_settle_s=SETTLE_S))[0] / settled_m[mode]
        for mode in _MODES
        for age_s in np.arange(0.0, 401.0, 10.0)
    )
    holds = worst <= 1.0 + 1e-9
    return Claim(
        name="Settled ground filter is the worst", new=True, holds=holds, paper_text="–",
        ours_text=f"at most {worst:.4f} of the settled one's error", why="" if holds else "A young one is worse.",
        definition=f"Ages of 0 to 400 s, step 10 s, released {SETTLE_S:g} s after the start; {' and '.join(_MODES)}.",
    )  # fmt: skip


def _age_picture() -> Picture:
    ages_s = np.arange(0.0, 121.0, 1.0)
    figure = new_figure(height=3.8)
    axis = figure.axes[0]
    data: dict[str, FloatArray] = {"ground_age_s": ages_s}
    for place, mode in enumerate(_MODES):
        for settle_s, dash in ((0.0, "-"), (SETTLE_S, "--")):
            line = np.array(
                [largest_error_m(mode, "gast-d", Smoothing(ground_age_s=each, ground_settle_s=settle_s))[0]
                 for each in ages_s]
            )  # fmt: skip
            label = f"{mode}, used {'at once' if settle_s == 0.0 else f'after {settle_s:g} s'}"
            axis.plot(
                ages_s, line, color=COLOURS[place], linestyle=dash, linewidth=1.6 if settle_s else 2.2, label=label
            )
            data[f"{label} [m]"] = line
    axis.set_xlabel("age of the ground filter at the onset, t_g [s]")
    axis.set_ylabel("largest undetected error [m]")
    axis.set_ylim(0.0, None)
    axis.legend(fontsize="small")
    return Picture(
        name="ground-age", title="Largest undetected error against the age of the ground filter", figure=figure,
        data=data, caption="GAST D, all rates up to 0.1 m/s, air filter of variant time constant. Both modes give the "
        "same error: twice the statistic for twice the divergence.",
    )  # fmt: skip


def receivers() -> Section:
    """Averaging over M receivers: all of Q in the paper's form, each receiver's own part in the sound one."""
    items: list[Item] = []
    forms: tuple[MonitorName, ...] = ("gast-f-paper", "gast-f-sound")
    for mode in ("Code L5", "Carrier L5"):
        for form in forms:
            found = {count: largest_error_m(mode, form, Smoothing(), receivers=count)[0] for count in (1, 2, 3, 4)}
            items.append(
                Value(
                    name=f"{mode}, {form}, four receivers", ours=found[4], unit="m",
                    definition="Largest undetected error, all rates; with one, two and three receivers "
                    f"{', '.join(f'{found[count]:.5g}' for count in (1, 2, 3))} m. Of one over four: "
                    f"{found[1] / found[4]:.4f}.",
                )
            )  # fmt: skip
    return Section(
        title="Averaging over receivers, Q/M", items=items,
        text="The paper divides all of Q by M. Of the sound form only what is each receiver's own is divided: the "
        "noise and multipath of the codes. Satellite clock, orbit and troposphere in the compensated carrier are alike "
        "at all receivers. Antennas that stand close share multipath, too: a station divides only what it has "
        "calibrated as its receivers' own, and nothing by default.",
    )  # fmt: skip

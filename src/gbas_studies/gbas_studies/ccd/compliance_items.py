"""Compliance of all modes, users and monitors as items of the reproduction."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from gbas_core.ranging.fault_modes import FAULT_MODES
from gbas_core.record import FloatArray
from gbas_studies.ccd.compliance import (
    MALFUNCTION_M,
    P_INTEGRITY,
    P_PRIOR,
    TIME_TO_ALERT_S,
    USERS,
    Cell,
    cells,
    critical_mapping,
    response_over_error,
)
from gbas_studies.ccd.monitors import MONITORS
from gbas_studies.reproduction.drawing import new_figure
from gbas_studies.reproduction.items import Claim, Item, Picture, Section

_MONITOR_NAMES: Final = {"gast-d": "GAST D", "gast-f-paper": "GAST F, paper", "gast-f-sound": "GAST F, sound"}
_USER_NAMES: Final = {"L1": "L1", "L5": "L5", "IF": "I-free"}
_DEFINITION: Final = (
    "Least statistic over error, over the critical mapping function, of all starts, times and rates; 1 just meets the "
    "limit case. –: no error."
)


def section() -> Section:
    """All cells, for equal sizes and for those that hide the fault best."""
    equal, worst = cells(), cells(any_sizes=True)
    items: list[Item] = [
        _row(mode, monitor, [each for each in equal if (each.mode, each.monitor) == (mode, monitor)])
        for mode in FAULT_MODES
        for monitor in MONITORS
    ]
    items += [
        _any_sizes(monitor, user, [each for each in worst if (each.monitor, each.user) == (monitor, user)])
        for monitor in MONITORS
        for user in USERS
    ]
    critical = ", ".join(f"{critical_mapping(name):.5g} 1/{'m' if 'f' in name[5:] else 's'}" for name in MONITORS)
    return Section(
        title="Compliance of fifteen modes, three users and three monitors", items=items,
        text="Differential error of 30 s smoothed ranges on L1, on L5 and ionosphere-free, at every time since the "
        "onset, for the worst start of the air filter of either kind and at every rate; the statistic is that of "
        f"{TIME_TO_ALERT_S:g} s earlier. Limit case: P_md at most 10^(-2.56 |E| + 1.92) from 0.75 m on and 1e-5 from "
        f"2.7 m on. Malfunction case: P_md at {MALFUNCTION_M:g} m times {P_PRIOR:g} at most {P_INTEGRITY:g}. A cell is "
        f"met if both are. A divergence of 1 m/s gives {response_over_error():.5g} m/s of statistic for each metre of "
        f"error at least. Critical mappings: {critical}. One receiver; the printed Q. The GAST D monitor watches the "
        "user's band, and both bands for the ionosphere-free user. Rows of any sizes let the rates of the mode's "
        "measurements differ as hides them best.",
        pictures=(_picture("compliance", "equal sizes", equal), _picture("compliance-any", "any sizes", worst)),
    )  # fmt: skip


def _word(each: Cell) -> str:
    if not np.isfinite(each.margin):
        return "–"
    word = f"{each.margin:.3g}"
    return word if each.met else f"{word} not met"


def _missed(of: Sequence[Cell]) -> str:
    return f"{max(each.p_missed for each in of):.1e}"


def _row(mode: str, monitor: str, of: Sequence[Cell]) -> Claim:
    failing = [f"{_USER_NAMES[each.user]}: {_reason(each)}" for each in of if not each.met]
    return Claim(
        name=f"Compliance, {mode}, {_MONITOR_NAMES[monitor]}", new=True, holds=not failing, paper_text="met",
        ours_text="; ".join(f"{_USER_NAMES[each.user]} {_word(each)}" for each in of),
        definition=f"{_DEFINITION} P_md at {MALFUNCTION_M:g} m: at most {_missed(of)}.", why="; ".join(failing),
    )  # fmt: skip


def _any_sizes(monitor: str, user: str, of: Sequence[Cell]) -> Claim:
    least = min(of, key=lambda each: each.margin)
    failing = [each for each in of if not each.met]
    return Claim(
        name=f"Any sizes, {_USER_NAMES[user]}, {_MONITOR_NAMES[monitor]}", new=True, paper_text="met",
        holds=not failing,
        ours_text=f"{len(of) - len(failing)} of {len(of)} met; least {least.margin:.3g}",
        definition=f"Least margin over all sizes of each mode's rates; the least of all is that of {least.mode}. P_md "
        f"at {MALFUNCTION_M:g} m: at most {_missed(of)}.",
        why="; ".join(f"{each.mode}: {_reason(each)}" for each in failing),
    )  # fmt: skip


def _reason(each: Cell) -> str:
    if each.margin == 0.0:
        return (
            "codes and carriers in the ratio of an ionosphere, (1, γ, -1, -γ), leave no statistic; single-band users "
            "need a single-band monitor beside it"
        )
    return "limit case not met" if not each.limit_case else "malfunction case not met"


def _picture(name: str, sizes: str, of: Sequence[Cell]) -> Picture:
    """Margins as a table in colour."""
    modes = list(FAULT_MODES)
    shape = (len(modes), len(MONITORS), len(USERS))
    margin = np.array([each.margin for each in of]).reshape(shape)
    met = np.array([each.met for each in of]).reshape(shape)
    figure = new_figure(1, len(MONITORS), width=9.6, height=5.6, sharey=True)
    data: dict[str, FloatArray] = {}
    for place, monitor in enumerate(MONITORS):
        axis = figure.axes[place]
        shown = np.log10(np.clip(margin[:, place], 0.1, 100.0))
        axis.imshow(np.where(np.isfinite(margin[:, place]), shown, np.nan), cmap="RdYlGn", vmin=-1.0, vmax=2.0,
                    aspect="auto")  # fmt: skip
        for row in range(len(modes)):
            for column in range(len(USERS)):
                value = margin[row, place, column]
                text = "–" if not np.isfinite(value) else f"{value:.3g}" + ("" if met[row, place, column] else " ✗")
                axis.text(column, row, text, ha="center", va="center", fontsize=7)
        axis.set_xticks(range(len(USERS)), [_USER_NAMES[user] for user in USERS])
        axis.set_yticks(range(len(modes)), modes, fontsize=7)
        axis.set_title(_MONITOR_NAMES[monitor], fontsize=9)
        axis.grid(visible=False)
        for column, user in enumerate(USERS):
            label = f"{_MONITOR_NAMES[monitor]}, {_USER_NAMES[user]}"
            data[f"{label}, margin"] = margin[:, place, column]
            data[f"{label}, met"] = met[:, place, column].astype(np.float64)
    return Picture(
        name=name, title=f"Compliance, {sizes}", figure=figure, data=data,
        caption="Margin over the limit case; ✗: not met; –: the mode makes no error for that user. Rows of the data "
        "are the modes from the top down.",
    )  # fmt: skip

"""Figures 5 to 10 of the paper, and what it describes without a figure."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes

from gbas_core.ranging.divergence import GROUND_SIGMA_MPS
from gbas_core.ranging.fault_modes import FAULT_MODES
from gbas_core.record import FloatArray
from gbas_ground.monitors.divergence_forms import threshold
from gbas_studies.ccd.missed_detection import critical_mapping_gast_d, critical_mapping_gast_f, p_md, required_p_md
from gbas_studies.ccd.monitors import P_FALSE_ALARM, Monitor, cmc_rate, monitor_for, one_sided_threshold_mps
from gbas_studies.ccd.smoothed_error import Smoothing, Start, smoothed_cmc_s, unit_error_s
from gbas_studies.ccd.tables import FINE_GRID, STARTS, responses
from gbas_studies.ccd.worst_case import smallest_mapping
from gbas_studies.reproduction.drawing import COLOURS, LIMIT_COLOUR, new_figure
from gbas_studies.reproduction.items import Claim, Item, Picture, Section, Value

_RATE_MPS: Final = 0.01
_KINDS: Final = ("Code", "Carrier", "Code+Carrier")
_TOP_FOUR: Final = ("Code L1+L5, Carrier L1", "Code L5, Carrier L1", "Code+Carrier L1", "Carrier L1")
_GREY: Final = "#9AA3AE"


def _error_after_start(mode: str, band: str, start: Start, samples: FloatArray) -> FloatArray:
    """Air less ground with the air filter started at the onset, d = 0.01 m/s [m]."""
    smoothing = Smoothing(start=start)
    unit = smoothed_cmc_s(0, samples, smoothing) - smoothed_cmc_s(-720, samples, smoothing)
    return np.asarray(_RATE_MPS * cmc_rate(mode, "L1" if band == "L1" else "L5") * unit)


def figure_5_and_6() -> Section:
    """Differential error over time without detection."""
    samples = np.arange(0.0, 401.0)
    time_s = 0.5 * samples
    items: list[Item] = []
    pictures = []
    for number, band in ((5, "L1"), (6, "L5")):
        lines = {(kind, start): _error_after_start(f"{kind} {band}", band, start, samples)
                 for kind in _KINDS for start in (STARTS if number == 5 else STARTS[:1])}  # fmt: skip
        pictures.append(_transient_picture(number, band, time_s, lines))
        code, carrier, both = (lines[kind, "variant"] for kind in _KINDS)
        peak = int(np.abs(code).argmax())
        items.append(
            Value(
                name=f"Figure {number}, peak of Code, variant", ours=float(np.abs(code[peak])), unit="m",
                definition=f"d = 0.01 m/s, both filters of 30 s, air started at the onset, ground 360 s before. At "
                f"{time_s[peak]:g} s.",
            )
        )  # fmt: skip
        same = bool(np.allclose(code, carrier, atol=1e-12) and np.allclose(both, 2.0 * code, atol=1e-12))
        items.append(
            Claim(
                name=f"Figure {number}, code, carrier, both", holds=same, definition="All times, to 1e-12 m.",
                paper_text="Carrier as Code, half of Code+Carrier", ours_text="the same" if same else "not so",
            )
        )  # fmt: skip
    invariant = max(
        float(np.abs(_error_after_start(f"{kind} L1", "L1", "invariant", samples)).max()) for kind in _KINDS
    )
    items.append(
        Claim(
            name="Figure 5, invariant filters", paper_text="zero", holds=invariant < 1e-12,
            ours_text=f"at most {invariant:.1g} m", definition="Started at the onset: neither filter has a lag then.",
        )
    )  # fmt: skip
    unaffected = max(float(np.abs(_error_after_start(f"{kind} L1", "L5", "variant", samples)).max()) for kind in _KINDS)
    items.append(
        Claim(
            name="Figure 6, faults on L1", paper_text="no effect on L5", holds=unaffected == 0.0,
            ours_text="none" if unaffected == 0.0 else "some", definition="Single-frequency smoothing of L5.",
        )
    )  # fmt: skip
    return Section(
        title="Figures 5 and 6: differential error without detection", items=items,
        pictures=(*pictures, _delay_picture()),
    )  # fmt: skip


def _transient_picture(
    number: int, band: str, time_s: FloatArray, lines: dict[tuple[str, Start], FloatArray]
) -> Picture:
    figure = new_figure(2, 1, sharex=True, height=5.2)
    styles = {"Code": ("-", 2.6), "Carrier": ("--", 1.6), "Code+Carrier": ("-", 1.6)}
    data = {"time_s": time_s}
    smoothing = Smoothing()
    for place, kind in enumerate(_KINDS):
        dash, width = styles[kind]
        factor = _RATE_MPS * cmc_rate(f"{kind} {band}", "L1" if band == "L1" else "L5")
        air = factor * smoothed_cmc_s(0, 2.0 * time_s, smoothing) - (_RATE_MPS * time_s if kind != "Code" else 0.0)
        figure.axes[0].plot(time_s, air, color=COLOURS[place], linestyle=dash, linewidth=width, label=f"{kind} {band}")
        for start in STARTS:
            if (kind, start) in lines:
                label = f"{kind} {band}, {start}"
                shown: dict[str, Any] = {"color": COLOURS[place] if start == "variant" else _GREY, "linewidth": width}
                figure.axes[1].plot(time_s, lines[kind, start], linestyle=dash, label=label, **shown)
                data[f"{kind.lower()}_{start}_m"] = lines[kind, start]
    figure.axes[0].set_ylabel("error of the air's\nsmoothed range [m]")
    figure.axes[1].set_ylabel("differential\nerror [m]")
    figure.axes[1].set_xlabel("time since onset and start of the air filter [s]")
    for axis in figure.axes:
        axis.legend(fontsize="small", ncols=2 if len(axis.lines) > 3 else 1)
        axis.set_xlim(0.0, 200.0)
    return Picture(
        name=f"fig-{number}", title=f"Figure {number}: error and differential error on {band}", data=data,
        figure=figure,
        caption="d = 0.01 m/s on the code, -0.01 m/s on the carrier, no detection. Code and Carrier lie on each other "
        "in the lower axes" + (", and so do all invariant filters, at zero." if number == 5 else "."),
    )  # fmt: skip


def _delay_picture() -> Picture:
    delay_s, offset_s = np.arange(5.0, 151.0, 1.0), np.arange(-150.0, 151.0, 1.0)
    error = np.array(
        [np.abs(_RATE_MPS * unit_error_s(2.0 * offset_s, Smoothing(delay_s=float(each)))) for each in delay_s]
    )
    figure = new_figure(height=3.8)
    axis = figure.axes[0]
    mesh = axis.pcolormesh(offset_s, delay_s, error, shading="nearest", cmap="viridis", rasterized=True)
    figure.colorbar(mesh, ax=axis, label="differential error [m]")
    axis.axhline(50.0, color="white", linewidth=1.0, linestyle="--")
    axis.text(-145.0, 53.0, "50 s, used in the tables", color="white", fontsize="small")
    axis.set_xlabel("start of the air filter after the onset, t_a - t_f [s]")
    axis.set_ylabel("delay to incorporation [s]")
    axis.grid(visible=False)
    return Picture(
        name="delay", title="Differential error against the delay to incorporation", figure=figure,
        caption="Carrier or Code, variant filter, d = 0.01 m/s, no detection. The paper describes this surface without "
        "showing it.",
    )  # fmt: skip


def figure_7_and_8() -> Section:
    """Non-centrality and missed detection against the rate."""
    d_mps = np.linspace(0.0, 0.05, 201)
    seen = {mode: monitor_for("gast-f-paper", mode) for mode in FAULT_MODES}
    order = sorted(seen, key=lambda mode: -seen[mode].gain)
    top = tuple(order[:4])
    full_rank = {mode: monitor_for("gast-f-sound", mode) for mode in FAULT_MODES}
    items: list[Item] = [
        Claim(
            name="Figure 7, the four largest", paper_text="; ".join(_TOP_FOUR), ours_text="; ".join(top),
            holds=top == _TOP_FOUR, why="" if top == _TOP_FOUR else "Other modes are larger.",
            definition="Non-centrality in steady state, printed Q, d on codes, -d on carriers; from the largest down.",
        ),
        Claim(
            name="Figures 7 and 8, same order", paper_text="larger ratios, better detection",
            holds=_same_order(seen), ours_text="P_md falls with the non-centrality in every pair of modes",
            definition="At d = 0.004 m/s.",
        ),
        Value(
            name=f"Smallest non-centrality at 0.01 m/s, {order[-1]}", ours=(0.01 * seen[order[-1]].gain) ** 2, unit="-",
            definition=f"Paper's metric; {(0.01 * full_rank[order[-1]].gain) ** 2:.5g} in the sound form.",
        ),
    ]  # fmt: skip
    pictures = (_noncentrality_picture(d_mps, seen, order), _missed_picture(d_mps, seen, order))
    return Section(title="Figures 7 and 8: detection against the rate of divergence", items=items, pictures=pictures)


def _same_order(seen: dict[str, Monitor]) -> bool:
    missed = [(monitor.gain, float(p_md(monitor, 0.004 * monitor.gain))) for monitor in seen.values()]
    ordered = [value for _, value in sorted(missed)]
    return all(later <= earlier + 1e-12 for earlier, later in pairwise(ordered))


def _line_of(place: int) -> dict[str, Any]:
    """Line of the mode at a place in the order of detection: colours for the first, dashes to tell the rest apart."""
    dash = ("-", "--", ":")[place // 5]
    return {"color": COLOURS[place % 5], "linestyle": dash, "linewidth": 1.5}


def _noncentrality_picture(d_mps: FloatArray, seen: dict[str, Monitor], order: list[str]) -> Picture:
    figure = new_figure(width=8.2, height=4.8)
    axis = figure.axes[0]
    data = {"d_mps": d_mps}
    for place, mode in enumerate(order):
        value = (d_mps * seen[mode].gain) ** 2
        axis.plot(d_mps[1:], value[1:], label=mode, **_line_of(place))
        data[f"{mode} [-]"] = value
    axis.axhline(threshold("published", P_FALSE_ALARM), color=LIMIT_COLOUR, linestyle="--", linewidth=1.0)
    axis.text(
        0.0495, threshold("published", P_FALSE_ALARM) * 1.15, "threshold", color=LIMIT_COLOUR, ha="right", fontsize=8
    )
    axis.set_yscale("log")
    axis.set_ylim(1.0, None)
    axis.set_xlim(0.0, 0.05)
    axis.set_xlabel("rate of divergence d [m/s]")
    axis.set_ylabel("non-centrality [-]")
    figure.legend(loc="outside right center", fontsize="x-small", title="from the largest down")
    return Picture(
        name="fig-7", title="Figure 7: non-centrality against the rate", data=data, figure=figure,
        caption="GAST F, paper's metric, steady state; d on the codes of the mode, -d on its carriers.",
    )  # fmt: skip


def _missed_picture(d_mps: FloatArray, seen: dict[str, Monitor], order: list[str]) -> Picture:
    figure = new_figure(width=8.2, height=4.8)
    axis = figure.axes[0]
    data = {"d_mps": d_mps}
    for place, mode in enumerate(order):
        value = p_md(seen[mode], d_mps * seen[mode].gain)
        axis.plot(d_mps, value, label=mode, **_line_of(place))
        data[f"{mode} [-]"] = value
    single = p_md(monitor_for("gast-d", "Code L1"), d_mps)
    axis.plot(d_mps, single, color=COLOURS[-1], linewidth=2.2, label="GAST D, code or carrier")
    data["GAST D, one [-]"] = single
    axis.set_yscale("log")
    axis.set_ylim(1e-9, 2.0)
    axis.set_xlim(0.0, 0.05)
    axis.set_xlabel("rate of divergence d [m/s]")
    axis.set_ylabel("probability of missed detection [-]")
    figure.legend(loc="outside right center", fontsize="x-small")
    return Picture(
        name="fig-8", title="Figure 8: missed detection against the rate", data=data, figure=figure,
        caption="Steady state, probability of false alarm 1e-9 (GAST D: 0.0233 m/s). GAST F detects every mode at "
        "smaller rates than GAST D.",
    )  # fmt: skip


def figure_9_and_10() -> Section:
    """Missed detection against the differential error."""
    error_m = np.linspace(0.0, 3.0, 601)
    return Section(
        title="Figures 9 and 10: missed detection against the differential error",
        text="A mapping function turns an error into the statistic it comes with at the least; the worst one of each "
        "mode gives its curve.",
        pictures=(_picture_9(error_m), _picture_10(error_m)),
    )


def _required_line(axis: Axes, error_m: FloatArray) -> None:
    axis.plot(error_m, required_p_md(error_m), color="#1F4E9E", linewidth=2.4, label="required")
    axis.set_yscale("log")
    axis.set_ylim(1e-9, 2.0)
    axis.set_xlim(0.0, 3.0)
    axis.set_xlabel("differential error [m]")
    axis.set_ylabel("probability of missed detection [-]")


def _picture_9(error_m: FloatArray) -> Picture:
    figure = new_figure()
    axis = figure.axes[0]
    _required_line(axis, error_m)
    limit = one_sided_threshold_mps()
    critical, _ = critical_mapping_gast_d(GROUND_SIGMA_MPS, limit)
    monitor = monitor_for("gast-d", "Code L1", threshold_mps=limit)
    data = {"error_m": error_m, "required": required_p_md(error_m)}
    lines = {f"critical mapping {critical:.4f} 1/s": critical}
    for start in STARTS:
        least = smallest_mapping(responses("Code L1", "gast-d", start, FINE_GRID), FINE_GRID.rates_mps())
        lines[f"worst case, {start} filter, {least.value:.4f} 1/s"] = least.value
    for colour, (label, mapping) in zip((COLOURS[2], COLOURS[1], COLOURS[5]), lines.items(), strict=True):
        value = p_md(monitor, mapping * error_m)
        axis.plot(error_m, value, color=colour, label=label)
        data[label] = value
    axis.legend(fontsize="small")
    return Picture(
        name="fig-9", title="Figure 9: GAST D", data=data, figure=figure,
        caption="The critical mapping function just meets the requirement; the worst cases are far inside. The curve "
        "is the same for Code, Carrier and Code+Carrier.",
    )  # fmt: skip


def _picture_10(error_m: FloatArray) -> Picture:
    figure = new_figure()
    axis = figure.axes[0]
    _required_line(axis, error_m)
    critical, _ = critical_mapping_gast_f("published", P_FALSE_ALARM)
    monitor = monitor_for("gast-f-paper", "Code L5")
    data = {"error_m": error_m, "required": required_p_md(error_m)}
    value = p_md(monitor, np.sqrt(critical * error_m))
    label = f"critical mapping {critical:.2f} 1/m"
    axis.plot(error_m, value, color=COLOURS[2], label=label)
    data[label] = value
    for place, mode in enumerate(("Code L5", "Carrier L5", "Code+Carrier L5")):
        least = smallest_mapping(responses(mode, "gast-f-paper", "variant", FINE_GRID), FINE_GRID.rates_mps())
        value = p_md(monitor, np.sqrt(least.value * error_m))
        label = f"{mode}, {least.value:.1f} 1/m"
        axis.plot(error_m, value, color=(COLOURS[1], COLOURS[5], COLOURS[3])[place], label=label)
        data[label] = value
    axis.legend(fontsize="small")
    return Picture(
        name="fig-10", title="Figure 10: GAST F, L5", data=data, figure=figure,
        caption="Mapping functions of rates from 0.001 m/s, as in table 6. Because the non-centrality grows with the "
        "square of the rate, they are those of errors of millimetres: at the errors drawn here the real curves are far "
        "lower.",
    )  # fmt: skip

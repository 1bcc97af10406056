"""Figures 1 to 4 and table 2 on recorded receivers, the storm of 2003, and the monitors' false alarms there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from gbas_core.ranging.divergence import GROUND, GROUND_THRESHOLD_MPS, DivergenceParams
from gbas_core.record import FloatArray
from gbas_core.satellites import SAT_IDS
from gbas_core.signals import BANDS, L1
from gbas_ground.monitors.divergence_forms import threshold, with_iono_free_code
from gbas_studies.ccd.monitors import P_FALSE_ALARM
from gbas_studies.ccd.recorded import (
    ONE_SECOND_SETS,
    PAIR_L1L2,
    PAIR_L1L5,
    SHORT_SETTLE,
    SINGLE_L1L5,
    SPIRENT_L1L5,
    STORM_FILTERS,
    STORM_SETS,
    MonitoredSeries,
    RecordedSet,
    monitor_set,
)
from gbas_studies.reproduction.drawing import limit_line, new_figure
from gbas_studies.reproduction.items import Claim, Item, Picture, Section, Value
from gbas_studies.reproduction.registry import Options

# Known: ENC 2015, table 2, before and after the filters [m/s].
TABLE_2: Final[dict[str, tuple[str, str]]] = {
    "dCMC1": ("0.1451", "0.0032"), "dCMC5": ("0.0456", "0.0055"), "dCMC_DF1": ("0.1451", "0.0012"),
    "dCMC_DF5": ("0.0458", "0.0012"), "dCMC_IF": ("0.1451", "0.0031"), "dφ_IF,C": ("0.0163", "0.00085"),
}  # fmt: skip
_NO_DATA: Final = "No folder of recorded data was given (--data, or GBAS_DATA)."
_SLUGS: Final = {PAIR_L1L5.name: "pair-l1l5", SINGLE_L1L5.name: "single-l1l5", SPIRENT_L1L5.name: "hardware-simulator",
                 PAIR_L1L2.name: "pair-l1l2"}  # fmt: skip


def sections(options: Options) -> list[Section]:
    """Everything that needs recordings; without them, sections that say so."""
    if options.data is None:
        return [_left_out(_NO_DATA)]
    missing = [each.name for each in (*ONE_SECOND_SETS, *STORM_SETS) if not each.exists(options.data)]
    if missing:
        return [_left_out(f"Files are missing in the folder of recorded data: {'; '.join(missing)}.")]
    series = {}
    for each in ONE_SECOND_SETS:
        options.progress(each.name)
        series[each.name] = monitor_set(each, options.data, filters_of(each))
    return [_one_second(series), _table_2(series), _storm(options.data, options)]


def filters_of(chosen: RecordedSet) -> DivergenceParams:
    """The paper's filters; the shorter settle time where a recording is not much longer than the paper's 360 s."""
    return GROUND if chosen is PAIR_L1L2 else SHORT_SETTLE


def _left_out(why: str) -> Section:
    item = Claim(
        name="Figures 1 to 4, table 2", holds=None, paper_text="recorded at Pattonville", ours_text="–",
        definition="The monitors on recorded receivers.", why=why,
    )  # fmt: skip
    return Section(title="Figures 1 to 4 and table 2: recorded receivers", items=(item,))


def _one_second(series: Mapping[str, MonitoredSeries]) -> Section:
    items: list[Item] = []
    pictures = []
    for chosen in ONE_SECOND_SETS:
        seen = series[chosen.name]
        items += _alarm_claims(chosen, seen)
        pictures.append(picture_of(chosen.name, seen, chosen.other, f"fig-1-4-{_SLUGS[chosen.name]}", _kind(chosen)))
    return Section(
        title="Figures 1 to 4: the monitors on recorded receivers, 1 Hz", items=items, pictures=pictures,
        text="The paper's recording is not public. These are other receivers with ordinary antennas, one or two of "
        "them, elevation mask 5°. Filters of 30 s; they count after 360 s, in the recordings of 5 to 15 minutes after "
        "207 s, when the start adds 1 % to the variance.\n\nThe printed covariance (18) is that of a multipath "
        "limiting "
        "antenna and does not bound ordinary ones. Calibrated covariances are judged on data they were not made from: "
        "each half of a recording by that of the other half.",
    )  # fmt: skip


def _kind(chosen: RecordedSet) -> str:
    return "Recorded from a hardware simulator." if chosen.simulated else "Recorded."


def _alarm_claims(chosen: RecordedSet, seen: MonitoredSeries) -> list[Item]:
    single = [name for name in seen.alarms if name.startswith("gast-d")]
    worst = float(np.nanmax(np.abs(seen.single_mean_mps)))
    alarms = {name: seen.alarms[name] for name in single if seen.alarms[name].any()}
    items: list[Item] = [
        Claim(
            name=f"{chosen.name}: GAST D", holds=not alarms, new=True, paper_text="one false alarm (SV27)",
            ours_text=f"no alarm; largest rate {worst:.4f} m/s" if not alarms else _alarm_text(alarms),
            definition=f"0.0233 m/s, all bands, {_monitored(seen, single=True)}.", why=_alarm_reason(seen, alarms),
        )
    ]  # fmt: skip
    limit = threshold("full_rank", P_FALSE_ALARM)
    metrics, fewest = cross_validated(seen)
    count, largest = int((metrics > limit).sum()), float(np.nanmax(metrics))
    items.append(
        Claim(
            name=f"{chosen.name}: GAST F, sound, calibrated", holds=count == 0, new=True, paper_text="no false alarm",
            ours_text=f"{count or 'no'} alarm; largest metric {largest:.1f} of {limit:.1f}",
            definition=f"Halves judged by each other's covariance ({fewest:.0f} independent samples and more); "
            f"{_monitored(seen)}.",
            why="" if count == 0 else "The covariance of one half does not bound the other.",
        )
    )  # fmt: skip
    printed = int(seen.alarms["gast-f-sound"].sum())
    items.append(
        Claim(
            name=f"{chosen.name}: GAST F, sound, printed Q", holds=printed == 0, new=True, paper_text="no false alarm",
            ours_text=f"{printed or 'no'} alarms; largest metric {np.nanmax(seen.full_rank):.1f}",
            definition="Covariance (18) as if it were of this site.",
            why="" if printed == 0 else "Code multipath of ordinary antennas is larger than (18) bounds.",
        )
    )  # fmt: skip
    return items


def _monitored(seen: MonitoredSeries, *, single: bool = False) -> str:
    known = np.isfinite(seen.single_mean_mps[:, L1] if single else seen.full_rank)
    return f"{int(known.any(axis=0).sum())} satellites, {int(known.sum())} statistics that count"


def _alarm_text(alarms: Mapping[str, np.ndarray]) -> str:
    parts = []
    for name, alarm in alarms.items():
        band = name.split()[1]
        tripped = np.flatnonzero(alarm.any(axis=0))
        parts += [f"{SAT_IDS[each]} on {band}, {int(alarm[:, each].sum())} epochs" for each in tripped]
    return "; ".join(parts)


def _alarm_reason(seen: MonitoredSeries, alarms: Mapping[str, np.ndarray]) -> str:
    """What the two-frequency statistics say of the first alarm: an ionosphere they would not show."""
    if not alarms:
        return ""
    alarm = next(iter(alarms.values()))
    satellite = int(np.flatnonzero(alarm.any(axis=0))[0])
    epochs = np.flatnonzero(alarm[:, satellite])
    with np.errstate(invalid="ignore"):
        free = np.nanmax(np.abs(seen.double_mps[epochs, :, :2, satellite]), axis=(0, 1))
    peak = float(np.nanmax(np.abs(seen.single_mean_mps[epochs][:, :, satellite])))
    elevation = float(np.degrees(seen.elevation_rad[epochs[0], satellite]))
    return (
        f"{SAT_IDS[satellite]} at {elevation:.0f}°: {peak:.4f} m/s, and {free[0]:.4f} m/s in DF1 against "
        f"{free[1]:.4f} m/s in the other DF. What stays without the ionosphere and is on one code is multipath of that "
        "code; one ordinary antenna has no other receivers to average it with."
    )


def cross_validated(seen: MonitoredSeries) -> tuple[FloatArray, float]:
    """Test metric of each half of a series with the other half's calibration, and the fewest independent samples."""
    there = np.flatnonzero(np.isfinite(seen.full_rank).any(axis=1))
    middle = int((there[0] + there[-1]) // 2)
    first, second = slice(0, middle), slice(middle, len(seen.time_s))
    parts, fewest = [], np.inf
    for own, other in ((first, second), (second, first)):
        made = seen.calibrated(GROUND.tau_s, other)
        fewest = min(fewest, made.effective_samples)
        parts.append(seen.metric(made.covariance)[own])
    return np.concatenate(parts), fewest


def picture_of(title: str, seen: MonitoredSeries, other: int, name: str, kind: str, *, hours: bool = False) -> Picture:
    """The four panels of figures 1 to 4: single-frequency rates of both bands, divergence-free ones below."""
    figure = new_figure(2, 2, sharex=True, width=9.0, height=6.2)
    time = seen.time_s / (3600.0 if hours else 60.0)
    single = [receivers_mean(seen.single_mps[:, :, band]) for band in (L1, other)]
    double = [receivers_mean(seen.double_mps[:, :, place]) for place in (0, 1)]
    titles = [f"{kind} {BANDS[band]}" for kind in ("GAST D,", "GAST F, DF") for band in (L1, other)]
    for axis, values, label in zip(figure.axes, (*single, *double), titles, strict=True):
        axis.plot(time, values, linewidth=0.7)
        limit_line(axis, GROUND_THRESHOLD_MPS, "0.0233 m/s", both_sides=True)
        axis.set_title(label, fontsize=10)
        largest = max(0.03, 1.08 * float(np.nanmax(np.abs(np.array([single, double])))))
        axis.set_ylim(-largest, largest)
    for axis in figure.axes[::2]:
        axis.set_ylabel("filtered rate [m/s]")
    for axis in figure.axes[2:]:
        axis.set_xlabel("time [h]" if hours else "time [min]")
    figure.axes[0].legend(handles=[figure.axes[0].lines[-1]], labels=["threshold of GAST D"], fontsize="small")
    return Picture(
        name=name, title=title, figure=figure,
        caption=f"{kind} One line a satellite, mean over receivers. The divergence-free rates below have no "
        "ionosphere; "
        "the threshold of GAST D is drawn there for comparison.",
    )  # fmt: skip


def receivers_mean(values: FloatArray) -> FloatArray:
    """Mean over receivers (E, R, N) of what there is, (E, N)."""
    there = np.isfinite(values)
    count = there.sum(axis=1)
    total = np.where(there, values, 0.0).sum(axis=1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def six_statistics(seen: MonitoredSeries, other: int) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Table 2's six, before and after the filters, of each receiver: (E, R, N) each."""
    four, four_raw = (
        with_iono_free_code(np.moveaxis(values, 2, 0), L1, other) for values in (seen.double_mps, seen.double_rate_mps)
    )
    names = list(TABLE_2)
    result = {
        names[0]: (seen.single_rate_mps[:, :, L1], seen.single_mps[:, :, L1]),
        names[1]: (seen.single_rate_mps[:, :, other], seen.single_mps[:, :, other]),
    }
    result |= {name: (four_raw[place], four[place]) for place, name in enumerate(names[2:])}
    return result


def table_2_items(seen: MonitoredSeries, other: int, where: str) -> list[Item]:
    """Standard deviations of the six statistics before and after filtering."""
    items: list[Item] = []
    for name, values in six_statistics(seen, other).items():
        for stage, printed, value in zip(("before", "after"), TABLE_2[name], values, strict=True):
            items.append(
                Value(
                    name=f"{name}, {stage}", paper=printed, ours=float(np.nanstd(value)), unit="m/s", comparable=False,
                    definition=f"Single receivers, {where}.", why="The paper's recording is not public.",
                )
            )  # fmt: skip
    return items


def _table_2(series: Mapping[str, MonitoredSeries]) -> Section:
    others = {each.name: each.other for each in ONE_SECOND_SETS}
    picture = spread_picture({name: six_statistics(seen, others[name]) for name, seen in series.items()})
    return Section(
        title="Table 2: standard deviations before and after the filters", pictures=(picture,),
        items=table_2_items(series[SINGLE_L1L5.name], SINGLE_L1L5.other, SINGLE_L1L5.name),
        text="Standard deviations over all satellites and epochs that count. Removing the ionosphere changes nothing "
        "before the filters, where code noise rules, and helps after them "
        "as far as the ionosphere rules there. With the code multipath of ordinary antennas it mostly does not.",
    )  # fmt: skip


def spread_picture(sets: Mapping[str, Mapping[str, tuple[FloatArray, FloatArray]]]) -> Picture:
    """After the filters, statistic by statistic: the paper's and ours."""
    figure = new_figure(width=8.6, height=4.4)
    axis = figure.axes[0]
    names = list(TABLE_2)
    paper = [float(TABLE_2[name][1]) for name in names]
    rows: dict[str, Sequence[float]] = {"paper, multipath limiting antenna": paper}
    rows |= {label: [float(np.nanstd(found[name][1])) for name in names] for label, found in sets.items()}
    width = 0.8 / len(rows)
    for place, (label, values) in enumerate(rows.items()):
        axis.bar(np.arange(len(names)) + (place - 0.5 * (len(rows) - 1)) * width, values, width, label=label)
    axis.set_xticks(np.arange(len(names)), [name.replace("5", "5 (or 2)") for name in names])
    axis.set_yscale("log")
    axis.set_ylabel("standard deviation after the filters [m/s]")
    axis.set_ylim(1e-6, 0.1)
    axis.legend(fontsize="x-small", ncols=2)
    axis.grid(axis="x", visible=False)
    return Picture(
        name="table-2", title="Table 2, after the filters", figure=figure,
        caption="The hardware simulator has almost no noise and a smooth ionosphere: what its single-frequency rates "
        "show "
        "is ionosphere alone, and the others remove it.",
    )  # fmt: skip


def _storm(data: Path, options: Options) -> Section:
    items: list[Item] = []
    pictures = []
    for chosen in STORM_SETS:
        options.progress(chosen.name)
        seen = monitor_set(chosen, data, STORM_FILTERS)
        storm = "storm" in chosen.name
        single = seen.alarms["gast-d L1"] | seen.alarms["gast-d L2"]
        double = seen.alarms["gast-f-sound"]
        peak = float(np.nanmax(np.abs(seen.single_mean_mps)))
        free = float(np.nanmax(np.abs(seen.double_mps[:, :, :2])))
        items.append(
            Claim(
                name=f"{chosen.name}: GAST D", holds=bool(single.any()) == storm, new=True,
                paper_text="ionosphere trips it" if storm else "–",
                definition=f"0.0233 m/s on L1 and L2; {_monitored(seen, single=True)}.",
                ours_text=f"{int(single.any(axis=0).sum()) or 'no'} satellites trip; largest rate {peak:.4f} m/s",
                why="" if bool(single.any()) == storm else "The ionosphere is not what its day suggests.",
            )
        )  # fmt: skip
        items.append(
            Claim(
                name=f"{chosen.name}: GAST F, sound", holds=not double.any(), new=True,
                paper_text="ionosphere does not trip it", definition=f"Printed Q; {_monitored(seen)}.",
                ours_text=f"{int(double.any(axis=0).sum()) or 'no'} satellites trip; largest metric "
                f"{np.nanmax(seen.full_rank):.1f} of {threshold('full_rank', P_FALSE_ALARM):.1f}, largest DF rate "
                f"{free:.4f} m/s",
                why="" if not double.any() else "Something besides the ionosphere diverges.",
            )
        )  # fmt: skip
        if chosen in STORM_SETS[:2]:
            station = chosen.name.split(",")[0].lower()
            pictures.append(picture_of(chosen.name, seen, chosen.other, f"storm-{station}", "Recorded.", hours=True))
    return Section(
        title="The ionosphere storm of 2003: recorded at 30 s, L1 and L2", items=items, pictures=pictures,
        text="At 30 s a filter of 30 s filters nothing. These filters have tau = 300 s and count after 2070 s; "
        "thresholds are those of the 30 s filters. Such filters miss what is shorter than some minutes: this shows "
        "what "
        "the combinations remove, not how fast a monitor is.",
    )  # fmt: skip

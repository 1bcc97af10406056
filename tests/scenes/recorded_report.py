"""Prints the tables of recorded data in docs/validation.md: ``python tests/scenes/recorded_report.py [DATA]``."""

from __future__ import annotations

import os
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from gbas_chain.chain import AirborneOutput
from gbas_chain.process import ProcessResult, prepare, process
from gbas_chain.results import Row, error_statistics
from gbas_core.gnss.frames import geodetic_from_ecef, rot_enu_ecef
from gbas_core.gnss.gpstime import epoch_key
from gbas_core.parameters import replaced
from gbas_core.satellites import SAT_IDS
from gbas_msgs_py.records import SolutionEpoch
from gbas_studies.bounding import BoundingReport, bounding_report, error_series
from recorded_sets import recorded_sets, request, truth_ecef_m, truth_of_rows
from rtklib_dgnss import rtklib_positions
from weighted_dgnss import dgnss_position, read_ranges

BOUNDING_SETS = ("upc1_upc2", "upc12_garr", "mosaic_base_rover")
TITLES = {
    "upc1_upc2": "UPC1 → UPC2, 38 m, GPS, 1 Hz",
    "upc12_garr": "UPC1+UPC2 → GARR, 19.7 km, GPS, user at 30 s",
    "mosaic_base_rover": "mosaic base → rover, 1 m, GPS+Galileo",
    "mosaic_rover_base": "mosaic rover → base",
    "spirent_static": "hardware simulator, static rover 2 km east",
    "spirent_dynamic": "hardware simulator, moving rover",
}


def rtklib_of(name: str, data: Path, folder: Path) -> dict[str, np.ndarray]:
    """RTKLIB's own code DGNSS on the first reference receiver and the user of a set."""
    item = recorded_sets()[name]
    return rtklib_positions(
        data / item["ground"][0],
        data / item["user"],
        [data / path for path in item["navigation"]],
        folder,
        base_xyz=tuple(item["ground_xyz_m"][0]),
        systems=item["systems"],
        galileo=item.get("galileo", "inav"),
    )


def paired(rows: tuple[Row, ...], other: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times of week and both positions of the epochs that both programs solved."""
    place = {int(key): k for k, key in enumerate(other["key"])}
    pairs = [
        (row.tow_s, row.position_m, other["xyz_m"][place[epoch_key(row.gps_week, row.tow_s)]])
        for row in rows
        if row.position_m is not None and epoch_key(row.gps_week, row.tow_s) in place
    ]
    return np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs]), np.array([p[2] for p in pairs])


def rms_enu_m(error_ecef_m: np.ndarray, place_m: np.ndarray) -> tuple[float, float]:
    """Horizontal and vertical root mean square of errors (n, 3) [m]."""
    latitude, longitude, _ = geodetic_from_ecef(place_m)
    enu = error_ecef_m @ rot_enu_ecef(latitude, longitude).T
    return float(np.sqrt(np.mean(np.sum(enu[:, :2] ** 2, axis=1)))), float(np.sqrt(np.mean(enu[:, 2] ** 2)))


def rtklib_rms_m(name: str, data: Path, result: ProcessResult) -> tuple[float, float]:
    """RTKLIB's horizontal and vertical root mean square errors on the epochs we solved [m]."""
    with tempfile.TemporaryDirectory() as folder:
        tow_s, _, theirs = paired(result.rows, rtklib_of(name, data, Path(folder)))
    truth = truth_ecef_m(name, data, tow_s)
    return rms_enu_m(theirs - truth, truth[0])


def unsmoothed(name: str, data: Path, *, epochs: int | None = None) -> list[SolutionEpoch]:
    """Solutions of a set without smoothing, and so without settling, on either side."""
    prepared = prepare(request(name, data))
    raw = replace(
        prepared,
        ground=replaced(
            prepared.ground,
            {"smoothing.tau_s": (0.0, 0.0), "smoothing.settle_time_s": 0.0, "monitors.readmission_time_s": 0.0},
        ),
        airborne=replace(prepared.airborne, smoothing_tau_s=0.0, settle_s=0.0),
    )
    outputs = raw.chain().run(raw.epochs()[:epochs])
    return [output.solution for output in outputs if isinstance(output, AirborneOutput)]


def bounding(name: str, data: Path, solutions: list[SolutionEpoch], smoothing_tau_s: float) -> BoundingReport:
    """Sigmas of the first half of a set's solutions, counted in the second; alert limit of GAST-C at 200 ft."""
    truth = truth_ecef_m(name, data, np.array([each.tow_s for each in solutions]))
    return bounding_report(error_series(solutions, truth), smoothing_tau_s=smoothing_tau_s, alert_limit_m=10.0)


def unsmoothed_difference_m(name: str, data: Path) -> tuple[int, float]:
    """Ten minutes without smoothing on either side against DGNSS on RTKLIB's ranges with our weights, every 10th epoch.

    Returns
    -------
    int, float
        Epochs compared, and the root mean square distance of the positions [m].
    """
    item = recorded_sets()[name]
    navigation = [data / path for path in item["navigation"]]
    message, place = item.get("galileo", "inav"), np.array(item["ground_xyz_m"][0])
    with tempfile.TemporaryDirectory() as folder:
        base = read_ranges(data / item["ground"][0], navigation, Path(folder), galileo=message)
        rover = read_ranges(data / item["user"], navigation, Path(folder), galileo=message)
    solutions = [each for each in unsmoothed(name, data, epochs=600)[::10] if np.isfinite(each.x_m)]
    differences = []
    for solution in solutions:
        key = epoch_key(solution.gps_week, solution.tow_s)
        theirs = dgnss_position([(base[key], place)], rover[key], _sigmas_m(solution), place)
        differences.append(np.array([solution.x_m, solution.y_m, solution.z_m]) - theirs)
    return len(differences), float(np.sqrt(np.mean(np.sum(np.square(differences), axis=1))))


def _sigmas_m(solution: SolutionEpoch) -> dict[str, float]:
    """The satellites of a solution with the sigmas that weighted them [m]."""
    columns = (solution.sigma_gnd_m, solution.sigma_air_m, solution.sigma_tropo_m, solution.sigma_iono_m)
    sigma_m = np.sqrt(sum(column**2 for column in columns))
    return {SAT_IDS[k]: float(sigma_m[k]) for k in np.flatnonzero(np.isfinite(sigma_m))}


def print_bounding(title: str, report: BoundingReport) -> None:
    """Two lines of the table of measured sigmas."""
    for error in ("range", "vertical"):
        cells = []
        for each in report.exceedances["measured"][error]:
            share = f"{100.0 * each.count / each.total:.1f} % ({100.0 * each.low:.1f} to {100.0 * each.high:.1f})"
            seen = f"{each.visible_ratio:.1f}" if np.isfinite(each.visible_ratio) else "never"
            cells.append(f"{share}, {each.verdict}; {seen}")
        trials = report.exceedances["measured"][error][0].trials
        print(f"| {title} | {error} | {trials:.1f} | {' | '.join(cells)} |")


def print_bounding_table(data: Path, smoothed: dict[str, ProcessResult]) -> None:
    """Print the table of measured sigmas, smoothed and not, and the Stanford counts."""
    print("| recording | error | trials | beyond K of 30 % | of 10 % | of 1 % |")
    print("|---|---|---|---|---|---|")
    reports = {}
    for name in BOUNDING_SETS:
        with_filters = [output.solution for output in smoothed[name].outputs]
        reports[name] = bounding(name, data, with_filters, smoothed[name].airborne.smoothing_tau_s)
        reports[f"{name} unsmoothed"] = bounding(name, data, unsmoothed(name, data), 0.0)
    for name, report in reports.items():
        print_bounding(name, report)
    for name, report in reports.items():
        sigmas = ", ".join(
            f"{sigma:.2f}" if count else "-"
            for sigma, count in zip(report.measured.sigma_m, report.measured.count, strict=True)
        )
        print(f"{name}: sigma {sigmas} m, {report.ratio:.2f} of the assumed, correlated {report.correlation_s:.0f} s")
        for probability, counts in report.stanford.items():
            print(f"  K of {probability:g}: {counts}")


def main(data: Path) -> None:
    """Print the tables."""
    results: dict[str, ProcessResult] = {}
    print("| recording | solved | horizontal, vertical rms | RTKLIB's | VPL median | error > VPL | error > LPL |")
    print("|---|---|---|---|---|---|---|")
    for name in recorded_sets():
        result = results[name] = process(request(name, data))
        item = error_statistics(result.rows, truth_of_rows(name, data, result.rows))
        theirs = rtklib_rms_m(name, data, result)
        vpl = np.median([row.vpl_m for row in result.rows if row.position_m is not None])
        count = item["epochs"]
        above = [count - item[f"{which}_bounded_epochs"] for which in ("vertical", "lateral")]
        print(
            f"| {TITLES[name]} | {count} of {len(result.rows)} "
            f"| {item['horizontal_rms_m']:.3f}, {item['vertical_rms_m']:.3f} m | {theirs[0]:.3f}, {theirs[1]:.3f} m "
            f"| {vpl:.1f} m | {above[0]}, worst ratio {item['vertical_worst_ratio']:.3f} "
            f"| {above[1]}, {item['lateral_worst_ratio']:.3f} |"
        )
    print_bounding_table(data, results)
    for name in ("upc1_upc2", "mosaic_base_rover", "spirent_static"):
        count, rms_m = unsmoothed_difference_m(name, data)
        print(f"{name}: {count} unsmoothed positions, {100.0 * rms_m:.2f} cm rms from DGNSS on RTKLIB's ranges")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else os.environ.get("GBAS_DATA", "../shared/data")))

"""``gbas process`` beside RTKLIB's own post-processing of the same files, through pyrtklib."""

from __future__ import annotations

import gzip
import importlib.util
import shutil
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any, Final

from gbas_bench.figures import Figure, Part
from gbas_chain.process import ProcessRequest, process, write_results

_FOLDER: Final = "static_pair_L1L2_1h_2010"
GROUND: Final = f"{_FOLDER}/UPC10770.11o.gz"
USER: Final = f"{_FOLDER}/UPC20770.11o.gz"
NAVIGATION: Final = f"{_FOLDER}/brdc0770.11n.gz"
GROUND_XYZ_M: Final = (4789013.0077, 176610.1555, 4195034.8091)
_GPS: Final = 1
_ABOUT: Final = (
    "Files to solution table, wall time: reading, processing, writing; an hour of two receivers at 1 Hz, L1 GPS. "
    "RTKLIB (C) makes code DGPS of them; gbas process (Python) makes smoothed corrections with integrity, broadcasts "
    "them bit for bit, receives them, and computes protection levels."
)


def recorded_request(data: Path) -> ProcessRequest:
    """An hour of two receivers, one as the station's, one as the user's."""
    return ProcessRequest(
        ground=(data / GROUND,), ground_xyz_m=(GROUND_XYZ_M,), user=data / USER, navigation=(data / NAVIGATION,)
    )


def why_not(data: Path | None) -> str:
    """Why there are no recorded files to measure with; empty when there are."""
    if data is None:
        return "no recorded data: name their folder with --data or GBAS_DATA"
    lacking = [name for name in (GROUND, USER, NAVIGATION) if not (data / name).is_file()]
    return f"{data / lacking[0]} is not there" if lacking else ""


def measure_process(data: Path | None, *, repeats: int) -> Part:
    """Time of ``gbas process`` against RTKLIB's and against the duration of the data."""
    reason = why_not(data)
    if reason or data is None:
        return Part(name="process", about=_ABOUT, skipped=reason)
    ours, epochs = [], 0
    for _ in range(repeats):
        seconds, epochs = _ours(data)
        ours.append(seconds)
    ours_s = statistics.median(ours)
    figures = [
        Figure(part="process", name=f"gbas process, {epochs} epochs of 1 s", value=epochs / ours_s, unit="x real time",
               against="real time, 1 Hz", reference=1.0, better="more")
    ]  # fmt: skip
    details: dict[str, Any] = {"gbas_process_s": ours}
    if importlib.util.find_spec("pyrtklib") is None:
        return Part(
            name="process", about=_ABOUT, figures=tuple(figures), details=details,
            skipped="comparison with RTKLIB: pyrtklib is not installed (pip install pyrtklib)",
        )  # fmt: skip
    theirs = [_theirs(data) for _ in range(repeats + 1)][1:]
    figures.append(
        Figure(part="process", name="gbas process, the same files", value=ours_s, unit="s",
               against="RTKLIB (postpos, code DGPS)", reference=statistics.median(theirs), better="less")
    )  # fmt: skip
    return Part(name="process", about=_ABOUT, figures=tuple(figures), details={**details, "rtklib_s": theirs})


def _ours(data: Path) -> tuple[float, int]:
    with tempfile.TemporaryDirectory() as folder:
        begin_s = time.perf_counter()
        result = process(recorded_request(data))
        write_results(result, Path(folder))
        return time.perf_counter() - begin_s, len(result.rows)


def _theirs(data: Path) -> float:
    """Seconds RTKLIB takes."""
    import pyrtklib as rtk

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        files = [str(_plain(data / each, folder)) for each in (USER, GROUND, NAVIGATION)]
        option, solution = rtk.prcopt_default, rtk.solopt_default
        option.mode, option.nf, option.navsys = rtk.PMODE_DGPS, 1, _GPS
        option.ionoopt, option.tropopt = rtk.IONOOPT_BRDC, rtk.TROPOPT_SAAS
        option.refpos = 0
        for axis in range(3):
            option.rb[axis] = GROUND_XYZ_M[axis]
        solution.posf, solution.timef = rtk.SOLF_XYZ, 0
        output = folder / "rtklib.pos"
        outfile = rtk.Arr1Dchar(1024)
        for place, character in enumerate(f"{output}\0"):
            outfile[place] = character
        zero = rtk.gtime_t()
        begin_s = time.perf_counter()
        status = rtk.postpos(zero, zero, 0.0, 0.0, option, solution, rtk.filopt_t(), files, len(files), outfile, "", "")
        taken_s = time.perf_counter() - begin_s
        if status != 0 or not output.exists():
            raise RuntimeError(f"RTKLIB failed with status {status}")
        return taken_s


def _plain(path: Path, folder: Path) -> Path:
    """Uncompressed copy: RTKLIB reads no gzip here, and its time is that of plain files."""
    target = folder / path.name.removesuffix(".gz")
    with gzip.open(path, "rb") as source, target.open("wb") as sink:
        shutil.copyfileobj(source, sink)
    return target

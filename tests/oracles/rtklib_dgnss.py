"""Code DGNSS by RTKLIB (through pyrtklib): an independent second opinion on positions.

RTKLIB reads the files itself, computes its own orbits and clocks, forms double differences of the raw L1 codes against
the base station, and solves each epoch by itself (mode DGPS, no smoothing, no dynamics).
"""

from __future__ import annotations

import gzip
import shutil
from pathlib import Path

import numpy as np
import pyrtklib as rtk

GPS, GALILEO = 0x01, 0x08
_GALILEO_MESSAGES = {"inav": 0, "fnav": 1}


def select_galileo_message(name: str) -> None:
    """Which Galileo navigation message RTKLIB uses from now on: ``"inav"`` (its default) or ``"fnav"``."""
    rtk.setseleph(rtk.SYS_GAL, _GALILEO_MESSAGES[name])


def plain_copy(path: Path, folder: Path) -> Path:
    """Uncompressed copy of a file in `folder` (RTKLIB reads no gzip here); the name keeps RTKLIB's type hint."""
    target = folder / path.name.removesuffix(".gz")
    opener = gzip.open if path.suffix == ".gz" else open
    with opener(path, "rb") as source, open(target, "wb") as sink:
        shutil.copyfileobj(source, sink)
    return target


def rtklib_positions(
    base: Path | None,
    rover: Path,
    navigation: list[Path],
    folder: Path,
    *,
    base_xyz: tuple[float, float, float] | None = None,
    systems: str = "G",
    elevation_mask_deg: float = 5.0,
    troposphere: bool = True,
    ionosphere: bool = True,
    galileo: str = "inav",
) -> dict[str, np.ndarray]:
    """Positions of the rover, epoch by epoch.

    Parameters
    ----------
    base : Path or None
        Base observations; None for a single point solution.

    Returns
    -------
    dict
        ``key`` (n,) milliseconds of GPS time, ``xyz_m`` (n, 3), ``n_sats`` (n,).
    """
    select_galileo_message(galileo)
    option = rtk.prcopt_default
    option.mode = rtk.PMODE_DGPS if base is not None else rtk.PMODE_SINGLE
    option.nf = 1
    option.navsys = (GPS if "G" in systems else 0) | (GALILEO if "E" in systems else 0)
    option.elmin = np.deg2rad(elevation_mask_deg)
    option.ionoopt = rtk.IONOOPT_BRDC if ionosphere else rtk.IONOOPT_OFF
    option.tropopt = rtk.TROPOPT_SAAS if troposphere else rtk.TROPOPT_OFF
    option.maxtdiff = 1.0
    if base is not None:
        assert base_xyz is not None
        option.refpos = 0
        for axis in range(3):
            option.rb[axis] = base_xyz[axis]
    solution = rtk.solopt_default
    solution.posf = rtk.SOLF_XYZ
    solution.timef = 0
    solution.times = rtk.TIMES_GPST
    solution.outhead = 0
    files = [str(plain_copy(rover, folder))]
    if base is not None:
        files.append(str(plain_copy(base, folder)))
    files += [str(plain_copy(item, folder)) for item in navigation]
    output = folder / "rtklib.pos"
    outfile = rtk.Arr1Dchar(1024)
    for index, character in enumerate(str(output) + "\0"):
        outfile[index] = character
    zero = rtk.gtime_t()
    status = rtk.postpos(zero, zero, 0.0, 0.0, option, solution, rtk.filopt_t(), files, len(files), outfile, "", "")
    if status != 0 or not output.exists():
        raise RuntimeError(f"RTKLIB failed with status {status}")
    rows = [line.split() for line in output.read_text().splitlines() if line and not line.startswith("%")]
    week = np.array([int(row[0]) for row in rows])
    tow = np.round([float(row[1]) for row in rows], 1)  # RTKLIB takes the receiver clock off the time tag
    return {
        "key": np.round(week * 604_800_000 + tow * 1000.0).astype(np.int64),
        "xyz_m": np.array([[float(value) for value in row[2:5]] for row in rows]),
        "n_sats": np.array([int(row[6]) for row in rows]),
    }

"""Ephemerides of recorded streams."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gbas_core.gnss.gpstime import SECONDS_PER_WEEK
from gbas_core.io.files import PathLike
from gbas_core.io.rinex.navigation import NavigationFile, NavigationRow, navigation_of
from gbas_core.io.rtcm.stream import RtcmError, Stream, read_stream


def read_rtcm_navigation(
    paths: PathLike | Sequence[PathLike], *, gps_week: int | None = None, galileo: str = "inav", simulated: bool = False
) -> NavigationFile:
    """Read and merge the ephemerides of recorded streams: messages 1019, 1045 and 1046.

    Parameters
    ----------
    paths : path or sequence of paths
        RTCM 3 streams, plain or gzip.
    gps_week : int or None
        GPS week of the first epoch of each; None takes it from the ephemerides.
    galileo, simulated
        As of :func:`gbas_core.io.rinex.read_navigation`.

    Returns
    -------
    NavigationFile
        The time of transmission of a record is the epoch of the stream at which it came first.

    Raises
    ------
    RtcmError
        For a stream that cannot be used, and when there is no ephemeris of GPS or Galileo.
    ValueError
        For another `galileo`.

    Notes
    -----
    The week of toe is the one that brings toe nearest to the epoch at which the message came. A message whose own week
    says otherwise is old and left out.
    """
    files = tuple(Path(path) for path in ([paths] if isinstance(paths, str | Path) else paths))
    if not files:
        raise ValueError("paths: no stream given")
    notes: list[str] = []
    records: list[NavigationRow] = []
    for path in files:
        stream = read_stream(path, gps_week=gps_week)
        notes += [f"{path}: {note}" for note in stream.notes]
        records += _records_of(stream, notes)
    if not records:
        raise RtcmError(", ".join(map(str, files)), "has no ephemeris of GPS or Galileo; expected at least one")
    return navigation_of(files, records, galileo=galileo, simulated=simulated, notes=notes)


def _records_of(stream: Stream, notes: list[str]) -> list[NavigationRow]:
    rows: list[NavigationRow] = []
    old = 0
    for key, raw in stream.ephemerides():
        received_s = key / 1000.0
        toe_s = received_s + raw.toe_after_s(received_s)
        if raw.satellite is None:
            continue
        if not raw.is_of_week(toe_s):
            old += 1
            continue
        rows.append((raw.satellite, raw.values(round((toe_s - raw.toe_tow_s) / SECONDS_PER_WEEK)), received_s))
    if old:
        notes.append(f"{stream.path}: {old} ephemerides are of another week and were left out")
    return rows

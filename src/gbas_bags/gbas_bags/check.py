"""Is a bag whole, readable by others, in order, and can its alerts be traced?

A problem names file, topic and index. A note is something a person should know that is no fault of the bag.
"""

from __future__ import annotations

from pathlib import Path

from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from rosbags.highlevel import AnyReader

from gbas_bags.bags import METADATA_FILE, bag_files
from gbas_bags.check_contents import Contents
from gbas_bags.problems import CheckResult, Problem, text_of


def check(path: Path) -> CheckResult:
    """Check a bag.

    Raises
    ------
    BagError
        When there is no such bag, or a file of it is no MCAP at all.
    """
    result = CheckResult(path)
    contents = Contents(result)
    for file in bag_files(path):
        count = contents.read(file)
        result.messages += count
        _check_with_mcap(file, count, result)
    _check_with_rosbags(path, result)
    contents.check_versions()
    contents.check_order()
    contents.check_frames()
    contents.check_alerts()
    contents.check_exclusions()
    return result


# --- other readers


def _check_with_mcap(file: Path, count: int, result: CheckResult) -> None:
    """The mcap library must read it, with every CRC, and its summary must be true."""
    try:
        with file.open("rb") as stream:
            for _ in StreamReader(stream, validate_crcs=True).records:
                pass
        with file.open("rb") as stream:
            summary = make_reader(stream).get_summary()
        counted = summary.statistics.message_count if summary and summary.statistics else None
        if counted != count:
            result.problem(Problem(f"its summary counts {counted} messages, and it holds {count}", str(file)))
        result.checked["files read by mcap"] += 1
    except Exception as error:  # whatever the library makes of damaged bytes
        result.problem(Problem(f"mcap cannot read it: {text_of(error)}", str(file)))


def _check_with_rosbags(path: Path, result: CheckResult) -> None:
    """The rosbags library must read it, as tools for rosbag2 do."""
    if path.is_dir() and not (path / METADATA_FILE).is_file():
        result.problem(Problem(f"{METADATA_FILE} is missing; rosbag2 needs it", str(path)))
        return
    try:
        with AnyReader([path]) as reader:
            count = sum(1 for _ in reader.messages())
        if count != result.messages:
            result.problem(Problem(f"rosbags reads {count} messages of {result.messages}", str(path)))
        result.checked["messages read by rosbags"] += count
    except Exception as error:  # whatever the library makes of damaged bytes
        result.problem(Problem(f"rosbags cannot read it: {text_of(error)}", str(path)))

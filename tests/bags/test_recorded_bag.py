"""The bag that comes with the repository: small, whole, labelled, and replayed to the same numbers.

A regression test: what is expected is what the suite itself computed when the bag was recorded (bags/README.md).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gbas_bags import bags
from gbas_bags.bags import vector_instructions
from gbas_bags.check import check
from gbas_bags.compare import NAMES, TopicComparison
from gbas_bags.info import info
from gbas_bags.records import read_records
from gbas_cli.replay import ReplayRequest, ReplayResult, replay
from gbas_core.record import columns_of
from gbas_msgs_py import topics

BAG = Path(__file__).resolve().parents[2] / "bags" / "short_approach"
EPOCHS = 399
TABLES = tuple(topics.resolve(name) for name in NAMES if name != topics.VDB)


def test_the_bag_is_small_whole_and_labelled() -> None:
    assert sum(file.stat().st_size for file in BAG.iterdir()) < 3_000_000
    result = check(BAG)
    assert result.ok, result.problems
    document = info(BAG).as_json()
    assert document["origin"] == "simulated"
    assert document["command"].startswith("gbas demo --config short_approach")


@pytest.mark.ros
def test_replay_gives_the_recorded_numbers(tmp_path: Path) -> None:
    result = replay(ReplayRequest(bag=BAG, out=tmp_path, quiet=True))
    # one mode runs in the bag, so that there is no table of all of them
    of_one_mode = {name for topic, name in NAMES.items() if topic != topics.AIRBORNE_MODES}
    assert {topic.name for topic in result.topics} == of_one_mode
    recorded_on = info(BAG).metadata[bags.SUITE_METADATA].get(bags.VECTOR_METADATA)
    if recorded_on in (None, vector_instructions()):
        assert [difference(topic) for topic in result.topics if differs(topic)] == []
    else:
        compare_values(result)


def differs(topic: TopicComparison) -> bool:
    """Whether anything of a topic is not as it was recorded, to the bit."""
    return topic.recorded != EPOCHS or not topic.same or topic.extra > 0


def difference(topic: TopicComparison) -> str:
    """What a failure says."""
    return f"{topic.verdict()}; {topic.explanation()} (meant? then: make bag)"


def compare_values(result: ReplayResult) -> None:
    """Every column of every table, on a processor whose sines may differ in the last bit: a millionth."""
    before, after = (read_records(bag, TABLES) for bag in (result.bag, result.replayed))
    for topic in TABLES:
        assert len(before[topic]) == len(after[topic]) == EPOCHS
        for old, new in zip(before[topic], after[topic], strict=True):
            assert (old.gps_week, old.tow_s) == (new.gps_week, new.tow_s)
            for field, _ in columns_of(type(old)):
                then, now = getattr(old, field.name), getattr(new, field.name)
                np.testing.assert_allclose(now, then, rtol=1e-6, atol=1e-6, err_msg=f"{topic} {field.name}")


def test_a_difference_is_seen() -> None:
    """One epoch of one table that differs, or is missing, or was not recorded."""
    good = TopicComparison("/t", "monitor epochs", recorded=EPOCHS, identical=EPOCHS)
    assert not differs(good)
    for counts in ({"different": 1, "identical": EPOCHS - 1}, {"missing": 1}, {"extra": 1}, {"recorded": EPOCHS - 1}):
        assert differs(TopicComparison(**{**vars(good), **counts}))

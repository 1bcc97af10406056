"""The bag that comes with the repository: small, whole, labelled, and replayed to the same numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gbas_bringup import bags
from gbas_bringup.bag_check import check
from gbas_bringup.bag_records import read_records
from gbas_bringup.replay import ReplayRequest, replay
from gbas_core.record import columns_of
from gbas_msgs_py import topics
from gbas_msgs_py.records import ProtectionEpoch, SolutionEpoch

BAG = Path(__file__).resolve().parents[2] / "bags" / "short_approach"
SOLUTION = topics.resolve(topics.AIRBORNE_SOLUTION)
PROTECTION = topics.resolve(topics.AIRBORNE_PROTECTION)


def test_the_bag_is_small_whole_and_labelled() -> None:
    assert sum(file.stat().st_size for file in BAG.iterdir()) < 3_000_000
    result = check(BAG)
    assert result.ok, result.problems
    document = bags.info(BAG).as_json()
    assert document["origin"] == "simulated"
    assert document["command"].startswith("gbas demo --config short_approach")


@pytest.mark.ros
def test_replay_gives_the_recorded_numbers(tmp_path: Path) -> None:
    """Bit for bit on one type of processor; sines of another may differ in the last bit, so 1 µm here."""
    result = replay(ReplayRequest(bag=BAG, out=tmp_path, quiet=True))
    before, after = (read_records(bag, (SOLUTION, PROTECTION)) for bag in (BAG, result.replayed))
    for topic, kind in ((SOLUTION, SolutionEpoch), (PROTECTION, ProtectionEpoch)):
        assert len(before[topic]) == len(after[topic]) == 399
        for old, new in zip(before[topic], after[topic], strict=True):
            assert (old.gps_week, old.tow_s) == (new.gps_week, new.tow_s)
            for field, _ in columns_of(kind):
                np.testing.assert_allclose(
                    getattr(new, field.name), getattr(old, field.name), rtol=0.0, atol=1e-6, err_msg=field.name
                )

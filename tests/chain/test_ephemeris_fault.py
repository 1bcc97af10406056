"""A recorded ephemeris fault: G17's Cuc of 2010-03-18 20:00 is wrong in one of two navigation files.

The fault moves the satellite by about 2 km along its track. Whoever holds the wrong file, the satellite must never
reach a position.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import yaml

from gbas_bringup.resources import config_path
from gbas_chain.chain import AirborneOutput, Chain
from gbas_chain.process import NOMINAL_STATION, ProcessRequest, prepare
from gbas_chain.results import Row
from gbas_core.gnss.gpstime import epoch_key
from gbas_core.satellites import SAT_INDEX
from gbas_ground.params import watching
from gbas_msgs_py.codes import ChannelState, ExclusionCause

FOLDER = "static_pair_L1L2_1h_2010"
RIGHT, WRONG = "brdc0770.10n.gz", "brdc0770.10nERR.gz"
G17 = SAT_INDEX["G17"]
# The faulty record (toe 20:00, IODE 78) is sent from 18:00:50 on; 17:30 to 20:30 covers its first hours.
WEEK, FIRST_S, LAST_S = 1575, 345_600 + 17.5 * 3600, 345_600 + 20.5 * 3600
MATA_M = np.array([4776835.587, 202618.9947, 4207574.6304])


@dataclass(frozen=True)
class Flown:
    """What came of one combination of navigation files."""

    with_g17: int
    solved: int
    worst_error_ratio: float
    causes: set[str]


def _fly(data: Path, folder: Path, ground_navigation: str, user_navigation: str) -> Flown:
    """GARR as station, MATA (51 km away, so without a maximum use distance) as user."""
    document = yaml.safe_load(config_path(NOMINAL_STATION).read_text(encoding="utf-8"))
    document["ground"]["station"]["max_use_distance_m"] = 0.0
    # A file of 30 s is too slow for monitors that are made for 2 Hz.
    document["ground"] |= {
        "carrier_acceleration": {"exclude": False},
        "ccd": {"exclude": False},
        "ccd_f": {"exclude": "none"},
    }
    station = folder / "unlimited_station.yaml"
    station.write_text(yaml.safe_dump(document), encoding="utf-8")
    prepared = prepare(
        ProcessRequest(
            ground=(data / FOLDER / "GARR0770.10o.gz",),
            user=data / FOLDER / "MATA0770.10o.gz",
            navigation=(data / FOLDER / ground_navigation,),
            user_navigation=(data / FOLDER / user_navigation,),
            station=station,
        )
    )
    first, last = epoch_key(WEEK, FIRST_S), epoch_key(WEEK, LAST_S)
    outputs, causes = [], set()
    for output in prepared.chain().run(epoch for epoch in prepared.epochs() if first <= epoch.key <= last):
        causes |= {event.cause for event in output.events if event.subject.startswith("G17")}
        if isinstance(output, AirborneOutput):
            outputs.append(output)
    rows = [Row.of(output.solution, output.protection) for output in outputs]
    solved = [row for row in rows if row.position_m is not None]
    return Flown(
        with_g17=sum(bool(np.isfinite(output.solution.s_vert[G17])) for output in outputs if _after_switch(output)),
        solved=len(solved),
        worst_error_ratio=max(float(np.linalg.norm(row.position_m - MATA_M)) / row.vpl_m for row in solved),
        causes=causes,
    )


def _after_switch(output: AirborneOutput) -> bool:
    # Until toe of the old record + 2 h (20:00) a station may go on with the old record, which is right.
    return output.solution.tow_s > 345_600 + 20 * 3600


def test_right_ephemeris_is_used(data_dir: Path, tmp_path: Path) -> None:
    flown = _fly(data_dir, tmp_path, RIGHT, RIGHT)
    assert flown.with_g17 > 50  # of the 60 epochs from 20:00 to 20:30
    assert flown.worst_error_ratio < 1.0


@pytest.mark.parametrize(
    ("ground_navigation", "user_navigation", "cause"),
    [
        (RIGHT, WRONG, "ephemeris_crc_mismatch"),
        (WRONG, RIGHT, "ephemeris_change"),
        (WRONG, WRONG, "ephemeris_change"),
    ],
)
def test_wrong_ephemeris_never_reaches_a_position(
    data_dir: Path, tmp_path: Path, ground_navigation: str, user_navigation: str, cause: str
) -> None:
    flown = _fly(data_dir, tmp_path, ground_navigation, user_navigation)
    assert cause in flown.causes
    assert flown.with_g17 == 0
    assert flown.solved > 300
    assert flown.worst_error_ratio < 1.0


def test_ground_that_never_knew_better_does_not_correct_with_it(data_dir: Path) -> None:
    """A station without an older record cannot compare, but this Cuc does not fit its 16 bits: nobody broadcast it."""
    prepared = prepare(
        ProcessRequest(
            ground=(data_dir / FOLDER / "GARR0770.10o.gz",),
            user=data_dir / FOLDER / "MATA0770.10o.gz",
            navigation=(data_dir / FOLDER / WRONG,),
        )
    )
    received = prepared.recording.ephemerides()
    newest = tuple(item for item in received if not item.toe_tow_s[G17] < LAST_S - 3600)
    ground = watching(prepared.ground)  # a file of 30 s is too slow for them
    chain = Chain(ground, prepared.airborne, newest, newest)
    first, last = epoch_key(WEEK, 345_600 + 20.1 * 3600), epoch_key(WEEK, LAST_S)
    outputs = [chain.ground_step(epoch) for epoch in prepared.recording.epochs(first=first, last=last)]
    assert all(output.integrity.state[G17] != ChannelState.USABLE for output in outputs)
    assert outputs[-1].integrity.cause[G17] == ExclusionCause.NO_EPHEMERIS
    assert (outputs[-1].integrity.state == ChannelState.USABLE).sum() >= 6

"""Type 11 messages joined with the type 1 messages of their instant."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from gbas_airborne.reception.columns import B_VALUES, IOD, LISTED, PRC, RRC, SIGMA
from gbas_airborne.reception.service_d import joined, with_decorrelation
from gbas_airborne.reception.station_data import Corrections, correction_set
from gbas_core.gnss.gpstime import modified_z_count_s
from gbas_core.satellites import SAT_INDEX
from gbas_vdb.messages.types import Correction30, Correction100, Type11

FRAME = (2300, 7200.0)


def of_type1(*sources: int, frame: tuple[int, float] = FRAME) -> Corrections:
    """A set of type 1 corrections."""
    return correction_set(
        frame,
        frame,
        tuple(
            Correction100(
                ranging_source_id=source, iod=7, prc_m=float(source), rrc_mps=0.1, sigma_pr_gnd_m=0.5,
                b_values_m=(0.1, -0.1, math.nan, math.nan),
            )
            for source in sources
        ),
    )  # fmt: skip


def type11(*sources: int, flag: int = 0, frame: tuple[int, float] = FRAME, sigma_d_m: float = 0.2) -> Type11:
    """A type 11 message; its corrections are 100 m more than those of type 1."""
    return Type11(
        modified_z_count_s=modified_z_count_s(frame[1]),
        additional_message_flag=flag,
        ephemeris_decorrelation_d=1e-4,
        measurements=tuple(
            Correction30(
                ranging_source_id=source, prc_30_m=100.0 + source, rrc_30_mps=0.3, sigma_pr_gnd_d_m=sigma_d_m,
                sigma_pr_gnd_30_m=0.9,
            )
            for source in sources
        ),
    )  # fmt: skip


def test_corrections_and_sigmas_are_type_11s_the_rest_type_1s() -> None:
    found = joined({"l1_100": of_type1(5, 73)}, (type11(5, 73),), FRAME)
    of_30, of_d = found["l1_30"], found["l1_100_d"]
    for satellite, source in (("G05", 5), ("E03", 73)):
        s = SAT_INDEX[satellite]
        assert of_30.columns[[LISTED, IOD, PRC, RRC, SIGMA], s].tolist() == [1.0, 7.0, 100.0 + source, 0.3, 0.9]
        assert of_d.columns[[LISTED, IOD, PRC, RRC, SIGMA], s].tolist() == [1.0, 7.0, float(source), 0.1, 0.2]
        for columns in (of_30.columns, of_d.columns):
            np.testing.assert_array_equal(columns[B_VALUES:, s], [0.1, -0.1, math.nan, math.nan])
    assert (of_30.received, of_30.tow_s) == (FRAME, FRAME[1])
    assert found["l1_100"].columns[SIGMA, SAT_INDEX["G05"]] == 0.5  # inflated, for GAST-C


@pytest.mark.parametrize("order", [(1, 3), (3, 1)])
def test_both_messages_of_a_pair_count(order: tuple[int, int]) -> None:
    messages = tuple(type11(5 if flag == 1 else 6, flag=flag) for flag in order)
    columns = joined({"l1_100": of_type1(5, 6)}, messages, FRAME)["l1_30"].columns
    assert np.isfinite(columns[LISTED]).sum() == 2


def test_half_a_pair_and_another_instant_add_nothing() -> None:
    before = joined({"l1_100": of_type1(5, 6)}, (type11(5, 6),), FRAME)
    later = (2300, 7200.5)
    now = {**before, "l1_100": of_type1(5, 6, frame=later)}
    for messages, frame in (
        ((type11(5, flag=1, frame=later),), later),
        ((type11(5, flag=3, frame=later),), later),
        ((type11(5, 6),), FRAME),
        ((), None),
    ):
        assert joined(now, messages, frame) is now
        assert joined({}, messages, frame) == {}
    assert joined(now, (type11(5, 6, frame=later),), later)["l1_30"].tow_s == 7200.5


def test_a_satellite_needs_both_messages_and_may_be_in_each_once() -> None:
    found = joined({"l1_100": of_type1(5, 6)}, (type11(6, 8, 6, 255),), FRAME)
    of_30, of_d = found["l1_30"].columns, found["l1_100_d"].columns
    assert np.isnan(of_30[LISTED, [SAT_INDEX["G05"], SAT_INDEX["G08"]]]).all()
    for columns in (of_30, of_d):
        assert columns[LISTED, SAT_INDEX["G06"]] == 1.0
        assert math.isnan(columns[SIGMA, SAT_INDEX["G06"]])  # twice: it contradicts itself


def test_a_sigma_that_marks_a_correction_invalid_stays_so() -> None:
    found = joined({"l1_100": of_type1(5)}, (type11(5, sigma_d_m=math.nan),), FRAME)
    assert math.isnan(found["l1_100_d"].columns[SIGMA, SAT_INDEX["G05"]])
    assert found["l1_30"].columns[SIGMA, SAT_INDEX["G05"]] == 0.9


def test_p_d_is_the_first_satellites() -> None:
    p_d = with_decorrelation(None, type11(5, 6))
    assert p_d is not None
    assert p_d[SAT_INDEX["G05"]] == 1e-4
    assert np.isfinite(p_d).sum() == 1
    more = with_decorrelation(p_d, replace(type11(6, 5), ephemeris_decorrelation_d=2e-4))
    assert more is not None
    assert (more[SAT_INDEX["G05"]], more[SAT_INDEX["G06"]]) == (1e-4, 2e-4)
    assert with_decorrelation(p_d, type11()) is p_d

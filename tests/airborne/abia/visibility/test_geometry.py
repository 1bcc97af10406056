"""Dilution of precision against the projection of one epoch and closed forms; requirements as printed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gbas_airborne.abia.visibility.geometry import EstimatedErrors, dilution, estimated_errors
from gbas_airborne.abia.visibility.requirements import (
    PAPER_SIGMA_UERE_M,
    REQUIREMENTS,
    GeometryCriteria,
    accuracy_missed,
    alert_limit_exceeded,
)
from gbas_core.positioning.wls import projection_matrix
from gbas_core.satellites import CLOCK_GROUPS, N_SATS


def random_sky(seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    azimuth, elevation = random.uniform(0.0, 2.0 * np.pi, N_SATS), random.uniform(0.1, 1.5, N_SATS)
    los = np.stack(
        [np.cos(elevation) * np.sin(azimuth), np.cos(elevation) * np.cos(azimuth), np.sin(elevation)], axis=0
    )
    used = np.zeros(N_SATS, dtype=bool)
    used[random.choice(N_SATS, count, replace=False)] = True
    return los, used


@pytest.mark.parametrize("count", [3, 4, 5, 6, 9, 20])
def test_dilution_is_of_the_projection(count):
    """The squares of S with ranges of one metre."""
    skies = [random_sky(seed, count) for seed in range(8)]
    found = dilution(np.stack([los for los, _ in skies]), np.stack([used for _, used in skies]))
    assert (found.satellites == count).all()
    for number, (los, used) in enumerate(skies):
        projection = projection_matrix(los, np.where(used, 1.0, np.nan), CLOCK_GROUPS)
        if projection is None:
            assert math.isnan(found.pdop[number])
            continue
        squares = (projection**2).sum(axis=1)
        assert found.hdop[number] == pytest.approx(math.sqrt(squares[:2].sum()), rel=1e-6)
        assert found.vdop[number] == pytest.approx(math.sqrt(squares[2]), rel=1e-6)
        assert found.pdop[number] == pytest.approx(math.sqrt(squares[:3].sum()), rel=1e-6)


def test_regular_geometry():
    """One at the zenith and three at 120 degrees in the horizon: HDOP^2 = VDOP^2 = 4/3 (K&H, 7.3)."""
    los, used = np.full((3, N_SATS), np.nan), np.zeros(N_SATS, dtype=bool)
    los[:, 0] = (0.0, 0.0, 1.0)
    for number in (1, 2, 3):
        angle = 2.0 * np.pi * number / 3.0
        los[:, number] = (math.sin(angle), math.cos(angle), 0.0)
    used[:4] = True
    found = dilution(los, used)
    assert float(found.hdop) == pytest.approx(math.sqrt(4.0 / 3.0))
    assert float(found.vdop) == pytest.approx(math.sqrt(4.0 / 3.0))


def test_no_position_without_geometry():
    los, used = random_sky(1, 6)
    cone = los.copy()
    cone[2] = 0.5  # all at one elevation: height and clock cannot be told apart
    cone[:2] *= math.sqrt(0.75) / np.hypot(cone[0], cone[1])
    gps = used & CLOCK_GROUPS[0]
    gps[:6] = True
    assert math.isnan(float(dilution(cone, gps).pdop))
    unknown = los.copy()
    unknown[:, used] = np.nan
    assert (float(dilution(unknown, used).satellites), math.isnan(float(dilution(unknown, used).pdop))) == (0.0, True)


def test_requirements_of_the_paper():
    """Tables II and III; the tighter end of ranges."""
    paper = REQUIREMENTS["paper"]
    assert paper["oceanic"][2:] == pytest.approx((7400.0, math.nan, 300.0), nan_ok=True)
    assert paper["npa"] == pytest.approx((220.0, math.nan, 556.0, math.nan, 10.0), nan_ok=True)
    assert paper["apv_2"] == (16.0, 8.0, 40.0, 20.0, 6.0)
    assert paper["cat_1"] == (16.0, 4.0, 40.0, 10.0, 6.0)
    assert paper["cat_3"] == (6.2, 2.0, 15.5, 5.3, 1.0)
    assert set(paper) == set(REQUIREMENTS["current"])
    assert GeometryCriteria(table="paper", phase="cat_2").requirement.val_m == 5.3


def test_selective_availability_would_stop_every_precision_approach():
    """With 33.3 m and the best dilution there is (HDOP 0.8, VDOP 1.1) APV-I and better are never met; en route is."""
    best = estimated_errors(dilution(*random_sky(3, 20))._replace(hdop=np.array(0.8), vdop=np.array(1.1)), 33.3)
    assert PAPER_SIGMA_UERE_M == 33.3
    for table in REQUIREMENTS.values():
        for phase, requirement in table.items():
            assert accuracy_missed(best, requirement) == phase.startswith(("apv", "cat"))
    with pytest.raises(ValueError, match="sigma_uere_m = 0.0"):
        estimated_errors(dilution(*random_sky(3, 20)), 0.0)


def test_errors_against_requirements():
    """95 % is 1.96 sigma; either direction counts; nothing known meets nothing."""
    apv = REQUIREMENTS["current"]["apv_1"]

    def errors(ehe_m: float, eve_m: float) -> EstimatedErrors:
        return EstimatedErrors(*(np.array(each) for each in (math.hypot(ehe_m, eve_m), ehe_m, eve_m)))

    assert not accuracy_missed(errors(16.0 / 1.97, 20.0 / 1.97), apv)
    assert accuracy_missed(errors(16.0 / 1.95, 1.0), apv)
    assert accuracy_missed(errors(1.0, 20.0 / 1.95), apv)
    assert accuracy_missed(errors(math.nan, math.nan), apv)
    assert not alert_limit_exceeded(errors(19.0, 19.0), apv)
    assert alert_limit_exceeded(errors(19.0, 26.0), apv)
    assert alert_limit_exceeded(errors(math.nan, 1.0), REQUIREMENTS["current"]["npa"])
    assert not accuracy_missed(errors(10.0, 1e5), REQUIREMENTS["current"]["npa"])  # requires nothing vertically

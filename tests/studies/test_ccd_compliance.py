"""Compliance with the range-domain requirement: critical mappings against rates, times and starts tried singly."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import ncx2, norm

from divergence_loops import GAMMA_L5, ccd_statistic, four_statistics, hatch
from gbas_core.ranging.fault_modes import FAULT_MODES, FAULT_SIGNS
from gbas_ground.monitors.divergence_covariance import PRINTED_COVARIANCE
from gbas_studies.ccd import compliance, compliance_items
from gbas_studies.ccd.compliance import USERS, cell, cells
from gbas_studies.ccd.monitors import MONITORS
from gbas_studies.reproduction.items import Verdict

NEAR, FAR = GAMMA_L5 / (GAMMA_L5 - 1.0), -1.0 / (GAMMA_L5 - 1.0)
WEIGHTS = {"L1": (1.0, 0.0), "L5": (0.0, 1.0), "IF": (NEAR, FAR)}
SOUND_ROWS = [0, 1, 3]
SOUND_INVERSE = np.linalg.inv(PRINTED_COVARIANCE[np.ix_(SOUND_ROWS, SOUND_ROWS)])
PAPER_INVERSE = np.linalg.pinv(PRINTED_COVARIANCE)


def required(error_m: np.ndarray) -> np.ndarray:
    """The curve as the standard words it."""
    return np.select([error_m < 0.75, error_m < 2.7], [1.0, 10.0 ** (-2.56 * error_m + 1.92)], 1e-5)


def missed(monitor: str, statistic: np.ndarray) -> np.ndarray:
    """scipy's own distributions; the suite has the special functions."""
    if monitor == "gast-d":
        return norm.cdf(0.0233, statistic, 0.00399) - norm.cdf(-0.0233, statistic, 0.00399)
    limit, freedom = (47.8795, 4) if monitor == "gast-f-paper" else (44.8413, 3)  # published; chi-square table of 1e-9
    return ncx2.cdf(limit, freedom, statistic**2)


def steady(monitor: str, rates: np.ndarray, user: str) -> float:
    """Statistic that a rate ends in: eq (2) or (8) to (11) and (15), written out."""
    code1, code5, carrier1, carrier5 = rates
    if monitor == "gast-d":
        bands = np.abs([code1 - carrier1, code5 - carrier5])
        return {"L1": bands[0], "L5": bands[1], "IF": bands.max()}[user]
    means = np.array(four_statistics(code1, code5, carrier1, carrier5))
    if monitor == "gast-f-sound":
        return float(np.sqrt(means[SOUND_ROWS] @ SOUND_INVERSE @ means[SOUND_ROWS]))
    return float(np.sqrt(means @ PAPER_INVERSE @ means))


def error_rate(rates: np.ndarray, user: str) -> float:
    first, second = WEIGHTS[user]
    return abs(first * (rates[0] - rates[2]) + second * (rates[1] - rates[3]))


@pytest.fixture(scope="module")
def moments():
    """Response of the filters and error of users at some times, for 1 m/s, by plain loops: (response, error)."""
    alpha, found = 0.5 / 30.0, []
    ground_start = -500
    for sample in (45, 60, 80, 100, 130, 160, 180, 200, 220, 240, 260, 300, 400):
        ground = hatch([0.5 * max(n, 0) for n in range(ground_start, sample + 1)],
                       [0.0] * (sample - ground_start + 1), alpha, True)  # fmt: skip
        seen = ccd_statistic(1.0, -0.5 * 99 + 0.5 * sample - 1.5)
        for start in range(sample - 99, -81, -3):  # the youngest used filter first
            for variant in (True, False):
                code = [0.5 * max(n, 0) for n in range(start, sample + 1)]
                found.append((seen, abs(hatch(code, [0.0] * len(code), alpha, variant) - ground)))
    return np.array(found)


def test_smallest_response_over_error_is_that_of_the_loops(moments):
    some = moments[:, 1] > 1e-9
    # Coarser in times and starts than the closed form: never below it, and close to it.
    least = (moments[some, 0] / moments[some, 1]).min()
    assert compliance.response_over_error() <= least * (1.0 + 1e-9)
    assert compliance.response_over_error() == pytest.approx(least, rel=0.01)


@pytest.mark.parametrize("monitor", MONITORS)
@pytest.mark.parametrize("mode", ["Code L1", "Code L5", "Carrier L1", "Code L1+L5, Carrier L5", "Code+Carrier L1+L5"])
def test_margin_is_where_rates_begin_to_break_the_curve(moments, monitor, mode):
    direction = np.where(FAULT_MODES[mode], FAULT_SIGNS, 0.0)
    some = moments[moments[:, 1] > 1e-9]
    seen, error = some[(some[:, 0] / some[:, 1]).argsort()[:3]].T  # the worst moments
    for user in USERS:
        each = cell(mode, user, monitor)
        scale = error_rate(direction, user)
        if scale == 0.0:
            assert not np.isfinite(each.margin)
            continue
        size = steady(monitor, direction, user)
        rates = np.geomspace(0.5, 5.0, 150)[:, np.newaxis] / (scale * error.max())

        def kept(weaker, size=size, scale=scale, rates=rates):
            return (missed(monitor, rates * size * seen / weaker) <= required(rates * scale * error)).all()

        # The grid of times, starts and rates costs 1 % (see above) and 1.5 % (its step).
        assert kept(each.margin * 0.97)
        assert not kept(each.margin * 1.03)
        assert each.limit_case == (each.margin >= 1.0)
        weakest = (size * seen / (scale * error)).min() * 1.6
        assert each.p_missed == pytest.approx(missed(monitor, weakest), rel=0.3, abs=1e-12)


def test_any_sizes_by_trying_them():
    rng = np.random.default_rng(3)
    tried = rng.standard_normal((4000, 4))
    for monitor in MONITORS:
        for user in USERS:
            for mode in ("Code L1+L5", "Carrier L1+L5", "Code L1+L5, Carrier L5", "Code+Carrier L5"):
                rates = np.where(FAULT_MODES[mode], tried, 0.0)
                errors = np.array([error_rate(each, user) for each in rates])
                each = cell(mode, user, monitor, any_sizes=True)
                if not errors.any():
                    assert not np.isfinite(each.margin)
                    continue
                least = min(
                    steady(monitor, each, user) / error
                    for each, error in zip(rates, errors, strict=True)
                    if error > 0.0
                )
                ours = each.mapping / compliance.response_over_error()
                assert ours <= least * (1.0 + 1e-9)
                assert ours == pytest.approx(least, rel=0.05)  # 4000 directions in three dimensions


def test_verdicts():
    """All cells of equal sizes are met; of any sizes all but the ionosphere's likeness on a single band."""
    equal, worst = cells(), cells(any_sizes=True)
    assert len(equal) == len(worst) == 15 * 3 * 3
    assert all(each.met for each in equal)
    broken = {(each.mode, each.user, each.monitor) for each in worst if not each.met}
    assert broken == {
        ("Code+Carrier L1+L5", user, monitor) for user in ("L1", "L5") for monitor in ("gast-f-paper", "gast-f-sound")
    }
    ghost = np.array([1.0, GAMMA_L5, -1.0, -GAMMA_L5])
    assert steady("gast-f-sound", ghost, "L1") < 1e-9 < error_rate(ghost, "L1")
    assert error_rate(ghost, "IF") == pytest.approx(0.0, abs=1e-12)  # nothing to protect there
    for one, other in zip(equal, worst, strict=True):
        assert other.margin <= one.margin * (1.0 + 1e-9)


def test_items():
    section = compliance_items.section()
    assert len(section.items) == 45 + 9
    differs = [each.name for each in section.items if each.verdict is Verdict.DIFFERS]
    assert differs == [f"Any sizes, {user}, GAST F, {form}" for form in ("paper", "sound") for user in ("L1", "L5")]
    assert [picture.name for picture in section.pictures] == ["compliance", "compliance-any"]
    assert section.pictures[0].data["GAST D, L1, margin"].shape == (15,)

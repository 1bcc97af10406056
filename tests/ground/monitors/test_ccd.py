"""Code-carrier divergence of single bands (GAST D)."""

from __future__ import annotations

import numpy as np
import pytest

from gbas_core.ranging.divergence import DivergenceParams, ramp_response
from gbas_core.signals import L1, L2, L5, N_BANDS
from gbas_ground.monitors.ccd import CcdInput, CcdParams, ccd_step, initial_ccd

N = 68
T_S = 0.5
FAULTY, SOUND = 4, 40
QUICK = CcdParams(filters=DivergenceParams(settle_s=20.0))


def run(code_rate_mps, *, params=QUICK, receivers=3, epochs=400, used=None, change=lambda number, code, carrier: None):
    """Step a monitor over ranges that grow; `code_rate_mps` (R, N_BANDS, N) is what the code has in excess."""
    state = initial_ccd(receivers)
    shape = (receivers, N_BANDS, N)
    here = np.isin(np.arange(N), (FAULTY, SOUND))
    used = np.ones((receivers, N), dtype=bool) if used is None else used
    for number in range(epochs):
        carrier = np.where(here, 2.2e7 - 400.0 * T_S * number, np.nan) * np.ones(shape)
        code = carrier + 12.0 + code_rate_mps * T_S * number
        slips = np.zeros(shape, dtype=bool)
        change(number, code, carrier)
        dt_s = T_S if number else float("nan")
        state, epoch = ccd_step(state, CcdInput(code, carrier, slips, used), dt_s, params)
    return epoch


def rates(receivers=3, **by_band):
    value = np.zeros((receivers, N_BANDS, N))
    for band, rate in by_band.items():
        value[:, {"l1": L1, "l2": L2, "l5": L5}[band], FAULTY] = rate
    return value


def test_each_band_shows_its_own_divergence():
    epoch = run(rates(l1=0.05, l5=-0.04))
    expected = ramp_response(np.array([399]), T_S / 30.0)[0]
    assert epoch.mean_mps[:, FAULTY] == pytest.approx([0.05 * expected, 0.0, -0.04 * expected], abs=1e-9)
    assert epoch.satellites.failed[:, FAULTY].tolist() == [True, False, True]
    assert epoch.satellites.statistic[L5, FAULTY] == pytest.approx(0.04 * expected, abs=1e-9)
    assert not epoch.satellites.failed[:, SOUND].any()
    assert epoch.channels.failed[:, L1, FAULTY].all()


def test_mean_is_over_the_receivers_used():
    value = rates()
    value[0, L1, FAULTY] = 0.06
    everyone, without = run(value), run(value, used=np.arange(3)[:, np.newaxis] * np.ones(N) > 0)
    assert everyone.mean_mps[L1, FAULTY] == pytest.approx(everyone.receiver_mps[0, L1, FAULTY] / 3.0)
    assert everyone.receivers[L1, FAULTY] == 3
    assert not everyone.satellites.failed.any()  # 0.02 m/s
    assert without.mean_mps[L1, FAULTY] == pytest.approx(0.0, abs=1e-9)
    assert without.receivers[L1, FAULTY] == 2
    assert without.channels.failed[:, L1, FAULTY].tolist() == [True, False, False]


def test_threshold_is_the_papers():
    # The published threshold separates rates a little below from a little above it, in steady state.
    steady = {"epochs": 1500}
    assert not run(rates(l1=0.0232), **steady).satellites.failed.any()
    assert run(rates(l1=-0.0234), **steady).satellites.failed[L1, FAULTY]


def test_nothing_counts_before_it_has_settled():
    epoch = run(rates(l1=1.0), params=CcdParams(), epochs=720)
    assert np.isfinite(epoch.receiver_mps[0, L1, FAULTY])
    assert epoch.receivers[L1, FAULTY] == 0
    assert np.isnan(epoch.satellites.statistic[L1, FAULTY])
    assert not epoch.satellites.failed.any()
    assert run(rates(l1=1.0), params=CcdParams(), epochs=721).satellites.failed[L1, FAULTY]


def test_a_receiver_that_is_away_is_not_averaged():
    def change(number, code, carrier):
        if number == 399:
            code[1] = np.nan

    epoch = run(rates(l1=0.05), change=change)
    assert epoch.receivers[L1, FAULTY] == 2
    assert epoch.satellites.failed[L1, FAULTY]


@pytest.mark.parametrize("wrong", [{"threshold_mps": 0.0}, {"sigma_mps": float("nan")}])
def test_parameters_are_checked(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        CcdParams(**wrong)

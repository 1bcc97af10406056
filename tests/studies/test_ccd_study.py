"""The divergence study: closed forms against recursions and loops, sweeps against brute force, finer grids."""

from __future__ import annotations

import numpy as np
import pytest

from divergence_loops import ccd_statistic, differential_error
from gbas_core.ranging.divergence import ramp_response
from gbas_core.ranging.fault_modes import FAULT_MODES
from gbas_studies.ccd import station_items
from gbas_studies.ccd.monitors import MONITORS, cmc_rate, monitor_for
from gbas_studies.ccd.smoothed_error import (
    LONG_BEFORE,
    Smoothing,
    StudyError,
    smoothed_cmc_s,
    stepped_error_m,
    unit_error_s,
)
from gbas_studies.ccd.station_items import SETTLE_S, largest_error_m
from gbas_studies.ccd.worst_case import (
    Grid,
    response,
    scale_free_mapping,
    smallest_mapping,
    study,
    worst_error,
    worst_error_any_rate,
)

STARTS = ("variant", "invariant")


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("ground_start", [-720, -61, -20, 0, 7])
@pytest.mark.parametrize("air_start", [-200, -90, -61, -60, -59, -30, -1, 0, 1, 2, 50])
def test_closed_form_is_the_recursion(start, ground_start, air_start):
    smoothing = Smoothing(start=start)
    stepped = stepped_error_m(1.0, 0.0, air_start, 250, smoothing, ground_start=ground_start)
    samples = np.arange(air_start, 251)
    closed = smoothed_cmc_s(air_start, samples, smoothing) - smoothed_cmc_s(ground_start, samples, smoothing)
    assert (np.isfinite(stepped) == np.isfinite(closed)).all()
    # The requirement of the project; found to be 3e-13, rounding of ranges of some hundred metres.
    assert stepped == pytest.approx(closed, abs=1e-10, nan_ok=True)


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize(("code", "carrier"), [(1.0, 0.0), (0.0, -1.0), (1.0, -1.0), (0.3, 0.7)])
def test_closed_form_is_the_loop(start, code, carrier):
    # A third formulation: eq (19) in a plain loop, on code and carrier themselves.
    for t_a in (-150.0, -29.5, -3.0, 0.0, 12.5, 34.0, 150.0):
        unit = unit_error_s(t_a / 0.5, Smoothing(start=start))
        expected = differential_error(code, carrier, t_a, variant=start == "variant")
        assert abs((code - carrier) * unit) == pytest.approx(expected, abs=1e-10)


def test_other_intervals_and_time_constants():
    for interval_s, tau_s in ((1.0, 30.0), (0.5, 100.0), (0.2, 7.0)):
        smoothing = Smoothing(interval_s=interval_s, tau_s=tau_s, delay_s=60.0)
        for t_a in (-40.0, -1.0, 0.0, 25.0):
            unit = unit_error_s(t_a / interval_s, smoothing)
            timing = {"updates": smoothing.updates, "interval": interval_s, "tau": tau_s, "t_g": -30.0 * tau_s}
            expected = differential_error(1.0, 0.0, t_a, variant=True, **timing)
            assert abs(unit) == pytest.approx(expected, abs=1e-9)


def test_settled_filters_do_not_differ():
    assert unit_error_s(np.array([-5000.0]), Smoothing()) == pytest.approx(0.0, abs=1e-12)
    later = unit_error_s(0, Smoothing(), later=np.array([0, 3000]))
    assert abs(later[1]) < 1e-12 < abs(later[0])


def test_a_young_ground_filter_with_the_air_filter_makes_no_error():
    assert unit_error_s(30, Smoothing(), ground_start=30) == pytest.approx(0.0, abs=1e-12)
    assert abs(unit_error_s(30, Smoothing(), ground_start=LONG_BEFORE)) > 1.0


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("age_s", [0.0, 7.5, 40.0, 300.0])
def test_sweep_with_a_young_ground_filter_is_the_loop(start, age_s):
    grid = Grid(d_step_mps=0.02, d_max_mps=0.1, onset_step_s=20.0, onset_max_s=100.0)
    smoothing = Smoothing(start=start, ground_age_s=age_s, ground_settle_s=90.0)
    error, _, found = study("Code L1", "gast-d", smoothing, grid)
    worst = 0.0
    for t_a, ours in zip(found.offset_s, found.error_s, strict=True):
        used = t_a + 49.5 >= 90.0 - age_s
        variant = start == "variant"
        size = differential_error(1.0, 0.0, float(t_a), variant=variant, t_g=-age_s) if used else 0.0
        assert ours == pytest.approx(size, abs=1e-10)
        for d in (0.02, 0.04, 0.06, 0.08, 0.1):
            worst = max(worst, d * size) if d * ccd_statistic(1.0, float(t_a)) <= 0.0233 else worst
    assert error.value == pytest.approx(worst, abs=1e-10)


def test_a_ground_filter_released_early_is_worse_than_a_settled_one():
    settled_m = largest_error_m("Code L1", "gast-d", Smoothing())[0]
    assert largest_error_m("Code L1", "gast-d", Smoothing(ground_age_s=0.0))[0] > 2.0 * settled_m
    waiting = Smoothing(ground_age_s=0.0, ground_settle_s=SETTLE_S)
    assert largest_error_m("Code L1", "gast-d", waiting)[0] <= settled_m
    assert largest_error_m("Code L1", "gast-d", Smoothing(ground_age_s=3600.0))[0] == pytest.approx(settled_m)
    for section in station_items.sections():
        assert all(each.holds for each in section.items if hasattr(each, "holds"))


def test_averaging_divides_what_is_a_receivers_own():
    # All of Q over M makes every statistic sqrt(M) larger, and the rate that is just not detected as much smaller.
    one, four = (largest_error_m("Code L5", "gast-f-paper", Smoothing(), receivers=count)[0] for count in (1, 4))
    assert one / four == pytest.approx(2.0, rel=1e-6)
    # The codes' part is a receiver's own; what the carrier alone shows is not.
    gains = {mode: [monitor_for("gast-f-sound", mode, receivers=count).gain for count in (1, 4)]
             for mode in ("Code L5", "Carrier L5")}  # fmt: skip
    assert gains["Code L5"][1] / gains["Code L5"][0] == pytest.approx(2.0, rel=1e-3)
    assert 1.0 < gains["Carrier L5"][1] / gains["Carrier L5"][0] < 2.0
    with pytest.raises(StudyError, match="receivers is 0"):
        monitor_for("gast-f-sound", "Code L5", receivers=0)


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("mode", ["Code L1", "Code+Carrier L1"])
def test_sweep_is_brute_force(start, mode):
    grid = Grid(d_step_mps=0.02, d_max_mps=0.1, onset_step_s=10.0)
    error, mapping, _ = study(mode, "gast-d", Smoothing(start=start), grid)
    factor = 2.0 if mode.startswith("Code+") else 1.0
    worst, least = 0.0, np.inf
    for d in (0.02, 0.04, 0.06, 0.08, 0.1):
        for t_a in range(-150, 151, 10):
            size = differential_error(factor * d, 0.0, float(t_a), variant=start == "variant")
            statistic = ccd_statistic(factor * d, float(t_a))
            worst = max(worst, size) if statistic <= 0.0233 else worst
            least = min(least, statistic / size) if size > 1e-12 else least
    assert error.value == pytest.approx(worst, abs=1e-10)
    assert mapping.value == pytest.approx(least, rel=1e-6)


@pytest.mark.parametrize("monitor", MONITORS)
@pytest.mark.parametrize("mode", FAULT_MODES)
def test_every_mode_and_monitor(mode, monitor):
    grid = Grid(d_step_mps=0.005, onset_step_s=5.0)
    error, mapping, found = study(mode, monitor, Smoothing(), grid)
    if not found.error_s.any():  # the diverging measurements cancel in what is smoothed
        assert error.value == 0.0
        return
    anywhere = worst_error_any_rate(found, grid.d_max_mps)
    assert error.value <= anywhere.value + 1e-12
    assert mapping.value > 0.0
    # The worst rate is the one that just is not detected, or the largest.
    place = found.offset_s == anywhere.onset_s
    statistic = anywhere.d_mps * found.statistic[place][0]
    assert statistic == pytest.approx(found.monitor.threshold, rel=1e-9) or anywhere.d_mps == grid.d_max_mps


def test_finer_grids_find_worse_cases():
    coarse, fine = Grid(), Grid(d_step_mps=0.001, onset_step_s=0.5)
    for mode, monitor in (("Code L1", "gast-d"), ("Code L5", "gast-f-paper"), ("Carrier L5", "gast-f-paper")):
        values = [study(mode, monitor, Smoothing(), grid)[0].value for grid in (coarse, fine)]
        assert values[1] >= values[0]
    # The smallest errors of table 4 are the coarse grid's alone.
    carrier = study("Carrier L5", "gast-f-paper", Smoothing(), fine)[0].value
    assert carrier > 1000.0 * 7.151e-6


def test_worst_error_over_all_rates_bounds_every_grid():
    monitor = monitor_for("gast-d", "Code L1")
    found = response("Code L1", monitor, Smoothing(), Grid(onset_step_s=0.5).offsets(0.5))
    exact = worst_error_any_rate(found, 0.1).value
    for steps in (0.01, 0.003, 0.0007, 0.0001):
        rates = Grid(d_step_mps=steps).rates_mps()
        assert worst_error(found, rates).value <= exact + 1e-12
    assert worst_error(found, Grid(d_step_mps=1e-5).rates_mps()).value == pytest.approx(exact, rel=1e-3)
    # Threshold over the smallest mapping function, by definition of both.
    assert exact == pytest.approx(0.0233 / scale_free_mapping(found).value, rel=1e-9)


def test_mapping_of_gast_f_is_proportional_to_the_smallest_rate():
    found = response("Code L5", monitor_for("gast-f-paper", "Code L5"), Smoothing(), Grid().offsets(0.5))
    one, half = (smallest_mapping(found, np.array([rate, 0.05])).value for rate in (0.002, 0.001))
    assert one == pytest.approx(2.0 * half)
    some = found.error_s > 1e-9
    assert half == pytest.approx(0.001 * (found.statistic[some] ** 2 / found.error_s[some]).min())


def test_a_late_exclusion_lets_more_through():
    monitor = monitor_for("gast-d", "Code L1")
    offsets = Grid().offsets(0.5)
    errors = [
        worst_error_any_rate(response("Code L1", monitor, Smoothing(), offsets, exclusion_delay_s=late), 0.1).value
        for late in (0.0, 1.5, 6.0)
    ]
    assert errors[0] < errors[1] < errors[2]


def test_statistic_is_the_filters():
    found = response("Code+Carrier L1", monitor_for("gast-d", "Code+Carrier L1"), Smoothing(), np.array([0.0, 60.0]))
    assert found.statistic == pytest.approx(2.0 * ramp_response(np.array([99, 159]), 1.0 / 60.0))


def test_error_of_the_ionosphere_free_range():
    # 2.2606 of what L1 does, -1.2606 of what L5 does.
    assert cmc_rate("Code L1", "IF") == pytest.approx(2.2606, abs=5e-5)
    assert cmc_rate("Code L5", "IF") == pytest.approx(-1.2606, abs=5e-5)
    assert cmc_rate("Code+Carrier L1+L5", "IF") == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda: Grid(d_step_mps=0.0), "d_step_mps"),
        (lambda: Grid(d_step_mps=0.2, d_max_mps=0.1), "d_step_mps"),
        (lambda: Grid(onset_step_s=float("nan")), "onset_step_s"),
        (lambda: Grid(d_step_mps=1e-9), "million"),
        (lambda: Grid(onset_step_s=0.3).offsets(0.5), "multiple"),
        (lambda: Smoothing(start="sudden"), "sudden"),
        (lambda: Smoothing(tau_s=-1.0), "tau_s"),
        (lambda: Smoothing(interval_s=60.0), "interval_s"),
        (lambda: monitor_for("gast-x", "Code L1"), "gast-x"),
        (lambda: monitor_for("gast-d", "Code L2"), "Code L2"),
    ],
)
def test_bad_requests_are_refused(make, match):
    with pytest.raises(StudyError, match=match):
        make()

"""Modes are entries of a table: what one more of them needs, and what it may not change."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from airborne_world import REFERENCE_ECEF_M, World, above, position_of
from gbas_airborne.modes import bands_of, configured_modes
from gbas_airborne.params import AirborneParams
from gbas_airborne.receiver import AirborneOutput, AirborneReceiver, AirborneState
from gbas_core.parameters import ParameterError
from gbas_core.satellites import N_SATS, SAT_IDS
from gbas_core.signals import L1, L5, N_BANDS
from gbas_msgs_py import modes
from gbas_msgs_py.codes import ServiceType, Signal
from gbas_msgs_py.modes import Mode, mode_of

PARAMS = AirborneParams(settle_s=5.0, inflate_unsettled=False)
TOY = Mode(
    number=77,
    name="toy",
    signal=Signal.L1,
    smoothing_s=30.0,
    products=("l1_100",),
    service=ServiceType.C,
    doc="a test's",
)
RAMP_MPS = 0.1


def with_toy(monkeypatch: pytest.MonkeyPatch, toy: Mode = TOY) -> None:
    """One entry more in the table."""
    monkeypatch.setattr(modes, "MODES", (*modes.MODES, toy))


def fly(world: World, params: AirborneParams = PARAMS, *, duration_s: float = 12.0, both_bands: bool = False) -> list:
    """Outputs of every epoch; the toy runs where it is in the table."""
    if modes.MODES[-1].name == "toy":
        params = replace(params, modes=("toy",))
    state, outputs = AirborneState(), []
    for k in range(round(2 * duration_s)):
        epoch = world.epoch(0.5 * k)
        if both_bands:
            seen = epoch.observations
            code, carrier = seen.code_m.copy(), seen.carrier_m.copy()
            code[L5], carrier[L5] = code[L1] + 3.0, carrier[L1] + 5.0
            epoch = replace(epoch, observations=replace(seen, code_m=code, carrier_m=carrier))
        state, output = AirborneReceiver.step(state, epoch, params)
        outputs.append(output)
    return outputs


def last(outputs: list[AirborneOutput]) -> AirborneOutput:
    return outputs[-1]


def test_a_mode_is_one_entry(monkeypatch: pytest.MonkeyPatch) -> None:
    """It gets its solution and protection beside the other, which is as it was to the bit."""
    alone = fly(World())
    with_toy(monkeypatch)
    beside = fly(World())
    first, toy = last(beside).solutions
    assert (first.mode, toy.mode) == (1.0, 77.0)
    assert [protection.mode for protection in last(beside).protections] == [1.0, 77.0]
    assert last(beside).protections[1].service == ServiceType.C
    assert np.linalg.norm(position_of(toy) - above(300.0, east_m=4000.0)) < 1e-3
    for one, both in zip(alone, beside, strict=True):
        assert len(one.solutions) == 1
        np.testing.assert_array_equal(position_of(one.solutions[0]), position_of(both.solutions[0]))
        assert one.protections[0].vpl_m == both.protections[0].vpl_m or np.isnan(one.protections[0].vpl_m)
        assert [repr(event) for event in both.events if not event.subject.startswith("toy/")] == [
            *map(repr, one.events)
        ]


def test_each_mode_has_its_own_time_constant(monkeypatch: pytest.MonkeyPatch) -> None:
    """A code that diverges from the carrier by a ramp: a settled filter of tau lags by 2 tau times half of it.

    All satellites alike, so it goes to the clock: the filter's lag is the difference of the clocks. After t the 1/n
    filter (t below tau) lags by half of what the ramp made: equal for both modes until 30 s, apart afterwards.
    """
    with_toy(monkeypatch)
    world = World(code_error_m=lambda t: np.full(N_SATS, RAMP_MPS * t))
    outputs = fly(world, duration_s=60.0)
    lag = [output.solutions[0].clock_m - output.solutions[1].clock_m for output in outputs]
    early, late = lag[round(2 * 20.0)], lag[-1]
    # the same mean, in two positions: their weights differ (30 s has larger sigmas), and steps end within 5 cm
    assert early == pytest.approx(0.0, abs=1e-5)
    # code ramp r: smoothed error of a running mean r t / 2; of the settled 30 s filter it grows towards r (t - 30 s)
    t = 59.5
    settled = _recursion(30.0, t) - _recursion(100.0, t)
    assert late == pytest.approx(-settled, abs=1e-3)


def _recursion(tau_s: float, duration_s: float, dt_s: float = 0.5) -> float:
    """Error of a Hatch filter whose code errs by a ramp, written out."""
    error = 0.0
    for n in range(1, round(duration_s / dt_s) + 1):
        weight = max(1.0 / (n + 1), dt_s / tau_s)
        error = weight * RAMP_MPS * n * dt_s + (1.0 - weight) * error
    return error


def test_events_of_the_other_modes_name_them(monkeypatch: pytest.MonkeyPatch) -> None:
    with_toy(monkeypatch)
    subjects = {event.subject for output in fly(World()) for event in output.events}
    used = {subject for subject in subjects if subject in SAT_IDS}
    assert used
    assert {f"toy/{subject}" for subject in used} <= subjects


def test_a_mode_of_another_signal_smooths_that(monkeypatch: pytest.MonkeyPatch) -> None:
    """L5 with the corrections of L1: three metres on every code go to the clock of that mode alone."""
    with_toy(monkeypatch, replace(TOY, signal=Signal.L5))
    first, toy = last(fly(World(), both_bands=True)).solutions
    assert toy.clock_m - first.clock_m == pytest.approx(3.0, abs=1e-3)
    np.testing.assert_allclose(position_of(toy), position_of(first), atol=1e-3)


def test_a_mode_whose_signal_is_not_there_has_no_position(monkeypatch: pytest.MonkeyPatch) -> None:
    with_toy(monkeypatch, replace(TOY, signal=Signal.L5))
    output = last(fly(World()))
    assert np.isfinite(output.solutions[0].x_m)
    assert np.isnan(output.solutions[1].x_m)
    assert (output.protections[0].alert, output.protections[1].alert) == (0.0, 1.0)


def test_a_mode_whose_product_is_not_sent_has_no_position(monkeypatch: pytest.MonkeyPatch) -> None:
    with_toy(monkeypatch, replace(TOY, products=("l1_30",)))
    output = last(fly(World()))
    assert np.isnan(output.solutions[1].x_m)
    assert np.isnan(output.solutions[1].correction_age_s)
    assert output.protections[1].alert == 1.0


def test_the_parameter_overrides_the_time_constant_of_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    with_toy(monkeypatch)
    chosen = configured_modes(AirborneParams(smoothing_tau_s=0.0, modes=("toy",)))
    assert [mode.smoothing_s for mode in chosen] == [0.0, 30.0]


def test_modes_run_that_are_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """The one that guides with those it falls back to and needs beside it, and then the others, each once."""
    with_toy(monkeypatch)
    assert [mode.number for mode in configured_modes(PARAMS)] == [1]
    assert [mode.name for mode in configured_modes(replace(PARAMS, service="D"))] == ["l1_30", "l1_100"]
    assert [mode.name for mode in configured_modes(replace(PARAMS, service="IF-30"))] == ["if_30", "l5_30", "l1_100"]
    alone = replace(PARAMS, service="IF-30", fallback=False)
    assert [mode.name for mode in configured_modes(alone)] == ["if_30"]
    beside = replace(PARAMS, modes=("l1_30_e",))
    assert [mode.name for mode in configured_modes(beside)] == ["l1_100", "l1_30_e", "l1_100_e"]
    everything = configured_modes(replace(PARAMS, modes=("all",)))
    assert len(everything) == len({mode.name for mode in everything}) == len(modes.MODES)
    gps = configured_modes(replace(PARAMS, modes=("all",), systems="G"))
    assert [mode.name for mode in gps] == ["l1_100", "l1_30", "l5_100", "l5_30", "if_100", "if_30", "toy"]
    assert {mode.systems for mode in gps} == {"G"}


def test_a_mode_that_is_not_there_is_refused() -> None:
    with pytest.raises(ParameterError, match="modes = 'l2_100' is not one of"):
        AirborneParams(modes=("l2_100",))


def test_a_combination_is_of_its_signals() -> None:
    assert bands_of(mode_of(6)) == (L1, L5)
    assert N_BANDS == 3
    with pytest.raises(ValueError, match="mode toy: signal L1_L2 is not one of L1, L2, L5"):
        bands_of(replace(TOY, signal=Signal.L1_L2))


def test_the_clock_of_galileo_alone_is_told() -> None:
    """The clock the world has, with and without GPS."""
    world = World()
    outputs = fly(world, replace(PARAMS, systems="E"))
    solution = last(outputs).solutions[0]
    assert np.isfinite(position_of(solution)).all()
    assert np.linalg.norm(position_of(solution) - REFERENCE_ECEF_M) > 1000.0
    both = last(fly(World())).solutions[0]
    # range errors of a centimetre's lattice are exact here; both constellations share the receiver's clock
    assert solution.clock_m == pytest.approx(both.clock_m, abs=1e-3)
    assert solution.clock_m == pytest.approx(world.clock_m(11.5), abs=0.01)

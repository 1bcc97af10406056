"""Faults of one receiver: they hit that one, those satellites, for as long as they should."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gbas_core.satellites import N_SATS, SAT_INDEX
from gbas_core.signals import L1, L2, L5, SPEED_OF_LIGHT_MPS
from gbas_sim.faults.kinds import (
    RECEIVER_FAULTS,
    RECEIVERS,
    ClockJump,
    FrozenOutput,
    Listener,
    Moment,
    NoiseBurst,
    RangeFault,
    ReceiverFault,
    SignalEffect,
    clock_jumps_s,
    receiver_effect,
    source_epochs,
)

G05, E11 = SAT_INDEX["G05"], SAT_INDEX["E11"]


def moment(epoch: int, names=RECEIVERS, interval_s: float = 0.5) -> Moment:
    return Moment(np.full(len(names), interval_s * epoch), interval_s, tuple(Listener(name) for name in names))


def effect_at(*faults: ReceiverFault, epoch: int, seed: int = 1, names=RECEIVERS) -> SignalEffect:
    return receiver_effect(faults, moment(epoch, names), epoch=epoch, seed=seed)


def test_bias_and_ramp_on_chosen_satellites_and_quantities():
    fault = RangeFault(
        receiver="rr3", satellites=("G05", "E11"), start_s=10.0, end_s=30.0, step_m=1.5, ramp_mps=0.1,
        quantities=("code_l1", "carrier_l5"),
    )  # fmt: skip
    effect = effect_at(fault, epoch=40)
    hit = np.zeros(N_SATS)
    hit[[G05, E11]] = 1.0
    np.testing.assert_allclose(effect.code_m[2, L1], 2.5 * hit)
    np.testing.assert_allclose(effect.carrier_m[2, L5], 2.5 * hit)
    np.testing.assert_allclose(effect.rate_mps[2, L5], 0.1 * hit)
    for values in (effect.code_m[:, [L2, L5]], effect.carrier_m[:, [L1, L2]], effect.code_m[[0, 1, 3, 4]]):
        assert (values == 0.0).all()
    for epoch in (19, 60):
        assert (effect_at(fault, epoch=epoch).code_m == 0.0).all()


def test_all_satellites_unless_some_are_named():
    effect = effect_at(RangeFault(receiver="airborne", start_s=0.0, step_m=2.0), epoch=0)
    np.testing.assert_array_equal(effect.code_m[4][[L1, L5]], 2.0)
    assert (effect.carrier_m == 0.0).all()


def test_noise_burst_has_its_size_and_is_white():
    fault = NoiseBurst(receiver="rr1", start_s=0.0, end_s=200.0, code_m=3.0, carrier_m=0.01, drop_db=8.0)
    values = [effect_at(fault, epoch=epoch) for epoch in range(400)]
    for name, sigma in (("code_m", 3.0), ("carrier_m", 0.01)):
        series = np.array([getattr(each, name)[0, [L1, L5]] for each in values])
        assert series.std() == pytest.approx(sigma, rel=5.0 / math.sqrt(2.0 * series.size))
        assert abs((series[1:] * series[:-1]).mean()) < 5.0 * sigma**2 / math.sqrt(series.size)
    np.testing.assert_array_equal(values[3].cn0_db[0, [L1, L5]], -8.0)
    assert all((each.code_m[1:] == 0.0).all() for each in values)
    assert (effect_at(fault, epoch=400).code_m == 0.0).all()


def test_noise_depends_on_seed_epoch_and_place_only():
    fault = NoiseBurst(receiver="rr2", start_s=0.0, code_m=1.0)
    values = effect_at(fault, epoch=7).code_m
    np.testing.assert_array_equal(effect_at(fault, epoch=7, names=("rr1", "rr2")).code_m[1], values[1])
    assert not np.array_equal(effect_at(fault, epoch=7, seed=2).code_m, values)
    assert not np.array_equal(effect_at(fault, epoch=8).code_m, values)
    twice = effect_at(fault, fault, epoch=7).code_m
    assert not np.allclose(twice, 2.0 * values)


def test_clock_jump_of_code_and_carrier():
    fault = ClockJump(receiver="rr4", start_s=10.0, end_s=20.0, milliseconds=-2)
    for epoch, expected in ((19, 0.0), (20, -0.002), (39, -0.002), (40, 0.0)):
        np.testing.assert_allclose(clock_jumps_s((fault,), moment(epoch)), [0.0, 0.0, 0.0, expected, 0.0])
        assert (effect_at(fault, epoch=epoch).code_m == 0.0).all()


def test_clock_jump_of_the_code_alone():
    fault = ClockJump(receiver="rr4", start_s=10.0, milliseconds=1, carrier_too=False, satellites=("G05",))
    effect = effect_at(fault, epoch=20)
    np.testing.assert_allclose(effect.code_m[3, :, G05], 1e-3 * SPEED_OF_LIGHT_MPS)
    assert (effect.code_m[3, :, E11] == 0.0).all()
    assert (effect.carrier_m == 0.0).all()
    assert (clock_jumps_s((fault,), moment(20)) == 0.0).all()


@pytest.mark.parametrize("start_s", [10.0, 9.7])
def test_frozen_output_repeats_the_last_epoch_before(start_s):
    fault = FrozenOutput(receiver="rr2", start_s=start_s, end_s=15.0, satellites=("G05",))
    for epoch in range(15, 35):
        sources = source_epochs((fault,), moment(epoch), epoch)
        frozen = start_s <= 0.5 * epoch < 15.0
        # Epoch 19 is at 9.5 s, the last before 9.7 s and before 10 s.
        assert sources[1, G05] == (19 if frozen else epoch)
        assert (np.delete(sources[1], G05) == epoch).all()
        assert (sources[[0, 2, 3, 4]] == epoch).all()


def test_frozen_from_the_start_has_nothing_to_repeat():
    sources = source_epochs((FrozenOutput(receiver="rr1", start_s=0.0),), moment(3), 3)
    assert (sources[0] == -1).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: RangeFault(receiver="rr5", start_s=0.0, step_m=1.0),
            "receiver = 'rr5' is not one of rr1, rr2, rr3, rr4, airborne",
        ),
        (
            lambda: RangeFault(receiver="rr1", start_s=0.0),
            "fault range: step_m, ramp_mps and acceleration_mps2 are all 0",
        ),
        (
            lambda: RangeFault(receiver="rr1", start_s=0.0, step_m=1.0, satellites=("G99",)),
            "satellites = 'G99' is not one of",
        ),
        (
            lambda: RangeFault(receiver="rr1", start_s=0.0, step_m=1.0, quantities=("code_l2",)),
            "quantities = 'code_l2'",
        ),
        (
            lambda: RangeFault(receiver="rr1", start_s=0.0, step_m=1.0, quantities=()),
            "fault range: quantities is empty",
        ),
        (lambda: NoiseBurst(receiver="rr1", start_s=0.0), "fault noise_burst: code_m, carrier_m and drop_db are all 0"),
        (lambda: ClockJump(receiver="rr1", start_s=0.0, milliseconds=0), "fault clock_jump: milliseconds is 0"),
        (
            lambda: ClockJump(receiver="rr1", start_s=0.0, milliseconds=1, satellites=("G01",)),
            "fault clock_jump: satellites must be empty when carrier_too is true",
        ),
    ],
)
def test_bad_parameters_are_refused(make, message):
    with pytest.raises(ValueError) as error:
        make()
    assert message in str(error.value)


def test_kinds_have_their_names():
    assert list(RECEIVER_FAULTS) == ["range", "noise_burst", "frozen", "clock_jump"]

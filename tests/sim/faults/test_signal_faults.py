"""Faults of signals: where and how fast each acts, what a smoothing filter makes of it, and when it is over."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gbas_core.ranging.smoothing import SmoothingParams, initial_smoothing, smooth_step
from gbas_core.satellites import N_SATS, SAT_INDEX
from gbas_core.signal.tracking_loops import TrackingParams, noise_sigmas
from gbas_core.signals import IONO_RATIO, L1, L2, L5, N_BANDS, SPEED_OF_LIGHT_MPS, WAVELENGTH_M
from gbas_sim.faults.deformation import Correlator, Deformation, deformation_bias_m
from gbas_sim.faults.kinds import (
    FAULT_MODES,
    RECEIVERS,
    SATELLITE_FAULTS,
    ClockFault,
    CodeCarrierDivergence,
    CycleSlip,
    ExcessiveAcceleration,
    Listener,
    LossOfLock,
    LowPower,
    SatelliteFault,
    SignalDeformation,
    SignalEffect,
    signal_effect,
)
from gbas_sim.receivers.receiver_model import ReceiverErrors, ReceiverModel

G05 = SAT_INDEX["G05"]
LISTENERS = tuple(Listener(name) for name in RECEIVERS)
GAMMA = float(IONO_RATIO[L5])


def effect_at(*faults: SatelliteFault, since_s: float, interval_s: float = 0.5) -> SignalEffect:
    return signal_effect(faults, np.full(len(LISTENERS), since_s), LISTENERS, interval_s)


def divergence(mode: str, **changes) -> CodeCarrierDivergence:
    values = {"satellite": "G05", "start_s": 100.0, "mode": mode, "ramp_mps": 0.02}
    return CodeCarrierDivergence(**(values | changes))


# --- divergence


def test_the_papers_fifteen_modes():
    """Every way but none to put a divergence on code or carrier of L1 or L5, once."""
    assert len(FAULT_MODES) == len(set(FAULT_MODES.values())) == 15
    for name, (code_l1, code_l5, carrier_l1, carrier_l5) in FAULT_MODES.items():
        said = name.replace("Code+Carrier L1+L5", "Code L1+L5, Carrier L1+L5")
        said = said.replace("Code+Carrier L1", "Code L1, Carrier L1").replace("Code+Carrier L5", "Code L5, Carrier L5")
        parts = dict(part.split(" ") for part in said.split(", "))
        assert ("L1" in parts.get("Code", ""), "L5" in parts.get("Code", "")) == (code_l1, code_l5)
        assert ("L1" in parts.get("Carrier", ""), "L5" in parts.get("Carrier", "")) == (carrier_l1, carrier_l5)


@pytest.mark.parametrize("mode", FAULT_MODES)
def test_divergence_goes_where_it_should(mode):
    effect = effect_at(divergence(mode), since_s=150.0)
    there = FAULT_MODES[mode]
    # 50 s of 0.02 m/s: +1 m on codes, -1 m on carriers.
    expected = np.zeros((4,))
    expected[:2], expected[2:] = 1.0 * np.array(there[:2]), -1.0 * np.array(there[2:])
    found = [
        effect.code_m[:, L1, G05],
        effect.code_m[:, L5, G05],
        effect.carrier_m[:, L1, G05],
        effect.carrier_m[:, L5, G05],
    ]
    np.testing.assert_allclose(np.array(found), expected[:, np.newaxis] * np.ones(5), atol=1e-12)
    np.testing.assert_allclose(effect.rate_mps[0, [L1, L5], G05], -0.02 * np.array(there[2:]))
    np.testing.assert_allclose(effect.doppler_hz[0, [L1, L5], G05], 0.02 * np.array(there[2:]) / WAVELENGTH_M[[L1, L5]])
    others = np.arange(N_SATS) != G05
    for values in (effect.code_m, effect.carrier_m, effect.rate_mps):
        assert (values[..., others] == 0.0).all()
        assert (values[:, L2] == 0.0).all()
    assert effect.tracked.all()
    assert not effect.slipped.any()
    assert (effect.cn0_db == 0.0).all()


@pytest.mark.parametrize("mode", FAULT_MODES)
def test_monitor_statistics_of_the_paper(mode):
    """Steady state of the statistics of Jiang et al., eq (17), with exact coefficients, from two epochs' effects."""
    first, second = (effect_at(divergence(mode), since_s=since) for since in (200.0, 200.5))
    code = (second.code_m - first.code_m)[0, :, G05] / 0.5
    carrier = (second.carrier_m - first.carrier_m)[0, :, G05] / 0.5
    df1 = code[L1] - carrier[L1] + 2.0 / (1.0 - GAMMA) * (carrier[L1] - carrier[L5])
    d1c, d5c, d1l, d5l = np.array([0.02, 0.02, -0.02, -0.02]) * FAULT_MODES[mode]
    assert df1 == pytest.approx(d1c - 3.5212 * d1l + 2.5212 * d5l, abs=1e-5)
    phase = 2.26060 * carrier[L1] - 1.26060 * carrier[L5]
    assert phase == pytest.approx(2.26060 * d1l - 1.26060 * d5l, abs=1e-9)
    assert code[L5] == pytest.approx(d5c, abs=1e-9)


def smoothed(fault: CodeCarrierDivergence, until_s: float, tau_s: tuple[float, ...]) -> np.ndarray:
    """Smoothed error of the faulty satellite on L1, filters settled before, (epochs, tau)."""
    params = SmoothingParams(tau_s=tau_s)
    state, errors = initial_smoothing(params, 3), []
    slipped = np.zeros((3, N_SATS), dtype=bool)
    # From 20 time constants before the fault on the filters' weights are the final ones.
    for epoch in range(-4000, round(2.0 * until_s)):
        effect = effect_at(fault, since_s=0.5 * epoch)
        state, values = smooth_step(state, effect.code_m[0], effect.carrier_m[0], slipped, 0.5, params)
        errors.append(values[:, L1, G05])
    return np.array(errors)[4000:]


def test_carrier_only_ramp_gives_the_smoothed_steady_state():
    """Jiang et al., eq (22): d_L tau, here -d tau; the sampled filter has tau less one interval."""
    errors = smoothed(divergence("Carrier L1", start_s=0.0), 1100.0, (100.0, 30.0))
    for place, tau_s in enumerate((100.0, 30.0)):
        # After 11 time constants exp(-11) = 2e-5 is missing.
        assert errors[-1, place] == pytest.approx(-0.02 * (tau_s - 0.5), rel=1e-4)
        assert errors[-1, place] == pytest.approx(-0.02 * tau_s, rel=0.02)


def test_code_only_ramp_gives_the_lagging_ramp():
    """d (t - tau (1 - exp(-t / tau))) in continuous time; sampling makes it up to an interval's ramp more."""
    errors = smoothed(divergence("Code L1", start_s=0.0), 300.0, (100.0, 30.0))
    time_s = 0.5 * np.arange(errors.shape[0])
    for place, tau_s in enumerate((100.0, 30.0)):
        expected = 0.02 * (time_s - tau_s * -np.expm1(-time_s / tau_s))
        np.testing.assert_allclose(errors[:, place], expected, atol=0.02 * 0.5)


def test_divergence_rate_from_noisy_output():
    """Slope of code less carrier by least squares over 100 s, against the noise's own standard error of it."""
    model = ReceiverModel(tracking=TrackingParams(code_bandwidth_hz=1.0))
    errors = ReceiverErrors(model, seed=2, numbers=(0,), interval_s=0.5)
    elevation = np.full((1, N_SATS), 0.7)
    cn0 = errors.cn0_dbhz(elevation)
    time_s = 0.5 * np.arange(200)
    for mode in FAULT_MODES:
        fault = divergence(mode, start_s=0.0)
        series = []
        for epoch, since_s in enumerate(time_s):
            effect, noise = effect_at(fault, since_s=float(since_s)), errors.at(epoch, elevation, cn0)
            series.append((effect.code_m + noise.code_m - effect.carrier_m - noise.carrier_m)[0, :, G05])
        slope = np.polyfit(time_s, np.array(series)[:, [L1, L5]], 1)[0]
        sigma = noise_sigmas(model.tracking, cn0).code_m[0, [L1, L5], G05]
        # Neighbours are correlated with exp(-2): (1 + r) / (1 - r) = 1.31 more variance.
        error = sigma * math.sqrt(1.31 / ((time_s - time_s.mean()) ** 2).sum())
        expected = 0.02 * (np.array(FAULT_MODES[mode][:2], float) + np.array(FAULT_MODES[mode][2:], float))
        assert (np.abs(slope - expected) < 5.0 * error).all()
        assert (error < 0.0012).all()


def test_weights_make_an_ionosphere():
    """Delay on codes, advance on carriers, by the square of the wavelength: no statistic without ionosphere sees it."""
    fault = divergence("Code+Carrier L1+L5", weights=(1.0, GAMMA, -1.0, -GAMMA))
    effect = effect_at(fault, since_s=150.0)
    code, carrier = effect.code_m[0, :, G05], effect.carrier_m[0, :, G05]
    assert code[L1] == pytest.approx(1.0)
    assert code[L1] - carrier[L1] + 2.0 / (1.0 - GAMMA) * (carrier[L1] - carrier[L5]) == pytest.approx(0.0, abs=1e-12)
    assert GAMMA * carrier[L1] - carrier[L5] == pytest.approx(0.0, abs=1e-12)


# --- profiles and times


@pytest.mark.parametrize(
    ("profile", "size_m", "rate_mps"),
    [
        ({"step_m": 3.0}, 3.0, 0.0),
        ({"ramp_mps": 0.1}, 2.0, 0.1),
        ({"acceleration_mps2": 0.01}, 2.0, 0.2),
        ({"step_m": 1.0, "ramp_mps": 0.1, "acceleration_mps2": 0.01}, 5.0, 0.3),
    ],
)
def test_profiles(profile, size_m, rate_mps):
    fault = ExcessiveAcceleration(satellite="E11", start_s=10.0, end_s=40.0, **profile)
    index = SAT_INDEX["E11"]
    effect = effect_at(fault, since_s=30.0)
    np.testing.assert_allclose(effect.code_m[..., index], size_m)
    np.testing.assert_allclose(effect.carrier_m[..., index], size_m)
    np.testing.assert_allclose(effect.rate_mps[..., index], rate_mps)


def test_start_and_end():
    fault = ExcessiveAcceleration(satellite="G05", start_s=10.0, end_s=20.0, step_m=1.0, ramp_mps=0.5)
    held = ExcessiveAcceleration(satellite="G05", start_s=10.0, end_s=20.0, step_m=1.0, ramp_mps=0.5, after="hold")
    for since_s, cleared, kept in (
        (9.5, 0.0, 0.0),
        (10.0, 1.0, 1.0),
        (19.5, 5.75, 5.75),
        (20.0, 0.0, 6.0),
        (90.0, 0.0, 6.0),
    ):
        assert effect_at(fault, since_s=since_s).code_m[0, L1, G05] == pytest.approx(cleared)
        after = effect_at(held, since_s=since_s)
        assert after.code_m[0, L1, G05] == pytest.approx(kept)
        assert after.rate_mps[0, L1, G05] == (0.5 if 10.0 <= since_s < 20.0 else 0.0)


def test_rate_is_the_derivative():
    fault = ExcessiveAcceleration(satellite="G05", start_s=0.0, ramp_mps=0.3, acceleration_mps2=0.02)
    before, here, after = (effect_at(fault, since_s=since).carrier_m[0, L1, G05] for since in (49.5, 50.0, 50.5))
    assert here == pytest.approx(0.3 * 50.0 + 0.01 * 2500.0)
    assert effect_at(fault, since_s=50.0).rate_mps[0, L1, G05] == pytest.approx(after - before, rel=1e-9)


def test_clock_that_runs_ahead_shortens_ranges():
    fault = ClockFault(satellite="G05", start_s=0.0, step_s=1e-8, ramp_sps=1e-10)
    effect = effect_at(fault, since_s=100.0)
    np.testing.assert_allclose(effect.code_m[..., G05], -2e-8 * SPEED_OF_LIGHT_MPS)
    np.testing.assert_allclose(effect.carrier_m[..., G05], effect.code_m[..., G05])
    np.testing.assert_allclose(effect.rate_mps[..., G05], -1e-10 * SPEED_OF_LIGHT_MPS)


def test_effects_add_up():
    one, two = divergence("Code L1"), ExcessiveAcceleration(satellite="G05", start_s=0.0, step_m=2.0)
    three = LowPower(satellite="G05", start_s=0.0, drop_db=6.0)
    both = effect_at(one, two, three, since_s=150.0)
    apart = effect_at(one, since_s=150.0).plus(effect_at(two, since_s=150.0)).plus(effect_at(three, since_s=150.0))
    for name, values in vars(both).items():
        np.testing.assert_allclose(getattr(apart, name), values, atol=1e-12)


# --- power, deformation, slips, lock


def test_low_power():
    fault = LowPower(
        satellite="G05", start_s=10.0, end_s=60.0, drop_db=3.0, ramp_dbps=0.5, largest_db=15.0, bands=("L1",)
    )
    for since_s, change in ((9.0, 0.0), (10.0, -3.0), (20.0, -8.0), (50.0, -15.0), (60.0, 0.0)):
        effect = effect_at(fault, since_s=since_s)
        np.testing.assert_allclose(effect.cn0_db[:, L1, G05], change)
        assert (effect.cn0_db[:, L5] == 0.0).all()


def test_deformation_depends_on_the_receiver():
    deformation = Deformation(ring_hz=8e6, damping_neperps=2e6)
    ground = Listener("rr1", (0.1, 0.1, 1.0), (16e6,) * 3)
    airborne = Listener.of("airborne", TrackingParams(spacing_chips=(0.2, 0.2, 1.0)))
    fault = SignalDeformation(satellite="G05", start_s=0.0, deformation=deformation)
    effect = signal_effect((fault,), np.zeros(2), (ground, airborne), 0.5)
    expected = [deformation_bias_m(deformation, Correlator(*each)) for each in ((0.1, 16e6), (0.2, 20e6))]
    np.testing.assert_allclose(effect.code_m[:, L1, G05], expected)
    assert (effect.code_m[:, L5] == 0.0).all()
    assert (effect.carrier_m == 0.0).all()
    assert abs(expected[0] - expected[1]) > 0.01


def test_cycle_slip():
    fault = CycleSlip(satellite="G05", start_s=10.0, cycles_l1=3, cycles_l5=-2, receivers=("rr2",), flagged=True)
    silent = CycleSlip(satellite="G05", start_s=10.0, cycles_l1=3)
    for since_s, slipped, there in ((9.5, False, False), (10.0, True, True), (10.5, False, True)):
        effect = effect_at(fault, since_s=since_s)
        np.testing.assert_allclose(
            effect.carrier_m[1, [L1, L5], G05], there * np.array([3.0, -2.0]) * WAVELENGTH_M[[L1, L5]]
        )
        assert (effect.slipped[1, [L1, L5], G05] == slipped).all()
        assert (effect.carrier_m[[0, 2, 3, 4]] == 0.0).all()
        assert not effect.slipped[[0, 2, 3, 4]].any()
        assert not effect_at(silent, since_s=since_s).slipped.any()
    assert (effect_at(silent, since_s=10.0).carrier_m[:, L1, G05] != 0.0).all()
    assert (effect_at(fault, since_s=10.0).code_m == 0.0).all()


def test_slip_between_epochs_shows_at_the_next():
    fault = CycleSlip(satellite="G05", start_s=10.2, cycles_l1=1, flagged=True)
    assert not effect_at(fault, since_s=10.0).slipped.any()
    assert effect_at(fault, since_s=10.5).slipped[:, L1, G05].all()
    assert not effect_at(fault, since_s=11.0).slipped.any()
    assert effect_at(fault, since_s=11.0, interval_s=1.0).slipped[:, L1, G05].all()


def test_loss_of_lock():
    fault = LossOfLock(
        satellite="G05", start_s=10.0, end_s=12.0, bands=("L5",), receivers=("rr1", "airborne"), cycles=77
    )
    for since_s, lost, over, slipped in (
        (9.5, 0, 0, 0),
        (10.0, 1, 0, 0),
        (11.5, 1, 0, 0),
        (12.0, 0, 1, 1),
        (12.5, 0, 1, 0),
    ):
        effect = effect_at(fault, since_s=since_s)
        assert (effect.tracked[[0, 4], L5, G05] == (not lost)).all()
        assert effect.tracked[1:4].all()
        assert effect.tracked[:, L1].all()
        np.testing.assert_allclose(effect.carrier_m[[0, 4], L5, G05], over * 77.0 * WAVELENGTH_M[L5])
        assert (effect.slipped[[0, 4], L5, G05] == bool(slipped)).all()


def test_none_is_nothing():
    effect = effect_at(since_s=0.0)
    assert effect.code_m.shape == (5, N_BANDS, N_SATS)
    assert all(
        (values == neutral).all()
        for values, neutral in zip(vars(effect).values(), (0, 0, 0, 0, True, False), strict=True)
    )


# --- what is refused


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: divergence("Code L2"), "mode = 'Code L2' is not one of Code L1; Code L5; Carrier L1; "),
        (
            lambda: divergence("Code L1", satellite="R01"),
            "satellite = 'R01' is not one of G01, G02, ..., E36",
        ),
        (lambda: divergence("Code L1", ramp_mps=0.0), "are all 0: nothing would happen"),
        (
            lambda: divergence("Code L1", ramp_mps=math.nan),
            "ramp_mps = nan is not a finite number",
        ),
        (lambda: divergence("Code L1", end_s=100.0), "fault divergence: end_s = 100.0 is not after start_s = 100.0"),
        (lambda: divergence("Code L1", end_s=math.nan), "end_s = nan is not -10000000 s or more"),
        (lambda: divergence("Code L1", after="stay"), "after = 'stay' is not one of 'clear', 'hold'"),
        (lambda: divergence("Code L1", weights=(1.0,)), "weights = (1.0,) has not the right number of values"),
        (lambda: LowPower(satellite="G05", start_s=0.0), "fault low_power: drop_db and ramp_dbps are both 0"),
        (lambda: LowPower(satellite="G05", start_s=0.0, drop_db=-3.0), "drop_db = -3 is not within 0 to 100 dB"),
        (
            lambda: LowPower(satellite="G05", start_s=0.0, drop_db=3.0, bands=("L2",)),
            "bands = 'L2' is not one of 'L1', 'L5'",
        ),
        (lambda: LossOfLock(satellite="G05", start_s=0.0, bands=()), "fault loss_of_lock: bands is empty"),
        (lambda: CycleSlip(satellite="G05", start_s=0.0), "fault cycle_slip: cycles_l1 and cycles_l5 are both 0"),
        (
            lambda: CycleSlip(satellite="G05", start_s=0.0, cycles_l1=1, receivers=("rr9",)),
            "receivers = 'rr9' is not one of",
        ),
        (lambda: ClockFault(satellite="G05", start_s=0.0, step_s=1.0), "step_s = 1 is not within -0.01 to 0.01 s"),
        (
            lambda: SignalDeformation(satellite="E05", start_s=0.0, deformation=Deformation(lag_chips=0.1)),
            "fault deformation: lag_chips has no model for E1",
        ),
    ],
)
def test_bad_parameters_are_refused(make, message):
    with pytest.raises(ValueError) as error:
        make()
    assert message in str(error.value)


def test_kinds_have_their_names():
    assert list(SATELLITE_FAULTS) == [
        "divergence", "acceleration", "clock", "orbit", "broadcast", "low_power", "deformation", "cycle_slip",
        "loss_of_lock",
    ]  # fmt: skip

"""The second band of a station: corrections known by construction, and which fault of which band excludes what."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gbas_airborne.params import AirborneParams
from gbas_airborne.reception.vdb_messages import reception_step
from gbas_airborne.reception.vdb_state import ReceptionState
from gbas_core.models.sigma_curves import sigma_gnd_m
from gbas_core.parameters import ParameterError
from gbas_core.satellites import IS_GALILEO, IS_GPS, N_SATS, SAT_INDEX, SOURCE_ID_INDEX
from gbas_core.signals import IONO_RATIO, L1, L5
from gbas_ground.params import watching
from gbas_ground.station import GroundEpoch, GroundStation
from gbas_msgs_py.codes import ChannelState
from gbas_msgs_py.products import L1_30, L1_100, L5_30, L5_100
from gbas_msgs_py.tables import CHANNELS, INTEGRITY, MONITORS
from gbas_vdb.transmission.receive import decode_burst
from ground_runs import half_seconds, params, run
from synthetic_ranges import truth

BOTH = ("l5_100", "l5_30")
# As in test_station.py: the time of transmission is found without the relativistic term of the clock.
NOISE_FREE_M = 2e-5
WITHOUT_L5 = np.isin(np.arange(N_SATS), [SAT_INDEX[name] for name in ("G02", "G05", "G06", "E03")])
SAT = SAT_INDEX["G01"]


def both_bands(code_m=0.0, carrier_m=0.0, *, without=WITHOUT_L5, cn0_dbhz=46.0):
    """L5 beside L1: its ranges with these errors more, functions of the second or ``(R, N)`` arrays."""

    def change(second, observed):
        shape = len(observed), N_SATS
        code, carrier, cn0 = (
            np.broadcast_to(each(second) if callable(each) else each, shape) for each in (code_m, carrier_m, cn0_dbhz)
        )
        result = []
        for row, each in enumerate(observed):
            arrays = {name: getattr(each, name).copy() for name in ("code_m", "carrier_m", "cn0_dbhz", "lli")}
            arrays["code_m"][L5] = np.where(without, np.nan, arrays["code_m"][L1] + code[row])
            arrays["carrier_m"][L5] = np.where(without, np.nan, arrays["carrier_m"][L1] + carrier[row] + 500.0)
            arrays["cn0_dbhz"][L5] = np.where(without | np.isnan(arrays["cn0_dbhz"][L1]), np.nan, cn0[row])
            arrays["lli"][L5] = np.where(without, np.nan, arrays["lli"][L1])
            result.append(replace(each, **arrays))
        return tuple(result)

    return change


def station(receivers=4, **changes):
    return params(receivers, **({"second_band__products": BOTH, "vdb__slots": "ABCDEF"} | changes))


def usable(integrity):
    return integrity.state == ChannelState.USABLE


def on_l5(integrity):
    return np.isfinite(integrity.prc_m[L5_100])


def without_mean(values, present):
    result = np.full(N_SATS, np.nan)
    for group in (IS_GPS, IS_GALILEO):
        own = present & group
        result[own] = values[own] - values[own].mean()
    return result


def at(channel, satellite, value, receivers=4):
    """An error of one channel, or of all receivers where `channel` is None."""
    error = np.zeros((receivers, N_SATS))
    error[slice(None) if channel is None else channel, satellite] = value
    return error


@pytest.fixture(scope="module")
def two_bands():
    rng = np.random.default_rng(5)
    error, extra = rng.normal(0.0, 10.0, N_SATS), rng.normal(0.0, 10.0, N_SATS)
    given = {"code_error_m": lambda _: error, "change": both_bands(extra, extra)}
    one = run(truth(4), params(4, gast_d__enabled=True, vdb__slots="ABCDEF"), half_seconds(40), **given)
    return error, extra, run(truth(4), station(gast_d__enabled=True), half_seconds(40), **given), one


def test_correction_is_minus_the_error_of_its_band_less_what_its_own_clock_takes(two_bands):
    error, extra, out, _ = two_bands
    last = out.integrity[-1]
    there = on_l5(last)
    assert np.array_equal(there, usable(last) & ~WITHOUT_L5)
    assert (usable(last) & WITHOUT_L5).sum() >= 2  # or the common sets would be the same
    tolerance = NOISE_FREE_M + 3e-6 * np.abs(error).max()
    for product in (L5_100, L5_30):
        assert np.array_equal(np.isfinite(last.prc_m[product]), there)
        assert np.nanmax(np.abs(last.prc_m[product] - without_mean(-error - extra, there))) < tolerance
        assert np.nanmax(np.abs(last.rrc_mps[product])) < 1e-6
        assert np.array_equal((last.receiver_used[product] == 1.0).all(axis=0), there)
    assert np.array_equal(last.p_ephemeris[[L5_100, L5_30]][:, there], last.p_ephemeris[[L1_100, L1_30]][:, there])


def test_sigmas_are_those_of_the_table(two_bands):
    last = two_bands[2].integrity[-1]
    there = on_l5(last)
    for product, smoothing_s in ((L5_100, 100.0), (L5_30, 30.0)):
        expected = sigma_gnd_m("A", "L5", smoothing_s, last.elevation_rad[there], 4)
        # two ways of writing one formula
        np.testing.assert_allclose(last.sigma_pr_gnd_m[product, there], expected, rtol=1e-12)


def test_the_first_band_is_what_it_is_without(two_bands):
    """To the bit, in every field and every epoch."""
    _, _, out, one = two_bands
    for with_l5, without in zip(out.integrity, one.integrity, strict=True):
        for name in ("prc_m", "rrc_mps", "b_m", "sigma_pr_gnd_m", "receiver_used", "p_ephemeris"):
            first = [getattr(each, name)[[L1_100, L1_30]].tobytes() for each in (with_l5, without)]
            assert first[0] == first[1], name
            assert np.isnan(getattr(without, name)[[L5_100, L5_30]]).all()
        assert with_l5.state.tobytes() == without.state.tobytes()
    assert not [event for event in out.events if event.subject.endswith("/l5") and event.cause != "used"]


def test_every_table_of_every_epoch_can_be_published(two_bands):
    """There and back to the bit; the monitors have their rows of L5 beside those of L1."""
    out = two_bands[2]
    for schema, records in ((INTEGRITY, out.integrity), (MONITORS, out.statistics), (CHANNELS, out.channels)):
        for record in records:
            table = schema.encode(record)
            again = schema.encode(schema.decode(schema.label_of(table), table))
            assert again.tobytes() == table.tobytes()
    signals = {(row.monitor, row.signal.name) for row in out.statistics[-1].select(sat="G01").rows()}
    both = ("expected_range", "signal_power", "ccd", "expected_power", "b_value", "correction_limits", "sigma_monitor")
    assert signals >= {(name, signal) for name in both for signal in ("L1", "L5")}
    assert not {signal for _, signal in signals} - {"L1", "L5", "NONE", "L1_L5"}


def test_inflation_for_anomalous_ionosphere_grows_with_the_delay():
    """On L1 f sigma, that is sqrt(f^2 - 1) sigma more in quadrature; on L5 (f1/f5)^2 of that; 30 s none, as on L1."""
    given = {"change": both_bands()}
    plain = run(truth(4), station(), half_seconds(20), **given).integrity[-1]
    inflated = run(truth(4), station(accuracy__inflation_iono=1.5), half_seconds(20), **given).integrity[-1]
    there = on_l5(plain)
    added = np.sqrt(1.5**2 - 1.0) * plain.sigma_pr_gnd_m[L1_100, there] * (1575.42 / 1176.45) ** 2
    expected = np.hypot(plain.sigma_pr_gnd_m[L5_100, there], added)
    np.testing.assert_allclose(inflated.sigma_pr_gnd_m[L5_100, there], expected, rtol=1e-9)
    assert np.array_equal(inflated.sigma_pr_gnd_m[L5_30], plain.sigma_pr_gnd_m[L5_30], equal_nan=True)
    assert IONO_RATIO[L5] == pytest.approx((1575.42 / 1176.45) ** 2)


def test_b_values_of_a_bias_of_one_band():
    """A bias b of one of four receivers on L5 gives b/4 there, of which the clock takes 1/N; on L1 nothing."""
    bias = 0.3
    error = at(2, SAT, bias)
    last = run(truth(4), station(), half_seconds(20), change=both_bands(error)).integrity[-1]
    n = (on_l5(last) & IS_GPS).sum()
    left = -bias * (1.0 - 1.0 / n)
    assert last.b_m[L5_100, 2, SAT] == pytest.approx(left / 4.0, abs=NOISE_FREE_M)
    assert last.b_m[L5_100, 0, SAT] == pytest.approx(-left / 12.0, abs=NOISE_FREE_M)
    assert abs(last.b_m[L1_100, 2, SAT]) < NOISE_FREE_M


def test_a_receiver_that_disagrees_on_one_band_is_excluded_there_alone():
    """Annunciated with its band; the satellite keeps both corrections, of three receivers on L5."""
    error = at(2, SAT, 30.0)
    out = run(truth(4), station(), half_seconds(30), change=both_bands(error, error))
    last = out.integrity[-1]
    assert [(kind, subject) for _, kind, subject in out.told("b_value")] == [("exclusion", "rr3/G01/l5")]
    assert last.receiver_used[L5_100, :, SAT].tolist() == [1.0, 1.0, 0.0, 1.0]
    assert last.receiver_used[L1_100, :, SAT].tolist() == [1.0, 1.0, 1.0, 1.0]
    assert on_l5(last)[SAT]
    assert usable(last)[SAT]


def test_power_is_of_the_band():
    """Too weak on L5 at every receiver: no correction there, and L1 goes on."""
    weak = lambda s: 46.0 - at(None, SAT, 25.0 if s >= 10.0 else 0.0)  # noqa: E731
    out = run(truth(4), station(), half_seconds(30), change=both_bands(cn0_dbhz=weak))
    last = out.integrity[-1]
    assert {subject for _, kind, subject in out.told("signal_power") if kind == "exclusion"} >= {
        f"rr{row}/G01/l5" for row in range(1, 5)
    }
    assert {subject for _, _, subject in out.told("expected_power")} == {"G01/l5"}
    assert not on_l5(last)[SAT]
    assert usable(last)[SAT]
    rows = {
        row.signal.name: row.state.name for row in out.statistics[-1].select(monitor="expected_power", sat="G01").rows()
    }
    assert rows == {"L1": "PASSED", "L5": "FAILED"}


def test_a_code_far_from_the_expected_range_never_enters_the_filter():
    spike = lambda s: at(None, SAT, 500.0 if s == 12.0 else 0.0)  # noqa: E731
    out = run(truth(4), station(), half_seconds(60), change=both_bands(spike))
    everyone = {"G01/l5", *(f"rr{row}/G01/l5" for row in range(1, 5))}
    assert {subject for _, _, subject in out.told("range_residual")} == everyone
    gone = [
        second
        for second, each in zip(out.seconds, out.integrity, strict=True)
        if second >= 6.0 and not on_l5(each)[SAT]
    ]
    assert gone[0] == 12.0
    # back after the re-admission time of 10 s, and what comes back has no trace of the spike
    assert on_l5(out.integrity[-1])[SAT]
    assert np.nanmax(np.abs(out.integrity[-1].prc_m[L5_100])) < NOISE_FREE_M
    assert all(usable(each)[SAT] for second, each in zip(out.seconds, out.integrity, strict=True) if second >= 6.0)


@pytest.mark.parametrize(("ratio_l1", "subjects", "left"), [(0.0, {"G01/l5"}, True), (1.0, {"G01"}, False)])
def test_divergence_of_l5_excludes_it_there_and_that_of_l1_excludes_both(ratio_l1, subjects, left):
    """A ramp of the code of 0.1 m/s against the carrier, four times the threshold, on L5 alone and on both bands."""
    ramp = lambda s: at(None, SAT, 0.1 * max(s - 10.0, 0.0))  # noqa: E731
    out = run(
        truth(4),
        station(ccd__tau_s=5.0, ccd_f__exclude="none"),
        half_seconds(80),
        code_error_m=lambda s: ratio_l1 * ramp(s),
        carrier_error_m=lambda s: 0.0,
        change=both_bands(lambda s: (1.0 - ratio_l1) * ramp(s)),
    )
    last = out.integrity[-1]
    assert {subject for _, _, subject in out.told("code_carrier_divergence")} >= subjects
    assert not on_l5(last)[SAT]
    assert bool(usable(last)[SAT]) is left


def test_two_band_divergence_excludes_both():
    """What no ionosphere makes of two bands says nothing of which one it is."""
    ramp = lambda s: at(None, SAT, 0.1 * max(s - 10.0, 0.0))  # noqa: E731
    out = run(truth(4), station(ccd__exclude=False), half_seconds(80), change=both_bands(ramp))
    assert "G01" in {subject for _, _, subject in out.told("two_frequency_divergence")}
    assert not usable(out.integrity[-1])[SAT]
    assert not on_l5(out.integrity[-1])[SAT]


def test_without_l1_there_is_no_l5():
    """The satellite is found, placed and timed by L1."""

    def change(second, observed):
        both = both_bands()(second, observed)
        for each in both if second >= 10.0 else ():
            each.code_m[L1, SAT] = each.carrier_m[L1, SAT] = np.nan
        return both

    last = run(truth(4), station(), half_seconds(30), change=change).integrity[-1]
    assert not usable(last)[SAT]
    assert not on_l5(last)[SAT]


@pytest.mark.parametrize(("receivers", "cause"), [((0, 1, 2, 3), "not_tracked"), ((0, 1, 2), "too_few_receivers")])
def test_a_signal_that_is_lost_says_so(receivers, cause):
    """L5 of one satellite gone at all receivers, or at all but one where two are needed."""

    def change(second, observed):
        both = both_bands()(second, observed)
        for row in receivers if second >= 10.0 else ():
            both[row].code_m[L5, SAT] = both[row].carrier_m[L5, SAT] = np.nan
        return both

    out = run(truth(4), station(), half_seconds(24), change=change)
    assert [(second, subject) for second, kind, subject in out.told(cause) if kind == "exclusion"] == [(10.0, "G01/l5")]
    assert usable(out.integrity[-1])[SAT]


def test_only_what_is_asked_for_is_made():
    last = run(truth(4), station(second_band__products=("l5_30",)), half_seconds(20), change=both_bands()).integrity[-1]
    assert np.isfinite(last.prc_m[L5_30]).any()
    for name in ("prc_m", "rrc_mps", "sigma_pr_gnd_m", "b_m", "receiver_used", "p_ephemeris"):
        assert np.isnan(getattr(last, name)[L5_100]).all()


def test_ionosphere_free_corrections_of_the_air_are_those_of_the_ground():
    """Smoothing, clocks and means are linear: to combine the corrections is to form them of the combination.

    The ground's are those of a station that is given the combined codes and carriers as its first band. Codes with
    noise and a changing ionosphere, filters settling. What is left: the time of transmission is found by the code, and
    the codes of the two ways differ by up to 15 m, which moves the expected range by 3e-6 of that (900 m/s over c). The
    paper found less than a millimetre (Caamano et al., section 3).
    """
    first, second = 1575.42**2 / (1575.42**2 - 1176.45**2), 1176.45**2 / (1575.42**2 - 1176.45**2)
    rng = np.random.default_rng(3)
    noise = rng.normal(0.0, 0.3, (60, 2, 3, N_SATS))
    delay_m, rate_mps = rng.uniform(1.0, 8.0, N_SATS), rng.uniform(-0.02, 0.02, N_SATS)
    everywhere = np.zeros(N_SATS, dtype=bool)

    def ionosphere(s):
        return delay_m + rate_mps * s

    def given(s):
        """Of L5: what it has more than L1."""
        more, (of_1, of_5) = (IONO_RATIO[L5] - 1.0) * ionosphere(s), noise[round(2 * s)]
        return more + of_5 - of_1, -more

    def two(s, observed):
        code_m, carrier_m = given(s)
        return both_bands(code_m, carrier_m, without=everywhere)(s, observed)

    def combined(s, observed):
        result = []
        for each in two(s, observed):
            arrays = {name: getattr(each, name).copy() for name in ("code_m", "carrier_m", "cn0_dbhz", "lli")}
            for name in ("code_m", "carrier_m"):
                arrays[name][L1] = first * arrays[name][L1] - second * arrays[name][L5]
            for values in arrays.values():
                values[L5] = np.nan
            result.append(replace(each, **arrays))
        return tuple(result)

    runs = [
        run(
            truth(3),
            watching(made),
            half_seconds(60),
            code_error_m=lambda s: ionosphere(s) + noise[round(2 * s), 0],
            carrier_error_m=lambda s: -ionosphere(s),
            change=change,
        )
        for made, change in ((station(3), two), (params(3), combined))
    ]
    compared = 0
    for of_bands, of_combination in zip(runs[0].integrity, runs[1].integrity, strict=True):
        for one, five in ((L1_100, L5_100), (L1_30, L5_30)):
            air_m = first * of_bands.prc_m[one] - second * of_bands.prc_m[five]
            both = np.isfinite(air_m + of_combination.prc_m[one])
            assert np.array_equal(np.isfinite(air_m), np.isfinite(of_combination.prc_m[one]))
            assert np.abs(air_m - of_combination.prc_m[one])[both].max(initial=0.0) < 5e-5
            compared += both.sum()
    assert compared > 1000


# --- over the air


def blocks(bursts):
    decoded = [decode_burst(burst) for burst in bursts]
    assert not any(each.errors for each in decoded)
    return [block for each in decoded for block in each.blocks]


def heard(out):
    """What a receiver knows after all frames of a run."""
    state, events = ReceptionState(), []
    for bursts in out.bursts:
        for burst in bursts:
            state, told = reception_step(state, (burst,), burst.gps_week, burst.tow_s + 0.5, AirborneParams())
            events.extend(told)
    return state, events


def test_what_the_station_makes_arrives_in_the_air(two_bands):
    """Within half of the last bit of a message; sigmas rounded up (ICAO Annex 10 vol. I, table B-63)."""
    out = two_bands[2]
    last, (state, events) = out.integrity[-1], heard(out)
    for name, product in zip(BOTH, (L5_100, L5_30), strict=True):
        received = state.corrections[name]
        there = on_l5(last)
        assert np.array_equal(np.isfinite(received.listed), there)
        assert np.abs(received.prc_m - last.prc_m[product])[there].max() <= 0.005 + 1e-9
        assert np.abs(received.rrc_mps - last.rrc_mps[product])[there].max() <= 0.0005 + 1e-9
        over = (received.sigma_m - last.sigma_pr_gnd_m[product])[there]
        assert -1e-9 <= over.min() <= over.max() < 0.02
        assert np.nanmax(np.abs(received.b_m - last.b_m[product])[:, there]) <= 0.025 + 1e-9
        assert np.array_equal(received.iod[there], last.iod[there] % 256)
        assert (received.gps_week, received.tow_s) == (last.gps_week, last.tow_s)
    assert {event.cause for event in events} == {
        "station_selected",
        "gcid_changed",
    }  # healthy once there are corrections
    assert state.counts.unpaired == state.counts.failed == 0


def test_a_receiver_of_one_band_gets_the_same_messages(two_bands):
    """Types 1 and 11 to the bit, in every frame; what else there is has a type that it does not look into."""
    _, _, out, one = two_bands
    for with_l5, without in zip(out.bursts, one.bursts, strict=True):
        of_both = [[each for each in blocks(bursts) if each.message_type in (1, 11)] for bursts in (with_l5, without)]
        assert of_both[0] == of_both[1]
        assert {each.message_type for each in blocks(without)} <= {1, 2, 11}
        assert {each.message_type for each in blocks(with_l5)} <= {1, 2, 8, 11}


SENDABLE = {
    "prc_m": (-327.67, 327.67), "rrc_mps": (-32.767, 32.767), "sigma_pr_gnd_m": (1e-300, 5.08), "b_m": (-6.35, 6.35),
}  # fmt: skip


@pytest.mark.parametrize("name", list(SENDABLE))
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 0.0, -1.0, 0.5, 1e9, 1e308])
def test_damaged_numbers_of_the_second_band_are_not_sent_and_do_not_touch_the_first(two_bands, name, value):
    """Whatever is in the table of L5: what is sent could be sent, and types 1 and 11 are the same bits."""
    whole = two_bands[2].integrity[-1]
    ready = GroundStation(station(gast_d__enabled=True))
    array = getattr(whole, name).copy()
    array[[L5_100, L5_30]] = np.where(np.isfinite(array[[L5_100, L5_30]]), value, np.nan)
    sent = [
        blocks(ready.broadcast(ready.initial_state().broadcast, each)[1])
        for each in (whole, replace(whole, **{name: array}))
    ]
    standard = [[each for each in frame if each.message_type in (1, 11)] for frame in sent]
    assert standard[0] == standard[1]
    for block in sent[1]:
        if block.message_type == 8:
            product = (L5_100, L5_30)[block.message.measurement_type]
            for correction in block.message.measurements:
                number = array[product][..., SOURCE_ID_INDEX[correction.ranging_source_id]]
                low, high = SENDABLE[name]
                assert ((low <= number) & (number <= high) | (np.isnan(number) & (name == "b_m"))).all()
    n_sent = [sum(len(each.message.measurements) for each in frame if each.message_type == 8) for frame in sent]
    assert n_sent[0] > 20
    low, high = SENDABLE[name]
    assert n_sent[1] == (n_sent[0] if low <= value <= high or (name == "b_m" and np.isnan(value)) else 0)


def test_what_does_not_fit_is_the_lowest_and_is_told():
    """Three slots hold types 1 and 11 of all, and not all of L5 beside them."""
    two = station(gast_d__enabled=True, vdb__slots="ABC")
    out = run(truth(4), two, half_seconds(20), change=both_bands())
    last, received = out.integrity[-1], heard(out)[0].corrections["l5_100"]
    there, sent = on_l5(last), np.isfinite(received.listed)
    assert 4 <= sent.sum() < there.sum()
    assert last.elevation_rad[sent].min() > last.elevation_rad[there & ~sent].max()
    (event,) = [each for each in out.events if each.cause == "no_room"]
    assert (event.subject, event.value, event.threshold) == ("station/l5", there.sum(), sent.sum())
    # types 1 and 11 still carry every satellite
    assert sum(len(each.message.measurements) for each in blocks(out.bursts[-1]) if each.message_type == 1) == 19


def test_satellites_that_do_not_fit_on_l1_are_told_too():
    out = run(truth(4), params(4, vdb__slots="A"), half_seconds(20))
    n = usable(out.integrity[-1]).sum()
    (event,) = [each for each in out.events if each.cause == "no_room"]
    assert (event.subject, event.value) == ("station", n)
    assert event.threshold < n


def test_slots_that_hold_no_second_band_are_refused():
    with pytest.raises(ParameterError, match=r"vdb.slots = 'A' leaves room for \d satellites of second_band.products"):
        station(vdb__slots="A", gast_d__enabled=True)


def test_parameters():
    with pytest.raises(ParameterError, match="'l2_100' is not one of l5_100, l5_30"):
        params(4, second_band__products=("l2_100",))
    with pytest.raises(ParameterError, match="one of them twice"):
        params(4, second_band__products=("l5_30", "l5_30"))


def test_a_table_without_curves_of_the_band_is_refused(tmp_path):
    row = "{end: ground, signal: L1, smoothing_s: 100.0, a0_m: 0.1, a1_m: 0.1, theta0_deg: 10.0, tag: known, source: x}"
    file = tmp_path / "curves.yaml"
    file.write_text(f"curves: [{row}]\n")
    with pytest.raises(ParameterError, match="no ground curve of L5"):
        station(accuracy__curves=str(file))


def test_state_is_pure():
    """The same state stepped twice gives the same."""
    world, ready = truth(3), GroundStation(station(3))
    out = run(world, station(3), half_seconds(12), change=both_bands())
    observed = both_bands()(6.0, world.observe(2300, 302_406.0))
    epoch = GroundEpoch(gps_week=2300, tow_s=302_406.0, observations=observed)
    first, second = (ready.step(out.state, epoch)[1].integrity.prc_m.tobytes() for _ in range(2))
    assert first == second

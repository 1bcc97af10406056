"""One receiver must not take the station down: it is named, and the others go on with all satellites.

The station is the suite's own, four receivers, simulated; its filters settle in 20 s instead of 230 s.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gbas_bringup.resources import named_config
from gbas_core.gnss.frames import rot_enu_ecef
from gbas_core.gnss.gpstime import from_epoch_key
from gbas_core.parameters import replaced
from gbas_core.satellites import N_SATS, SAT_INDEX
from gbas_core.signals import SPEED_OF_LIGHT_MPS, WAVELENGTH_M
from gbas_ground.params import GroundParams
from gbas_ground.station import GroundEpoch, GroundStation, initial_monitor_state
from gbas_msgs_py.records import ChannelState
from gbas_sim.scenario import read_sections, scenario_from_yaml
from gbas_sim.world import World
from ground_runs import half_seconds, params, receiver_values, run
from synthetic_ranges import TOW_S, truth

SETTLE_S = 20.0
MILLISECOND_M = 1e-3 * SPEED_OF_LIGHT_MPS
G02 = SAT_INDEX["G02"]


@pytest.fixture(scope="module")
def world():
    """Epochs of 60 s and the ephemeris."""
    quiet = scenario_from_yaml(named_config("quiet_approach"))
    made = World(replace(quiet, flight=None, duration_s=60.0, faults=(), fronts=()))
    return [(each.key, each.ground) for each in made], made.ephemeris


@pytest.fixture(scope="module")
def station():
    sections = read_sections(named_config("quiet_approach"))["ground"]
    return replaced(
        GroundParams.from_mapping(sections),
        {"smoothing.settle_time_s": SETTLE_S, "monitors.readmission_time_s": 10.0},
    )


def changed(receiver, **quantities):
    """Observations of one receiver with functions of a quantity put in its place."""

    def change(observed):
        each = observed[receiver]
        values = {name: function(getattr(each, name)) for name, function in quantities.items()}
        return (*observed[:receiver], replace(each, **values), *observed[receiver + 1 :])

    return change


def watched(world, station, change=lambda observed: observed, seconds=23.0, onset_s=0.0):
    """Usable satellites and receivers of each epoch, and the exclusions as (second, subject, cause)."""
    epochs, ephemeris = world
    state, usable, receivers, told = initial_monitor_state(station), [], [], []
    for number, (key, observed) in enumerate(epochs[: round(2.0 * seconds) + 1]):
        week, tow_s = from_epoch_key(key)
        epoch = GroundEpoch(
            gps_week=week, tow_s=tow_s, observations=change(observed) if number >= 2.0 * onset_s else observed,
            ephemerides=(ephemeris,) if number == 0 else (),
        )  # fmt: skip
        state, monitored = GroundStation.monitor(state, epoch, station)
        usable.append(int((monitored.integrity.state == ChannelState.USABLE).sum()))
        receivers.append(int(monitored.integrity.n_receivers))
        told += [(0.5 * number, each.subject, each.cause) for each in monitored.events if each.kind == "exclusion"]
    return np.array(usable), np.array(receivers), told


def moved(station, receiver, enu_m):
    """The station with one antenna surveyed wrong."""
    position = np.array(station.receivers.ecef_m[receiver])
    position = position + enu_m @ rot_enu_ecef(station.station.latitude_rad, station.station.longitude_rad)
    places = list(station.receivers.ecef_m)
    places[receiver] = tuple(float(each) for each in position)
    return replaced(station, receiver_values(np.array(places)))


def test_codes_off_by_a_millisecond_name_the_receiver(world, station):
    """The codes say when the satellite sent, so that each range is that of 1 ms before: up to 0.8 m, other for each."""
    usable, receivers, told = watched(world, station, changed(1, code_m=lambda code: code + MILLISECOND_M))
    assert told == [(SETTLE_S, "rr2", "receiver_baselines")]
    assert (usable[40:] == 17).all()
    assert (receivers[40:] == 3).all()


def test_codes_that_step_by_a_millisecond_do_not_come_back_with_the_receiver(world, station):
    """Its filters settle for 20 s; then it is named, and it stays out beyond the re-admission time of 10 s."""
    change = changed(1, code_m=lambda code: code + MILLISECOND_M)
    usable, receivers, told = watched(world, station, change, seconds=58.0, onset_s=22.0)
    assert told == [(22.0, "rr2", "no_channels"), (42.0, "rr2", "receiver_baselines")]
    assert (usable[40:] == 17).all()
    assert (receivers[44:] == 3).all()


@pytest.mark.parametrize(
    ("receiver", "enu_m"), [(2, (0.12, 0.0, 0.0)), (0, (0.0, 0.12, 0.0)), (3, (0.0, 0.0, 0.12)), (1, (0.0, 0.0, -0.12))]
)
def test_an_antenna_surveyed_12_cm_wrong_is_named(world, station, receiver, enu_m):
    usable, _, told = watched(world, moved(station, receiver, np.array(enu_m)))
    assert told == [(SETTLE_S, f"rr{receiver + 1}", "receiver_baselines")]
    assert (usable[40:] == 17).all()


def test_half_wavelengths_in_the_carriers_of_one_receiver_name_it(world, station):
    half = 0.5 * WAVELENGTH_M[:, np.newaxis] * np.random.default_rng(3).integers(0, 2, (3, N_SATS))
    usable, _, told = watched(world, station, changed(3, carrier_m=lambda carrier: carrier + half))
    assert told == [(SETTLE_S, "rr4", "receiver_baselines")]
    assert (usable[40:] == 17).all()


def test_when_less_than_half_of_the_satellites_point_they_are_excluded_and_come_back(world, station):
    """12 cm to the north at rr2: 8 of 17 point to it."""
    usable, _, told = watched(world, moved(station, 1, np.array([0.0, 0.12, 0.0])), seconds=33.0)
    assert (SETTLE_S, "rr2", "receiver_baselines") in told
    assert usable[40] == 10
    assert {when for when, subject, _ in told if subject != "rr2"} == {SETTLE_S}
    assert usable[-1] == 17


def test_carriers_that_freeze_are_not_used(world, station):
    frozen = world[0][43][1][2].carrier_m
    usable, receivers, told = watched(
        world, station, changed(2, carrier_m=lambda _: frozen), seconds=25.0, onset_s=22.0
    )
    assert [subject for _, subject, _ in told] == ["rr3"]
    assert (usable[40:] == 17).all()
    assert receivers[-1] == 3


def test_two_receivers_in_each_others_place_are_named(world, station):
    usable, receivers, told = watched(world, station, lambda seen: (seen[1], seen[0], *seen[2:]))
    assert {(subject, cause) for _, subject, cause in told if "/" not in subject} == {
        ("rr1", "receiver_fault"), ("rr2", "receiver_fault"),
    }  # fmt: skip
    assert (usable[40:] == 17).all()
    assert (receivers[40:] == 2).all()


@pytest.mark.parametrize("count", [2, 3])
def test_two_or_three_receivers_do_not_tell_which_is_wrong(world, station, count):
    """Then it is the satellites: whatever the receivers have, none is used that does not fit."""
    without = {f"receivers.rr{row}_ecef_m": None for row in range(count + 1, 5)}
    fewer = moved(replaced(station, without), 1, np.array([0.12, 0.0, 0.0]))
    usable, _, told = watched(world, fewer, lambda seen: seen[:count])
    assert not [subject for _, subject, _ in told if subject.startswith("rr")]
    assert {cause for _, _, cause in told} <= {"ionosphere_gradient", "ephemeris_residual", "too_few_common_satellites"}
    assert usable[40:].max() < 14


def _slope(station, size, course_rad, satellites):
    """Delays (R, N) of a gradient over the site on some satellites [m]."""
    enu = (station.receiver_positions_m() - station.reference_point_m()) @ rot_enu_ecef(
        station.station.latitude_rad, station.station.longitude_rad
    ).T
    along = enu[:, 0] * np.sin(course_rad) + enu[:, 1] * np.cos(course_rad)
    delay = np.zeros((4, N_SATS))
    delay[:, [SAT_INDEX[each] for each in satellites]] = size * along[:, np.newaxis]
    return delay


def _advanced(delay_m):
    """All receivers' carriers ahead and codes behind, L1 alone told apart from L5 by the square of the frequencies."""
    ratio = (WAVELENGTH_M / WAVELENGTH_M[0])[:, np.newaxis] ** 2

    def change(observed):
        return tuple(
            replace(each, code_m=each.code_m + ratio * own, carrier_m=each.carrier_m - ratio * own)
            for each, own in zip(observed, delay_m, strict=True)
        )

    return change


SLOPED = ("G01", "G21", "E08", "E17")  # two of the five references of each constellation


@pytest.mark.parametrize("course_deg", [0.0, 60.0, 120.0, 264.0])
def test_a_slope_over_the_site_excludes_the_satellites_and_no_receiver(world, station, course_deg):
    delay_m = _slope(station, 200e-6, np.radians(course_deg), SLOPED)
    _, receivers, told = watched(world, station, _advanced(delay_m), seconds=22.0)
    assert {subject for when, subject, _ in told if when == SETTLE_S} >= {"G01", "E08"}
    assert not [subject for _, subject, _ in told if subject.startswith("rr")]
    assert (receivers[40:] == 4).all()


def test_an_edge_that_has_reached_one_antenna_excludes_the_satellites_at_once(world, station):
    """70 mm at rr2 on four satellites: whatever is thought of rr2, they are out, and for the re-admission time."""
    delay_m = np.zeros((4, N_SATS))
    delay_m[1, [SAT_INDEX[each] for each in SLOPED]] = 0.07
    usable, _, told = watched(world, station, _advanced(delay_m), seconds=29.0)
    first = {subject for when, subject, cause in told if when == SETTLE_S and cause == "ionosphere_gradient"}
    assert first >= {"G01", "E08"}
    assert (usable[40:] <= 17 - len(first)).all()


# ---- made-up ranges: what happens later


def _difference(size_m):
    """An error of the carriers of G02 at the second of two receivers, a function of the second."""

    def error(second):
        result = np.zeros((2, N_SATS))
        result[1, G02] = size_m(second)
        return result

    return error


def _excluded(out):
    cause, _ = out.array("cause"), out.array("state")
    return cause[:, G02] >= 32


def test_what_is_excluded_stays_out_until_it_is_well_below_its_threshold():
    """A third of a wavelength on one receiver, since before the start, that shrinks slowly to a share of it."""
    station = params(2, atmosphere__refractivity=16.0, monitors__readmission_time_s=5.0)
    start = run(
        truth(2), station, half_seconds(14), code_error_m=lambda _: 0.0, carrier_error_m=_difference(lambda _: 0.06)
    )
    threshold = next(each.threshold for each in start.events if each.subject == "G02" and each.kind == "exclusion")
    for share, comes_back in ((0.8, False), (0.5, True)):
        last = share * threshold

        def size(second, last=last):
            return max(last, 0.06 - 0.002 * max(0.0, second - 7.0))

        out = run(
            truth(2), station, half_seconds(70), code_error_m=lambda _: 0.0, carrier_error_m=_difference(size)
        )  # fmt: skip
        assert _excluded(out)[10:24].all()
        assert _excluded(out)[-1] != comes_back
        assert out.integrity[-1].tow_s == TOW_S + 34.5


def _ramp(rate_mps, satellites):
    """Codes and carriers of some satellites that run away from the onset at 22 s."""
    theirs = np.isin(np.arange(N_SATS), [SAT_INDEX[each] for each in satellites])

    def change(observed):
        since_s = observed[0].tow_s - 216_000.0 - 22.0
        size = rate_mps * since_s * theirs
        return tuple(replace(each, code_m=each.code_m + size, carrier_m=each.carrier_m + size) for each in observed)

    return change


@pytest.mark.parametrize(
    "faulty", [("G01", "G08", "G16", "G06", "G18"), ("G01", "G08", "G16", "G12", "E08", "E15", "E24")]
)
def test_satellites_that_run_away_do_not_take_healthy_ones_with_them(world, station, faulty):
    """Five of the eight of GPS, seven of all seventeen: the mean of a constellation moves its healthy ones further."""
    _, _, told = watched(world, station, _ramp(0.02, faulty), seconds=36.0, onset_s=22.0)
    subjects = {subject for _, subject, _ in told}
    assert subjects <= set(faulty)
    assert len(subjects) >= 4  # the lowest, with larger sigmas, take longer

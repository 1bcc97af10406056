"""Geometry screening: every number against a second formulation, the search, and the station's state."""

from __future__ import annotations

import numpy as np
import pytest

import front_screening
from gbas_bringup.resources import named_config
from gbas_core.parameters import ParameterError, replaced
from gbas_core.satellites import N_SATS, SAT_INDEX
from gbas_ground.corrections.sigma import broadcast_sigmas
from gbas_ground.ionosphere.geometry_screening import judge, least_safe, sent_sigma_m, subsets_of
from gbas_ground.ionosphere.places import places_of
from gbas_ground.ionosphere.protection import (
    Sky,
    cases_of,
    changes,
    initial_ionosphere,
    protect,
    protection_in_words,
)
from gbas_ground.params import GroundParams
from gbas_ground.prepared import PreparedStation
from gbas_ground.sections import MAX_SIGMA_VIG
from gbas_sim.scenario import read_sections

# A sky of 52 degrees north: elevations and azimuths as they are at Braunschweig at the end of the quiet approach [deg].
SKY = {
    "G01": (69.6, 129), "G06": (34.7, -109), "G08": (73.2, -109), "G12": (21.9, 45), "G16": (15.4, 93),
    "G18": (6.3, -90), "G21": (31.3, -52), "E01": (9.8, 75), "E06": (10.7, -103), "E07": (62.0, -98),
    "E08": (61.0, 70), "E14": (22.5, 96), "E15": (19.1, 43), "E17": (27.2, -162),
}  # fmt: skip


def station(systems="GE", d_max_m=50_000.0, **ionosphere):
    ground = dict(read_sections(named_config("quiet_approach"))["ground"])
    ground["station"] = dict(ground["station"]) | {"systems": systems, "max_use_distance_m": d_max_m}
    ground["ionosphere"] = {"threat_model": "germany", "max_missing": 1} | ionosphere
    return GroundParams.from_mapping(ground)


def sky_of(params, names=tuple(SKY), receivers=4.0):
    elevation, azimuth, count = (np.full(N_SATS, np.nan) for _ in range(3))
    for name in names:
        if name[0] in params.station.systems:
            elevation[SAT_INDEX[name]], azimuth[SAT_INDEX[name]] = np.deg2rad(SKY[name])
            count[SAT_INDEX[name]] = receivers
    sent = np.isfinite(elevation)
    sky = Sky(elevation, azimuth, broadcast_sigmas(params, elevation, np.nan_to_num(count)).gnd_m, count)
    return sent, sky


def prepared(params, names=tuple(SKY)):
    sent, sky = sky_of(params, names)
    places = np.flatnonzero(sent)
    groups = np.array([[name == "G" for name in ("G" if i < 32 else "E" for i in places)]])
    groups = np.concatenate([groups, ~groups]) if "E" in params.station.systems else groups
    return cases_of(places, sky, params, places_of(params)), groups


@pytest.mark.parametrize("max_missing", [0, 1, 2])
def test_subsets_are_all_there_are(max_missing):
    groups = np.array([[1, 1, 1, 1, 1, 1, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0, 1, 1, 1, 1]], dtype=bool)
    combinations = [(0,), (1,), (0, 1)]
    ours = subsets_of(groups, combinations, max_missing)
    theirs = front_screening.subsets(groups, combinations, max_missing)
    assert {frozenset(np.flatnonzero(row).tolist()) for row in ours} == theirs
    assert len(ours) == len(theirs)


@pytest.mark.parametrize(("systems", "affected"), [("G", 1), ("G", 2), ("GE", 1), ("GE", 2)])
def test_levels_and_errors_against_least_squares(systems, affected):
    """To rounding of weights between 0.2 and 4 m: one part in 1e8, in every tenth geometry."""
    params = station(systems, affected=affected, aircraft_aad="AB")
    cases, groups = prepared(params)
    subsets = subsets_of(groups, [(0,), tuple(range(len(groups)))], 1)
    found = judge(cases, groups, subsets, 12.3e-6, 0.1)
    gnd = sent_sigma_m(cases.base_m, cases.shape_m, 0.1)
    for case in range(0, len(cases.tan_gpa), 5):
        sigma = np.sqrt(gnd**2 + cases.air2_m2[case] + (12.3e-6 * cases.iono_m[case]) ** 2)
        nominal = np.sqrt(cases.base_m**2 + cases.air2_m2[case] + (4e-6 * cases.iono_m[case]) ** 2)
        for row in range(0, len(subsets), 2):
            expected = front_screening.level_and_error(
                cases.los[case], sigma, nominal, cases.error_m[case], groups, set(np.flatnonzero(subsets[row])),
                cases.tan_gpa[case], cases.k_ffmd, 3.0, affected,
            )  # fmt: skip
            np.testing.assert_allclose(found.level_m[case, row], [each[0] for each in expected], rtol=1e-8)
            np.testing.assert_allclose(found.error_m[case, row], [each[1] for each in expected], rtol=1e-8)


def test_a_geometry_without_a_position_has_no_service():
    cases, groups = prepared(station("G"), ("G01", "G06", "G08", "G12", "G16"))
    flat = np.zeros((1, 5), dtype=bool)
    flat[0, :3] = True
    found = judge(cases, groups, flat, 4e-6, 0.0)
    assert np.isinf(found.level_m).all()
    assert found.not_safe == 0


def test_sigmas_are_rounded_up_to_what_a_message_carries():
    np.testing.assert_allclose(
        sent_sigma_m(np.array([0.1, 0.11, 0.3]), np.array([0.0, 0.0, 4.0]), 0.1), [0.1, 0.12, 0.5], atol=1e-12
    )


@pytest.mark.parametrize("largest", [1, 7, 40])
def test_the_search_finds_the_least_from_anywhere(largest):
    for least in range(largest + 2):
        for start in range(-2, largest + 3):
            tried = []

            def safe(step, least=least, tried=tried):
                tried.append(step)
                return step >= least

            assert least_safe(safe, largest, start) == (least if least <= largest else None)
            assert len(tried) <= 2 * (largest.bit_length() + 1)


@pytest.mark.parametrize(
    ("systems", "ionosphere"),
    [
        ("G", {"affected": 1}),
        ("GE", {}),
        ("G", {"tolerable_vertical_m": 6.0, "tolerable_lateral_m": 6.0, "affected": 1}),
    ],
)
def test_the_least_inflation_is_safe_and_one_step_less_is_not(systems, ionosphere):
    """Every geometry of every case, none left out, by the second formulation."""
    params = station(systems, aircraft_aad="B", aircraft_speed_mps=[70.0, 70.0], d_max_m=8_000.0, **ionosphere)
    sent, sky = sky_of(params)
    _, protection = protect(initial_ionosphere(), 0, sent, sky, params, PreparedStation(params).places)
    cases, groups = prepared(params)
    combinations = [(0,), (1,), (0, 1)] if systems == "GE" else [(0,)]

    def unsafe(sigma_vig, factor):
        gnd, count = sent_sigma_m(cases.base_m, cases.shape_m, factor), 0
        for case in range(len(cases.tan_gpa)):
            sigma = np.sqrt(gnd**2 + cases.air2_m2[case] + (sigma_vig * cases.iono_m[case]) ** 2)
            nominal = np.sqrt(cases.base_m**2 + cases.air2_m2[case] + (4e-6 * cases.iono_m[case]) ** 2)
            for chosen in front_screening.subsets(groups, combinations, 1):
                both = front_screening.level_and_error(
                    cases.los[case], sigma, nominal, cases.error_m[case], groups, chosen, cases.tan_gpa[case],
                    cases.k_ffmd, 3.0, params.ionosphere.affected,
                )  # fmt: skip
                served = all(level <= limit for (level, _), limit in zip(both, cases.limit_m[:, case], strict=True))
                bounded = all(
                    error <= max(level, tolerable)
                    for (level, error), tolerable in zip(both, cases.tolerable_m[:, case], strict=True)
                )
                count += served and not bounded
        return count

    assert protection.available
    assert unsafe(protection.sigma_vig, protection.factor) == 0
    assert unsafe(4e-6, 0.0) > 0  # nominal sigmas are not safe
    if protection.factor > 0.0:
        assert protection.sigma_vig == MAX_SIGMA_VIG
        assert unsafe(protection.sigma_vig, protection.factor - 0.005) > 0
    else:
        assert unsafe(protection.sigma_vig - 1e-7, 0.0) > 0


def test_result_is_held_for_a_minute_and_made_anew_when_the_satellites_change():
    params = station()
    sent, sky = sky_of(params)
    state, first = protect(initial_ionosphere(), 0, sent, sky, params, PreparedStation(params).places)
    state, held = protect(state, 59_500, sent, sky, params, PreparedStation(params).places)
    assert held is first
    renewed_state, renewed = protect(state, 60_000, sent, sky, params, PreparedStation(params).places)
    assert renewed is not first
    assert renewed_state.renewed_key == 60_000
    fewer, less = sky_of(params, tuple(SKY)[1:])
    changed_state, changed = protect(state, 30_000, fewer, less, params, PreparedStation(params).places)
    assert changed.factor > first.factor  # a satellite less, and a weaker geometry
    assert np.isnan(changed.shape_m[SAT_INDEX["G01"]])
    assert changed_state.renewed_key == 0  # the minute goes on
    one, lost = sky_of(params, receivers=3.0)
    assert protect(state, 30_000, one, lost, params, PreparedStation(params).places)[1] is not first


def test_a_rise_of_sigma_vig_counts_when_every_aircraft_has_it():
    """Station data are sent each 10 s: for a minute the sigmas of the corrections make up for what is not credited."""
    params = station(affected=1, max_missing=0, aircraft_systems=["GE"])
    sent, sky = sky_of(params)
    state, full = protect(initial_ionosphere(), 0, sent, sky, params, PreparedStation(params).places)
    assert 4e-6 < full.sigma_vig < MAX_SIGMA_VIG
    assert full.factor == 0.0
    fewer, less = sky_of(params, ("G06", "G08", "G12", "G16", "G21", "E01", "E07", "E15"))
    state, at_once = protect(state, 10_000, fewer, less, params, PreparedStation(params).places)
    assert at_once.sigma_vig == full.sigma_vig
    assert at_once.factor > 0.0
    state, minute = protect(state, 60_000, fewer, less, params, PreparedStation(params).places)
    assert minute.sigma_vig > full.sigma_vig
    assert minute.factor == at_once.factor
    state, later = protect(state, 120_000, fewer, less, params, PreparedStation(params).places)
    assert later.sigma_vig == minute.sigma_vig
    assert later.factor < at_once.factor
    _, back = protect(state, 180_000, sent, sky, params, PreparedStation(params).places)
    assert back.sigma_vig == full.sigma_vig


def test_after_a_short_interruption_aircraft_may_still_have_the_sigma_vig_of_before():
    params = station(affected=1, max_missing=0, aircraft_systems=["GE"])
    sent, sky = sky_of(params)
    state, full = protect(initial_ionosphere(), 0, sent, sky, params, PreparedStation(params).places)
    few, little = sky_of(params, ("G01", "G06", "G08"))
    state, nothing = protect(state, 1_000, few, little, params, PreparedStation(params).places)
    assert nothing.sigma_vig == MAX_SIGMA_VIG
    fewer, less = sky_of(params, ("G06", "G08", "G12", "G16", "G21", "E01", "E07", "E15"))
    soon, at_once = protect(state, 5_000, fewer, less, params, PreparedStation(params).places)
    assert at_once.sigma_vig > full.sigma_vig
    assert soon.credited_vig == full.sigma_vig
    assert at_once.factor > 0.0
    later, fresh = protect(state, 61_000, fewer, less, params, PreparedStation(params).places)
    assert later.credited_vig == fresh.sigma_vig
    assert fresh.factor < at_once.factor


def test_the_multiplier_is_the_least_any_aircraft_may_use():
    """One receiver has a larger one than two, but an aircraft takes that of the most behind a satellite it has."""
    params = station()
    sent, sky = sky_of(params)
    mixed = sky.receivers.copy()
    mixed[SAT_INDEX["G01"]] = 1.0
    places = np.flatnonzero(sent)
    multipliers = [
        cases_of(places, sky._replace(receivers=each), params, places_of(params)).k_ffmd
        for each in (sky.receivers, mixed, np.where(sent, 1.0, np.nan), np.where(sent, 2.0, np.nan))
    ]
    assert multipliers == pytest.approx([5.847, 5.847, 6.86, 5.762], abs=5e-4)  # ICAO Annex 10, table B-67


def test_a_type_d_station_keeps_its_other_sigmas():
    params = station()
    sent, sky = sky_of(params)
    _, protection = protect(initial_ionosphere(), 0, sent, sky, params, PreparedStation(params).places)
    inflated = protection.inflated_m(sky.sigma_m)[sent]
    assert protection.factor > 0.0
    assert (inflated > sky.sigma_m[sent]).all()
    assert (inflated <= 5.08).all()


def test_nothing_is_screened_without_a_threat_model_or_without_satellites():
    bare = station(threat_model="none")
    sent, sky = sky_of(bare)
    _, protection = protect(initial_ionosphere(), 0, sent, sky, bare, PreparedStation(bare).places)
    assert (protection.sigma_vig, protection.factor, protection.available) == (4e-6, 0.0, True)
    params = station("G")
    sent, sky = sky_of(params, ("G01", "G06", "G08"))
    state, protection = protect(initial_ionosphere(), 0, sent, sky, params, PreparedStation(params).places)
    assert protection.sigma_vig == MAX_SIGMA_VIG
    assert state.protection is None


def test_where_no_inflation_is_enough_nothing_is_available():
    """Two satellites at once, 425 mm/km, out to 50 km with eight satellites: not below any alert limit, and said so."""
    params = station("G", threat_model="conus")
    sent, sky = sky_of(params)
    _, protection = protect(initial_ionosphere(), 0, sent, sky, params, PreparedStation(params).places)
    assert not protection.available
    assert [cause for cause, _, _ in changes(None, protection)] == ["ionosphere_unprotected", "ionosphere_sigma_vig"]


def test_more_threat_takes_more_inflation():
    def inflation(**ionosphere):
        params = station(d_max_m=15_000.0, **ionosphere)
        sent, sky = sky_of(params)
        protection = protect(initial_ionosphere(), 0, sent, sky, params, PreparedStation(params).places)[1]
        return (not protection.available, protection.factor, protection.sigma_vig)

    base = inflation(affected=1)
    assert inflation(affected=2) > base
    assert inflation(affected=1, max_missing=2) >= base
    assert inflation(affected=1, threat_model="conus") > base
    assert inflation(affected=1, aircraft_systems=["GE"]) <= base
    assert inflation(affected=1, k_noise=0.0) <= base


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"approaches": ()}, "at least one approach"),
        ({"station.max_use_distance_m": 0.0}, "not unlimited"),
        ({"station.max_use_distance_m": 80_000.0}, "at most 60000 m"),
    ],
)
def test_what_cannot_be_screened_is_not_accepted(change, message):
    with pytest.raises(ParameterError, match=message):
        replaced(station(), change)


@pytest.mark.parametrize(
    ("ionosphere", "message"),
    [
        ({"threat_model": "worst"}, "ionosphere.threat_model = 'worst' is not one of"),
        ({"threat_model": "custom"}, "not lists of one length"),
        ({"gradient": [1e-4], "elevation_deg": [0.0]}, "is not custom"),
        ({"affected": 3}, "ionosphere.affected = 3 is not within 1 to 2"),
        ({"aircraft_systems": ["GX"]}, "is not one of 'G', 'E', 'GE'"),
        ({"aircraft_speed_mps": [80.0, 60.0]}, "not the lower one first"),
    ],
)
def test_bad_parameters_are_named(ionosphere, message):
    with pytest.raises(ParameterError, match=message):
        station(**ionosphere)


def test_a_custom_model_is_taken():
    params = station(threat_model="custom", elevation_deg=[10.0, 60.0], gradient=[100e-6, 200e-6], max_delay_m=20.0)
    assert params.ionosphere.threat().largest_gradient(np.deg2rad(35.0)) == pytest.approx(150e-6)


def test_the_protection_in_words():
    assert "no threat model" in protection_in_words(station(threat_model="none"))
    words = protection_in_words(station())
    assert "140 mm/km" in words
    assert "two satellites" in words
    assert "within 50 km" in words

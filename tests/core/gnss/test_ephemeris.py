"""Which ephemeris is used when: the store's rules, one by one, and on a recorded day."""

from __future__ import annotations

import dataclasses
import timeit
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gbas_core.gnss.ephemeris import (
    FIELDS,
    STORE_DEPTH,
    VALIDITY_S,
    Ephemeris,
    EphemerisStore,
    NavigationMessage,
    is_complete,
)
from gbas_core.gnss.gpstime import seconds_between
from gbas_core.io.rinex import read_navigation
from gbas_core.satellites import IS_GALILEO, IS_GPS, N_SATS, SAT_INDEX

G05, E11 = SAT_INDEX["G05"], SAT_INDEX["E11"]
WEEK, NOON = 2320, 302400.0


def ephemeris(
    received_s: float = -300.0, *, sats: tuple[int, ...] = (G05, E11), toe_s: float = 0.0, **fields: float
) -> Ephemeris:
    """Healthy ephemerides of some satellites; times count from noon of a Wednesday, other fields are 1."""
    values = dict.fromkeys(FIELDS, 1.0) | {"health": 0.0, "toe_week": WEEK, "toe_tow_s": NOON + toe_s, **fields}
    columns = {name: np.full(N_SATS, np.nan) for name in FIELDS}
    for sat in sats:
        for name, value in values.items():
            columns[name][sat] = value
    if "message" not in fields:
        columns["message"] = np.where(
            np.isnan(columns["message"]),
            np.nan,
            np.where(IS_GPS, NavigationMessage.GPS_LNAV, 1.0 * NavigationMessage.GALILEO_INAV),
        )
    for name, absent in (("iodc", IS_GALILEO), ("group_delay_e5b_s", IS_GPS)):
        columns[name][absent] = np.nan
    return Ephemeris(gps_week=WEEK, tow_s=NOON + received_s, simulated=0.0, **columns)


def store_of(*ephemerides: Ephemeris) -> EphemerisStore:
    store = EphemerisStore()
    for item in ephemerides:
        store = store.add(item)
    return store


def used(store: EphemerisStore, at_s: float = 0.0, settle_s: float = 120.0) -> dict[str, float]:
    """Issue of data in use of each satellite at a time after noon."""
    picked = store.usable(WEEK, NOON + at_s, settle_s)
    return {name: picked.iod[sat] for name, sat in SAT_INDEX.items() if np.isfinite(picked.iod[sat])}


def test_an_empty_store_has_nothing() -> None:
    picked = EphemerisStore().usable(WEEK, NOON, 0.0)
    assert all(np.isnan(getattr(picked, name)).all() for name in FIELDS)
    assert np.isnan(picked.simulated)


def test_what_comes_out_is_what_went_in() -> None:
    original = ephemeris(iod=7.0, af0_s=1e-4, cuc_rad=-3e-6)
    picked = store_of(original).usable(WEEK, NOON, 120.0)
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(picked, name), getattr(original, name), err_msg=name)
    assert (picked.gps_week, picked.tow_s, picked.simulated) == (WEEK, NOON, 0.0)


@pytest.mark.parametrize(("at_s", "there"), [(119.9, False), (120.0, True), (121.0, True)])
def test_a_new_ephemeris_settles_first(at_s: float, there: bool) -> None:
    assert bool(used(store_of(ephemeris(received_s=0.0)), at_s)) is there


def test_the_old_one_serves_until_the_new_one_has_settled() -> None:
    store = store_of(ephemeris(-3600.0, iod=1.0), ephemeris(0.0, iod=2.0, toe_s=3600.0))
    assert used(store, 119.0) == {"G05": 1.0, "E11": 1.0}
    assert used(store, 120.0) == {"G05": 2.0, "E11": 2.0}


def test_an_ephemeris_of_the_future_is_not_known_yet() -> None:
    store = store_of(ephemeris(600.0, iod=2.0))
    assert used(store, 0.0, settle_s=0.0) == {}
    assert np.isnan(store.matching(np.full(N_SATS, 2.0), WEEK, NOON).iod).all()


@pytest.mark.parametrize(("name", "hours"), [("G05", 2.0), ("E11", 4.0)])
def test_validity_ends_on_both_sides_of_toe(name: str, hours: float) -> None:
    # IS-GPS-200N 20.3.4.4 (fit interval of 4 h centred on toe); Galileo OS SDD (4 h).
    assert VALIDITY_S[SAT_INDEX[name]] == hours * 3600.0
    store = store_of(ephemeris(-20000.0))
    for at_s in (-hours * 3600.0, hours * 3600.0):
        assert name in used(store, at_s)
        assert name not in used(store, at_s + np.sign(at_s) * 0.5)


def test_a_received_one_that_is_not_valid_yet_does_not_displace_one_that_is() -> None:
    store = store_of(ephemeris(-600.0, iod=1.0), ephemeris(-300.0, iod=2.0, toe_s=3 * 3600.0))
    assert used(store) == {"G05": 1.0, "E11": 2.0}


def test_bad_health_counts_at_once_and_until_it_is_withdrawn() -> None:
    store = store_of(ephemeris(-600.0, iod=1.0), ephemeris(-10.0, iod=2.0, health=63.0))
    assert used(store, -11.0) == {"G05": 1.0, "E11": 1.0}
    assert used(store, -10.0) == {}
    assert np.isnan(store.matching(np.full(N_SATS, 1.0), WEEK, NOON).iod).all()
    healthy_again = store.add(ephemeris(100.0, iod=3.0))
    assert used(healthy_again, 219.0) == {}  # and what was sent before the failure does not come back
    assert used(healthy_again, 220.0) == {"G05": 3.0, "E11": 3.0}


def test_unknown_health_is_not_good_health() -> None:
    assert used(store_of(ephemeris(-600.0, iod=1.0), ephemeris(-10.0, iod=2.0, health=np.nan))) == {}


@pytest.mark.parametrize(
    "field", [name for name in FIELDS if name not in ("message", "iodc", "group_delay_e5b_s", "accuracy_m")]
)
def test_an_incomplete_ephemeris_is_not_there(field: str) -> None:
    assert used(store_of(ephemeris(**{field: np.nan}))) == {}


def test_completeness_by_message() -> None:
    def complete(**fields: float) -> list[bool]:
        return [bool(is_complete(ephemeris(**fields))[sat]) for sat in (G05, E11)]

    assert complete() == [True, True]
    assert complete(iodc=np.nan) == [False, True]
    assert complete(group_delay_e5b_s=np.nan) == [True, False]
    assert complete(accuracy_m=np.nan) == [True, False]
    fnav = dataclasses.replace(
        ephemeris(sats=(E11,), group_delay_e5b_s=np.nan),
        message=np.where(np.arange(N_SATS) == E11, NavigationMessage.GALILEO_FNAV, np.nan).astype(float),
    )
    assert is_complete(fnav)[E11]
    assert not is_complete(ephemeris(message=float(NavigationMessage.GPS_LNAV), sats=(E11,)))[E11]
    assert not is_complete(ephemeris(message=float(NavigationMessage.GALILEO_INAV), sats=(G05,)))[G05]
    assert is_complete(ephemeris()).sum() == 2


def test_adding_again_changes_nothing() -> None:
    store = store_of(ephemeris(-600.0, iod=1.0), ephemeris(-300.0, iod=2.0))
    assert store.add(ephemeris(-100.0, iod=2.0)) is store
    assert store.add(ephemeris(-100.0, iod=1.0)) is store  # nor does a late repetition of an older one
    assert used(store.add(ephemeris(-200.0, iod=3.0, sats=(G05,)))) == {"G05": 3.0, "E11": 2.0}


def test_adding_makes_a_new_store() -> None:
    first = store_of(ephemeris(-600.0, iod=1.0))
    second = first.add(ephemeris(-300.0, iod=2.0))
    assert used(first) == {"G05": 1.0, "E11": 1.0}
    assert used(second) == {"G05": 2.0, "E11": 2.0}
    with pytest.raises(ValueError, match="read-only"):
        second.values[0] = 0.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        second.values = first.values  # type: ignore[misc]


@given(st.lists(st.integers(min_value=0, max_value=9), max_size=12))
def test_the_last_few_different_ones_are_kept(iods: list[int]) -> None:
    store, kept = EphemerisStore(), []
    for place, iod in enumerate(iods):
        store = store.add(ephemeris(-1000.0 + place, iod=float(iod)))
        if iod not in kept:
            kept = [*kept, iod][-STORE_DEPTH:]
    for iod in range(10):
        matched = store.matching(np.full(N_SATS, float(iod)), WEEK, NOON)
        assert bool(np.isfinite(matched.iod[G05])) == (iod in kept)


def test_matching_takes_each_satellites_own_issue() -> None:
    store = store_of(ephemeris(-600.0, iod=1.0, af0_s=1e-5), ephemeris(-10.0, iod=2.0, af0_s=2e-5))
    wanted = np.full(N_SATS, np.nan)
    wanted[G05], wanted[E11] = 1.0, 2.0
    matched = store.matching(wanted, WEEK, NOON)
    assert (matched.af0_s[G05], matched.af0_s[E11]) == (1e-5, 2e-5)  # the airborne side need not let it settle
    assert np.isfinite(matched.iod).sum() == 2
    assert np.isnan(store.matching(np.full(N_SATS, 9.0), WEEK, NOON).iod).all()


def test_matching_takes_the_later_of_two_with_the_same_issue() -> None:
    store = store_of(ephemeris(-600.0, iod=1.0, af0_s=1e-5), ephemeris(-300.0, iod=1.0, af0_s=2e-5))
    assert store.matching(np.full(N_SATS, 1.0), WEEK, NOON).af0_s[G05] == 2e-5


def test_of_two_received_at_once_the_one_added_later_is_used() -> None:
    assert used(store_of(ephemeris(-300.0, iod=1.0), ephemeris(-300.0, iod=2.0)))["G05"] == 2.0


def test_across_the_end_of_the_week() -> None:
    last = dataclasses.replace(ephemeris(toe_week=WEEK + 1, toe_tow_s=0.0), tow_s=604800.0 - 60.0)
    store = store_of(last)
    assert np.isnan(store.usable(WEEK + 1, 59.0, 120.0).iod[G05])
    assert np.isfinite(store.usable(WEEK + 1, 60.0, 120.0).iod[G05])


def test_simulated_ephemerides_stay_marked() -> None:
    store = store_of(dataclasses.replace(ephemeris(sats=(G05,)), simulated=1.0), ephemeris(sats=(E11,)))
    assert store.usable(WEEK, NOON, 120.0).simulated == 1.0
    assert store_of(ephemeris()).usable(WEEK, NOON, 120.0).simulated == 0.0


def test_on_a_recorded_day_the_nearest_valid_ones_serve(data_dir: Path) -> None:
    """Every hour, each satellite in use is within its validity, settled, and the last that was received."""
    navigation = read_navigation(data_dir / "nav_rinex4_2026" / "BRD400DLR_S_20260680000_01D_MN.rnx.gz")
    pending = list(navigation.received(2409, 86400.0))
    store, received = EphemerisStore(), []
    numbers = []
    for tow_s in np.arange(86400.0, 172800.0, 3600.0):
        while pending and seconds_between(pending[0].gps_week, pending[0].tow_s, 2409, tow_s) >= 0.0:
            received.append(pending.pop(0))
            store = store.add(received[-1])
        picked = store.usable(2409, float(tow_s), 120.0)
        for sat in np.flatnonzero(np.isfinite(picked.iod)):
            assert abs(tow_s - picked.toe_tow_s[sat]) <= VALIDITY_S[sat]
            settled = [r for r in received if np.isfinite(r.iod[sat]) and r.tow_s <= tow_s - 120.0]
            valid = [r for r in settled if abs(tow_s - r.toe_tow_s[sat]) <= VALIDITY_S[sat]]
            assert picked.iod[sat] == valid[-1].iod[sat]
        numbers.append((np.isfinite(picked.iod[IS_GPS]).sum(), np.isfinite(picked.iod[IS_GALILEO]).sum()))
    # The file is a worldwide one: all healthy satellites always have an ephemeris. In the spring of 2026 31 GPS
    # satellites (less one unhealthy part of the day), and Galileo less those that its own messages call unhealthy.
    assert min(gps for gps, _ in numbers) >= 29
    assert min(galileo for _, galileo in numbers) >= 23


def test_lookups_are_cheap() -> None:
    store = store_of(*(ephemeris(-600.0 + i, iod=float(i), sats=tuple(range(N_SATS))) for i in range(STORE_DEPTH)))
    wanted = np.full(N_SATS, 2.0)
    for lookup in (lambda: store.usable(WEEK, NOON, 120.0), lambda: store.matching(wanted, WEEK, NOON)):
        # Design: 100 us on one core. The limit is wider, for slow and busy machines.
        assert min(timeit.repeat(lookup, number=5, repeat=20)) / 5 < 4e-4

"""The divergence monitors on recorded receivers and streams; skipped where the data are not."""

from __future__ import annotations

import numpy as np
import pytest

from gbas_core.io.recording import RecordedEpoch
from gbas_core.io.rtcm import read_rtcm
from gbas_core.ranging.divergence import GROUND
from gbas_core.satellites import SAT_INDEX
from gbas_core.signals import BANDS
from gbas_ground.monitors.ccd import CcdParams
from gbas_ground.monitors.ccd_f import TwoFrequencyParams
from gbas_ground.monitors.divergence_forms import threshold
from gbas_studies.ccd.empirical import cross_validated
from gbas_studies.ccd.injected import ANTENNAS_M
from gbas_studies.ccd.recorded import (
    PAIR_L1L2,
    PAIR_L1L5,
    SHORT_SETTLE,
    SINGLE_L1L5,
    SPIRENT_L1L5,
    STORM_FILTERS,
    STORM_SETS,
    monitor_epochs,
    monitor_set,
)

LIMIT = threshold("full_rank", 1e-9)


def single_alarms(seen):
    return sum(int(alarm.sum()) for name, alarm in seen.alarms.items() if name.startswith("gast-d"))


@pytest.mark.parametrize("chosen", [PAIR_L1L5, SPIRENT_L1L5], ids=["pair", "spirent"])
def test_no_false_alarm_at_1_hz(chosen, data_dir):
    seen = monitor_set(chosen, data_dir, SHORT_SETTLE)
    assert np.isfinite(seen.full_rank).sum() > 1000
    assert single_alarms(seen) == 0
    assert not seen.alarms["gast-f-sound"].any()  # even with the covariance of a multipath limiting antenna
    metric, _ = cross_validated(seen)
    assert np.nanmax(metric) < LIMIT


def test_multipath_of_one_ordinary_antenna(data_dir):
    """One satellite's code multipath passes GAST D's threshold; a calibrated covariance knows it from a fault."""
    seen = monitor_set(SINGLE_L1L5, data_dir, SHORT_SETTLE)
    alarm = seen.alarms["gast-d L1"]
    tripped = np.flatnonzero(alarm.any(axis=0))
    assert tripped.tolist() == [SAT_INDEX["G14"]]
    assert single_alarms(seen) == alarm.sum() < 30
    # It is on one code, and not the ionosphere: the divergence-free rate of L1 shows it, that of L5 does not.
    free = np.abs(seen.double_mps[alarm.any(axis=1), 0, :2, tripped[0]])
    assert free[:, 0].max() > 0.0233
    assert free[:, 1].max() < 0.005
    metric, _ = cross_validated(seen)
    assert np.nanmax(metric) < LIMIT
    # The carrier's rate, clear of geometry, clocks and troposphere, is quiet to a fraction of a millimetre a second.
    assert np.sqrt(np.nanmean(seen.double_mps[:, :, 2] ** 2)) < 0.0005


@pytest.mark.campaign
def test_an_hour_of_two_receivers(data_dir):
    seen = monitor_set(PAIR_L1L2, data_dir, GROUND)
    assert single_alarms(seen) == 0
    metric, fewest = cross_validated(seen)
    assert fewest > 200.0
    assert np.nanmax(metric) < LIMIT
    assert np.isnan(seen.published).all()  # its covariance is of L1 and L5


def storm_part(number, data_dir, hours):
    """Some hours of a day of the storm set."""
    chosen = STORM_SETS[number]
    recording = chosen.open(data_dir)
    first, last = (int(recording.keys[0]) + round(hour * 3.6e6) for hour in hours)
    params = TwoFrequencyParams(other_band=BANDS[chosen.other], filters=STORM_FILTERS)
    return monitor_epochs(
        recording.epochs(first=first, last=last), recording.ephemerides(), chosen.antennas_m(recording),
        CcdParams(filters=STORM_FILTERS), params,
    )  # fmt: skip


def test_the_storm_trips_one_frequency_and_not_two(data_dir):
    storm = storm_part(0, data_dir, (19.5, 22.5))
    assert storm.alarms["gast-d L1"].any(axis=0).sum() >= 2
    assert storm.alarms["gast-d L2"].any(axis=0).sum() >= 5
    assert np.isfinite(storm.full_rank).sum() > 1000
    assert not storm.alarms["gast-f-sound"].any()


def test_a_quiet_day_trips_nothing(data_dir):
    quiet = storm_part(2, data_dir, (19.5, 22.5))
    assert np.isfinite(quiet.full_rank).sum() > 1000
    assert not any(alarm.any() for alarm in quiet.alarms.values())


@pytest.mark.campaign
@pytest.mark.parametrize("number", range(4))
def test_whole_days_of_the_storm(number, data_dir):
    seen = monitor_set(STORM_SETS[number], data_dir, STORM_FILTERS)
    tripped = int((seen.alarms["gast-d L1"] | seen.alarms["gast-d L2"]).any(axis=0).sum())
    assert tripped >= 10 if number < 2 else tripped == 0
    assert np.isfinite(seen.full_rank).sum() > 15_000
    assert not seen.alarms["gast-f-sound"].any()


@pytest.mark.parametrize(
    ("name", "lost", "longest_s"), [("fw206mrtk_rtcm.rtcm3", 0, 1.0), ("ROVRMSG.bin", 2, 73.0)]
)  # fmt: skip
def test_streams_with_gaps_are_survived(name, lost, longest_s, data_dir):
    """RTCM without ephemerides: what needs geometry is not monitored, the rest is, and begins anew after the gaps."""
    stream = read_rtcm(data_dir / "raw_streams" / name, gps_week=2300)
    epochs = [
        RecordedEpoch(key=int(key), ground=(stream.epoch(row),), user=None) for row, key in enumerate(stream.keys)
    ]
    seen = monitor_epochs(
        epochs, (), np.array(ANTENNAS_M[:1]), CcdParams(filters=SHORT_SETTLE), TwoFrequencyParams(filters=SHORT_SETTLE)
    )
    assert seen.epochs_lost == lost
    gaps_s = np.diff(seen.time_s)
    assert gaps_s.max() == longest_s
    counts = np.isfinite(seen.single_mean_mps[:, 0]).any(axis=1)
    for place in np.flatnonzero(gaps_s > SHORT_SETTLE.max_gap_s) + 1:
        assert not counts[place : place + 207].any()
    assert counts.sum() > 400
    assert np.isnan(seen.full_rank).all()
    assert not any(alarm.any() for alarm in seen.alarms.values())

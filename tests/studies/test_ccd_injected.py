"""The divergence monitors on four simulated receivers: quiet, under an ionospheric front, with faults."""

from __future__ import annotations

import numpy as np
import pytest

from gbas_core.ranging.divergence import GROUND
from gbas_core.ranging.fault_modes import FAULT_MODES
from gbas_studies.ccd.injected import (
    campaign,
    front_over_station,
    inject,
    monitored,
    nominal_world,
    settled_base,
)

RATES = (0.02, 0.1)


@pytest.fixture(scope="module")
def covariance():
    return monitored(nominal_world(410.0, seed=1001)).calibrated(GROUND.tau_s).covariance


@pytest.fixture(scope="module")
def base(covariance):
    return settled_base(nominal_world(480.0), 200, covariance=covariance)


def test_a_front_trips_one_frequency_and_leaves_two_as_they_were(covariance):
    quiet = monitored(nominal_world(410.0), covariance=covariance)
    front = monitored(nominal_world(410.0, fronts=(front_over_station(start_s=365.0),)), covariance=covariance)
    assert not any(alarm.any() for alarm in quiet.alarms.values() if alarm is not quiet.alarms["gast-f-paper"])
    assert front.alarms["gast-d L1"].any(axis=0).sum() >= 3
    assert front.alarms["gast-d L5"].any(axis=0).sum() >= 3
    assert not front.alarms["gast-f-sound"].any()
    # The delay moves the path's time of transmission by nanoseconds; nothing else may change.
    assert np.nanmax(np.abs(front.full_rank - quiet.full_rank)) < 0.05


@pytest.mark.parametrize("mode", FAULT_MODES)
def test_faults_are_found_when_the_closed_form_says(base, mode):
    satellite = base.highest()[0]
    for rate in RATES:
        found = inject(base, mode, rate, satellite)
        due, seen = found.expected_s["gast-f-sound"], found.times_s["gast-f-sound"]
        assert found.others == 0
        if due < 60.0:
            # Noise moves the alarm: the metric passes its threshold within a fifth of the time, or a few seconds.
            assert seen == pytest.approx(due, rel=0.35, abs=4.0)


@pytest.mark.parametrize("mode", ["Code L1", "Carrier L1", "Code+Carrier L1"])
def test_single_frequency_takes_longer(base, mode):
    found = inject(base, mode, 0.1, base.highest()[0])
    due = found.expected_s["gast-d L1"]
    assert found.times_s["gast-d L1"] == pytest.approx(due, rel=0.3, abs=4.0)
    assert found.times_s["gast-f-sound"] <= found.times_s["gast-d L1"]
    assert np.isnan(found.expected_s["gast-d L5"])
    assert np.isnan(found.times_s["gast-d L5"])


def test_campaign_is_the_product(base):
    satellites = base.highest()[:2]
    found = campaign(base, ("Carrier L5",), (0.1,), satellites)
    assert [each.satellite for each in found] == [inject(base, "Carrier L5", 0.1, s).satellite for s in satellites]

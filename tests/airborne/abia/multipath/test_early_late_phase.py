"""Early-late phase: closed forms of noise and echoes, the paper's detection and false alarms, what it cannot see."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gbas_airborne.abia.multipath.early_late_phase import (
    THRESHOLD_RAD,
    EarlyLateParams,
    correlators,
    detection_share,
    early_late_phase_rad,
    false_alarm_share,
    noise_sigma_rad,
    noisy_phase_rad,
    threshold_rad,
)

PARAMS = EarlyLateParams()


def test_one_echo_by_hand():
    """d = 0.5, an echo of 0.5 square to the signal and 0.5 chips late: early 0.5 + 0i, late 0.5 + 0.5i: 45 degrees."""
    early, late = correlators(PARAMS, 0.5, 0.5j)
    assert (complex(early), complex(late)) == (0.5 + 0.0j, 0.5 + 0.5j)
    assert float(early_late_phase_rad(early, late)) == pytest.approx(math.pi / 4.0)
    # The loop's own phase turns both and leaves the difference, as that of two arc tangents.
    turned = early_late_phase_rad(early * np.exp(0.3j), late * np.exp(0.3j))
    assert float(turned) == pytest.approx(math.pi / 4.0)
    assert math.atan(0.5 / 0.5) - math.atan(0.0) == pytest.approx(math.pi / 4.0)  # eq (41) corrected


def test_no_echo_no_phase():
    early, late = correlators(PARAMS, 0.3, 0.0)
    assert float(early_late_phase_rad(early, late)) == 0.0


@pytest.mark.parametrize("spacing_chips", [0.1, 0.25, 0.5])
def test_noise_is_the_closed_form(spacing_chips):
    """At 60 dB-Hz phases are small; 1 % of 200,000 draws."""
    params = EarlyLateParams(spacing_chips=spacing_chips)
    none = np.zeros(200_000)
    drawn = noisy_phase_rad(params, 60.0, (none, none), seed=7)
    assert np.std(drawn) == pytest.approx(float(noise_sigma_rad(params, 60.0)), rel=0.01)
    threshold = threshold_rad(params, 60.0, 0.1)
    assert false_alarm_share(params, 60.0, threshold) == pytest.approx(0.1, abs=0.003)
    with pytest.raises(ValueError, match="false_alarm = 1.0"):
        threshold_rad(params, 60.0, 1.0)


def test_false_alarms_of_the_paper():
    """Figure 22: 0.3 at 0.1 rad and 42 dB-Hz; the paper gives no correlators: 0.30 at d = 0.45, 0.37 at d = 0.5."""
    assert float(false_alarm_share(EarlyLateParams(spacing_chips=0.45), 42.0, THRESHOLD_RAD)) == pytest.approx(
        0.30, abs=0.01
    )
    assert float(false_alarm_share(PARAMS, 42.0, THRESHOLD_RAD)) == pytest.approx(0.37, abs=0.01)
    # At 1 s hardly any are left.
    assert float(false_alarm_share(EarlyLateParams(integration_s=1.0), 42.0, THRESHOLD_RAD)) < 1e-3


def test_detection_of_the_paper():
    """Figure 21: about 80 % at 0.1 rad, with delays up to 1.5 chips and amplitudes of 0.5 to 0.7."""
    for amplitude in (0.5, 0.7):
        found = float(detection_share(PARAMS, 42.0, amplitude, THRESHOLD_RAD))
        assert found == pytest.approx(0.8, abs=0.03)
    thresholds = np.linspace(0.0, 1.0, 11)
    curve = detection_share(PARAMS, 42.0, 0.5, thresholds)
    assert curve[0] == pytest.approx(1.0, abs=1e-4)
    assert (np.diff(curve) <= 0.0).all()
    assert (detection_share(PARAMS, 42.0, 0.7, thresholds)[1:] > curve[1:]).all()


def test_echoes_of_the_airframe_are_not_seen():
    """Both correlators turn alike: a fin's echo, 1.2 m late, is 0.011 rad at any phase, a ninth of the threshold.

    By hand: both correlators are 0.75 with the echo square to the signal, 2 x 1.2/293 x 0.5 / 0.75^2 apart, at most
    2 x 0.0041 x 0.5 / (0.5 (1 - 0.25)) over all phases.
    """
    phases = np.exp(2j * np.pi * np.arange(360) / 360)
    early, late = correlators(PARAMS, 1.2 / 293.05, 0.5 * phases)
    assert np.abs(early_late_phase_rad(early, late)).max() == pytest.approx(0.0109, abs=1e-4)

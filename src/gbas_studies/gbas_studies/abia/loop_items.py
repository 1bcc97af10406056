"""Tracking loops: equations (42) to (56), and the margins of the cautions."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from gbas_core.parameters import replaced
from gbas_core.signal.loop_thresholds import (
    PHASE_LIMIT_RAD,
    LoopParams,
    Motion,
    cn0_thresholds,
    jamming_margin_db,
    oscillator_rad,
    phase_stress_rad,
    phase_three_sigma_rad,
    vibration_rad,
)
from gbas_studies.reproduction.drawing import limit_line, new_figure
from gbas_studies.reproduction.items import Claim, Picture, Section, Value

JERK: Final = Motion(jerk_mps3=98.0)
_STILL: Final = Motion()
_WITH: Final = "third order, vibration and oscillator as the paper's"


def loop_section() -> Section:
    """Jitter, stress and thresholds of the fighter's receiver."""
    return Section(
        title="Tracking loops: equations (42) to (56)",
        text="Third-order Costas loop of 18 Hz; 1e-9 per g, 0.005 g²/Hz from 20 to 2000 Hz; Allan deviation 1e-10.",
        items=[*_jitter_items(), *_threshold_items(), *_aiding_items()],
        pictures=[_jitter_picture()],
    )


def _jitter_items() -> list[Value | Claim]:
    params = LoopParams()
    degrees_ps3 = 98.0 * 360.0 * 1575.42e6 / 299_792_458.0
    stress = math.degrees(float(phase_stress_rad(params, JERK)))
    oscillator = math.degrees(oscillator_rad(params))
    return [
        Value(name="vibration", ours=math.degrees(vibration_rad(params)), unit="deg", definition="eq (46)"),
        Value(name="oscillator", ours=oscillator, unit="deg", definition="eq (48), the factor 160 in degrees"),
        Claim(
            name="eq (47), (48) in radians",
            holds=oscillator > 45.0,
            paper_text="144 and 160 times sigma f / B are radians",
            ours_text=f"degrees: {oscillator:.3f}; as radians it would be {oscillator * 57.3:.0f}° and no loop held",
            definition="eq (48) with the paper's oscillator",
            why="The unit is misprinted; Kaplan and Hegarty have degrees.",
        ),
        Value(
            name="10 g/s on L1",
            ours=degrees_ps3,
            paper="185398",
            unit="deg/s³",
            definition="98 m/s³ x 360° x f / c (the text has 98/s³)",
            kind="input",
        ),
        Value(
            name="eq (49), factor", ours=0.7845**3, paper="0.4828", unit="", definition="0.7845³", kind="coefficient"
        ),
        Value(name="dynamic stress", ours=stress, unit="deg", definition="eq (49) at 18 Hz, third derivative of R"),
        Value(
            name="caution of the phase loop",
            ours=math.degrees(0.95 * PHASE_LIMIT_RAD),
            paper="42.25",
            unit="deg",
            definition="45° less 5 %",
            why="Misprint: 0.95 x 45° is 42.75°; likewise 0.2375/T and 0.95 d for frequency and code loops.",
        ),
    ]


def _threshold_items() -> list[Value | Claim]:
    found = {
        (bandwidth, integration_ms, moving): cn0_thresholds(
            LoopParams(phase_bandwidth_hz=bandwidth, integration_s=1e-3 * integration_ms), JERK if moving else _STILL
        )
        for bandwidth in (15.0, 18.0)
        for integration_ms in (5.0, 20.0)
        for moving in (False, True)
    }
    items: list[Value | Claim] = [
        Value(
            name=f"threshold, {bandwidth:g} Hz, {integration_ms:g} ms, {'10 g/s' if moving else 'no jerk'}",
            ours=each.phase_dbhz,
            unit="dB-Hz",
            definition=f"root of eq (43), {_WITH}",
        )
        for (bandwidth, integration_ms, moving), each in found.items()
    ]
    every = [each.phase_dbhz for each in found.values()]
    stressed = [each.phase_dbhz for (bandwidth, _, moving), each in found.items() if moving and bandwidth == 15.0]
    items.append(
        Claim(
            name="25 to 28 dB-Hz for 15 to 18 Hz and 5 to 20 ms",
            holds=min(every) >= 24.5 and max(every) <= 28.5,
            paper_text="rule of thumb of the phase loop's threshold: 25 to 28 dB-Hz",
            ours_text=f"{min(every):.1f} to {max(every):.1f} dB-Hz",
            definition=f"both ends of both ranges, with and without 10 g/s, {_WITH}",
            why=f"That is the range of 18 Hz with and without the jerk; 15 Hz with it is {max(stressed):.1f} dB-Hz.",
        )
    )
    weak = found[18.0, 20.0, True]
    items.append(
        Claim(
            name="the carrier loop is the weak link",
            holds=weak.phase_dbhz == weak.all_dbhz,
            paper_text="unaided, the phase loop is lost first",
            ours_text=f"{weak.phase_dbhz:.1f}, frequency {weak.frequency_dbhz:.1f}, code {weak.code_dbhz:.1f} dB-Hz",
            definition="18 Hz, 20 ms, 10 g/s; frequency loop of second order and 10 Hz, code loop of 1 Hz: ours",
            why="Depends on the other loops, of which the paper gives no numbers.",
        )
    )
    return items


def _aiding_items() -> list[Value | Claim]:
    given = _lowest_aided_dbhz(LoopParams(aiding_residual=0.0))
    better = _lowest_aided_dbhz(LoopParams(aiding_residual=0.0, allan_deviation=1e-11, vibration_g2phz=0.0))
    return [
        Claim(
            name="15 to 18 dB-Hz with velocity aiding",
            holds=given <= 18.0,
            paper_text="a threshold of about 15 to 18 dB-Hz can be achieved",
            ours_text=f"{given:.1f} dB-Hz at best; {better:.1f} with a tenth of the Allan deviation and no vibration",
            definition="all of the motion taken by the aiding, the best bandwidth from 1 to 18 Hz, 20 ms",
            why="Narrower, the paper's own oscillator breaks the loop: its jitter goes with 1 / bandwidth.",
        ),
        Value(
            name="J/S at 44 dB-Hz, unaided with 10 g/s",
            ours=float(jamming_margin_db(44.0, cn0_thresholds(LoopParams(), JERK).phase_dbhz)),
            unit="dB",
            definition="10 log(1.5 R_c (1/threshold - 1/C/N0)), a jammer with the signal's spectrum",
        ),
        Value(
            name="J/S at 44 dB-Hz, aided",
            ours=float(jamming_margin_db(44.0, given)),
            unit="dB",
            definition="the same, with the best aided threshold",
        ),
    ]


def _lowest_aided_dbhz(params: LoopParams) -> float:
    """Threshold at the bandwidth that is best for it."""
    return min(
        cn0_thresholds(replaced(params, {"phase_bandwidth_hz": float(each)}), JERK).phase_dbhz
        for each in np.arange(1.0, 18.1, 0.25)
    )


def _jitter_picture() -> Picture:
    cn0 = np.linspace(20.0, 50.0, 301)
    curves = {
        "still, 20 ms": phase_three_sigma_rad(LoopParams(), cn0, _STILL),
        "still, 5 ms": phase_three_sigma_rad(LoopParams(integration_s=0.005), cn0, _STILL),
        "10 g/s, 20 ms": phase_three_sigma_rad(LoopParams(), cn0, JERK),
        "10 g/s, 5 ms": phase_three_sigma_rad(LoopParams(integration_s=0.005), cn0, JERK),
    }
    figure = new_figure()
    axis = figure.axes[0]
    for name, values in curves.items():
        axis.plot(cn0, np.degrees(values), label=name)
    limit_line(axis, 45.0, "lost: 45°")
    axis.set_xlabel("C/N0 [dB-Hz]")
    axis.set_ylabel("three sigma with dynamic error [deg]")
    axis.set_ylim(0.0, 90.0)
    axis.legend()
    return Picture(
        name="phase-jitter",
        title="Phase jitter over C/N0",
        caption="Third-order loop of 18 Hz, with the paper's vibration and oscillator.",
        figure=figure,
        data={"cn0_dbhz": cn0} | {f"{name} [deg]": np.degrees(values) for name, values in curves.items()},
    )

"""Multipath: figures 14, 21, 22, equations (21) to (35), (40), (41)."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from gbas_airborne.abia.airframe.aircraft import fighter
from gbas_airborne.abia.multipath.airframe_echoes import airframe_echoes, error_envelope, reached_by_ground_m
from gbas_airborne.abia.multipath.early_late_phase import (
    THRESHOLD_RAD,
    EarlyLateParams,
    correlators,
    detection_share,
    early_late_phase_rad,
    false_alarm_share,
)
from gbas_core.signal.antenna import ANTENNAS
from gbas_core.signal.tracking_loops import BPSK_1
from gbas_core.signals import SPEED_OF_LIGHT_MPS
from gbas_studies.reproduction.drawing import limit_line, new_figure
from gbas_studies.reproduction.items import Claim, Picture, Section, Value
from gbas_studies.reproduction.registry import Options

_THRESHOLDS_RAD: Final = np.linspace(0.0, 1.0, 101)
_AMPLITUDES: Final = (0.1, 0.3, 0.5, 0.7)
_CN0_DBHZ: Final = (36.0, 39.0, 42.0, 45.0, 48.0)
_RECEIVER: Final = EarlyLateParams()


def echo_section(options: Options) -> Section:
    """Echoes of the fighter, and the observable that is to detect them."""
    return Section(
        title="Multipath: figures 14, 21, 22, equations (21) to (35), (40), (41)",
        text=(
            "Delays are by the method of images on the mesh, every triangle a flat metal mirror: amplitudes are upper "
            "bounds. The paper leaves out the correlators of figures 21 and 22: early to late one chip, 20 ms."
        ),
        items=[*_delay_items(options.seed), *_misprint_items(), *_detection_items(options.seed)],
        pictures=[_phasor_picture(), _detection_picture(options.seed), _false_alarm_picture(options.seed)],
    )


def _delay_items(seed: int) -> list[Value | Claim]:
    random = np.random.default_rng([seed, 16])
    directions = random.uniform(0.0, 2.0 * math.pi, 3000), np.arcsin(random.uniform(0.0872, 1.0, 3000))
    aircraft = fighter()
    echoes = airframe_echoes(aircraft.airframe, aircraft.antenna("upper"), ANTENNAS["fighter"], directions)
    parts = np.array(echoes.part)
    longest = {part: float(echoes.delay_m[parts == part].max()) for part in sorted(set(echoes.part))}
    errors = error_envelope(echoes.delay_m, echoes.amplitude, BPSK_1, 1.0)
    worst = float(np.maximum(errors.code_highest_m, -errors.code_lowest_m).max())
    early, late = correlators(
        _RECEIVER, max(longest.values()) / BPSK_1.chip_m, 0.5 * np.exp(2j * np.pi * np.arange(360) / 360)
    )
    seen = float(np.abs(early_late_phase_rad(early, late)).max())
    share = float(np.mean(parts == "fuselage"))
    return [
        Value(
            name="delay of the fuselage's echo at the zenith",
            ours=longest["fuselage"] / SPEED_OF_LIGHT_MPS,
            paper="1.7e-10",
            unit="s",
            definition="2 x 5 cm sin(E) / c, the longest of 3000 directions above 5°",
            why="The paper takes the height once, 0.05 m / c: the extra path is twice that.",
        ),
        Claim(
            name="fuselage reflection is the main contribution",
            holds=share > 0.5,
            paper_text="the fuselage dominates, wings and ground are small",
            ours_text=f"{100.0 * share:.0f} % of the echoes are the fuselage's",
            definition="number of echoes above 5° of elevation, by part",
            why="Other parts have more.",
        ),
        Claim(
            name="multipath range error beyond 1 m, from the airframe",
            holds=worst > 1.0,
            paper_text="a warning for an error of more than 1 m",
            ours_text=f"at most {worst:.2f} m; longest delays "
            + ", ".join(f"{part} {value:.2f} m" for part, value in longest.items()),
            definition="worst phase of each echo, early to late one chip, without limits of bandwidth",
            why="An error of 1 m takes a delay of 1 m at an amplitude of 0.5: these are shorter or weaker.",
        ),
        Claim(
            name="early-late phase sees echoes of the airframe",
            holds=seen > THRESHOLD_RAD,
            paper_text="0.1 rad detects multipath",
            ours_text=f"{seen:.3f} rad at most",
            definition="the longest of these delays, at an amplitude of 0.5, the worst phase",
            why="Both correlators turn alike with an echo that is late by thousandths of a chip.",
        ),
    ]


def _misprint_items() -> list[Value | Claim]:
    return [
        Value(
            name="eq (35): 1.5 µs",
            ours=1.5e-6 * SPEED_OF_LIGHT_MPS,
            paper="448.5",
            unit="m",
            definition="1.5 µs x c",
            tolerance=1.5,
            why="The paper's product is 0.3 % off.",
        ),
        Value(
            name="eq (35): bound of h sin E",
            ours=float(reached_by_ground_m(1e6, 0.5 * math.pi)),
            paper="448.5",
            unit="m",
            definition="half of 1.5 µs x c: by eq (34) the delay is 2 h sin(E)",
            why="The paper bounds h sin(E) by the whole delay.",
        ),
    ]


def _detection_items(seed: int) -> list[Value | Claim]:
    alarm = {
        spacing: float(false_alarm_share(EarlyLateParams(spacing_chips=spacing), 42.0, THRESHOLD_RAD, seed=seed))
        for spacing in (0.5, 0.45)
    }
    detected = {each: float(detection_share(_RECEIVER, 42.0, each, THRESHOLD_RAD, seed=seed)) for each in (0.5, 0.7)}
    why = "The paper does not give amplitude, delays and correlators."
    return [
        Value(
            name="figure 21: detection at 0.1 rad",
            ours=detected[0.5],
            paper="0.8",
            unit="",
            definition="amplitude 0.5, delays even up to 1.5 chips, phases even, 42 dB-Hz, d = 0.5, 20 ms",
            tolerance=0.05,
            why=why,
        ),
        Value(
            name="figure 21: detection at 0.1 rad, stronger",
            ours=detected[0.7],
            unit="",
            definition="the same with amplitude 0.7",
        ),
        Value(
            name="figure 22: false alarms at 0.1 rad, 42 dB-Hz",
            ours=alarm[0.5],
            paper="0.3",
            unit="",
            definition="noise alone, early to prompt 0.5 chips, 20 ms",
            tolerance=0.1,
            why=f"With 0.45 chips it is {alarm[0.45]:.2f}; the paper gives neither spacing nor time.",
        ),
        Value(
            name="false alarms with 1 s",
            ours=float(false_alarm_share(EarlyLateParams(integration_s=1.0), 42.0, THRESHOLD_RAD, seed=seed)),
            unit="",
            definition="the same, correlators summed over 1 s: what a caution needs to be of use",
        ),
    ]


def _phasor_picture() -> Picture:
    angle = np.linspace(0.0, 360.0, 361)
    curves = {
        f"A_m / A_d = {each:g}": np.abs(1.0 + each * np.exp(1j * np.radians(angle))) for each in (0.1, 0.25, 0.5, 0.9)
    }
    figure = new_figure()
    axis = figure.axes[0]
    for name, values in curves.items():
        axis.plot(angle, values, label=name)
    axis.set_xlabel("phase of the echo β [deg]")
    axis.set_ylabel("amplitude of the sum over the direct signal's")
    axis.legend()
    return Picture(
        name="fig-14",
        title="Figure 14: amplitude of the sum by the phase of the echo",
        caption="Eq (21).",
        figure=figure,
        data={"beta_deg": angle} | curves,
    )


def _detection_picture(seed: int) -> Picture:
    curves = {
        f"α = {each:g}": detection_share(_RECEIVER, 42.0, each, _THRESHOLDS_RAD, seed=seed) for each in _AMPLITUDES
    }
    return _curves("fig-21", "Figure 21: echoes detected, by threshold", "42 dB-Hz, 20 ms, d = 0.5.", curves)


def _false_alarm_picture(seed: int) -> Picture:
    curves = {f"{each:g} dB-Hz": false_alarm_share(_RECEIVER, each, _THRESHOLDS_RAD, seed=seed) for each in _CN0_DBHZ}
    return _curves("fig-22", "Figure 22: false alarms, by threshold", "Noise alone, 20 ms, d = 0.5.", curves)


def _curves(name: str, title: str, caption: str, curves: dict[str, np.ndarray]) -> Picture:
    figure = new_figure()
    axis = figure.axes[0]
    for label, values in curves.items():
        axis.plot(_THRESHOLDS_RAD, values, label=label)
    limit_line(axis, 0.8 if name == "fig-21" else 0.3, "the paper's at 0.1 rad")
    axis.set_xlabel("threshold [rad]")
    axis.set_ylabel("share")
    axis.legend()
    return Picture(
        name=name, title=title, caption=caption, figure=figure, data={"threshold_rad": _THRESHOLDS_RAD} | curves
    )

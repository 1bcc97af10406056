"""Antennas and link budget: figures 10 and 11, equations (12) to (20), (57) to (59)."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from gbas_core.record import FloatArray
from gbas_core.satellites import N_SATS
from gbas_core.signal.antenna import ANTENNAS, oxygen_loss_db, paper_beam_db, slant_range_m
from gbas_core.signal.link_budget import SignalCriteria, TransmitBudget, scintillation_db
from gbas_core.signals import FREQUENCY_HZ, L1
from gbas_studies.reproduction.drawing import new_figure
from gbas_studies.reproduction.items import Claim, Picture, Section, Value

_GPS: Final = 0
_L1_HZ: Final = float(FREQUENCY_HZ[L1])


def _at(elevation_deg: ArrayLike) -> FloatArray:
    return np.asarray(np.radians(np.atleast_1d(np.asarray(elevation_deg)))[:, np.newaxis] * np.ones(N_SATS))


def _cn0_dbhz(elevation_deg: ArrayLike) -> FloatArray:
    return np.asarray(TransmitBudget().cn0_dbhz(_at(elevation_deg))[:, L1, _GPS])


def link_section() -> Section:
    """Link budget of a GPS satellite at the fighter's antenna."""
    return Section(
        title="Antennas and link budget: figures 10 and 11, equations (12) to (20)",
        text="GPS L1 C/A, EIRP 26.8 dBW, noise figure 3 dB, the fighter's antenna.",
        items=[*_antenna_items(), *_term_items(), *_criteria_items()],
        pictures=[_gain_picture(), _cn0_picture()],
    )


def _antenna_items() -> list[Value | Claim]:
    pattern = ANTENNAS["fighter"]
    low, zenith = (float(pattern.gain_at_dbic(math.radians(each))) for each in (10.0, 90.0))
    edge, nearest = slant_range_m(_at(np.array([0.0, 90.0])))[:, _GPS]
    viewing = 2.0 * math.degrees(math.asin(6_378_137.0 / 26_559_700.0))
    return [
        Value(name="eq (15), 10°", ours=low, paper="-3", unit="dBic", definition="7.8659 sin E - 4.3659"),
        Value(name="eq (15), 90°", ours=zenith, paper="3.5", unit="dBic", definition="7.8659 sin E - 4.3659"),
        Value(
            name="figure 10, viewing angle of the Earth",
            ours=viewing,
            paper="27.7",
            unit="deg",
            definition="twice the arc sine of the Earth's radius over the orbit's (26,559.7 km)",
            tolerance=0.1,
            why="27.8°: the paper's radii are not given.",
        ),
        Value(
            name="path length from edge to zenith",
            ours=20.0 * math.log10(edge / nearest),
            paper="2.1",
            unit="dB",
            definition="20 log of the distances at 0° and 90° of elevation",
        ),
        Claim(
            name="eq (14), satellites' beam",
            holds=bool(paper_beam_db(math.radians(10.0)) > paper_beam_db(math.radians(90.0))),
            paper_text="2.5 dB less towards the edge of the Earth",
            ours_text="GPS shapes its beam to favour the edge",
            definition="2.5413 sin E - 2.5413 with E the elevation: what reproduces 38.1 dB-Hz below",
            why="Physically reversed: the beam is shaped so that the ground is lit evenly. Kept as beam: paper.",
        ),
    ]


def _term_items() -> list[Value | Claim]:
    low, zenith = _cn0_dbhz(np.array([10.0, 90.0]))
    terms = TransmitBudget().terms(_at(90.0))
    literal = float(terms.cn0_dbhz[0, L1, _GPS]) + terms.noise_dbwphz - 3.0
    branch = 2.0 * 0.035 / (math.sin(math.radians(10.0)) + 0.043)
    exact = float(oxygen_loss_db(math.radians(10.0)))
    rising = scintillation_db(np.radians([5.0, 90.0]), _L1_HZ)
    return [
        Value(name="C/N0 at 10°", ours=float(low), unit="dB-Hz", definition="eq (12) with N0 = k 290 K F"),
        Value(name="C/N0 at 90°", ours=float(zenith), unit="dB-Hz", definition="eq (12) with N0 = k 290 K F"),
        Claim(
            name="eq (12) as printed",
            holds=abs(literal - float(zenith)) < 1.0,
            paper_text="C/N0 of transmitted power, gains, losses and noise figure",
            ours_text=f"{literal:.1f} dB at the zenith",
            definition="every term as printed",
            why="The noise density k T0, -203.98 dBW/Hz, is missing.",
        ),
        Value(
            name="oxygen at the zenith",
            ours=float(oxygen_loss_db(0.5 * math.pi)),
            paper="0.035",
            unit="dB",
            definition="eq (16)",
            kind="input",
        ),
        Claim(
            name="eq (16), branches",
            holds=abs(branch / exact - 1.0) < 0.1,
            paper_text="2 A / (sin E + 0.043) from 3° to 10°",
            ours_text=f"{branch:.3f} dB at 10°, {exact:.3f} dB by the whole form",
            definition="both forms of eq (16) at 10°",
            why="The low branch is 63 % too large where it begins: the whole form is used at all elevations.",
        ),
        Value(
            name="eq (18), constant",
            ours=float(rising[1]),
            paper="0.0326",
            unit="dB",
            definition="0.025 f^(7/12), f in GHz, at the zenith",
        ),
        Claim(
            name="eq (17), exponent",
            holds=bool(rising[0] < rising[1]),
            paper_text="csc(E)^-0.85: more scintillation at high elevations",
            ours_text="csc(E)^+0.85",
            definition="scintillation at 5° against 90°",
            why="The sign is misprinted: the paper's own text has it grow at low elevations.",
        ),
    ]


def _criteria_items() -> list[Value | Claim]:
    criteria = SignalCriteria()
    return [
        Value(
            name="processing gain",
            ours=criteria.processing_gain_db,
            paper="43",
            unit="dB",
            definition="10 log(1.023 MHz x 20 ms); eq (58) as printed, 2 C_R / T_D, is 80 dB",
        ),
        Claim(
            name="C/N0 below 25 and 27 dB-Hz",
            holds=criteria.warning_dbhz <= criteria.warning_cn0_dbhz,
            paper_text="a criterion beside 10 and 12 dB after correlation",
            ours_text=f"the latter are {criteria.warning_dbhz:.1f} and {criteria.caution_dbhz:.1f} dB-Hz",
            definition="C/N0 - 10 log(2.046 MHz) + 43.1 dB",
            why="10 dB after correlation are 30 dB-Hz: the rule of 25 never binds. Both are kept, named apart.",
        ),
    ]


def _gain_picture() -> Picture:
    elevation = np.linspace(0.0, 90.0, 181)
    receiver, satellite = ANTENNAS["fighter"].gain_at_dbic(np.radians(elevation)), paper_beam_db(np.radians(elevation))
    figure = new_figure()
    axis = figure.axes[0]
    axis.plot(elevation, receiver, label="receiver, eq (15)")
    axis.plot(elevation, satellite, label="satellite, eq (14)")
    axis.set_xlabel("elevation [deg]")
    axis.set_ylabel("gain [dBic], [dB]")
    axis.legend()
    return Picture(
        name="fig-11",
        title="Figure 11: antennas",
        caption="Gains by elevation, in the antenna's frame and above the horizon.",
        figure=figure,
        data={"elevation_deg": elevation, "receiver_dbic": receiver, "satellite_db": satellite},
    )


def _cn0_picture() -> Picture:
    elevation = np.linspace(3.0, 90.0, 175)
    cn0 = _cn0_dbhz(elevation)
    figure = new_figure()
    axis = figure.axes[0]
    axis.plot(elevation, cn0)
    axis.set_xlabel("elevation [deg]")
    axis.set_ylabel("C/N0 [dB-Hz]")
    return Picture(
        name="cn0-elevation",
        title="C/N0 over elevation",
        caption="GPS L1 C/A at the fighter's antenna, wings level.",
        figure=figure,
        data={"elevation_deg": elevation, "cn0_dbhz": cn0},
    )

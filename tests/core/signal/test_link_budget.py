"""Link budget by what satellites send: the paper's numbers, its misprints, each term by hand, and the criteria."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from gbas_core.satellites import IS_GPS, N_SATS
from gbas_core.signal.antenna import ANTENNAS, slant_range_m
from gbas_core.signal.link_budget import SignalCriteria, TransmitBudget, scintillation_db
from gbas_core.signals import FREQUENCY_HZ, L1, L2, L5

TABLE = yaml.safe_load((Path(__file__).parents[2] / "tables" / "abia_paper.yaml").read_text(encoding="utf-8"))


def at(*elevation_deg: float) -> np.ndarray:
    return np.radians(np.array(elevation_deg))[:, np.newaxis] * np.ones(N_SATS)


@pytest.mark.parametrize("row", TABLE["link_budget"], ids=str)
def test_budget_of_the_paper(row):
    """Known to a tenth."""
    assert TransmitBudget().cn0_dbhz(at(row["elevation_deg"]))[0, L1, 0] == pytest.approx(row["cn0_dbhz"], abs=0.05)


@pytest.mark.parametrize("row", TABLE["antenna_dbic"], ids=str)
def test_antenna_of_the_paper(row):
    gain = ANTENNAS["fighter"].gain_at_dbic(math.radians(row["elevation_deg"]))
    assert float(gain) == pytest.approx(row["gain_dbic"], abs=1e-3)


def test_antenna_between_the_points_of_its_table():
    elevation = np.radians(np.linspace(0.0, 90.0, 91))
    exact = 7.8659 * np.sin(elevation) - 4.3659  # eq (15)
    np.testing.assert_allclose(ANTENNAS["fighter"].gain_at_dbic(elevation), exact, atol=0.01)


@pytest.mark.parametrize("elevation_deg", [10.0, 35.0, 90.0])
def test_budget_by_hand(elevation_deg):
    """Eq (12) with the corrected terms, logarithms of the distance by the law of cosines."""
    elevation = math.radians(elevation_deg)
    sine = math.sin(elevation)
    distance = -6378.137e3 * sine + math.sqrt((6378.137e3 * sine) ** 2 + 26_559_700.0**2 - 6378.137e3**2)
    spread = 20.0 * math.log10(4.0 * math.pi * distance * 1575.42e6 / 299_792_458.0)
    height = 6.0 / 6378.0
    oxygen = 0.07 * (1.0 + height / 2.0) / (sine + math.sqrt(sine**2 + 2.0 * height + height**2))
    turbulence = 0.0326 * (1.0 / sine) ** 0.85
    gains = 2.5413 * sine - 2.5413 + 7.8659 * sine - 4.3659
    expected = 26.8 + gains - spread - oxygen - turbulence + 203.98 - 3.0
    assert TransmitBudget().cn0_dbhz(at(elevation_deg))[0, L1, 0] == pytest.approx(expected, abs=0.02)


def test_misprints():
    """Without the noise density eq (12) gives -155 dB; "falling" scintillation; 80 dB of processing gain."""
    terms = TransmitBudget().terms(at(90.0))
    assert terms.noise_dbwphz == pytest.approx(-203.98 + 3.0, abs=5e-3)
    literal = terms.cn0_dbhz[0, L1, 0] + terms.noise_dbwphz - 3.0
    assert literal == pytest.approx(-155.3, abs=0.1)
    low, high = scintillation_db(np.radians([5.0, 90.0]), float(FREQUENCY_HZ[L1]))
    assert high == pytest.approx(0.0326, abs=5e-5)  # the constant of eq (18) is right
    assert low > high
    assert 10.0 * math.log10(2.0 * 1.023e6 / 0.02) == pytest.approx(80.1, abs=0.1)  # eq (58) as printed
    assert SignalCriteria().processing_gain_db == pytest.approx(43.1, abs=0.01)  # "about 43 dB"


def test_each_signal_has_the_same_margin():
    """Over the minimum each interface document guarantees at 5 degrees: -158.5, -154.0, -157.25 and -155.25 dBW."""
    terms = TransmitBudget(beam="flat").terms(at(5.0))
    received = terms.eirp_dbw + terms.beam_db - terms.spread_db - terms.oxygen_db
    minimum = np.full(received.shape, np.nan)
    minimum[:, L1], minimum[:, L5] = np.where(IS_GPS, -158.5, -157.25), np.where(IS_GPS, -154.0, -155.25)
    margin = (received - minimum)[0, [L1, L5]]
    np.testing.assert_allclose(margin, margin[0, 0], atol=0.1)  # powers are given to a tenth
    assert 0.0 < margin[0, 0] < 1.0
    assert np.isnan(terms.cn0_dbhz[:, L2]).all()


def test_banked_antenna_and_given_distance():
    budget = TransmitBudget()
    level = budget.cn0_dbhz(at(40.0))
    banked = budget.cn0_dbhz(at(40.0), at(10.0))
    gains = ANTENNAS["fighter"].gain_at_dbic(np.radians([40.0, 10.0]))
    np.testing.assert_allclose((level - banked)[0, L1], gains[0] - gains[1], atol=1e-9)
    far = budget.terms(at(40.0), distance_m=2.0 * slant_range_m(at(40.0)))
    np.testing.assert_allclose((level - far.cn0_dbhz)[0, L1], 20.0 * math.log10(2.0), atol=1e-9)
    assert np.isnan(budget.cn0_dbhz(at(math.nan))).all()
    assert np.isfinite(budget.cn0_dbhz(at(-10.0))[0, L1]).all()  # an aircraft sees below its local horizon


def test_criteria_before_and_after_correlation():
    """10 and 12 dB after correlation are 30 and 32 dB-Hz: the paper's rule of 25 and 27 dB-Hz never binds."""
    criteria = SignalCriteria()
    assert (criteria.warning_dbhz, criteria.caution_dbhz) == pytest.approx((30.0, 32.0), abs=1e-6)
    assert float(criteria.post_correlation_db(30.0)) == pytest.approx(10.0, abs=1e-6)
    assert float(criteria.pre_correlation_db(30.0)) == pytest.approx(30.0 - 63.11, abs=5e-3)
    lax = SignalCriteria(warning_post_correlation_db=0.0, caution_post_correlation_db=0.0)
    assert (lax.warning_dbhz, lax.caution_dbhz) == (25.0, 27.0)
    with pytest.raises(ValueError, match="caution_cn0_dbhz = 20.0 is below"):
        SignalCriteria(caution_cn0_dbhz=20.0)

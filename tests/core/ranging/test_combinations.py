"""Two-band combinations: published coefficients, and what is left of simulated ranges."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gbas_core.ranging import combinations as comb
from gbas_core.signals import IONO_RATIO, L1, L2, L5

PAIRS = [(L1, L5), (L5, L1), (L1, L2), (L2, L1), (L2, L5), (L5, L2)]
# Ranges of 2.2e7 m have a spacing of 3.7e-9 m, and the largest gain here (L2 with L5) is about 25.
ROUNDING_M = 1e-6


def ranges(band, delay_l1_m, ambiguity_m=0.0):
    """Code and carrier of a band for a delay on L1."""
    delay_m = IONO_RATIO[band] * delay_l1_m
    geometric_m = 2.2e7 + 1000.0 * np.arange(5)
    return geometric_m + delay_m, geometric_m - delay_m + ambiguity_m, geometric_m


def test_ratios_are_those_of_the_multiples_of_10_23_mhz():
    assert comb.iono_ratio(L1, L5) == float(Fraction(154, 115) ** 2)
    assert comb.iono_ratio(L1, L2) == float(Fraction(154, 120) ** 2)
    assert comb.iono_ratio(L1, L5) == pytest.approx(1.7933, abs=5e-5)  # printed digits
    assert comb.iono_ratio(L1, L2) == pytest.approx(1.6469, abs=5e-5)
    for band, other in PAIRS:
        # Each division rounds once.
        assert comb.iono_ratio(band, other) == pytest.approx(IONO_RATIO[other] / IONO_RATIO[band], rel=1e-15)


def test_published_ionosphere_free_coefficients():
    """Caamano et al. and ENC 2015: 2.26 and 1.26 for L1 with L5; to five digits 2.26060 and 1.26060."""
    first, second = comb.iono_free_weights(L1, L5)
    assert (first, second) == (pytest.approx(2.26060, abs=5e-6), pytest.approx(-1.26060, abs=5e-6))
    # IS-GPS-200N 20.3.3.3.3.3: (rho_2 - gamma rho_1) / (1 - gamma), gamma = (77/60)^2.
    gamma = Fraction(77, 60) ** 2
    assert comb.iono_free_weights(L1, L2) == (
        pytest.approx(float(gamma / (gamma - 1))),
        pytest.approx(float(1 / (1 - gamma))),
    )


@pytest.mark.parametrize(("band", "other"), PAIRS)
@given(st.floats(-100.0, 100.0))
def test_ionosphere_free_removes_the_delay(band, other, delay_m):
    code, carrier, geometric = ranges(band, delay_m)
    other_code, other_carrier, _ = ranges(other, delay_m)
    np.testing.assert_allclose(comb.ionosphere_free(code, other_code, band, other), geometric, atol=ROUNDING_M)
    np.testing.assert_allclose(comb.ionosphere_free(carrier, other_carrier, band, other), geometric, atol=ROUNDING_M)
    residue = comb.ionosphere_free_cmc(code, carrier, other_code, other_carrier, band, other)
    np.testing.assert_allclose(residue, 0.0, atol=ROUNDING_M)


@pytest.mark.parametrize(("band", "other"), PAIRS)
@given(st.floats(-100.0, 100.0))
def test_divergence_free_carrier_has_the_delay_of_the_code(band, other, delay_m):
    code, carrier, _ = ranges(band, delay_m)
    _, other_carrier, _ = ranges(other, delay_m)
    free = comb.divergence_free_carrier(carrier, other_carrier, band, other)
    np.testing.assert_allclose(free, code, atol=ROUNDING_M)
    np.testing.assert_allclose(
        comb.divergence_free_cmc(code, carrier, other_carrier, band, other), 0.0, atol=ROUNDING_M
    )
    np.testing.assert_allclose(
        comb.slant_iono_from_carriers(carrier, other_carrier, band, other), code - (code + carrier) / 2, atol=ROUNDING_M
    )


def test_geometry_free_and_code_minus_carrier():
    code, carrier, _ = ranges(L1, 3.0, ambiguity_m=4.0)
    code5, _, _ = ranges(L5, 3.0)
    np.testing.assert_allclose(comb.geometry_free(code, code5), 3.0 * (1.0 - IONO_RATIO[L5]), atol=ROUNDING_M)
    np.testing.assert_allclose(comb.code_minus_carrier(code, carrier), 2 * 3.0 - 4.0, atol=ROUNDING_M)


def test_ambiguities_stay_constant():
    """Constants of the carriers come out as a constant: 2.26 times the one minus 1.26 times the other."""
    _, plain, _ = ranges(L1, 5.0)
    _, with_ambiguity, _ = ranges(L1, 5.0, ambiguity_m=10.0)
    _, other, _ = ranges(L5, 5.0)
    change = comb.ionosphere_free(with_ambiguity, other, L1, L5) - comb.ionosphere_free(plain, other, L1, L5)
    np.testing.assert_allclose(change, 22.6060, atol=5e-5)


def test_matrix_of_enc_2015():
    """Eq (17) prints 3.53, 2.53, 4.53, 3.53, 2.26, 1.26: rounded, so within 0.01."""
    printed = np.array(
        [[1.0, 0.0, -3.53, 2.53], [0.0, 1.0, -4.53, 3.53], [2.26, -1.26, -2.26, 1.26], [0.0, 0.0, 2.26, -1.26]]
    )
    np.testing.assert_allclose(comb.combination_matrix(L1, L5), printed, atol=0.0101)


def test_matrix_agrees_with_the_functions():
    rng = np.random.default_rng(1)
    rho1, rho5, phi1, phi5 = parts = rng.normal(size=(4, 6))
    expected = np.stack(
        [
            comb.divergence_free_cmc(rho1, phi1, phi5, L1, L5),
            comb.divergence_free_cmc(rho5, phi5, phi1, L5, L1),
            comb.ionosphere_free_cmc(rho1, phi1, rho5, phi5, L1, L5),
            comb.ionosphere_free(phi1, phi5, L1, L5),
        ]
    )
    np.testing.assert_allclose(comb.combination_matrix(L1, L5) @ parts, expected, atol=1e-13)


@pytest.mark.parametrize(("band", "other"), PAIRS)
def test_matrix_has_rank_three(band, other):
    """The third row follows from the first two, and pure ionosphere (1, gamma, -1, -gamma) is invisible."""
    matrix, gamma = comb.combination_matrix(band, other), comb.iono_ratio(band, other)
    np.testing.assert_allclose(matrix[2], (gamma * matrix[0] - matrix[1]) / (gamma - 1.0), atol=1e-11)
    assert np.linalg.matrix_rank(matrix, tol=1e-9) == 3
    np.testing.assert_allclose(matrix @ [1.0, gamma, -1.0, -gamma], 0.0, atol=1e-11)


def test_noise_of_the_ionosphere_free_combination():
    """Against the sample deviation of 200 000 draws, which is good to 1/sqrt(2 n) = 0.16 %: five times that."""
    rng = np.random.default_rng(2)
    first, second = 0.3 * rng.normal(size=200_000), 0.2 * rng.normal(size=200_000)
    sigma = comb.ionosphere_free_sigma(np.array(0.3), np.array(0.2), L1, L5)
    assert np.std(comb.ionosphere_free(first, second, L1, L5)) == pytest.approx(float(sigma), rel=0.008)


def test_missing_stays_missing():
    nothing, something = np.array([np.nan, 1.0]), np.array([1.0, 1.0])
    for result in (
        comb.ionosphere_free(nothing, something, L1, L5),
        comb.divergence_free_carrier(something, nothing, L1, L5),
        comb.geometry_free(something, nothing),
    ):
        np.testing.assert_array_equal(np.isnan(result), [True, False])


def test_one_band_is_no_pair():
    with pytest.raises(ValueError, match="two bands"):
        comb.iono_free_weights(L1, L1)

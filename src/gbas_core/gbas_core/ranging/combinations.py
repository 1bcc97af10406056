"""Linear combinations of two bands.

Model: ``rho_i = r + I_i + ...`` and ``phi_i = r - I_i + ...`` with ``I_j / I_i = (f_i / f_j)^2``, all in metres. The
band arguments are indices into :data:`gbas_core.signals.BANDS`. Frequencies are whole multiples of 10.23 MHz, so the
ratios are exact. Any combination with a missing part is missing.

Source: Jiang, Milner, Macabiau, ENC 2015, eq (8) to (11); Hwang, McGraw, Bader, Navigation 46(2), 1999 (divergence-free
smoothing).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from gbas_core.record import FloatArray

# Carrier frequencies of L1, L2, L5 as multiples of 10.23 MHz (IS-GPS-200N 3.3.1.1, IS-GPS-705J 3.3.1.1).
_MULTIPLE: Final = (154, 120, 115)


def iono_ratio(band: int, other: int) -> float:
    """Ionospheric delay of `other` over that of `band`, ``gamma = (f_band / f_other)^2`` [-].

    Raises
    ------
    ValueError
        When both are the same band: no combination of it exists.
    """
    if band == other:
        raise ValueError(f"band {band} given twice: a combination needs two bands")
    return _MULTIPLE[band] ** 2 / _MULTIPLE[other] ** 2


def iono_free_weights(band: int, other: int) -> tuple[float, float]:
    """Coefficients of the ionosphere-free combination, ``gamma / (gamma - 1)`` and ``-1 / (gamma - 1)`` [-].

    For L1 and L5: 2.26060 and -1.26060. They sum to one.
    """
    ratio = iono_ratio(band, other)
    return ratio / (ratio - 1.0), -1.0 / (ratio - 1.0)


def ionosphere_free(value_m: FloatArray, other_m: FloatArray, band: int, other: int) -> FloatArray:
    """Combination of two code or two carrier ranges without first-order ionosphere.

    Parameters
    ----------
    value_m, other_m : (..., n_sats) arrays
        Code ranges, carrier ranges, smoothed ranges or corrections on `band` and on `other` [m].
    band, other : int
        Band indices.

    Returns
    -------
    (..., n_sats) array
        Ionosphere-free range [m]. Its noise is ``hypot(2.26 sigma_1, 1.26 sigma_5)`` for L1 and L5.

    Source: ENC 2015, eq (10) and (11).
    """
    first, second = iono_free_weights(band, other)
    return first * value_m + second * other_m


def ionosphere_free_sigma(sigma_m: FloatArray, other_sigma_m: FloatArray, band: int, other: int) -> FloatArray:
    """Standard deviation of :func:`ionosphere_free` of independent errors [m]."""
    first, second = iono_free_weights(band, other)
    return np.hypot(first * sigma_m, second * other_sigma_m)


def geometry_free(value_m: FloatArray, other_m: FloatArray) -> FloatArray:
    """Difference of two bands: ionosphere, biases and noise, without geometry and clocks [m]."""
    result: FloatArray = value_m - other_m
    return result


def code_minus_carrier(code_m: FloatArray, carrier_m: FloatArray) -> FloatArray:
    """Code minus carrier of one band: twice the ionosphere, multipath, noise and an ambiguity [m].

    Source: ENC 2015, eq (1).
    """
    result: FloatArray = code_m - carrier_m
    return result


def slant_iono_from_carriers(carrier_m: FloatArray, other_m: FloatArray, band: int, other: int) -> FloatArray:
    """Ionospheric delay on `band` from two carriers, up to the constant of their ambiguities [m]."""
    result: FloatArray = (carrier_m - other_m) / (iono_ratio(band, other) - 1.0)
    return result


def divergence_free_carrier(carrier_m: FloatArray, other_m: FloatArray, band: int, other: int) -> FloatArray:
    """Carrier of `band` with the ionosphere of its code, ``phi + 2 / (gamma - 1) (phi - phi_other)``.

    Smoothing the code of `band` with it leaves the code's ionospheric delay and no divergence, whatever the time
    constant.

    Parameters
    ----------
    carrier_m, other_m : (..., n_sats) arrays
        Carrier ranges on `band` and on the helping band [m].
    band, other : int
        Band indices.

    Returns
    -------
    (..., n_sats) array
        Carrier range [m].

    Source: ENC 2015, eq (8) and (9), of which it is the carrier part.
    """
    gain = 2.0 / (iono_ratio(band, other) - 1.0)
    result: FloatArray = carrier_m + gain * (carrier_m - other_m)
    return result


def divergence_free_cmc(
    code_m: FloatArray, carrier_m: FloatArray, other_carrier_m: FloatArray, band: int, other: int
) -> FloatArray:
    """Code of `band` minus its divergence-free carrier: multipath, noise and an ambiguity, no ionosphere [m].

    Source: ENC 2015, eq (8) and (9).
    """
    result: FloatArray = code_m - divergence_free_carrier(carrier_m, other_carrier_m, band, other)
    return result


def ionosphere_free_cmc(
    code_m: FloatArray,
    carrier_m: FloatArray,
    other_code_m: FloatArray,
    other_carrier_m: FloatArray,
    band: int,
    other: int,
) -> FloatArray:
    """Ionosphere-free code minus ionosphere-free carrier [m].

    Source: ENC 2015, eq (10).
    """
    return ionosphere_free(code_m - carrier_m, other_code_m - other_carrier_m, band, other)


def combination_matrix(band: int, other: int) -> FloatArray:
    """The four statistics of the ENC 2015 paper as rows over ``(rho, rho_other, phi, phi_other)``.

    Rows: divergence-free code minus carrier of `band` and of `other`, ionosphere-free code minus carrier,
    ionosphere-free carrier.

    Returns
    -------
    (4, 4) array
        Coefficients [-].

    Notes
    -----
    The matrix has rank 3: the third row is ``gamma/(gamma-1)`` times the first minus ``1/(gamma-1)`` times the
    second. The paper rounds the coefficients (3.53 for 3.5212), which hides that.

    Source: ENC 2015, eq (8) to (11) and (17).
    """
    near, far = iono_free_weights(band, other)
    gain = 2.0 / (iono_ratio(band, other) - 1.0)
    gain_other = 2.0 / (iono_ratio(other, band) - 1.0)
    return np.array(
        [
            [1.0, 0.0, -(1.0 + gain), gain],
            [0.0, 1.0, gain_other, -(1.0 + gain_other)],
            [near, far, -near, -far],
            [0.0, 0.0, near, far],
        ]
    )

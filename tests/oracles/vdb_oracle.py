"""Second formulations of the VDB's codes: strings of bits, long division, polynomials over GF(256). Slow and plain.

Nothing here uses the suite's code.
"""

from __future__ import annotations

# ---- bits as text ----


def air_bits(data: bytes) -> str:
    """Bits of bytes in the order of the air: each byte least significant bit first."""
    return "".join(f"{byte:08b}"[::-1] for byte in data)


def bytes_of_air_bits(bits: str) -> bytes:
    """Inverse of :func:`air_bits`."""
    assert len(bits) % 8 == 0
    return bytes(int(bits[start : start + 8][::-1], 2) for start in range(0, len(bits), 8))


def field_bits(raw: int, n_bits: int) -> str:
    """Bits of a field in the order of the air: least significant first, two's complement."""
    return f"{raw & ((1 << n_bits) - 1):0{n_bits}b}"[::-1]


# ---- cyclic redundancy checks by long division ----

CRC32Q = 0x1_8141_41AB
CRC16 = 0x1_1021


def crc_remainder_bits(message_bits: str, generator: int) -> str:
    """Remainder of x^k M(x) divided by G(x), the coefficient of the highest power first.

    The message bit first on the air is the coefficient of its highest power.
    """
    degree = generator.bit_length() - 1
    dividend = [int(bit) for bit in message_bits] + [0] * degree
    divisor = [int(bit) for bit in f"{generator:b}"]
    for start in range(len(message_bits)):
        if dividend[start]:
            for offset, bit in enumerate(divisor):
                dividend[start + offset] ^= bit
    return "".join(str(bit) for bit in dividend[-degree:])


# ---- Reed-Solomon over GF(256) with x^8 + x^7 + x^2 + x + 1 ----


def gf_multiply(a: int, b: int) -> int:
    """Product of two field elements, shift and add."""
    product = 0
    while b:
        if b & 1:
            product ^= a
        a <<= 1
        if a & 0x100:
            a ^= 0x187
        b >>= 1
    return product


def gf_power(base: int, exponent: int) -> int:
    """Power of a field element by repeated multiplication."""
    result = 1
    for _ in range(exponent):
        result = gf_multiply(result, base)
    return result


def generator_polynomial() -> list[int]:
    """Product of (x + alpha^i), i = 120 to 125, highest power first."""
    polynomial = [1]
    for exponent in range(120, 126):
        root = gf_power(2, exponent)
        shifted = [*polynomial, 0]
        for index, coefficient in enumerate(polynomial):
            shifted[index + 1] ^= gf_multiply(coefficient, root)
        polynomial = shifted
    return polynomial


def fec_by_division(application_data: bytes) -> bytes:
    """b0 to b5: remainder of x^6 m(x) divided by g(x), m(x) the 249 bytes, unused ones zero at the low powers."""
    generator = generator_polynomial()
    dividend = list(application_data) + [0] * (249 - len(application_data)) + [0] * 6
    for start in range(249):
        factor = dividend[start]
        if factor:
            for offset, coefficient in enumerate(generator):
                dividend[start + offset] ^= gf_multiply(factor, coefficient)
    return bytes(dividend[-6:][::-1])


def codeword_values_at_roots(application_data: bytes, fec: bytes) -> list[int]:
    """The code polynomial at alpha^120 to alpha^125 by Horner's rule: all zero for a codeword."""
    coefficients = list(application_data) + [0] * (249 - len(application_data)) + list(fec[::-1])
    values = []
    for exponent in range(120, 126):
        root = gf_power(2, exponent)
        value = 0
        for coefficient in coefficients:
            value = gf_multiply(value, root) ^ coefficient
        values.append(value)
    return values


# ---- GPS navigation message by bit positions ----

# (subframe, first bit of each piece, bits of each piece, field): IS-GPS-200N figure 20-1; bits count from 1 in a
# subframe of 300. A field in two pieces lists the most significant first.
GPS_PLACES = {
    "iodc": [(1, 83, 2), (1, 211, 8)],
    "group_delay_s": [(1, 197, 8)],
    "toc_tow_s": [(1, 219, 16)],
    "af2_sps2": [(1, 241, 8)],
    "af1_sps": [(1, 249, 16)],
    "af0_s": [(1, 271, 22)],
    "crs_m": [(2, 69, 16)],
    "delta_n_radps": [(2, 91, 16)],
    "m0_rad": [(2, 107, 8), (2, 121, 24)],
    "cuc_rad": [(2, 151, 16)],
    "e": [(2, 167, 8), (2, 181, 24)],
    "cus_rad": [(2, 211, 16)],
    "sqrt_a": [(2, 227, 8), (2, 241, 24)],
    "toe_tow_s": [(2, 271, 16)],
    "cic_rad": [(3, 61, 16)],
    "omega0_rad": [(3, 77, 8), (3, 91, 24)],
    "cis_rad": [(3, 121, 16)],
    "i0_rad": [(3, 137, 8), (3, 151, 24)],
    "crc_m": [(3, 181, 16)],
    "omega_rad": [(3, 197, 8), (3, 211, 24)],
    "omega_dot_radps": [(3, 241, 24)],
    "idot_radps": [(3, 279, 14)],
}
IODE_PLACES = [(2, 61, 8), (3, 271, 8)]

# Ephemeris CRC mask, words 3 to 10 of subframes 1 to 3.
GPS_MASK = (
    "000003 000000 000000 000000 0000FF FFFFFF FFFFFF FFFFFC",
    "FFFFFF FFFFFF FFFFFF FFFFFF FFFFFF FFFFFF FFFFFF FFFF00",
    "FFFFFF FFFFFF FFFFFF FFFFFF FFFFFF FFFFFF FFFFFF FFFFFC",
)


def gps_subframes(raw: dict[str, int], iode: int, noise: str = "0") -> list[list[str]]:
    """Three subframes of 300 bits with the fields at their places; all other bits are `noise`."""
    subframes = [[noise] * 300 for _ in range(3)]
    pieces = [(places, sum(bits for _, _, bits in places), raw[name]) for name, places in GPS_PLACES.items()]
    pieces += [([place], 8, iode) for place in IODE_PLACES]
    for places, total, value in pieces:
        text = f"{value & ((1 << total) - 1):0{total}b}"
        for subframe, first, bits in places:
            subframes[subframe - 1][first - 1 : first - 1 + bits] = text[:bits]
            text = text[bits:]
    return subframes


def gps_crc_bits(subframes: list[list[str]]) -> str:
    """M(x) of the ephemeris CRC: masked words 3 to 10 without parity, each byte least significant bit first."""
    message = ""
    for subframe, mask in zip(subframes, GPS_MASK, strict=True):
        for word, hexadecimal in enumerate(mask.split(), start=3):
            start = 30 * (word - 1)
            data = int("".join(subframe[start : start + 24]), 2) & int(hexadecimal, 16)
            message += "".join(f"{byte:08b}"[::-1] for byte in data.to_bytes(3, "big"))
    return message

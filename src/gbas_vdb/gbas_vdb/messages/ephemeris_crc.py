"""The ephemeris CRC of the type 1 message: both ends compute it from the ephemeris they hold, so that a ground station
and an aircraft never use different ephemerides under the same issue of data.

For GPS the 576 bits of subframes 1 to 3 that the standard names are made again from the fields of the ephemeris. This
is exact: each field is a multiple of its scale factor, and a RINEX file has more digits than that.

No standard has an ephemeris CRC for Galileo. The suite's own takes the same polynomial over the ephemeris and clock
fields with the scale factors of the navigation message, and a leading byte that names the message (I/NAV or F/NAV), so
that the two messages' clocks are told apart. It is private to the suite.

Source: Annex 10 Volume I, Appendix B, 3.6.4.2.3 (mask, reconstructed: uncertain); IS-GPS-200N figure 20-1
and tables 20-I to 20-III; Galileo OS SIS ICD 2.1 tables 39 to 45 and 67 to 74.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gbas_core.gnss.ephemeris import Ephemeris, NavigationMessage
from gbas_core.record import FloatArray
from gbas_core.satellites import IS_GALILEO, IS_GPS, N_SATS
from gbas_vdb.coding.crc import crc16


@dataclass(frozen=True, kw_only=True, slots=True)
class NavigationField:
    """A field of a navigation message: attribute of the ephemeris, bits, value of the lowest bit, two's complement."""

    name: str
    bits: int
    lsb: float = 1.0
    signed: bool = False


@dataclass(frozen=True, kw_only=True, slots=True)
class FieldBits:
    """Bits `first` to `first` + `bits` - 1 of a field, counted from its most significant; no name: masked bits."""

    bits: int
    name: str | None = None
    first: int = 0


_SEMICIRCLE: Final = math.pi


def _field(name: str, bits: int, exponent: int, *, signed: bool = True, semicircles: bool = False) -> NavigationField:
    return NavigationField(
        name=name, bits=bits, lsb=math.ldexp(_SEMICIRCLE if semicircles else 1.0, exponent), signed=signed
    )


GPS_FIELDS: Final[tuple[NavigationField, ...]] = (
    NavigationField(name="iodc", bits=10),
    _field("group_delay_s", 8, -31),
    _field("toc_tow_s", 16, 4, signed=False),
    _field("af2_sps2", 8, -55),
    _field("af1_sps", 16, -43),
    _field("af0_s", 22, -31),
    NavigationField(name="iod", bits=8),
    _field("crs_m", 16, -5),
    _field("delta_n_radps", 16, -43, semicircles=True),
    _field("m0_rad", 32, -31, semicircles=True),
    _field("cuc_rad", 16, -29),
    _field("e", 32, -33, signed=False),
    _field("cus_rad", 16, -29),
    _field("sqrt_a", 32, -19, signed=False),
    _field("toe_tow_s", 16, 4, signed=False),
    _field("cic_rad", 16, -29),
    _field("omega0_rad", 32, -31, semicircles=True),
    _field("cis_rad", 16, -29),
    _field("i0_rad", 32, -31, semicircles=True),
    _field("crc_m", 16, -5),
    _field("omega_rad", 32, -31, semicircles=True),
    _field("omega_dot_radps", 24, -43, semicircles=True),
    _field("idot_radps", 14, -43, semicircles=True),
)


def _whole(name: str, bits: int) -> FieldBits:
    return FieldBits(name=name, bits=bits)


# Words 3 to 10 of subframes 1, 2 and 3, 24 bits each, most significant first. Bits outside the mask are not named.
GPS_BITS: Final[tuple[FieldBits, ...]] = (
    *(FieldBits(bits=22), FieldBits(name="iodc", bits=2)),
    *(FieldBits(bits=24), FieldBits(bits=24), FieldBits(bits=24)),
    *(FieldBits(bits=16), _whole("group_delay_s", 8)),
    *(FieldBits(name="iodc", bits=8, first=2), _whole("toc_tow_s", 16)),
    *(_whole("af2_sps2", 8), _whole("af1_sps", 16)),
    *(_whole("af0_s", 22), FieldBits(bits=2)),
    *(_whole("iod", 8), _whole("crs_m", 16)),
    *(_whole("delta_n_radps", 16), _whole("m0_rad", 32)),
    *(_whole("cuc_rad", 16), _whole("e", 32)),
    *(_whole("cus_rad", 16), _whole("sqrt_a", 32)),
    *(_whole("toe_tow_s", 16), FieldBits(bits=8)),
    *(_whole("cic_rad", 16), _whole("omega0_rad", 32)),
    *(_whole("cis_rad", 16), _whole("i0_rad", 32)),
    *(_whole("crc_m", 16), _whole("omega_rad", 32)),
    _whole("omega_dot_radps", 24),
    *(_whole("iod", 8), _whole("idot_radps", 14), FieldBits(bits=2)),
)

_GALILEO_ORBIT_FIELDS: Final[tuple[NavigationField, ...]] = (
    NavigationField(name="message", bits=8),
    NavigationField(name="iod", bits=10),
    NavigationField(name="toe_tow_s", bits=14, lsb=60.0),
    _field("m0_rad", 32, -31, semicircles=True),
    _field("e", 32, -33, signed=False),
    _field("sqrt_a", 32, -19, signed=False),
    _field("omega0_rad", 32, -31, semicircles=True),
    _field("i0_rad", 32, -31, semicircles=True),
    _field("omega_rad", 32, -31, semicircles=True),
    _field("idot_radps", 14, -43, semicircles=True),
    _field("omega_dot_radps", 24, -43, semicircles=True),
    _field("delta_n_radps", 16, -43, semicircles=True),
    _field("cuc_rad", 16, -29),
    _field("cus_rad", 16, -29),
    _field("crc_m", 16, -5),
    _field("crs_m", 16, -5),
    _field("cic_rad", 16, -29),
    _field("cis_rad", 16, -29),
    NavigationField(name="toc_tow_s", bits=14, lsb=60.0),
    _field("af0_s", 31, -34),
    _field("af1_sps", 21, -46),
    _field("af2_sps2", 6, -59),
    _field("group_delay_s", 10, -32),
)
GALILEO_FNAV_FIELDS: Final = _GALILEO_ORBIT_FIELDS
GALILEO_INAV_FIELDS: Final = (*_GALILEO_ORBIT_FIELDS, _field("group_delay_e5b_s", 10, -32))


def quantised(ephemeris: Ephemeris, fields: tuple[NavigationField, ...]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Counts of the fields of every satellite, as the satellite transmits them.

    Returns
    -------
    counts : (n_fields, N_SATS) int array
        Two's complement fields as unsigned; zero where not known.
    known : (N_SATS,) bool array
        Whether every field is there and fits its bits.
    """
    values = np.array([getattr(ephemeris, item.name) for item in fields])
    lsb = np.array([item.lsb for item in fields])[:, None]
    span = np.array([2.0**item.bits for item in fields])[:, None]
    lowest = np.array([-(2.0 ** (item.bits - 1)) if item.signed else 0.0 for item in fields])[:, None]
    counts = np.rint(values / lsb)
    fits = (counts >= lowest) & (counts < lowest + span)
    known = fits.all(axis=0)
    unsigned = np.where(known, np.where(counts < 0.0, counts + span, counts), 0.0)
    return unsigned.astype(np.int64), known


def gps_masked_bytes(ephemeris: Ephemeris, satellite: int) -> bytes:
    """The 72 bytes (576 bits) of one GPS satellite's subframes 1 to 3 under the mask, most significant bit first.

    Raises
    ------
    ValueError
        When the satellite has no ephemeris or a field does not fit its bits.
    """
    counts, known = quantised(ephemeris, GPS_FIELDS)
    if not known[satellite]:
        raise ValueError(f"satellite index {satellite} has no whole ephemeris")
    return _gps_bytes(counts[:, satellite].tolist())


_GPS_INDEX: Final = {item.name: index for index, item in enumerate(GPS_FIELDS)}
# For each piece of the bit string: length, index of the field, right shift of the field, mask.
_GPS_PIECES: Final = tuple(
    (piece.bits, -1, 0, 0)
    if piece.name is None
    else (
        piece.bits,
        _GPS_INDEX[piece.name],
        GPS_FIELDS[_GPS_INDEX[piece.name]].bits - piece.first - piece.bits,
        (1 << piece.bits) - 1,
    )
    for piece in GPS_BITS
)


def _gps_bytes(counts: list[int]) -> bytes:
    value = 0
    n_bits = 0
    for bits, index, shift, mask in _GPS_PIECES:
        value = value << bits | (counts[index] >> shift & mask if index >= 0 else 0)
        n_bits += bits
    return value.to_bytes(n_bits // 8, "big")


def _galileo_bytes(counts: list[int], fields: tuple[NavigationField, ...]) -> bytes:
    value = 0
    n_bits = 0
    for count, item in zip(counts, fields, strict=True):
        value = value << item.bits | count
        n_bits += item.bits
    padding = -n_bits % 8
    return (value << padding).to_bytes((n_bits + padding) // 8, "big")


def ephemeris_crcs(ephemeris: Ephemeris) -> FloatArray:
    """Ephemeris CRC of every satellite.

    Parameters
    ----------
    ephemeris : Ephemeris

    Returns
    -------
    (N_SATS,) array
        The 16-bit field of the type 1 message (0 to 65535); NaN where there is no ephemeris, where a field is missing
        or does not fit the navigation message.
    """
    crcs = np.full(N_SATS, np.nan)
    counts, known = quantised(ephemeris, GPS_FIELDS)
    for satellite in np.flatnonzero(known & IS_GPS).tolist():
        crcs[satellite] = crc16(_gps_bytes(counts[:, satellite].tolist()))
    for message, fields in (
        (NavigationMessage.GALILEO_INAV, GALILEO_INAV_FIELDS),
        (NavigationMessage.GALILEO_FNAV, GALILEO_FNAV_FIELDS),
    ):
        counts, known = quantised(ephemeris, fields)
        for satellite in np.flatnonzero(known & IS_GALILEO & (ephemeris.message == message)).tolist():
            crcs[satellite] = crc16(_galileo_bytes(counts[:, satellite].tolist(), fields))
    return crcs

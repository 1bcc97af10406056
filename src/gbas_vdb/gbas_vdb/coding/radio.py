"""A burst on the air: training sequence, scrambling and differentially encoded 8-phase shift keying.

A burst is, in the order of the air: 15 zero bits of power stabilisation, 48 bits of synchronisation, then scrambled the
station slot identifier (3), the transmission length (17), training FEC (5), application data (each byte least
significant bit first) and application FEC (each byte most significant bit first); then up to 2 fill bits to complete a
symbol, and 9 zero bits while the power ramps down. Symbols are absolute phases in units of pi/4.

Source: Annex 10 Volume I, Appendix B, 3.6.2 and 3.6.3, Attachment D example.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from gbas_vdb.coding.bits import (
    BitArray,
    bits_lsb_first,
    bits_msb_first,
    bits_of_integer,
    bytes_lsb_first,
    bytes_msb_first,
    integer_lsb_first,
)
from gbas_vdb.coding.fec import FEC_BYTES, MAX_APPLICATION_BYTES, correct_training, training_parity
from gbas_vdb.errors import VdbError

SymbolArray = NDArray[np.uint8]


def _bit_array(text: str) -> BitArray:
    return np.array([int(bit) for bit in text if bit in "01"], dtype=np.uint8)


STABILISATION_BITS: Final = 15
RAMP_DOWN_BITS: Final = 9
SYNCHRONISATION: Final = _bit_array("000 010 011 110 000 001 101 110 001 100 011 111 101 111 100 010")
SCRAMBLER_START: Final = _bit_array("110100101011001")

_SSID_BITS: Final = 3
_LENGTH_BITS: Final = 17
_PARITY_BITS: Final = 5
_TRAINING_BITS: Final = _SSID_BITS + _LENGTH_BITS + _PARITY_BITS
_MAX_SCRAMBLED_BITS: Final = _TRAINING_BITS + 8 * (MAX_APPLICATION_BYTES + FEC_BYTES) + 2

# Phase change in units of pi/4 of three bits in the order of the air, the first as the most significant of the index.
_PHASE_OF_BITS: Final[SymbolArray] = np.array([0, 1, 3, 2, 7, 6, 4, 5], dtype=np.uint8)
_BITS_OF_PHASE: Final[SymbolArray] = np.argsort(_PHASE_OF_BITS).astype(np.uint8)


@dataclass(frozen=True, kw_only=True, slots=True)
class RadioBurst:
    """What the radio part of a receiver makes of a burst.

    Attributes
    ----------
    ssid : int
        Station slot identifier, 0 (A) to 7 (H).
    payload : bytes
        Application data and application FEC, as in :class:`gbas_vdb.transmission.burst.Burst`.
    training_corrected : int
        Bits the training FEC repaired (0 or 1).
    """

    ssid: int
    payload: bytes
    training_corrected: int = 0


@cache
def scrambler_sequence(n_bits: int = _MAX_SCRAMBLED_BITS) -> BitArray:
    """(n_bits,) pseudo-noise bits: 15 stages, taps 1 + x + x^15."""
    stages = SCRAMBLER_START.tolist()
    sequence = np.empty(n_bits, dtype=np.uint8)
    for position in range(n_bits):
        feedback = stages[0] ^ stages[14]
        sequence[position] = feedback
        stages = [feedback, *stages[:14]]
    sequence.flags.writeable = False
    return sequence


def scrambled(bits: BitArray) -> BitArray:
    """(n,) bits scrambled, or scrambled bits in the clear: the operation is its own inverse."""
    if len(bits) > _MAX_SCRAMBLED_BITS:
        raise VdbError(f"{len(bits)} bits after the synchronisation; at most {_MAX_SCRAMBLED_BITS} fit a burst")
    return bits ^ scrambler_sequence()[: len(bits)]


def burst_bits(payload: bytes, ssid: int) -> BitArray:
    """Scrambled bits of a burst, from the station slot identifier to the application FEC.

    Parameters
    ----------
    payload : bytes
        Application data and application FEC.
    ssid : int
        Station slot identifier, 0 (A) to 7 (H).

    Returns
    -------
    (25 + 8 len(payload),) array

    Raises
    ------
    VdbError
        When the payload is too short or too long or the slot identifier does not exist.
    """
    if not FEC_BYTES <= len(payload) <= MAX_APPLICATION_BYTES + FEC_BYTES:
        raise VdbError(f"payload of {len(payload)} bytes outside {FEC_BYTES} to {MAX_APPLICATION_BYTES + FEC_BYTES}")
    if not 0 <= ssid <= 7:
        raise VdbError(f"station slot identifier {ssid} outside 0 (A) to 7 (H)")
    header = np.concatenate([bits_of_integer(ssid, _SSID_BITS), bits_of_integer(8 * len(payload), _LENGTH_BITS)])
    return scrambled(
        np.concatenate(
            [
                header,
                training_parity(header),
                bits_lsb_first(payload[:-FEC_BYTES]),
                bits_msb_first(payload[-FEC_BYTES:]),
            ]
        )
    )


def decode_burst_bits(bits: BitArray) -> RadioBurst:
    """Inverse of :func:`burst_bits`; fill bits behind are ignored.

    Raises
    ------
    FecError
        When the training sequence is beyond repair.
    VdbError
        When the transmission length is impossible or more than the bits that are there.
    """
    if len(bits) < _TRAINING_BITS:
        raise VdbError(f"{len(bits)} bits after the synchronisation; the training sequence alone has {_TRAINING_BITS}")
    clear = scrambled(bits[:_MAX_SCRAMBLED_BITS])
    header, corrected = correct_training(clear[:_TRAINING_BITS])
    length = integer_lsb_first(header[_SSID_BITS:])
    if length % 8 or not 8 * FEC_BYTES <= length <= 8 * (MAX_APPLICATION_BYTES + FEC_BYTES):
        raise VdbError(f"transmission length of {length} bits is not that of 6 to 228 bytes")
    if length > len(bits) - _TRAINING_BITS:
        raise VdbError(f"transmission length of {length} bits, but {len(bits) - _TRAINING_BITS} are there")
    fec_start = _TRAINING_BITS + length - 8 * FEC_BYTES
    data = bytes_lsb_first(clear[_TRAINING_BITS:fec_start])
    fec = bytes_msb_first(clear[fec_start : _TRAINING_BITS + length])
    return RadioBurst(ssid=integer_lsb_first(header[:_SSID_BITS]), payload=data + fec, training_corrected=corrected)


def burst_symbols(payload: bytes, ssid: int) -> SymbolArray:
    """(n_symbols,) absolute phases of a whole burst in units of pi/4, from power stabilisation to ramp-down."""
    body = burst_bits(payload, ssid)
    fill = np.zeros(-len(body) % 3, dtype=np.uint8)
    stabilisation = np.zeros(STABILISATION_BITS, dtype=np.uint8)
    ramp_down = np.zeros(RAMP_DOWN_BITS, dtype=np.uint8)
    return encode_symbols(np.concatenate([stabilisation, SYNCHRONISATION, body, fill, ramp_down]))


def encode_symbols(bits: BitArray) -> SymbolArray:
    """(n,) absolute phases in units of pi/4 of (3 n,) bits; the phase before the first symbol is zero."""
    triples = bits.reshape(-1, 3)
    changes = _PHASE_OF_BITS[triples[:, 0] << 2 | triples[:, 1] << 1 | triples[:, 2]]
    return (np.cumsum(changes, dtype=np.int64) & 7).astype(np.uint8)


def decode_symbols(phases: SymbolArray) -> BitArray:
    """(3 n,) bits of (n,) absolute phases in units of pi/4; the phase before the first symbol counts as zero."""
    absolute = np.concatenate([[0], phases]).astype(np.int64)
    changes = (absolute[1:] - absolute[:-1]) & 7
    index = _BITS_OF_PHASE[changes]
    return np.stack([index >> 2, index >> 1 & 1, index & 1], axis=1).reshape(-1).astype(np.uint8)


def decode_burst_symbols(phases: SymbolArray) -> RadioBurst:
    """A burst from its absolute phases, the first of which is the first power stabilisation symbol.

    Differential keying does not care about a constant phase offset: only the very first symbol is then wrong, and it
    carries nothing.

    Raises
    ------
    VdbError
        When the synchronisation is not where it must be, and as :func:`decode_burst_bits`.
    """
    bits = decode_symbols(np.asarray(phases))
    start = STABILISATION_BITS + len(SYNCHRONISATION)
    if not np.array_equal(bits[STABILISATION_BITS:start], SYNCHRONISATION):
        raise VdbError("the synchronisation and ambiguity resolution sequence is not there")
    return decode_burst_bits(bits[start:])

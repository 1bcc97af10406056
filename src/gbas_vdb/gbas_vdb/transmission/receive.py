"""From a burst as received to its message blocks: forward error correction, then every block's CRC."""

from __future__ import annotations

from dataclasses import dataclass

from gbas_vdb.coding.fec import correct_fec
from gbas_vdb.errors import VdbError
from gbas_vdb.messages.block import BlockError, MessageBlock, decode_blocks
from gbas_vdb.transmission.burst import Burst


@dataclass(frozen=True, kw_only=True, slots=True)
class DecodedBurst:
    """What a burst says.

    Attributes
    ----------
    blocks : tuple of MessageBlock
        Blocks whose CRC was right, in the order sent.
    errors : tuple of BlockError
        What was discarded and why; a burst beyond repair has one error and no blocks.
    corrected_bytes : int
        Bytes the FEC repaired.
    """

    blocks: tuple[MessageBlock, ...]
    errors: tuple[BlockError, ...]
    corrected_bytes: int = 0


def decode_burst(burst: Burst | bytes) -> DecodedBurst:
    """Decode a burst, or its application data and FEC. Never raises: what is wrong is in `errors`."""
    payload = burst.payload if isinstance(burst, Burst) else burst
    try:
        application_data, corrected = correct_fec(payload)
    except VdbError as error:
        return DecodedBurst(blocks=(), errors=(BlockError(offset=0, reason=str(error)),))
    blocks, errors = decode_blocks(application_data)
    return DecodedBurst(blocks=blocks, errors=errors, corrected_bytes=corrected)

"""Corrections of a second frequency: messages of one frame become a set, as type 1 messages do.

They travel in private messages of type 8 (:class:`~gbas_vdb.messages.types.Type8`), which no other receiver looks into.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from gbas_msgs_py.products import PRODUCTS
from gbas_vdb.messages.types import Correction100, Type8
from gbas_vdb.transmission.burst import Burst

PRODUCT_OF_PRIVATE: Final = {
    product.measurement_type: product.name for product in PRODUCTS if product.message_type == 8
}
"""Name of the product a private message carries, by its measurement type."""


class Half(NamedTuple):
    """First message of a linked pair that arrived, and the frame it came in."""

    message: Type8
    frame: tuple[int, float]


def whole_set(
    pending: Half | None, message: Type8, burst: Burst
) -> tuple[Half | None, tuple[Correction100, ...] | None]:
    """What a message and the half that waits make.

    Returns
    -------
    waiting : Half or None
        What waits for its other half now.
    measurements : tuple of Correction100 or None
        A whole set; None as long as half of it is missing. A half whose other half did not come in the same frame is
        never used.
    """
    if message.additional_message_flag == 0:
        return None, message.measurements
    frame = burst.gps_week, burst.tow_s
    if pending is not None and pending.frame == frame:
        pair = sorted((pending.message, message), key=lambda each: each.additional_message_flag)
        flags = [each.additional_message_flag for each in pair]
        if flags == [1, 3] and pending.message.modified_z_count_s == message.modified_z_count_s:
            return None, pair[0].measurements + pair[1].measurements
    return Half(message, frame), None

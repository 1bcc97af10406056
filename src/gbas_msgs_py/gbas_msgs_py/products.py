"""The corrections a ground station makes and broadcasts: one table, which every column, message and mode refers to.

A row of the integrity table has the columns of every product, ``prc_<name>_m`` and so on; the arrays of an
:class:`~gbas_msgs_py.records.IntegrityEpoch` have the products as their first axis, in this order.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Final

from gbas_msgs_py.codes import Signal


@dataclass(frozen=True, kw_only=True)
class Product:
    """A correction: of which signal, smoothed for how long, and where it stands in the VDB.

    Attributes
    ----------
    name : str
        As in the columns.
    signal : Signal
    smoothing_s : float
        Time constant of the carrier smoothing [s].
    message_type : int
        VDB message that carries it; the message tables know its size.
    measurement_type : int
        Which of the corrections that messages of this type may carry.
    doc : str
    optional : bool
        Whether only some stations make it: its columns are then in the table only where one does.
    """

    name: str
    signal: Signal
    smoothing_s: float
    message_type: int
    measurement_type: int = 0
    doc: str
    optional: bool = False


PRODUCTS: Final[tuple[Product, ...]] = (
    Product(name="l1_100", signal=Signal.L1, smoothing_s=100.0, message_type=1, doc="correction of GAST-C"),
    Product(name="l1_30", signal=Signal.L1, smoothing_s=30.0, message_type=11, doc="correction added by GAST-D"),
    Product(
        name="l5_100", signal=Signal.L5, smoothing_s=100.0, message_type=8, doc="second frequency, private message",
        optional=True,
    ),
    Product(
        name="l5_30", signal=Signal.L5, smoothing_s=30.0, message_type=8, measurement_type=1,
        doc="second frequency, private message", optional=True,
    ),
)  # fmt: skip
# Source: ICAO Annex 10 vol. I, App. B 3.6.4.2 and 3.6.4.11 (known). The standard has no message for a second frequency:
# those of L5 travel in test messages of ours (docs/conventions.md).

PRODUCT_INDEX: Final[dict[str, int]] = {product.name: index for index, product in enumerate(PRODUCTS)}
"""Place of a product on the axis, by its name."""
L1_100: Final = PRODUCT_INDEX["l1_100"]
L1_30: Final = PRODUCT_INDEX["l1_30"]
L5_100: Final = PRODUCT_INDEX["l5_100"]
L5_30: Final = PRODUCT_INDEX["l5_30"]


def product_dictionary() -> list[dict[str, Any]]:
    """The products as JSON-able data."""
    return [asdict(product) | {"signal": product.signal.name} for product in PRODUCTS]

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
    doc : str
    """

    name: str
    signal: Signal
    smoothing_s: float
    message_type: int
    doc: str


PRODUCTS: Final[tuple[Product, ...]] = (
    Product(name="l1_100", signal=Signal.L1, smoothing_s=100.0, message_type=1, doc="correction of GAST-C"),
    Product(name="l1_30", signal=Signal.L1, smoothing_s=30.0, message_type=11, doc="correction added by GAST-D"),
)
# Source: ICAO Annex 10 vol. I, App. B 3.6.4.2 and 3.6.4.11 (known).

PRODUCT_INDEX: Final[dict[str, int]] = {product.name: index for index, product in enumerate(PRODUCTS)}
"""Place of a product on the axis, by its name."""
L1_100: Final = PRODUCT_INDEX["l1_100"]
L1_30: Final = PRODUCT_INDEX["l1_30"]


def product_dictionary() -> list[dict[str, Any]]:
    """The products as JSON-able data."""
    return [asdict(product) | {"signal": product.signal.name} for product in PRODUCTS]

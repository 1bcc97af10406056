"""Airborne processing modes: one table. A solution and its protection levels say by number which of them made them."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Final

from gbas_msgs_py.codes import ServiceType, Signal
from gbas_msgs_py.products import PRODUCT_INDEX


@dataclass(frozen=True, kw_only=True)
class Mode:
    """How an aircraft makes a position of its measurements and the station's corrections.

    Attributes
    ----------
    number : int
        As the tables carry it; never given a second meaning.
    name : str
    signal : Signal
        What is smoothed: one signal, or a combination.
    smoothing_s : float
        Time constant of the airborne carrier smoothing [s].
    product : str
        Correction that is applied, a name of :data:`~gbas_msgs_py.products.PRODUCTS`.
    service : ServiceType
        Service that the mode can give.
    doc : str
    """

    number: int
    name: str
    signal: Signal
    smoothing_s: float
    product: str
    service: ServiceType
    doc: str

    def __post_init__(self) -> None:
        """Refuse a mode without a number or with a product that does not exist."""
        if self.number < 1:
            raise ValueError(f"mode {self.name}: number is {self.number}, expected 1 or more")
        if self.product not in PRODUCT_INDEX:
            raise ValueError(f"mode {self.name}: product {self.product!r} is not one of {', '.join(PRODUCT_INDEX)}")


MODES: Final[tuple[Mode, ...]] = (
    Mode(
        number=1,
        name="l1_100",
        signal=Signal.L1,
        smoothing_s=100.0,
        product="l1_100",
        service=ServiceType.C,
        doc="GAST-C: single-frequency code smoothed with its own carrier, type 1 corrections",
    ),
)
# Source: ICAO Annex 10 vol. I, App. B 3.6.5 (known).

L1_100: Final = MODES[0]


def mode_of(number: float) -> Mode:
    """The mode of a number in a table.

    Raises
    ------
    ValueError
        When there is none.
    """
    for mode in MODES:
        if mode.number == number:
            return mode
    raise ValueError(f"mode {number:g} is none of {', '.join(f'{mode.number} ({mode.name})' for mode in MODES)}")


def mode_dictionary() -> list[dict[str, Any]]:
    """The modes as JSON-able data."""
    return [asdict(mode) | {"signal": mode.signal.name, "service": mode.service.name} for mode in MODES]

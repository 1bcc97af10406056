"""Airborne processing modes: one table. A solution and its protection levels say by number which of them made them.

Six ways of processing, each for GPS, Galileo and both: 18 modes. A way that is added is one entry of :data:`_WAYS`.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Final

from gbas_core.signals import FREQUENCY_HZ, IONO_RATIO, L1, L5
from gbas_msgs_py.codes import ServiceType, Signal
from gbas_msgs_py.products import PRODUCT_INDEX

WITHOUT_INFLATION: Final = "_d"
"""After a product's name: its corrections with the sigma that GAST-D broadcasts beside the inflated one."""
COMBINATIONS: Final[dict[Signal, tuple[tuple[Signal, float], ...]]] = {
    Signal.L1_L5: (
        (Signal.L1, float(FREQUENCY_HZ[L1] ** 2 / (FREQUENCY_HZ[L1] ** 2 - FREQUENCY_HZ[L5] ** 2))),
        (Signal.L5, float(-(FREQUENCY_HZ[L5] ** 2) / (FREQUENCY_HZ[L1] ** 2 - FREQUENCY_HZ[L5] ** 2))),
    )
}
"""Signals of a combination with their factors: 2.2606 and -1.2606, free of ionosphere.

Source: Circiu et al., "Assessment of different dual-frequency dual-constellation GBAS processing modes", eq (3).
"""


@dataclass(frozen=True, kw_only=True)
class Mode:
    """How an aircraft makes a position of its measurements and the station's corrections.

    Attributes
    ----------
    number : int
        As the tables carry it; never given a second meaning.
    name : str
    signal : Signal
        What is smoothed: one signal, or a combination of smoothed and corrected ranges (:data:`COMBINATIONS`).
    smoothing_s : float
        Time constant of the airborne carrier smoothing [s].
    products : tuple of str
        Corrections that are applied, names of :data:`~gbas_msgs_py.products.PRODUCTS`: one of each signal.
    systems : str
        Satellite systems, of those the receiver is set to: ``"G"``, ``"E"``, ``"GE"``.
    service : ServiceType
        Service that the mode can give.
    levels : tuple of str
        Products whose sigmas the protection levels are made of; with :data:`WITHOUT_INFLATION` those of GAST-D. Empty:
        those that are applied. The weights are of those that are applied.
    levels_smoothing_s : float
        Time constant the airborne sigma and sigma_iono of the protection levels are for [s]; 0: the own.
    iono_factor : float
        Ionospheric delay in the range over that on L1 [-]; 0 without.
    beside : str
        Way whose ranges are projected with the same S, for D_V and D_L; empty: none.
    monitors : tuple of str
        Airborne monitors that must pass, names of :data:`AIRBORNE_MONITORS`.
    fallback : str
        Way that guides where this one cannot; empty: none.
    doc : str
    """

    number: int
    name: str
    signal: Signal
    smoothing_s: float
    products: tuple[str, ...]
    systems: str = "GE"
    service: ServiceType
    levels: tuple[str, ...] = ()
    levels_smoothing_s: float = 0.0
    iono_factor: float = 1.0
    beside: str = ""
    monitors: tuple[str, ...] = ()
    fallback: str = ""
    doc: str

    def __post_init__(self) -> None:
        """Refuse a mode without a number, with a product that does not exist, or with too many or few of them."""
        if self.number < 1:
            raise ValueError(f"mode {self.name}: number is {self.number}, expected 1 or more")
        for product in (*self.products, *(name.removesuffix(WITHOUT_INFLATION) for name in self.levels)):
            if product not in PRODUCT_INDEX:
                raise ValueError(f"mode {self.name}: product {product!r} is not one of {', '.join(PRODUCT_INDEX)}")
        if len(self.products) != len(self.components) or len(self.levels) not in (0, len(self.components)):
            raise ValueError(f"mode {self.name}: {len(self.products)} products for {len(self.components)} signals")
        if unknown := set(self.monitors) - AIRBORNE_MONITORS.keys():
            raise ValueError(f"mode {self.name}: monitor {min(unknown)!r} is not one of {', '.join(AIRBORNE_MONITORS)}")

    def __hash__(self) -> int:
        """Few of the fields tell modes apart; a mode is looked up by itself many times an epoch."""
        return hash((self.number, self.smoothing_s, self.systems))

    @property
    def components(self) -> tuple[tuple[Signal, float], ...]:
        """Signals with their factors in the range."""
        return COMBINATIONS.get(self.signal, ((self.signal, 1.0),))

    @property
    def level_products(self) -> tuple[str, ...]:
        """Products whose sigmas the protection levels are made of."""
        return self.levels or self.products

    def same_systems(self, way: str) -> str:
        """Name of the mode of another way with the same systems; empty for none."""
        return way and way + _suffix(self.systems)


AIRBORNE_MONITORS: Final[dict[str, str]] = {
    "divergence": "code and carrier drift apart (CCD): the satellite is not used",
    "dual_solution": "30 s and 100 s solutions differ (DSIGMA)",
    "reference_receiver": "B values of a reference receiver in the position (RRFM)",
    "correction_shift": "what the corrections move the position by, horizontally",
    "geometry": "how much the position rests on one satellite, and on two",
    "step_in": "a satellite is used only when it has been usable for a while",
}
"""Monitors a mode may need, and what they look at."""
_SERVICE_D: Final = tuple(AIRBORNE_MONITORS)
_OF_L5: Final = float(IONO_RATIO[L5])

# Source: ICAO Annex 10 vol. I, App. B 3.6.5 (C, known; D: sigmas of weights and levels uncertain); Circiu et al. for
# the others: sections 3 and 5, where L5 30 s has 30 s in sigma_iono and GAST-D has 100 s.
_WAYS: Final[tuple[Mode, ...]] = (
    Mode(
        number=1, name="l1_100", signal=Signal.L1, smoothing_s=100.0, products=("l1_100",), service=ServiceType.C,
        doc="GAST-C: single-frequency code smoothed with its own carrier, type 1 corrections",
    ),
    Mode(
        number=2, name="l1_30", signal=Signal.L1, smoothing_s=30.0, products=("l1_30",), service=ServiceType.D,
        levels=("l1_100" + WITHOUT_INFLATION,), levels_smoothing_s=100.0, beside="l1_100", monitors=_SERVICE_D,
        fallback="l1_100", doc="GAST-D: 30 s solution (type 11 corrections) with the 100 s solution beside it",
    ),
    Mode(
        number=3, name="l5_100", signal=Signal.L5, smoothing_s=100.0, products=("l5_100",), service=ServiceType.L5_100,
        iono_factor=_OF_L5, fallback="l1_100", doc="L5/E5a code smoothed with its own carrier",
    ),
    Mode(
        number=4, name="l5_30", signal=Signal.L5, smoothing_s=30.0, products=("l5_30",), service=ServiceType.L5_30,
        iono_factor=_OF_L5, fallback="l1_100", doc="L5/E5a code smoothed with its own carrier",
    ),
    Mode(
        number=5, name="if_100", signal=Signal.L1_L5, smoothing_s=100.0, products=("l1_100", "l5_100"),
        service=ServiceType.IF_100, iono_factor=0.0, fallback="l5_100",
        doc="without ionosphere: smoothed and corrected L1/E1 and L5/E5a ranges combined",
    ),
    Mode(
        number=6, name="if_30", signal=Signal.L1_L5, smoothing_s=30.0, products=("l1_30", "l5_30"),
        service=ServiceType.IF_30, iono_factor=0.0, fallback="l5_30",
        doc="without ionosphere: smoothed and corrected L1/E1 and L5/E5a ranges combined",
    ),
)  # fmt: skip
_SYSTEMS: Final = {"GE": 0, "G": 10, "E": 20}
"""Sets of satellite systems, and what their modes' numbers begin after."""


def _suffix(systems: str) -> str:
    return "" if systems == "GE" else f"_{systems.lower()}"


def _of_systems(way: Mode, systems: str) -> Mode:
    rest = {name: getattr(way, name) for name in Mode.__dataclass_fields__}
    return Mode(
        **rest | {"number": way.number + _SYSTEMS[systems], "name": way.name + _suffix(systems), "systems": systems}
    )


MODES: Final[tuple[Mode, ...]] = tuple(_of_systems(way, systems) for systems in _SYSTEMS for way in _WAYS)
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

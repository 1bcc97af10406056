"""The processing modes a receiver runs, from the contract's table, and where their corrections come from."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Final

from gbas_airborne.params import AirborneParams
from gbas_core.signals import BAND_INDEX
from gbas_msgs_py import modes
from gbas_msgs_py.codes import ServiceType, Signal
from gbas_msgs_py.modes import Mode
from gbas_msgs_py.products import PRODUCT_INDEX, PRODUCTS, Product

# Known (ICAO Annex 10 vol. I, table B-70): measurement type 0 of a type 1 message is C/A or E1 code on L1.
SIGNAL_OF_MEASUREMENT: Final = {0: Signal.L1}
_OF_MESSAGE: Final = {(product.message_type, product.signal): product.name for product in PRODUCTS}
PRODUCT_OF_MEASUREMENT: Final = {
    measurement: _OF_MESSAGE[1, signal] for measurement, signal in SIGNAL_OF_MEASUREMENT.items()
}
"""Name of the product a type 1 message carries, by its measurement type."""


def configured_modes(params: AirborneParams) -> tuple[Mode, ...]:
    """The modes that run: those of the service asked for. The first is the one guidance is from.

    Its time constant is that of the parameters.

    Raises
    ------
    ValueError
        When the table has no mode for that service.
    """
    return _modes_of(modes.MODES, params.service, params.smoothing_tau_s)


@lru_cache(maxsize=8)
def _modes_of(table: tuple[Mode, ...], service: str, smoothing_tau_s: float) -> tuple[Mode, ...]:
    chosen = [mode for mode in table if mode.service == ServiceType[service]]
    if not chosen:
        raise ValueError(f"service {service}: no mode gives it")
    return replace(chosen[0], smoothing_s=smoothing_tau_s), *chosen[1:]


def subject_prefix(number: float, params: AirborneParams) -> str:
    """What goes before the subjects of a mode's events: nothing for the mode guidance is from, the others' names."""
    first, *others = configured_modes(params)
    if number == first.number:
        return ""
    return next((f"{mode.name}/" for mode in others if mode.number == number), f"mode {number:g}/")


def band_of(mode: Mode) -> int:
    """Place of a mode's signal on the band axis.

    Raises
    ------
    ValueError
        When the mode is of a combination of signals: there is no processing of these.
    """
    band = BAND_INDEX.get(mode.signal.name)
    if band is None:
        raise ValueError(f"mode {mode.name}: signal {mode.signal.name} is not one of {', '.join(BAND_INDEX)}")
    return band


def product_of(mode: Mode) -> Product:
    """The correction a mode applies."""
    return PRODUCTS[PRODUCT_INDEX[mode.product]]

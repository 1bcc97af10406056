"""The processing modes a receiver runs, from the contract's table, and where their corrections come from."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Final, NamedTuple, TypeVar

from gbas_airborne.params import ALL_MODES, AirborneParams
from gbas_core.signals import BAND_INDEX
from gbas_msgs_py import modes
from gbas_msgs_py.codes import ServiceType, Signal
from gbas_msgs_py.modes import Mode
from gbas_msgs_py.products import PRODUCT_INDEX, PRODUCTS

# Known (ICAO Annex 10 vol. I, table B-70): measurement type 0 of a type 1 message is C/A or E1 code on L1.
SIGNAL_OF_MEASUREMENT: Final = {0: Signal.L1}
_OF_MESSAGE: Final = {(product.message_type, product.signal): product.name for product in PRODUCTS}
PRODUCT_OF_MEASUREMENT: Final = {
    measurement: _OF_MESSAGE[1, signal] for measurement, signal in SIGNAL_OF_MEASUREMENT.items()
}
"""Name of the product a type 1 message carries, by its measurement type."""


def configured_modes(params: AirborneParams) -> tuple[Mode, ...]:
    """The modes that run, each once: those that may guide, best first, what they need beside them, and the others.

    The first is of the service asked for; its systems, and those of every mode, are at most those of the parameters.

    Raises
    ------
    ValueError
        When the table has no mode for that service.
    """
    return _modes_of(modes.MODES, params)


def guiding_modes(params: AirborneParams) -> tuple[Mode, ...]:
    """The modes guidance may be from, best first."""
    return _chain(modes.MODES, params)


@lru_cache(maxsize=8)
def _chain(table: tuple[Mode, ...], params: AirborneParams) -> tuple[Mode, ...]:
    way = next((mode for mode in table if mode.service.option == params.service), None)
    if way is None:
        raise ValueError(f"service {params.service}: no mode gives it")
    if way.service is ServiceType.C:
        way = replace(way, smoothing_s=params.smoothing_tau_s)
    chain = [way]
    while params.fallback and chain[-1].fallback:
        chain.append(_named(table, chain[-1].same_systems(chain[-1].fallback)))
    return tuple(_limited(mode, params.systems) for mode in chain)


@lru_cache(maxsize=8)
def _modes_of(table: tuple[Mode, ...], params: AirborneParams) -> tuple[Mode, ...]:
    found = {mode.name: mode for mode in _chain(table, params)}
    wanted = [mode for mode in table if mode.name in params.modes or (ALL_MODES in params.modes and _of(mode, params))]
    for mode in (*found.values(), *wanted):
        found.setdefault(mode.name, _limited(mode, params.systems))
        if mode.beside:
            beside = _named(table, mode.same_systems(mode.beside))
            found.setdefault(beside.name, _limited(beside, params.systems))
    return tuple(found.values())


def _of(mode: Mode, params: AirborneParams) -> bool:
    """Whether a mode is one of all: of both systems, or of one of two that are used."""
    return len(mode.systems) > 1 or len(params.systems) > 1


def _named(table: tuple[Mode, ...], name: str) -> Mode:
    return next(mode for mode in table if mode.name == name)


def _limited(mode: Mode, systems: str) -> Mode:
    """The mode with those of its systems that the receiver uses."""
    return replace(mode, systems="".join(letter for letter in mode.systems if letter in systems))


def subject_prefix(number: float, params: AirborneParams) -> str:
    """What goes before the subjects of a mode's events: nothing for the mode asked for, the others' names."""
    first, *others = configured_modes(params)
    if number == first.number:
        return ""
    return next((f"{mode.name}/" for mode in others if mode.number == number), f"mode {number:g}/")


def bands_of(mode: Mode) -> tuple[int, ...]:
    """Places of a mode's signals on the band axis.

    Raises
    ------
    ValueError
        When a signal is a combination that the contract's table does not take apart.
    """
    names = [signal.name for signal, _ in mode.components]
    if unknown := [name for name in names if name not in BAND_INDEX]:
        raise ValueError(f"mode {mode.name}: signal {unknown[0]} is not one of {', '.join(BAND_INDEX)}")
    return tuple(BAND_INDEX[name] for name in names)


T = TypeVar("T")
N_SIGNALS: Final = 2
"""The most signals a mode's range is combined of."""


def pair(values: tuple[T, ...]) -> tuple[T, T]:
    """One value a signal; of a single one it stands twice, for arrays with an axis of signals."""
    return values[0], values[-1]


class Processing(NamedTuple):
    """The numbers of a mode, as loops have them.

    Attributes
    ----------
    coefficient : tuple of float
        Factors of the signals in the range; 0 for one that is not there.
    level_tau_s, iono_tau_s : float
        Time constants that the levels' airborne sigma and sigma_iono are for [s].
    model_tau_s : tuple of float
        Time constant of each signal's airborne sigma model [s].
    """

    coefficient: tuple[float, float]
    level_tau_s: float
    iono_tau_s: float
    model_tau_s: tuple[float, float]


@lru_cache(maxsize=64)
def processing_of(mode: Mode) -> Processing:
    """The numbers of a mode.

    Corrections are smoothed over their time constant whatever the aircraft does, so sigma_iono is for the longer one.
    """
    factors = tuple(factor for _, factor in mode.components)
    level_tau_s = mode.levels_smoothing_s or mode.smoothing_s
    models = tuple(_model_tau_s(signal, mode) for signal, _ in mode.components)
    corrections_s = max(PRODUCTS[PRODUCT_INDEX[name]].smoothing_s for name in mode.products)
    return Processing(
        coefficient=(factors[0], factors[1] if len(factors) > 1 else 0.0),
        level_tau_s=level_tau_s,
        iono_tau_s=max(level_tau_s, corrections_s),
        model_tau_s=pair(models),
    )


def _model_tau_s(signal: Signal, mode: Mode) -> float:
    """Time constant of a signal's airborne sigma model: known is 100 s for L1 [s].

    Circiu et al. find little between 100 s and 30 s on L5, and give a curve for each; the one surrogate we have is
    taken for either.
    """
    return 100.0 if signal is Signal.L1 else mode.smoothing_s

"""The processing modes a receiver runs, from the contract's table, and where their corrections come from."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any, Final, NamedTuple, TypeVar, cast

from gbas_airborne.params import ALL_MODES, AirborneParams
from gbas_core.models.sigma_curves import CurveSignal, Part, sigma_curves
from gbas_core.satellites import SYSTEM_MASKS
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


class _Table:
    """The contract's table as a key of what is kept: the same where it is that object."""

    def __init__(self, table: tuple[Mode, ...]) -> None:
        self.modes = table

    def __hash__(self) -> int:
        return id(self.modes)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Table) and other.modes is self.modes


def configured_modes(params: AirborneParams) -> tuple[Mode, ...]:
    """The modes that run, each once: those that may guide, best first, what they need beside them, and the others.

    The first is of the service asked for; its systems, and those of every mode, are at most those of the parameters.

    Raises
    ------
    ValueError
        When the table has no mode for that service.
    """
    return _modes_of(_Table(modes.MODES), params)


def guiding_modes(params: AirborneParams) -> tuple[Mode, ...]:
    """The modes guidance may be from, best first."""
    return _chain(_Table(modes.MODES), params)


@lru_cache(maxsize=8)
def _chain(known: _Table, params: AirborneParams) -> tuple[Mode, ...]:
    table = known.modes
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
def _modes_of(known: _Table, params: AirborneParams) -> tuple[Mode, ...]:
    table, found = known.modes, {mode.name: mode for mode in _chain(known, params)}
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
MODEL_TAU_S: Final = 100.0
"""Time constant of the airborne sigma models of the standard."""
_PARTS: Final[tuple[Part, ...]] = ("noise", "multipath")
_SYSTEM_LETTERS: Final = tuple(SYSTEM_MASKS)
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
    tau_s : tuple of float
        Time constants the airborne sigma is for, of levels and of weights [s].
    iono_tau_s : float
        Time constant sigma_iono is for [s].
    """

    coefficient: tuple[float, float]
    tau_s: tuple[float, float]
    iono_tau_s: float


@lru_cache(maxsize=64)
def processing_of(mode: Mode) -> Processing:
    """The numbers of a mode.

    Corrections are smoothed over their time constant whatever the aircraft does, so sigma_iono is for the longer one.
    """
    factors = tuple(factor for _, factor in mode.components)
    level_tau_s = mode.levels_smoothing_s or mode.smoothing_s
    corrections_s = max(PRODUCTS[PRODUCT_INDEX[name]].smoothing_s for name in mode.products)
    return Processing(
        coefficient=(factors[0], factors[1] if len(factors) > 1 else 0.0),
        tau_s=(level_tau_s, mode.smoothing_s),
        iono_tau_s=max(level_tau_s, corrections_s),
    )


class AirModel(NamedTuple):
    """Airborne noise and multipath of a mode, for levels and for weights.

    Attributes
    ----------
    tau_s : (2, C) tuple
        Time constant each signal's curves are for [s].
    curves : (2, systems, C, 6) tuple
        Coefficients a0, a1 [m] and theta0 [deg] of noise, and of multipath; systems as in CLOCK_GROUPS.
    """

    tau_s: tuple[tuple[float, ...], ...]
    curves: tuple[Any, ...]


@lru_cache(maxsize=64)
def air_model(mode: Mode, designator: str) -> AirModel:
    """The curves of the suite's table for a mode; with a time constant below all of a signal, those of 100 s.

    Raises
    ------
    ValueError
        When the table has none, or a curve of several pieces.
    """
    families = [[_signal_curves(signal, tau, designator) for signal, _ in mode.components] for tau in _taus(mode)]
    return AirModel(
        tau_s=tuple(pair(tuple(tau for tau, _ in signals)) for signals in families),
        curves=tuple(
            tuple(pair(tuple(curves[system] for _, curves in signals)) for system in range(len(_SYSTEM_LETTERS)))
            for signals in families
        ),
    )


def _taus(mode: Mode) -> tuple[float, float]:
    return processing_of(mode).tau_s


def _signal_curves(signal: Signal, tau_s: float, designator: str) -> tuple[float, list[tuple[float, ...]]]:
    """Time constant and coefficients, by system, of one signal."""
    table, name = sigma_curves(), cast(CurveSignal, signal.name)
    found: list[tuple[float, ...]] = []
    for system in _SYSTEM_LETTERS:
        parts = [
            table.pieces("air", part, name, designator, tau_s, system)
            or table.pieces("air", part, name, designator, MODEL_TAU_S, system)
            for part in _PARTS
        ]
        if any(len(pieces) != 1 for pieces in parts) or len({pieces[0].smoothing_s for pieces in parts}) != 1:
            raise ValueError(f"airborne curves of {name}, {tau_s:g} s, system {system}: expected one of noise and one "
                             "of multipath, of one time constant")  # fmt: skip
        rows = [pieces[0] for pieces in parts]
        found.append(tuple(
            number for row in rows for number in (row.scale * row.a0_m, row.scale * row.a1_m, row.theta0_deg)
        ))  # fmt: skip
        constant_s = rows[0].smoothing_s
    return constant_s, found

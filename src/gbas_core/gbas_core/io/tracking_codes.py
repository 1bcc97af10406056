"""Which tracking codes the columns of a receiver's file are taken from.

A receiver may track several signals in a band; the suite has one column a band. For the whole file one tracking code is
taken per system and band, so that a column never changes its signal.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from gbas_core.record import FloatArray, IntArray
from gbas_core.satellites import N_SATS
from gbas_core.signals import BAND_INDEX, BANDS, N_BANDS

SignalTable = Mapping[tuple[str, str], Sequence[str]]

DEFAULT_SIGNALS: Final[SignalTable] = {
    ("G", "L1"): ("1C", "1W", "1P"),
    ("G", "L2"): ("2W", "2L", "2S", "2X", "2C", "2P"),
    ("G", "L5"): ("5Q", "5I", "5X"),
    ("E", "L1"): ("1C", "1B", "1X"),
    ("E", "L5"): ("5Q", "5I", "5X"),
}
"""Tracking codes (RINEX 3 band and attribute) by system and band, the preferred first."""

CODE, CARRIER, DOPPLER, CN0, LLI = range(5)
"""Places of the quantities in the result of :func:`columns_of_signals`."""
QUANTITY_LETTERS: Final = "CLDS"
"""First letters of RINEX observation codes: code, carrier, Doppler, C/N0."""


@dataclass(frozen=True, kw_only=True)
class SignalChoice:
    """The observation codes taken for one system and band; None where the file has none."""

    code: str | None
    carrier: str | None
    doppler: str | None
    cn0: str | None


@dataclass(frozen=True, kw_only=True)
class FlatValues:
    """Every wanted observation of a file, one row each; `code` indexes `codes`. Carriers are in metres."""

    codes: list[tuple[str, str]]  # (system, observation code)
    epoch: IntArray
    satellite: IntArray
    code: IntArray
    value: FloatArray
    lli: FloatArray


def wanted_codes(signals: SignalTable) -> dict[tuple[str, str], str]:
    """Band of each wanted (system, observation code).

    Raises
    ------
    ValueError
        For an unknown system or band in `signals`.
    """
    bands: dict[tuple[str, str], str] = {}
    for (system, band), trackings in signals.items():
        if system not in ("G", "E") or band not in BAND_INDEX:
            raise ValueError(f"signals: {(system, band)!r} is not a system (G, E) and band ({', '.join(BANDS)})")
        bands |= {(system, letter + tracking): band for tracking in trackings for letter in QUANTITY_LETTERS}
    return bands


def _choose(counts: Mapping[str, int], trackings: Sequence[str]) -> SignalChoice | None:
    """Choice for one system and band from the numbers of observations of each observation code."""
    both = [min(counts.get("C" + tracking, 0), counts.get("L" + tracking, 0)) for tracking in trackings]
    together = next((t for t, n in zip(trackings, both, strict=True) if n > 0 and 2 * n >= max(both)), None)

    def first(letter: str, preferred: str | None) -> str | None:
        order = [preferred, *trackings] if preferred else trackings
        return next((letter + tracking for tracking in order if counts.get(letter + tracking)), None)

    code, carrier = first("C", together), first("L", together)
    if code is None and carrier is None:
        return None
    tracking = (carrier or code or "")[1:]
    return SignalChoice(code=code, carrier=carrier, doppler=first("D", tracking), cn0=first("S", tracking))


def columns_of_signals(
    flat: FlatValues, n_epochs: int, signals: SignalTable
) -> tuple[dict[tuple[str, str], SignalChoice], list[FloatArray]]:
    """Chosen signals and the five quantities (code, carrier, doppler, C/N0, LLI), each (E, N_BANDS, N_SATS)."""
    number = dict(zip(flat.codes, np.bincount(flat.code, minlength=len(flat.codes)).tolist(), strict=True))
    place = {key: index for index, key in enumerate(flat.codes)}
    arrays = [np.full((n_epochs, N_BANDS, N_SATS), np.nan) for _ in range(5)]
    chosen: dict[tuple[str, str], SignalChoice] = {}
    for (system, band), trackings in signals.items():
        choice = _choose({code: n for (letter, code), n in number.items() if letter == system}, trackings)
        if choice is None:
            continue
        chosen[system, band] = choice
        row = BAND_INDEX[band]
        for quantity, name in enumerate((choice.code, choice.carrier, choice.doppler, choice.cn0)):
            if name is None:
                continue
            rows = flat.code == place[system, name]
            where = (flat.epoch[rows], row, flat.satellite[rows])
            arrays[quantity][where] = flat.value[rows]
            if quantity == CARRIER:
                arrays[LLI][where] = np.nan_to_num(flat.lli[rows])  # a blank indicator is 0 (RINEX)
    arrays[CODE][arrays[CODE] <= 0.0] = np.nan
    return chosen, arrays

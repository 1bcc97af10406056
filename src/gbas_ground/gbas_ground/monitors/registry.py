"""The station's monitors: the entries of the contract with what runs them.

Names, numbers, tests, causes, units and what is judged are the contract's (:mod:`gbas_msgs_py.monitors`), because
readers of bags need them without the station. A monitor of the contract is a monitor of the station.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from gbas_msgs_py import monitors as contract
from gbas_msgs_py.codes import ExclusionCause


@dataclass(frozen=True, kw_only=True)
class GroundMonitor:
    """A monitor and what runs it.

    Attributes
    ----------
    entry : Monitor
        Number, name, tests with cause and unit, what it judges, and what it looks for.
    parameters : type or None
        Its section in a station's file; None while the station makes its settings.
    step : callable or None
        ``step(state, inputs, parameters) -> (state, result)``; None while the station calls it by its own name.
    """

    entry: contract.Monitor
    parameters: type | None = None
    step: Callable[..., Any] | None = None

    @property
    def name(self) -> str:
        """Its one name."""
        return self.entry.name

    @property
    def causes(self) -> tuple[ExclusionCause, ...]:
        """Causes of its exclusions."""
        return self.entry.causes


MONITORS: Final[tuple[GroundMonitor, ...]] = tuple(GroundMonitor(entry=entry) for entry in contract.MONITORS)
"""All monitors, in the order of the table."""

"""The station's monitors of signals, in the order in which they run.

Names, numbers, tests, causes, units and what is judged are the contract's (:mod:`gbas_msgs_py.monitors`), because
readers of bags need them without the station. A monitor of the contract that has a module of its name with ``MONITOR``
is run; the others there are belong to one stage each: checks of channels, agreement of the corrections.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Final

from gbas_ground.monitors.interface import SignalMonitor
from gbas_msgs_py import monitors as contract


def _signal_monitors() -> tuple[SignalMonitor, ...]:
    names = [f"{__package__}.{entry.name}" for entry in contract.MONITORS]
    modules = [import_module(name) for name in names if find_spec(name) is not None]
    return tuple(module.MONITOR for module in modules if hasattr(module, "MONITOR"))


SIGNAL_MONITORS: Final = _signal_monitors()

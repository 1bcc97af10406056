"""Imported once by the process that nodes are forked from: every node and every compiled function they run."""

from __future__ import annotations

import importlib

from gbas_bringup.node_kinds import NODE_KINDS
from gbas_core.compiled import load_ahead

for _kind in NODE_KINDS.values():
    importlib.import_module(_kind.module)
load_ahead()

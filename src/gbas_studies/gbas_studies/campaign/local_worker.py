"""What dask loads into each local worker."""

from __future__ import annotations

import signal


def dask_setup(worker: object) -> None:
    """Leave Ctrl-C, which the terminal sends to all processes, to the one that has the workers: it ends them."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

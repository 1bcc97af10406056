"""Nodes as processes that are forked from one which has imported everything.

A node is up after a third of a second of processor time instead of three seconds, and shares the memory of what it
runs. All else is as with a program of its own: its environment, arguments, session, output and exit code.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import io
import multiprocessing
import os
import signal
import sys
from collections.abc import Mapping, Sequence
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from typing import Final

from setproctitle import setproctitle

_FORKING: Final = multiprocessing.get_context("forkserver")
_PRELOADED: Final = ("__main__", "gbas_bringup.preloaded")
_PR_SET_PDEATHSIG: Final = 1


class NodeProcess:
    """A running node.

    Parameters
    ----------
    module : str
        Module with a function ``main``, which gets its arguments by ``sys.argv``.
    arguments : sequence of str
    environment : mapping
        All of it; nothing else is inherited.
    output : int
        File descriptor of its standard output and error; the caller's remains the caller's.
    """

    def __init__(self, module: str, arguments: Sequence[str], environment: Mapping[str, str], output: int) -> None:
        _FORKING.set_forkserver_preload([*_PRELOADED])
        begun, begins = _FORKING.Pipe(duplex=False)
        with Connection(os.dup(output), readable=False) as theirs, begun:
            given = (module, list(arguments), dict(environment), theirs, begins)
            self._process = _FORKING.Process(target=_run, args=given, name=module, daemon=True)
            with begins:
                self._process.start()
            begun.poll(None)  # until it has closed its end: a signal before that would be lost

    @property
    def pid(self) -> int:
        """Process identifier."""
        assert self._process.pid is not None
        return self._process.pid

    def poll(self) -> int | None:
        """Exit code, negative for a signal; None while it runs."""
        return self._process.exitcode

    def wait(self, timeout_s: float | None = None) -> int | None:
        """Exit code, or None when it still runs after `timeout_s`."""
        self._process.join(timeout_s)
        return self._process.exitcode

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)


def _run(
    module: str, arguments: Sequence[str], environment: Mapping[str, str], output: Connection, begins: Connection
) -> None:
    """The child's part: become what a program started by itself would be, then run."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    begins.close()
    setproctitle(" ".join([sys.executable, "-m", module, *arguments]))  # before the environment changes: it lies there
    os.setsid()
    _end_with_parent()
    os.environ.clear()
    os.environ.update(environment)
    with open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)
    for descriptor in (1, 2):
        os.dup2(output.fileno(), descriptor)
    output.close()
    sys.stdout, sys.stderr = (_written_by_line(descriptor) for descriptor in (1, 2))
    program = importlib.import_module(module)
    sys.argv = [program.__file__ or module, *arguments]
    program.main()


def _written_by_line(descriptor: int) -> io.TextIOWrapper:
    return open(descriptor, "w", buffering=1, errors="replace", closefd=False)


def _end_with_parent() -> None:
    """Get SIGINT when the launcher is killed, so that no node is left behind and the bag is closed.

    The parent is the process that nodes are forked from. It lives as long as anybody holds what keeps it alive, which
    each child was given; without that it ends with the launcher.
    """
    os.close(forkserver._forkserver._forkserver_alive_fd)  # type: ignore[attr-defined]
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGINT)

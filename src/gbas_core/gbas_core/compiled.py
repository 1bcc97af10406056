"""Compiled functions: loops over single numbers that numpy would be slow at."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

_Function = TypeVar("_Function", bound=Callable[..., Any])


def compiled(function: _Function) -> _Function:
    """The function compiled, once a machine. No ``fastmath``: the order of sums and the meaning of NaN stay."""
    return cast(_Function, njit(cache=True, error_model="numpy")(function))


def as_written(function: _Function) -> _Function:
    """The Python of a compiled function: a formula of single numbers is one of arrays too."""
    return cast(_Function, getattr(function, "py_func", function))

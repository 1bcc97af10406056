# mypy: disable-error-code="no-untyped-call"
"""Compiled functions: loops over single numbers that numpy would be slow at.

What is compiled is kept beside its module (or, where that cannot be written, in the user's cache) for the next process.
A cache that cannot be read or written costs time and nothing else.
"""

from __future__ import annotations

import contextlib
import hashlib
import types
import warnings
from collections.abc import Callable, Iterator
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import numba
import numpy as np
from numba.core import caching

_Function = TypeVar("_Function", bound=Callable[..., Any])

_dispatchers: Final[list[Any]] = []
_OPTIONS: Final[dict[str, Any]] = {"error_model": "numpy", "no_cfunc_wrapper": True}  # nothing in C calls them


def compiled(function: _Function) -> _Function:
    """The function compiled, once a machine. No ``fastmath``: the order of sums and the meaning of NaN stay."""
    if getattr(numba.config, "DISABLE_JIT", False):
        return function
    dispatcher: Any = numba.njit(**_OPTIONS)(function)
    try:
        kept = dispatcher._cache = _Kept(function)
        dispatcher._compile_for_args = kept.noting_calls(dispatcher._compile_for_args)
    except (OSError, RuntimeError):  # numba's word for no folder that can be written
        _note_once("nowhere", "no folder for compiled functions can be written, so every process compiles them anew")
    _dispatchers.append(dispatcher)
    return cast(_Function, dispatcher)


def as_written(function: Callable[..., Any]) -> Callable[..., Any]:
    """The Python of a compiled function: a formula of single numbers is one of arrays too."""
    return cast("Callable[..., Any]", getattr(function, "py_func", function))


def load_ahead() -> int:
    """Load what Python has called before of the functions known by now, so that no first call waits; how many.

    Other functions are compiled into the loops that call them.
    """
    return sum(each._cache.load_all(each) for each in _dispatchers if isinstance(each._cache, _Kept))


_tried: Final[dict[str, OSError | None]] = {}


class _OnceAFolder:
    """A place for caches that is tried once, not for each function."""

    def ensure_cache_path(self) -> None:
        path = self.get_cache_path()  # type: ignore[attr-defined]
        if path not in _tried:
            try:
                super().ensure_cache_path()  # type: ignore[misc]
                _tried[path] = None
            except OSError as error:
                _tried[path] = error
        if (failed := _tried[path]) is not None:
            raise failed


class _Given(_OnceAFolder, caching.UserProvidedCacheLocator):
    """The folder of NUMBA_CACHE_DIR."""


class _Beside(_OnceAFolder, caching.InTreeCacheLocator):
    """Beside the module."""


class _OfUser(_OnceAFolder, caching.UserWideCacheLocator):
    """The user's cache."""


class _Places(caching.CompileResultCacheImpl):
    _locator_classes = [_Given, _Beside, _OfUser]  # noqa: RUF012


class _Kept(caching.FunctionCache):
    """A function's cache that is valid for what the function calls, too, and never ends a program."""

    _impl_class = _Places

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._called = Path(self._cache_file._index_path).with_suffix(".called")

    def noting_calls(self, first_call: Callable[..., Any]) -> Callable[..., Any]:
        """What Python's first call of a form leads to, with a note that Python calls it."""

        def noted(*arguments: Any, **names: Any) -> Any:
            with contextlib.suppress(OSError):
                self._called.touch()
            return first_call(*arguments, **names)

        return noted

    @cached_property
    def stamp(self) -> bytes:
        """Made at the first use, when all that the function calls is there."""
        return stamp_of(self._py_func)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            self._cache_file._source_stamp = self.stamp
            return super().load_overload(sig, target_context)
        except Exception as error:
            _note_once(
                "read", f"compiled functions in {self.cache_path} cannot be read and are compiled anew: {error!r}"
            )
            Path(self._cache_file._index_path).unlink(missing_ok=True)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            self._cache_file._source_stamp = self.stamp
            super().save_overload(sig, data)
        except Exception as error:
            _note_once("write", f"compiled functions cannot be kept in {self.cache_path}: {error!r}")

    def load_all(self, dispatcher: Any) -> int:
        """Load the first form there is for this machine, which is that of the set-up."""
        if not self._called.exists():
            return 0
        try:
            self._cache_file._source_stamp = self.stamp
            kept = list(self._cache_file._load_index())
        except Exception:
            return 0  # the first call will say so
        codegen = dispatcher.targetctx.codegen()
        for form, *rest in kept:
            if (form, *rest) == self._index_key(form, codegen):
                dispatcher.compile(form)
                return 1
        return 0


_noted: Final[set[str]] = set()


def _note_once(kind: str, text: str) -> None:
    if kind not in _noted:
        _noted.add(kind)
        warnings.warn(text, RuntimeWarning, stacklevel=4)


def stamp_of(function: Callable[..., Any]) -> bytes:
    """Digest of all that is compiled into a function: functions it calls, by their modules, and constants."""
    parts: set[bytes] = set()
    seen, waiting = {function}, [function]
    while waiting:
        each = waiting.pop()
        parts.add(_source(each.__code__.co_filename))
        for name, value in _outside(each):
            inner = getattr(value, "py_func", None)
            if inner is not None and inner not in seen:
                seen.add(inner)
                waiting.append(inner)
            elif isinstance(value, np.ndarray):
                parts.add(f"{name} {value.dtype} {value.shape} ".encode() + value.tobytes())
            elif isinstance(value, int | float | complex | str | bytes | tuple):
                parts.add(f"{name}={value!r}".encode())
    return hashlib.sha256(b"\0".join(hashlib.sha256(part).digest() for part in sorted(parts))).digest()


def _outside(function: Callable[..., Any]) -> Iterator[tuple[str, Any]]:
    """Global names the function uses, in order, with their values; of a module, what it uses of it."""
    used = {name for code in _codes(function.__code__) for name in code.co_names}
    for name in sorted(used & function.__globals__.keys()):
        value = function.__globals__[name]
        if isinstance(value, types.ModuleType):
            yield from ((f"{name}.{each}", getattr(value, each)) for each in sorted(used & vars(value).keys()))
        else:
            yield name, value


def _codes(code: types.CodeType) -> Iterator[types.CodeType]:
    yield code
    for each in code.co_consts:
        if isinstance(each, types.CodeType):
            yield from _codes(each)


@cache
def _source(path: str) -> bytes:
    return hashlib.sha256(Path(path).read_bytes()).digest()

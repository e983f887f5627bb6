"""Compilation of the reduced engine's arithmetic: by numba where it is, else left as it is."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

F = TypeVar("F", bound=Callable)

try:
    from numba import njit
except ImportError:  # without the extra `fast` the same functions run as plain Python
    njit = None


def compiled(function: F) -> F:
    """Return a function compiled for those that are compiled themselves, or as it is."""
    return _compiled(function)


def inlined(function: F) -> F:
    """Return a function compiled into those that call it, or as it is."""
    return _compiled(function, forceinline=True)


def entry(function: F) -> F:
    """Return a function compiled for everybody, or as it is."""
    return _compiled(function, no_cpython_wrapper=False)


def _compiled(function: F, *, no_cpython_wrapper: bool = True, forceinline: bool = False) -> F:
    if njit is None:
        return function
    # numba's cache sees changes in a function's own file alone, and in its name.
    function.__qualname__ += f"_{_SOURCES}"
    return njit(  # pyright: ignore[reportCallIssue]
        cache=True,
        nogil=True,
        error_model="numpy",
        no_cpython_wrapper=no_cpython_wrapper,
        no_cfunc_wrapper=True,
        forceinline=forceinline,
    )(function)


def _digest() -> str:
    files = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:12]


_SOURCES = _digest()

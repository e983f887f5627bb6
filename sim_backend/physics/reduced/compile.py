"""Compilation of the reduced engine by numba; without numba its functions stay Python."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

F = TypeVar("F", bound=Callable)

try:
    from numba import njit
except ImportError:  # without the extra `fast`: the same functions as plain Python
    njit = None


def compiled(function: F) -> F:
    """Compile a function for calls from compiled code only."""
    return _compiled(function)


def inlined(function: F) -> F:
    """Compile a function to be inlined by its compiled callers."""
    return _compiled(function, forceinline=True)


def entry(function: F) -> F:
    """Compile a function for calls from Python."""
    return _compiled(function, no_cpython_wrapper=False)


def _compiled(function: F, *, no_cpython_wrapper: bool = True, forceinline: bool = False) -> F:
    if njit is None:
        return function
    # numba's cache detects changes of a function's own file and name only, so the name contains a
    # hash of all files.
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

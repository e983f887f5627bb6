"""Compilation of the exact engine by numba; without numba its functions stay Python."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, TypeVar

from numpy.typing import NDArray

F = TypeVar("F", bound=Callable)

try:
    from numba import njit
except ImportError:  # without the extra `fast`: the same functions as plain Python
    njit = None


def compiled(function: F) -> F:
    """Compile a function, also for calls from Python."""
    return _compiled(function)


def inlined(function: F) -> F:
    """Compile a function into those that call it."""
    return _compiled(function, forceinline=True)


def expanded(function: F) -> F:
    """Expand a function that returns records, which no compiled function can, in its callers."""
    return _compiled(function, inline="always")


def _compiled(function: F, **options: Any) -> F:
    if njit is None:
        return function
    # numba's cache detects changes of a function's own file and name only, so the name contains a
    # hash of all files.
    function.__qualname__ += f"_{_SOURCES}"
    return njit(  # pyright: ignore[reportCallIssue]
        cache=True,
        nogil=True,
        error_model="numpy",
        no_cfunc_wrapper=True,
        _nrt=False,  # no reference counts: the arrays belong to the caller
        **options,
    )(function)


def records(array: NDArray[Any]) -> Any:
    """Return an array of records; without numba, where these are slow, as lists of objects.

    Args:
        array: Of shape (n,) or (m, n); compiled functions change it in place.
    """
    if njit is not None:
        return array
    if array.ndim > 1:
        return [records(row) for row in array]
    names = array.dtype.names or ()
    return [
        SimpleNamespace(
            **{name: row[name] if row[name].ndim else row[name].item() for name in names}
        )
        for row in array
    ]


def _digest() -> str:
    files = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:12]


_SOURCES = _digest()

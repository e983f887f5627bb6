"""Compilation of the exact engine by numba; without numba its functions stay Python.

Numba compiles a function once more for every literal integer or truth value among the arguments of
its calls; signs and similar arguments are therefore floats.
"""

import hashlib
import logging
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from numpy.typing import NDArray

from sautereau.sim_backend.physics.structures import as_objects

F = TypeVar("F", bound=Callable)

try:
    from numba import njit
    from numba.core import event
except ImportError:  # without the extra `fast`: the same functions as plain Python
    njit = event = None

_LOG = logging.getLogger(__name__)


def _compiled(function: F, **options: Any) -> F:
    if njit is None:
        return function
    # numba's cache detects changes of a function's own file and name only, so the name contains a
    # hash of all files.
    function.__qualname__ += f"_{_SOURCES}"
    settings: dict[str, Any] = {
        "cache": True,
        "nogil": True,
        "error_model": "numpy",
        "forceinline": False,  # if not given, what is compiled for an inlined function inherits it
        "no_cpython_wrapper": True,  # which takes as long to compile as a small function
        "no_cfunc_wrapper": True,
        "_nrt": False,  # no reference counts: the arrays belong to the caller
    }
    compiler: Any = njit(**settings | options)
    return compiler(function)


entry = partial(_compiled, no_cpython_wrapper=False)
"""Compile a function for calls from Python, too."""
compiled = _compiled
"""Compile a function for calls from compiled ones."""
inlined = partial(_compiled, forceinline=True)
"""Compile a function into those that call it."""
expanded = partial(_compiled, inline="always")
"""Expand a function in its callers, which takes less time to compile if there is only one."""


def records(array: NDArray[Any]) -> Any:
    """Return an array of records; without numba, where these are slow, as a list of objects.

    Args:
        array: Of shape (n,); compiled functions change it in place.
    """
    return as_objects(array) if njit is None else array


class Announcement(
    event.Listener if event else object  # pyright: ignore[reportGeneralTypeIssues]
):
    """Logs once that this engine is compiled, as it is where numba's cache lacks it."""

    def __init__(self):
        self._done = False

    def on_start(self, event: Any) -> None:
        """Take the start of the compilation of a function."""
        if self._done or not event.data["dispatcher"].py_func.__qualname__.endswith(_SOURCES):
            return
        self._done = True
        level = logging.WARNING if sys.stderr.isatty() else logging.INFO
        _LOG.log(level, "compiling the exact engine, once for this version: about 15 s")

    def on_end(self, event: Any) -> None:
        """Take the end of a compilation."""


_FOLDER = Path(__file__).parent
_FILES = _FOLDER.parent / "laws.py", _FOLDER.parent / "structures.py", *sorted(_FOLDER.glob("*.py"))
_SOURCES = hashlib.sha256(b"".join(file.read_bytes() for file in _FILES)).hexdigest()[:12]
if event:
    event.register("numba:compile", Announcement())

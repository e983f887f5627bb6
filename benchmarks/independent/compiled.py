"""Compile with numba where it is installed; plain Python is about 100 times slower."""

try:
    from numba import njit
except ImportError:  # the extra `fast` is not installed

    def njit(*_arguments, **_options):
        """Return a decorator that changes nothing."""
        return lambda function: function


entry = njit(cache=True, error_model="numpy", no_cfunc_wrapper=True)
"""For what Python calls."""
compiled = njit(
    cache=True,
    error_model="numpy",
    forceinline=False,  # if not given, what is compiled for an inlined function inherits it
    no_cpython_wrapper=True,  # which takes as long to compile as a small function
    no_cfunc_wrapper=True,
    _nrt=False,
)
"""For what only compiled functions call; without reference counts, so it can make no arrays."""
inlined = njit(inline="always", error_model="numpy")
"""For what a compiled function calls in every step."""

"""Compile with numba where it is installed; plain Python is about 100 times slower."""

try:
    from numba import njit
except ImportError:  # the extra `fast` is not installed

    def njit(*_arguments, **_options):
        """Return a decorator that changes nothing."""
        return lambda function: function


compiled = njit(cache=True, error_model="numpy")
inlined = njit(inline="always", error_model="numpy")
"""For what a compiled function calls in every step: a call costs a count for each of its arrays."""

"""What counts as a difference, and why: the one place of all tolerances.

JSON keys, the number of elements, integers, words of texts, subjects of warnings and the bytes on
the wire are compared exactly, because they are the same on every machine. Floats may differ in the
order of additions in BLAS, numba and the compiler's vector instructions.
"""

import math
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

INSTANT = 0.1
"""Of the standard uncertainty that stands beside a value as NAME_std: a smaller change means
nothing to the user. Searches for an instant end within less than that on every machine."""
MODEL = 1e-9  # Relative, of predictions: closed forms and roots that are solved to 1e-12
OTHER = 1e-6
"""Relative, of all other floats: they follow from fits whose steps end below 1e-8 of a value, and
no text shows more than six digits of them."""
ZERO = 1e-12
"""SI, a difference below which a float counts as 0: that of two equal values of any quantity."""
SAMPLES = 2.0**-19
"""Of the largest sample, on the signed sum of a signal: 32 steps of a converter of 24 bits. It lets
single samples fall into the next step, as rounding does on another machine and with another numpy
(2.0 and 2.4 differ by 5 steps), while another seed, filter or motion changes thousands of samples
by more than a step."""
LAST_PLACE = 1.01
"""Units of the last place of a number with decimals in a text: rounding on another machine."""
RELATIVE = {"wire": 0.0, "model": MODEL}  # By the group of answers; 0 is exact, also in texts

_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?", re.ASCII)
SIGNAL = {"n", "peak", "sums"}  # Keys of what `plain.checksum` returns
MISSING = "(missing)"
ROUNDING = "rounding"
"""Key of the stored answers of presses whose samples depend on the processor (`--write`)."""
CHANGED = "other samples: the simulation or its input changed, nothing else of it is compared"


class Difference(NamedTuple):
    """A stored answer that is another one now."""

    case: str
    field: str
    stored: Any
    now: Any
    tolerance: str = "exact"

    def __str__(self) -> str:
        return (
            f"{self.case}: {self.field}\n    stored: {self.stored!r}\n    now:    {self.now!r}"
            f"\n    tolerance: {self.tolerance}"
        )


def differences(case: str, stored: Any, now: Any, relative: float = OTHER) -> Iterator[Difference]:
    """Yield what differs between two answers, which consist of what JSON can hold.

    Args:
        case: Name of the answers.
        relative: Tolerance of floats, and 0 for an exact comparison.
    """
    for found in _walk("", stored, now, relative, None):
        yield found._replace(case=case)


def same_samples(stored: Any, now: Any) -> bool:
    """Return whether signals, as `plain.checksum` describes them, have the same samples.

    Args:
        stored: One signal, signals by their names, or None.
        now: The same.
    """
    if not isinstance(stored, dict) or not isinstance(now, dict) or stored.keys() != now.keys():
        return stored == now
    if stored.keys() != SIGNAL:
        return all(same_samples(each, now[name]) for name, each in stored.items())
    limit = SAMPLES * max(stored["peak"], now["peak"]) + ZERO
    pairs = zip(stored["sums"], now["sums"], strict=True)
    return stored["n"] == now["n"] and all(abs(a - b) <= limit for a, b in pairs)


def _walk(field: str, stored: Any, now: Any, relative: float, std: Any) -> Iterator[Difference]:
    if isinstance(stored, dict) and isinstance(now, dict):
        yield from _mappings(field, stored, now, relative)
    elif isinstance(stored, list) and isinstance(now, list):
        yield from _lists(field, stored, now, relative, std)
    elif isinstance(stored, str) and isinstance(now, str):
        if not _same_text(stored, now, relative):
            words = "exact, numbers to their last place" if relative else "exact"
            yield Difference("", field, stored, now, words)
    elif type(stored) is float or type(now) is float:
        yield from _floats(field, stored, now, relative, std)
    elif stored != now or type(stored) is not type(now):
        yield Difference("", field, stored, now)


def _mappings(field: str, stored: dict, now: dict, relative: float) -> Iterator[Difference]:
    if not same_samples(stored.get("sampled"), now.get("sampled")):
        yield Difference("", _under(field, "sampled"), CHANGED, now.get("sampled"))
        return
    if stored.keys() == SIGNAL:
        if not same_samples(stored, now):
            yield Difference("", field, stored, now, f"{SAMPLES:.2g} of the peak, on the sums")
        return
    for name in dict.fromkeys([*stored, *now]):
        if name in ("sampled", ROUNDING):
            continue
        inner = _under(field, name)
        if name not in stored or name not in now:
            yield Difference("", inner, stored.get(name, MISSING), now.get(name, MISSING))
        else:
            std = stored.get(f"{name}_std")
            yield from _walk(inner, stored[name], now[name], relative, std)


def _lists(field: str, stored: list, now: list, relative: float, std: Any) -> Iterator[Difference]:
    if len(stored) != len(now):
        yield Difference("", f"{field}, number of elements", stored, now)
        return
    stds = std if isinstance(std, list) and len(std) == len(stored) else [None] * len(stored)
    for number, (before, after, each) in enumerate(zip(stored, now, stds, strict=True)):
        yield from _walk(f"{field}[{number}]", before, after, relative, each)


def _floats(field: str, stored: Any, now: Any, relative: float, std: Any) -> Iterator[Difference]:
    numbers = all(type(value) in (int, float) for value in (stored, now))
    tolerance, words = relative, f"{relative:g} of the value"
    if numbers:
        tolerance = relative * abs(stored) + ZERO * bool(relative)
        if isinstance(std, float) and INSTANT * std > tolerance:
            tolerance, words = INSTANT * std, f"{INSTANT:g} of the uncertainty: {INSTANT * std:.3g}"
    if not numbers or not abs(stored - now) <= tolerance:
        yield Difference("", field, stored, now, words)


def _same_text(stored: str, now: str, relative: float) -> bool:
    """Return whether two texts have the same words, and numbers that may be rounded otherwise."""
    if stored == now or not relative:
        return stored == now
    if _NUMBER.sub("#", stored).split() != _NUMBER.sub("#", now).split():
        return False
    pairs = zip(_NUMBER.findall(stored), _NUMBER.findall(now), strict=True)
    return all(_same_number(before, after) for before, after in pairs)


def _same_number(stored: str, now: str) -> bool:
    if stored == now or not {".", "e"} & set(stored + now):
        return stored == now
    digits, _, exponent = stored.partition("e")
    place = 10.0 ** (int(exponent or 0) - len(digits.partition(".")[2]))
    return math.isclose(float(stored), float(now), rel_tol=0.0, abs_tol=LAST_PLACE * place)


def _under(field: str, name: str) -> str:
    return f"{field}.{name}" if field else name

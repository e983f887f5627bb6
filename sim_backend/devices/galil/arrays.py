"""The controller's arrays, and the capture that fills them, sample by sample."""

import re
from collections.abc import Callable

from sautereau.sim_backend.devices.galil.faults import CommandError

ARRAYS = 30  # Arrays that may be defined

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9]{0,7}")


class Arrays:
    """Named arrays in a memory of fixed size.

    Args:
        elements: That all arrays together may have.
        burned: Arrays to start with.
    """

    def __init__(self, elements: int, burned: dict[str, list[float]]) -> None:
        self._elements = elements
        self._values = {name: list(values) for name, values in burned.items()}

    @property
    def unused(self) -> int:
        """Arrays that may still be defined."""
        return ARRAYS - len(self._values)

    def items(self) -> list[tuple[str, list[float]]]:
        """Return names and values in alphabetical order."""
        return sorted(self._values.items())

    @property
    def free(self) -> int:
        """Elements that are not in use."""
        return self._elements - sum(map(len, self._values.values()))

    def define(self, sizes: dict[str, int]) -> None:
        """Define arrays of zeros, all of them or none.

        Raises:
            CommandError: A name is invalid or in use, or the memory is full.
        """
        for name, size in sizes.items():
            if not _NAME.fullmatch(name) or name in self._values:
                raise CommandError(57)
            if not 1 <= size <= self._elements:
                raise CommandError(84)
        if len(self._values) + len(sizes) > ARRAYS:
            raise CommandError(67)
        if sum(sizes.values()) > self.free:
            raise CommandError(66)
        self._values.update({name: [0.0] * size for name, size in sizes.items()})

    def remove(self, names: set[str]) -> None:
        """Free the memory of arrays, all of them or none; ``*`` means every array."""
        for name in names - {"*"}:
            self.values(name)
        for name in list(self._values) if "*" in names else names:
            del self._values[name]

    def values(self, name: str) -> list[float]:
        """Return an array itself, into which a capture writes."""
        if name not in self._values:
            raise CommandError(82)
        return self._values[name]

    def element(self, name: str, index: float) -> float:
        """Return one element; index -1 is the array's length."""
        values = self.values(name)
        if index == -1:
            return float(len(values))
        if not 0 <= index < len(values):
            raise CommandError(56)
        return values[int(index)]

    def set_element(self, name: str, index: float, value: float) -> None:
        """Set one element."""
        self.element(name, index)
        if index < 0:
            raise CommandError(56)
        self.values(name)[int(index)] = value


class Capture:
    """RA, RD and RC: every 2^n samples, one number of each source into its array."""

    def __init__(self) -> None:
        self.arrays: list[list[float]] = []
        self.sources: list[Callable[[], float]] = []
        self.index = 0
        """Element that is written next."""
        self.running = False
        self._period = self._countdown = self._length = 0
        self._circular = False

    def start(self, exponent: int, count: int = 0) -> None:
        """Start with the next sample.

        Args:
            exponent: 1 to 8; one record every 2^exponent samples.
            count: Records to take; 0 fills the arrays, a negative number wraps around.

        Raises:
            CommandError: A capture runs, has no arrays or sources, or the arrays are too short.
        """
        if self.running:
            raise CommandError(80)
        if not self.arrays or len(self.arrays) != len(self.sources):
            raise CommandError(81)
        room = min(map(len, self.arrays))
        if abs(count) > room:
            raise CommandError(84)
        self._length, self._circular = abs(count) or room, count < 0
        self._period, self._countdown = 2**exponent, 0
        self.index, self.running = 0, True

    @property
    def awaited(self) -> bool:
        """Whether it runs and ends by itself."""
        return self.running and not self._circular

    def stop(self) -> None:
        """Stop; what has been recorded stays."""
        self.running = False

    def sample(self) -> None:
        """Record, if it is due: the first sample after the start is the first record."""
        if self._countdown > 0:
            self._countdown -= 1
            return
        self._countdown = self._period - 1
        for values, source in zip(self.arrays, self.sources, strict=True):
            values[self.index] = source()
        self.index += 1
        if self.index == self._length:
            self.index = 0 if self._circular else self.index
            self.running = self._circular

"""Digital outputs, of which some may be brakes."""

from collections.abc import Sequence

from sautereau.sim_backend.devices.emulators import OnOutput
from sautereau.sim_backend.devices.galil.axis import Axis
from sautereau.sim_backend.devices.galil.memory import OUTPUTS


class Outputs:
    """The outputs, numbered from 1, and what they show.

    Args:
        on_output: Called with number and level when an output changes.
    """

    def __init__(self, on_output: OnOutput) -> None:
        self.bits = [False] * OUTPUTS
        """Levels as set, without the brakes'."""
        self._levels = [False] * OUTPUTS
        self._axes: Sequence[Axis] = ()
        self._on_output = on_output

    @property
    def value(self) -> int:
        """What OP reports."""
        return sum(level << bit for bit, level in enumerate(self.bits))

    def reset(self, bits: Sequence[bool], axes: Sequence[Axis]) -> None:
        """Start with burned levels, and with the axes whose BW makes an output a brake."""
        self.bits, self._axes = list(bits), axes
        self.update()

    def is_brake(self, number: int) -> bool:
        """Return whether an output is an axis's brake."""
        return number <= len(self._axes) and self._axes[number - 1].settings["BW"] > 0

    def level(self, number: int) -> bool:
        """Return what @OUT reports, which a brake does not change."""
        return not self.is_brake(number) and self.bits[number - 1]

    def set(self, number: int, level: bool) -> None:
        """Set an output; this changes no brake."""
        if not self.is_brake(number):
            self.bits[number - 1] = level
        self.update()

    def update(self) -> None:
        """Report the outputs that have changed; a brake is on while its motor is off."""
        for number in range(1, OUTPUTS + 1):
            level = self.bits[number - 1]
            if self.is_brake(number):
                level = not self._axes[number - 1].motor_on
            if self._levels[number - 1] != level:
                self._levels[number - 1] = level
                self._on_output(number, level)

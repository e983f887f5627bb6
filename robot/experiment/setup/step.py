"""A step of the set-up: its questions to the operator and its results."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol

from sautereau.rig.edit import TomlValue
from sautereau.rig.schema import Rig
from sautereau.robot.controller import MotionController, motion_controller
from sautereau.robot.errors import RobotError


class Declined(RobotError):  # noqa: N818 - the name states what happened
    """The operator did not agree; nothing was done."""


class Ask(Protocol):
    """Asks the operator, or answers for them."""

    def confirm(self, question: str) -> bool:
        """Return whether the answer is yes."""
        ...

    def act(self, instruction: str) -> bool:
        """Have the operator do something by hand; return False where nobody is there to do it."""
        ...

    def number(self, question: str, unit: str, expected: float) -> float | None:
        """Return a measured value.

        Args:
            unit: SI unit of the answer and of the expected value.

        Returns:
            The value in that unit; None where it cannot be measured.
        """
        ...


@dataclass(frozen=True)
class Found:
    """The results of a step."""

    lines: tuple[str, ...]
    """Text for the operator."""
    values: Mapping[str, TomlValue] = field(default_factory=dict)
    """For the rig file, by dotted key; empty where it contains them already. One that is a table
    with its `value` becomes a table with its source there."""
    figures: Mapping[str, float] = field(default_factory=dict)
    """SI, by name."""
    warnings: tuple[str, ...] = ()
    """Doubts about the results."""

    @property
    def plain(self) -> dict[str, TomlValue]:
        """The values without their tables, which are there to be written with their source."""
        return {k: v["value"] if isinstance(v, dict) else v for k, v in self.values.items()}


def ask_first(ask: Ask, step: str, what: str) -> None:
    """Continue only where the answer is yes.

    Raises:
        Declined: The answer is no.
    """
    if not ask.confirm(what):
        raise Declined(
            f"setup {step}: not agreed to, so nothing was done; prepare the bench and give the"
            " command again"
        )


@contextmanager
def homed(rig: Rig) -> Iterator[MotionController]:
    """Yield the arm at home with its motors on; they are always off after the block."""
    with motion_controller(rig) as controller, controller.powered():
        controller.home()
        yield controller


def approach_speed(rig: Rig) -> float:
    """Return `arm.approach_speed` in counts per second."""
    return rig.arm.approach_speed / rig.arm.radians_per_count

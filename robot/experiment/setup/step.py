"""What a step of the set-up asks, and what it gives."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol

from sautereau.rig.schema import Rig
from sautereau.robot.controller import MotionController
from sautereau.robot.drivers.registry import motion_controller
from sautereau.robot.errors import RobotError


class Declined(RobotError):  # noqa: N818 - the name says what happened
    """Whoever was asked said no; nothing was done."""


class Ask(Protocol):
    """Somebody at the bench, or who stands for him."""

    def confirm(self, question: str) -> bool:
        """Return whether the answer is yes."""
        ...

    def number(self, question: str, unit: str, expected: float) -> float | None:
        """Return what was measured.

        Args:
            question: What to measure.
            unit: SI unit of the answer and of what is expected.
            expected: What it should be.

        Returns:
            The quantity in that unit; None where nobody can measure it.
        """
        ...


@dataclass(frozen=True)
class Found:
    """What a step has found."""

    lines: tuple[str, ...]
    """For the reader."""
    values: Mapping[str, str | int] = field(default_factory=dict)
    """For the rig file, by dotted key; empty where it holds them already."""
    figures: Mapping[str, float] = field(default_factory=dict)
    """SI, by name."""
    warnings: tuple[str, ...] = ()
    """What is doubtful."""


Step = Callable[[Rig, Ask], Found]


def ask_first(ask: Ask, step: str, what: str) -> None:
    """Go on only where the answer is yes.

    Raises:
        Declined: It is no.
    """
    if not ask.confirm(what):
        raise Declined(
            f"setup {step}: not agreed to, so nothing was done; make the bench ready and give the"
            " command again"
        )


@contextmanager
def homed(rig: Rig) -> Iterator[MotionController]:
    """Yield the arm with its motors on and at home; they are off afterwards, whatever happens."""
    with motion_controller(rig) as controller, controller.powered():
        controller.home()
        yield controller


def approach_speed(rig: Rig) -> float:
    """Return `arm.approach_speed` in counts a second."""
    return rig.arm.approach_speed * counts_per_radian(rig)


def counts_per_radian(rig: Rig) -> float:
    """Return the encoder counts of a radian."""
    from math import pi

    return rig.arm.counts_per_revolution / (2 * pi)

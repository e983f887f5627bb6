"""What the steps of a verification share: the controller, the operator and the results."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from sautereau.rig.schema import Rig
from sautereau.robot.drivers.driver import POLL
from sautereau.robot.drivers.galil.driver import GalilDriver
from sautereau.robot.drivers.galil.line import Line
from sautereau.robot.drivers.powered_arm import PoweredArm
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.setup.step import Ask, Declined


class Surprise(RobotError):  # noqa: N818 - the name states what happened
    """The controller is not as the rig and the command reference say; the verification ends."""


@dataclass
class Workbench:
    """One verification under way."""

    rig: Rig
    ask: Ask
    controller: PoweredArm[GalilDriver]
    step: str = ""
    """Number and name of the current step."""
    lines: list[str] = field(default_factory=list)
    """Text for the operator."""
    values: dict[str, str | int | list[str]] = field(default_factory=dict)
    """For the rig file, by dotted key."""
    figures: dict[str, float] = field(default_factory=dict)
    """SI, by name."""
    warnings: list[str] = field(default_factory=list)
    """What could not be measured, and doubts."""

    @property
    def of_daq(self) -> dict[str, str | int | list[str]]:
        """What was found of the acquisition, for the steps after it."""
        return {key: value for key, value in self.values.items() if key.startswith("daq.")}

    @property
    def driver(self) -> GalilDriver:
        """The driver of the connection."""
        return self.controller.driver

    @property
    def line(self) -> Line:
        """The line to the controller."""
        return self.driver.line

    def expect(self, holds: bool, what: str, fix: str) -> None:
        """End the verification unless something holds.

        Raises:
            Surprise: Names the step, what was found and what to do.
        """
        if not holds:
            raise Surprise(f"setup verify, step {self.step}: {what}; {fix}")

    def until(self, holds: Callable[[], bool], limit: float) -> bool:
        """Ask until something holds, for ``limit`` s at most; return whether it does."""
        deadline = time.perf_counter() + limit
        while not (held := holds()) and time.perf_counter() < deadline:
            time.sleep(POLL)
        return held

    def by_hand(self, instruction: str) -> bool:
        """Have the operator do something; note it where nobody is there to do it."""
        done = self.ask.act(instruction)
        if not done:
            self.warn(f"not measured without an operator: {instruction}")
        return done

    def say(self, text: str) -> None:
        """Add a line to the results."""
        self.lines.append(f"{self.step}: {text}")

    def warn(self, text: str) -> None:
        """Add a doubt to the results."""
        self.warnings.append(f"{self.step}: {text}")


@dataclass(frozen=True)
class VerifyStep:
    """One step of the verification."""

    number: str
    """`A` before the amplifiers have power, `B` with the motors on."""
    name: str
    what: str
    """What it finds out, for docs/galil.md."""
    run: Callable[[Workbench], None]

    def __call__(self, bench: Workbench) -> None:
        """Run the step.

        Raises:
            RobotError: The first surprise; the motors are off.
        """
        bench.step = f"{self.number} {self.name}"
        try:
            self.run(bench)
        except (Surprise, Declined):
            raise
        except RobotError as error:
            surprise = Surprise(f"setup verify, step {bench.step}: {error.args[0]}")
            surprise.aftermath = error.aftermath
            raise surprise from error

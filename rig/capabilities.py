"""What a kind of motion controller can do, which planner and experiment ask instead of its name."""

from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from sautereau.rig.registry import CONTROLLERS

if TYPE_CHECKING:
    from sautereau.rig.schema import Rig


class HomingKind(StrEnum):
    """How a controller learns where its joints are."""

    SWITCHES = "switches"
    """It seeks home switches, which can be found again to notice an encoder that has slipped."""
    ABSOLUTE = "absolute"
    """Its encoders know; nothing moves."""


@dataclass(frozen=True)
class Capabilities:
    """What a kind of controller can do, whatever the bench."""

    trigger_output: bool
    """Whether an output's edge marks the start of a motion. Without it, the acquisition starts
    before the motion, and the start is found in the samples."""
    torque_feed_forward: bool
    """Whether it adds torques to those of its position loops."""
    preloaded: bool
    """Whether it stores a motion, `controller.segment_limit` segments at most, and plays it by
    its own clock; otherwise the host streams it."""
    capture_interval: int
    """Controller samples between two rows of its finest record of a motion."""
    homing: HomingKind
    lead_intervals: int = 0
    """`capture_interval`s for which it records the arm at rest before a motion."""

    def capture_rate(self, sample_period: float) -> float:
        """Return the rows per second of its finest record; ``sample_period`` is in s."""
        return 1 / (self.capture_interval * sample_period)

    def lead(self, sample_period: float) -> float:
        """Return the time [s] from the request to start a motion to its start, as intended."""
        return self.lead_intervals / self.capture_rate(sample_period)


def capabilities_of(rig: "Rig") -> Capabilities:
    """Return what the controller of a rig can do; nothing is connected.

    Raises:
        RigError: No installed package provides `controller.kind`, or importing it failed.
    """
    return CONTROLLERS.get(rig.controller.kind)(rig).capabilities

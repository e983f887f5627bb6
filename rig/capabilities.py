"""What motion controllers can do: each kind, and each of Galil's models.

Planner and experiment ask for the capabilities of a kind instead of its name. The table of models
is `capabilities.csv`, after the lists in the manufacturer's command reference; of the commands only
those count that the emulated controller knows. Driver and stand-in read it.
"""

import functools
import re
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Self

from sautereau.rig.disk import table_beside
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


PVT = frozenset({"PV", "BT"})  # Commands, and operands, of motions with position, velocity and time


@dataclass(frozen=True)
class GalilModel:
    """One model with its firmware."""

    family: str
    """Family, as the command reference names it."""
    axes: int
    """Number of axes; their letters begin with A."""
    absent: frozenset[str]
    """Commands, and operands, that model or firmware does not know."""

    @classmethod
    def of(cls, revision: str) -> Self | None:
        """Return the model of an answer to ^R^V such as `DMC4020 Rev 1.3a`; None if unknown."""
        named = re.match(r"DMC(\d+)(?!\S)(?: Rev (\S*))?", revision)
        for family, _, pattern, absent in _table():
            if named and (found := re.fullmatch(pattern, named[1])):
                fast = PVT if "-FAST" in (named[2] or "") else frozenset()
                return cls(family, int(found[1]), frozenset(absent.split()) | fast)
        return None


@functools.cache
def _table() -> list[list[str]]:
    return table_beside(__file__)


def families(needed: frozenset[str] = frozenset()) -> list[str]:
    """Return the names of the families that have all of the commands and a second axis."""
    return [
        name
        for _, name, pattern, absent in _table()
        if not needed & set(absent.split()) and (not needed or "(1)" not in pattern)
    ]

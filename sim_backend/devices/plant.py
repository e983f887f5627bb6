"""The simulated arm as the controller sees it: encoders, switches, amplifiers, and their wiring."""

import math

import numpy as np

from sautereau.sim_backend.devices.emulators import AMPLIFIER_VOLTS
from sautereau.sim_backend.physics.base import World
from sautereau.sim_backend.physics.finger import Reference
from sautereau.trajectory.motion import Floats

Pair = tuple[float, float]


class ArmPlant:
    """Motors, encoders and switches of a world's arm, which may be wired wrongly or fail.

    Joints are counted from 1 in the methods of faults, axes from 0 in those of the controller.

    Args:
        world: With the arm.
        index_angles: rad, of each joint from its home switch to its encoder's index.
        limit_switches: Whether there are switches at the joints' limits.
    """

    def __init__(self, world: World, index_angles: Pair = (0.1, 0.1), limit_switches: bool = False):
        self._world, self._index_angles = world, index_angles
        self._limit_switches = limit_switches
        self._slipped, self._by_hand = [0, 0], [0, 0]
        self._signs = [1, 1]
        self._sources = [0, 1]
        self._frozen: list[float | None] = [None, None]
        self._closed: set[tuple[str, int]] = set()
        self._inverted: set[str] = set()
        self._cut: set[tuple[str, int]] = set()
        self._crossed: set[str] = set()
        self._no_index: set[int] = set()
        self._broken: set[int] = set()
        self._places = self._encoders = self._physical(world.finger.joints())
        self._latched: list[int | None] = [None, None]

    def encoder_counts(self) -> tuple[int, int]:
        """Return the raw encoder counts since power-up, as of the last `sample`."""
        return self._rounded(self._encoders)

    def home_counts(self) -> tuple[int, int]:
        """Return the raw encoder counts at the home switches."""
        return self._rounded(self._seen(self._physical(self._world.rig.arm.home_angles, False)))

    def index(self, axis: int) -> int | None:
        """Return the raw counts of the index that passed in the last sample; None for none."""
        return self._latched[axis]

    def active(self, switch: str, axis: int) -> bool:
        """Return whether current flows in an input: forward, reverse, home or abort.

        The home switches conduct below the home positions.
        """
        group = "limit" if switch in ("forward", "reverse") else switch
        if group in self._crossed:
            if group == "home":
                axis = 1 - axis
            else:
                switch = "reverse" if switch == "forward" else "forward"
        key = switch, 0 if switch == "abort" else axis
        if key in self._cut:
            return False
        on = key in self._closed or (switch != "abort" and self._beyond(switch, axis))
        return on != (group in self._inverted)

    def _beyond(self, switch: str, axis: int) -> bool:
        """Return whether a joint is where its switch conducts."""
        arm, radians = self._world.rig.arm, self._world.radians_per_count
        joint = self._places[axis] * radians + self._world.start[axis]
        if switch == "home":
            return joint < arm.home_angles[axis] - radians / 2
        if not self._limit_switches:
            return False
        if switch == "forward":
            return joint > arm.upper_limits[axis]
        return joint < arm.lower_limits[axis]

    def amplifier_fault(self, axis: int) -> bool:
        """Return whether an axis's amplifier reports overcurrent."""
        return axis in self._broken

    def torque_volts(self) -> Pair:
        """Return the commands to the amplifiers [V]."""
        limit = self._world.rig.arm.torque_limit
        first, second = self._world.finger.torques()
        return first / limit * AMPLIFIER_VOLTS, second / limit * AMPLIFIER_VOLTS

    def drive(self, offsets: Pair, limits: Pair) -> None:
        """Add offsets [V] to the loops' commands from now on, and limit [V] the sums."""
        volt = self._world.rig.arm.torque_limit / AMPLIFIER_VOLTS
        offsets, limits = ((first * volt, second * volt) for first, second in (offsets, limits))
        self._world.finger.drive(offsets, limits)

    def sample(self) -> None:
        """Read the encoders now."""
        before, self._places = self._places, self._physical(self._world.finger.joints())
        self._encoders = self._seen(self._places)
        for axis, joint in enumerate(self._sources):
            self._latched[axis] = None
            if joint in self._no_index or self._frozen[axis] is not None:
                continue
            arm, world = self._world.rig.arm, self._world
            angle = arm.home_angles[joint] + self._index_angles[joint] - world.start[joint]
            turn = arm.counts_per_revolution / arm.gear_ratios[joint]
            first = angle / world.radians_per_count  # place of an index, in counts
            both = self._places[joint], before[joint]
            here, there = (math.floor((place - first) / turn) for place in both)
            if here != there:
                passed = first + max(here, there) * turn
                self._latched[axis] = round(self._signs[axis] * passed + self._slipped[axis])

    def wired(self, reference: Reference) -> Reference:
        """Return the controller's reference as the position loops apply it to the arm.

        The loops follow the encoders: they move the arm by the difference that they see.
        """
        true = self._physical(self._world.finger.joints(), by_hand=False)
        seen = self._seen((true[0] + self._by_hand[0], true[1] + self._by_hand[1]))
        if seen == true:
            return reference
        off = np.subtract(seen, true)

        def of_arm(fractions: Floats) -> tuple[Floats, Floats]:
            counts, speeds = reference(fractions)
            return counts - off, speeds

        return of_arm

    # Faults, and what an operator does by hand.

    def slip(self, joint: int, counts: int) -> None:
        """Offset the readings of a joint's encoder by ``counts`` from now on."""
        self._slipped[joint - 1] += counts
        self.sample()

    def lift(self, joint: int, counts: int) -> None:
        """Move a joint of the unpowered arm by hand."""
        self._by_hand[joint - 1] += counts
        self.sample()

    def reverse(self, joint: int) -> None:
        """Make a joint's encoder count backwards."""
        self._signs[joint - 1] *= -1
        self.sample()

    def swap(self) -> None:
        """Exchange the encoders."""
        self._sources.reverse()
        self.sample()

    def lose_encoder(self, joint: int) -> None:
        """Freeze the readings of a joint's encoder from now on."""
        self._frozen[joint - 1] = float(self._encoders[joint - 1])

    def connect_encoder(self, joint: int) -> None:
        """Connect a lost encoder again; it counts on from where its readings stopped."""
        frozen, self._frozen[joint - 1] = self._frozen[joint - 1], None
        if frozen is not None:
            self._slipped[joint - 1] += round(frozen - self._reading(self._places, joint - 1))
        self.sample()

    def unwire_index(self, joint: int) -> None:
        """Remove the index of a joint's encoder."""
        self._no_index.add(joint - 1)

    def close(self, switch: str, joint: int) -> None:
        """Close a switch: forward, reverse, home or abort."""
        self._closed.add((switch, 0 if switch == "abort" else joint - 1))

    def open(self, switch: str, joint: int) -> None:
        """Open a switch that was closed."""
        self._closed.discard((switch, 0 if switch == "abort" else joint - 1))

    def invert(self, switch: str) -> None:
        """Invert the wiring of limit, home or abort inputs."""
        self._inverted.add(switch)

    def cut(self, switch: str, joint: int) -> None:
        """Cut the wire of a switch: no current flows."""
        self._cut.add((switch, 0 if switch == "abort" else joint - 1))

    def cross(self, switch: str) -> None:
        """Exchange the limit switches of each joint, or the home switches of the joints."""
        self._crossed.add(switch)

    def break_amplifier(self, joint: int) -> None:
        """Make a joint's amplifier report overcurrent from now on."""
        self._broken.add(joint - 1)

    def stall(self, joint: int) -> None:
        """Block the motor of a joint from now on."""
        self._world.finger.block(joint - 1)

    def _physical(self, joints: Pair, by_hand: bool = True) -> Pair:
        """Return the counts of perfect encoders, as fractions."""
        start, radians = self._world.start, self._world.radians_per_count
        first, second = (joints[0] - start[0]) / radians, (joints[1] - start[1]) / radians
        if not by_hand:
            return first, second
        return first + self._by_hand[0], second + self._by_hand[1]

    def _seen(self, places: Pair) -> Pair:
        """Return what the encoders as wired read at the places of the joints."""
        first, second = self._reading(places, 0), self._reading(places, 1)
        return first, second

    def _reading(self, places: Pair, axis: int) -> float:
        frozen = self._frozen[axis]
        if frozen is not None:
            return frozen
        return self._signs[axis] * places[self._sources[axis]] + self._slipped[axis]

    def _rounded(self, counts: Pair) -> tuple[int, int]:
        return round(counts[0]), round(counts[1])

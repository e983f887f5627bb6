"""What the force transducer carries besides the key: its fixture, and a weight on a thread."""

import math
from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.rig.units import GRAVITY
from sautereau.sim_backend.parts import Weight
from sautereau.sim_backend.physics.events import Motions
from sautereau.sim_backend.sensors.simulated import mean_rates
from sautereau.trajectory.arm import fingertip_place


class FingertipLoad:
    """Adds the fixture's inertia and a weight's pull to the force that the transducer measures.

    The fixture moves with the key while the finger touches it, else with the arm, whose
    acceleration is that of the controller sample before.

    Args:
        rig: The simulated bench.
        weight: On a thread, if any.
        starts: s, simulated times at which acquisitions have started.
    """

    def __init__(self, rig: Rig, weight: Weight | None, starts: Sequence[float]):
        self._rig, self._weight, self._starts = rig, weight, starts
        self._hangs = weight is not None
        self._last = 0.0, 0.0
        self._heights: list[float] = []

    def on(self, motions: Motions, joints: tuple[float, float]) -> Motions:
        """Return a controller sample's motion with these forces, and the speed of a weight.

        Args:
            joints: rad, at its end.
        """
        if self._rig.arm.fixture_mass:
            motions = self._with_fixture(motions, joints)
        return motions if self._weight is None else self._with_weight(self._weight, motions, joints)

    def _with_fixture(self, motions: Motions, joints: tuple[float, float]) -> Motions:
        arm, period = self._rig.arm, self._rig.controller.sample_period
        height = float(fingertip_place(arm, np.array([joints]))[0, 1])
        self._heights = [*self._heights, height][-3:]
        of_arm = -np.diff(self._heights, 2).sum() / period**2  # 0 before there are three
        of_key, self._last = mean_rates(motions.time, motions.angular_velocity, self._last)
        touches = motions.finger_force > 0
        down = np.where(touches, self._rig.key.press_arm * of_key, of_arm)
        return replace(motions, finger_force=motions.finger_force + arm.fixture_mass * down)

    def _with_weight(
        self, weight: Weight, motions: Motions, joints: tuple[float, float]
    ) -> Motions:
        cut = self._starts[0] + weight.cut if self._starts else math.inf
        at = int(np.searchsorted(motions.time, cut, "right")) * self._hangs
        if self._hangs and cut <= motions.time[-1]:  # from now on it falls: both sides of the cut
            self._hangs = False
            rows = {f.name: getattr(motions, f.name) for f in fields(Motions)}
            both = {n: [np.interp(cut, motions.time, row)] * 2 for n, row in rows.items()}
            motions = Motions(**{n: np.insert(row, at, both[n]) for n, row in rows.items()})
            at += 1
        falling = np.arange(len(motions.time)) >= at
        fallen = np.where(falling, motions.time - cut, 0.0)
        speed = np.where(GRAVITY * fallen**2 / 2 < weight.fall, GRAVITY * fallen, 0.0)
        along = -math.sin(sum(joints))  # part of a vertical force along the finger
        pull = np.where(falling, 0.0, weight.mass * GRAVITY * along)
        return replace(
            motions,
            angular_velocity=speed / self._rig.key.laser_arm,
            finger_force=motions.finger_force - pull,
        )

"""The bodies of a scene, assembled (disabled parts have none), and the division of its step."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pymunk

from sautereau.analysis.model.choirs import choirs
from sautereau.rig.acquisition import OF_STRING
from sautereau.rig.instrument import Choir
from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.parts import Fingertip
from sautereau.sim_backend.physics.base import steps_in_sample
from sautereau.sim_backend.physics.events import PluckEvents
from sautereau.sim_backend.physics.rigid.arm import ServoFinger
from sautereau.sim_backend.physics.rigid.bodies import INERTIA, MM, Dry
from sautereau.sim_backend.physics.rigid.finger import (
    IdealFinger,
    PaddedIdealFinger,
    PushFinger,
    SteppedFinger,
    touching_angle,
)
from sautereau.sim_backend.physics.rigid.jacks import CarriedJack
from sautereau.sim_backend.physics.rigid.key import BendingKey, SinkingKey, StiffKey
from sautereau.sim_backend.physics.rigid.pluck import Plucking
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.arm import fingertip_place

TICK = 1e-9  # ms, below which a remaining time counts as zero
SHORTEST = 1e-4  # ms, of a step, below which a scene is refused
ITERATIONS = {"push": 20, "ideal": 20, "servo": 70}
"""Solver iterations at an event, times 1 + rho; see `Assembly.kick`."""
LARGEST_RATIO = 2e4  # Largest rho, with which an event takes about 0.1 s of computing


class Division:
    """Division of the scene's step into equal parts that resolve the present contacts.

    A stiffness k on a mass m oscillates with omega = sqrt(k / m), and a damping c decays at the
    rate c / m; a part covers at most 0.1 of either. The mass is that of the jack or the
    key alone, a lower bound of the oscillating mass.

    Args:
        jacks: With their strings.
        step: ms, the longest.
        fingertip: With its pad; None for a rigid one.
        gears: 1/ms, fastest rate of the arm's gears.

    Raises:
        SceneError: A stiffness or a damping is too large for any step.
    """

    def __init__(
        self,
        rig: Rig,
        key: StiffKey,
        jacks: Iterable[CarriedJack],
        step: float,
        fingertip: Fingertip | None = None,
        gears: float = 0.0,
    ):
        self._step = step
        self._key, self._jacks = key, tuple(jacks)
        arm, inertia = rig.key.press_arm * MM, rig.key.inertia * INERTIA
        inertia /= 1 + inertia / (key.mass * arm**2)
        damping = (key.felt_damping + key.viscous) / inertia
        pad = 0.0
        if fingertip is not None:
            # Both masses on the pad, each alone.
            mobility = arm**2 / inertia + 3 / (rig.arm.lower_mass * MM)
            oscillation = math.sqrt(fingertip.stiffness / MM * mobility)
            pad = max(oscillation, fingertip.damping * mobility)
        strings = [_rate(j.string.stiffest, j) for j in self._jacks if j.string]
        always = (
            (key.viscous / inertia, "the pivot's viscous friction", "key.pivot_viscous_friction"),
            (key.rate, key.what, key.keys),
            (pad, "the fingertip's pad", "fingertip.stiffness or fingertip.damping"),
            (
                gears,
                "a gear",
                "joints.gear_stiffness or gear_damping, or raise the rotors' inertia",
            ),
        )
        felt = max(math.sqrt(key.felt_stiffness / inertia), damping)
        at_times = (
            (felt, "the front felt", "key.felt_stiffness or key.felt_damping"),
            (max(strings, default=0.0), "a held string", "string.tension, or raise jack.mass"),
        )
        faults = [
            f"rig {rig.name}: {what} needs steps of {shortest * 1e-3:.3g} s, and"
            f" {SHORTEST * 1e-3:.3g} s is the shortest possible; lower {parameter}"
            for rate, what, parameter in (*always, *at_times)
            if (shortest := step / self._parts(rate)) < SHORTEST
        ]
        if faults:
            raise SceneError("\n".join(faults))
        self._always = max(self._parts(rate) for rate, *_ in always)
        self._felt = self._parts(felt)

    def step(self) -> float:
        """Return the step [ms] for the present contacts."""
        parts = max(self._always, self._felt if self._key.on_felt else 1)
        for jack in self._jacks:
            if jack.string is not None and jack.string.stiffness:
                parts = max(parts, self._parts(_rate(jack.string.stiffness, jack)))
        return self._step / parts

    def _parts(self, rate: float) -> int:
        """Return the number of parts that resolve a rate [1/ms]."""
        return max(1, math.ceil(self._step * rate / 0.1 - 1e-9))


def _rate(stiffness: float, jack: CarriedJack) -> float:
    return math.sqrt(stiffness / jack.mass)


def even_steps(left: float, step: float) -> tuple[int, float]:
    """Return the number of steps that fill the remaining time, all but the first equal.

    Args:
        left: ms, above zero.
        step: ms, of the equal ones.

    Returns:
        Their number, and the length [ms] of the first: at most 1.25 steps.
    """
    count = max(1, math.ceil(left / step - 1e-6))
    first = left - (count - 1) * step
    if abs(first - step) < 1e-6 * step:
        return count, step
    if first < step / 4 and count > 1:
        return count - 1, first + step
    return count, first


@dataclass(frozen=True)
class Assembly:
    """The parts of a scene and the joints between them."""

    space: pymunk.Space
    gravity: float
    """mm/ms^2, upwards."""
    key: StiffKey
    jacks: list[CarriedJack]
    finger: SteppedFinger
    division: Division
    dry: Dry
    iterations: tuple[int, int]
    """Solver iterations at an event: the least number, and that to be multiplied by 1 + rho."""

    def kick(self, step: float, fraction: float) -> None:
        """Step the engine with a fraction of its own weight and friction, at an event.

        No impulse is warm-started, so the solver iterates until it has converged. Each Gauss-Seidel
        iteration leaves the fraction rho / (1 + rho) of the error between jacks, key and rail or
        finger, where rho is the sum of m r'^2 over the jacks, divided by I; so 20 (1 + rho) of them
        leave exp(-20). Fewer would let a heavy jack rebound.

        Args:
            step: ms, always the present step of the engine.
            fraction: Dimensionless, of weight and dry friction.
        """
        least, factor = self.iterations
        rho = mass_ratio(self.key, self.jacks, self.key.body.angle)
        self.space.iterations = max(least, math.ceil(factor * (1 + rho)))
        self.space.gravity = 0.0, self.gravity * fraction
        for joint, force in self.dry:
            joint.max_force = force * fraction
        self.space.step(step)
        for joint, force in self.dry:
            joint.max_force = force
        self.space.gravity = 0.0, self.gravity


def mass_ratio(key: StiffKey, jacks: Iterable[CarriedJack], angle: float) -> float:
    """Return the inertia of the jacks about the pin over that of the key, at an angle [rad].

    For a key that may sink, their mass over that of the key is added.
    """
    return sum(j.mass * (j.slope(angle) ** 2 / key.inertia + 1 / key.mass) for j in jacks)


def assemble(rig: Rig, scene: Scene, start: tuple[float, float], events: PluckEvents) -> Assembly:
    """Assemble the bodies of a scene, at rest.

    Args:
        rig: The true bench.
        scene: With a chosen step.
        start: rad, of the arm's joints.
        events: List to which the strings append their events.

    Raises:
        SceneError: A part is too stiff, the jacks are too heavy for the key, a choir has no
            pluck, or the finger starts inside the key.
    """
    space = pymunk.Space()
    gravity = -scene.gravity / MM
    space.gravity, space.iterations = (0.0, gravity), scene.iterations
    key = _key(space, rig, scene, start)
    jacks = [
        CarriedJack(space, key, rig, choir, scene, _string(rig, scene, choir, number, events))
        for number, choir in enumerate(choirs(rig))
    ]
    if isinstance(key, SinkingKey):
        key.carry(jack.forces(0.0, 0.0) + jack.mass * scene.gravity / MM for jack in jacks)
    if (rho := mass_ratio(key, jacks, 0.0)) > LARGEST_RATIO:
        raise SceneError(
            f"rig {rig.name}: jack.mass: the jacks' inertia about the pin is {rho:.3g} times that"
            f" of the key, and impacts are solved up to {LARGEST_RATIO:g} times; lower the masses"
            " of the jacks, or raise key.inertia"
        )
    dry = [*key.dry, *(each for jack in jacks for each in jack.dry)]
    period = rig.controller.sample_period
    steps = steps_in_sample(rig, scene.step or period)
    gears, given = 0.0, (key, rig, scene, start)
    if scene.push is not None:
        finger = PushFinger(*given, scene.push)
    elif scene.servo is not None:
        finger = ServoFinger(space, *given)
        dry, gears = dry + finger.dry, finger.gear_rate
    elif scene.fingertip is not None:
        finger = PaddedIdealFinger(*given)
    else:
        finger = IdealFinger(space, *given)
    division = Division(rig, key, jacks, period * MM / steps, scene.fingertip, gears)
    iterations = scene.iterations, ITERATIONS[scene.finger]
    return Assembly(space, gravity, key, jacks, finger, division, dry, iterations)


def _key(space: pymunk.Space, rig: Rig, scene: Scene, start: tuple[float, float]) -> StiffKey:
    """Return the key at rest, on its rail or on the fingertip."""
    angle = 0.0
    if scene.finger != "push" and scene.fingertip is None:
        angle = max(0.0, float(touching_angle(rig, fingertip_place(rig.arm, np.array(start)))))
    if scene.bending is not None:
        key = BendingKey(space, rig.key, scene, angle, scene.bending)
    elif scene.play is not None:
        key = SinkingKey(space, rig.key, scene, angle, scene.play)
    else:
        key = StiffKey(space, rig.key, scene, angle)
    if not angle < key.bottom:
        raise SceneError(
            f"start: the fingertip is in the key: contact needs a key angle of {angle:.4g} rad, and"
            f" the key turns by {key.bottom:.4g} rad at most; start above the key"
        )
    return key


def _string(
    rig: Rig, scene: Scene, choir: Choir, number: int, events: PluckEvents
) -> Plucking | None:
    if scene.plectrum == "none":
        return None
    if scene.string == "modal":
        from sautereau.sim_backend.physics.rigid.modal import ModalPlucking

        heard = {own.string for own in rig.daq.channels if own.quantity in OF_STRING}
        return ModalPlucking(choir, scene, number, events, measured=number + 1 in heard)
    return Plucking(choir, scene, number, events)

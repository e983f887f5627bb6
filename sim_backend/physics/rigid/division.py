"""Subdivision of the step while a stiff part is in contact."""

import math
from collections.abc import Iterable

from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.rigid.bodies import INERTIA
from sautereau.sim_backend.physics.rigid.jacks import CarriedJack
from sautereau.sim_backend.physics.rigid.key_loads import KeyLoads

RESOLVED = 0.1
"""rad, phase of the fastest oscillation, or fraction of a decay, that a step covers at most."""
TICK = 1e-9
"""ms, below which a remaining time counts as zero."""
SHORTEST = 1e-4
"""ms, of a step, below which a scene is refused."""


class Division:
    """Division of the scene's step into equal parts that resolve the present contacts.

    A stiffness k on a mass m oscillates with omega = sqrt(k / m), and a damping c decays at the
    rate c / m; a part covers at most `RESOLVED` of either. The mass is that of the jack or the
    key alone, a lower bound of the oscillating mass.

    Args:
        rig: The bench.
        loads: On the key.
        jacks: With their strings.
        step: ms, the longest.

    Raises:
        SceneError: A stiffness or a damping is too large for any step.
    """

    def __init__(self, rig: Rig, loads: KeyLoads, jacks: Iterable[CarriedJack], step: float):
        self._step = step
        self._loads = loads
        self._jacks = tuple(jacks)
        inertia = rig.key.inertia * INERTIA
        felt = max(
            math.sqrt(loads.felt_stiffness / inertia),
            (loads.felt_damping + loads.viscous) / inertia,
        )
        slowed = self._parts(loads.viscous / inertia)
        self._always = slowed
        self._felt = self._parts(felt)
        strings = [self._parts(_rate(j.string.stiffest, j)) for j in self._jacks if j.string]
        faults = []
        for parts, what, parameter in (
            (slowed, "the pivot's viscous friction", "key.pivot_viscous_friction"),
            (self._felt, "the front felt", "key.felt_stiffness or key.felt_damping"),
            (max(strings, default=1), "a held string", "string.tension, or raise jack.mass"),
        ):
            if step / parts < SHORTEST:
                faults.append(
                    f"rig {rig.name}: {what} needs steps of {step / parts * 1e-3:.3g} s, and"
                    f" {SHORTEST * 1e-3:.3g} s is the shortest possible; lower {parameter}"
                )
        if faults:
            raise SceneError("\n".join(faults))
        self.most = max(slowed, self._felt, *strings, 1)
        """Largest number of parts in this scene."""

    def step(self) -> float:
        """Return the step [ms] for the present contacts."""
        parts = max(self._always, self._felt if self._loads.pressed else 1)
        for jack in self._jacks:
            if jack.string is not None and jack.string.stiffness:
                parts = max(parts, self._parts(_rate(jack.string.stiffness, jack)))
        return self._step / parts

    def _parts(self, rate: float) -> int:
        """Return the number of parts that resolve a rate [1/ms]."""
        return max(1, math.ceil(self._step * rate / RESOLVED - 1e-9))


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

"""The error of a step, estimated from the same drive observed with shorter steps."""

import math
from collections.abc import Callable

from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.observation import Errors, Observation, errors

FINER = 3
"""Rungs above one that tell its error."""
SAFETY = Errors(time=1.5, force=3.0)
"""1, multiples of the estimates by which they are given; forces jump, and converge slower."""
BLOW = 1.3
"""1, growth of the largest force with half the step, from which it is a blow's."""
ROUNDING = Errors(time=1e-8, force=1e-5)
"""Added to every estimate: what arithmetic, tables and the reference itself leave."""
LOST = Errors(math.inf, math.inf)
"""Of a step with which the engine found no motion."""


class Ladder:
    """One drive observed with one, two, four, ... times so many steps, each at most once.

    Args:
        observe: Of so many steps a controller sample.
        first: Steps a controller sample on the lowest rung.
        most: Steps a controller sample at most.
    """

    def __init__(self, observe: Callable[[int], Observation], first: int, most: int):
        self._observe = observe
        self.first = first
        self.most = most
        self._rungs: dict[int, Observation] = {}
        self._lost: dict[int, SceneError] = {}

    def steps(self, rung: int) -> int:
        """Return the steps a controller sample of a rung."""
        return self.first << rung

    def reaches(self, rung: int) -> bool:
        """Return whether the error of a rung can be estimated, which takes `FINER` more."""
        return self.steps(rung + FINER) <= self.most

    def estimate(self, rung: int) -> Errors:
        """Return the error of a rung; infinite where events come and go with the step.

        With errors that at least halve from the last rung but one to the last, that of the
        last is at most the distance of those two (Richardson). More than one lies between,
        because engines divide a step themselves where something stiff is in touch, and two
        neighbours may come to the same.

        Raises:
            SceneError: None of the rungs can be simulated.
        """
        runs = [self.run(rung + i) for i in range(FINER + 1)]
        here, before, last = runs[0], runs[-2], runs[-1]
        if here is None or before is None or last is None:
            if not any(runs):
                raise self._lost[rung]
            return LOST
        found = total(_apart(here, last), _apart(before, last), ROUNDING)
        return Errors(found.time, math.inf) if _struck(before, last) else found

    def run(self, rung: int) -> Observation | None:
        """Return what is observed on a rung; None where the engine lost its numbers."""
        if rung not in self._rungs and rung not in self._lost:
            try:
                self._rungs[rung] = self._observe(self.steps(rung))
            except SceneError as error:
                self._lost[rung] = error
        return self._rungs.get(rung)


def total(*parts: Errors) -> Errors:
    """Return the sum of errors that may all point the same way."""
    return Errors(sum(part.time for part in parts), sum(part.force for part in parts))


def _struck(before: Observation, last: Observation) -> bool:
    """Return whether the finger strikes the key while a string is held.

    The force of a blow is the larger, the shorter the step.
    """
    return _strongest(last) > BLOW * _strongest(before)


def _strongest(run: Observation) -> float:
    """Return the largest force [N] of the finger while a string is held, its ends left out."""
    time, force = run.motions.time, run.motions.finger_force
    strongest = 0.0
    for contact, release in zip(run.events.contacts, run.events.releases, strict=False):
        margin = 0.1 * (release.time - contact.time)
        held = (time > contact.time + margin) & (time < release.time - margin)
        strongest = max(strongest, float(force[held].max(initial=0.0)))
    return strongest


def _apart(one: Observation, last: Observation) -> Errors:
    """Return how far two runs are apart, whichever of them is taken for the truth."""
    there, back = errors(one, last), errors(last, one)
    time, force = max(there.time, back.time), max(there.force, back.force)
    return Errors(SAFETY.time * time, SAFETY.force * force)

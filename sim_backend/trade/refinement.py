"""Step refinement: the error of a step, measured or estimated by shorter steps."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.base import steps_in_sample
from sautereau.sim_backend.physics.drive import Drive
from sautereau.sim_backend.physics.observation import Errors, Observation, errors
from sautereau.sim_backend.scene import Scene

FINER = 3
"""Halvings of a step from which its error is estimated; more of one that the engine divides."""
ROUNDING = Errors(time=1e-8, force=1e-5)
"""Added to every error: rounding, tables and the reference solution itself."""
DIVERGED = Errors(math.inf, math.inf)
"""Error of a step with which the engine found no motion, or that has no estimate."""
SHORTEST, LONGEST = 1e-7, 2e-3  # s, limits of a scene's step
CHECKED = 3
"""Steps, each half the one before, of which the largest error counts as that of the longest: one
step may be accurate by coincidence."""
MOST = {"rigid": 600_000, "exact": 4_000_000}
"""Largest number of steps of one drive that is tried with an engine."""
TRUTH_STEPS = 256
"""Steps per controller sample of a solution by refinement: 4 times those of the finest point of a
study, so that its own error is a fraction of that point's at any order of convergence."""

Observe = Callable[[Rig, Scene, Drive | None], Observation]
"""Runs a drive through a world; `sautereau.sim_backend.physics.observation.observe`."""


class StepRefinement:
    """One drive observed with 1, 2, 4, ... times as many steps, each at most once.

    Args:
        observe: Runs the drive with a number of steps per controller sample.
        first: Steps per controller sample at level 0.
        most: Largest number of steps per controller sample.
        period: s, of a controller sample.
        noise: s, by which rounding of the encoders may shift events.
    """

    def __init__(
        self,
        observe: Callable[[int], Observation],
        first: int,
        most: int,
        period: float,
        noise: float = 0.0,
    ):
        self._observe = observe
        self.first = first
        self.most = most
        self._period, self._noise = period, noise
        self._runs: dict[int, Observation] = {}
        self._diverged: dict[int, SceneError] = {}

    def steps(self, level: int) -> int:
        """Return the steps per controller sample at a level."""
        return self.first << level

    def reaches(self, level: int) -> bool:
        """Return whether the error at a level can be estimated, which takes `FINER` more."""
        return self.steps(level + FINER) <= self.most

    def estimate(self, level: int) -> Errors:
        """Return the error at a level; infinite where events depend on the step, or are unresolved.

        If errors at least halve from the second finest level to the finest, the error of the
        finest is at most the distance of these two (Richardson extrapolation). The distance of each
        level to the finest counts, because two may agree by coincidence. Engines divide a step
        while something stiff is in contact, and halving such a step changes nothing at first: the
        finest level is so fine that the steps of a pressing finger are shorter by a factor of 4.

        Raises:
            SceneError: None of the levels can be simulated.
        """
        here = self.run(level)
        more = 0 if here is None else self._halvings(level, here)
        if more > 5:  # The engine divides the step too often
            return DIVERGED
        finest = level + FINER + more
        finer = range(max(finest - FINER, level + 1), finest + 1)
        runs = [here, *(self.run(each) for each in finer)]
        last = runs[-1]
        if here is None or runs[-2] is None or last is None:
            if not any(runs):
                raise self._diverged[level]
            return DIVERGED
        apart = [_distance(run, last) for run in runs[:-1] if run is not None]
        # What the encoders' rounding may change; forces grow in the shortest pluck.
        contacts, releases, noise = last.events.contacts, last.events.releases, self._noise
        held = (b.time - a.time for b in releases for a in contacts if a.choir == b.choir)
        shortest = max(noise, min((time for time in held if time > 0), default=math.inf))
        return total(_largest(apart), apart[-1], ROUNDING, Errors(noise, noise / shortest))

    def finest(self, most: int) -> tuple[int, Observation, Errors]:
        """Return the steps, observation and error of the finest level of at most so many steps.

        The error is the larger of its distances from the two levels before: if errors at least
        halve from one to the next, the last distance alone bounds it (Richardson extrapolation),
        and these may agree by coincidence.

        Raises:
            SceneError: One of the levels cannot be simulated, or their events are not the same.
        """
        level = max(2, math.floor(math.log2(min(most, self.most) / self.first)))
        levels = range(level - 2, level + 1)
        runs = [run for run in map(self.run, levels) if run is not None]
        if len(runs) < len(levels):
            raise next(self._diverged[each] for each in levels if each in self._diverged)
        found = _largest([_distance(run, runs[-1]) for run in runs[:-1]])
        if not math.isfinite(found.time + found.force):
            raise SceneError(
                f"scene: its numbers of contacts, releases or returns differ between"
                f" {self.steps(level - 2)} and {self.steps(level)} steps per controller sample, so"
                " that no solution is known to compare with; change the drive, so that no event"
                " nearly happens"
            )
        return self.steps(level), runs[-1], total(found, ROUNDING)

    def run(self, level: int) -> Observation | None:
        """Return the observation at a level; None where the engine diverged."""
        if level not in self._runs and level not in self._diverged:
            try:
                self._runs[level] = self._observe(self.steps(level))
            except SceneError as error:
                self._diverged[level] = error
        return self._runs.get(level)

    def _halvings(self, level: int, run: Observation) -> int:
        """Return by how many halvings the engine's steps are shorter than those of a level."""
        steps = np.diff(run.motions.time)[run.motions.finger_force[1:] > 0]
        steps, given = steps[steps > 0], self._period / self.steps(level)
        if steps.sum() < given:  # a push that ends within a step divides it as well
            return 0
        parts = given / float(np.median(steps))
        return max(0, math.floor(math.log2(parts) + 1e-6))


@dataclass(frozen=True)
class Truth:
    """What the ways to simulate a scene are compared with."""

    observation: Observation
    errors: Errors
    """Its own."""
    origin: str
    """How it was found, and what it was checked by."""


class Trial:
    """Runs of one drive on one bench, with an engine and steps of several lengths.

    Args:
        true: The simulated bench.
        observe: Runs a drive through a world.
        solve: Solves it exactly; None to estimate all errors by shorter steps.
    """

    def __init__(self, rig: Rig, true: Rig, drive: Drive, observe: Observe, solve: Observe | None):
        self.true = true
        self._rig, self._drive = rig, drive
        self._observe, self._solve = observe, solve
        self._exact: Observation | None = None

    def run(self, scene: Scene, steps: int) -> Observation:
        """Return what is observed with a number of steps per controller sample."""
        return self._observe(self._rig, stepped(self.true, scene, steps), self._drive)

    def errors(self, scene: Scene) -> Iterator[tuple[int, Errors]]:
        """Yield steps per controller sample and their errors, from the longest step down.

        Errors are measured against the exact solution; for modal strings and bending keys, which
        have none, they are estimated.

        Raises:
            SceneError: There is no exact solution of the scene, or it cannot be simulated, or not
                with as many steps as an estimate takes.
        """
        refinement = self._refinement(scene, steps_in_sample(self.true, LONGEST))
        solved = self._solve is not None and scene.solvable
        if refinement.steps(CHECKED - 1 if solved else FINER) > refinement.most:
            raise SceneError(
                f"accuracy: a drive of {self._drive.samples} controller samples is too long to be"
                f" tried with the engine {scene.engine}; give a step instead of accuracy"
            )
        if self._solve is None or not scene.solvable:
            level = 0
            while refinement.reaches(level):
                yield refinement.steps(level), refinement.estimate(level)
                level += 1
            return
        if self._exact is None:
            self._exact = self._solve(self._rig, scene, self._drive)
        found: list[Errors] = []
        while refinement.steps(len(found)) <= refinement.most:
            run = refinement.run(len(found))
            found.append(DIVERGED if run is None else total(errors(run, self._exact), ROUNDING))
            if len(found) >= CHECKED:
                yield refinement.steps(len(found) - CHECKED), _largest(found[-CHECKED:])

    def truth(self, scene: Scene) -> Truth:
        """Return the exact solution of a scene, or where it has none the rigid engine's finest.

        The latter is checked: of the same scene with what the exact engine supports, the rigid
        engine's error with these steps is measured.

        Args:
            scene: With its plectrum and string chosen.

        Raises:
            SceneError: The scene cannot be simulated, or its events depend on the step.
        """
        if self._solve is not None and scene.solvable:
            found = self._solve(self._rig, scene, self._drive)
            return Truth(found, Errors(0.0, 0.0), "the exact solution")
        rigid = scene.model_copy(update={"engine": "rigid"})
        steps, found, own = self._refinement(rigid, steps_in_sample(self.true, LONGEST)).finest(
            TRUTH_STEPS
        )
        step = self.true.controller.sample_period / steps
        origin = (
            f"the rigid engine with steps of {step * 1e6:.3g} us, within {_text(own)} by halving"
            " the step"
        )
        if self._solve is not None:
            string = "spring" if scene.string == "modal" else scene.string
            bare = rigid.model_copy(update={"string": string, "bending": None, "play": None})
            apart = errors(self.run(bare, steps), self._solve(self._rig, bare, self._drive))
            parts = ["the string's modes"] if scene.string == "modal" else []
            parts += [part for part in ("bending", "play") if getattr(scene, part) is not None]
            without = " and ".join(parts)
            origin += f"; without {without} it is within {_text(apart)} of the exact solution"
        return Truth(found, own, origin)

    def estimate(self, scene: Scene, steps: int) -> Errors:
        """Return the error of a number of steps per controller sample, by shorter steps."""
        return self._refinement(scene, steps).estimate(0)

    def _refinement(self, scene: Scene, first: int) -> StepRefinement:
        most = MOST[scene.engine] // self._drive.samples
        period = self.true.controller.sample_period
        most = min(most, int(period / SHORTEST))
        true, noise = self.true, 0.0
        if scene.finger == "servo":  # a pressing fingertip may be half an encoder count away
            speed = true.press.jack_speed * true.key.press_arm / true.key.jack_arm
            noise = true.arm.resolution / 2 / speed
        return StepRefinement(lambda steps: self.run(scene, steps), first, most, period, noise)


def _text(found: Errors) -> str:
    return f"{found.time * 1e6:.2g} us and {100 * found.force:.2g} %"


def stepped(true: Rig, scene: Scene, steps: int, **changes: str) -> Scene:
    """Return a scene with a number of steps per controller sample, and other changes."""
    step = true.controller.sample_period / steps
    return scene.model_copy(update={"step": step, "accuracy": None, **changes})


def total(*parts: Errors) -> Errors:
    """Return the sum of errors, which may all have the same sign."""
    return Errors(sum(part.time for part in parts), sum(part.force for part in parts))


def _largest(found: Sequence[Errors]) -> Errors:
    return Errors(max(each.time for each in found), max(each.force for each in found))


def _distance(one: Observation, last: Observation) -> Errors:
    """Return how far two runs are apart, whichever of them is the truth."""
    apart = _largest([errors(one, last), errors(last, one)])
    return Errors(1.5 * apart.time, 3.0 * apart.force)  # Forces jump, and converge more slowly

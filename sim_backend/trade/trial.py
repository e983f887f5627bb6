"""One drive on one bench, tried with an engine and steps of several lengths."""

import math
from collections.abc import Callable, Iterator

from sautereau.rig.schema import Rig
from sautereau.sim_backend.accuracy import Accuracy
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.drive import Drive
from sautereau.sim_backend.physics.observation import Errors, Observation, errors
from sautereau.sim_backend.scene import Scene
from sautereau.sim_backend.trade.cost import cost
from sautereau.sim_backend.trade.ladder import LOST, ROUNDING, Ladder, total
from sautereau.sim_backend.trade.settled import Settled, meets, share

Observe = Callable[[Rig, Scene, Drive | None], Observation]

SHORTEST, LONGEST = 1e-7, 2e-3
"""s, of a step; a scene's limits."""
NOT_LUCK = 3
"""Steps, each half the one before, of which the largest error counts as the longest's."""
MOST = {"rigid": 600_000, "reduced": 4_000_000}
"""Steps of one drive at most that an engine is tried with."""


class Trial:
    """Runs of one drive on one bench.

    Args:
        rig: The nominal bench.
        true: As it is in the scene.
        drive: What is played.
        observe: Runs a drive through a world.
        solve: Solves it exactly; None where nobody does.
    """

    def __init__(self, rig: Rig, true: Rig, drive: Drive, observe: Observe, solve: Observe | None):
        self.rig = rig
        self.true = true
        self.drive = drive
        self._observe = observe
        self._solve = solve
        self._exact: Observation | None = None

    def run(self, scene: Scene, steps: int) -> Observation:
        """Return what is observed with so many steps a controller sample."""
        return self._observe(self.rig, self.stepped(scene, steps), self.drive)

    def exact(self, scene: Scene) -> Observation | None:
        """Return what truly happens with spring strings or none; None where nobody solves it.

        Raises:
            SceneError: It has no solution.
        """
        if self._solve is None or scene.string == "modal":
            return None
        if self._exact is None:
            self._exact = self._solve(self.rig, scene, self.drive)
        return self._exact

    def stepped(self, scene: Scene, steps: int) -> Scene:
        """Return the scene with its step."""
        step = self.true.controller.sample_period / steps
        return scene.model_copy(update={"step": step, "accuracy": None})

    def climb(self, scene: Scene, asked: Accuracy, string: Errors) -> Settled:
        """Return the longest step that meets what is asked, or the best that was tried."""
        ladder = self._ladder(scene, fewest(self.true), MOST[scene.engine])
        exact = self.exact(scene)
        rungs = self._measured(scene, ladder, exact) if exact else _estimated(ladder)
        closest = None
        for steps, error in rungs:
            found = self._settled(scene, steps, asked, total(error, string))
            if closest is None or share(found.errors, asked) < share(closest.errors, asked):
                closest = found
            if meets(found.errors, asked):
                break
        if closest is None:
            raise SceneError(
                f"accuracy: a drive of {self.drive.samples} controller samples is too long to be"
                f" tried with the engine {scene.engine}; give a step in place of accuracy"
            )
        return closest

    def as_told(self, scene: Scene) -> Settled:
        """Return a scene that has a step, with the error of it by shorter ones."""
        step = scene.step or LONGEST
        steps = math.ceil(self.true.controller.sample_period / step - 1e-9)
        ladder = self._ladder(scene, steps, MOST[scene.engine])
        return self._settled(scene, steps, None, ladder.estimate(0))

    def _measured(
        self, scene: Scene, ladder: Ladder, exact: Observation
    ) -> Iterator[tuple[int, Errors]]:
        """Yield steps and errors; no step's is less than that of shorter ones, which were luck."""
        found: list[Errors] = []
        while ladder.steps(len(found)) <= ladder.most:
            run = ladder.run(len(found))
            found.append(LOST if run is None else total(errors(run, exact), ROUNDING))
            if len(found) >= NOT_LUCK:
                last = found[-NOT_LUCK:]
                worst = Errors(max(e.time for e in last), max(e.force for e in last))
                yield ladder.steps(len(found) - NOT_LUCK), worst

    def _ladder(self, scene: Scene, first: int, most: int) -> Ladder:
        most = min(most // self.drive.samples, int(self.true.controller.sample_period / SHORTEST))
        return Ladder(lambda steps: self.run(scene, steps), first, most)

    def _settled(self, scene: Scene, steps: int, asked: Accuracy | None, found: Errors) -> Settled:
        factor = 1 / cost(self.true, scene, steps)
        return Settled(self.stepped(scene, steps), asked, found, factor)


def _estimated(ladder: Ladder) -> Iterator[tuple[int, Errors]]:
    """Yield steps and errors as far as they can be estimated."""
    rung = 0
    while ladder.reaches(rung):
        yield ladder.steps(rung), ladder.estimate(rung)
        rung += 1


def fewest(true: Rig) -> int:
    """Return the least steps in a controller sample."""
    return math.ceil(true.controller.sample_period / LONGEST - 1e-9)

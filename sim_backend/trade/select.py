"""Select the cheapest engine, string model and step that reach the accuracy of a scene."""

import math
from dataclasses import dataclass
from importlib.util import find_spec

from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.parts import Accuracy
from sautereau.sim_backend.physics.base import steps_in_sample
from sautereau.sim_backend.physics.drive import Drive
from sautereau.sim_backend.physics.observation import Errors, drive_of, errors, observe, reference
from sautereau.sim_backend.scene import Scene
from sautereau.sim_backend.trade import refinement

STEP = {"rigid": 10e-6, "exact": 2e-6}
"""s, cost of one step of an engine with one choir; measured on one machine, once."""
INTERPRETED = 500e-6  # s, cost of one step of the exact engine without numba
SAMPLE = {"rigid": 50e-6, "exact": 30e-6}  # s, additional cost of every controller sample
FINGER = {"push": 0.0, "ideal": 100e-6, "servo": 100e-6}
"""s, cost of the finger's reference in every controller sample."""
MODAL = 10e-6  # s, cost of one step of a modal string and its plectrum


@dataclass(frozen=True)
class Selected:
    """A scene with every choice made, and its accuracy by its own measurement."""

    scene: Scene
    """The scene with its step, engine, plectrum level and string."""
    asked: Accuracy | None
    """None where the scene gives a step."""
    errors: Errors
    """Upper bound for the scene's drive, a press from rest, against the exact solution."""
    real_time_factor: float
    """Dimensionless, simulated over real time, by a fixed rule and not by a clock."""

    def __str__(self) -> str:
        scene = self.scene
        asked = f" for the {self.asked} asked" if self.asked else ""
        if scene.engine == "rigid" and scene.finger == "servo":
            asked += ", in a press from rest; where earlier motions stop, it knows less accurately"
        return (
            f"selected engine {scene.engine}, plectrum {scene.plectrum}, string {scene.string},"
            f" steps of {micro(scene.step or 0.0)}: {reached(self.errors)}{asked};"
            f" about {self.real_time_factor:.2g} x real time"
        )


def select_solver(
    rig: Rig,
    scene: Scene,
    drive: Drive | None = None,
    *,
    observe: refinement.Observe = observe,
    solve: refinement.Observe | None = reference,
) -> Selected:
    """Choose what a scene leaves open by the accuracy that it asks for.

    Candidates are run through the scene's own drive and compared with its exact solution;
    where there is none, as for modal strings, and for a scene that gives a step, the error is
    estimated by shorter steps. The choice depends on the arguments and on whether numba is
    installed, never on the speed of the machine.

    Args:
        scene: What it chooses itself is kept.
        drive: What will be played; None for `drive_of` the scene.
        observe: Runs a drive through a world.
        solve: Solves it exactly; None to estimate all errors by shorter steps.

    Raises:
        SceneError: The scene cannot be simulated, or not with the accuracy that it asks for.
    """
    true = scene.true_rig(rig)
    trial = refinement.Trial(rig, true, drive or drive_of(rig, scene), observe, solve)
    if scene.accuracy is None:
        scene = scene.with_engine()
        steps = steps_in_sample(true, scene.step or refinement.LONGEST)
        return _selected(true, scene, steps, None, trial.estimate(scene, steps))
    asked = Accuracy.parse(scene.accuracy)
    fewest = steps_in_sample(true, refinement.LONGEST)
    met: list[Selected] = []
    missed: list[Selected] = []
    refusals: list[SceneError] = []
    spring_error = Errors(0.0, 0.0)
    if scene.string == "auto":
        steps = math.ceil(true.controller.sample_period / 50e-6)  # s
        modal = best_models(true, scene).model_copy(update={"engine": "rigid"})
        spring = modal.model_copy(update={"string": "spring"})
        spring_error = errors(trial.run(spring, steps), trial.run(modal, steps))
    for candidate in _candidates(true, scene, fewest):
        own = spring_error if candidate.string == "spring" else Errors(0.0, 0.0)
        cheapest = min((1 / found.real_time_factor for found in met), default=math.inf)
        if not meets(own, asked) or cost(true, candidate, fewest) >= cheapest:
            continue
        try:
            found = _refined(trial, candidate, asked, own)
        except SceneError as error:
            refusals.append(error)
            continue
        (met if meets(found.errors, asked) else missed).append(found)
    if met:
        return max(met, key=lambda found: found.real_time_factor)
    if missed:
        closest = min(missed, key=lambda found: found.errors.over(asked))
        raise SceneError(_out_of_reach(closest, asked))
    raise refusals[0]


def cost(rig: Rig, scene: Scene, steps: int) -> float:
    """Return the computing time [s] per simulated second by a fixed rule.

    Args:
        rig: The simulated bench.
        scene: With its engine and string chosen.
    """
    step = STEP[scene.engine]
    if scene.engine == "exact" and find_spec("numba") is None:
        step = INTERPRETED
    if scene.string == "modal":
        step += MODAL * (1 + len(rig.more_choirs))
    sample = steps * step + SAMPLE[scene.engine] + FINGER[scene.finger]
    return sample / rig.controller.sample_period


def best_models(true: Rig, scene: Scene) -> Scene:
    """Return the scene with the best plectrum level and string where it says "auto".

    Args:
        true: The simulated bench.
        scene: Of any kind.
    """
    string = "modal" if scene.string == "auto" else scene.string
    return scene.on_bench(true).model_copy(update={"string": string})


def meets(found: Errors, asked: Accuracy) -> bool:
    """Return whether an error is at most the one asked for."""
    return found != refinement.DIVERGED and found.over(asked) <= 1


def reached(found: Errors) -> str:
    """Return the text of an error."""
    if not math.isfinite(found.time):
        return "events that depend on the step, or a step too long to estimate their error"
    return f"events to {found.time * 1e6:.2g} us and forces to {100 * found.force:.2g} %"


def micro(seconds: float) -> str:
    """Return a time in microseconds, with its unit."""
    return f"{seconds * 1e6:.4g} us"


def _refined(trial: refinement.Trial, scene: Scene, asked: Accuracy, own: Errors) -> Selected:
    """Return the longest step that meets what is asked, or the best that was tried.

    Args:
        trial: Of the scene's drive.
        scene: With its engine and string chosen.
    """
    tried: list[Selected] = []
    for steps, error in trial.errors(scene):
        total = refinement.total(error, own)
        tried.append(_selected(trial.true, scene, steps, asked, total))
        if meets(total, asked):
            break
    return min(tried, key=lambda found: found.errors.over(asked))


def _selected(
    true: Rig, scene: Scene, steps: int, asked: Accuracy | None, found: Errors
) -> Selected:
    return Selected(
        refinement.stepped(true, scene, steps), asked, found, 1 / cost(true, scene, steps)
    )


def _candidates(true: Rig, scene: Scene, fewest: int) -> list[Scene]:
    """Return the scene with every engine and string that it leaves open, the cheapest first."""
    base = best_models(true, scene)
    strings = ("spring", "modal") if scene.string == "auto" else (base.string,)
    engines = ("exact", "rigid") if scene.engine == "auto" else (scene.engine,)
    ways = [
        base.model_copy(update={"engine": engine, "string": string})
        for string in strings
        for engine in engines
    ]
    candidates = [way for way in ways if way.engine == "rigid" or way.solvable]
    return sorted(candidates, key=lambda way: cost(true, way, fewest))


def _out_of_reach(closest: Selected, asked: Accuracy) -> str:
    scene, found = closest.scene, closest.errors
    if math.isfinite(found.over(asked)):
        # Rounded upwards, so that it is reached where it is asked for.
        reachable = Accuracy(found.time, None) if asked.time else Accuracy(None, found.force)
        fix = f"ask for {reachable.rounded_up()}"
    else:
        fix = (
            "a contact, release or return nearly does not happen: change the drive, or give a step"
        )
    return (
        f"accuracy: {asked} is out of reach: engine {scene.engine}, string {scene.string}"
        f" and steps of {micro(scene.step or 0.0)} reach {reached(closest.errors)}; {fix}, or"
        " choose another engine or string"
    )

"""The cheapest engine, string and step with which a scene is as accurate as it asks."""

import math

from sautereau.rig.instrument import Plectrum
from sautereau.rig.schema import Rig
from sautereau.sim_backend.accuracy import Accuracy
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.drive import Drive, drive_of
from sautereau.sim_backend.physics.observation import Errors, errors, observe
from sautereau.sim_backend.physics.reference.observe import reference
from sautereau.sim_backend.scene import Scene
from sautereau.sim_backend.trade.cost import cost
from sautereau.sim_backend.trade.settled import Settled, meets, micro, reached, share
from sautereau.sim_backend.trade.trial import Observe, Trial, fewest

NONE = Errors(0.0, 0.0)
STRING_STEP = 50e-6
"""s, at which a spring string is held against a modal one."""


def settle(
    rig: Rig,
    scene: Scene,
    drive: Drive | None = None,
    *,
    observe: Observe = observe,
    solve: Observe | None = reference,
) -> Settled:
    """Choose what a scene leaves open by the accuracy that it asks for.

    Candidates are run through the scene's own drive and held against its exact solution;
    where there is none, as for modal strings, and for a scene that gives a step, the error is
    estimated by shorter steps. The choice depends on nothing but the arguments, so the same
    scene is always settled alike.

    Args:
        rig: The nominal bench.
        scene: What it chooses itself, is kept.
        drive: What will be played; None for `drive_of` the scene.
        observe: Runs a drive through a world.
        solve: Solves it exactly; None to estimate all errors by shorter steps.

    Raises:
        SceneError: The scene cannot be simulated, or not as accurately as it asks.
    """
    true = scene.true_rig(rig)
    drive = drive or drive_of(rig, scene)
    trial = Trial(rig, true, drive, observe, solve)
    if scene.accuracy is None:
        return trial.as_told(scene)
    asked = Accuracy.parse(scene.accuracy)
    best: Settled | None = None
    closest: Settled | None = None
    refusals: list[SceneError] = []
    string = _string_error(trial, scene)
    for candidate in _candidates(true, scene):
        own = string.get(candidate.string, NONE)
        if not meets(own, asked):
            continue
        if best and cost(true, candidate, fewest(true)) >= 1 / best.real_time_factor:
            continue
        try:
            found = trial.climb(candidate, asked, own)
        except SceneError as error:
            refusals.append(error)
            continue
        if meets(found.errors, asked):
            if best is None or found.real_time_factor > best.real_time_factor:
                best = found
        elif closest is None or share(found.errors, asked) < share(closest.errors, asked):
            closest = found
    if best:
        return best
    if closest:
        raise SceneError(_out_of_reach(closest, asked))
    raise refusals[0]


def best_level(plectrum: Plectrum) -> str:
    """Return the level that is exact for a plectrum, and builds the sooner."""
    return "fe" if plectrum.outline is not None else "elastica"


def told(true: Rig, scene: Scene) -> Scene:
    """Return the scene as the exact model has it: the best level and string where it says auto.

    Args:
        true: The bench as it is in the scene.
        scene: Of any kind.
    """
    level = best_level(true.plectrum) if scene.plectrum == "auto" else scene.plectrum
    string = "modal" if scene.string == "auto" else scene.string
    return scene.model_copy(update={"plectrum": level, "string": string})


def _candidates(true: Rig, scene: Scene) -> list[Scene]:
    """Return the scene with every engine and string that it leaves open, the cheapest first."""
    base = told(true, scene)
    strings = ("spring", "modal") if scene.string == "auto" else (base.string,)
    engines = ("reduced", "rigid") if scene.engine == "auto" else (scene.engine,)
    return [
        base.model_copy(update={"engine": engine, "string": string})
        for string in strings
        for engine in engines
        if engine == "rigid" or not (scene.finger == "servo" or string == "modal")
    ]


def _string_error(trial: Trial, scene: Scene) -> dict[str, Errors]:
    """Return by the string what a spring in place of a modal one changes, with the same step."""
    if scene.string != "auto":
        return {}
    steps = math.ceil(trial.true.controller.sample_period / STRING_STEP)
    modal = told(trial.true, scene).model_copy(update={"engine": "rigid"})
    spring = modal.model_copy(update={"string": "spring"})
    return {"spring": errors(trial.run(spring, steps), trial.run(modal, steps))}


def _out_of_reach(closest: Settled, asked: Accuracy) -> str:
    scene, short = closest.scene, share(closest.errors, asked)
    if math.isfinite(short):
        remedy = f"ask for {short:.3g} times as much"
    else:
        remedy = "strings are met, let go or passed by a hair: change the drive, or give a step"
    return (
        f"accuracy: {asked} is out of reach: engine {scene.engine}, string {scene.string}"
        f" and steps of {micro(scene.step or 0.0)} reach {reached(closest.errors)}; {remedy}, or"
        " choose another engine or string"
    )

"""Scenes, rigs and references for the tests of the stand-in."""

from functools import cache

import numpy as np

from sautereau.rig.instrument import Choir
from sautereau.rig.load import load_rig
from sautereau.sim_backend.parts import Push
from sautereau.sim_backend.physics.drive import drive_of
from sautereau.sim_backend.physics.observation import observe, reference
from sautereau.sim_backend.scene import Scene, load_scene

RIG = load_rig("paper")
MUTE = {"plectrum": "none", "string": "none"}
BARE = {**MUTE, "friction": False, "felt": False}
RETURNING = {"tongue": True, "damper": True}  # Parts that act while the jack falls


def push_of(force, duration, rest=0.0):
    """Return a push of a force [N], a duration and a rest after it [s]."""
    return Push.model_construct(force=force, duration=duration, rest=rest)


def scene_of(name, **changes):
    """Return a packaged scene of rigid bodies with some values changed, SI."""
    return load_scene(name).model_copy(update={"engine": "rigid"} | changes)


def pushed(force=1.2, duration=0.02, rest=0.0, **changes):
    """Return a push of a plucking key with friction and felt, in steps of 1 ms; changes in SI."""
    parts = {"finger": "push", "plectrum": "elastica", "string": "spring"}
    parts |= {"friction": True, "felt": True, "engine": "exact", "step": "1 ms"}
    parts["push"] = {"force": f"{force} N", "duration": f"{duration} s", "rest": f"{rest} s"}
    return Scene.model_validate(parts).model_copy(update=changes)


def pressed(**changes):
    """Return the same scene as `pushed` for an ideal finger."""
    return pushed(finger="ideal", push=None, **changes)


def choir(arm, clearance, mass=6e-3, overlap=0.2e-3):
    """Return a second choir on a lever [m], with its own clearance [m], mass [kg], overlap [m]."""
    return Choir.model_construct(
        jack_arm=arm,
        jack=RIG.jack.model_copy(update={"string_clearance": clearance, "mass": mass}),
        plectrum=RIG.plectrum.model_copy(update={"overlap": overlap}),
        string=RIG.string,
    )


def at_rest(fractions):
    """Return a reference that does not move."""
    return np.zeros((len(fractions), 2)), np.zeros((len(fractions), 2))


@cache
def press_solved(name):
    """Return the reference solution of a packaged scene's press, and its drive."""
    scene = scene_of(name, sensors=None)
    return reference(RIG, scene), drive_of(RIG, scene)


def run(rig, scene, drive=None):
    """Observe a press; its motions are finite and their times do not fall."""
    found = observe(rig, scene, drive)
    assert all(np.isfinite(values).all() for values in vars(found.motions).values())
    assert np.all(np.diff(found.motions.time) >= 0)
    return found

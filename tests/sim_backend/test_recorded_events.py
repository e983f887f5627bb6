"""Contact and release as a recording without noise shows them, for an accuracy asked for.

An oracle that knows the shape of the force locates both between the samples: up to the contact the
force is smooth, from there on a smooth term grows from zero, until the force jumps at the release.
"""

from functools import cache

import numpy as np
import pytest

from benchmarks.simulated import acquired
from sautereau.rig.load import with_values
from sautereau.sim_backend.physics.observation import observe, reference
from sautereau.sim_backend.scene import load_scene
from sautereau.sim_backend.trade.select import select_solver
from tests.sim_backend.scenes import RIG, pushed

RIG_1_MHZ = with_values(RIG, {"daq.sample_rate": "1 MHz"})


def recorded(rig, scene):
    """Return times [s], forces [N], and the true contact and release, after the trigger."""
    found, truth = acquired(rig, scene, observe(rig, scene))
    channel = found.rig.daq.channel("force")
    assert channel is not None
    force = found.volts[channel.name] * channel.scale
    return np.arange(len(force)) / found.rate, force, truth.contacts[0], truth.releases[0]


def bend(time, force, near, width=4e-3):
    """Return the time of the bend near a time [s]: where the cubics of both sides meet."""
    past = time - near
    sides = (past > -width) & (past < -1e-4), (past > 1e-4) & (past < width)
    before, after = (np.polyfit(past[side], force[side], 3) for side in sides)
    roots = np.roots(after - before)
    return near + min(roots, key=abs).real


def fall(time, force, near):
    """Return the first sample [s] after the sudden fall of the force near a time."""
    part = np.flatnonzero(np.abs(time - near) < 1e-3)
    return time[part[np.argmin(np.diff(force[part]))] + 1]


@cache
def exact():
    """Return the exact solution of the scene."""
    return reference(RIG_1_MHZ, load_scene("ideal"))


@pytest.mark.parametrize("engine", ["exact", "rigid"])
def test_the_recording_keeps_the_accuracy_asked_for(engine):
    accuracy = 1e-6
    scene = load_scene("ideal").model_copy(
        update={"engine": engine, "accuracy": f"{accuracy} s", "step": None}
    )
    selected = select_solver(RIG_1_MHZ, scene, solve=lambda *_: exact()).scene
    assert (selected.step or 0.0) > 500e-6
    time, force, contact, release = recorded(RIG_1_MHZ, selected)
    assert bend(time, force, contact) == pytest.approx(contact, abs=accuracy)
    found = fall(time, force, release)
    assert found - 1e-6 - accuracy <= release <= found + accuracy
    # The step itself takes one sample: there is no ramp on either side of it.
    k = int(np.searchsorted(time, release))
    slopes = np.abs(np.diff(force[k - 100 : k + 100])) * 1e6
    assert np.sum(slopes > 100) == 1


def test_a_push_ends_at_once():
    """The force of a push, which ends between two samples and two steps."""
    scene = pushed(duration=0.0123456, rest=0.01)
    for engine in ("exact", "rigid"):
        moved = observe(RIG, scene.model_copy(update={"engine": engine})).motions
        force = np.interp([0.0, 0.0123455, 0.0123457], moved.time, moved.finger_force)
        np.testing.assert_allclose(force, [1.2, 1.2, 0.0], rtol=1e-12)

"""Errors that `trade` states, and what it recommends, judged by the independent oracles."""

import math

import numpy as np
import pytest

from sautereau.sim_backend.parts import Accuracy
from sautereau.sim_backend.physics.drive import drive_of
from sautereau.sim_backend.physics.events import Motions, PluckEvents, StringEvent
from sautereau.sim_backend.physics.observation import Observation, errors, observe
from sautereau.sim_backend.trade import study
from sautereau.sim_backend.trade.refinement import Trial, stepped
from sautereau.sim_backend.trade.study import run_trade
from tests.budget import amount, slow
from tests.sim_backend import finger_oracle, oracle
from tests.sim_backend.test_finger_oracle import SAMPLES
from tests.sim_backend.test_finger_oracle import drawn as drawn_finger
from tests.sim_backend.test_oracle import drawn as drawn_push

ASKED = "10 us"
FLOOR = 1e-7  # s, of times that are equal: ten times `refinement.ROUNDING`
BESIDE = 1e-10  # s, from an event to the values before and after it
SEEDS = [(f, seed) for f in ("push", "ideal", "servo") for seed in range(amount(2, 10))]


class Played:
    """A drive that follows an oracle's reference."""

    def __init__(self, reference):
        self.start, self.samples, self.reference = reference.start, SAMPLES, reference.of_sample
        self.ends = lambda: reference.counts(np.arange(SAMPLES + 1.0) * reference.period)


def drawn(finger, seed):
    """Return a random rig, a scene, its drive, and its oracle as a function of times [s]."""
    if finger == "push":
        rig, scene = drawn_push(seed)
        drive = drive_of(rig, scene)

        def solve(end, times=()):
            return oracle.solve(rig, scene, end, times)
    else:
        rig, scene, reference = drawn_finger(finger, seed)
        drive = Played(reference)

        def solve(end, times=()):
            return finger_oracle.solve(rig, scene, reference, end, times)

    return rig, scene.model_copy(update={"step": None, "accuracy": ASKED}), drive, solve


def truth(solve, end):
    """Return the oracle's observation, with two values of what may jump at an event."""
    bends = np.array(solve(end).bends)
    bends = bends[(bends > BESIDE) & (bends < end - BESIDE)]
    even = np.linspace(0.0, end, 4001)[1:-1]
    even = even[np.abs(even[:, None] - bends).min(axis=1, initial=math.inf) > 2 * BESIDE]
    shown = np.sort(np.concatenate([even, bends, bends]))
    asked = np.sort(np.concatenate([even, bends - BESIDE, bends + BESIDE]))
    found = solve(end, asked)
    angle, velocity, rise, force = np.array(found.motion).T
    events = {
        name: [StringEvent(*event) for event in getattr(found, name)]
        for name in ("contacts", "releases", "returns")
    }
    nothing = np.zeros_like(shown)
    motions = Motions(shown, angle, velocity, rise, force, nothing, nothing)
    return Observation(motions, PluckEvents(**events))


def of_events(seen, true):
    """Return the largest error [s] of a contact, release or return."""
    pairs = [
        pair
        for name in ("contacts", "releases", "returns")
        for pair in zip(getattr(seen.events, name), getattr(true.events, name), strict=True)
    ]
    return max((abs(a.time - b.time) for a, b in pairs), default=0.0)


@pytest.mark.parametrize("known", [True, False], ids=["exact", "refined"])
@pytest.mark.parametrize(("finger", "seed"), [slow(*each) for each in SEEDS])
def test_stated_errors_are_the_oracles_and_the_recommended_way_keeps_its_accuracy(
    monkeypatch, finger, seed, known
):
    """They are 0.5 to 5 times the true ones, with the exact solution as truth and without it.

    A solution by refinement states its own error, which each stated error contains. Where the
    scene has no exact solution, the exact engine cannot simulate it either.
    """
    rig, scene, drive, solve = drawn(finger, seed)
    monkeypatch.setattr(study, "drive_of", lambda *_: drive)
    monkeypatch.setattr(study, "STEPS", {"rigid": (1, 4, 16, 64), "exact": (1, 8) * known})
    monkeypatch.setattr(study, "RUNS", (1, 1))
    monkeypatch.setattr(study, "store_trade", lambda *_: None)
    own = []

    class Judged(Trial):
        def __init__(self, *parts):
            super().__init__(*(parts if known else (*parts[:-1], None)))

        def truth(self, scene):
            found = super().truth(scene)
            own.append(found.errors.time)
            return found

    monkeypatch.setattr(study, "Trial", Judged)
    trade = run_trade(rig, scene, fresh=True)
    assert trade.truth == "the exact solution" or not known
    exact = truth(solve, drive.samples * rig.controller.sample_period)
    true = {}
    for number, point in enumerate(trade.points):
        if not point.failed and point.level == "elastica":
            way = stepped(rig, scene, 1, engine=point.engine).model_copy(update={"step": point.dt})
            seen = observe(rig, way, drive)
            true[number] = of_events(seen, exact)
            # Jumps of the finger's force count too, which the rigid bodies do not locate.
            most = max(true[number], errors(seen, exact).time) + FLOOR
            assert 0.5 * (true[number] - FLOOR) < point.error < 5 * most + own[0]
    asked = Accuracy.parse(ASKED).time
    good = [number for number, error in true.items() if error <= asked]
    if trade.recommended is None:  # nothing is within it, or the truth is not known so well
        assert not good or own[0] > 0.1 * asked
        return
    chosen = trade.points[trade.recommended]
    assert chosen.error <= asked
    if trade.recommended in true:
        assert true[trade.recommended] <= asked
    fastest = max((trade.points[number].real_time_factor for number in good), default=0.0)
    assert chosen.real_time_factor > 0.9 * fastest

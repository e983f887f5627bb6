"""The stand-in's accuracy against its speed, and MuJoCo's for the same scenes.

Beside MuJoCo, whose error is given, each engine takes the longest steps with which it is at least
as accurate, and the processor time of all counts: another program that runs does not change it.
"""

import importlib.util
import time

import numpy as np

from benchmarks.figures import RUNS, Figure, check
from benchmarks.figures import timed as clocked
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.drive import Drive, drive_of
from sautereau.sim_backend.physics.observation import (
    Observation,
    errors,
    observe,
    play,
    reference,
)
from sautereau.sim_backend.physics.world import new_world
from sautereau.sim_backend.scene import Scene, load_scene
from sautereau.sim_backend.trade.refinement import stepped
from sautereau.sim_backend.trade.select import select_solver
from sautereau.sim_backend.trade.study import Timed, first_runs, time_in_turns

STEPS = 10  # Steps of the rigid engine per controller sample: 98 us each
FINER = (1, 2, 4, 8, 10, 16, 32, 64)
MUJOCO = {
    "pluck": {1: 10.0, STEPS: 2.0}, "ideal": {1: 100.0, STEPS: 10.0, 40: 1.0},
    "paper": {1: 100.0, STEPS: 20.0, 40: 5.0},
}  # fmt: skip
"""us, largest error of an event in MuJoCo with a number of steps per controller sample."""


def run() -> list[Figure]:
    """Return errors against the reference, and simulated time over real time."""
    rig = load_rig()
    pluck = load_scene("pluck")
    return [
        *_rigid(rig, pluck),
        *_exact(rig, pluck),
        *_paper(rig),
        *_settling(rig),
        *_mujoco(rig),
    ]


def _rigid(rig: Rig, scene: Scene) -> list[Figure]:
    error, factor = _measured(rig, stepped(rig, scene, STEPS, engine="rigid"))
    ways = [_measured(rig, stepped(rig, scene, steps, engine="rigid")) for steps in FINER]
    best = max(factor for error, factor in ways if error <= 1e-6)
    return [
        Figure("pluck, rigid, 98 us: error of an event", error * 1e6, "us", "limit", 2.0),
        Figure("pluck, rigid, 98 us: times real time", factor, "1", "at least", 14.0),
        Figure("pluck, rigid, within 1 us: times real time", best, "1", "at least", 3.0),
    ]


def _exact(rig: Rig, scene: Scene) -> list[Figure]:
    way = stepped(rig, scene, 1, engine="exact")
    error, factor = _measured(rig, way)
    alone = _alone(rig, way, drive_of(rig, way))
    name = "pluck, exact, 977 us"
    return [
        Figure(f"{name}: error of an event", error * 1e6, "us", "limit", 1.0),
        Figure(f"{name}: times real time", factor, "1", "at least", 100.0),
        Figure(f"{name}, world included", (alone.build + alone.run) * 1e6, "us", "limit", 100.0),
    ]


def _paper(rig: Rig) -> list[Figure]:
    scene = load_scene("paper")
    ways = [_measured(rig, stepped(rig, scene, steps, engine="rigid")) for steps in FINER[:6]]
    within = [factor for error, factor in ways if error <= 5e-6]
    least = min(error for error, _ in ways) * 1e6
    check(bool(within), f"no step is within 5 us; the best is {least:.3g} us off")
    return [
        Figure("paper, servo: smallest error of an event", least, "us", "limit", 5.0),
        Figure("paper, servo, within 5 us: times real time", max(within), "1", "at least", 5.0),
    ]


def _settling(rig: Rig) -> list[Figure]:
    figures = []
    for name, limit in (("pluck", 1.0), ("ideal", 1.0), ("paper", 5.0)):
        scene = load_scene(name)
        asked = scene.model_copy(update={"step": None, "accuracy": "10 us", "engine": "auto"})
        spent, settled = clocked(select_solver, rig, asked)
        drive = drive_of(rig, settled.scene)
        found = errors(observe(rig, settled.scene, drive), reference(rig, settled.scene, drive))
        check(found.time <= 10e-6, f"{name}: {found.time * 1e6:.3g} us off, 10 us were requested")
        figures.append(Figure(f"{name}: solver selected for 10 us", spent, "s", "limit", limit))
    return figures


def _mujoco(rig: Rig) -> list[Figure]:
    if importlib.util.find_spec("mujoco") is None:
        print("mujoco is not installed; comparison omitted: pip install --group peers")
        return []
    return [figure for name in MUJOCO for figure in _beside_mujoco(rig, name)]


def _beside_mujoco(rig: Rig, name: str) -> list[Figure]:
    from benchmarks.mujoco_peer import observe_in_mujoco

    scene, period = load_scene(name), rig.controller.sample_period
    true, drive, figures = reference(rig, scene), drive_of(rig, scene), []
    errors_of = {
        engine: {n: errors(_spent(rig, way, drive)[2], true).time for n, way in ways.items()}
        for engine in ("exact", "rigid")
        for ways in [{n: stepped(rig, scene, n, engine=engine) for n in FINER}]
    }
    for steps, limit in MUJOCO[name].items():
        *_, seen = observe_in_mujoco(rig, scene, period / steps, drive)
        off = errors(seen, true).time
        what = f"{name}: MuJoCo, {period / steps * 1e6:.0f} us"
        check(off < limit * 1e-6, f"{what}: {off * 1e6:.3g} us off")
        for engine, found in errors_of.items():
            chosen = next((n for n, error in found.items() if error <= off), FINER[-1])
            way, spent = stepped(rig, scene, chosen, engine=engine), []
            for _ in range(RUNS):  # in turns, so that all run under the same load
                *theirs, _ = observe_in_mujoco(rig, scene, period / steps, drive)
                *ours, _ = _spent(rig, way, drive)
                spent.append((sum(theirs), sum(ours), theirs[1], ours[1]))
            # A push ends with the pluck in MuJoCo.
            simulated = scene.push.duration if scene.push else drive.samples * period
            seconds = np.array([simulated, drive.samples * period] * 2)
            there, here, their_run, our_run = seconds / np.median(spent, axis=0)
            against = f"{engine}, {period / chosen * 1e6:.3g} us"
            figures += [
                Figure(f"{what}: error of an event", off * 1e6, "us", against, found[chosen] * 1e6),
                Figure(f"{what}: times real time", their_run, "1", against, our_run),
                Figure(f"{what}: times real time, world included", there, "1", against, here),
            ]
    return figures


def _spent(rig: Rig, way: Scene, drive: Drive) -> tuple[float, float, Observation]:
    """Return the processor times [s] to build a world and to run it, and what is observed."""
    began = time.process_time()
    world = new_world(rig, way, start=drive.start)
    built = time.process_time()
    seen = play(world, drive)
    return built - began, time.process_time() - built, seen


def _measured(rig: Rig, scene: Scene) -> tuple[float, float]:
    """Return the largest error of an event [s], and simulated time over the time to run it."""
    drive = drive_of(rig, scene)
    own = _alone(rig, scene, drive)
    simulated = drive.samples * rig.controller.sample_period
    return errors(own.found, reference(rig, scene, drive)).time, simulated / own.run


def _alone(rig: Rig, way: Scene, drive: Drive) -> Timed:
    """Return what is observed in a drive simulated in one way, and how long it took."""
    (own,) = first_runs(rig, [way], drive)
    if isinstance(own, str):
        raise SceneError(own)
    time_in_turns(rig, [way], drive, [own])
    return own

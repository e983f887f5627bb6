"""The stand-in's accuracy against its speed, and MuJoCo's for the same push."""

import importlib.util

import numpy as np

from benchmarks.figures import RUNS, Figure, check
from benchmarks.figures import timed as clocked
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.drive import Drive, drive_of
from sautereau.sim_backend.physics.observation import errors, observe, reference
from sautereau.sim_backend.scene import Scene, load_scene
from sautereau.sim_backend.trade.refinement import stepped
from sautereau.sim_backend.trade.select import select_solver
from sautereau.sim_backend.trade.study import Timed, first_runs, time_in_turns

STEPS = 10  # Steps of the rigid engine per controller sample: 98 us each
FINER = (1, 2, 4, 8, 10, 16, 32, 64)
MUJOCO = {1: 10.0, STEPS: 2.0}
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
        *_mujoco(rig, pluck),
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


def _mujoco(rig: Rig, scene: Scene) -> list[Figure]:
    if importlib.util.find_spec("mujoco") is None:
        print("mujoco is not installed; comparison omitted: pip install --group peers")
        return []
    from benchmarks.mujoco_peer import observe_in_mujoco

    true, drive = reference(rig, scene), drive_of(rig, scene)
    simulated = drive.samples * rig.controller.sample_period
    figures = []
    for steps, limit in MUJOCO.items():
        step = rig.controller.sample_period / steps
        name, seen = f"MuJoCo, {step * 1e6:.0f} us", None
        ways = {engine: stepped(rig, scene, steps, engine=engine) for engine in ("rigid", "exact")}
        ours: dict[str, float] = {}
        built: dict[str, list[float]] = {engine: [] for engine in ("", *ways)}
        ran: dict[str, list[float]] = {engine: [] for engine in ("", *ways)}
        for _ in range(RUNS):  # in turn, so that all run under the same load
            *spent, seen = observe_in_mujoco(rig, scene, step)
            scale = simulated / scene.push.duration
            built[""].append(spent[0])
            ran[""].append(spent[1] * scale)
            for engine, way in ways.items():
                own = _alone(rig, way, drive)
                ours[engine] = errors(own.found, true).time
                built[engine].append(own.build)
                ran[engine].append(own.run)
        off = errors(seen, true).time
        check(off < limit * 1e-6, f"{name}: {off * 1e6:.3g} us off")
        alone = {engine: simulated / float(np.median(ran[engine])) for engine in ran}
        whole = {
            engine: simulated / float(np.median(np.add(built[engine], ran[engine])))
            for engine in ran
        }
        for engine in ways:
            figures += [
                Figure(f"{name}: error of an event", off * 1e6, "us", engine, ours[engine] * 1e6),
                Figure(f"{name}: times real time", alone[""], "1", engine, alone[engine]),
                Figure(
                    f"{name}: times real time, world included",
                    whole[""],
                    "1",
                    engine,
                    whole[engine],
                ),
            ]
    return figures


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

"""Work-precision study: error and speed of a scene on this machine, simulated in every way."""

import contextlib
import hashlib
import json
import math
import os
import platform
import statistics
import time
from dataclasses import asdict, fields, replace
from importlib.metadata import version
from pathlib import Path

from sautereau.analysis.errors import ModelError
from sautereau.rig.disk import read_text, write_durably
from sautereau.rig.document import rig_json
from sautereau.rig.progress import tracked
from sautereau.rig.schema import Rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.parts import Accuracy
from sautereau.sim_backend.physics.drive import Drive
from sautereau.sim_backend.physics.observation import Observation, drive_of, errors, play, reference
from sautereau.sim_backend.physics.world import new_world
from sautereau.sim_backend.scene import Scene
from sautereau.sim_backend.trade.refinement import stepped
from sautereau.sim_backend.trade.results import MARGIN, Point, Trade, pareto_front, recommended
from sautereau.sim_backend.trade.select import best_models

STEPS = {"rigid": (1, 2, 4, 8, 16, 32, 64), "exact": (1, 2, 4, 8, 16)}
"""Steps per controller sample that are tried with an engine."""
FEW = (1, 8)
"""Those that simpler levels and strings are tried with: a step does not improve a model."""
RUNS = (3, 99)  # Least and largest number of runs whose median speed counts
ENOUGH = 0.3  # s, total duration of runs after which there are no more


def run_trade(rig: Rig, scene: Scene, fresh: bool = False) -> Trade:
    """Measure error and speed of a scene over engine, step, level and string.

    The truth is the reference solution of the scene, with the best level and string where it
    says "auto"; simpler ones than those are tried, but no better ones.

    Args:
        scene: With a step or an accuracy, which only affects the recommendation.
        fresh: Measure again, even if the result is in the cache.

    Raises:
        SceneError: The scene cannot be simulated.
    """
    found = None if fresh else stored_trade(rig, scene)
    if found is None:
        found = _measured(rig, scene)
        store_trade(rig, scene, found)
    return found


def stored_trade(rig: Rig, scene: Scene) -> Trade | None:
    """Return the study in the user's cache, or None where there is none or it is damaged."""
    try:
        document = json.loads(read_text(_path(rig, scene)))
        points = tuple(Point(**point) for point in document.pop("points"))
        pareto = tuple(document.pop("pareto"))
        return replace(Trade(points=points, pareto=pareto, **document), cached=True)
    except (OSError, ValueError, TypeError, KeyError):
        return None


def store_trade(rig: Rig, scene: Scene, trade: Trade) -> None:
    """Write a study to the cache, so that no other process ever reads an incomplete file."""
    path = _path(rig, scene)
    with contextlib.suppress(OSError):  # without a cache it is only slower
        path.parent.mkdir(parents=True, exist_ok=True)
        write_durably(path, json.dumps(asdict(trade)), replace=True)


def timed(rig: Rig, scene: Scene, drive: Drive) -> tuple[Observation, float, float]:
    """Return what is observed in a drive, and the times [s] to build its world and to run it.

    Both are medians of repeats, after one that loads what is cached or compiled.

    Args:
        scene: With its step and engine chosen.

    Raises:
        SceneError: The scene cannot be simulated.
    """
    least, most = RUNS
    builds: list[float] = []
    runs: list[float] = []
    play(new_world(rig, scene, start=drive.start), drive)
    while True:
        started = time.perf_counter()
        world = new_world(rig, scene, start=drive.start)
        built = time.perf_counter()
        found = play(world, drive)
        runs.append(time.perf_counter() - built)
        builds.append(built - started)
        if len(runs) == most or (len(runs) >= least and sum(runs) > ENOUGH):
            return found, statistics.median(builds), statistics.median(runs)


def machine() -> str:
    """Return a description of this machine, without its name."""
    system = f"{platform.system()}, Python {platform.python_version()}"
    return f"{platform.machine()}, {os.cpu_count()} cores, {system}"


def _path(rig: Rig, scene: Scene) -> Path:
    import platformdirs

    parts = [version("sautereau"), platform.node(), machine(), rig_json(rig), repr(scene)]
    parts += [field.name for field in fields(Point)]
    name = hashlib.sha256("\n".join(parts).encode()).hexdigest()
    return platformdirs.user_cache_path("sautereau", appauthor=False) / "trade" / f"{name}.json"


def _measured(rig: Rig, scene: Scene) -> Trade:
    true = scene.true_rig(rig)
    drive = drive_of(rig, scene)
    exact = best_models(true, scene)
    truth = reference(rig, exact, drive)
    points = [_point(rig, way, drive, truth) for way in tracked(_ways(true, exact))]
    good = [i for i, point in enumerate(points) if not point.failed]
    front = pareto_front(
        [points[i].error or 0.0 for i in good],
        [points[i].real_time_factor or 0.0 for i in good],
        MARGIN,
    )
    asked = Accuracy.parse(scene.accuracy).time if scene.accuracy else None
    requested = asked or 0.5 / rig.daq.sample_rate  # half a sample, which no recording resolves
    return Trade(
        scene=scene.description,
        machine=machine(),
        requested=requested,
        points=tuple(points),
        pareto=tuple(good[i] for i in front),
        recommended=recommended(points, requested, MARGIN),
    )


def _ways(true: Rig, exact: Scene) -> list[Scene]:
    """Return complete scenes: all steps of the exact one, and a few of each simpler model."""
    engines = ["rigid", "exact"] if exact.solvable else ["rigid"]
    ways = [stepped(true, exact, n, engine=engine) for engine in engines for n in STEPS[engine]]
    simpler = [{"plectrum": level} for level in _simpler_levels(true, exact)]
    if exact.string == "modal":
        simpler.append({"string": "spring"})
    return ways + [
        stepped(true, exact, n, engine=engine, **change)
        for change in simpler
        for engine in (["rigid", "exact"] if "string" in change else engines)
        for n in FEW
    ]


def _simpler_levels(true: Rig, exact: Scene) -> list[str]:
    if exact.plectrum not in ("elastica", "fe"):
        return []
    simpler = ["rods", "beam"] if exact.plectrum == "elastica" else ["elastica", "rods", "beam"]
    return [*simpler, "two-beam"] if true.plectrum.tip_thickness is not None else simpler


def _point(rig: Rig, way: Scene, drive: Drive, truth: Observation) -> Point:
    models = way.engine, way.plectrum, way.string
    blank = Point(way.description, way.step or 0.0, *models)
    try:
        found, built, ran = timed(rig, way, drive)
    except (SceneError, ModelError) as error:
        return replace(blank, failed=str(error))
    error = errors(found, truth)
    if not math.isfinite(error.time + error.force):
        return replace(blank, failed="contacts or releases are missing, or there are too many")
    simulated = drive.samples * rig.controller.sample_period
    return replace(
        blank,
        error=error.time,
        force_error=error.force,
        real_time_factor=simulated / (built + ran),
        build_time=built,
        run_time=ran,
    )

"""Work-precision study: error and speed of a scene on this machine, simulated in every way."""

import contextlib
import hashlib
import json
import math
import os
import platform
import statistics
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np

from sautereau.analysis.errors import ModelError
from sautereau.rig.disk import read_text, write_durably
from sautereau.rig.document import rig_json
from sautereau.rig.progress import tracked
from sautereau.rig.schema import Rig
from sautereau.rig.version import code_hash
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.parts import Accuracy
from sautereau.sim_backend.physics.drive import Drive
from sautereau.sim_backend.physics.observation import (
    Observation,
    drive_of,
    errors,
    observe,
    play,
    reference,
)
from sautereau.sim_backend.physics.world import new_world
from sautereau.sim_backend.scene import Scene
from sautereau.sim_backend.trade.refinement import Trial, Truth, stepped, total
from sautereau.sim_backend.trade.results import MARGIN, Point, Trade, pareto_front, recommended
from sautereau.sim_backend.trade.select import best_models

STEPS = {"rigid": (1, 2, 4, 8, 16, 32, 64), "exact": (1, 2, 4, 8, 16)}
"""Steps per controller sample that are tried with an engine."""
RUNS = (3, 99)  # Least and largest number of runs whose median speed counts
SIMULATING = ("rig", "trajectory", "analysis", "sim_backend")
"""Packages whose code may change a study; one in the cache is of the same code."""


def run_trade(rig: Rig, scene: Scene, fresh: bool = False) -> Trade:
    """Measure error and speed of a scene over engine, step, level and string.

    The truth is the exact solution of the scene, with the best level and string where it says
    "auto", or where there is none its finest refinement; see `Trial.truth`. Simpler models than
    those are tried, but no better ones.

    Args:
        scene: With a step or an accuracy, which only affects the recommendation.
        fresh: Measure again, even if the result is in the cache.

    Raises:
        SceneError: The scene cannot be simulated.
    """
    found = None if fresh else stored_trade(rig, scene)
    if found is not None:
        return found
    true = scene.true_rig(rig)
    drive = drive_of(rig, scene)
    best = best_models(true, scene)
    ways = _ways(true, best)
    # First of all, as the truth would compile the exact engine beforehand.
    every = list(zip(ways, first_runs(rig, ways, drive), strict=True))
    truth = Trial(rig, true, drive, observe, reference).truth(best)
    kept = [one for i, one in enumerate(every) if not any(_is_same(one, b) for b in every[:i])]
    clocked = [(way, one) for way, one in kept if isinstance(one, Timed)]
    time_in_turns(rig, [way for way, _ in clocked], drive, [one for _, one in clocked])
    points = [_point(rig, way, drive, truth, one) for way, one in kept]
    good = [i for i, point in enumerate(points) if not point.failed]
    front = pareto_front(
        [points[i].error or 0.0 for i in good],
        [points[i].real_time_factor or 0.0 for i in good],
        MARGIN,
    )
    asked = Accuracy(0.5 / rig.daq.sample_rate, None)  # half a sample: no recording resolves it
    if scene.accuracy:
        asked = Accuracy.parse(scene.accuracy)
    extra = [one.first - one.build - one.run for way, one in clocked if way.engine == "exact"]
    found = Trade(
        scene=scene.description,
        machine=machine(),
        truth=truth.origin,
        requested=asked,
        points=tuple(points),
        pareto=tuple(good[i] for i in front),
        recommended=recommended(points, asked, MARGIN),
        compile_time=max(0.0, extra[0]) if extra else 0.0,
        same=len(every) - len(kept),
    )
    store_trade(rig, scene, found)
    return found


def stored_trade(rig: Rig, scene: Scene) -> Trade | None:
    """Return the study in the user's cache, or None where there is none or it is damaged."""
    try:
        document = json.loads(read_text(_path(rig, scene)))
        points = tuple(Point(**point) for point in document.pop("points"))
        document["requested"] = Accuracy(**document["requested"])
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


@dataclass
class Timed:
    """One way to simulate a drive, and how long each of its repeats took."""

    found: Observation
    first: float
    """s, to build the world and to run the drive for the first time, which may compile."""
    builds: list[float] = field(default_factory=list)
    """s, to build its world."""
    runs: list[float] = field(default_factory=list)
    """s, to run the drive."""

    @property
    def build(self) -> float:
        """Median time [s] to build its world."""
        return statistics.median(self.builds)

    @property
    def run(self) -> float:
        """Median time [s] to run the drive."""
        return statistics.median(self.runs)

    @property
    def spread(self) -> float:
        """Interquartile range of the times of a run over their median, dimensionless."""
        low, middle, high = np.percentile(self.runs, (25, 50, 75))
        return float((high - low) / middle)

    def repeat(self, rig: Rig, way: Scene, drive: Drive) -> None:
        """Simulate it once more."""
        started = time.perf_counter()
        world = new_world(rig, way, start=drive.start)
        built = time.perf_counter()
        play(world, drive)
        self.runs.append(time.perf_counter() - built)
        self.builds.append(built - started)


def first_runs(rig: Rig, ways: Sequence[Scene], drive: Drive) -> list[Timed | str]:
    """Simulate a drive once in each way.

    Args:
        ways: With their steps and engines chosen.

    Returns:
        One for each way; for one that cannot be simulated, why.
    """
    found: list[Timed | str] = []
    for way in tracked(ways):
        started = time.perf_counter()
        try:
            seen = play(new_world(rig, way, start=drive.start), drive)
            found.append(Timed(seen, time.perf_counter() - started))
        except (SceneError, ModelError) as error:
            found.append(str(error))
    return found


def time_in_turns(rig: Rig, ways: Sequence[Scene], drive: Drive, found: Sequence[Timed]) -> None:
    """Repeat the ways to simulate a drive in turns, so that a load slows all of them alike.

    Args:
        found: Their first runs.
    """
    least, most = RUNS
    for n in range(most):
        for way, one in zip(ways, found, strict=True):
            if n < least or sum(one.runs) < 0.3:  # s
                one.repeat(rig, way, drive)


def machine() -> str:
    """Return a description of this machine, without its name."""
    system = f"{platform.system()}, Python {platform.python_version()}"
    return f"{platform.machine()}, {os.cpu_count()} cores, {system}"


def _path(rig: Rig, scene: Scene) -> Path:
    import platformdirs

    code = code_hash(Path(__file__).parents[2], SIMULATING)
    parts = [code, platform.node(), machine(), rig_json(rig), repr(scene)]
    name = hashlib.sha256("\n".join(parts).encode()).hexdigest()
    return platformdirs.user_cache_path("sautereau", appauthor=False) / "trade" / f"{name}.json"


def _is_same(this: tuple[Scene, Timed | str], other: tuple[Scene, Timed | str]) -> bool:
    """Return whether two ways with one engine and models simulated the same steps.

    An engine that divides its step itself, while something stiff is in contact, may ignore ours.
    """
    (way, one), (before, two) = this, other
    if isinstance(one, str) or isinstance(two, str):
        return False
    models = [(each.engine, each.plectrum, each.string) for each in (way, before)]
    motions = [vars(each.found.motions).values() for each in (one, two)]
    return models[0] == models[1] and all(map(np.array_equal, *motions))


def _ways(true: Rig, exact: Scene) -> list[Scene]:
    """Return complete scenes: all steps of the exact one, and a few of each simpler model."""
    ways = [stepped(true, exact, n, engine=engine) for engine in STEPS for n in STEPS[engine]]
    levels = {"elastica": ["rods", "beam"], "fe": ["elastica", "rods", "beam"]}
    simpler = [{"plectrum": level} for level in levels.get(exact.plectrum, [])]
    if simpler and true.plectrum.tip_thickness is not None:
        simpler.append({"plectrum": "two-beam"})
    if exact.string == "modal":
        simpler.append({"string": "spring"})
    ways += [
        stepped(true, exact, n, engine=engine, **change)
        for change in simpler
        for engine in ("rigid", "exact")
        for n in (1, 8)  # Not all: a step does not improve a model
    ]
    return [way for way in ways if way.engine == "rigid" or way.solvable]


def _point(rig: Rig, way: Scene, drive: Drive, truth: Truth, one: Timed | str) -> Point:
    models = way.engine, way.plectrum, way.string
    blank = Point(way.description, way.step or 0.0, *models)
    if isinstance(one, str):
        return replace(blank, failed=one)
    error = total(errors(one.found, truth.observation), truth.errors)
    if not math.isfinite(error.time + error.force):
        return replace(blank, failed="contacts or releases are missing, or there are too many")
    simulated = drive.samples * rig.controller.sample_period
    return replace(
        blank,
        error=error.time,
        force_error=error.force,
        real_time_factor=simulated / (one.build + one.run),
        build_time=one.build,
        run_time=one.run,
        spread=one.spread,
    )

"""How fast and how wrong a scene is on this machine, simulated in every way there is."""

import math
from collections.abc import Callable
from dataclasses import replace

from sautereau.analysis.errors import ModelError
from sautereau.rig.schema import Rig
from sautereau.sim_backend.accuracy import Accuracy
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.drive import Drive, drive_of
from sautereau.sim_backend.physics.observation import Observation, errors
from sautereau.sim_backend.scene import Scene
from sautereau.sim_backend.trade.cache import machine, store_trade, stored_trade
from sautereau.sim_backend.trade.choose import told
from sautereau.sim_backend.trade.pareto import pareto
from sautereau.sim_backend.trade.points import Point, Trade
from sautereau.sim_backend.trade.stopwatch import timed

STEPS = {"rigid": (1, 2, 4, 8, 16, 32, 64), "reduced": (1, 2, 4, 8, 16)}
"""Steps a controller sample that are tried with an engine."""
FEW = (1, 8)
"""Those that simpler levels and strings are tried with: a step does not mend a model."""
ITERATIONS = (1, 3, 30, 100)
"""Of the rigid bodies' solver, tried beside the scene's own with `MIDDLE` steps a sample."""
MIDDLE = 8
MARGIN = 0.1
"""1, of speed, which the clock on the wall does not tell apart."""


def run_trade(
    rig: Rig,
    scene: Scene,
    fresh: bool = False,
    progress: Callable[[float], None] = lambda share: None,
) -> Trade:
    """Measure error and speed of a scene over engine, step, iterations, level and string.

    The truth is the reference of the scene as it is told, with the best level and string
    where it says auto; simpler ones than those are tried, and not better ones.

    Args:
        rig: The nominal bench.
        scene: With a step or an accuracy, which only says what to recommend.
        fresh: Measure again, whatever was measured before.
        progress: Told the share that is done, from 0 to 1.

    Raises:
        SceneError: The scene cannot be simulated.
    """
    found = None if fresh else stored_trade(rig, scene)
    if found is None:
        found = _measured(rig, scene, progress)
        store_trade(rig, scene, found)
    progress(1.0)
    return found


def recommended(points: list[Point], wanted: float) -> int | None:
    """Return the index of the fastest point whose error [s] is at most the wanted one."""
    fit = [i for i, p in enumerate(points) if p.error is not None and p.error <= wanted]
    return max(fit, key=lambda i: points[i].real_time_factor or 0.0, default=None)


def _measured(rig: Rig, scene: Scene, progress: Callable[[float], None]) -> Trade:
    from sautereau.sim_backend.physics.reference.observe import reference

    true = scene.true_rig(rig)
    drive = drive_of(rig, scene)
    exact = told(true, scene)
    truth = reference(rig, exact, drive)
    ways = _ways(true, exact)
    points = []
    for i, way in enumerate(ways):
        progress(i / len(ways))
        points.append(_point(rig, true, way, drive, truth))
    good = [i for i, point in enumerate(points) if not point.failed]
    wrong = [points[i].error or 0.0 for i in good]
    kept = pareto(wrong, [points[i].real_time_factor or 0.0 for i in good], MARGIN)
    wanted = _wanted(rig, scene)
    return Trade(
        scene=scene.description,
        machine=machine(),
        wanted=wanted,
        points=tuple(points),
        pareto=tuple(good[i] for i in kept),
        recommended=recommended(points, wanted),
    )


def _wanted(rig: Rig, scene: Scene) -> float:
    """Return the error [s] asked for, or half a sample of the card, which no recording shows."""
    asked = Accuracy.parse(scene.accuracy).time if scene.accuracy else None
    return asked or 0.5 / rig.daq.sample_rate


def _ways(true: Rig, exact: Scene) -> list[Scene]:
    """Return settled scenes: all steps of the exact one, and a few of each simpler model."""
    engines = ["rigid"]
    if exact.finger != "servo":
        engines.append("reduced")
    ways = [
        way
        for engine in engines
        for steps in STEPS[engine]
        if (way := _way(true, exact, steps, engine=engine))
    ]
    middle = [_way(true, exact, MIDDLE, engine="rigid", iterations=n) for n in ITERATIONS]
    ways += [way for way in middle if way and way.iterations != exact.iterations]
    simpler = [{"plectrum": level} for level in _simpler_levels(true, exact)]
    if exact.string == "modal":
        simpler.append({"string": "spring"})
    for change in simpler:
        for engine in engines:
            ways += [
                way for steps in FEW if (way := _way(true, exact, steps, engine=engine, **change))
            ]
    return ways


def _way(true: Rig, exact: Scene, steps: int, **change: str | int) -> Scene | None:
    """Return a settled scene, or None where an engine does not do it."""
    step = true.controller.sample_period / steps
    way = exact.model_copy(update={"step": step, "accuracy": None, **change})
    return None if way.engine == "reduced" and way.string == "modal" else way


def _simpler_levels(true: Rig, exact: Scene) -> list[str]:
    if exact.plectrum not in ("elastica", "fe"):
        return []
    simpler = ["rods", "beam"] if exact.plectrum == "elastica" else ["elastica", "rods", "beam"]
    return [*simpler, "two-beam"] if true.plectrum.tip_thickness is not None else simpler


def _point(rig: Rig, true: Rig, way: Scene, drive: Drive, truth: Observation) -> Point:
    period = true.controller.sample_period
    blank = Point(
        scene=way.description,
        dt=way.step or period,
        engine=way.engine,
        level=way.plectrum,
        string=way.string,
        iterations=way.iterations,
        error=None,
        force_error=None,
        real_time_factor=None,
    )
    try:
        found, factor = timed(rig, way, drive)
    except (SceneError, ModelError) as error:
        return replace(blank, failed=str(error))
    wrong = errors(found, truth)
    if not math.isfinite(wrong.time + wrong.force):
        return replace(blank, failed="it misses contacts or releases, or invents some")
    return replace(
        blank,
        error=wrong.time,
        force_error=wrong.force,
        real_time_factor=factor,
    )

"""Correct the trajectory from the measured speed of the jack, press after press."""

import uuid
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sautereau.commands import common

LEARNED = "learned.json"
"""File of the correction in the folder."""


def learn(
    rig: common.RigName = "paper",
    *,
    n: Annotated[int, Parameter(name=["-n", "--number"])] = 6,
    feed_forward: Path | None = None,
    out: common.OutFolder,
    notes: str = "",
    simulation: common.Simulation = common.Simulation(),
    json: common.Json = False,
) -> int:
    """Press up to n times, correcting the trajectory from the measured speed of the jack.

    Parameters
    ----------
    n
        Maximum number of presses; learning stops when the speed error no longer improves.
    feed_forward
        Recording of an earlier press, for feed-forward torques against its measured force.
    out
        Folder for the recordings and for learned.json, the correction for `press --learned`.
    notes
        Operator's notes, saved in every recording.
    """
    from sautereau.analysis.model.predict import expected_of
    from sautereau.daq.file.reading import read_session
    from sautereau.robot.drivers.registry import motion_controller
    from sautereau.robot.errors import RobotError
    from sautereau.robot.experiment.feedforward import force_of
    from sautereau.robot.experiment.folder_lock import only_session
    from sautereau.robot.experiment.learning import IterativeLearning, write_learned
    from sautereau.robot.experiment.plan import digest
    from sautereau.robot.experiment.session import Item, Origin, make_presses

    served = common.bench(rig, simulation)
    nominal = served.rig.values
    expected, doubts = expected_of(nominal)
    file = out / LEARNED
    if file.exists():
        raise RobotError(f"learning: {file} already exists; give another --out")
    pushed = digest(feed_forward) if feed_forward else ""
    measured = force_of(feed_forward) if feed_forward else None
    lesson = IterativeLearning(nominal, expected, n, measured=measured, notes=notes)
    warnings = [*doubts, *lesson.warnings]
    common.warn(not json, *warnings)
    with (
        common.signals_stop(),
        only_session(out),
        served.connected() as bench,
        common.bar(n) as step,
    ):
        common.say(not json, f"rig {nominal.name} on {bench.where}\n{'press':<18} RMS speed error")

        def done(item: Item, path: Path) -> None:
            bench.keep_truth(path)
            lesson.update(item, path)
            common.say(not json, f"{path.name:<18} {lesson.errors[-1]:>8.2%}")
            step()

        recordings = make_presses(
            motion_controller(bench.rig),
            out,
            lesson.presses_on(bench.rig),
            Origin(uuid.uuid4().hex, bench.scene, bench.seed),
            on_press=done,
        )
    best = lesson.best
    lines = [f"learning stopped: {lesson.stopped}"] if lesson.stopped else []
    if best is None:
        lines.append("no correction reduced the speed error")
    else:
        write_learned(file, nominal, best, lesson.errors, pushed)
        lines.append(f"learned:    {file}; use it with press --learned")
    result = {
        "rms_speed_error": lesson.errors,
        "stopped": lesson.stopped,
        "learned": str(file) if best is not None else None,
        "recordings": [str(path) for path in recordings],
        "simulated": any(read_session(path).simulated for path in recordings),
        "seed": bench.seed,
        "warnings": warnings,
    }
    return common.answer(json, result, [*lines, *(f"recording:  {path}" for path in recordings)])

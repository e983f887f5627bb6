"""Press the key: once, as a session, again as recorded, or to learn."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from sautereau.analysis.results.result import part_of
from sautereau.commands import common
from sautereau.commands.output import FileOutput, Output
from sautereau.commands.running import on_signals

if TYPE_CHECKING:
    from sautereau.entrance.bench import Bench
    from sautereau.entrance.devices import Connected
    from sautereau.entrance.pressing import Settings
    from sautereau.robot.experiment.monitor import Control


def press(
    rig: common.RigName = "paper",
    *,
    n: common.Number = 1,
    out: common.OutFolder = common.Dated("press-DATE"),
    table: Annotated[Path | None, common.read_as("a CSV file of presses", ".csv")] = None,
    design: Annotated[Path | None, common.read_as("a TOML file of a design", ".toml")] = None,
    rest: common.Duration = common.Quantity(0),
    learned: common.Learned = None,
    feed_forward: common.FeedForward = None,
    ignore_health: Annotated[bool, common.RARE] = False,
    recorded: common.Recorded = common.Recorded(),
    simulation: common.Simulation = common.Simulation(),
    output: Output = Output(),
) -> int:
    r"""Press the key n times, record each press, and compare them with the model.

    Ctrl-\ pauses after the current press, with the motors off; press it again to continue. Ctrl-C
    ends the session. To continue an interrupted session, run the same command again with the same
    --out; with a larger -n it adds presses, also to a finished session.

    Parameters
    ----------
    n
        Number of presses. With a table: number of presses of each row with an empty cell `repeats`.
    out
        Folder for the recordings. Existing files in it are kept.
    table
        CSV file of presses. Its columns are keys of the rig file (press.jack_speed), with values
        and units in the cells, and optionally `repeats` and `notes`. If a row changes the
        instrument, the command asks you to change it.
    design
        TOML file of a designed experiment: `[factors]` with their levels, `repeats`, `block`
        (factors that are changed by hand), `set_ups` and `seed`. More repeats or levels add presses
        to a session.
    rest
        Time between presses: "2 s".
    learned
        Correction of the trajectory, written by `sautereau learn`.
    ignore_health
        Continue where the session would stop, with the motors off: the jack has not returned, the
        key has not followed the finger or has sunk, the plectrum no longer plucks, or the force at
        rest has drifted.
    """
    from sautereau.entrance.pressing import Settings, Table
    from sautereau.robot.experiment.design import read_design

    if design is not None and (table is not None or n != 1):
        return output.fail("--design excludes --table and -n: its file has the repeats", 2)
    settings = Settings(
        recorded.warm_up, rest, recorded.notes, learned, feed_forward, ignore_health
    )
    what = Table(table, n) if table else read_design(design) if design else n
    return _run(common.bench(rig, simulation), what, out, settings, recorded, output)


def replay(
    first: Annotated[Path, Parameter(name="[RIG] RECORDING")],
    second: Annotated[Path | None, Parameter(name="RECORDING", show=False)] = None,
    /,
    *,
    rig: common.RigName = "paper",
    n: common.Number = 1,
    out: common.OutFolder = common.Dated("replay-DATE"),
    recorded: common.Recorded = common.Recorded(),
    simulation: common.Simulation = common.Simulation(),
    output: Output = Output(),
) -> int:
    """Repeat a recorded press n times, and record it.

    The motion is the plan in the recording, with its learned correction. If the recording has no
    plan, for example because it was imported, the motion is the measured one.

    Parameters
    ----------
    first
        Recording of the press, after the rig file: `sautereau replay my-rig.toml press-0001.mcap`.
    n
        Number of presses.
    out
        Folder for the recordings.
    """
    from sautereau.entrance.pressing import Replay, Settings
    from sautereau.rig.disk import kind_of

    kind = "a recording"
    recording, own = common.rig_first(
        "replay", first, second, lambda path: kind_of(path) == kind, kind, output
    )
    what, settings = Replay(recording, n), Settings(recorded.warm_up, notes=recorded.notes)
    return _run(common.bench(own or rig, simulation), what, out, settings, recorded, output)


def learn(
    rig: common.RigName = "paper",
    *,
    n: common.Number = 6,
    out: common.OutFolder = common.Dated("learn-DATE"),
    feed_forward: common.FeedForward = None,
    notes: common.Notes = "",
    simulation: common.Simulation = common.Simulation(),
    output: FileOutput = FileOutput(),
) -> int:
    """Press up to n times, correcting the trajectory from the measured speed of the jack.

    The exit status is 1 if the speed error of the best press stays above press.speed_tolerance. To
    continue after an interruption, run the same command again with the same --out.

    Parameters
    ----------
    n
        Maximum number of presses; learning stops when the speed error no longer improves.
    out
        Folder for the recordings and for learned.json, the correction for `press --learned`.
    """
    from sautereau.entrance.learning import LEARNED, Learning

    def begin(bench: "Connected") -> None:
        output.say(f"rig {bench.rig.name} on {bench.where}\n{'press':<18} RMS speed error")

    def pressed(path: Path, error: float) -> None:
        output.say(f"{path.name:<18} {100 * error:>8.2f} %")
        show(next(presses) / n)

    with output.replacing(out / LEARNED), output.progress("learning") as show:
        presses = count(1)
        bench = common.bench(rig, simulation)
        learning = Learning(bench, n, out, notes, feed_forward)
        output.warn(*learning.warnings)
        with _pausing(bench.control):
            found = learning.run(begin, pressed)
    lines = [f"learning stopped: {found.stopped}"] if found.stopped else []
    lines.append(
        f"learned:    {found.path}; use it with press --learned"
        if found.path
        else "no correction reduced the speed error"
    )
    result = {
        "rms_speed_error": found.errors,
        **part_of(found, "held_speed_error", "tolerance", "reached"),
        **part_of(found, "floor", "rounding", "scatter", "fast"),
        "learned": found.path,
        "recordings": [press.path for press in found.session],
        **part_of(found, "stopped", "simulated", "seed", "warnings"),
    }
    lines += [f"recording:  {press.path}" for press in found.session]
    lines += [found.verdict] if found.reached else []
    return output.answer(
        result, lines, faults=[] if found.reached else [f"learning: {found.verdict}"]
    )


def _run(
    bench: "Bench",
    what: Any,
    out: Path,
    settings: "Settings",
    recorded: common.Recorded,
    output: Output,
) -> int:
    """Run a session, and print every press of it and its analysis."""
    from sautereau.commands.session import SessionReport
    from sautereau.entrance.pressing import Pressing

    pressing = Pressing(bench, what, out, settings)
    output.warn(*pressing.planner.warnings)
    report = SessionReport(pressing, output, recorded)
    with _pausing(bench.control):
        pressing.run(report)
    return report.end()


@contextmanager
def _pausing(control: "Control") -> Iterator[None]:
    r"""Pause after the present press on Ctrl-\, on Windows on Ctrl-Break; continue on the next."""

    def toggle(_number: int, _frame: object) -> None:
        if control.paused:
            control.resume()
        else:
            control.pause()
            sys.stderr.write("pausing after this press; the same key continues, Ctrl-C stops\n")

    with on_signals(("SIGQUIT", "SIGBREAK"), toggle):
        yield

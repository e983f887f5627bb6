"""Press the key."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from sautereau.commands import common

if TYPE_CHECKING:
    from sautereau.entrance.bench import Bench
    from sautereau.robot.experiment.control import Control


def _is_time(_: object, text: str) -> None:
    from sautereau.rig.units import parse_quantity

    if parse_quantity(text, "s") < 0:
        raise ValueError(f"The rest must be 0 s or longer, not {text!r}.")


def press(
    rig: common.RigName = "paper",
    *,
    n: Annotated[int, Parameter(name=["-n", "--number"])] = 1,
    table: Path | None = None,
    warm_up: int = 0,
    rest: Annotated[str, Parameter(validator=_is_time)] = "0 s",
    learned: Path | None = None,
    feed_forward: Path | None = None,
    out: common.OutFolder,
    notes: str = "",
    view: bool = False,
    live: bool = False,
    simulation: common.Simulation = common.Simulation(),
    json: common.Json = False,
) -> int:
    r"""Press the key n times, record each press, and compare them with the model.

    Ctrl-\ pauses after the present press with the motors off, and continues; Ctrl-C ends. To
    continue an interrupted session, run the same command again.

    Parameters
    ----------
    n
        Number of presses; with a table, of each row without a number of repeats.
    table
        CSV file of presses: columns are the rig's dotted keys (press.jack_speed), cells
        hold values with units; further columns are repeats and notes. If a row changes
        the instrument, you are asked to set it.
    warm_up
        Number of warm-up presses, at the start and after each change of the instrument.
    rest
        Time between presses: "2 s".
    learned
        Correction of the trajectory, written by `sautereau learn`.
    feed_forward
        Recording of an earlier press, for feed-forward torques against its measured force.
    out
        Folder for the recordings; nothing in it is overwritten.
    notes
        Operator's notes, saved in every recording.
    view
        Show arm, acquisition, force and speed in the terminal during the session.
    live
        Serve them to Foxglove on this machine.
    """
    from sautereau.entrance.pressing import Table

    run = _Options(warm_up, rest, notes, learned, feed_forward)
    what = Table(table, n) if table else n
    return press_and_report(common.bench(rig, simulation), what, out, run, view, live, json)


def replay(
    recording: Path,
    /,
    rig: common.RigName = "paper",
    *,
    n: Annotated[int, Parameter(name=["-n", "--number"])] = 1,
    out: common.OutFolder,
    notes: str = "",
    view: bool = False,
    live: bool = False,
    simulation: common.Simulation = common.Simulation(),
    json: common.Json = False,
) -> int:
    """Press again what was pressed in a recording, n times, and record it.

    The motion is the planned one of the recording, with its learned correction; of a recording
    without a plan, such as an imported one, it is the measured one.

    Parameters
    ----------
    recording
        Recording of the press.
    n
        Number of presses.
    out
        Folder for the recordings; nothing in it is overwritten.
    notes
        Operator's notes, saved in every recording.
    view
        Show arm, acquisition, force and speed in the terminal during the session.
    live
        Serve them to Foxglove on this machine.
    """
    from sautereau.entrance.pressing import Replay

    bench, what = common.bench(rig, simulation), Replay(recording, n)
    return press_and_report(bench, what, out, _Options(notes=notes), view, live, json)


@dataclass(frozen=True)
class _Options:
    """Options of `Bench.press`."""

    warm_up: int = 0
    rest: str = "0 s"
    notes: str = ""
    learned: Path | None = None
    feed_forward: Path | None = None


def press_and_report(
    bench: "Bench", what: Any, out: Path, run: _Options, view: bool, live: bool, as_json: bool
) -> int:
    """Run a session, and print every press of it and its analysis."""
    from sautereau.commands.session import SessionReport
    from sautereau.entrance.pressing import Pressing

    pressing = Pressing(bench, what, out, **vars(run))
    common.warn(not as_json, *pressing.planner.warnings)
    report = SessionReport(pressing, bench.where, as_json, view=view, live=live)
    with common.signals_stop():
        with pausing(bench.control):
            pressing.run(report)
        report.end()
    return 0


@contextmanager
def pausing(control: "Control") -> Iterator[None]:
    r"""Pause after the present press on Ctrl-\, on Windows on Ctrl-Break; continue on the next."""

    def toggle(_number: int, _frame: object) -> None:
        if control.paused:
            control.resume()
        else:
            control.pause()
            sys.stderr.write("pausing after this press; the same key continues, Ctrl-C ends\n")

    with common.on_signals(("SIGQUIT", "SIGBREAK"), toggle):
        yield

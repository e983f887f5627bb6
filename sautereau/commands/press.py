"""Press the key."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from sautereau.commands import common

if TYPE_CHECKING:
    from sautereau.entrance.pressing import Pressing
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
    from sautereau.entrance.pressing import Pressing, Table

    pressing = Pressing(
        common.bench(rig, simulation),
        Table(table, n) if table else n,
        out,
        warm_up=warm_up,
        rest=rest,
        notes=notes,
        learned=learned,
        feed_forward=feed_forward,
    )
    return _run(pressing, json, view=view, live=live)


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
    from sautereau.entrance.pressing import Pressing, Replay

    bench = common.bench(rig, simulation)
    pressing = Pressing(bench, Replay(recording, n), out, notes=notes)
    return _run(pressing, json, view=view, live=live)


def _run(pressing: "Pressing", as_json: bool, *, view: bool, live: bool) -> int:
    """Run a session, and print every press of it and its analysis."""
    from sautereau.commands.session import SessionReport

    common.warn(not as_json, *pressing.planner.warnings)
    report = SessionReport(pressing, as_json, view=view, live=live)
    with common.signals_stop():
        with _pausing(pressing.bench.control):
            pressing.run(report)
        report.end()
    return 0


@contextmanager
def _pausing(control: "Control") -> Iterator[None]:
    r"""Pause after the present press on Ctrl-\, on Windows on Ctrl-Break; continue on the next."""

    def toggle(_number: int, _frame: object) -> None:
        if control.paused:
            control.resume()
        else:
            control.pause()
            sys.stderr.write("pausing after this press; the same key continues, Ctrl-C ends\n")

    with common.on_signals(("SIGQUIT", "SIGBREAK"), toggle):
        yield

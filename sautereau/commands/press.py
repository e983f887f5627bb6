"""Press the key."""

import sys
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from sautereau.commands import common
from sautereau.commands.live.watching import watching

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sautereau.rig.schema import Rig
    from sautereau.robot.controller import TorqueTable
    from sautereau.robot.experiment.plan import Place
    from sautereau.robot.experiment.plan_table import Row
    from sautereau.robot.experiment.session_folder import SessionFolder
    from sautereau.trajectory.press import Trajectory


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
    """Press the key n times, record each press, and compare them with the model.

    To continue an interrupted session, run the same command again.

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
    from sautereau.commands.session import SessionReport
    from sautereau.rig.units import parse_quantity
    from sautereau.robot.experiment.folder_lock import only_session
    from sautereau.robot.experiment.plan import Plan, digest, plan_rows
    from sautereau.robot.experiment.plan_table import Row, read_plan_table
    from sautereau.robot.experiment.session_folder import SessionFolder
    from sautereau.sim_backend.scene import current_scene

    nominal = common.rig_to_move(rig, simulation)
    rows = read_plan_table(table, nominal, n, notes) if table else (Row(nominal, n, notes=notes),)
    followed = {"learned": learned, "feed_forward": feed_forward}
    files = {name: digest(path) for name, path in followed.items() if path}
    plan = Plan(
        nominal,
        rows,
        warm_up,
        parse_quantity(rest, "s"),
        simulation.load().model_dump_json() if simulation.requested else "",
        files,
    )
    warnings: list[str] = []
    trajectories = plan_rows(
        rows, lambda bench: _planned(bench, learned, files.get("feed_forward", ""), warnings)
    )
    common.warn(not json, *warnings)
    tables = _torques(rows, trajectories, feed_forward)
    waiting: dict[str, Any] = {}
    with common.signals_stop(), only_session(out):
        fresh = common.fresh_seed() if simulation.requested else None
        folder = SessionFolder(out, plan, simulation.seed, fresh, current_scene)
        report = SessionReport(folder, warnings, json)
        report.begin()
        for places in plan.set_ups:
            left = [place for place in places if place.number not in folder.done]
            if not left:
                continue
            waiting = _instrument_to_set(folder, rows[places[0].row], simulated=bool(plan.scene))
            if waiting:
                break
            planned = list(zip(trajectories, tables, strict=True))
            _press(folder, left, planned, simulation, report, view=view, live=live)
        report.end(waiting)
    return 0


def _planned(
    rig: "Rig", learned: Path | None, feed_forward: str, warnings: list[str]
) -> "Trajectory":
    """Plan the press of one rig, and append what is doubtful about it to the warnings."""
    from sautereau.robot.experiment.learning import read_learned
    from sautereau.trajectory.press import plan_press

    expected, doubts = common.expected_of(rig)
    correction = read_learned(learned, rig, feed_forward) if learned else None
    trajectory = plan_press(rig, expected, correction)
    warnings += [*doubts, *trajectory.warnings]
    return trajectory


def _torques(
    rows: "Sequence[Row]", trajectories: "list[Trajectory]", feed_forward: Path | None
) -> "list[TorqueTable | None]":
    """Return the feed-forward torques of each row."""
    if feed_forward is None:
        return [None for _ in rows]
    from sautereau.robot.experiment.feedforward import force_of, torque_table

    measured = force_of(feed_forward)
    return [
        torque_table(row.rig, trajectory, measured)
        for row, trajectory in zip(rows, trajectories, strict=True)
    ]


def _press(
    folder: "SessionFolder",
    places: "list[Place]",
    planned: "list[tuple[Trajectory, TorqueTable | None]]",
    simulation: common.Simulation,
    report: Any,
    *,
    view: bool,
    live: bool,
) -> None:
    """Run the presses of one set-up of the instrument."""
    from sautereau.robot.drivers.registry import motion_controller
    from sautereau.robot.experiment.session import Item, Origin, make_presses

    plan = folder.plan
    seed = _seed_from(folder.seed, places[0].number)
    nominal = plan.rows[places[0].row].rig
    with (
        common.hardware(nominal, replace(simulation, seed=seed)) as bench,
        nullcontext(lambda: None) if view else common.bar(len(places)) as step,
        watching(
            f"rig {nominal.name} on {bench.where}", in_terminal=view, to_foxglove=live
        ) as watch,
    ):
        report.on(bench)
        rigs = {row: plan.rows[row].on(bench.rig) for row in {place.row for place in places}}

        def items():
            for place in places:
                trajectory, torques = planned[place.row]
                yield Item(
                    rigs[place.row],
                    trajectory,
                    place.number,
                    warm_up=place.warm_up,
                    notes=plan.rows[place.row].notes,
                    torques=torques,
                )

        def done(item: Item, path: Path) -> None:
            bench.keep_truth(path)
            if item.number is not None:
                report.pressed(item.number, path)
            step()

        make_presses(
            motion_controller(bench.rig),
            folder.path,
            items(),
            Origin(folder.session, bench.scene, bench.seed),
            rest=plan.rest,
            on_ready=folder.start,
            on_press=done,
            watch=watch,
        )


def _instrument_to_set(folder: "SessionFolder", row: "Row", simulated: bool) -> dict[str, Any]:
    """Ask the operator to set the instrument; without a terminal, return what must be set."""
    from sautereau.robot.experiment.plan import to_set

    if simulated or dict(folder.set_up) == row.set_up:
        return {}
    changes = to_set(folder.plan.rig, folder.set_up, row)
    text = ", ".join(f"{key} = {value}" for key, value in changes.items())
    if sys.stdin.isatty() and sys.stderr.isatty():
        sys.stderr.write(f"Set the instrument: {text}. Continue with Enter, stop with Ctrl-C. ")
        sys.stderr.flush()
        if sys.stdin.readline():
            folder.note_set_up(row.set_up)
            return {}
    folder.note_set_up(row.set_up)
    return changes


def _seed_from(seed: int | None, number: int) -> int | None:
    """Return the seed of a stand-in that starts with this press: each has its own noise."""
    if seed is None or number == 1:
        return seed
    import numpy as np

    return int(np.random.SeedSequence([seed, number]).generate_state(1)[0])

"""A session of presses: from what was requested to the recordings."""

import math
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from sautereau.entrance.devices import Connected, Devices, fresh_seed
from sautereau.entrance.press_file import PressFile
from sautereau.entrance.session import Session
from sautereau.rig import schema
from sautereau.rig.disk import write_durably
from sautereau.rig.faults import fault_list
from sautereau.rig.units import parse_quantity
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.design import RECORD, Design, read_design, record
from sautereau.robot.experiment.health import Health
from sautereau.robot.experiment.monitor import Seen, Watch
from sautereau.robot.experiment.plan import Plan, Row, read_plan_table
from sautereau.robot.experiment.planner import Planner, rows_of_recording
from sautereau.robot.experiment.run import Crew, Place, PlanRun
from sautereau.robot.experiment.session_folder import (
    Manifest,
    SessionFolder,
    only_session,
    read_manifest,
)
from sautereau.robot.experiment.steps import (
    OPERATOR,
    STAND_IN,
    Answer,
    Ask,
    Given,
    answers_of,
    of_rows,
    plan_of,
)
from sautereau.sim_backend.scene import current_scene


@dataclass(frozen=True)
class Table:
    """A plan table."""

    path: Path
    repeats: int = 1
    """Presses of a row without a number."""


@dataclass(frozen=True)
class Replay:
    """A recorded press to repeat."""

    recording: Path
    repeats: int = 1


@dataclass(frozen=True)
class Settings:
    """How a session presses; see `sautereau.entrance.bench.Bench.press`."""

    warm_up: int = Plan.warm_up
    rest: str | float = 0.0
    notes: str = ""
    learned: str | Path | None = None
    feed_forward: str | Path | None = None
    ignore_health: bool = False
    """Whether to continue if a recording shows that the instrument is at fault."""
    answers: Given | None = None
    """Answers to all questions of the plan; None to ask the operator."""


class Observer:
    """Observes a session while it runs; each method may be replaced."""

    def begin(self, folder: SessionFolder) -> None:
        """Take the folder before the first press."""

    def on(self, bench: Connected) -> None:
        """Take the bench of the next presses."""

    def pressed(self, place: Place, path: Path) -> None:
        """Take a press and its recording."""

    def answered(self, answer: Answer) -> None:
        """Take an answer that the operator has not given."""

    def watching(self) -> AbstractContextManager[Watch]:
        """Return what gets the events of the presses on one bench."""
        return nullcontext(lambda seen: None)


class Pressing:
    """One session, new or continued; see `sautereau.entrance.bench.Bench.press`."""

    def __init__(self, bench: Devices, what: Any, out: str | Path, settings: Settings = Settings()):
        self._out, self.bench = Path(out), bench
        nominal = bench.rig.values
        rows = rows_of(what, nominal, settings.notes, self._out)
        files = settings.learned, settings.feed_forward
        self.planner = Planner(*(Path(path) if path else None for path in files))
        self._steps = plan_of(what) if rows is None else of_rows(rows)
        self.plan = Plan(
            nominal,
            rows,
            settings.warm_up,
            _rest(settings.rest),
            bench.scene_text,
            self.planner.files,
        )
        self.planner.plan_all(rows or ())
        self._ignore_health = settings.ignore_health
        self._answers = None if settings.answers is None else answers_of(settings.answers)
        self.open = cache(PressFile)  # a recording is analysed once
        self.folder: SessionFolder
        self.result: PlanRun

    def run(self, observer: Observer) -> None:
        """Make the presses that are not yet in the folder."""
        fresh = None if self.bench.scene is None else fresh_seed()
        with only_session(self._out, self.bench.real):
            seed = self.bench.seed
            self.folder = SessionFolder(self._out, self._continued, seed, fresh, current_scene)
            bench = self.bench
            observer.begin(self.folder)
            watches: list[Watch] = []

            @contextmanager
            def on(rig: schema.Rig, seed: int | None) -> Iterator[Connected]:
                with bench.connected(rig, seed) as found:
                    observer.on(found)
                    with observer.watching() as watch:
                        watches[:] = [watch]
                        yield found

            def pressed(place: Place, path: Path) -> None:
                self._keep_record()
                observer.pressed(place, path)

            def watch(seen: Seen) -> None:
                watches[0](seen)

            def answer(question: Ask, noted: Answer | None) -> Answer | None:
                found = self._answer(question, noted)
                if found and found.by != OPERATOR and found is not noted:
                    observer.answered(found)
                return found

            crew = Crew(
                self.planner, on, bench.ask, answer, pressed, self._examine, self.open, watch
            )
            self.result = PlanRun(self.folder, self._steps, crew, bench.control)
            self.result.run()
            self._keep_record()

    def _keep_record(self) -> None:
        """Write the presses of a design beside the recordings, with those that are made."""
        rows = self.plan.rows or ()
        if rows and rows[0].levels:
            done = {number: path.name for number, path in self.folder.done.items()}
            write_durably(self._out / RECORD, record(rows, done), replace=True)

    @property
    def session(self) -> Session:
        """The recordings in the order of the plan, without the warm-up presses."""
        return Session(self._presses, self.warnings, self._out)

    @property
    def _presses(self) -> list[PressFile]:
        done = self.folder.done
        return [self.open(done[number]) for number in sorted(done)]

    @property
    def warnings(self) -> list[str]:
        """What is doubtful about the plans, and what the presses show about instrument and
        correction; `result.halted` has the fault that has halted the session."""
        fault = self.result.fault if not self.result.halted else ""
        stale = self.planner.stale(press.partial for press in self._presses)
        set_up = dict.fromkeys(key for row in self.plan.rows or () for key in row.set_up)
        overridden = self.bench.scene.overridden(set_up) if self.bench.scene else ()
        without_effect = ", ".join(overridden) and (
            f"{', '.join(overridden)}: the scene has its own value, so those of the presses have no"
            " effect on the stand-in"
        )
        return [*self.planner.warnings, *filter(None, (without_effect, fault, stale))]

    def _continued(self, started: Manifest | None) -> Plan:
        """Return the plan with the engine of a session that was started."""
        self.bench = self.bench.continuing(started)
        self.plan = replace(self.plan, scene=self.bench.scene_text)
        return self.plan

    def _examine(self, path: Path, first: Path | None) -> Health:
        if self._ignore_health:
            return Health()
        return self.open(path).health(first and self.open(first))

    def _answer(self, question: Ask, noted: Answer | None) -> Answer | None:
        """Return the answer to a question; None where nobody answers it."""
        if self._answers is not None:
            given = self._answers.take(question.text)
            return noted if noted and noted.answer == given.answer else given
        if noted is not None:
            return noted
        answer, by = self.bench.ask(question.text), OPERATOR
        if answer is None and self.bench.scene is not None:
            answer, by = question.stand_in, STAND_IN
        return None if answer is None else Answer(question.text, answer, by)

    @property
    def faults(self) -> list[str]:
        """Why the session has halted, or the answers that it has not used."""
        run, answers = self.result, self._answers
        if run.halted:
            return [run.halted]
        if answers is None or run.to_set or run.unanswered or not answers.unused:
            return []
        return [fault_list(answers.origin, answers.unused)]

    def check_ended(self) -> None:
        """Refuse a session that needs an operator, or an instrument put right.

        Raises:
            RobotError: The plan has not ended, or not used all answers.
        """
        if self.faults:
            raise RobotError("\n".join(f"session {self._out}: {text}" for text in self.faults))
        needed = ", ".join(f"{key} = {value}" for key, value in self.result.to_set.items())
        if needed or self.result.unanswered:
            what = f"set {needed} on the instrument" if needed else self.result.unanswered
            raise RobotError(
                f"session {self._out}: it needs an operator: {what}; then run the same command"
                " or plan again to continue"
            )


def _rest(value: str | float) -> float:
    """Return the time between presses [s]."""
    try:
        rest = parse_quantity(value, "s") if isinstance(value, str) else float(value)
    except (TypeError, ValueError) as error:
        raise RobotError(f'rest: {error}; give a text such as "2 s", or seconds') from error
    if not 0 <= rest < math.inf:
        raise RobotError(f"rest: {value!r} is no time between presses; give 0 s or more")
    return rest


def rows_of(what: Any, rig: schema.Rig, notes: str, out: Path) -> tuple[Row, ...] | None:
    """Return the rows of what was requested; None for a plan that is a program.

    Args:
        out: Folder of the session; a design continues the one in it.
    """
    if isinstance(what, int):
        return (Row(rig, what, notes=notes),)
    if isinstance(what, str | Path):
        path = Path(what)
        what = read_design(path) if path.suffix == ".toml" else Table(path)
    if isinstance(what, Design):
        started = read_manifest(out)
        return what.rows(rig, started.plan.get("presses", ()) if started else (), notes)
    if isinstance(what, Table):
        return read_plan_table(what.path, rig, what.repeats, notes)
    if isinstance(what, Replay):
        return rows_of_recording(what.recording, rig, what.repeats, notes)
    return None

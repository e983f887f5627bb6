"""Run a plan: make the presses that it requests and that are not yet in the session's folder."""

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any

from sautereau.rig.document import named_values
from sautereau.rig.load import with_values
from sautereau.rig.schema import Rig
from sautereau.robot.controller import TorqueTable, motion_controller
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.health import Health
from sautereau.robot.experiment.monitor import Control, Watch
from sautereau.robot.experiment.plan import MOST_PRESSES, Row, instrument_of, to_set
from sautereau.robot.experiment.session import Item, Origin, make_presses, with_warm_ups
from sautereau.robot.experiment.session_folder import SessionFolder
from sautereau.robot.experiment.steps import OPERATOR, Answer, Ask, Plan, Step
from sautereau.trajectory.press import Trajectory

Planned = tuple[Trajectory, TorqueTable | None]


@dataclass(frozen=True)
class Bench:
    """The bench of some presses, real or simulated."""

    rig: Rig
    """The rig, with the addresses in use."""
    scene: str = ""
    """The stand-in's scene as text; empty on the hardware."""
    seed: int | None = None
    """Seed of the stand-in's random numbers."""

    def keep_truth(self, recording: Path) -> None:
        """Write the true events beside a recording, if they are known."""


@dataclass(frozen=True)
class Place:
    """One press of a plan."""

    number: int
    """From 1; of a warm-up press, that of the press it is made for."""
    row: Row
    warm_up: bool = False


@dataclass(frozen=True)
class Crew:
    """Functions that a plan needs to make its presses, and observers."""

    planned: Callable[[Row], Planned]
    """Returns trajectory and feed-forward torques of a row's presses."""
    bench: Callable[[Rig, int | None], AbstractContextManager[Bench]]
    """Starts the bench of a rig, with a seed."""
    operator: Callable[[str], str | None] = lambda text: None
    """Asks the operator, and returns the answer; None if there is nobody to ask."""
    answer: Callable[[Ask, Answer | None], Answer | None] = lambda question, noted: noted
    """Returns the answer to a plan's question, which may have been noted before; None if there is
    nobody to ask."""
    on_press: Callable[[Place, Path], Any] = lambda place, path: None
    """Called with each press and its recording."""
    examine: Callable[[Path, Path | None], Health] = lambda path, first: Health()
    """Judges a recording, beside the first one with the same plan and instrument."""
    opened: Callable[[Path], Any] = lambda path: path
    """Returns what the plan is sent for a recording."""
    watch: Watch = lambda seen: None
    goes_on: Callable[[], bool] = lambda: True
    """Returns whether the presses that are requested and not yet made are still needed."""


class PlanRun:
    """One run of a plan in a session's folder."""

    def __init__(self, folder: SessionFolder, plan: Plan, crew: Crew, control: Control):
        self._folder, self._plan, self._crew, self._control = folder, plan, crew, control
        self._numbers, self._requests = count(1), count()
        self._places: deque[Place] = deque()
        self._made: list[Any] = []
        self._answer: Any = None
        self._question: Ask | None = None
        self.to_set: dict[str, Any] = {}
        """What the operator must set before the session continues; empty for nothing."""
        self.unanswered = ""
        """Question that the operator must answer before the session continues."""
        self.fault = ""
        """What is wrong with the instrument after the last press; empty for nothing."""
        self.halted = ""
        """The same and how to continue, if presses are left."""
        self._first: list[tuple[Rig, Path]] = []

    def run(self) -> None:
        """Run the plan to its end, or until it needs an operator who is not there.

        Raises:
            SautereauError: Of any kind; the arm has been stopped and switched off.
        """
        while (place := self._next()) is not None:
            if self.fault:
                self.halted = f"{self.fault}; then run the same command or plan again to continue"
                return
            self._control.wait()
            if isinstance(place, Ask):
                answer = self._crew.answer(place, None)
                if answer is None:
                    self.unanswered = place.text
                    return
                self._answered(answer)
            elif not self._instrument_set(place.row):
                return
            else:
                self._press(place)

    def _next(self) -> Place | Ask | None:
        """Return the next press that is not yet made, or question; None at the end of the plan."""
        while self._question is None:
            while self._places and self._crew.goes_on():
                recording = self._folder.done.get(self._places[0].number)
                if recording is None:
                    return self._places[0]
                self._done(recording)
            self._places.clear()
            try:
                request = self._plan.send(self._answer)
            except StopIteration:
                return None
            self._answer = None
            self._index = next(self._requests)
            if isinstance(request, Ask):
                self._question = request
                row = self._folder.row(self._index) or {}
                if "answer" in row:
                    noted = Answer(request.text, row["answer"], row.get("by", OPERATOR))
                    self._answered(self._crew.answer(request, noted) or noted, noted)
            else:
                self._take(request)
        return self._question

    def _take(self, request: Step | Row) -> None:
        """Number the presses of a request."""
        folder, row = self._folder, request
        if isinstance(row, Step):
            values = named_values(row.values, {})
            row = Row(with_values(folder.plan.rig, values), row.repeats, values, row.notes)
            if not 0 < row.repeats <= MOST_PRESSES:
                raise RobotError(f"session: {row.repeats} presses; request 1 to {MOST_PRESSES}")
        folder.plan.check(row)
        folder.note_row(self._index, row.document())
        self._places = deque(Place(next(self._numbers), row) for _ in range(row.repeats))
        self._answer = self._made = []

    def _done(self, recording: Path) -> None:
        """Take the recording of the first place."""
        row = self._places[0].row
        if self._first_with(row) is None:
            self._first.append((row.rig, recording))
        self._places.popleft()
        self._made.append(self._crew.opened(recording))

    def _first_with(self, row: Row) -> Path | None:
        """Return the first valid recording with the plan and instrument of a row."""
        return next((path for rig, path in self._first if rig == row.rig), None)

    def _answered(self, answer: Answer, noted: Answer | None = None) -> None:
        if answer is not noted:
            row = {"values": {}, "repeats": 0, "notes": answer.question, "answer": answer.answer}
            self._folder.note_row(self._index, row | {"by": answer.by})
        self._answer, self._question = answer.answer, None

    def _instrument_set(self, row: Row) -> bool:
        """Return whether the instrument is set for a row; the operator is asked if it is not."""
        folder = self._folder
        if folder.plan.scene or dict(folder.set_up) == row.set_up:
            return True
        changes = to_set(folder.plan.rig, folder.set_up, row)
        text = ", ".join(f"{key} = {value}" for key, value in changes.items())
        by_hand = ", ".join(f"{f} = {level}" for f, level in row.levels.items())
        where = f"Block {row.block} ({by_hand}). " if row.block else ""
        answer = self._crew.operator(f"{where}Set the instrument: {text}.")
        folder.note_set_up(row.set_up)
        if answer is None:
            self.to_set = changes
        return answer is not None

    def _press(self, first: Place) -> None:
        """Make presses until the instrument changes, the operator is needed, or it pauses."""
        folder, crew = self._folder, self._crew
        current: list[Place] = []
        instrument = instrument_of(first.row.rig)

        def items(bench: Bench) -> Iterator[Item]:
            while not self.fault and isinstance(place := self._next(), Place):
                another = instrument_of(place.row.rig) != instrument
                if another or (current and self._control.paused):
                    return
                row, (trajectory, torques) = place.row, crew.planned(place.row)
                rig, notes = row.on(bench.rig), row.notes
                current[:] = [place]
                yield Item(
                    rig, trajectory, place.number, False, notes, torques, row.levels, row.block
                )

        def done(item: Item, path: Path) -> None:
            if item.warm_up:
                folder.warm_ups.append(path)
            bench.keep_truth(path)
            crew.on_press(replace(current[0], warm_up=item.warm_up), path)
            health = crew.examine(path, self._first_with(current[0].row))
            self.fault = health.reason and f"{path.name}: {health.reason}"
            if item.warm_up:
                return
            if health.valid:
                folder.done[current[0].number] = path
                self._done(path)
            else:
                folder.note_invalid(path)

        seed = seed_from(folder.seed, first.number)
        with (
            crew.bench(first.row.rig, seed) as bench,
            self._control.over(motion_controller(bench.rig)) as controller,
        ):
            make_presses(
                controller,
                folder.path,
                with_warm_ups(
                    items(bench),
                    folder.plan.warm_up,
                    lambda: not (self.fault or self._control.paused),
                ),
                Origin(folder.session, bench.scene, bench.seed),
                rest=folder.plan.rest,
                on_ready=folder.start,
                on_press=done,
                watch=self._control.watched(crew.watch),
            )


def seed_from(seed: int | None, number: int) -> int | None:
    """Return the seed of a stand-in that starts with this press: each has its own noise."""
    if seed is None or number == 1:
        return seed
    import numpy as np

    return int(np.random.SeedSequence([seed, number]).generate_state(1)[0])

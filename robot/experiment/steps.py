"""Plans as programs: generators that request presses, and get the recordings back.

    def plan():
        yield from press(2)
        for speed in ("0.05 m/s", "0.1 m/s"):
            made = yield from press(3, jack_speed=speed)

A plan must request the same again when it runs again with the same recordings and answers: an
interrupted session continues by running its plan from the start, and takes the presses from the
folder that are made already. Answers to its questions, and to those of the set-up, may be given in
advance.
"""

from collections import Counter
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sautereau.rig.faults import fault_list
from sautereau.rig.layers import read_toml_file
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.plan import Row


@dataclass(frozen=True)
class Step:
    """A request for equal presses."""

    repeats: int = 1
    values: Mapping[str, Any] = field(default_factory=dict)
    """Values that differ from the session's rig, as `Rig.with_values` takes them."""
    notes: str = ""


@dataclass(frozen=True)
class Ask:
    """A request to the operator."""

    text: str
    stand_in: str = ""
    """Answer of the stand-in."""


Plan = Generator[Step | Row | Ask, Any, Any]
"""A plan; it is sent the list of recordings for a `Step` or `Row`, and a text for an `Ask`."""


def press(
    n: int = 1, values: Mapping[str, Any] | None = None, /, *, notes: str = "", **named: Any
) -> Plan:
    """Press n times; return the recordings.

    Args:
        n: Number of presses.
        values: Values that differ from the session's rig, by dotted key.
        notes: The operator's, for these recordings.
        named: Values by the last part of their key: `jack_speed="0.1 m/s"`.
    """
    return (yield Step(n, {**(values or {}), **named}, notes))


def scan(name: str, over: Iterable[Any], n: int = 1, /, *, notes: str = "", **named: Any) -> Plan:
    """Press n times at each value of one quantity; return the recordings of each value.

    Args:
        name: Key of the rig's value, dotted or its last part.
        over: Texts with units, or numbers in SI units.
        n: Number of presses at each.
        notes: The operator's.
        named: Further values, the same at all.
    """
    made = []
    for value in over:
        made.append((yield Step(n, {**named, name: value}, notes)))
    return made


def repeat_until(
    enough: Callable[[Sequence[Any]], bool],
    /,
    most: int,
    *,
    least: int = 1,
    notes: str = "",
    **named: Any,
) -> Plan:
    """Press until a criterion holds; return the recordings.

    Args:
        enough: Gets all recordings so far, and returns whether they suffice.
        most: Number of presses after which it always ends.
        least: Number of presses before the criterion is asked.
        notes: The operator's.
        named: Values that differ from the session's rig.
    """
    made: list[Any] = []
    while len(made) < most and (len(made) < least or not enough(made)):
        made += yield Step(1, named, notes)
    return made


def ask(text: str, /, *, stand_in: str = "") -> Plan:
    """Ask the operator with the motors off; return the answer, which is saved with the session.

    Args:
        text: The question. `answers` of the session may answer it in advance.
        stand_in: Answer of the stand-in, where there is no terminal to ask at.
    """
    return (yield Ask(text, stand_in))


def of_rows(rows: Iterable[Row]) -> Plan:
    """Return the plan of a table: its rows in order."""
    for row in rows:  # noqa: UP028 (an iterator has no `send`)
        yield row


def plan_of(what: "Plan | Callable[[], Plan]") -> Plan:
    """Return a plan, given as a generator or as the function that returns it.

    Raises:
        RobotError: It is neither.
    """
    plan = what() if callable(what) else what
    if not isinstance(plan, Generator):
        raise RobotError(
            f"session: {what!r} is no plan; give a number of presses, a plan table, or a function"
            " with `yield from press(...)`"
        )
    return plan


Given = Mapping[str, str | Sequence[str]] | str | Path
"""Answers by question, or the TOML file of them."""
OPERATOR = "the operator"
STAND_IN = "the stand-in"


@dataclass(frozen=True)
class Answer:
    """An answer to a question."""

    question: str
    answer: str
    by: str
    """Who gave it: the operator, the stand-in, or the file or mapping of answers."""

    def __str__(self) -> str:
        return f"{self.question} {self.answer or '(nothing)'} (by {self.by})"


class Answers:
    """Answers by question: a question is named by its text, or by the beginning of it.

    The longest name that fits a question counts. One text answers a question each time it is
    asked, several answer it in their order.

    Args:
        given: Texts by question.
        origin: Their file, for messages.

    Raises:
        RobotError: Lists every answer that is not a text, and every question without a name.
    """

    def __init__(self, given: Mapping[str, str | Sequence[str]], origin: str = "answers"):
        self._given, self.origin = given, origin
        self._asked: Counter[str] = Counter()
        faults = [] if all(given) else ["a question without a text; write its beginning"]
        for question, answers in given.items():
            texts = [answers] if isinstance(answers, str) else answers
            if not (
                isinstance(texts, Sequence) and texts and all(isinstance(t, str) for t in texts)
            ):
                faults.append(f"{question!r}: {answers!r} is refused: give a text, or several")
        if faults:
            raise RobotError(fault_list(origin, faults))

    def take(self, question: str, *choices: str) -> Answer:
        """Return the next answer to a question.

        Args:
            choices: The answers that are possible; none for any.

        Raises:
            RobotError: There is none, and the message lists the answers that no question has used;
                or it is not possible.
        """
        fitting = [name for name in self._given if question.startswith(name)]
        name = max(fitting, key=len, default="")
        answers, number = self._given.get(name, ()), self._asked[name]
        if isinstance(answers, str):
            answers, number = [answers], 0
        self._asked[name] += 1
        if number == len(answers):
            fault = f"no answer to {question!r}, asked as question {number + 1} of {name!r}; add it"
            if not fitting:
                fault = f"no answer to {question!r}; add it"
            raise RobotError(fault_list(self.origin, [fault, *self.unused]))
        if choices and answers[number] not in choices:
            raise RobotError(
                f"{self.origin}: {answers[number]!r} is no answer to {question!r}; give"
                f" {' or '.join(choices)}"
            )
        return Answer(question, answers[number], self.origin)

    @property
    def unused(self) -> list[str]:
        """Lists the answers that no question has used so far."""
        found = []
        for name, answers in self._given.items():
            given, asked = 1 if isinstance(answers, str) else len(answers), self._asked[name]
            if not asked:
                found.append(f"{name!r}: no such question was asked; correct or remove it")
            elif asked < given:
                found.append(f"{name!r}: {given} answers, and asked {asked} times; remove the rest")
        return found


def answers_of(given: Given) -> Answers:
    """Return answers given as a mapping, or as a TOML file of texts by question.

    Raises:
        RobotError: The file cannot be read; or as of `Answers`.
    """
    if isinstance(given, Mapping):
        return Answers(given)
    origin = f"answers {given}"
    return Answers(read_toml_file(Path(given), origin, RobotError)[1], origin)

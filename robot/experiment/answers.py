"""Answers to the questions of a session or of the set-up that are given in advance."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from sautereau.rig.disk import read_text, why_unreadable
from sautereau.rig.faults import fault_list
from sautereau.rig.layers import read_toml
from sautereau.robot.errors import RobotError

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
    try:
        text = read_text(Path(given))
    except (OSError, UnicodeDecodeError) as error:
        raise RobotError(f"{origin}: cannot be read: {why_unreadable(error)}") from error
    return Answers(read_toml(text, origin, RobotError), origin)

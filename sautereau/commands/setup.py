"""A new rig file, the checks of this machine, and the set-up of a bench, step by step."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict
from datetime import date
from difflib import get_close_matches
from math import degrees
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from cyclopts import Parameter, Token
from cyclopts.validators import Number as Range

from sautereau.analysis.text import wrapped
from sautereau.commands import common
from sautereau.commands.output import FileOutput, Output, has
from sautereau.rig.errors import UsageError
from sautereau.robot.errors import RobotError

if TYPE_CHECKING:
    from sautereau.rig.edit import Edit, TomlValue
    from sautereau.robot.experiment.setup.step import Found
    from sautereau.robot.experiment.steps import Answer, Answers

_TIMEOUT = "60 s"
"""Timeout of the stand-in's controller, which answers only after the motion has ended."""

UNKNOWN = "unknown"  # Answer to a question about a value that is not measured


Weight = Annotated[
    float, "QUANTITY", common.in_unit("kg", "50 g"), Parameter(validator=Range(gt=0))
]

StepName = Literal[
    "all", "port", "controller", "verify", "home", "encoders", "force", "contact", "touch", "tap",
    "loops", "dry-run",
]  # fmt: skip


def _no_step(text: str) -> str:
    """Return what is wrong with a name that is no step."""
    names = get_args(StepName)
    near = "".join(f"did you mean {name!r}? or " for name in get_close_matches(text, names, 1))
    fix = near or f"give the rig first, `sautereau setup {text} STEP`; the step is "
    return f"{text!r} is no step; {fix}{'give ' * bool(near)}one of {', '.join(names)}"


def _rig_and_step(rig: str, step: str) -> tuple[str, Any]:
    """Return rig and step, where a step alone is that of the packaged rig.

    Raises:
        UsageError: What is given alone resembles a step, and is none.
    """
    if step != "all" or Path(rig).suffix or Path(rig).is_file():
        return rig, step
    if rig in get_args(StepName):
        return "paper", rig
    if get_close_matches(rig, get_args(StepName), 1):
        raise UsageError(_no_step(rig))
    return rig, step


def _step(_: object, tokens: Sequence[Token]) -> str:
    if (text := tokens[0].value) in get_args(StepName):
        return text
    raise ValueError(_no_step(text))


def init(
    file: Path = Path("my-rig.toml"),
    /,
    *,
    instrument: bool = False,
    bench: bool = False,
    base: str = "",
    output: FileOutput = FileOutput(),
) -> int:
    """Write a new rig file that explains every key: its meaning, unit and limits.

    Parameters
    ----------
    file
        New file.
    instrument
        Only key, jack, plectrum and string: one key of an instrument. All else is that of --base,
        and the numbers to start from are its key's, or the paper's where it has none.
    bench
        Only press, arm, controller and acquisition, to be the base of instrument files.
    base
        Rig of which an instrument file has all else: a packaged one, or a rig or bench file, seen
        from the folder of the new file. Default: paper.
    """
    from sautereau.rig.disk import write_durably
    from sautereau.rig.load import parse_rig
    from sautereau.rig.text import commented_rig

    if bench and instrument:
        return output.fail("--bench and --instrument exclude each other; write two files", 2)
    if base and not instrument:
        return output.fail("--base: only an instrument file has one; add --instrument", 2)
    named = f"./{file}" if str(file).startswith("-") else str(file)  # not to read as an option
    check = f"check it with: sautereau plan {quote(named)}"
    numbers = "the packaged rig `paper`"
    if instrument:
        text = commented_rig("instrument", file.stem, base or "paper", file.parent)
        parse_rig(text, str(file), file.parent)
        numbers = f"{base}, and those that it lacks of {numbers}" if base else numbers
    elif bench:
        text = commented_rig("bench")
        check = f"use it with: sautereau init KEY.toml --instrument --base {quote(file.name)}"
    else:
        text = commented_rig()
    if not has(file, text):
        with output.creating(file):
            write_durably(file, text)
    return output.answer(
        {"path": str(file)},
        [f"rig file: {file}, with the numbers of {numbers}", check],
    )


def doctor(rig: common.RigName = "paper", *, output: Output = Output()) -> int:
    """Show what is installed, connected and missing, and how to fix it."""
    from sautereau.doctor import examine

    found = examine(common.load_rig(rig), Path())
    lines = []
    for finding in found:
        verdict = "ok" if finding.ok else "MISSING"
        lines.append(f"{verdict:<7}  {finding.name}: {finding.detail}")
        if not finding.ok:
            lines.append(f"         fix: {finding.how_to_fix}")
    return output.answer({"checks": [asdict(finding) for finding in found]}, lines)


def setup(
    rig: common.RigName = "paper",
    step: Annotated[StepName, Parameter(converter=_step)] = "all",
    *,
    yes: bool = False,
    answers: Annotated[Path | None, common.read_as("a TOML file of answers", ".toml")] = None,
    save: bool = False,
    recording: list[Path] | None = None,
    weight: Weight | None = None,
    pressing: Annotated[bool, common.RARE] = False,
    simulation: common.Simulation = common.Simulation(),
    output: Output = Output(),
) -> int:
    """Set up the bench: find the controller, home, check, touch the key, dry run.

    Every step asks before anything moves. If its results differ from the rig file, it shows the
    difference and, if you agree, writes it into the file.

    Parameters
    ----------
    step
        Run only this step. Default: all, in this order.
    yes
        Confirm all motions in advance, for supervised scripts. Manual measurements are skipped. On
        the stand-in this is the default without a terminal.
    answers
        TOML file that answers all questions: "QUESTION" = "ANSWER", where the beginning of a
        question is enough, and a list of answers is used in its order. Answers are "yes" or "no",
        "done" or "skip", and a value with its unit or "unknown".
    save
        Write the results into the rig file without asking.
    recording
        Use this recording instead of a motion: with the step `tap` of taps on the key, repeated for
        several; with the step `force` of a weight that is taken off the transducer; with the step
        `loops` of presses, which show how far the position loops yield.
    weight
        With the step `force`: mass of the weight, such as "50 g"; asked for without it.
    pressing
        With the step `force`: the weight lies on the transducer. Default: it hangs from it.
    """
    from sautereau.rig.faults import fault_list
    from sautereau.rig.load import with_values
    from sautereau.robot.experiment.setup.steps import make_steps
    from sautereau.robot.experiment.steps import STAND_IN, answers_of

    rig, step = _rig_and_step(rig, step)
    simulated, typed = simulation.requested, sys.stdin.isatty()
    if yes and answers:
        return output.fail("--yes and --answers exclude each other; give one of them", 2)
    if not (yes or answers or recording or typed or simulated or step == "loops"):
        return output.fail(
            "setup asks before motions: run it on a terminal, or give --yes or --answers", 2
        )
    if save and not Path(rig).is_file():
        return output.fail(f"--save: {rig} is not a file; write one with `sautereau init`", 2)
    mass = -weight if weight is not None and pressing else weight
    if (weight is not None or pressing) and step not in ("all", "force"):
        return output.fail(f"--weight, --pressing: they belong to the step force, not {step}", 2)
    agreed_by = "--yes" if yes else STAND_IN if simulated and not typed else ""
    given = answers_of(answers) if answers else None
    operator = _Operator(given, agreed_by, output.say, mass)
    results = _Results(rig, output, operator, simulated=simulated)
    if recording or step == "loops":
        results.add(step, _of_recordings(step, recording or [], mass))
        return results.close(save, yes)
    served = common.bench(rig, simulation)
    if (yes or answers) and not simulated and step in ("all", "verify"):
        option = "--yes" if yes else "--answers"
        return output.fail(f"setup verify needs an operator: give it without {option}", 2)
    nominal = served.rig.values
    if simulated:
        nominal = with_values(nominal, {"controller.timeout": _TIMEOUT})
    with served.connected(nominal) as bench:
        for name, found in make_steps(bench.rig, operator, None if step == "all" else step):
            results.add(name, found)
    faults = [fault_list(given.origin, given.unused)] if given and given.unused else []
    return results.close(save, bool(given or agreed_by), faults)


def _of_recordings(step: str, recordings: list[Path], mass: float | None) -> "Found":
    """Return what a step finds in recordings.

    Raises:
        UsageError: The step reads none, or others.
    """
    if step == "tap":
        from sautereau.robot.experiment.setup.tap import modes_of_recordings

        return modes_of_recordings(recordings)
    if step == "loops":
        if not recordings:
            raise UsageError(
                "setup loops: nothing moves, it reads presses; give one or more by --recording"
            )
        from sautereau.robot.experiment.setup.loops import loops_of_recordings

        return loops_of_recordings(recordings)
    if step == "force" and mass is not None and len(recordings) == 1:
        from sautereau.robot.experiment.setup.force import force_of_recording

        return force_of_recording(recordings[0], mass)
    raise UsageError(
        "--recording: only the steps tap, loops, and force with one recording and --weight read"
        " recordings"
    )


class _Results:
    """What the steps found, for the rig file and the answer.

    Args:
        rig: Path of the rig file, or name of a packaged rig.
        output: Of the command.
        operator: Of the steps.
        simulated: Whether the stand-in was set up.
    """

    def __init__(self, rig: str, output: Output, operator: "_Operator", *, simulated: bool):
        self._rig, self._output, self._operator = rig, output, operator
        self._simulated = simulated
        self._steps: dict[str, Any] = {}
        self._values: dict[str, TomlValue] = {}

    def add(self, name: str, found: "Found") -> None:
        """Print and keep the results of a step; a stand-in's port is not kept for the rig file."""
        for line in found.lines:
            self._output.say(line)
        self._output.warn(*(f"{name}: {warning}" for warning in found.warnings))
        self._steps[name] = asdict(found)
        self._values |= {
            key: value
            for key, value in found.values.items()
            if not (self._simulated and key.startswith("controller."))
        }

    def close(self, save: bool, agreed: bool, faults: Sequence[str] = ()) -> int:
        """Write the values into the rig file if the operator agrees, and answer."""
        from sautereau.rig.edit import edit_rig

        source = f"sautereau setup, {date.today().isoformat()}"
        is_file = bool(self._values) and Path(self._rig).is_file()
        edit = edit_rig(self._rig, self._values, source) if is_file else None
        saved = edit is not None and self._save(edit, save, agreed)
        result = {
            "steps": self._steps,
            "values": self._values,
            "difference": edit.difference if edit else "",
            "saved": saved,
            "simulated": self._simulated,
            "answers": [asdict(answer) for answer in self._operator.answered],
        }
        return self._output.answer(result, [self._closing(saved)], faults=faults)

    def _save(self, edit: "Edit", save: bool, agreed: bool) -> bool:
        """Show the difference, and write it if the operator agrees."""
        if not edit.difference:
            return False
        self._output.say(edit.difference, as_it_is=True)
        if not save and (agreed or _asked(f"Write this into {edit.path}? [y/N]").lower() != "y"):
            return False
        edit.save()
        return True

    def _closing(self, saved: bool) -> str:
        if not self._values:
            return "there is nothing to write into a rig file"
        if saved:
            return f"written into {self._rig}"
        found = ", ".join(f"{key} = {value}" for key, value in self._values.items())
        return f"not written: {found}; --save writes it into a rig file of your own"


class _Operator:
    """Answers the questions of the steps; see `sautereau.robot.experiment.setup.step.Ask`.

    Args:
        answers: Given in advance; None to ask the person at the terminal.
        agreed_by: Who has agreed to all motions in advance; empty for nobody.
        say: Prints an answer that was not typed.
        weight: kg, of a weight on the fingertip, negative if it presses; None to ask for it.
    """

    def __init__(
        self,
        answers: "Answers | None",
        agreed_by: str,
        say: Callable[[str], None],
        weight: float | None,
    ):
        self._answers, self._agreed_by, self._say = answers, agreed_by, say
        self._weight = weight
        self.answered: list[Answer] = []
        """Every answer that was not typed."""

    def confirm(self, question: str) -> bool:
        """Return whether the answer is yes; see `Ask`."""
        known = self._known(question, "yes", "yes", "no")
        return (known or _asked(f"{question} [y/N]").lower()) in ("y", "yes")

    def act(self, instruction: str) -> bool:
        """Wait until it is done; see `Ask`."""
        known = self._known(instruction, "skip", "done", "skip")
        if known is None:
            _asked(f"{instruction} Press Enter when it is done.")
        return known != "skip"

    def number(self, question: str, unit: str, expected: float) -> float | None:
        """Return the measured value; see `Ask`."""
        if unit == "kg" and self._weight is not None:
            return self._weight
        from sautereau.rig.units import format_quantity, parse_quantity

        known, shown = self._known(question, UNKNOWN), _readable(expected, unit)
        if known == UNKNOWN:
            return None
        asked = f"{question} Expected: {shown}; press Enter if unknown:"
        while text := _asked(asked) if known is None else known:
            try:
                return parse_quantity(text, unit)
            except ValueError as error:
                example = format_quantity(expected, unit)
                said = f"{error}; write it like {shown} or {example}"
                if known:
                    raise RobotError(
                        f"setup: {text!r} is no answer to {question!r}: {said}, or {UNKNOWN!r}"
                    ) from error
                sys.stderr.write(wrapped(said) + "\n")
        return None

    def _known(self, question: str, agreed: str, *choices: str) -> str | None:
        """Return the answer that was given in advance; None where the person is to be asked.

        Args:
            agreed: The answer where all motions were agreed to in advance.
            choices: The answers that are possible; none for any.
        """
        from sautereau.robot.experiment.steps import Answer

        if self._answers is not None:
            found = self._answers.take(question, *choices)
        elif self._agreed_by:
            found = Answer(question, agreed, self._agreed_by)
        else:
            return None
        self.answered.append(found)
        self._say(str(found))
        return found.answer


def _readable(value: float, unit: str) -> str:
    if unit == "rad":
        return f"{degrees(value):.3g} deg"
    return f"{value * 1e3:.4g} mm" if unit == "m" else f"{value:.4g} {unit}"


def _asked(question: str) -> str:
    """Return a line of the terminal; empty at the end of input."""
    sys.stderr.write(f"{wrapped(question)} ")
    sys.stderr.flush()
    return sys.stdin.readline().strip()

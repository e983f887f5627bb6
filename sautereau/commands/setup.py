"""A new rig file, the checks of this machine, and the set-up of a bench, step by step."""

import sys
from collections.abc import Sequence
from dataclasses import asdict
from datetime import date
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter, Token
from cyclopts.validators import Number as Range

from sautereau.analysis.text import wrapped
from sautereau.commands import common
from sautereau.commands.output import FileOutput, Output

if TYPE_CHECKING:
    from sautereau.rig.edit import Edit, TomlValue
    from sautereau.robot.experiment.setup.step import Found

_TIMEOUT = "60 s"
"""Timeout of the stand-in's controller, which answers only after the motion has ended."""


def _mass(_: object, tokens: Sequence[Token]) -> float:
    from sautereau.rig.units import parse_quantity

    try:
        return parse_quantity(tokens[0].value, "kg")
    except ValueError as error:
        raise ValueError(f'{error}; write it like "50 g"') from error


Weight = Annotated[float, "QUANTITY", Parameter(converter=_mass, validator=Range(gt=0))]

StepName = Literal[
    "all", "port", "controller", "verify", "home", "encoders", "force", "contact", "touch", "tap",
    "dry-run",
]  # fmt: skip


def init(
    file: common.OutFile = Path("my-rig.toml"), /, *, output: FileOutput = FileOutput()
) -> int:
    """Write a new rig file that explains every key: its meaning, unit and limits.

    Parameters
    ----------
    file
        New file.
    """
    from sautereau.rig.disk import write_durably
    from sautereau.rig.text import commented_rig

    write_durably(file, commented_rig())
    return output.answer(
        {"path": str(file)},
        [
            f"rig file: {file}, with the numbers of the packaged rig `paper`",
            f"check it with: sautereau plan {file}",
        ],
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
    step: StepName = "all",
    rig: common.RigName = "paper",
    *,
    yes: bool = False,
    save: bool = False,
    recording: list[Path] | None = None,
    weight: Weight | None = None,
    pressing: bool = False,
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
        Confirm all motions in advance, for the stand-in and for supervised scripts. Manual
        measurements are skipped.
    save
        Write the results into the rig file without asking.
    recording
        Use this recording instead of a motion: with the step `tap` of taps on the key, repeated for
        several; with the step `force` of a weight that is taken off the transducer.
    weight
        With the step `force`: mass of the weight, such as "50 g"; asked for without it.
    pressing
        With the step `force`: the weight lies on the transducer. Default: it hangs from it.
    """
    from sautereau.rig.load import with_values
    from sautereau.robot.experiment.setup.steps import make_steps

    if not yes and not recording and not sys.stdin.isatty():
        return output.fail("setup asks before motions: run it on a terminal, or give --yes", 2)
    if save and not Path(rig).is_file():
        return output.fail(f"--save: {rig} is not a file; write one with `sautereau init`", 2)
    results = _Results(rig, output, simulated=simulation.requested)
    mass = -weight if weight is not None and pressing else weight
    if (weight is not None or pressing) and step not in ("all", "force"):
        return output.fail(f"--weight, --pressing: they belong to the step force, not {step}", 2)
    if recording:
        if step == "tap":
            from sautereau.robot.experiment.setup.tap import modes_of_recordings

            results.add(step, modes_of_recordings(recording))
        elif step == "force" and mass is not None and len(recording) == 1:
            from sautereau.robot.experiment.setup.force import force_of_recording

            results.add(step, force_of_recording(recording[0], mass))
        else:
            known = "tap, and force with one recording and --weight"
            return output.fail(f"--recording: only the steps {known} read recordings", 2)
        return results.close(save, yes)
    served = common.bench(rig, simulation)
    if yes and not simulation.requested and step in ("all", "verify"):
        return output.fail("setup verify needs an operator: give it without --yes", 2)
    nominal = served.rig.values
    if simulation.requested:
        nominal = with_values(nominal, {"controller.timeout": _TIMEOUT})
    with served.connected(nominal) as bench:
        operator = _Operator(yes, mass)
        for name, found in make_steps(bench.rig, operator, None if step == "all" else step):
            results.add(name, found)
    return results.close(save, yes)


class _Results:
    """What the steps found, for the rig file and the answer.

    Args:
        rig: Path of the rig file, or name of a packaged rig.
        output: Of the command.
        simulated: Whether the stand-in was set up.
    """

    def __init__(self, rig: str, output: Output, *, simulated: bool):
        self._rig, self._output, self._simulated = rig, output, simulated
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

    def close(self, save: bool, agreed: bool) -> int:
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
        }
        return self._output.answer(result, [self._closing(saved)])

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
    """Asks the person at the terminal.

    Args:
        agreed: Whether every motion was agreed to in advance; then nothing is asked.
        weight: kg, of a weight on the fingertip, negative if it presses; None to ask for it.
    """

    def __init__(self, agreed: bool, weight: float | None = None):
        self._agreed, self._weight = agreed, weight

    def confirm(self, question: str) -> bool:
        """Return whether the answer is yes; see `Ask`."""
        return self._agreed or _asked(f"{question} [y/N]").lower() in ("y", "yes")

    def act(self, instruction: str) -> bool:
        """Wait until it is done; see `Ask`."""
        if self._agreed:
            return False
        _asked(f"{instruction} Press Enter when it is done.")
        return True

    def number(self, question: str, unit: str, expected: float) -> float | None:
        """Return the measured value; see `Ask`."""
        if unit == "kg" and self._weight is not None:
            return self._weight
        if self._agreed:
            return None
        from sautereau.rig.units import format_quantity, parse_quantity

        shown = _readable(expected, unit)
        while text := _asked(f"{question} Expected: {shown}; press Enter if unknown:"):
            try:
                return parse_quantity(text, unit)
            except ValueError as error:
                example = format_quantity(expected, unit)
                sys.stderr.write(wrapped(f"{error}; write it like {shown} or {example}") + "\n")
        return None


def _readable(value: float, unit: str) -> str:
    if unit == "rad":
        return f"{degrees(value):.3g} deg"
    return f"{value * 1e3:.4g} mm" if unit == "m" else f"{value:.4g} {unit}"


def _asked(question: str) -> str:
    """Return a line of the terminal; empty at the end of input."""
    sys.stderr.write(f"{wrapped(question)} ")
    sys.stderr.flush()
    return sys.stdin.readline().strip()

"""Set a bench up, step by step."""

import sys
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from sautereau.commands.common import (
    Flag,
    Json,
    RigName,
    Simulation,
    answer,
    fail,
    hardware,
    load_rig,
    say,
    signals_stop,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from sautereau.rig.edit import Edit
    from sautereau.rig.schema import Rig

_PATIENCE = "60 s"
"""Timeout of the stand-in's controller, which answers only when nothing moves any more."""

StepName = Literal["all", "port", "controller", "home", "encoders", "contact", "touch", "dry-run"]


def setup(
    step: StepName = "all",
    rig: RigName = "paper",
    *,
    yes: Annotated[bool, Flag] = False,
    save: Annotated[bool, Flag] = False,
    simulation: Simulation = Simulation(),
    json: Json = False,
) -> int:
    """Set the bench up: find the controller, home, check, touch the key, play in the air.

    Every step asks before anything moves, and tells what it found. What differs from the rig
    file is shown, and written into it if you agree.

    Parameters
    ----------
    step
        Step to make alone. Default: all, in this order.
    yes
        Agree to every motion beforehand; for the stand-in and for scripts that are watched.
        What a person would measure is not measured then.
    save
        Write what was found into the rig file without asking.
    """
    from sautereau.robot.experiment.setup.steps import make_steps

    nominal = load_rig(rig)
    if not yes and not sys.stdin.isatty():
        return fail("setup: nobody can be asked; run it on a terminal, or give --yes", status=2)
    if save and not Path(rig).is_file():
        return fail(f"--save: {rig} is no file of your own; copy the rig file first", status=2)
    values: dict[str, str | int] = {}
    steps: dict[str, Any] = {}
    with signals_stop(), _bench(nominal, simulation) as (wired, simulated):
        for name, found in make_steps(wired, _Person(yes), None if step == "all" else step):
            for line in found.lines:
                say(not json, line)
            for warning in found.warnings:
                sys.stderr.write(f"warning: {name}: {warning}\n")
            values |= _of_bench(found.values, simulated)
            steps[name] = {
                "lines": list(found.lines),
                "values": dict(found.values),
                "figures": dict(found.figures),
                "warnings": list(found.warnings),
            }
    edit = _edit(rig, values) if values and Path(rig).is_file() else None
    saved = edit is not None and _save(edit, save, yes, told=not json)
    result = {
        "steps": steps,
        "values": values,
        "difference": edit.difference if edit else "",
        "saved": saved,
        "simulated": simulated,
    }
    answer(json, result, _closing(rig, values, saved))
    return 0


@contextmanager
def _bench(nominal: "Rig", simulation: Simulation) -> "Iterator[tuple[Rig, bool]]":
    """Yield the rig to set up, and whether it is the stand-in's."""
    from sautereau.rig.load import with_values

    if simulation.wanted:
        nominal = with_values(nominal, {"controller.timeout": _PATIENCE})
    with hardware(nominal, simulation) as bench:
        yield bench.rig, bool(bench.scene)


class _Person:
    """Whoever sits at the terminal.

    Args:
        agreed: Whether everything is agreed to; then nobody is asked.
    """

    def __init__(self, agreed: bool):
        self._agreed = agreed

    def confirm(self, question: str) -> bool:
        """Return whether the answer is yes; see `Ask`."""
        return self._agreed or _asked(f"{question} [y/N] ").lower() in ("y", "yes")

    def number(self, question: str, unit: str, expected: float) -> float | None:
        """Return what was measured; see `Ask`."""
        if self._agreed:
            return None
        from sautereau.rig.units import format_quantity, parse_quantity

        shown = _readable(expected, unit)
        while text := _asked(f"{question} It should be {shown}; Enter if you cannot tell: "):
            try:
                return parse_quantity(text, unit)
            except ValueError as error:
                example = format_quantity(expected, unit)
                sys.stderr.write(f"{error}; write it like {shown} or {example}\n")
        return None


def _of_bench(values: "Mapping[str, str | int]", simulated: bool) -> dict[str, str | int]:
    """Return what is true of the bench itself: the stand-in's port is not."""
    return {k: v for k, v in values.items() if not (simulated and k.startswith("controller."))}


def _readable(value: float, unit: str) -> str:
    from math import degrees

    if unit == "rad":
        return f"{degrees(value):.3g} deg"
    return f"{value * 1e3:.4g} mm" if unit == "m" else f"{value:.4g} {unit}"


def _asked(question: str) -> str:
    """Return a line of the terminal; the end of input is no answer."""
    sys.stderr.write(question)
    sys.stderr.flush()
    return sys.stdin.readline().strip()


def _edit(rig: str, values: dict[str, str | int]) -> "Edit":
    from datetime import date

    from sautereau.rig.edit import edit_rig

    return edit_rig(rig, values, f"sautereau setup, {date.today().isoformat()}")


def _save(edit: "Edit", save: bool, agreed: bool, *, told: bool) -> bool:
    """Show the difference, and write it where that is agreed to."""
    if not edit.difference:
        return False
    say(told, edit.difference)
    if not save and (agreed or _asked(f"Write this into {edit.path}? [y/N] ").lower() != "y"):
        return False
    edit.save()
    return True


def _closing(rig: str, values: dict[str, str | int], saved: bool) -> list[str]:
    if not values:
        return ["the rig holds all this already"]
    if saved:
        return [f"written into {rig}"]
    found = ", ".join(f"{key} = {value}" for key, value in values.items())
    return [f"not written: {found}; --save writes it into a rig file of your own"]

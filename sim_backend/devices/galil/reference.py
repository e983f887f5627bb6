"""The commands as data: arguments and validity, as the manufacturer's reference has them.

The table is `reference.csv`, one command per line:

- form: `values` (one number per axis), `mask` (axis letters), `numbers` (arguments in order),
  `none`, or `text` (a syntax of its own);
- arguments: `name:low..high/resolution=default`, or `name:a,b=default` for single values;
- valid: B burnable, T in the terminal, M while in motion, P in a program;
- heading: of the command's entry in the reference.

`sautereau.rig.capabilities` lists the commands that a model lacks.

Where the reference contradicts itself, its examples are followed: `WT` is used in motion, and `BN`
lists `EO` among the burned parameters. Limits are those of a controller with two axes.
"""

import csv
import functools
from dataclasses import dataclass
from fractions import Fraction
from importlib.resources import files

from sautereau.sim_backend.devices.galil.answers import CommandError

_ABSENT = """
AD AO AP AQ AR AS AU AV BC BD BI BK BX BZ CA CC CD CI CM CR CS DH DR DT DV EA EB EC EG EM EP EQ ES
ET EW EY GA GD GM GR HS IA IH II IK KS LC LE LI LM MB ME MF MR MU MW NB NF NZ OC PL PT QH
QQ QR QS RI SL TN TR UI VA VD VE VM VP VR VS VV YA YB YC YR YS ZA
"""
ABSENT = frozenset(_ABSENT.split())
"""Commands of the reference that are not emulated: all are refused, and begin no variable."""

SMALLEST = 1 / 65536  # Resolution of all numbers
NOT_STORED = (20 / 65536, 1 / 256)
"""Resolutions of outputs, voltages and filters; such a setting reads back as it was sent."""


@dataclass(frozen=True)
class Argument:
    """A number that a command takes."""

    name: str
    low: float
    high: float
    step: float = 0.0
    """Resolution; values are rounded towards zero to a multiple. 0 for none."""
    default: float | None = None
    choices: tuple[float, ...] = ()
    """The only values, if any are listed."""

    def accept(self, value: float, scale: float = 1.0) -> float:
        """Return the value as the controller stores it.

        Args:
            value: As sent.
            scale: Factor of the resolution, for commands that are scaled by TM.

        Raises:
            CommandError: It is out of range.
        """
        if self.choices:
            if value not in self.choices:
                raise CommandError(6)
            return value
        if not self.low - SMALLEST <= value <= self.high + SMALLEST:
            raise CommandError(6)
        step = self.step * scale
        return int(value / step) * step if step and self.step not in NOT_STORED else value

    @property
    def decimals(self) -> int:
        """Digits after the point in answers."""
        if self.choices:
            return 0 if all(value % 1 == 0 for value in self.choices) else 1
        if self.step >= 1:
            return 0
        return 2 if self.step >= 1 / 32 else 4


@dataclass(frozen=True)
class Entry:
    """A command of the reference."""

    code: str
    form: str
    arguments: tuple[Argument, ...]
    valid: str
    heading: str

    @property
    def burnable(self) -> bool:
        """Whether BN stores it."""
        return "B" in self.valid

    @property
    def in_terminal(self) -> bool:
        """Whether the host may send it."""
        return "T" in self.valid

    @property
    def in_motion(self) -> bool:
        """Whether it is valid while an axis that it names moves."""
        return "M" in self.valid or self.code == "WT"

    @property
    def in_program(self) -> bool:
        """Whether a program may contain it."""
        return "P" in self.valid


def _number(text: str) -> float:
    return float(Fraction(text))


def _argument(text: str) -> Argument:
    name, _, rest = text.partition(":")
    limits, _, default = rest.partition("=")
    given = _number(default) if default else None
    if ".." not in limits:
        choices = tuple(map(_number, limits.split(",")))
        return Argument(name, min(choices), max(choices), 0.0, given, choices)
    ends, _, step = limits.partition("/")
    low, high = map(_number, ends.split(".."))
    return Argument(name, low, high, _number(step) if step else 0.0, given)


@functools.cache
def entries() -> dict[str, Entry]:
    """Return the commands of the table by their letters."""
    table = files("sautereau.sim_backend.devices.galil").joinpath("reference.csv")
    text = table.read_text(encoding="utf-8")
    found = {}
    for row in csv.DictReader(text.splitlines(), delimiter="|"):
        arguments = tuple(map(_argument, row["arguments"].split()))
        code, form, valid, heading = (row[name] for name in ("code", "form", "valid", "heading"))
        found[code] = Entry(code, form, arguments, valid, heading)
    return found

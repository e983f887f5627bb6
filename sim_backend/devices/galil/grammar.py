"""The controller's grammar: numbers, expressions, and lists of arguments."""

import operator
import re
from collections.abc import Callable

from sautereau.sim_backend.devices.galil.answers import CommandError
from sautereau.sim_backend.devices.galil.machine import Machine
from sautereau.sim_backend.devices.galil.operands import function, operand, variable

QUERY = "?"
STRING = 6  # Characters in a number

_TOKEN = re.compile(
    r'(?P<string>"[^"]*")|(?P<axis>~[a-h])|'
    r"(?P<number>[0-9]+\.?[0-9]*|\.[0-9]+)|(?P<hex>\$[0-9A-Fa-f]+(?:\.[0-9A-Fa-f]{1,4})?)"
    r"|(?P<operand>_[A-Z]{2}(?:~[a-h]|[A-Z0-9]?[0-9]?))|(?P<label>#[A-Za-z0-9]+)"
    r"|(?P<name>@?[A-Za-z][A-Za-z0-9]*)|(?P<sign>[-+*/%&|()\[\]])",
    re.ASCII,
)
_BLANKS = re.compile(r'("[^"]*")| ')
_OPERATOR = re.compile(r"<=|>=|<>|[-+*/%&|<>=]")
_OPERATIONS: dict[str, Callable[[float, float], float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "%": operator.mod,
    "&": lambda left, right: (int(left * 65536) & int(right * 65536)) / 65536,
    "|": lambda left, right: (int(left * 65536) | int(right * 65536)) / 65536,
    "<": operator.lt,
    ">": operator.gt,
    "=": operator.eq,
    "<>": operator.ne,
    "<=": operator.le,
    ">=": operator.ge,
}
_ASSIGNMENT = re.compile(
    r"(?P<name>~[a-h]|[A-Za-z][A-Za-z0-9]{0,7}) *"
    r"(?:\[(?P<index>[^=]*)\])? *=(?P<value>(?:[^=].*)?)",
    re.ASCII,
)


class _Expression:
    """A text being evaluated from left to right, without precedence of operators.

    A comparison is 1 if it holds, otherwise 0.
    """

    def __init__(self, text: str, machine: Machine) -> None:
        self._text = _BLANKS.sub(r"\1", text) if " " in text else text
        self._machine = machine
        self._at = 0

    def value(self) -> float:
        result = self._sum()
        if self._at < len(self._text):
            raise CommandError(59 if self._text[self._at] in "])" else 83)
        return result

    def _sum(self) -> float:
        result = self._term()
        while sign := _OPERATOR.match(self._text, self._at):
            self._at = sign.end()
            right = self._term()
            if sign[0] in "/%" and right == 0:
                raise CommandError(6)
            result = _bounded(float(_OPERATIONS[sign[0]](result, right)))
        return result

    def _term(self) -> float:
        token = _TOKEN.match(self._text, self._at)
        if token is None or token.lastgroup is None:
            raise CommandError(83)
        self._at = token.end()
        if token.lastgroup == "sign":
            match token[0]:
                case "-":
                    return -self._term()
                case "+":
                    return self._term()
                case "(":
                    return self._closed(")", 59)
                case _:
                    raise CommandError(83)
        if token.lastgroup == "name":
            text = token[0]
            if self._peek() != "[":
                if text.startswith("@"):
                    raise CommandError(55)
                return variable(self._machine, text)
            self._at += 1
            index = self._closed("]", 55)
            if text.startswith("@"):
                return _bounded(function(self._machine, text, index))
            return self._machine.arrays.element(text, index)
        return _OPERANDS[token.lastgroup](self._machine, token[0])

    def _closed(self, bracket: str, code: int) -> float:
        result = self._sum()
        if self._peek() != bracket:
            raise CommandError(code)
        self._at += 1
        return result

    def _peek(self) -> str:
        return self._text[self._at : self._at + 1]


def _bounded(value: float) -> float:
    if not abs(value) <= 2.0**31:  # Numbers are multiples of 1/65536
        raise CommandError(6)
    return int(value * 65536) / 65536


def _packed(text: str) -> float:
    """Return the number that holds the characters of a string, from its highest byte on."""
    if len(text) > STRING:
        raise CommandError(52)
    return int.from_bytes(text.encode("latin-1", "replace").ljust(STRING, b"\0"), "big") / 65536


def _hexadecimal(text: str) -> float:
    whole, _, fraction = text.partition(".")
    value = int(whole, 16)
    if value >= 2**32:
        raise CommandError(6)
    signed = value - 2**32 if value >= 2**31 else value
    return signed + int(fraction.ljust(4, "0") or "0", 16) / 65536


_OPERANDS: dict[str, Callable[[Machine, str], float]] = {
    "string": lambda machine, text: _packed(text[1:-1]),
    "axis": lambda machine, text: variable_axis(machine, text),
    "number": lambda machine, text: _bounded(float(text)),
    "hex": lambda machine, text: _hexadecimal(text[1:]),
    "operand": lambda machine, text: operand(machine, text[1:3] + named_axes(machine, text[3:])),
    "label": lambda machine, text: float(machine.program.line_of(text)),
}
"""Values of the tokens that are complete terms."""


def evaluate(text: str, machine: Machine) -> float:
    """Return the value of an expression.

    Raises:
        CommandError: It is not an expression, or its value is too large for the controller.
    """
    if not text.strip(" "):
        raise CommandError(50)
    return _Expression(text, machine).value()


def parse_assignment(text: str) -> tuple[str, str | None, str] | None:
    """Return name, index (None for a variable) and value of ``x=1`` or ``x[0]=1``, or None."""
    found = _ASSIGNMENT.fullmatch(text)
    return (found["name"], found["index"], found["value"]) if found else None


def variable_axis(machine: Machine, name: str) -> int:
    """Return the number of the axis for which ``~a`` to ``~h`` stands."""
    if name not in machine.variable_axes:
        raise CommandError(9)
    return machine.variable_axes[name]


def named_axes(machine: Machine, text: str) -> str:
    """Return a text with the letters of axes instead of ``~a`` to ``~h``."""
    return re.sub("~[a-h]", lambda found: machine.letters[variable_axis(machine, found[0])], text)


def parse_axes(args: str, machine: Machine) -> list[int]:
    """Return the axes that letters name, 0 for A; no letter means all axes."""
    letters = args.replace(" ", "").replace("X", "A").replace("Y", "B")
    if letters in ("", "*"):
        return list(range(len(machine.letters)))
    if any(letter not in machine.letters for letter in letters):
        raise CommandError(90)
    return sorted({machine.letters.index(letter) for letter in letters})


def parse_list(args: str, machine: Machine) -> dict[int, float | None]:
    """Return the values of ``1,2``, ``,2``, ``A=1`` or ``*=1`` by axis; None for ``?``.

    Raises:
        CommandError: An axis or a value is invalid, or there is none.
    """
    named = re.match(r" *((?:[A-Z*]|~[a-h])+) *=", args)
    if named:
        axes = parse_axes(named_axes(machine, named[1]), machine)
        texts = [args[named.end() :]] * len(axes)
    else:
        texts = split_arguments(args)
        axes = list(range(len(texts)))
        if len(axes) > len(machine.letters):
            raise CommandError(90)
        if not any(texts):
            raise CommandError(50)
    values: dict[int, float | None] = {}
    for axis, text in zip(axes, texts, strict=True):
        if text.strip(" ") == QUERY:
            values[axis] = None
        elif text or named:
            values[axis] = evaluate(text, machine)
    return values


def split_arguments(args: str) -> list[str]:
    """Split at the commas outside strings and brackets; blanks around an argument are dropped."""
    parts, depth, quoted = [""], 0, False
    for character in args:
        quoted ^= character == '"'
        depth += 0 if quoted else (character in "[(") - (character in "])")
        if character == "," and depth <= 0 and not quoted:
            parts.append("")
        else:
            parts[-1] += character
    if quoted:
        raise CommandError(52)
    return [part.strip(" ") for part in parts]

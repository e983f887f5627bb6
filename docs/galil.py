"""What the code says on docs/galil.md: where each command is used, the program, the verification.

`python -m docs.galil` rewrites these parts; the rest of the page is written by hand. A test checks
that they are up to date, and that everything in the code is explained there.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from sautereau.robot.drivers.galil import axes
from sautereau.robot.drivers.galil.dmc import controller_program
from sautereau.robot.experiment.setup import steps, verify

PAGE = Path(__file__).with_suffix(".md")
_TEXT = PAGE.read_text(encoding="utf-8")
_DRIVER = Path(axes.__file__).parent
_VERIFY = Path(str(verify.__file__)).parent
_COMMAND = re.compile(r"^\s*(\^R\^V|[A-Z]{2})(?=[ A-Z0-9=,#\\]|$)")
_OPERAND = re.compile(r"_[A-Z]{2}|\bTIME\b")
_ROW = re.compile(r"^\| `([^`]+)` \| (.*) \|[^|]*\|$", re.MULTILINE)
_PROGRAM = re.compile(r"(?<=^```\n).*?(?=^```$)", re.DOTALL | re.MULTILINE)
_STEPS = re.compile(r"(?<=what it measures \|\n\|---\|---\|---\|\n).*", re.DOTALL)

OPERANDS = {name for name, _ in _ROW.findall(_TEXT) if _OPERAND.fullmatch(name)}
COMMANDS = {name for name, _ in _ROW.findall(_TEXT)} - OPERANDS
ROUTINES = set(re.findall(r"^- `(#\w+)`: ", _TEXT, re.MULTILINE))


def sent() -> tuple[dict[str, set[str]], dict[str, set[str]]]:
    """Return the commands and operands in the code, each with the files that use it."""
    commands: dict[str, set[str]] = {}
    operands: dict[str, set[str]] = {}
    texts = [("program", line) for line in controller_program(1)]
    for path in [*_DRIVER.glob("*.py"), *_VERIFY.glob("*.py")]:
        texts += [(path.stem, text) for text in _strings(ast.parse(path.read_text("utf-8")))]
    for file, text in texts:
        for part in text.split(";"):
            found = _COMMAND.match(part.replace("\x12\x16", "^R^V"))
            if found and found[1] in COMMANDS:
                commands.setdefault(found[1], set()).add(file)
        for name in _OPERAND.findall(text):
            operands.setdefault(name, set()).add(file)
    return commands, operands


def _strings(tree: ast.AST) -> Iterator[str]:
    """Yield the string constants of a module, without docstrings."""
    docstrings = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and id(node) not in docstrings:
            yield str(node.value)


def page() -> str:
    """Return the text of the page."""
    commands, operands = sent()
    used = commands | operands

    def row(found: re.Match[str]) -> str:
        return f"| `{found[1]}` | {found[2]} | {', '.join(sorted(used.get(found[1], ())))} |"

    every = (*steps.BEFORE_POWER, *steps.WITH_POWER)
    rows = "".join(f"| {step.number} | {step.name} | {step.what} |\n" for step in every)
    program = "".join(f"{line}\n" for line in controller_program(1))
    text = _PROGRAM.sub(lambda _: program, _ROW.sub(row, _TEXT))
    return _STEPS.sub(lambda _: rows, text)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")

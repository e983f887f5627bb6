"""docs/galil.md: everything that the driver sends to a Galil controller, and what confirms it.

`python -m docs.galil` rewrites the page. The commands and operands are found in the code; a test
checks that each is explained here, and that the committed page is up to date.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from sautereau.robot.drivers.galil import axes
from sautereau.robot.drivers.galil.program import controller_program
from sautereau.robot.experiment.setup.verify import run

PAGE = Path(__file__).with_suffix(".md")
_DRIVER = Path(axes.__file__).parent
_VERIFY = Path(run.__file__).parent
_COMMAND = re.compile(r"^\s*(\^R\^V|[A-Z]{2})(?=[ A-Z0-9=,#\\]|$)")
_OPERAND = re.compile(r"_([A-Z]{2})|\b(TIME)\b")

COMMANDS = {
    "AB": "`AB` ends motion and all programs, `AB 1` motion only; either switches off a motor whose"
    " OE is not 0",
    "AM": "waits until both joints have ended their motion",
    "AT": "waits until a time after `AT 0`; a negative time also sets the next reference; `,1`"
    " counts samples [measured: A8]; even",
    "BG": "begins a move, FE or FI; refused while one runs",
    "BT": "begins the segments of both axes in one sample; refused with the motors off",
    "CB": "clears an output; no effect on a brake's output",
    "CF": "`CF I` sends messages of programs to the port that asks",
    "CN": "polarity of limit and home switches; no selective abort; abort input ends no program",
    "CW": "`CW 1` sets the most significant bit of every character of a program's message",
    "DA": "frees all arrays",
    "DC": "deceleration of ST, multiples of 1024; cannot be set during a move, so it is set before",
    "DL": "receives a program, ended by `\\`; refused while a program runs",
    "DM": "defines arrays",
    "DP": "defines encoder and commanded position; clears a following error",
    "AC": "acceleration, multiples of 1024",
    "BL": "reverse software limit",
    "EN": "ends a program; `EN 1` ends #CMDERR and restores the interrupted wait",
    "EO": "echo; a serial port only",
    "ER": "counts of following error at which OE switches off",
    "FE": "moves until the home input changes: backward from 1, forward from 0, with the speed SP",
    "FI": "moves at JG's speed to the index, returns to it at HV's speed, and sets position 0",
    "FL": "forward software limit",
    "HV": "speed of the return to the index",
    "HX": "ends a program thread",
    "JG": "speed and direction of FI",
    "JP": "jumps if its condition is true",
    "LD": "disables limit switches that do not exist",
    "LS": "lists the program: line number, text, a trailing blank",
    "MG": "returns values, each as ` 1.0000`",
    "MO": "motors off",
    "NO": "does nothing",
    "OA": "switches off if an encoder does not move for OT samples at a torque above OV",
    "OE": "1: off on following error, amplifier error and abort; 3: also on a limit switch. It"
    " switches off its own axis only; the program switches off the other",
    "OF": "volts added to the command of the amplifier",
    "OT": "samples for OA",
    "OV": "volts for OA; not above TL",
    "PA": "target of a move",
    "PR": "distance of a move",
    "PV": "`PVA=p,v,t`: relative counts, counts/s and samples, the last two even; t = 0 ends, t ="
    " -1 clears; 255 segments",
    "QU": "uploads elements of an array, separated by commas and ended by control-Z [measured: A6]",
    "RA": "names the arrays of a record",
    "RC": "records a row every 2^n samples, n from 1 to 8; 0 ends",
    "RD": "names what is recorded; a torque is an integer, 32767 for 10 V [measured: A9]",
    "RE": "ends #POSERR, #LIMSWI, #AMPERR and #TCPERR; `RE 1` restores the interrupted wait",
    "SB": "sets an output when its line runs: up to a sample before BT on the same line",
    "SD": "deceleration at a limit",
    "SH": "motors on, at their present position",
    "SP": "speed, even",
    "ST": "`ST AB` decelerates both axes [in a segment measured: B6]; programs continue",
    "TC": "`TC1` returns code and text of the last error",
    "TK": "0: no torque above TL, not even for a short time",
    "TL": "limit of the command, V; lower if the amplifier requires it",
    "TM": "`TM 1000` makes samples of 976 us",
    "WT": "waits for ms; even",
    "XQ": "starts a program thread",
    "^R^V": "returns model and firmware",
}
OPERANDS = {
    "AB": "abort input, 1 inactive",
    "AG": "gain of the amplifier",
    "BG": "1 in motion",
    "BL": "as set",
    "BN": "serial number",
    "BT": "number of executed segments",
    "BW": "samples of brake delay; if it is not 0, outputs 1 and 2 are brakes",
    "CE": "type of encoder",
    "CN": "as set",
    "DM": "free elements of arrays",
    "EO": "as set",
    "ER": "as set",
    "FL": "as set",
    "HM": "home input: 1 if FE moves backward",
    "KD": "gain of the position loop",
    "KI": "gain of the position loop; OA needs one above 0",
    "KP": "gain of the position loop",
    "LD": "as set",
    "LF": "1 if the forward limit switch allows motion",
    "LR": "1 if the reverse limit switch allows motion",
    "MO": "1 with the motor off",
    "MT": "type of motor",
    "OA": "as set",
    "OE": "as set",
    "OF": "as set",
    "OT": "as set",
    "OV": "as set",
    "PV": "free segments",
    "RC": "1 while it records",
    "RP": "commanded position",
    "SC": "stop code",
    "TC": "code of the last error",
    "TE": "following error",
    "TIME": "samples since the reset",
    "TK": "as set",
    "TL": "as set",
    "TM": "as set",
    "TP": "encoder position",
    "TT": "command to the amplifier, V; as a record, an integer",
    "XQ": "line that a thread executes, -1 for none",
}
ROUTINES = {
    "#CMDERR": "an error in a program line; without this routine all threads would"
    " end, including the watchdog",
    "#POSERR": "a following error above ER, or a lost encoder; also runs if thread 0 does not",
    "#LIMSWI": "a limit switch or software limit in motion",
    "#AMPERR": "an error of a Galil amplifier",
    "#TCPERR": "a message that no Ethernet client acknowledged",
}


def sent() -> tuple[dict[str, set[str]], dict[str, set[str]]]:
    """Return the commands and operands in the code, each with the files that use it."""
    commands: dict[str, set[str]] = {}
    operands: dict[str, set[str]] = {}
    for path in sorted([*_DRIVER.glob("*.py"), *_VERIFY.glob("*.py")]):
        for text in _strings(ast.parse(path.read_text(encoding="utf-8"))):
            for part in text.split(";"):
                found = _COMMAND.match(part.replace("\x12\x16", "^R^V"))
                if found and found[1] in COMMANDS:
                    commands.setdefault(found[1], set()).add(path.stem)
            for name, time in _OPERAND.findall(text):
                operands.setdefault(name or time, set()).add(path.stem)
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
    lines = [
        "# The Galil controller, command by command",
        "",
        "Written by `python -m docs.galil` from the code.",
        "",
        "This page lists the commands that the driver sends, and what it relies on. The source is",
        "the manufacturer's command reference (Galil Command Reference, DMC-4103 edition), under",
        "the heading of the same name. Where a line says *measured*, the named step of",
        "`sautereau setup verify` measures it. See also [safety](safety.md).",
        "",
        "## Commands",
        "",
        "| command | what the driver relies on | used in |",
        "|---|---|---|",
        *_rows(COMMANDS, commands),
        "",
        "## Operands",
        "",
        "| operand | what the driver reads from it | used in |",
        "|---|---|---|",
        *_rows({_shown(name): text for name, text in OPERANDS.items()}, operands),
        "",
        "## The program in the controller",
        "",
        "Thread 0 runs the watchdog, thread 1 the press, thread 2 the torques. Thread 3 switches",
        "the motors off if one joint stops alone. The routines below run in thread 0, and start",
        "with `AB 1;MO AB`.",
        "",
        *(f"- `{name}`: {text}." for name, text in ROUTINES.items()),
        "",
        "```",
        *controller_program(1),
        "```",
        "",
        "## Steps of the verification",
        "",
        "In steps A the amplifiers have no power. In steps B the motors have little torque.",
        "",
        "| step | name | what it measures |",
        "|---|---|---|",
        *(f"| {s.number} | {s.name} | {s.what} |" for s in (*run.BEFORE_POWER, *run.WITH_POWER)),
    ]
    return "\n".join(lines) + "\n"


def _shown(operand: str) -> str:
    return operand if operand == "TIME" else f"_{operand}"


def _rows(known: dict[str, str], used: dict[str, set[str]]) -> Iterator[str]:
    for name, text in sorted(known.items()):
        files = ", ".join(sorted(used.get(name.lstrip("_"), ())))
        yield f"| `{name}` | {text} | {files} |"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")

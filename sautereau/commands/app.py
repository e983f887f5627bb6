"""The command line: every command, and how its errors are reported.

Packages are imported inside the commands that need them, so that `sautereau --help` starts
quickly.
"""

import errno
import os
import re
import signal
import sys
import traceback
from collections.abc import Iterable, Iterator
from contextlib import suppress
from difflib import get_close_matches
from pathlib import Path
from typing import Literal, get_args, get_origin

# No matrix here is large enough for the threads of BLAS, which wait for each other in busy loops
# and slow a loaded machine down. A value set by the user stays.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from cyclopts import (
    App,
    CycloptsError,
    Group,
    MissingArgumentError,
    Parameter,
    UnknownOptionError,
    UnusedCliTokensError,
)
from cyclopts.argument import Argument

from sautereau import __version__
from sautereau.commands import (
    acquire,
    animate,
    campaign,
    fit,
    folder,
    plan,
    press,
    recordings,
    running,
    setup,
    voicing,
)
from sautereau.commands.common import HELP_ALL
from sautereau.commands.output import end_output, fail, printable

UNREAD = 141
"""Exit status where the reader of the output has ended: 128 + SIGPIPE, as a shell reports it."""
TERMINAL = "/dev/tty"  # The one that controls the process, if there is one


def _default_shown(value: object) -> str | None:
    """Return a default as help texts show it; None for a flag and for nothing."""
    if value is None or isinstance(value, bool) or value in ("", (), {}):
        return None
    return f"{value:g}" if type(value) is float else str(value)


app = App(
    name="sautereau",
    version=__version__,
    help="Press a harpsichord key with a robot finger, record it, compare it with a model.",
    help_flags=("--help", "-h", HELP_ALL),
    help_epilogue=f"{HELP_ALL} after a command also shows the options that few need.",
    default_parameter=Parameter(negative=(), show_default=_default_shown),  # no --no-flag
    group_commands=Group("General options", sort_key=100),  # --help and --version
    result_action="return_value",
    suppress_keyboard_interrupt=False,
)
GROUPS = {
    "Bench": (setup.init, plan.mount, setup.setup, setup.doctor, acquire.stand_in),
    "Press": (
        plan.plan,
        press.press,
        press.learn,
        press.replay,
        acquire.acquire,
        folder.watch,
    ),
    "Analyse": (
        fit.phases,
        plan.predict,
        fit.compare,
        fit.identify,
        fit.transient,
        animate.animate,
        animate.listen,
        folder.report,
    ),
    "Files": (
        recordings.info,
        recordings.recover,
        recordings.split,
        recordings.export,
        recordings.import_,
        folder.package,
    ),
    "Study": (
        voicing.outline,
        voicing.voice,
        campaign.effects,
        campaign.survey,
        campaign.campaign,
        campaign.touch,
        acquire.trade,
    ),
}
"""Commands as the help shows them, each group in the order of use."""
for place, (title, commands) in enumerate(GROUPS.items()):
    group = Group(title, sort_key=place)
    for order, command in enumerate(commands):
        app.command(running.run(command), group=group, sort_key=order)
app.register_install_completion_command()


def main() -> None:
    """Run the command line and exit with its status: 0, 1 for an error, 2 for wrong usage.

    Ctrl-C gives 130, and any signal that ends a command 128 and its number, as of other programs;
    so does a pipe whose reader ends (141).
    With `--json` an error, too, is one JSON object, on standard error.
    """
    as_json = "--json" in sys.argv
    _open_closed_streams()
    try:
        _need_folder()
        status = app(print_error=False, exit_on_error=False)
    except CycloptsError as error:
        command = " ".join(["sautereau", *(error.command_chain or ())])
        status = fail(as_json, f"{_usage_fault(error)}\nSee: {command} --help", 2)
    except BrokenPipeError as error:
        status = _unread(error, as_json)
    except SystemExit as error:
        if not isinstance(error.__context__, BrokenPipeError):
            raise
        status = UNREAD  # of the help: rich ends with 1
    except KeyboardInterrupt as error:
        status = _interrupted(error, as_json)
    except Exception as error:
        from sautereau.rig.errors import SautereauError, UsageError

        if isinstance(error.__context__, KeyboardInterrupt) and _follows(error):
            status = _interrupted(error.__context__, as_json)
        elif isinstance(error, SautereauError | OSError | MemoryError):
            error = _first_cause(error)
            status = 2 if isinstance(error, UsageError) else 1
            status = fail(as_json, _with_notes(_text(error), error), status)
        elif as_json:
            status = fail(True, f"bug: {error!r}", traceback=traceback.format_exc())
        else:
            raise
    sys.exit(status)


def _first_cause(error: Exception) -> Exception:
    """Return the error during whose handling an `OSError` was raised, with that one as a note."""
    from sautereau.rig.errors import SautereauError

    first = error.__context__
    implied = error.__cause__ is None and not error.__suppress_context__
    if implied and not isinstance(error, SautereauError) and isinstance(first, SautereauError):
        first.add_note(f"then: {_text(error)}")
        return first
    return error


def _follows(error: Exception) -> bool:
    """Return whether an interrupt causes this error.

    It does while a compiled module is loaded, and if the terminal of a progress bar is closed.
    """
    return isinstance(error, ImportError) or getattr(error, "errno", None) == errno.EIO


def _need_folder() -> None:
    """Refuse to run in a folder that was removed: no relative path means anything there."""
    from sautereau.rig.errors import SautereauError

    try:
        Path.cwd()
    except FileNotFoundError as error:
        raise SautereauError("the working folder was removed; change to another one") from error


def _open_closed_streams() -> None:
    """Give the streams that the caller has closed a file that takes and drops everything."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: PTH123, SIM115


def _interrupted(error: KeyboardInterrupt, as_json: bool) -> int:
    """Report the signal that ended a command, named in the error; without a name Ctrl-C."""
    running.ignore_signals()
    given = str(error)
    number = signal.Signals[given] if given in signal.Signals.__members__ else signal.SIGINT
    with suppress(OSError):  # of a terminal that is closed
        fail(as_json, _with_notes("interrupted", *_interrupts(error)), 128 + number)
    return 128 + number


def _unread(error: BaseException, as_json: bool) -> int:
    """End as the programs do that a pipe without a reader ends: silently, except for the arm."""
    end_output()
    if hasattr(error, "__notes__"):
        message = "stopped because nothing reads the output; run the same command again to continue"
        message = _with_notes(message, error)
        try:
            fail(as_json, message)
        except OSError:  # the same pipe; --log has it, and who is at the terminal reads it
            with suppress(OSError), Path(TERMINAL).open("w", encoding="utf-8") as terminal:
                terminal.write(f"sautereau: {printable(message)}\n")
    return UNREAD


def _text(error: Exception) -> str:
    """Return the message of an error; of the operating system's with the file first."""
    if isinstance(error, OSError) and error.filename and error.strerror:
        return f"{error.filename}: {error.strerror}"
    if isinstance(error, MemoryError):
        split = "a recording of many presses takes less once `sautereau split` has made one of each"
        return f"not enough memory ({error}); {split}"
    return str(error)


def _with_notes(message: str, *errors: BaseException) -> str:
    notes = [note for error in errors for note in getattr(error, "__notes__", [])]
    return "\n".join([message, *dict.fromkeys(notes)])


def _interrupts(last: BaseException) -> Iterator[BaseException]:
    """Yield an interrupt and those before it, the first one first: each may carry notes."""
    if last.__context__ is not None:
        yield from _interrupts(last.__context__)
    yield last


def _usage_fault(error: CycloptsError) -> str:
    if isinstance(error, UnusedCliTokensError):
        unused = error.unused_tokens or []
        return f"Unexpected argument{'s' * (len(unused) > 1)}: {' '.join(unused)}"
    if isinstance(error, UnknownOptionError):
        return "\n".join(_unknown_options(error, [error.token.keyword or error.token.value]))
    argument = error.argument
    if type(error) is not MissingArgumentError or argument is None:
        return str(error)
    faults = _unknown_options(error, error.unused_tokens or ())
    if not any(f"Did you mean {argument.name}?" in fault for fault in faults):
        faults.append(_missing(argument, set(error.root_input_tokens or ())))
    return "\n".join(faults)


def _unknown_options(error: CycloptsError, tokens: Iterable[str]) -> list[str]:
    """Return a message for each option that the command does not have.

    It suggests the most similar one, or else the first whose help has the word.
    """
    command = app[" ".join(error.command_chain or ())]
    arguments = command.assemble_argument_collection(parse_docstring=True)
    named = {name.strip("-"): name for argument in arguments for name in argument.names}
    faults = []
    for token in tokens:
        word = token.strip("-").partition("=")[0]
        if not token.startswith("-") or token.partition("=")[0] in named.values():
            continue
        in_help = re.compile(rf"\b{re.escape(word)}\b", re.IGNORECASE)
        near = [name for name in named if len(name) > 2 and word.startswith(name)]
        meant = [named[name] for name in get_close_matches(word, named, n=1) or near] or [
            argument.names[0]
            for argument in arguments
            if len(word) > 3 and in_help.search(argument.parameter.help or "")
        ]
        faults.append(f"Unknown option: {token}.{f' Did you mean {meant[0]}?' if meant else ''}")
    return faults


def _missing(argument: Argument, given: set[str]) -> str:
    if not argument.name.startswith("-"):
        return f"Missing argument: {argument.name}"
    what = "Missing value of option" if given & set(argument.names) else "Missing option"
    return f"{what}: {argument.name} {_value_name(argument)}"


def _value_name(argument: Argument) -> str:
    """Return the name of an option's value: choices, the name in its annotation, FILE or VALUE."""
    if get_origin(argument.hint) is Literal:
        return "|".join(map(str, get_args(argument.hint)))
    annotation = argument.field_info.annotation
    kinds = (annotation, *get_args(annotation))
    metadata = [text for kind in kinds for text in getattr(kind, "__metadata__", ())]
    default = "FILE" if Path in (argument.hint, *get_args(argument.hint)) else "VALUE"
    return next((text for text in metadata if isinstance(text, str)), default)

"""Messages for wrong usage of the command line."""

from typing import Literal, get_args, get_origin

from cyclopts import CycloptsError, MissingArgumentError, UnusedCliTokensError
from cyclopts.argument import Argument


def usage_message(error: CycloptsError) -> str:
    """Return the message for wrong usage, and which help page to read."""
    command = " ".join(["sautereau", *(error.command_chain or ())])
    return f"{_message(error)}\nSee: {command} --help"


def _message(error: CycloptsError) -> str:
    if isinstance(error, UnusedCliTokensError):
        unused = error.unused_tokens or []
        return f"Unexpected argument{'s' * (len(unused) > 1)}: {' '.join(unused)}"
    argument = error.argument
    if type(error) is not MissingArgumentError or argument is None:
        return str(error)
    if not argument.name.startswith("-"):
        return f"Missing argument: {argument.name}"
    given = set(argument.names) & set(error.root_input_tokens or ())
    what = "Missing value of option" if given else "Missing option"
    mistyped = str(error).partition("Did you mean")
    hint = f". {''.join(mistyped[1:])}" if mistyped[1] else ""
    return f"{what}: {argument.name} {_value_name(argument)}{hint}"


def _value_name(argument: Argument) -> str:
    """Return the name of an option's value: choices, the name in its annotation, or VALUE."""
    if get_origin(argument.hint) is Literal:
        return "|".join(map(str, get_args(argument.hint)))
    metadata = getattr(argument.field_info.annotation, "__metadata__", ())
    return next((text for text in metadata if isinstance(text, str)), "VALUE")

"""The analysis of a session while its recordings arrive."""

from contextlib import suppress
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sautereau.commands import common


def watch(
    folder: Path,
    /,
    *,
    n: Annotated[int | None, Parameter(name=["-n", "--number"])] = None,
    level: common.Level = "elastica",
    json: common.Json = False,
) -> int:
    """Show the presses of a folder and their analysis as recordings arrive, until Ctrl-C.

    Parameters
    ----------
    folder
        Folder to which another process, or another machine, writes recordings.
    n
        End when this number of presses has arrived.
    """
    from sautereau.analysis.summary.press import HEADER, press_line
    from sautereau.entrance.session import watch as watch_folder

    common.say(not json, f"waiting for recordings in {folder}; Ctrl-C ends\n{HEADER}")
    shown, warned, compared = 0, 0, None
    with common.signals_stop(), suppress(KeyboardInterrupt):
        for session in watch_folder(folder):
            for press in session[shown:]:
                common.say(not json, press_line(press.analysed.press, press.phases))
            common.warn(not json, *session.warnings[warned:])
            shown, warned = len(session), len(session.warnings)
            if shown:
                compared = session.compare(level=level)
                common.say(not json, "\n".join(compared.lines(features=False)))
            if n is not None and shown >= n:
                break
    result = compared.document if compared else {"conditions": [], "simulated": False}
    return common.answer(json, result, [f"{shown} presses in {folder}"])

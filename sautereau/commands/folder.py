"""A folder of recordings: its analysis while they arrive, its report, and its archive."""

from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sautereau.analysis.text import SOME_SIMULATED
from sautereau.commands import common
from sautereau.commands.output import FileOutput, Output


def watch(
    folder: common.Folder,
    /,
    *,
    n: common.Number | None = None,
    page: bool = False,
    level: common.RareLevel = "auto",
    output: Output = Output(),
) -> int:
    """Show the presses of a folder and their analysis as recordings arrive, until Ctrl-C.

    Parameters
    ----------
    folder
        Folder to which another process, or another machine, writes recordings.
    n
        End when this number of presses has arrived.
    page
        Serve a page with the report of the newest presses to browsers on this machine; its address
        is printed.
    """
    from sautereau.analysis.results.press import HEADER
    from sautereau.analysis.text import counted
    from sautereau.entrance.session import watch as watch_folder

    sessions = watch_folder(folder)
    output.say(f"waiting for recordings in {folder}; Ctrl-C ends\n{HEADER}")
    shown, warned, compared, view = 0, 0, None, None
    with ExitStack() as stack, suppress(KeyboardInterrupt):
        if page:
            from sautereau.commands.live.page import PageView

            view = stack.enter_context(PageView(f"Folder {folder}", level))
            output.say(view.instruction)
        for session in sessions:
            for press in session[shown:]:
                output.say(press.line)
            output.warn(*session.warnings[warned:])
            shown, warned = len(session), len(session.warnings)
            if view and shown:
                view.made([press.path for press in session], session.warnings, watched=True)
            if shown:
                compared = session.compare(level=level)
                output.say("\n".join(compared.lines(features=False, remarks=False)))
            if n is not None and shown >= n:
                break
    result = compared.document if compared else {"conditions": [], "simulated": False}
    return output.answer(result, [f"{counted(shown, 'press')} in {folder}"])


def report(
    session: common.Folder,
    /,
    *,
    out: common.OutFile | None = None,
    level: common.RareLevel = "auto",
    output: FileOutput = FileOutput(),
) -> int:
    """Write one HTML page about a session, which works offline in any browser.

    Parameters
    ----------
    session
        Folder of recordings, written by `sautereau press --out`. Files fit*.json in it are
        fits, written by `sautereau identify --json`.
    out
        File of the page. Default: report.html in the folder.
    """
    from sautereau.entrance.session import PAGE, open

    with output.replacing(None if out else session / PAGE), output.progress("making the report"):
        made = open(session).report(out, level=level)
    lines = [*([SOME_SIMULATED] * made.simulated), f"report:     {made.path}"]
    lines += [f"omitted:    {path}: {why}" for path, why in made.left_out.items()]
    result = {
        "path": str(made.path),
        "presses": made.presses,
        "simulated": made.simulated,
        "left_out": {str(path): why for path, why in made.left_out.items()},
    }
    return output.answer(result, lines)


def package(
    session: Path,
    /,
    *,
    out: Annotated[common.OutFile | None, common.written_as(".zip")] = None,
    license: str = "",
    author: Annotated[list[str] | None, Parameter(consume_multiple=True)] = None,
    output: FileOutput = FileOutput(),
) -> int:
    """Pack a session as one archive for a repository, described as an RO-Crate.

    The archive has the recordings, a table of their features, the rig, the versions of the
    software and ro-crate-metadata.json. The same session gives the same bytes.

    Parameters
    ----------
    session
        Folder of recordings, written by `sautereau press --out`.
    out
        Archive. Default: the name of the folder with .zip, beside it.
    license
        Address of the licence, such as https://creativecommons.org/licenses/by/4.0/.
    author
        Names of the authors, or addresses of their ORCID.
    """
    from sautereau.entrance.package import package_of
    from sautereau.entrance.session import open

    with output.replacing(None if out else package_of(session)), output.progress("packing"):
        made = open(session).package(out, licence=license, authors=author or (), processes=None)
    lines = [
        *([SOME_SIMULATED] * made.simulated),
        f"package:    {made.path}",
        f"sha256:     {made.sha256}",
        f"{len(made.files)} files, and ro-crate-metadata.json, read back as they were written",
    ]
    warnings = []
    if not license:
        warnings.append("no license: repositories ask for one; give it with --license")
    output.warn(*warnings)
    result = {
        "path": str(made.path),
        "sha256": made.sha256,
        "files": list(made.files),
        "simulated": made.simulated,
        "license": license,
        "warnings": warnings,
        "faults": list(made.left_out),
    }
    return output.answer(result, lines, faults=list(made.left_out))

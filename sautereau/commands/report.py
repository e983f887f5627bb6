"""A session as one HTML page."""

from pathlib import Path

from sautereau.analysis.text import SOME_SIMULATED
from sautereau.commands import common
from sautereau.commands.output import FileOutput


def report(
    session: Path,
    /,
    *,
    out: common.OutFile | None = None,
    level: common.Level = "auto",
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

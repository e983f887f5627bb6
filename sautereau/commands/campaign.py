"""From thousands of recordings to what the finger feels."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sautereau.analysis.summary.text import SOME_SIMULATED
from sautereau.commands.common import Json, Picture, answer, fail, share_bar, signals_stop

SHOWN = 20
"""Faulty recordings that are named in the text; JSON has them all."""


def campaign(
    folder: Path,
    /,
    *,
    out: Path,
    processes: Annotated[int | None, Parameter(help="Default: one for each core.")] = None,
    cluster: Annotated[str | None, Parameter(help="Address of a Dask scheduler.")] = None,
    json: Json = False,
) -> int:
    """Make one table of the features of all recordings in a folder.

    Call it again to go on after an interruption, or when there are more recordings: those that
    the table holds are not read again. A faulty recording is listed and left out.

    Parameters
    ----------
    folder
        Of recordings, and of folders of them.
    out
        Parquet file of the table.
    """
    import os

    from sautereau.analysis.campaign.run import run_campaign

    if processes is not None and cluster is not None:
        return fail("--processes and --cluster: work is done here or there; give one", status=2)
    here = processes if processes is not None else os.cpu_count() or 1
    where = here if cluster is None else cluster
    with signals_stop(), share_bar() as show:
        made = run_campaign(folder, out, where, on_read=lambda done, total: show(done / total))
    found = made.campaign
    presses, faults = len(found.table), found.faults
    result = {
        "table": str(out),
        "presses": presses,
        "simulated": found.simulated,
        "read": made.read,
        "kept": made.kept,
        "dropped": made.dropped,
        "faults": [{"path": f.source.path, "fault": f.text} for f in faults],
    }
    lines = [
        f"{out}: {presses} presses, {len(found.table.column_names)} columns;"
        f" {made.read} recordings read, {made.kept} known before"
        + (f", {made.dropped} gone or changed since" if made.dropped else "")
    ]
    if found.simulated:
        lines.insert(0, SOME_SIMULATED)
    lines += [f"left out: {f.source.path}: {f.text}" for f in faults[:SHOWN]]
    if len(faults) > SHOWN:
        lines.append(f"left out: {len(faults) - SHOWN} more; --json tells them all")
    answer(json, result, lines)
    return 0


def touch(file: Path, /, *, plot: Picture = None, json: Json = False) -> int:
    """Tell how the plectrum's shape shapes the force felt at the key.

    Parameters
    ----------
    file
        Table that `sautereau campaign` has written.
    """
    from sautereau.analysis.campaign.table import read_campaign
    from sautereau.analysis.campaign.touch import find_touch
    from sautereau.analysis.summary.touch import touch_lines, touch_summary

    found = find_touch(read_campaign(file))
    result, lines = touch_summary(found), touch_lines(found)
    if plot:
        from sautereau.analysis.figures.touch import plot_touch

        plot_touch(plot, found)
        result["picture"] = str(plot)
        lines.append(f"picture: {plot}")
    answer(json, result, lines)
    return 0

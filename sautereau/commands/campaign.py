"""Features of thousands of recordings, and the force at the key that they give."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sautereau.analysis.results.result import part_of
from sautereau.analysis.text import SOME_SIMULATED, counted
from sautereau.commands import common
from sautereau.commands.output import FileOutput, Output, make_folders, save_plot

SHOWN = 20  # Faulty recordings that the text lists; JSON lists all


def campaign(
    folder: Path,
    /,
    *,
    out: Annotated[Path, "FILE", common.written_as(".parquet")],
    processes: Annotated[
        common.Count | None,
        Parameter(help="Number of processes. Default: one per core, fewer for few recordings."),
    ] = None,
    cluster: Annotated[str | None, Parameter(help="Address of a Dask scheduler.")] = None,
    output: Output = Output(),
) -> int:
    """Write one table of the features of all recordings in a folder.

    Run it again to continue after an interruption, or to add new recordings. Recordings that are
    in the table are not read again. Faulty recordings are listed and omitted.

    Parameters
    ----------
    folder
        Folder of recordings, including its subfolders.
    out
        Parquet file of the table. If it exists, new recordings are added to it.
    """
    from sautereau.analysis.campaign.run import run_campaign

    if processes is not None and cluster is not None:
        return output.fail("--processes and --cluster exclude each other; give one of them", 2)
    make_folders(out)
    where = processes if cluster is None else cluster
    with output.progress("reading recordings"):
        made = run_campaign(folder, out, where)
    found = made.campaign
    presses, faults = len(found.table), found.faults
    result = {
        "table": out,
        "presses": presses,
        "simulated": found.simulated,
        **part_of(made, "read", "kept", "dropped"),
        "faults": [{"path": f.source.path, "fault": f.text} for f in faults],
    }
    lines = [
        f"{out}: {counted(presses, 'press')}, {len(found.table.column_names)} columns;"
        f" {counted(made.read, 'recording')} read, {made.kept} in the table before"
        + (f", {made.dropped} deleted or changed since" if made.dropped else "")
    ]
    if found.simulated:
        lines.insert(0, SOME_SIMULATED)
    lines += [f"omitted: {f.source.path}: {f.text}" for f in faults[:SHOWN]]
    if len(faults) > SHOWN:
        lines.append(f"omitted: {len(faults) - SHOWN} more; --json lists all")
    return output.answer(result, lines)


def touch(
    file: Path,
    /,
    *,
    labels: Path | None = None,
    plot: common.Picture = None,
    output: FileOutput = FileOutput(),
) -> int:
    """Show how the force at the key depends on the plectrum, and how musicians judge it.

    Parameters
    ----------
    file
        Table written by `sautereau campaign`.
    labels
        CSV of judgements: a column `touch` (soft, medium, hard) and one of path, session,
        plectrum or rig. Default: lines such as "touch: hard" in the notes of the recordings.
    """
    from sautereau.analysis.campaign.judged import find_judged
    from sautereau.analysis.campaign.judgements import with_labels
    from sautereau.analysis.campaign.table import read_campaign
    from sautereau.analysis.campaign.touch import find_touch
    from sautereau.analysis.results.touch import JudgedTouch

    table = read_campaign(file)
    if labels is not None:
        table = with_labels(table, labels)
    found = JudgedTouch(find_touch(table), find_judged(table))
    if plot:
        save_plot(plot, found.plot())
    return output.answer(found.document, found.lines(), plot)

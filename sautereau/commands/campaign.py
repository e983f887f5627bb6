"""Many recordings: their features, the touch that they show, and the keys of an instrument."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from sautereau.analysis.results.result import part_of
from sautereau.analysis.text import SOME_SIMULATED, counted, listed
from sautereau.commands import common
from sautereau.commands.output import FileOutput, Output, has, make_folders
from sautereau.rig.errors import UsageError

Processes = Annotated[
    common.Count | None,
    common.RARE,
    Parameter(help="Number of processes. Default: one per core, fewer for little work."),
]
Cluster = Annotated[str | None, common.RARE, Parameter(help="Address of a Dask scheduler.")]


def _exclusive(processes: int | None, cluster: str | None) -> None:
    if processes is not None and cluster is not None:
        raise UsageError("--processes and --cluster exclude each other; give one of them")


SHOWN = 20  # Faulty recordings that the text lists; JSON lists all


def campaign(
    folder: common.Folder,
    /,
    *,
    out: Annotated[Path, "FILE", common.written_as(".parquet")] = common.Dated(
        "campaign-DATE.parquet"
    ),
    processes: Processes = None,
    cluster: Cluster = None,
    output: Output = Output(),
) -> int:
    """Write one table of the features of all recordings in a folder.

    Run it again with the same --out to continue after an interruption, or to add new recordings.
    Recordings that are in the table are not read again. Faulty recordings are listed and omitted.

    Parameters
    ----------
    folder
        Folder of recordings, including its subfolders.
    out
        Parquet file of the table. If it exists, new recordings are added to it.
    """
    from sautereau.analysis.campaign.run import run_campaign

    _exclusive(processes, cluster)
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
    file: Annotated[Path, common.read_as("a table of `sautereau campaign`", ".parquet")],
    /,
    *,
    labels: Annotated[Path | None, common.read_as("a CSV file", ".csv")] = None,
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
    from sautereau.analysis.campaign.judged import find_judged, with_labels
    from sautereau.analysis.campaign.table import read_campaign
    from sautereau.analysis.campaign.touch import find_touch
    from sautereau.analysis.results.touch import JudgedTouch

    table = read_campaign(file)
    if labels is not None:
        table = with_labels(table, labels)
    return output.show(JudgedTouch(find_touch(table), find_judged(table)), plot)


def effects(
    files: common.Files,
    /,
    *,
    of: Annotated[str, "A,B", Parameter(help="Features of a press, separated by commas.")] = "",
    interaction: bool = False,
    plot: common.Picture = None,
    output: FileOutput = FileOutput(),
) -> int:
    """Estimate the effects of the factors of an experiment: means, differences and intervals.

    The factors are those of the design (press --design) or, without one, the values of the rig in
    which the presses differ. A mixed model separates the presses from their blocks.

    Parameters
    ----------
    interaction
        Estimate the interactions of every two factors as well.
    """
    from sautereau.analysis.results.effects import DEFAULT
    from sautereau.entrance.session import open

    names = listed(of) or DEFAULT
    with output.progress("reading recordings"):
        session, faults = open(files).readable(processes=None)
    return output.show(session.effects(names, interaction=interaction), plot, faults)


_TABLE = common.read_as("a table of keys", ".csv", ".toml")


def _is_table(path: Path) -> bool:
    return path.suffix.lower() == ".csv" or has(path, "[keys", within=True)


def survey(
    first: Annotated[Path, _TABLE, Parameter(name="[RIG] FILE")],
    second: Annotated[Path | None, _TABLE, Parameter(name="FILE", show=False)] = None,
    /,
    *,
    level: common.RareLevel = "auto",
    processes: Processes = None,
    cluster: Cluster = None,
    plot: common.Picture = None,
    output: FileOutput = FileOutput(),
) -> int:
    """Predict every key of an instrument, read its recordings, and show how even the keys are.

    Parameters
    ----------
    first
        Table of the keys (.csv or .toml): their names, and values that differ from the rig. Before
        it the rig of all other values, by path or packaged name. Default: the table's `base`, or
        paper.
    """
    from sautereau.analysis.campaign.workers import worthwhile
    from sautereau.analysis.model.choirs import choirs
    from sautereau.analysis.results.survey import survey
    from sautereau.entrance.found import recordings_of
    from sautereau.entrance.session import WORTH_A_PROCESS
    from sautereau.rig.keys import read_keys

    _exclusive(processes, cluster)
    file, rig = common.rig_first("survey", first, second, _is_table, "a table of keys", output)
    keys = read_keys(file, rig)
    recordings, warnings = {}, []
    for key in keys:
        found = [recordings_of(what, None) for what in key.recordings]
        recordings[key.name] = [path for paths, _ in found for path in paths]
        warnings += [f"{key.name}: {warning}" for _, more in found for warning in more]
    # Maps of elements may be new, and a recording takes 0.1 s; else a process takes longer to start
    heavy = sum(any(c.plectrum.described for c in choirs(key.rig)) for key in keys)
    heavy += sum(map(len, recordings.values()))
    where = cluster or processes or worthwhile(heavy, WORTH_A_PROCESS)
    with output.progress("predicting and reading"):
        made = survey(keys, recordings, level, where)
    return output.show(replace(made, warnings=(*made.warnings, *warnings)), plot)

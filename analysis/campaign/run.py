"""Make a table of a folder of recordings; an earlier run is continued."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

from sautereau.analysis.campaign.row import Fault, Row, Source, read_batch
from sautereau.analysis.campaign.table import SCHEMA, Campaign, empty_campaign, read_campaign
from sautereau.analysis.campaign.workers import Where, computed_by, run_over, worthwhile
from sautereau.analysis.errors import AnalysisError
from sautereau.rig.progress import tracked

BATCH = 8  # Number of recordings that a process reads at a time: about 0.2 s of work
UNWRITTEN = 256  # Presses after which the table is written: a killed run loses no more


@dataclass(frozen=True)
class CampaignRun:
    """The result of a run."""

    campaign: Campaign
    read: int
    """Number of recordings read by this run."""
    kept: int
    """Number of rows of an earlier run whose recordings have not changed."""
    dropped: int
    """Number of rows of an earlier run whose recordings have disappeared or changed."""


def run_campaign(folder: str | Path, out: str | Path, where: Where | None = 1) -> CampaignRun:
    """Make a table of all recordings in a folder and its subfolders.

    A recording that is in the table already is read again only if its size or date has changed or
    other code of sautereau, or another version of numpy or scipy, has written the table. Faulty
    recordings are tried again. The table contains everything that was read, however the run ends;
    only a killed run loses the last few presses.

    Args:
        out: Parquet file to write; an existing table is continued.
        where: Processes or cluster that read the recordings; the table does not depend on it. None:
            as many processes as shorten the run, at most one per core.

    Raises:
        AnalysisError: The folder holds no recordings, or ``out`` is not a campaign's table or has
            another file extension than .parquet.
    """
    folder, out = Path(folder).resolve(), Path(out)
    if out.suffix != ".parquet":
        raise AnalysisError(
            f"campaign {out}: tables are written as Parquet only; use the file extension .parquet"
        )
    found = find_recordings(folder)
    earlier = read_campaign(out) if out.exists() else empty_campaign(out, computed_by())
    if (earlier.made_by, earlier.schema) != (computed_by(), SCHEMA):  # other code has written it
        earlier = empty_campaign(out, computed_by())
    campaign = earlier.only(set(found))
    kept = set(campaign.sources)
    unread = [source for source in found if source not in kept]
    if where is None:
        # A further process, which starts in 1.5 s, is worth 64 recordings.
        where = worthwhile(len(unread), 64)
    batches = [unread[i : i + BATCH] for i in range(0, len(unread), BATCH)]
    rows: list[Row] = []
    faults: list[Fault] = []
    done = 0
    try:
        read = run_over(partial(read_batch, folder), batches, where)
        for _, (number, (more, faulty)) in zip(tracked(batches), read, strict=True):
            rows += more
            faults += faulty
            done += len(batches[number])
            # Or 2 % of the rows, if more, which limits the time of writing.
            if len(rows) >= max(UNWRITTEN, 0.02 * len(campaign.table)):
                # Cleared first: if the writing fails, the last one shall not add them again.
                campaign, rows, faults = campaign.grown(rows, faults), [], []
                campaign.write()
    finally:
        if done or not batches:
            campaign = campaign.grown(rows, faults)
            campaign.write()
    return CampaignRun(campaign, done, len(kept), len(earlier.table) - len(kept))


def find_recordings(folder: Path) -> list[Source]:
    """Return the recordings in a folder and its subfolders, ordered by path.

    Raises:
        AnalysisError: There is no such folder, or it holds none.
    """
    paths = sorted(path for path in folder.rglob("*.mcap") if path.is_file())
    if not paths:
        fault = (
            "the folder holds no recordings (NAME.mcap)"
            if folder.is_dir()
            else "there is no such folder"
        )
        raise AnalysisError(
            f"campaign of {folder}: {fault}; give the folder that `sautereau press --out` or"
            " `sautereau import` has filled"
        )
    stats = [(path.relative_to(folder).as_posix(), path.stat()) for path in paths]
    return [Source(name, stat.st_size, stat.st_mtime_ns) for name, stat in stats]

"""From a folder of recordings to a table, going on where an earlier run was stopped."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from sautereau.analysis.campaign.row import Batch, Fault, Row, Source, read_batch
from sautereau.analysis.campaign.table import Campaign, empty_campaign, read_campaign
from sautereau.analysis.campaign.workers import Where, run_over
from sautereau.analysis.errors import AnalysisError

BATCH = 8
"""Recordings that a process reads before it answers, some 0.2 s of work."""
UNWRITTEN = 256
"""Presses that a run which is killed loses at most, or
`UNWRITTEN_SHARE` of those in the table: so that writing stays a small part of the work."""
UNWRITTEN_SHARE = 0.02


@dataclass(frozen=True)
class CampaignRun:
    """What a run has made of a folder."""

    campaign: Campaign
    read: int
    """Recordings that this run has read."""
    kept: int
    """Rows of an earlier run whose recordings have not changed since."""
    dropped: int
    """Rows of an earlier run whose recordings are gone from the folder, or have changed."""


def run_campaign(
    folder: str | Path,
    out: str | Path,
    where: Where = 1,
    *,
    on_read: Callable[[int, int], None] = lambda done, total: None,
) -> CampaignRun:
    """Make a table of all recordings in a folder and the folders in it.

    Recordings that the table already holds are not read again unless their size or their date
    has changed, or another version of sautereau has written the table; faulty ones are tried
    again. However the run ends, what it has read is in the table; only if it is killed, the last
    few presses are not.

    Args:
        folder: Of recordings, `*.mcap`.
        out: Parquet file to write; an earlier one is gone on with.
        where: Who reads; the table is the same.
        on_read: Called with the recordings read so far and those that were to be read.

    Raises:
        AnalysisError: The folder holds no recordings, or ``out`` is something else.
    """
    folder, out = Path(folder).resolve(), Path(out)
    found = find_recordings(folder)
    before = _earlier(out)
    campaign = before.only(set(found))
    kept = set(campaign.sources)
    left = [source for source in found if source not in kept]
    batches = [Batch(folder, tuple(left[i : i + BATCH])) for i in range(0, len(left), BATCH)]
    rows: list[Row] = []
    faults: list[Fault] = []
    done = 0
    try:
        for number, (more, faulty) in run_over(read_batch, batches, where):
            rows += more
            faults += faulty
            done += len(batches[number].sources)
            on_read(done, len(left))
            if len(rows) >= max(UNWRITTEN, UNWRITTEN_SHARE * len(campaign.table)):
                campaign = campaign.grown(rows, faults)
                campaign.write()
                rows, faults = [], []
    finally:
        if done or not batches:
            campaign = campaign.grown(rows, faults)
            campaign.write()
    return CampaignRun(campaign, done, len(kept), len(before.table) - len(kept))


def find_recordings(folder: Path) -> list[Source]:
    """Return the recordings below a folder, in the order of their paths.

    Raises:
        AnalysisError: There are none.
    """
    paths = sorted(path for path in folder.rglob("*.mcap") if path.is_file())
    if not paths:
        raise AnalysisError(
            f"campaign of {folder}: it holds no recordings, no file NAME.mcap; give the folder"
            " that `sautereau press --out` or `sautereau import` has filled"
        )
    stats = [(path.relative_to(folder).as_posix(), path.stat()) for path in paths]
    return [Source(name, stat.st_size, stat.st_mtime_ns) for name, stat in stats]


def _earlier(out: Path) -> Campaign:
    """Return what an earlier run has left, as far as this version can go on with it."""
    made_by = version("sautereau")
    if not out.exists():
        return empty_campaign(out, made_by)
    earlier = read_campaign(out)
    return earlier if earlier.made_by == made_by else empty_campaign(out, made_by)

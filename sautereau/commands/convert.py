"""Export recordings to the formats of other programs, and import from them."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from sautereau.commands.common import Flag, Json, OutFile, answer, bar, load_rig

PerChannel = Annotated[dict[str, str], Parameter(negative=())]


@Parameter(name="*")
@dataclass(frozen=True)
class Unstated:
    """Facts that the imported file does not state."""

    column: PerChannel = field(default_factory=dict)
    """Column of a channel: --column.velocity NAME. Default: the column named as the channel."""
    unit: PerChannel = field(default_factory=dict)
    """Unit of a channel's values: --unit.velocity V, or mm/s."""
    full_scale: PerChannel = field(default_factory=dict)
    """Full scale of a WAV file's channel: --full-scale.velocity "100 mm/s", or "4 V"."""
    without: Annotated[tuple[str, ...], Parameter(negative=())] = ()
    """Channel of the rig that the file does not hold; repeat it for several."""
    time: str | None = None
    """Column of times in s."""
    rate: str | None = None
    """Sample rate: "51.2 kHz"."""
    trigger: str | None = None
    """Time of the trigger: "12 ms" in the column of times, or after the start of the file."""
    started: str | None = None
    """Date of the file's time 0: 2026-02-03T04:05:06+01:00."""
    simulated: Annotated[bool | None, Parameter(negative="--measured")] = None
    """Whether the data were simulated, or measured on an instrument."""


def export(
    files: list[Path],
    /,
    *,
    to: Literal["parquet", "csv"],
    out: Path | None = None,
    raw: Annotated[bool, Flag] = False,
    json: Json = False,
) -> int:
    """Export recordings to Parquet or CSV.

    Parameters
    ----------
    files
        Recordings.
    to
        Format. The metadata of a CSV file are in NAME.csv.json beside it.
    out
        File to write, or folder for several. Default: beside each recording. Nothing is
        overwritten.
    raw
        Write raw volts only, without values in SI units.
    """
    from sautereau.daq.convert.export import export as export_recording
    from sautereau.daq.convert.export import targets

    written: list[Path] = []
    with bar(len(files)) as step:
        for file, target in targets(files, to, out):
            written += export_recording(file, to, target, raw=raw)
            step()
    answer(json, {"files": [str(path) for path in written]}, [str(path) for path in written])
    return 0


def import_(
    file: Path,
    /,
    *,
    rig: str | None = None,
    out: OutFile,
    notes: str = "",
    unstated: Unstated = Unstated(),
    json: Json = False,
) -> int:
    """Import a TDMS, CSV, WAV or Parquet file as a recording.

    Parameters
    ----------
    file
        .tdms, .csv, .wav, .parquet, or a format that an installed package adds. A file written
        by `export` needs only --out.
    rig
        Path of a rig file, or name of a packaged one: it holds the sensors' calibrations.
    out
        Recording to write; nothing is overwritten.
    notes
        Operator's notes, saved in the recording.
    """
    from dataclasses import asdict

    from sautereau.daq.convert.importing import import_file
    from sautereau.daq.convert.options import ImportOptions

    bench = None if rig is None else load_rig(rig)
    done = import_file(file, out, rig=bench, options=ImportOptions(**vars(unstated)), notes=notes)
    lines = [
        f"{'SIMULATED' if done.simulated else 'measured'}: {done.path}",
        f"{done.n_samples} samples at {done.rate:.9g} Hz, the first is sample {done.first_sample}",
        f"trigger: {done.trigger_shift * 1e6:.3g} us after sample 0",
    ]
    answer(json, asdict(done), lines)
    return 0

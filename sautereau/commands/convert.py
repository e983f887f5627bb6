"""Recordings for other programs, and from them."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from sautereau.commands.common import Flag, Json, answer, bar, load_rig

PerChannel = Annotated[dict[str, str], Parameter(negative=())]


@Parameter(name="*")
@dataclass(frozen=True)
class Told:
    """What the file does not tell."""

    column: PerChannel = field(default_factory=dict)
    """Column of a channel: --column.velocity NAME. Default: one of the channel's name."""
    unit: PerChannel = field(default_factory=dict)
    """Of a channel's values: --unit.velocity V, or mm/s."""
    full_scale: PerChannel = field(default_factory=dict)
    """Of a WAV file's channel: --full-scale.velocity "100 mm/s", or "4 V"."""
    without: Annotated[tuple[str, ...], Parameter(negative=())] = ()
    """A channel of the rig that the file does not have; may be given again."""
    time: str | None = None
    """Column of times in s."""
    rate: str | None = None
    """Of the samples: "51.2 kHz"."""
    trigger: str | None = None
    """When the trigger came: "12 ms" on the column of times, or after the file's begin."""
    started: str | None = None
    """Date of the file's time 0: 2026-02-03T04:05:06+01:00."""
    simulated: Annotated[bool | None, Parameter(negative="--measured")] = None
    """Whether a simulation made it, or an instrument."""


def export(
    files: list[Path],
    /,
    *,
    to: Literal["parquet", "csv"],
    out: Path | None = None,
    raw: Annotated[bool, Flag] = False,
    json: Json = False,
) -> int:
    """Write recordings for other programs.

    Parameters
    ----------
    files
        Recordings.
    to
        A CSV file has its metadata beside it, in NAME.csv.json.
    out
        File to write, or folder for several. Default: beside each recording. Nothing is
        overwritten.
    raw
        Write the raw volts alone, without the values in SI units.
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
    out: Path,
    notes: str = "",
    told: Told = Told(),
    json: Json = False,
) -> int:
    """Make a recording of another program's file.

    Parameters
    ----------
    file
        .tdms, .csv, .wav, .parquet, or a format that an installed package adds. A file written
        by `export` needs only --out.
    rig
        Path of a rig file, or name of a packaged one, with the charts of the sensors.
    out
        Recording to write; nothing is overwritten.
    notes
        Operator's notes, kept in the recording.
    """
    from dataclasses import asdict

    from sautereau.daq.convert.importing import import_file
    from sautereau.daq.convert.options import ImportOptions

    bench = None if rig is None else load_rig(rig)
    done = import_file(file, out, rig=bench, options=ImportOptions(**vars(told)), notes=notes)
    lines = [
        f"{'SIMULATED' if done.simulated else 'measured'}: {done.path}",
        f"{done.n_samples} samples at {done.rate:.9g} Hz from sample {done.first_sample} on",
        f"the trigger lies {done.trigger_shift * 1e6:.3g} us after sample 0",
    ]
    answer(json, asdict(done), lines)
    return 0

"""Recordings as files: described, recovered, exported to other formats and imported from them."""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from sautereau.commands import common


@Parameter(name="*")
@dataclass(frozen=True)
class Unstated:
    """Facts that the imported file does not state."""

    column: dict[str, str] = field(default_factory=dict)
    """Column of a channel: --column.velocity NAME. Default: the column named as the channel."""
    unit: dict[str, str] = field(default_factory=dict)
    """Unit of a channel's values: --unit.velocity V, or mm/s."""
    full_scale: dict[str, str] = field(default_factory=dict)
    """Full scale of a WAV file's channel: --full-scale.velocity "100 mm/s", or "4 V"."""
    without: tuple[str, ...] = ()
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


def info(file: Path, /, *, json: common.Json = False) -> int:
    """Describe a recording, complete or damaged.

    Parameters
    ----------
    file
        Recording.
    """
    from sautereau.daq.file.survey import describe

    found = describe(file)
    lines = [f"{'SIMULATED' if found['simulated'] else 'measured'}: {file}"]
    for name, value in found.items():
        if isinstance(value, dict):
            lines += [f"{name}:", *(f"  {key}: {item}" for key, item in value.items())]
        else:
            lines.append(f"{name}: {value}")
    return common.answer(json, dict(found), lines)


def recover(file: Path, /, *, out: common.OutFile | None = None, json: common.Json = False) -> int:
    """Write a valid recording with everything that is readable in a damaged one.

    The damaged file is not changed. No sample is invented: missing samples are reported.

    Parameters
    ----------
    file
        Damaged recording: truncated, or with changed bytes.
    out
        New recording, which must not exist yet. Default: the name without .part, or
        NAME-recovered.mcap.
    """
    from sautereau.daq.file.recovery import recover

    found = recover(file, out)
    lines = [f"{found.path}: recovered from {file}; {found.damage}"]
    lines += [f"{name}: {count} samples" for name, count in found.samples.items()]
    lines += [str(gap) for gap in found.gaps] or ["nothing is missing"]
    result = {key: value for key, value in asdict(found).items() if key != "gaps"}
    return common.answer(json, result | {"missing": [gap.document() for gap in found.gaps]}, lines)


def export(
    files: list[Path],
    /,
    *,
    to: Literal["parquet", "csv"],
    out: Path | None = None,
    raw: bool = False,
    json: common.Json = False,
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
    with common.bar(len(files)) as step:
        for file, target in targets(files, to, out):
            written += export_recording(file, to, target, raw=raw)
            step()
    return common.answer(
        json, {"files": [str(path) for path in written]}, [str(path) for path in written]
    )


def import_(
    file: Path,
    /,
    *,
    rig: str | None = None,
    out: common.OutFile,
    notes: str = "",
    unstated: Unstated = Unstated(),
    json: common.Json = False,
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
    from sautereau.daq.convert.importing import import_file
    from sautereau.daq.convert.options import ImportOptions

    bench = None if rig is None else common.load_rig(rig)
    done = import_file(file, out, rig=bench, options=ImportOptions(**vars(unstated)), notes=notes)
    lines = [
        f"{'SIMULATED' if done.simulated else 'measured'}: {done.path}",
        f"{done.n_samples} samples at {done.rate:.9g} Hz, the first is sample {done.first_sample}",
        f"trigger: {done.trigger_shift * 1e6:.3g} us after sample 0",
    ]
    return common.answer(json, asdict(done), lines)

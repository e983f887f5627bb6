"""Recordings as files: described, recovered, and exported to other formats."""

from dataclasses import asdict
from pathlib import Path
from typing import Literal

from sautereau.commands import common
from sautereau.commands.output import FileOutput, Output


def info(file: Path, /, *, output: Output = Output()) -> int:
    """Describe a recording, complete or damaged.

    Parameters
    ----------
    file
        Recording.
    """
    from sautereau.analysis.summary.recording import recording_lines
    from sautereau.daq.file.survey import describe

    found = describe(file)
    return output.answer(dict(found), recording_lines(found))


def recover(
    file: Path, /, *, out: common.OutFile | None = None, output: FileOutput = FileOutput()
) -> int:
    """Write a valid recording with all readable data of a damaged one.

    The damaged file is not changed. Missing samples are reported, not filled in.

    Parameters
    ----------
    file
        Damaged recording: truncated, or with changed bytes.
    out
        New recording. Default: the name without .part, or NAME-recovered.mcap.
    """
    from sautereau.daq.file.recovery import recover, recovered_path

    with output.replacing(None if out else recovered_path(file)):
        found = recover(file, out)
    lines = [f"{found.path}: recovered from {file}; {found.damage}"]
    lines += [f"{name}: {count} samples" for name, count in found.samples.items()]
    lines += [str(gap) for gap in found.gaps] or ["nothing is missing"]
    result = {key: value for key, value in asdict(found).items() if key != "gaps"}
    return output.answer(result | {"missing": [gap.document() for gap in found.gaps]}, lines)


def export(
    files: common.Files,
    /,
    *,
    to: Literal["parquet", "csv", "h5", "wav", "tdms", "urdf"],
    out: Path | None = None,
    raw: bool = False,
    output: FileOutput = FileOutput(),
) -> int:
    """Export recordings to Parquet, CSV, HDF5, WAV or TDMS, or their rig to URDF.

    Parameters
    ----------
    to
        Format. The metadata of a CSV or WAV file are beside it, in NAME.csv.json.
    out
        File to write, or folder for several. Default: beside each recording.
    raw
        Write raw volts only, without values in SI units.
    """
    from sautereau.daq.convert.export import export as export_recording
    from sautereau.daq.convert.export import files_of
    from sautereau.daq.convert.targets import targets
    from sautereau.entrance.session import open
    from sautereau.rig.progress import tracked

    written: list[Path] = []
    pairs = targets([press.path for press in open(files)], to, out)
    made = [path for _, file in pairs for path in files_of(to, file)]
    with output.creating(*made), output.progress("exporting"):
        for file, target in tracked(pairs):
            if to == "urdf":
                written.append(_export_rig(file, target))
            else:
                written += export_recording(file, to, target, raw=raw)
    return output.answer(
        {"files": [str(path) for path in written]}, [str(path) for path in written]
    )


def _export_rig(file: Path, target: Path) -> Path:
    """Write the URDF of a recording's rig."""
    from sautereau.daq.errors import RecordingError
    from sautereau.daq.file.reading import read_recording
    from sautereau.rig.disk import write_durably
    from sautereau.trajectory.urdf import rig_urdf

    try:
        write_durably(target, rig_urdf(read_recording(file).rig), new=True)
    except OSError as error:
        raise RecordingError(
            f"export of {file} to {target}: {error.strerror}; nothing is overwritten: give"
            " another --out"
        ) from error
    return target

"""Recordings as files: described, recovered, split, exported, and imported from other formats."""

from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from sautereau.analysis.text import counted, grouped
from sautereau.commands import common
from sautereau.commands.output import FileOutput, Output
from sautereau.daq.convert.options import ImportOptions
from sautereau.daq.errors import RecordingError
from sautereau.rig.errors import UsageError

if TYPE_CHECKING:
    from sautereau.daq.convert.importing import Imported


def info(file: Path, /, *, output: Output = Output()) -> int:
    """Describe a recording, complete or damaged; or show in what a rig file differs from its base.

    Parameters
    ----------
    file
        Recording, or rig file (.toml).
    """
    if file.suffix == ".toml":
        return _rig_info(file, output)
    from sautereau.analysis.results.recording import recording_lines
    from sautereau.daq.file.survey import describe

    found = describe(file)
    return output.answer(dict(found), recording_lines(found))


def _rig_info(file: Path, output: Output) -> int:
    from sautereau.rig.disk import named_text
    from sautereau.rig.document import flat
    from sautereau.rig.errors import RigError
    from sautereau.rig.layers import Layers
    from sautereau.rig.load import rig_of
    from sautereau.rig.units import shown

    text, origin, folder = named_text(file, "sautereau.rig", "rig", RigError)
    layers = Layers(text, origin, folder)
    rig = rig_of(layers)
    changes, count = layers.differences, len(flat(layers.values))
    origins = [layer.origin for layer in layers.bases]
    lines = [f"rig: {rig.name}", f"base: {', '.join(origins) or 'none'}"]
    if origins:
        lines += [f"{len(changes)} of {count} values differ from the base:"]
        tables = {key.partition(".outline.")[0] for key in changes if ".outline." in key}
        lines += [f"  {table}.outline: the points of an outline" for table in sorted(tables)]
        for key, (before, now) in changes.items():
            if ".outline." in key:
                continue
            was = "new" if before is None else f"base: {shown(before)}"
            lines.append(f"  {key}: {'removed' if now is None else shown(now)} ({was})")
    values = [{"key": key, "value": now, "base": before} for key, (before, now) in changes.items()]
    result = {"path": str(file), "rig": rig.name, "bases": origins, "values": count}
    return output.answer(result | {"differences": values if origins else []}, lines)


def recover(
    file: common.Recording,
    /,
    *,
    out: common.OutFile | None = None,
    output: FileOutput = FileOutput(),
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


def split(
    file: common.Recording,
    /,
    *,
    out: common.OutFolder = common.Dated("split-DATE"),
    output: FileOutput = FileOutput(),
) -> int:
    """Write each press of a recording into a recording of its own.

    Presses are separated where the key is at rest for 40 ms, with key and force back where they
    were before the press; without such a pause where the key is highest, which is said. The
    recording is not changed, and keeps what is between the presses.

    Parameters
    ----------
    file
        Recording in which the key is pressed several times, imported or of `acquire`.
    out
        Folder for the new recordings, NAME-0001.mcap and so on.
    """
    from sautereau.analysis.loading.presses import presses_of
    from sautereau.daq.convert.importing import write_part
    from sautereau.daq.file.reading import read_recording
    from sautereau.rig.progress import tracked

    def target(number: int) -> Path:
        return out / f"{file.stem}-{number:04}.mcap"

    with output.creating(target(1)):
        recorded = read_recording(file)
        found = presses_of(recorded)
    spans = {target(number): span for number, span in enumerate(found.presses, 1)}
    with output.creating(*spans), output.progress("splitting"):
        for number, (path, span) in enumerate(tracked(list(spans.items())), 1):
            write_part(recorded, span.start, span.stop, path, number)
    rate, first = recorded.rate, recorded.first_sample
    made = [
        {"path": str(path), "start": (first + one.start) / rate, "stop": (first + one.stop) / rate}
        for path, one in spans.items()
    ]
    others = [((first + one.start) / rate, (first + one.stop) / rate) for one in found.others]
    warnings = grouped([(path, why) for path, one in spans.items() for why in one.doubts], "press")
    warnings += [f"{a:.6g} to {b:.6g} s: motion that is in no press" for a, b in others]
    lines = [
        *["SIMULATED"] * recorded.simulated,
        f"{counted(len(spans), 'press')}, separated by pauses of"
        f" {found.pause * 1e3:.4g} ms or more",
        *(f"{one['path']}: {one['start']:.6g} to {one['stop']:.6g} s" for one in made),
        *(f"warning: {text}" for text in warnings),
    ]
    result = {"recordings": list(map(str, spans)), "presses": made, "pause": found.pause}
    return output.answer(result | {"simulated": recorded.simulated, "warnings": warnings}, lines)


def export(
    files: common.Files,
    /,
    *,
    to: Literal["parquet", "csv", "hdf5", "h5", "wav", "tdms", "urdf"],
    out: Path | None = None,
    raw: Annotated[bool, common.RARE] = False,
    output: FileOutput = FileOutput(),
) -> int:
    """Export recordings to Parquet, CSV, HDF5, WAV or TDMS, or their rig to URDF.

    Parameters
    ----------
    to
        Format; h5 is hdf5. The metadata of a CSV or WAV file are beside it, in NAME.csv.json or
        NAME.wav.json.
    out
        File to write, with the file extension of the format, or folder. A name without file
        extension is a folder. Default: beside each recording.
    raw
        Write raw volts only, without values in SI units.
    """
    from sautereau.daq.convert.export import export as export_recording
    from sautereau.daq.convert.export import files_of
    from sautereau.entrance.found import each
    from sautereau.entrance.session import open

    to = "h5" if to == "hdf5" else to  # the file extension
    if raw and to == "urdf":
        return output.fail("--raw: a URDF contains no samples; omit it", 2)

    def convert(pair: tuple[Path, Path]) -> list[Path]:
        file, target = pair
        if to == "urdf":
            return [_export_rig(file, target)]
        return export_recording(file, to, target, raw=raw)

    pairs = targets([press.path for press in open(files)], to, out)
    made = [path for _, file in pairs for path in files_of(to, file)]
    with output.creating(*made), output.progress("exporting"):
        done, faults = each(pairs, convert)
    written = [str(path) for paths in done for path in paths]
    texts = [str(error) for _, error in faults]
    return output.answer({"files": written, "faults": texts}, written, faults=texts)


def _export_rig(file: Path, target: Path) -> Path:
    """Write the URDF of a recording's rig."""
    from sautereau.daq.file.reading import read_recording
    from sautereau.rig.disk import explained, write_durably
    from sautereau.trajectory.urdf import rig_urdf

    text, fix = rig_urdf(read_recording(file).rig), "nothing is overwritten: give another --out"
    with explained(RecordingError, f"export of {file} to {target}", fix):
        write_durably(target, text)
    return target


@dataclass(frozen=True)
class Unstated(ImportOptions):
    """Facts that the imported file does not state."""

    simulated: Annotated[bool | None, Parameter(negative="--measured")] = None
    """State whether the data were simulated, or measured on an instrument."""


def import_(
    files: list[Path],
    /,
    *,
    rig: str | None = None,
    out: Annotated[Path, "FILE or FOLDER"] = common.Dated("import-DATE"),
    notes: str = "",
    profile: Path | None = None,
    save_profile: common.OutFile | None = None,
    unstated: Annotated[Unstated, Parameter(name="*")] = Unstated(),
    output: FileOutput = FileOutput(),
) -> int:
    """Import files of other programs as recordings.

    Parameters
    ----------
    files
        .csv, .txt, .tsv, .dat, .asc, .tdms, .wav, .parquet, .mat, .npz, .h5, .hdf5, or a format
        that an installed package adds. A file written by `export` needs no options.
    rig
        Path of a rig file, or name of a packaged one, with the calibrations of the sensors.
    out
        Recording to write (NAME.mcap), or folder. A name without file extension is a folder.
    notes
        Operator's notes, saved in the recording.
    profile
        TOML file of options, written by --save-profile. Options given here replace them.
    save_profile
        Write the options of this import to this TOML file, if the import succeeds.
    """
    from sautereau.daq.convert.importing import import_file
    from sautereau.daq.convert.profile import load_profile
    from sautereau.daq.convert.profile import save_profile as write_profile
    from sautereau.entrance.found import each

    options: ImportOptions = unstated
    if profile is not None:
        saved = load_profile(profile)
        options, rig = saved.under(options), rig or saved.rig
    bench = None if rig is None else common.load_rig(rig)
    pairs = targets(files, "mcap", out)
    made = (target for _, target in pairs)
    with output.creating(*made), output.progress("importing"):
        done, faults = each(
            pairs, lambda pair: import_file(*pair, rig=bench, options=options, notes=notes)
        )
    if save_profile is not None and not faults:
        write_profile(save_profile, options, rig)
    lines = [line for imported in done for line in _lines(imported)]
    warnings = [(imported.path, text) for imported in done for text in imported.warnings]
    lines += [f"warning: {line}" for line in grouped(warnings, "recording")]
    reasons = [(file, str(e).removeprefix(f"import of {file}: ")) for (file, _), e in faults]
    texts = [f"not imported: {line}" for line in grouped(reasons, "file")]
    found = [asdict(imported) for imported in done]
    several = {"imports": found, "faults": [str(error) for _, error in faults]}
    return output.answer(found[0] if len(files) == 1 else several, lines, faults=texts)


def _lines(done: "Imported") -> list[str]:
    return [
        f"{'SIMULATED' if done.simulated else 'measured'}: {done.path}",
        f"{done.n_samples} samples at {done.rate:.9g} Hz, the first is sample {done.first_sample}",
        f"trigger: {done.trigger_shift * 1e6:.3g} us after sample 0",
        *([f"read as: {done.read_as}"] if done.read_as else []),
    ]


def targets(files: list[Path], extension: str, out: Path | None) -> list[tuple[Path, Path]]:
    """Return each file to read with the file to write.

    Args:
        extension: File extension of the files to write, without the dot.
        out: File to write, or folder: one that exists, or a name without file extension; None for
            the folder of each file.

    Raises:
        RecordingError: Several files would be converted to the same file.
        UsageError: The file to write has the file extension of another format.
    """
    from sautereau.rig.faults import fault_list

    pairs = []
    is_folder = out is not None and (out.is_dir() or not out.suffix)
    if out and not is_folder and out.suffix.lower() != f".{extension}":
        raise UsageError(
            f"{out}: the file to write has the file extension {out.suffix}; use .{extension}, or"
            " give a folder that exists"
        )
    for file in files:
        name = f"{file.stem}.{extension}"
        pairs.append((file, out / name if out and is_folder else out or file.with_name(name)))
    counts = Counter(target for _, target in pairs)
    faults = [
        f"{target}: {n} files would be converted to it; give files with different names, and a"
        " folder as the target"
        for target, n in counts.items()
        if n > 1
    ]
    if faults:
        raise RecordingError(fault_list("several files", faults))
    return pairs

"""Import files of other programs as recordings."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from sautereau.analysis.text import grouped
from sautereau.commands import common
from sautereau.commands.output import FileOutput
from sautereau.daq.convert.options import ImportOptions

if TYPE_CHECKING:
    from sautereau.daq.convert.importing import Imported


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
    out: Annotated[Path, "FILE or FOLDER"],
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
        that an installed package adds. A file written by `export` needs only --out.
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
    from sautereau.daq.convert.targets import targets
    from sautereau.entrance.each import each

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

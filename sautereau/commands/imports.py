"""Import files of other programs as recordings."""

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from sautereau.commands import common
from sautereau.commands.output import FileOutput

if TYPE_CHECKING:
    from sautereau.daq.convert.importing import Imported


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
    invert: tuple[str, ...] = ()
    """Channel whose sensor has the opposite sign; repeat it for several."""
    time: str | None = None
    """Column of times, or of ISO 8601 dates."""
    time_unit: str | None = None
    """Unit of the column of times: ms. Default: as the file says, else s."""
    rate: str | None = None
    """Sample rate: "51.2 kHz"."""
    trigger: str | None = None
    """Time of the trigger: "12 ms" in the column of times, or after the start of the file."""
    started: str | None = None
    """Date of the file's time 0: 2026-02-03T04:05:06+01:00, or "modified" for that of the file."""
    simulated: Annotated[bool | None, Parameter(negative="--measured")] = None
    """Whether the data were simulated, or measured on an instrument."""
    complete: bool | None = None
    """The file is complete, although its last line has no line end."""


def import_(
    files: list[Path],
    /,
    *,
    rig: str | None = None,
    out: Annotated[Path, "FILE"],
    notes: str = "",
    profile: Path | None = None,
    save_profile: common.OutFile | None = None,
    unstated: Unstated = Unstated(),
    output: FileOutput = FileOutput(),
) -> int:
    """Import files of other programs as recordings.

    Parameters
    ----------
    files
        .csv, .txt, .tsv, .dat, .asc, .tdms, .wav, .parquet, .mat, .npz, .h5, .hdf5, or a format
        that an installed package adds. A file written by `export` needs only --out.
    rig
        Path of a rig file, or name of a packaged one: it holds the sensors' calibrations.
    out
        Recording to write, or existing folder for several.
    notes
        Operator's notes, saved in the recording.
    profile
        Options saved by --save-profile; those given here replace them.
    save_profile
        TOML file to write these options to, if the import succeeds.
    """
    from sautereau.daq.convert.importing import import_file, targets
    from sautereau.daq.convert.options import ImportOptions
    from sautereau.daq.convert.profile import load_profile
    from sautereau.daq.convert.profile import save_profile as write_profile
    from sautereau.daq.errors import RecordingError
    from sautereau.rig.progress import tracked

    options = ImportOptions(**vars(unstated))
    if profile is not None:
        saved = load_profile(profile)
        options, rig = saved.under(options), rig or saved.rig
    bench = None if rig is None else common.load_rig(rig)
    done: list[Imported] = []
    faults: list[str] = []
    pairs = targets(files, out)
    made = (target for _, target in pairs)
    with output.creating(*made), output.progress("importing"):
        for file, target in tracked(pairs):
            try:
                done.append(import_file(file, target, rig=bench, options=options, notes=notes))
            except RecordingError as error:
                if len(files) == 1:
                    raise
                faults.append(str(error))
    if save_profile is not None and not faults:
        write_profile(save_profile, options, rig)
    lines = [line for imported in done for line in _lines(imported)]
    lines += [f"not imported: {fault}" for fault in faults]
    found = [asdict(imported) for imported in done]
    several = {"imports": found, "faults": faults}
    output.answer(found[0] if len(files) == 1 else several, lines)
    return 1 if faults else 0


def _lines(done: "Imported") -> list[str]:
    return [
        f"{'SIMULATED' if done.simulated else 'measured'}: {done.path}",
        f"{done.n_samples} samples at {done.rate:.9g} Hz, the first is sample {done.first_sample}",
        f"trigger: {done.trigger_shift * 1e6:.3g} us after sample 0",
        *(f"warning: {warning}" for warning in done.warnings),
    ]

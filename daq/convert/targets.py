"""The files that a conversion writes, one for each file that it reads."""

from collections import Counter
from pathlib import Path

from sautereau.daq.errors import RecordingError
from sautereau.rig.errors import UsageError
from sautereau.rig.faults import fault_list


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

"""Describe recordings, and recover damaged ones."""

from dataclasses import asdict
from pathlib import Path

from sautereau.commands.common import Json, OutFile, answer


def info(file: Path, /, *, json: Json = False) -> int:
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
    answer(json, dict(found), lines)
    return 0


def recover(
    file: Path,
    /,
    *,
    out: OutFile | None = None,
    json: Json = False,
) -> int:
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
    answer(json, result | {"missing": [gap.document() for gap in found.gaps]}, lines)
    return 0

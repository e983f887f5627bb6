"""What is in a recording, and what is left of a damaged one."""

from dataclasses import asdict
from pathlib import Path

from sautereau.commands.common import Json, answer


def info(file: Path, /, *, json: Json = False) -> int:
    """Describe a recording, be it whole or damaged.

    Parameters
    ----------
    file
        The recording.
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
    out: Path | None = None,
    json: Json = False,
) -> int:
    """Make a whole recording of what a damaged one has left.

    The damaged file is not changed. No sample is made up: what is missing is told.

    Parameters
    ----------
    file
        The damaged recording: without its end, or with bytes that have changed.
    out
        New recording, which must not exist. Default: the name without .part, or
        NAME-recovered.mcap.
    """
    from sautereau.daq.file.recovery import recover

    found = recover(file, out)
    lines = [f"{found.path}: recovered from {file}; {found.damage}"]
    lines += [f"{name}: {count} samples" for name, count in found.samples.items()]
    lines += [str(gap) for gap in found.gaps] or ["nothing is missing"]
    told = {key: value for key, value in asdict(found).items() if key != "gaps"}
    answer(json, told | {"missing": [gap.document() for gap in found.gaps]}, lines)
    return 0

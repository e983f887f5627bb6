"""Contact and release set by hand, in a small file beside the recording."""

import re
from pathlib import Path

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.phases.contact import Contact
from sautereau.analysis.phases.found import line_through
from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.rows import rows_of
from sautereau.analysis.phases.signals import Signals
from sautereau.rig.disk import read_text, why_unreadable, write_durably
from sautereau.rig.layers import read_toml
from sautereau.rig.units import parse_quantity

NAMES = ("contact", "contact_std", "release", "release_std")
HEAD = "# Contact and release set by hand. Delete this file to find them in the signals again.\n"
FORM = "'52.1 ms +- 0.3 ms to 72.05 ms +- 0.05 ms'"
_INSTANTS = re.compile(r"(.+?)\s*\+-\s*(.+?)\s+to\s+(.+?)\s*\+-\s*(.+)")

Pluck = tuple[float, float, float, float]
"""Contact, its standard uncertainty, release and its standard uncertainty, in s."""


def path_by_hand(recording: Path) -> Path:
    """Return the path of the file beside a recording."""
    return recording.with_suffix(".phases.toml")


def write_by_hand(recording: Path, texts: list[str]) -> None:
    """Write the plucks of a press beside its recording.

    Args:
        texts: Of each pluck, contact and release after the trigger as in `FORM`; none for a press
            without a pluck.

    Raises:
        AnalysisError: A text has another form, or the plucks are not in order.
    """
    tables = []
    for text in texts:
        found = _INSTANTS.fullmatch(text.strip())
        if found is None:
            raise AnalysisError(
                f"--at {text!r}: expected contact and release with their standard uncertainties,"
                f" such as {FORM}"
            )
        tables.append(dict(zip(NAMES, found.groups(), strict=True)))
    _plucks(tables, "--at")
    lines = [
        "\n[[plucks]]\n" + "".join(f'{name} = "{value}"\n' for name, value in table.items())
        for table in tables
    ]
    text = HEAD + ("".join(lines) or "plucks = []\n")
    write_durably(path_by_hand(recording), text, replace=True)


def read_by_hand(recording: Path) -> list[Pluck] | None:
    """Return the plucks set by hand, in order; None where there is no file.

    Raises:
        AnalysisError: The file does not hold plucks.
    """
    path = path_by_hand(recording)
    if not path.is_file():
        return None
    try:
        tables = read_toml(read_text(path), str(path), AnalysisError)["plucks"]
    except (OSError, UnicodeDecodeError, KeyError) as error:
        raise AnalysisError(
            f"{path}: it holds no plucks ({why_unreadable(error)}); correct it, or delete it to"
            " find them again"
        ) from error
    return _plucks(tables, str(path))


def _plucks(tables: object, where: str) -> list[Pluck]:
    found: list[Pluck] = []
    if not isinstance(tables, list):
        raise AnalysisError(f"{where}: plucks is no list of tables; give [[plucks]] for each")
    for number, table in enumerate(tables, 1):
        try:
            values = [parse_quantity(str(table[name]), "s") for name in NAMES]
        except (KeyError, TypeError, ValueError) as error:
            raise AnalysisError(
                f"{where}, pluck {number}: {error}; give {', '.join(NAMES)}, each with its unit"
            ) from error
        contact, contact_std, release, release_std = values
        earlier = found[-1][2] if found else -np.inf
        if not (contact < release > earlier and contact_std > 0 and release_std > 0):
            raise AnalysisError(
                f"{where}, pluck {number}: contact {contact * 1e3:.5g} ms and release"
                f" {release * 1e3:.5g} ms must be in order, the releases of plucks increasing, and"
                " uncertainties above 0; change them"
            )
        found.append((contact, contact_std, release, release_std))
    return found


def plucks_by_hand(
    signals: Signals, plucks: list[Pluck], bottom: float, recording: Path
) -> list[tuple[Contact, Release]]:
    """Return contacts and releases set by hand, with the fall of the load at each release.

    Args:
        bottom: s, at which the jack reaches its top.

    Raises:
        AnalysisError: A pluck begins before the recording or ends after the way down.
    """
    found = []
    for contact, contact_std, release, release_std in plucks:
        if contact < signals.time[0] or release > bottom:
            raise AnalysisError(
                f"{path_by_hand(recording)}: the pluck from {contact * 1e3:.5g} to"
                f" {release * 1e3:.5g} ms is not within the way down, from"
                f" {signals.time[0] * 1e3:.5g} to {bottom * 1e3:.5g} ms; change it with --at, or"
                " delete the file"
            )
        fall = _fall(signals, release)
        found.append(
            (
                Contact(contact, contact_std, 0.0, fall, 1.0),
                Release(release, release_std, fall, 0.0, 0.0, 0.0, 1.0),
            )
        )
    return found


def _fall(signals: Signals, release: float) -> float:
    """Return the fall [N] of the load between lines on either side of a release; 0 at an end."""
    first, last = (signals.sample(release + side) for side in (-2e-3, 2e-3))
    rows = rows_of(signals, max(0, first), min(len(signals.time), last))
    away = rows.time - release
    before, after = away < -rows.step, away > rows.step
    if min(before.sum(), after.sum()) < 3:
        return 0.0
    return (
        line_through(away[before], rows.load[before])[1]
        - line_through(away[after], rows.load[after])[1]
    )

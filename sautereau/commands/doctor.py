"""This machine."""

from dataclasses import asdict
from pathlib import Path

from sautereau.commands.common import Json, RigName, answer, load_rig


def doctor(rig: RigName = "paper", *, json: Json = False) -> int:
    """Show what is installed, connected and missing, and how to fix it."""
    from sautereau.doctor.checks import examine

    found = examine(load_rig(rig), Path())
    lines = []
    for finding in found:
        lines.append(f"{'ok     ' if finding.ok else 'MISSING'} {finding.name}: {finding.detail}")
        if not finding.ok:
            lines.append(f"        fix: {finding.how_to_fix}")
    answer(json, {"checks": [asdict(finding) for finding in found]}, lines)
    return 0

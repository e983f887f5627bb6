"""This machine."""

from dataclasses import asdict
from pathlib import Path

from sautereau.commands.common import Json, RigName, answer, load_rig


def doctor(rig: RigName = "paper", *, json: Json = False) -> int:
    """Tell what is installed, connected and missing, with the remedy."""
    from sautereau.doctor.checks import examine

    found = examine(load_rig(rig), Path())
    lines = []
    for finding in found:
        lines.append(f"{'ok     ' if finding.ok else 'MISSING'} {finding.name}: {finding.detail}")
        if not finding.ok:
            lines.append(f"        remedy: {finding.remedy}")
    answer(json, {"checks": [asdict(finding) for finding in found]}, lines)
    return 0

"""Files that a rig file names: gestures of the finger, outlines of plectra."""

from pathlib import Path
from typing import Any

from sautereau.rig.csv_files import read_gesture
from sautereau.rig.errors import RigError


def read_files(values: dict[str, Any], folder: Path) -> list[tuple[str, str]]:
    """Replace the names of files by their contents; return the faults in them."""
    faults: list[tuple[str, str]] = []
    press = values.get("press")
    gesture = press.get("gesture") if isinstance(press, dict) else None
    if isinstance(press, dict) and isinstance(gesture, dict) and set(gesture) == {"file"}:
        try:
            press["gesture"] = read_gesture(folder / str(gesture["file"]))
        except RigError as error:
            del press["gesture"]
            faults.append(("press.gesture", str(error)))
    choirs = values.get("more_choirs")
    holders = [("", values)]
    if isinstance(choirs, list):
        holders += [(f"more_choirs.{i}.", c) for i, c in enumerate(choirs) if isinstance(c, dict)]
    for prefix, holder in holders:
        plectrum = holder.get("plectrum")
        outline = plectrum.get("outline") if isinstance(plectrum, dict) else None
        if isinstance(plectrum, dict) and isinstance(outline, dict) and "file" in outline:
            from sautereau.rig.outline import read_outline  # imports numpy; few rigs need it

            try:
                plectrum["outline"] = read_outline(outline, folder)
            except RigError as error:
                del plectrum["outline"]
                faults.append((f"{prefix}plectrum.outline", str(error)))
    return faults

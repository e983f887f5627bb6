"""Write a press as the files an experimenter would have: a CSV table and a rig file."""

from importlib.resources import files
from pathlib import Path

import numpy as np

from .press import Pressed


def write_csv(pressed: Pressed, path: str | Path) -> list[str]:
    """Write time and both channels' volts; return the arguments of the command that imports it.

    The columns are ``time [s]`` into the file, ``velocity [V]`` and ``force [V]``. The rig file
    named by the arguments is written by `write_rig`.
    """
    path = Path(path)
    times = np.arange(len(pressed.velocity_volts)) / pressed.rate
    table = np.column_stack([times, pressed.velocity_volts, pressed.force_volts])
    header = "time [s],velocity [V],force [V]"
    np.savetxt(path, table, fmt=["%.9f", "%.9e", "%.9e"], delimiter=",", header=header, comments="")
    return [
        *("sautereau", "import", str(path), "--out", str(path.with_suffix(".mcap"))),
        *("--rig", str(path.with_suffix(".toml")), "--rate", f"{pressed.rate:.9g} Hz"),
        *("--column.velocity", "velocity [V]", "--unit.velocity", "V"),
        *("--column.force", "force [V]", "--unit.force", "V"),
        *("--trigger", f"{pressed.t0:.12g} s", "--started", "2026-01-01T00:00:00+00:00"),
        "--measured",
    ]


def write_rig(pressed: Pressed, path: str | Path) -> None:
    """Write the rig file `paper` with the experimenter's values in it."""
    import tomlkit

    document = tomlkit.parse((files("sautereau.rig") / "paper.toml").read_text(encoding="utf-8"))
    for dotted, value in pressed.rig_values.items():
        table = document
        *parents, last = dotted.split(".")
        for name in parents:
            if name.isdigit():
                while len(table) <= int(name):
                    table.append(tomlkit.table())
                table = table[int(name)]
                continue
            if name not in table:
                table[name] = tomlkit.aot() if name == "more_choirs" else tomlkit.table()
            table = table[name]
        table[last] = value
    Path(path).write_text(tomlkit.dumps(document), encoding="utf-8")

"""The manufacturer's command reference as judge: its dialogues, replayed over the ports."""

import contextlib
import csv
from pathlib import Path

import pytest
import serial

from sautereau.rig.load import load_rig
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.scene import parse_scene
from tests.presses import MUTE_TEXT
from tests.sim_backend.transcripts import Terminal, read_dialogues

HERE = Path(__file__).parent / "galil_transcripts"
SCENE = f'{MUTE_TEXT}[controller]\nindex_angles = ["0.01 rad", "0.01 rad"]\n'
UNITS = {
    "burned": "",
    "dmc4143": 'model = "DMC4143"\nfirmware = "1.1a1"\ninterface = "usb"\namplifier = "D3040"\n',
    "ethernet": 'interface = "ethernet"\n',
}
"""Files of dialogues with units of their own."""
DISAGREE = dict(
    line.split(" | ")
    for line in (HERE / "disagreements.txt").read_text(encoding="utf-8").splitlines()
)
"""Reason by heading."""


def dialogues(*names):
    """The dialogues of files, those of `DISAGREE` marked as failing."""
    return [
        pytest.param(
            each,
            id=each.heading,
            marks=[pytest.mark.xfail(strict=True, reason=DISAGREE[each.heading])]
            if each.heading in DISAGREE
            else [],
        )
        for name in names
        for each in read_dialogues(HERE / f"{name}.txt")
    ]


@contextlib.contextmanager
def at_terminal(unit="", paced=False):
    scene = parse_scene(SCENE + unit)
    with (
        StandIn(load_rig(), scene, paced=paced) as stand_in,
        serial.serial_for_url(stand_in.serial_port.replace("tcp:", "socket:"), timeout=0.2) as port,
    ):
        yield Terminal(port, stand_in.bench)


@pytest.fixture(scope="module")
def terminal():
    with at_terminal() as each:
        yield each


@pytest.fixture(scope="module")
def paced():
    with at_terminal(paced=True) as each:
        yield each


@pytest.mark.parametrize(
    "dialogue", dialogues("values", "commands", "more_commands", "errors", "motion", "homing")
)
def test_dialogue(dialogue, terminal):
    terminal.reset()
    terminal.replay(dialogue)


@pytest.mark.parametrize("dialogue", dialogues("programs", "threads"))
def test_program(dialogue, paced):
    paced.reset()
    paced.replay(dialogue)


@pytest.mark.parametrize("name", UNITS)
def test_other_unit(name):
    """Each file in its own session, as its burned state or its port concerns the next dialogue."""
    with at_terminal(UNITS[name]) as terminal:
        for dialogue in read_dialogues(HERE / f"{name}.txt"):
            if name != "ethernet":
                terminal.reset()
            terminal.replay(dialogue)


RANGES = list(csv.DictReader((HERE / "ranges.csv").read_text(encoding="utf-8").splitlines()))


@pytest.mark.parametrize("row", RANGES, ids=lambda row: row["command"])
def test_range(row, terminal):
    """The bounds and the default are the reference's, and values are multiples of the resolution.

    Beyond the bounds the code is 6, a number out of range.
    """
    name = row["command"]
    set_to, read = (f"{name} ", f"_{name}") if name == "TM" else (f"{name}A=", f"_{name}A")
    step = float(row["resolution"] or 20 / 65536)
    terminal.reset()
    faults = []

    def value():
        return float(terminal.ask(f"MG {read}"))

    def expect(found, wanted, tolerance):
        if abs(found - wanted) > tolerance + 5e-5:
            faults.append(f"{found} instead of {wanted}")

    if row["default"]:
        expect(value(), float(row["default"]), 0)
    for bound, beyond in ((row["lowest"], -1), (row["highest"], 1)):
        if bound:
            assert terminal.ask(set_to + bound) == "", f"{set_to}{bound} is refused"
            found = abs(value()) if name == "JG" else value()
            expect(found, abs(float(bound)) if name == "JG" else float(bound), step)
            outside = float(bound) + beyond * max(4 * step, abs(float(bound)) / 1e4)
            if terminal.ask(f"{set_to}{outside:.4f}") != "?":
                faults.append(f"{set_to}{outside:.4f} is not refused")
            elif (code := terminal.ask("TC0").strip()) != "6":
                faults.append(f"{set_to}{outside:.4f} is refused with code {code}")
    if row["resolution"] and step != 1:
        assert terminal.ask(f"{set_to}{10_240.4 * step if step > 1 else 40.4 * step:.6f}") in (
            "",
            "?",
        )
        expect(value() / step, round(value() / step), 6e-5 / step)
    assert not faults, faults

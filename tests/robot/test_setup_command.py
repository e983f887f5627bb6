"""The command `setup`: what it prints, what it writes into the rig file, and when."""

import io
import json
from importlib import resources

import pytest

from sautereau.commands.common import Simulation
from sautereau.commands.setup import setup
from sautereau.rig.load import load_rig
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.setup.step import Declined

TEXT = resources.files("sautereau.rig").joinpath("paper.toml").read_text(encoding="utf-8")
BARE = """
description = "a key without strings that lies 0.3 mm lower than the rig has it"
finger = "ideal"
plectrum = "none"
string = "none"
friction = false
felt = false
step = "1 ms"
truth = { "arm.base_z" = "174.42 mm" }
"""


@pytest.fixture
def bench(tmp_path):
    """A rig file of one's own, and the stand-in."""
    rig, scene = tmp_path / "rig.toml", tmp_path / "scene.toml"
    rig.write_text(TEXT, encoding="utf-8")
    scene.write_text(BARE, encoding="utf-8")
    return rig, Simulation(scene=str(scene))


def test_what_was_found_is_written_on_save_alone(bench, capsys):
    file, simulation = bench
    assert setup("touch", str(file), yes=True, simulation=simulation) == 0
    told = capsys.readouterr()
    assert '-base_z = { value = "174.12 mm"' in told.out
    assert "not written: arm.base_z" in told.out
    assert "warning: touch: nobody measured" in told.err
    assert file.read_text() == TEXT

    assert setup("touch", str(file), yes=True, save=True, simulation=simulation, json=True) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["saved"]
    assert result["simulated"]
    assert result["steps"]["touch"]["figures"]["away"] == pytest.approx(0.3e-3, abs=0.03e-3)
    rig = load_rig(file)
    assert rig.arm.base_z == pytest.approx(0.17442, abs=0.03e-3)
    assert rig.sources["arm.base_z"].startswith("sautereau setup, 20")


def test_the_port_of_the_stand_in_never_gets_into_a_file(bench, capsys):
    file, simulation = bench
    assert setup("port", str(file), yes=True, save=True, simulation=simulation) == 0
    assert "DMC4020" in capsys.readouterr().out
    assert file.read_text() == TEXT


def test_where_nobody_can_be_asked_nothing_moves(bench, capsys):
    file, simulation = bench
    assert setup("home", str(file), simulation=simulation) == 2
    assert "--yes" in capsys.readouterr().err


def test_a_packaged_rig_is_not_saved_into(capsys):
    assert setup("home", "paper", yes=True, save=True, simulation=Simulation(sim=True)) == 2
    assert "copy the rig file first" in capsys.readouterr().err


def test_the_hardware_that_is_not_there_is_told(bench):
    file, _ = bench
    file.write_text(TEXT.replace("/dev/ttyUSB0", "/dev/ttyNONE"))
    with pytest.raises(RobotError, match="ttyNONE"):
        setup("controller", str(file), yes=True)


@pytest.mark.slow
def test_all_steps_in_their_order(bench, capsys):
    file, simulation = bench
    assert setup("all", str(file), yes=True, simulation=simulation, json=True) == 0
    steps = json.loads(capsys.readouterr().out)["steps"]
    assert list(steps) == [
        "port", "controller", "home", "encoders", "contact", "touch", "dry-run",
    ]  # fmt: skip


class Terminal(io.StringIO):
    """Somebody who types."""

    def isatty(self):
        return True


def test_a_person_is_asked_measures_and_agrees(bench, capsys, monkeypatch):
    file, simulation = bench
    typed = ["y", "171", "171 mm", "", "13.68 cm", "y"]  # a unit is missing; one cannot be told
    monkeypatch.setattr("sys.stdin", Terminal("\n".join(typed) + "\n"))
    assert setup("touch", str(file), simulation=simulation) == 0
    told = capsys.readouterr()
    assert "Is its way free" in told.err
    assert "has no unit; write it like" in told.err
    assert f"Write this into {file}?" in told.err
    assert "written into" in told.out
    assert load_rig(file).arm.base_z == pytest.approx(0.17442, abs=0.03e-3)


def test_a_person_who_does_not_agree_moves_nothing(bench, monkeypatch):
    file, simulation = bench
    monkeypatch.setattr("sys.stdin", Terminal(""))
    with pytest.raises(Declined):
        setup("home", str(file), simulation=simulation)

"""The command `setup`: what it prints, and what it writes into the rig file."""

import io
import json

import numpy as np
import pytest

from benchmarks.independent import ONE_FACTOR
from sautereau.commands.common import Simulation
from sautereau.commands.output import Output
from sautereau.commands.setup import setup
from sautereau.daq.signals.calibration import to_volts
from sautereau.rig.errors import UsageError
from sautereau.rig.load import load_rig, with_values
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.setup.step import Declined
from tests.presses import MUTE_TEXT
from tests.presses import QUICK_TEXT as TEXT
from tests.recordings import write_recording
from tests.taps import RATE, tapped

BARE = f'{MUTE_TEXT}truth = {{ "arm.base_z" = "171.12 mm" }}\n'
"""The base is 3 mm lower than in the rig: the finger, lowered from 4 mm above, soon touches."""


@pytest.fixture
def bench(tmp_path):
    """A rig file of the user's own, and the stand-in."""
    rig, scene = tmp_path / "rig.toml", tmp_path / "scene.toml"
    rig.write_text(TEXT, encoding="utf-8")
    scene.write_text(BARE, encoding="utf-8")
    return rig, Simulation(scene=str(scene))


@pytest.mark.slow
def test_what_was_found_is_written_on_save(bench, capsys):
    file, simulation = bench
    assert (
        setup(
            str(file), "touch", yes=True, save=True, simulation=simulation, output=Output(json=True)
        )
        == 0
    )
    result = json.loads(capsys.readouterr().out)
    assert result["saved"]
    assert result["simulated"]
    assert '-base_z = { value = "174.12 mm"' in result["difference"]
    assert result["steps"]["touch"]["figures"]["away"] == pytest.approx(3e-3, abs=0.03e-3)
    assert "were not measured" in result["steps"]["touch"]["warnings"][-1]
    rig = load_rig(file)
    assert rig.arm.base_z == pytest.approx(0.17112, abs=0.03e-3)
    assert rig.sources["arm.base_z"].startswith("sautereau setup, 20")


def test_the_port_of_the_stand_in_never_gets_into_a_file(bench, capsys):
    file, simulation = bench
    assert setup(str(file), "port", yes=True, save=True, simulation=simulation) == 0
    assert "DMC4020" in capsys.readouterr().out
    assert file.read_text() == TEXT


def test_without_a_terminal_the_hardware_does_not_move_and_the_stand_in_agrees(bench, capsys):
    file, simulation = bench
    assert setup(str(file), "home") == 2
    assert "--yes or --answers" in " ".join(capsys.readouterr().err.split())
    assert setup(str(file), "home", simulation=simulation, output=Output(json=True)) == 0
    (answer,) = json.loads(capsys.readouterr().out)["answers"]
    assert "Is its way free?" in answer["question"]
    assert (answer["answer"], answer["by"]) == ("yes", "the stand-in")


def test_a_file_answers_the_questions(bench, tmp_path, capsys):
    file, simulation = bench
    answers = tmp_path / "answers.toml"
    answers.write_text('"The arm homes" = "yes"\n"By how much" = ["20 deg", "unknown"]\n')
    words = {"answers": answers, "save": True, "simulation": simulation}
    assert setup(str(file), "encoders", **words) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert f"20 deg (by answers {answers})" in printed
    assert "written into" in printed
    assert load_rig(file).arm.counts_per_revolution == 1_000_000
    for text, said in (
        ('"The arm homes" = "yes"\n"By how much" = "20"\n', "'20' is no answer.*no unit"),
        ('"The arm homes" = "yes"\n"By how" = ["20 deg"]\nx = "y"', "question 2 of.*x'"),
        ('"The arm homes" = "perhaps"\n', "give yes or no"),
    ):
        answers.write_text(text)
        with pytest.raises(RobotError, match=f"(?s){said}"):
            setup(str(file), "encoders", **words)
    assert setup(str(file), "home", yes=True, **words) == 2
    answers.write_text('"The arm" = "yes"\n"Which" = "this"\n')
    assert setup(str(file), "home", **words) == 1
    assert "'Which': no such question" in " ".join(capsys.readouterr().err.split())
    assert setup(str(file), "verify", answers=answers) == 2
    assert "needs an operator: give it without --answers" in capsys.readouterr().err


def test_a_packaged_rig_is_not_saved_into(capsys):
    assert setup("paper", "home", yes=True, save=True, simulation=Simulation(sim=True)) == 2
    assert "write one with `sautereau init`" in capsys.readouterr().err


def test_missing_hardware_is_named(bench):
    file, _ = bench
    file.write_text(TEXT.replace("/dev/ttyUSB0", "/dev/ttyNONE"))
    with pytest.raises(RobotError, match="ttyNONE"):
        setup(str(file), "controller", yes=True)


@pytest.mark.slow
def test_all_steps_in_their_order(bench, capsys):
    file, simulation = bench
    assert setup(str(file), "all", yes=True, simulation=simulation, output=Output(json=True)) == 0
    steps = json.loads(capsys.readouterr().out)["steps"]
    assert list(steps) == [
        "port", "controller", "verify", "home", "encoders", "force", "contact", "touch", "tap",
        "dry-run",
    ]  # fmt: skip


def test_modes_from_recorded_taps_are_written_into_the_rig(tmp_path, capsys):
    file, taps = tmp_path / "rig.toml", tmp_path / "taps.mcap"
    file.write_text(TEXT, encoding="utf-8")
    rig = with_values(load_rig(), {"daq.sample_rate": f"{RATE} Hz"})
    (force, velocity), _ = tapped(ONE_FACTOR["key heaves at 120 Hz"], seed=3)
    signals = {"force": force, "velocity": velocity}
    time = np.arange(len(force)) / RATE
    late = [np.interp(time - c.lag, time, signals[c.quantity]) for c in rig.daq.channels]
    volts = [to_volts(signal, c) for signal, c in zip(late, rig.daq.channels, strict=True)]
    write_recording(taps, rig, volts)
    assert setup(str(file), "tap", save=True, recording=[taps], output=Output(json=True)) == 0
    assert json.loads(capsys.readouterr().out)["saved"]
    modes = load_rig(file).key.modes
    assert 1 <= len(modes) <= 3
    assert all(0 < mode.frequency_std < 0.1 * mode.frequency for mode in modes)
    with pytest.raises(UsageError, match="tap, loops"):
        setup(str(file), "home", recording=[taps])


class Terminal(io.StringIO):
    """A terminal with a person at it."""

    def isatty(self):
        return True


def type_in(monkeypatch, *answers):
    monkeypatch.setattr("sys.stdin", Terminal("\n".join(answers) + "\n"))


def test_a_person_is_asked_measures_and_agrees(bench, capsys, monkeypatch):
    file, simulation = bench
    type_in(monkeypatch, "y", "20", "20 deg", "", "y")  # a unit is missing; one is not measured
    assert setup(str(file), "encoders", simulation=simulation) == 0
    answered = capsys.readouterr()
    questions = " ".join(answered.err.split())
    assert "Is its way free" in questions
    assert "has no unit; write it like" in questions
    assert f"Write this into {file}?" in questions
    assert "written into" in answered.out
    assert load_rig(file).arm.counts_per_revolution == 1_000_000


def test_without_agreement_nothing_is_written(bench, capsys, monkeypatch):
    file, simulation = bench
    type_in(monkeypatch, "y", "20 deg", "20 deg", "n")
    assert setup(str(file), "encoders", simulation=simulation) == 0
    assert "not written: arm.counts_per_revolution" in capsys.readouterr().out
    assert file.read_text() == TEXT


def test_a_person_who_does_not_agree_moves_nothing(bench, monkeypatch):
    file, simulation = bench
    type_in(monkeypatch)
    with pytest.raises(Declined):
        setup(str(file), "home", simulation=simulation)

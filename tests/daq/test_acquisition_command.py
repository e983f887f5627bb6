"""`sautereau acquire` on the stand-in, as users' scripts meet it."""

import json
import os
import signal
import threading
import time
from importlib import resources
from pathlib import Path

import pytest
from cyclopts import CycloptsError

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.press import load_press
from sautereau.commands.acquire import acquire
from sautereau.commands.app import app
from sautereau.commands.common import Simulation
from sautereau.commands.output import FileOutput
from sautereau.daq.file.reading import read_recording
from sautereau.rig.errors import RigError, SautereauError
from sautereau.rig.load import load_rig

IDEAL = Simulation(scene="ideal", seed=3)
JSON = FileOutput(json=True)


def test_a_dry_run_starts_nothing(capsys):
    assert acquire(dry_run=True, simulation=IDEAL, output=JSON) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["simulated"] is True
    assert found["trigger"] == ""
    assert (found["n_samples"], found["rate"], found["buffer"]) == (None, 51_200.0, 512_000)
    assert [channel["terminal"] for channel in found["channels"]] == ["Dev1/ai0", "Dev1/ai1"]
    assert acquire(dry_run=True, triggered=True, simulation=IDEAL) == 0
    result = capsys.readouterr().out
    assert "/Dev1/PFI0" in result
    assert "nothing was started" in result


def test_a_recording_of_a_given_duration(tmp_path, capsys):
    path = tmp_path / "a.mcap"
    assert acquire(duration=0.51, out=path, simulation=IDEAL, output=JSON) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["n_samples"], found["stopped"], found["seed"]) == (26_112, False, 3)
    recording = read_recording(path)
    assert len(recording.volts["velocity"]) == 26_112
    assert recording.session.simulated
    with pytest.raises(SautereauError, match="already exists"):
        app(["acquire", "--sim", "--out", str(path)], exit_on_error=False)


def test_a_rig_file_with_daq_alone_is_recorded_and_not_analysed(tmp_path):
    paper = resources.files("sautereau.rig").joinpath("paper.toml").read_text(encoding="utf-8")
    daq = paper[paper.index("[daq]") :]
    (tmp_path / "card.toml").write_text(daq, encoding="utf-8")
    path = tmp_path / "a.mcap"
    assert acquire(str(tmp_path / "card.toml"), duration=0.2, out=path, simulation=IDEAL) == 0
    rig = read_recording(path).rig
    assert (rig.name, rig.daq_only) == ("card", True)
    assert rig.daq.channels[0].sensor == load_rig().daq.channels[0].sensor
    with pytest.raises(AnalysisError, match=r"had \[daq\] alone.*import --rig"):
        load_press(path)
    with pytest.raises(RigError, match="key: missing"):
        load_rig(tmp_path / "card.toml")
    (tmp_path / "card.toml").write_text(daq.replace('"51.2 kHz"', '"51.2 kg"'), encoding="utf-8")
    line = 1 + daq[: daq.index('"51.2 kHz"')].count("\n")
    with pytest.raises(RigError, match=rf"line {line}: daq\.sample_rate"):
        acquire(str(tmp_path / "card.toml"), dry_run=True, simulation=IDEAL)


def test_an_interrupted_recording_is_complete(tmp_path, capsys):
    path = tmp_path / "a.mcap"
    part = path.with_name("a.mcap.part")

    def interrupt():
        while not (part.exists() and part.stat().st_size > 50_000):
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt, daemon=True).start()
    assert acquire(out=path, simulation=IDEAL, output=JSON) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["stopped"] is True
    recording = read_recording(path)
    assert len(recording.volts["force"]) == found["n_samples"] > 0
    assert recording.events[-1].kind == "stopped"
    assert not part.exists()


def test_wrong_usage_ends_with_two(capsys):
    assert acquire(out=Path("a.mcap"), triggered=True, simulation=IDEAL) == 2
    assert "--triggered: nothing presses" in capsys.readouterr().err
    with pytest.raises(CycloptsError, match=r'has no unit; write it like "1\.5 s"'):
        app(["acquire", "--sim", "--duration", "10"], exit_on_error=False, print_error=False)

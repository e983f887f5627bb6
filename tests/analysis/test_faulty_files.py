"""One faulty recording in a folder is named, and the others are shown."""

import json
import shutil
from contextlib import suppress

import numpy as np
import pytest

from benchmarks.campaign import write_presses
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.press import LEAST_RATE, load_press
from sautereau.analysis.phases.find import find_phases
from sautereau.commands import campaign as campaigns
from sautereau.commands import fit, recordings
from sautereau.commands import folder as folders
from sautereau.commands.output import FileOutput, Output
from tests.recordings import write_recording


def gaussian(rate, n):
    """Return volts of a slow hump of velocity and force at a rate, shape (2, n)."""
    time = np.arange(n) / rate
    at = (time - time.mean()) / time[-1]
    return np.array([0.05 * np.exp(-((10 * at) ** 2)), 0.5 * np.exp(-((7 * at) ** 2))])


def at_rate(path, rig, rate, n=300):
    """Write a recording of that hump as a slow test machine gives it."""
    scales = [[rig.daq.channel(name).scale] for name in ("velocity", "force")]
    return write_recording(path, rig, gaussian(rate, n) / scales, rate=rate)


FAULTY = {
    "slow": "LEAST_RATE",
    "short": "truncated",
    "foreign": "not an MCAP file",
    "bench": "[daq] alone",
    "short-press": "16 are needed",
}
"""Faulty recordings, and what is said about them."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory, paper):
    """Two presses and a recording with each fault; not to be changed."""
    folder = tmp_path_factory.mktemp("folder")
    for number, path in enumerate(write_presses(folder / "made", 1, 1, 2)):
        shutil.move(path, folder / f"good-{number}.mcap")
    shutil.rmtree(folder / "made")
    at_rate(folder / "slow.mcap", paper, 30.0)
    (folder / "short.mcap").write_bytes((folder / "good-0.mcap").read_bytes()[:-100])
    (folder / "foreign.mcap").write_bytes(b"PK" * 100)
    at_rate(folder / "bench.mcap", paper.model_copy(update={"daq_only": True}), 51_200.0)
    at_rate(folder / "short-press.mcap", paper, 51_200.0, 20)
    return folder


def answer(capsys, status):
    """Return the JSON that a command printed, and its error."""
    printed = capsys.readouterr()
    assert status == 1
    return json.loads(printed.out), json.loads(printed.err)["error"]["message"]


@pytest.mark.parametrize("rate", [10.0, 30.0, 100.0, 400.0])
@pytest.mark.parametrize("n", [40, 300])
def test_a_rate_without_an_analysis(tmp_path, paper, rate, n):
    path = at_rate(tmp_path / "slow.mcap", paper, rate, n)
    with pytest.raises(AnalysisError) as raised:
        load_press(path)
    for part in (str(path), f"{rate:g} Hz", f"LEAST_RATE = {LEAST_RATE:g} Hz", "export"):
        assert part in str(raised.value)


@pytest.mark.parametrize("rate", [500.0, 1000.0, 2000.0, 51_200.0, 1e6])
def test_rates_with_an_analysis(tmp_path, paper, rate):
    """No traceback where the way down is short compared with what smooths it."""
    for n in (40, 300, 6000):
        with suppress(AnalysisError):  # only 0 samples remain after the correction of the delay
            find_phases(load_press(at_rate(tmp_path / f"{n}.mcap", paper, rate, n)))


JSON = FileOutput(json=True)


@pytest.mark.parametrize(
    "command",
    [
        lambda files: fit.phases(files, output=JSON),
        lambda files: fit.compare(files, output=JSON),
        lambda files: fit.compare(files, against=files, output=JSON),
        lambda files: fit.identify(files, free="key.inertia", starts=1, output=JSON),
        lambda files: fit.transient(files, output=JSON),
    ],
    ids=["phases", "compare", "against", "identify", "transient"],
)
def test_the_others_are_shown(folder, capsys, command):
    result, message = answer(capsys, command([folder]))
    for name, said in FAULTY.items():
        assert any(f"{name}.mcap" in fault and said in fault for fault in result["faults"])
        assert f"{name}.mcap" in message
    assert "good-" not in message
    assert "good-" in json.dumps({key: result[key] for key in result if key != "faults"})


def test_the_others_are_exported(folder, tmp_path, capsys):
    """What cannot be analysed can still be exported."""
    status = recordings.export([folder], to="csv", out=tmp_path / "csv", output=JSON)
    message = answer(capsys, status)[1]
    assert {name for name in FAULTY if f"{name}.mcap" in message} == {"short", "foreign"}
    assert all((tmp_path / "csv" / f"{name}.csv").exists() for name in ("good-0", "slow"))


def test_the_others_are_in_the_report_and_the_campaign(folder, tmp_path, capsys):
    """These commands list what they omit, as their answer."""
    assert folders.report(folder, out=tmp_path / "report.html", output=JSON) == 0
    made = json.loads(capsys.readouterr().out)
    assert made["presses"] == 2
    table = tmp_path / "table.parquet"
    assert campaigns.campaign(folder, out=table, processes=1, output=Output(json=True)) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["presses"] == 2
    omitted = {
        "report": made["left_out"],
        "campaign": {f["path"]: f["fault"] for f in found["faults"]},
    }
    for texts in omitted.values():
        assert len(texts) == len(FAULTY)
        for name, said in FAULTY.items():
            assert any(f"{name}.mcap" in path and said in text for path, text in texts.items())


def test_nothing_but_faults_is_an_error(folder, capsys):
    with pytest.raises(AnalysisError, match="LEAST_RATE") as raised:
        fit.compare([folder / "slow.mcap", folder / "bench.mcap"], output=JSON)
    assert "[daq] alone" in raised.value.__notes__[0]

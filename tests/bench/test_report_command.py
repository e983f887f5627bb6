"""`sautereau report`: sessions that are complete, interrupted, damaged or empty."""

import json
import shutil
import sys
from html import unescape
from pathlib import Path

import pytest

from sautereau.analysis.errors import AnalysisError
from sautereau.commands.app import app
from sautereau.commands.folder import report
from sautereau.commands.output import FileOutput
from sautereau.daq.file.reading import read_recording
from sautereau.rig.errors import MissingExtraError
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.plan import Plan, Row
from sautereau.robot.experiment.session_folder import MANIFEST, SessionFolder
from sautereau.sim_backend.scene import load_scene


@pytest.fixture
def started(write_session, tmp_path):
    """A session of 3 planned presses without recordings."""
    rig = write_session.one.rig
    scene = load_scene("ideal").model_dump_json()
    path = tmp_path / "it's; an evening"
    folder = SessionFolder(path, Plan(rig, (Row(rig, 3),), warm_up=2, scene=scene), 5, 5)
    folder.start()
    return folder


def page_of(path, capsys, **options):
    capsys.readouterr()
    assert report(path, output=FileOutput(json=True, force=True), **options) == 0
    result = json.loads(capsys.readouterr().out)
    return result, unescape(Path(result["path"]).read_text(encoding="utf-8"))


def test_an_incomplete_session(started, write_session, capsys):
    """Interrupted presses, other sessions and damaged files are warnings at the top."""
    scene = load_scene("ideal").model_dump_json()
    own = {"session": started.session, "scene": scene, "seed": 5}
    write_session(started.path, 1, warm_up=True, **own)
    write_session(started.path, 2, first=2, **own)
    write_session(started.path, 1, first=8, session="another")
    (started.path / "press-0009.mcap.part").write_bytes(b"")
    damaged = started.path / "press-0010.mcap"
    damaged.write_bytes((started.path / "press-0002.mcap").read_bytes()[:20_000])
    (started.path / "fit-1.json").write_text("{}")
    result, page = page_of(started.path, capsys)
    assert (result["presses"], result["simulated"]) == (3, True)
    assert list(result["left_out"]) == [str(damaged)]
    for warning in (
        "2 of 3 planned presses are on this page",
        "1 recordings in the folder are from other sessions",
        "press-0009.mcap.part is from",
        "press-0010.mcap could not be read",
        "fit-1.json: parameters: Field required",
    ):
        assert warning in page.split("Setup</h2>")[0]
    assert "sautereau press rig.toml -n 3 --warm-up 2 --scene ideal --seed 5 --out AGAIN" in page
    assert "sautereau report 'it'\"'\"'s; an evening'" in page


def test_a_folder_without_a_manifest(write_session, tmp_path, capsys):
    write_session(tmp_path, 2)
    result, page = page_of(tmp_path, capsys, out=tmp_path / "deep" / "page.html")
    assert result["path"] == str(tmp_path / "deep" / "page.html")
    assert "AGAIN" not in page


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"plectrum": "elastica"}, "ideal"),
        ({"plectrum": "beam"}, "scene.toml"),
        ({"step": 7e-4}, "scene.toml"),
    ],
)
def test_the_scene_is_on_the_page_and_a_packaged_one_is_named(
    started, write_session, capsys, changes, named
):
    scene = load_scene("ideal").model_copy(update=changes).model_dump_json()
    write_session(started.path, 3, session=started.session, scene=scene)
    _, page = page_of(started.path, capsys)
    assert f"--scene {named} " in page
    assert scene in page


def test_an_unreadable_plan_is_a_warning(started, write_session, capsys):
    write_session(started.path, 3, session=started.session)
    manifest = started.path / MANIFEST
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {"plan": {}}))
    _, page = page_of(started.path, capsys)
    assert f"{MANIFEST}: its plan cannot be read (KeyError: 'presses')" in page


def test_a_folder_without_recordings_is_refused(started, tmp_path):
    for path in (started.path, tmp_path / "nowhere", started.path / MANIFEST):
        with pytest.raises((AnalysisError, RobotError), match="give"):
            report(path)


def test_a_page_is_overwritten(write_session, tmp_path, capsys):
    write_session(tmp_path, 1)
    _, first = page_of(tmp_path, capsys)
    shutil.copy(tmp_path / "press-0001.mcap", tmp_path / "press-0002.mcap")
    _, second = page_of(tmp_path, capsys)
    assert "1 press on rig" in first
    assert "2 presses on rig" in second


def test_missing_packages_are_named(write_session, tmp_path, monkeypatch):
    write_session(tmp_path, 1)
    monkeypatch.setitem(sys.modules, "plotly", None)
    with pytest.raises(MissingExtraError, match=r"plotly; .*pip install 'sautereau\[report\]'"):
        report(tmp_path)


@pytest.mark.slow
def test_the_command_on_the_page_repeats_the_session(rig_file, tmp_path, monkeypatch, capsys):
    """Its rig file and its command give the same volts to the bit."""

    def run(words):
        assert app(words, print_error=False, exit_on_error=False) in (0, None)

    monkeypatch.chdir(tmp_path)
    options = "--scene ideal -n 1 --seed 11 --out first --json"
    run(["press", str(rig_file()), *options.split()])
    _, page = page_of(tmp_path / "first", capsys)
    rig = page.split('<pre id="rig-toml">')[1].split("</pre>")[0]
    (tmp_path / "rig.toml").write_text(rig, encoding="utf-8")
    (command,) = [line for line in page.splitlines() if "sautereau press rig.toml" in line]
    words = command.removeprefix("<pre>").removesuffix("</pre>").split()
    run(words[1:])
    one, two = (
        read_recording(tmp_path / folder / "press-0001.mcap").volts for folder in ("first", "AGAIN")
    )
    assert one.keys() == two.keys()
    for name, volts in one.items():
        assert volts.tobytes() == two[name].tobytes()


def test_its_own_page_is_replaced_and_a_changed_one_is_not(write_session, tmp_path, sautereau):
    write_session(tmp_path / "evening", 1)
    for _ in range(2):
        assert sautereau("report", "evening").returncode == 0
    page = tmp_path / "evening" / "report.html"
    page.write_text(page.read_text(encoding="utf-8") + "<p>my note</p>", encoding="utf-8")
    done = sautereau("report", "evening")
    assert done.returncode == 1
    assert "--force" in done.stderr

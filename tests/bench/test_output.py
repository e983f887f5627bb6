"""What commands print and write besides their results: logs, progress, files that exist."""

import json
import os
import re
import shutil
import sys
from datetime import datetime
from inspect import signature
from io import BytesIO, TextIOWrapper
from pathlib import Path

import pytest

from sautereau.commands.app import app, main
from sautereau.commands.common import Dated
from sautereau.commands.output import FileOutput, Output
from sautereau.rig.errors import SautereauError
from sautereau.rig.progress import progress_to, tracked
from sautereau.robot.errors import RobotError

COMMANDS = [name for name in app if not name.startswith("-")]
WRITES = {
    "init": "my-rig.toml", "plan": "--plot p.png --out p.json", "mount": "--plot p.png",
    "acquire": "--sim --out a.mcap", "learn": "--sim --out s", "phases": "s --plot p.png",
    "predict": "--plot p.png", "compare": "s --plot p.png", "transient": "s --plot p.png",
    "identify": "s --free key.inertia --out r.toml", "animate": "s/press-0001.mcap --out p.gif",
    "listen": "--out a.wav",
    "outline": "a.png --plot p.png", "voice": "--target work=1 --plot p.png",
    "effects": "s --plot p.png",
    "survey": "keys.csv --plot p.png", "touch": "c.parquet --plot p.png", "report": "s",
    "package": "s",
    "recover": "s/press-0001.mcap", "export": "s/press-0001.mcap --to csv",
    "split": "a.mcap --out s", "import": "a.csv --rig paper --out a.mcap", "trade": "--plot p.png",
}  # fmt: skip
"""Options with which each command writes files."""
WRITTEN = {
    "my-rig.toml", "p.png", "p.json", "p.gif", "a.mcap", "a.wav", "r.toml", "s/learned.json",
    "s/report.html", "s.zip",
    "s/press-0001.mcap", "s/press-0001-recovered.mcap", "s/press-0001.csv.json",
    "s/a-0001.mcap",
}  # fmt: skip


def test_every_command_has_the_general_options():
    for name in COMMANDS:
        command = app[name].default_command
        output = signature(command).parameters["output"].default
        assert isinstance(output, FileOutput) == (name in WRITES), name
        assert isinstance(output, Output)


@pytest.mark.parametrize("command", WRITES)
def test_existing_files_are_refused_alike(tmp_path, monkeypatch, command):
    """Before anything is done: none of the inputs exists."""
    monkeypatch.chdir(tmp_path)
    for name in WRITTEN:
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("precious")
    with pytest.raises(SautereauError, match="already exists; give another name, or --force"):
        app([command, *WRITES[command].split()], exit_on_error=False, print_error=False)
    assert {p.read_text() for p in tmp_path.rglob("*") if p.is_file()} == {"precious"}


def test_a_name_of_today_is_free_of_a_recording_that_was_cut_off(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    first = Dated("acquire-DATE.mcap").today()
    Path(f"{first}.part").touch()
    second = Dated("acquire-DATE.mcap").today()
    second.touch()
    third = Dated("acquire-DATE.mcap").today()
    assert (second.stem, third.stem) == (f"{first.stem}-2", f"{first.stem}-3")


def test_force_replaces_a_file_only_by_a_complete_one(sautereau, rig_file, tmp_path):
    plan = tmp_path / "plan.json"
    plan.write_text("precious")
    rig = rig_file(dip='"7 mm"')
    assert sautereau("plan", rig, "--out", "plan.json", "--force").returncode == 1  # not feasible
    assert plan.read_text() == "precious"
    assert sautereau("init", rig, "--force").returncode == 0
    assert sautereau("plan", rig, "--out", "plan.json", "--force").returncode == 0
    assert json.loads(plan.read_text())["steps"]
    assert {path.name for path in tmp_path.iterdir()} == {"plan.json", "rig.toml"}


def test_the_log_holds_steps_commands_to_the_controller_and_errors(sautereau, bare, rig_file):
    log, rig = bare.parent / "press.log", rig_file()
    press = ("press", rig, "--scene", bare, "--out", "out", "--log", log)
    quiet = sautereau(*press, "--quiet")
    assert (quiet.returncode, quiet.stdout, quiet.stderr) == (0, "", "")
    first = log.read_text(encoding="utf-8")
    dated = re.match(r"(\S+ \S+)Z INFO sautereau: sautereau \S+: press ", first)
    assert dated
    datetime.fromisoformat(dated[1])
    assert re.search(r"INFO .*monitor: press 1: arm armed, acquisition armed", first)
    assert re.search(r"DEBUG .*serial_port: \S+ sent b'.*\\r'", first)
    assert re.search(r"DEBUG .*serial_port: \S+ received b'.*:'", first)
    shown = sautereau(*press, "--json", "--verbose")
    assert "reading recordings" in shown.stderr
    failed = sautereau("plan", "none", "--log", log)
    assert failed.stderr.count("\n") == 1
    text = log.read_text(encoding="utf-8")
    assert text.startswith(first)
    assert "RigError: " in text.splitlines()[-1] + text
    assert "cannot be written" in sautereau("plan", "--log", log / "log").stderr


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="limits of a process are POSIX's")
@pytest.mark.parametrize("options", [("--json",), (), ("--quiet",)])
def test_a_log_without_room_is_one_warning_beside_the_result(
    sautereau, command_server, bare, rig_file, tmp_path, options
):
    """The press continues, and its recording is complete."""
    log, most = tmp_path / "press.log", 50_000_000
    log.touch()
    os.truncate(log, most)  # without a block of the disk
    press = ("press", rig_file(), "--scene", bare, "--out", "out", "--log", log, *options)
    done = command_server.run(*press, folder=tmp_path, largest_file=most)
    assert done.returncode == 0
    assert log.stat().st_size == most
    assert (tmp_path / "out" / "press-0001.mcap").exists()
    shown = done.stdout + done.stderr
    assert shown.count("--log") == 1
    assert "Traceback" not in shown
    if options == ("--json",):
        assert str(log) in json.loads(done.stdout)["warnings"][-1]
        assert not done.stderr
    failed = command_server.run("plan", "none", "--log", log, folder=tmp_path, largest_file=most)
    assert failed.returncode == 1
    assert "'none'" in failed.stderr.splitlines()[0]
    assert failed.stderr.count("--log") == 1


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes with a name are POSIX's")
def test_a_log_is_a_regular_file(sautereau, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with open(os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK), "rb") as read:  # noqa: PTH123
        for name, why in (("pipe", "not a regular"), ("/dev/full", "not a regular"), (".", "dir")):
            refused = sautereau("plan", "--log", name)
            assert (refused.returncode, refused.stdout) == (1, "")
            assert why in refused.stderr
        read.close()
        assert "not a regular" in sautereau("plan", "--log", "pipe").stderr


@pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are POSIX's")
def test_progress_has_a_label_and_an_estimate_on_a_terminal_only(monkeypatch, capfd):
    """Lines of results stay on standard output, also while a bar is shown."""
    master, slave = os.openpty()
    with os.fdopen(master, "rb") as terminal, os.fdopen(slave, "w") as stderr:
        monkeypatch.setattr(sys, "stderr", stderr)
        monkeypatch.setenv("TERM", "xterm")
        with Output().progress("counting"):
            for number in tracked(range(4)):
                Output().say(f"result {number}")
        with Output(quiet=True).progress("nothing") as show:
            show(1.0)
        stderr.write("end")
        stderr.flush()
        shown = ""
        while not shown.endswith("end"):
            shown += os.read(terminal.fileno(), 1 << 16).decode()
    assert "counting" in shown
    assert "nothing" not in shown
    assert re.search(r"\d:\d\d:\d\d", shown)
    assert capfd.readouterr().out == "".join(f"result {number}\n" for number in range(4))


def test_progress_of_parts_is_part_of_the_progress():
    shown = []
    with progress_to(shown.append):
        for _ in tracked(range(2)):
            for _ in tracked("ab"):
                pass
    assert shown == [0.25, 0.5, 0.5, 0.75, 1.0, 1.0]
    assert list(tracked("ab")) == ["a", "b"]


def test_folders_that_cannot_be_written_are_all_reported_first(sautereau, tmp_path):
    (tmp_path / "file").touch()
    done = sautereau("plan", "--plot", "file/a.png", "--out", "file/b/c.json")
    assert (done.returncode, done.stdout) == (1, "")
    assert "folder file: it cannot be made" in done.stderr
    assert "folder file/b: it cannot be made" in done.stderr
    assert sautereau("plan", "--out", "d/e/f.json").returncode == 0
    assert (tmp_path / "d" / "e" / "f.json").is_file()


@pytest.mark.parametrize("words", ["phases a.mcap b.mcap", "compare a.mcap --against b.mcap"])
def test_all_missing_recordings_are_reported(sautereau, words):
    done = sautereau(*words.split())
    assert done.returncode == 1
    assert "a.mcap: there is no such file" in done.stderr
    assert "b.mcap: there is no such file" in done.stderr


@pytest.fixture
def damaged(ideal, tmp_path):
    """Names of two recordings that end too early, and of one between them that is complete."""
    whole = ideal[0][0]
    for name in ("a.mcap", "c.mcap"):
        (tmp_path / name).write_bytes(whole.read_bytes()[:20_000])
    shutil.copy(whole, tmp_path / "b.mcap")
    return ["a.mcap", "b.mcap", "c.mcap"]


@pytest.mark.parametrize("words", ["phases", "export --to urdf"])
def test_damaged_recordings_are_reported_with_the_results_of_the_others(sautereau, damaged, words):
    command, *options = words.split()
    done = sautereau(command, *damaged, *options, "--json")
    assert done.returncode == 1
    message = json.loads(done.stderr)["error"]["message"]
    found = json.loads(done.stdout)
    assert len(found["files"]) == 1
    assert [fault.split(":")[0] for fault in found["faults"]] == [
        "recording a.mcap", "recording c.mcap",
    ]  # fmt: skip
    assert message.split("\n") == found["faults"]


@pytest.mark.parametrize(
    "words",
    ["compare", "compare b.mcap --against", "identify --free key.inertia", "transient", "phases"],
)
def test_all_damaged_recordings_are_named_where_there_is_no_result(sautereau, damaged, words):
    done = sautereau(*words.split(), *(name for name in damaged if name != "b.mcap"), "--json")
    assert (done.returncode, done.stdout) == (1, "")
    message = json.loads(done.stderr)["error"]["message"]
    assert all(f"recording {name}: it is truncated" in message for name in ("a.mcap", "c.mcap"))


def test_characters_that_the_output_lacks_are_escaped(monkeypatch):
    monkeypatch.setattr("sys.stdout", TextIOWrapper(BytesIO(), "ascii"))
    Output().answer({}, ["rig file: ü.toml"])
    assert sys.stdout.buffer.getvalue() == b"rig file: \\xfc.toml\n"


@pytest.mark.parametrize("command", [name for name in WRITES if name != "init"])
def test_read_only_folders_are_refused_before_the_work(tmp_path, monkeypatch, command):
    """No input can be read: what is refused is the folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s").mkdir()
    (tmp_path / "s/press-0001.mcap").touch()
    monkeypatch.setattr("sautereau.commands.output._writable", lambda folder: False)
    with pytest.raises(SautereauError, match="no permission to write into it"):
        app([command, *WRITES[command].split()], exit_on_error=False, print_error=False)
    assert {p.name for p in tmp_path.rglob("*")} == {"s", "press-0001.mcap"}


def test_an_error_in_clearing_up_does_not_replace_the_first_one(monkeypatch, capsys):
    def clear_up(**_):
        try:
            raise RobotError("the first cause")
        finally:
            (Path("/nowhere") / "file").unlink()

    monkeypatch.setattr("sautereau.commands.app.app", clear_up)
    monkeypatch.setattr(sys, "argv", ["sautereau"])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 1
    first, second = capsys.readouterr().err.splitlines()
    assert first == "sautereau: the first cause"
    assert second.endswith("then: /nowhere/file: No such file or directory")


def test_init_again_is_no_fault_unless_the_file_was_changed(tmp_path):
    for _ in range(2):  # killed just after it had written the file
        app(["init", str(tmp_path / "a.toml")], exit_on_error=False, print_error=False)
        assert [path.name for path in tmp_path.iterdir()] == ["a.toml"]
        (tmp_path / ".a.toml.0123abcd.new").hardlink_to(tmp_path / "a.toml")
    (tmp_path / "a.toml").write_text((tmp_path / "a.toml").read_text() + "# mine\n")
    with pytest.raises(SautereauError, match="already exists"):
        app(["init", str(tmp_path / "a.toml")], exit_on_error=False, print_error=False)

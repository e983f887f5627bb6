"""The command line as scripts use it: JSON keys, exit statuses, one message per fault."""

import errno
import json
import os
import re
import signal
import subprocess
import sys
from datetime import date
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from sautereau.commands.app import UNREAD, app, main
from sautereau.rig.load import load_rig
from sautereau.robot.experiment.session_folder import LOCK
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.scene import load_scene
from sautereau.trajectory.arm import joints_holding_point
from sautereau.trajectory.motion import Motion
from tests.budget import slow
from tests.pages import read_page

PIPES = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}


def refused(done: subprocess.CompletedProcess, *words: str) -> None:
    """Check that a command ended with 1, and one message that contains all these words."""
    assert done.returncode == 1, done.stderr
    if "--json" in done.args:
        assert json.loads(done.stderr)["error"]["status"] == 1
    else:
        assert done.stderr.count("sautereau: ") == 1
    assert "Traceback" not in done.stderr
    for word in words:
        assert word in done.stderr


def test_help_imports_nothing_heavy(tmp_path):
    probe = (
        "import sys\nfrom sautereau.commands.app import app\n"
        "try: app(['--help'])\n"
        "finally: print(*[m for m in ('pandas', 'matplotlib', 'pymunk', 'nidaqmx', 'numpy',"
        " 'scipy', 'pint', 'pydantic') if m in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True)
    assert done.stderr.strip() == ""
    assert "stand-in" in done.stdout


def test_an_infeasible_plan_is_reported_and_plotted_but_not_written(sautereau, rig_file, tmp_path):
    path = rig_file(dip='"7 mm"')
    done = sautereau("plan", path, "--json", "--out", "plan.json", "--plot", "plan.png")
    refused(done, "depth of the key", "press.jack_rise")
    assert json.loads(done.stdout)["feasible"] is False
    assert (tmp_path / "plan.png").exists()
    assert not (tmp_path / "plan.json").exists()


def test_mount_locates_the_base_from_touches(sautereau, tmp_path):
    rig = load_rig()
    marks = np.array([-0.180, -0.165, -0.150])
    centres = np.stack([marks, np.full(3, rig.key.surface_height + 4e-3)], -1)
    still = np.zeros_like(centres)
    joints = joints_holding_point(rig.arm, Motion(centres, still, still)).position
    rows = [f"{m * 1e3},{a},{b}" for m, (a, b) in zip(marks, np.degrees(joints), strict=True)]
    table = "\n".join(["point [mm], joint1 [deg], joint2 [deg]", *rows])
    (tmp_path / "touches.csv").write_text(table)
    done = sautereau("mount", "--touches", "touches.csv", "--trust-homing", "--json")
    located = json.loads(done.stdout)["located"]
    assert located["base_x"] == pytest.approx(rig.arm.base_x, abs=1e-9)
    assert located["base_z"] == pytest.approx(rig.arm.base_z, abs=1e-9)
    (tmp_path / "touches.csv").write_text("point,joint1\n1,2\n")
    refused(sautereau("mount", "--touches", "touches.csv"), "joint2", "touches.csv")


def test_one_key_more_needs_a_bench_and_an_instrument(sautereau, tmp_path):
    assert sautereau("init", "bench.toml", "--bench").returncode == 0
    done = sautereau("init", "a4.toml", "--instrument", "--base", "bench.toml")
    assert done.returncode == 0, done.stderr
    found = json.loads(sautereau("info", "a4.toml", "--json").stdout)
    assert found["bases"] == ["bench.toml"]
    assert {"key": "name", "value": "a4", "base": None} in found["differences"]
    assert not any(each["key"].startswith("arm.") for each in found["differences"])
    assert load_rig(tmp_path / "a4.toml").arm == load_rig().arm
    refused(
        sautereau("info", "bench.toml"), "bench.toml: 5 faults", "key: missing", "name: missing"
    )
    assert sautereau("init", "b.toml", "--base", "paper").returncode == 2
    refused(sautereau("init", "b.toml", "--instrument", "--base", "x.toml"), "x.toml")
    assert not (tmp_path / "b.toml").exists()


def test_press_phases_compare_info_on_the_stand_in(sautereau, rig_file, tmp_path):
    words = ("--scene", "ideal", "-n", 2, "--seed", 3, "--warm-up", 0, "--out", "out", "--json")
    made = sautereau("press", rig_file(), *words)
    assert made.returncode == 0, made.stderr
    result = json.loads(made.stdout)
    assert result["simulated"] is True
    assert result["seed"] == 3
    assert all(0.025 < press["contact"] < press["release"] for press in result["presses"])
    assert (tmp_path / result["picture"]).read_bytes().startswith(b"\x89PNG")

    found = json.loads(sautereau("phases", *result["recordings"], "--json").stdout)
    assert len(found["files"]) == 2
    assert found["files"][0]["plucks"][0]["contact"] == result["presses"][0]["contact"]

    compared = json.loads(sautereau("compare", *result["recordings"], "--json").stdout)
    for key in ("slope_error", "magnitude_error", "duration_error"):
        low, high = compared[key]["ci95"]
        assert low < compared[key]["value"] < high

    assert compared["conditions"] == result["conditions"]  # to the last digit
    pair = sautereau("compare", result["recordings"][0], "--against", "out", "--json")
    assert "release_force" in json.loads(pair.stdout)["against"][0]["differences"]
    watched = json.loads(sautereau("watch", "out", "-n", 2, "--json").stdout)
    assert watched["conditions"] == compared["conditions"]
    words = ("replay", result["recordings"][0], rig_file(), "--scene", "ideal", "--warm-up", 0)
    again = sautereau(*words, "--out", "again")
    assert "Model error" in again.stdout
    shown = read_page("first-press.md").bodies("console")[0].splitlines()
    assert "\n".join(shown[2:8]) in again.stdout

    done = sautereau("compare", result["recordings"][0], "--plot", "figure.svg")
    assert "SIMULATED" in done.stdout
    assert "simulated" in (tmp_path / "figure.svg").read_text()


def test_a_press_is_heard(sautereau, tmp_path):
    done = sautereau("listen", "--out", "pluck.wav", "--duration", "300 ms", "--json")
    result = json.loads(done.stdout)
    assert (result["sample_rate"], result["duration"]) == (48_000, pytest.approx(0.3))
    assert 0.1 < result["full_scale"] < 1.0
    assert (tmp_path / "pluck.wav").stat().st_size > 2 * 14_400


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("frobnicate", 'Unknown command "frobnicate"'),
        ("plan --nonsense", "Unknown option: --nonsense"),
        ("plan paper paper", "Unexpected argument: paper"),
        ("press --sim --out", "Missing value of option: --out FOLDER"),
        ("press --sim --out out -n many", "'many' is not an integer"),
        ("press --sim --out out -n 2.5", "'2.5' is not an integer"),
        ("predict --level wood", "Plectrum level 'wood' is unknown"),
        ("press --sim --out out --rest 2_mm", "'2_mm'"),
        ("press --sim --out out --seed -1", 'Invalid value "-1" for --seed. Must be >= 0.'),
        ("press --sim --out out -n 0", 'Invalid value "0" for -n. Must be > 0.'),
        ("press --sim --out out --warm-up -1", "Must be >= 0."),
        ("watch . -n -1", "Must be > 0."),
        ("acquire --sim --out a.mcap --duration 0s", "for --duration. Must be > 0."),
        ("acquire --sim --out a.mcap --duration", "of option: --duration QUANTITY"),
        ("identify a.mcap --free key.inertia,overlap", "did you mean 'plectrum.overlap'?"),
        ("identify a.mcap --free key.inertia,key.inertia", "key.inertia: given twice"),
        ("identify a.mcap --free ,", "no parameter is free"),
        ("identify a.mcap --free plectrum.overlap --starts 0", "Must be > 0."),
        ("identify a.mcap --free plectrum.overlap --prior plectrum.overlap", "expected a key"),
        ("transient a.mcap --known key", 'write it like "key=350 Hz"'),
        ("animate a.mcap --out a.gif --slow nan", "Must be > 0."),
        ("animate a.mcap --out a.gif --since 60", "has no unit"),
        ("animate a.mcap --out a.gif --since 3kg", "--since"),
        ("animate a.mcap --out a.txt", "extension .txt; use .gif, .mp4."),
        ("listen --out a.mp3", "extension .mp3; use .wav."),
        ("listen --out a.wav --quality 0", "Must be > 0."),
        ("campaign . --out a.csv", "extension .csv; use .parquet."),
        ("campaign . --out a.parquet --processes 0", "Must be > 0."),
        ("phases", "Missing argument: FILES"),
        ("identify a.mcap", "Missing option: --free NAMES"),
        ("export a.mcap", "Missing option: --to parquet|csv"),
        ("setup port my-rig.toml", "give the rig first, `sautereau setup my-rig.toml STEP`"),
        ("replay", "Missing argument: [RIG] RECORDING"),
        ("setup", "give --yes"),
        ("plan --plot plan.foo", "file extension .foo"),
        ("plan --bench bench", "no file extension"),
        ("import a.csv --rig paper --out a.csv", "file extension .csv; use .mcap"),
        ("export a.mcap --to urdf --raw", "--raw: a URDF contains no samples"),
        ("mount --trust-homing", "--trust-homing: it concerns --touches FILE"),
        ("identify a.mcap --strts 3", "--strts. Did you mean --starts?\nSee"),
        ("campaign runs --ot a.parquet", "Unknown option: --ot"),
        ("press --sim --repeats 3", "Unknown option: --repeats. Did you mean -n?"),
        ("press --simulate", "Unknown option: --simulate. Did you mean --sim?"),
        ("export a.mcap --format csv", "Did you mean --to?"),
    ],
)
def test_wrong_usage_ends_with_two(refusal, tmp_path, words, message):
    done = refusal(*words.split(), "--json")
    error = json.loads(done.stderr)["error"]
    assert (done.returncode, done.stdout, error["status"]) == (2, "", 2)
    assert message in error["message"]
    assert not any(tmp_path.iterdir())


def test_the_text_of_wrong_usage_is_the_message_in_json(refusal):
    done, as_json = (refusal("plan", "paper", "paper", *more) for more in ((), ("--json",)))
    assert (done.returncode, done.stdout) == (2, "")
    message = json.loads(as_json.stderr)["error"]["message"]
    assert done.stderr == f"sautereau: {message}\n"


KINDS = (
    ("press --sim --table a.mcap", "--table", "a recording", "a CSV file of presses"),
    ("press --sim --feed-forward rig.toml", "--feed-forward", "a rig or scene file", "a recording"),
    ("plan --learned a.mcap", "--learned", "a recording", "the learned.json"),
    ("mount --touches a.mcap", "--touches", "a recording", "a CSV file"),
    ("predict --fit rig.toml", "--fit", "a rig or scene file", "the JSON of identify"),
    ("report a.mcap", "SESSION", "a recording", "a folder"),
    ("watch rig.toml", "FOLDER", "a rig or scene file", "a folder"),
    ("campaign a.mcap", "FOLDER", "a recording", "a folder"),
    ("touch a.mcap", "FILE", "a recording", "a table of `sautereau campaign`"),
    ("survey a.mcap", "FILE", "a recording", "a table of keys"),
    ("outline rig.toml", "PHOTO", "a rig or scene file", "a photograph"),
    ("recover rig.toml", "FILE", "a rig or scene file", "a recording"),
)


@pytest.mark.parametrize(("words", "argument", "kind", "instead"), KINDS)
def test_a_file_of_the_wrong_kind_is_recognised(refusal, tmp_path, words, argument, kind, instead):
    for name in ("a.mcap", "rig.toml"):
        (tmp_path / name).write_bytes(b"")
    done = refusal(*words.split())
    assert done.returncode == 2
    message = " ".join(done.stderr.split())
    assert argument in message
    assert f"It is {kind}; give {instead}" in message


def test_a_scene_and_a_rig_are_distinguished(sautereau, bare):
    rig = str(files("sautereau.rig").joinpath("paper.toml"))
    for command in ("plan", "doctor"):
        refused(sautereau(command, bare), "it is a scene, not a rig; give the file of a rig")
    done = sautereau("press", "--scene", rig, "--out", "out")
    refused(done, "it is a rig, not a scene; give the file of a scene")


def test_the_rig_comes_first_and_the_other_order_is_understood(sautereau, tmp_path):
    (tmp_path / "keys.csv").write_text("key,string.length [mm]\na,600\nb,700\n")
    words = ("--level", "beam", "--json")
    good = sautereau("survey", "paper", "keys.csv", *words)
    assert (good.returncode, good.stderr) == (0, "")
    swapped = sautereau("survey", "keys.csv", "paper", *words[:2])
    assert swapped.returncode == 0
    assert "give them as `sautereau survey paper keys.csv`" in " ".join(swapped.stderr.split())
    alone = sautereau("survey", "keys.csv", *words)
    assert json.loads(alone.stdout) == json.loads(good.stdout)
    home = ("--sim", "--seed", 1, "--yes", "--json")
    both = [sautereau("setup", *given, *home).stdout for given in (("paper", "home"), ("home",))]
    assert json.loads(both[0]) == json.loads(both[1])


def test_swapped_arguments_get_advice_and_the_press_is_repeated(sautereau, tmp_path, bare):
    words = ("--scene", bare, "--warm-up", 0, "--seed", 1)
    assert sautereau("press", "paper", *words, "--out", "one").returncode == 0
    made = "one/press-0001.mcap"
    swapped = sautereau("replay", made, "paper", *words, "--out", "two")
    assert swapped.returncode == 0
    said = " ".join(swapped.stderr.split())
    assert f"{made} is a recording, paper is a rig: give them as" in said
    assert f"`sautereau replay paper {made}`" in said


def test_without_out_a_new_dated_name_is_used_and_nothing_is_replaced(sautereau, tmp_path, bare):
    today = date.today().isoformat()
    words = ("--scene", bare, "--warm-up", 0, "--seed", 1)
    (tmp_path / f"press-{today}").mkdir()
    done = sautereau("press", *words)
    assert done.returncode == 0, done.stderr
    assert f"recordings go to press-{today}-2\n" in done.stdout
    assert (tmp_path / f"press-{today}-2" / "press-0001.mcap").is_file()
    for number in ("", "-2"):
        done = sautereau("listen", "--duration", "50 ms", "--json")
        assert json.loads(done.stdout)["path"] == f"listen-{today}{number}.wav"
    same = sautereau("press", *words, "-n", 2, "--out", f"press-{today}-2")
    assert "1 of 2 presses are in" in same.stdout
    assert len([path for path in tmp_path.iterdir() if today in path.name]) == 4


def test_rare_options_are_shown_by_help_all_alone(sautereau):
    few, all_ = (sautereau("identify", option).stdout for option in ("--help", "--help-all"))
    assert "--starts" not in few
    assert "--starts" in all_
    assert "--free" in few
    assert "--help-all" in few


TOO_LONG = "none" * 99  # as the name of a file
ERRORS = (
    f"init {TOO_LONG}", "setup none all --yes", "plan none", "mount none", "predict none",
    "survey none.csv",
    "press none --out out", "learn none --out out", "acquire none --out a.mcap",
    "phases none.mcap", "compare none.mcap", "identify none.mcap --free key.inertia",
    "animate none.mcap --out a.gif", "listen none --out a.wav", "report none",
    "effects none", "package none",
    "campaign none --out a.parquet", "touch none.parquet", "survey none.csv",
    "info none.mcap", "recover none.mcap",
    "export none.mcap --to csv", "import none.csv --rig paper --out a.mcap", "stand-in none",
    "outline none.png", "voice none", "trade none", "doctor none", "transient none.mcap",
    "split none.mcap --out out",
    "replay none.mcap --sim --out out", "watch none",
)  # fmt: skip


def test_errors_of_every_command_are_json_under_json(refusal):
    assert {words.split()[0] for words in ERRORS} == {n for n in app if not n.startswith("-")}
    for words in ERRORS:
        done = refusal(*words.split(), "--json")
        assert (done.returncode, done.stdout) == (1, ""), words
        error = json.loads(done.stderr)["error"]
        assert error["status"] == 1
        assert "none" in error["message"]


def _following(error: Exception, interrupt: KeyboardInterrupt) -> Exception:
    error.__context__ = interrupt
    return error


@pytest.mark.parametrize(
    ("error", "message", "status"),
    [
        (KeyboardInterrupt(), "interrupted\nthe arm is off", 130),
        (KeyboardInterrupt("SIGTERM"), "interrupted\nthe arm is off", 143),
        (RuntimeError("oh"), "bug: RuntimeErr", 1),
        (MemoryError("allocate 1 GiB"), "not enough memory (allocate 1 GiB); a recording", 1),
        # A compiled module while it is loaded, and a progress bar whose terminal is closed:
        (_following(ImportError("failed"), KeyboardInterrupt()), "interrupted", 130),
        (_following(OSError(errno.EIO, "I/O"), KeyboardInterrupt("SIGHUP")), "interrupted", 129),
        (_following(OSError(errno.ENOSPC, "full"), KeyboardInterrupt()), "[Errno 28] full", 1),
    ],
)
def test_interrupts_and_bugs_are_json_under_json(monkeypatch, capsys, error, message, status):
    def fail(**_):
        error.add_note("the arm is off")
        raise error

    monkeypatch.setattr("sautereau.commands.app.app", fail)
    monkeypatch.setattr("sautereau.commands.running.ignore_signals", lambda: None)
    monkeypatch.setattr(sys, "argv", ["sautereau", "press", "--json"])
    with pytest.raises(SystemExit, match=str(status)):
        main()
    answer = json.loads(capsys.readouterr().err)
    assert (answer["schema"], answer["error"]["status"]) == (1, status)
    assert answer["error"]["message"].startswith(message)


def test_faults_of_rig_and_scene_are_reported_together(refusal):
    for words in ("press none --scene nothing --out out", "stand-in nothing --rig none"):
        refused(refusal(*words.split()), "rig 'none' is neither", "scene 'nothing' is neither")


def test_a_packaged_rig_does_not_move_the_hardware(sautereau, tmp_path):
    for command in ("press", "learn"):
        done = sautereau(command, "--out", "out")
        refused(done, "rig 'paper'", "only with a rig file of your own", "sautereau init")
    assert not (tmp_path / "out").exists()


@pytest.fixture
def stand_in(bare):
    """The scene `bare` in this process, for a command line in another."""
    with StandIn(load_rig(), load_scene(str(bare))) as served:
        yield served
        assert served.bench.firmware.motors_on == (False, False)


def test_the_hardware_path_against_a_served_stand_in(sautereau, rig_file, stand_in):
    path = rig_file(port=f'"{stand_in.serial_port}"', address=f'"{stand_in.daq_address}"')
    done = sautereau("press", path, "--warm-up", 0, "--out", "out")
    assert done.returncode == 0, done.stderr
    assert "simulated" in done.stdout


def test_a_full_disk(command_server, tmp_path, bare, rig_file):
    words = ("press", rig_file(), "--scene", bare, "--out", "out")
    done = command_server.run(*words, folder=tmp_path, largest_file=20_000)
    refused(done, "warm-up-01.mcap.part", "cannot be written")


@pytest.mark.parametrize(
    "number",
    [
        signal.SIGINT,
        slow(signal.SIGTERM),
        signal.SIGHUP,
        slow(signal.SIGUSR1),
        slow(signal.SIGXCPU),
    ],
)
def test_an_interrupted_session_leaves_a_safe_arm_and_complete_files(
    command_server, rig_file, tmp_path, stand_in, number
):
    path = rig_file(port=f'"{stand_in.serial_port}"', address=f'"{stand_in.daq_address}"')
    # The served vibrometer has no AC coupling, and with that of the rig the key does not return.
    words = ("press", path, "-n", 500, "--warm-up", 0, "--ignore-health", "--out", "out")
    pipes = {"stderr": subprocess.PIPE}
    with command_server.start(*words, cwd=tmp_path, stdout=subprocess.PIPE, **pipes) as process:
        assert process.stdout
        for line in process.stdout:
            if "press-0002" in line:
                break
        process.send_signal(number)
        _, message = process.communicate(timeout=100)
    assert process.returncode == 128 + number, message
    assert "interrupted" in message
    assert "Traceback" not in message
    assert stand_in.bench.firmware.motors_on == (False, False)
    for left in (tmp_path / "out").iterdir():
        assert left.suffix in (".mcap", ".json") or left.name == LOCK or left.name in message


@pytest.mark.slow
def test_a_session_whose_reader_ends_stops_and_says_that_the_motors_are_off(
    command_server, rig_file, tmp_path, bare
):
    words = ("press", rig_file(), "--scene", bare, "-n", 99, "--out", "out")
    with command_server.start(*words, cwd=tmp_path, **PIPES) as process:
        while "press-0001" not in process.stdout.readline():
            pass
        process.stdout.close()
        message = process.stderr.read()
    assert process.returncode == UNREAD
    assert "nothing reads the output" in message
    assert "motors are off" in message
    assert "Traceback" not in message


def test_where_nobody_reads_the_errors_either_the_terminal_shows_the_motors_state(
    command_server, rig_file, tmp_path, bare
):
    """As of `2>&1 | head`."""
    master, slave = os.openpty()
    program = f"""
import os, sys
from sautereau.commands.app import main
os.setsid()
os.open({os.ttyname(slave)!r}, os.O_RDWR)
sys.argv = ["sautereau", "press", {str(rig_file())!r}, "--scene", {str(bare)!r}, "-n", "9"]
sys.argv += ["--warm-up", "0", "--out", "out"]
main()
"""
    streams = PIPES | {"stderr": subprocess.STDOUT}
    with command_server.start("-c", program, cwd=tmp_path, **streams) as process:
        while "press-0001" not in process.stdout.readline():
            pass
        process.stdout.close()
        shown = os.read(master, 1 << 16).decode()
    os.close(master)
    os.close(slave)
    assert process.returncode == UNREAD
    assert "nothing reads the output" in shown
    assert "motors are off" in shown


@pytest.mark.parametrize("command", ["plan", "--help"])
def test_other_commands_end_silently_when_their_reader_does(command, command_server, tmp_path):
    with command_server.start(command, cwd=tmp_path, **PIPES) as process:
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == UNREAD


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is full")
def test_an_output_that_cannot_be_written_is_an_error(command_server, tmp_path):
    with (
        Path("/dev/full").open("wb") as full,
        command_server.start("plan", cwd=tmp_path, **PIPES | {"stdout": full}) as process,
    ):
        assert "standard output: cannot be written" in process.stderr.read()
    assert process.returncode == 1


def test_closed_streams_change_nothing(command_server, tmp_path):
    program = """
import sys
from sautereau.commands.app import main
sys.argv, sys.stdout, sys.stderr = ["sautereau", "plan"], None, None
main()
"""
    assert command_server.run("-c", program, folder=tmp_path).returncode == 0


def test_plain_clients_press_against_a_served_stand_in(command_server, tmp_path, sautereau):
    example = Path(__file__).parents[2] / "examples" / "plain_clients.py"
    assert not re.search(
        r"(?m)^\s*(from|import) (rig|robot|daq|trajectory|analysis|sim_)", example.read_text()
    )
    assert sautereau("plan", "--out", "plan.json").returncode == 0
    words = ("stand-in", "ideal", "--fast", "--json")
    with command_server.start(*words, stdout=subprocess.PIPE, cwd=tmp_path) as server:
        try:
            assert server.stdout
            text = ""
            while not text.rstrip().endswith("}"):
                text += server.stdout.readline()
            (tmp_path / "bench.json").write_text(text)
            done = subprocess.run(
                [sys.executable, example, "bench.json", "plan.json"],
                capture_output=True, text=True, cwd=tmp_path, timeout=60, check=False,
            )  # fmt: skip
            assert done.returncode == 0, done.stderr
            assert done.stdout.startswith("25600 samples")
            force = float(done.stdout.split()[-2])
            assert force == pytest.approx(0.728, rel=0.01)
        finally:
            server.send_signal(signal.SIGTERM)
            assert server.wait(timeout=60) == 0


@pytest.mark.slow
def test_learn_answers_the_keys_of_the_contract_and_its_correction_is_used(
    sautereau, rig_file, servo, tmp_path
):
    rig, scene = rig_file(), ("--scene", servo)
    command = ("learn", rig, *scene, "-n", 3, "--seed", 3, "--out", "out", "--json")
    done = sautereau(*command)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    first, _, last = made = result["rms_speed_error"]
    assert last < 0.01 < 0.05 < first
    assert len(result["recordings"]) == 3
    assert (tmp_path / "out" / "warm-up-01.mcap").exists()
    assert result["simulated"] is True
    assert Path(result["learned"]).name == "learned.json"
    refused(sautereau("learn", rig, *scene, "--out", "out"), "learned.json", "--force")

    (tmp_path / "out" / "press-0003.mcap").unlink()
    continued = json.loads(sautereau(*command, "--force").stdout)
    assert continued["rms_speed_error"][:2] == made[:2]
    assert (tmp_path / "out" / "warm-up-02.mcap").exists()  # the finger comes from above again
    assert [Path(path).name for path in continued["recordings"]] == [
        f"press-000{number}.mcap" for number in (1, 2, 3)
    ]
    assert continued["rms_speed_error"][2] < 0.01

    command = ("press", rig, *scene, "--learned", "out/learned.json", "--out", "again", "--json")
    done = sautereau(*command, "--seed", 9)
    assert done.returncode == 0, done.stderr
    speeds = json.loads(done.stdout)["presses"][0]["speeds"]
    assert speeds["held"] == pytest.approx(0.072, rel=0.02)  # 0.065 without
    refused(sautereau("press", rig, "--sim", "--learned", "none.json", "--out", "x"), "none.json")
    refused(sautereau("press", rig, *scene, "--out", "again"), "files.learned", "--out")
    other = rig_file(jack_speed='"0.08 m/s"')
    done = sautereau("press", other, "--sim", "--learned", "out/learned.json", "--out", "other")
    refused(done, "press.jack_speed", "0.072", "0.08", "learn again")

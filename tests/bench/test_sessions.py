"""Sessions that are interrupted in any way continue, and lose nothing."""

import csv
import hashlib
import json
import os
import random
import signal
import subprocess
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

import sautereau as st
from sautereau.analysis.loading.press import load_press
from sautereau.analysis.session.repeatability import repeatability
from sautereau.daq.file.reading import read_recording, read_session
from sautereau.rig.load import load_rig, with_values
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.experiment.session import Item, make_presses
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.scene import load_scene
from sautereau.trajectory.press import plan_press
from sautereau.trajectory.timing import press_law
from tests.budget import amount


def names(out: Path) -> list[str]:
    return sorted(path.name for path in out.iterdir())


def fingerprints(out: Path) -> dict[str, str]:
    return {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in out.glob("press-*")}


def kill_again_and_again(command_server, words, tmp_path, presses, kills, seed):
    """Run a command until it ends by itself; before that, kill it after random presses."""
    chance = random.Random(seed)
    points = sorted(chance.sample(range(presses), kills))
    out, made = tmp_path / "out", {}
    for point in points:
        with command_server.start(*words, cwd=tmp_path, stdout=subprocess.PIPE) as process:
            wait = max(0, point - len(list(out.glob("press-*.mcap"))))
            for line in process.stdout:
                if line.startswith("press "):  # the heading: the arm is about to move
                    break
            for _ in range(wait):
                process.stdout.readline()
            try:  # somewhere in the next press or in its analysis
                process.wait(timeout=chance.uniform(0, 0.6))
            except subprocess.TimeoutExpired:
                process.kill()
        now = fingerprints(out)
        assert made.items() <= now.items()  # nothing is lost, renamed or written again
        made = now
    done = command_server.run(*words, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    now = fingerprints(out)
    assert made.items() <= now.items()
    return out, done


def every_press_once(out, presses):
    recordings = sorted(out.glob("press-*.mcap"))
    read = [read_session(path) for path in recordings]
    assert Counter(s.item for s in read) == Counter(range(1, presses + 1))
    assert len({s.session for s in read}) == 1
    assert sorted(read, key=lambda s: s.press) == sorted(read, key=lambda s: s.item or 0)
    return recordings


@pytest.mark.parametrize(
    ("presses", "kills"),
    [
        (2, 1),
        pytest.param(
            amount(10, 1000), amount(3, 10), marks=[pytest.mark.slow, pytest.mark.timeout(7200)]
        ),
    ],
)
def test_killed_at_random_moments_and_resumed(
    command_server, sautereau, tmp_path, bare, rig_file, presses, kills
):
    words = ("press", rig_file(), "--scene", bare, "-n", presses, "--out", "out")
    out, done = kill_again_and_again(command_server, words, tmp_path, presses, kills, seed=presses)
    recordings = every_press_once(out, presses)
    for path in recordings:
        assert read_recording(path).n_samples > 1000
    for left in out.glob("*.part"):
        assert left.name in done.stdout
    assert len({read_session(path).seed for path in recordings}) >= min(kills, 2)
    again = sautereau(*words, "--json")
    assert json.loads(again.stdout)["left"] == 0
    assert every_press_once(out, presses) == recordings


@pytest.mark.slow
def test_a_killed_design_continues_and_takes_more_repeats(
    command_server, sautereau, tmp_path, bare, rig_file
):
    """No press is repeated, and none that was planned changes its place."""
    path = tmp_path / "design.toml"
    text = 'seed = 1\nrepeats = {}\n[factors]\npress.jack_speed = ["0.05 m/s", "0.06 m/s"]\n'
    path.write_text(text.format(2))
    words = ("press", rig_file(), "--scene", bare, "--design", path, "--out", "out")
    out, _ = kill_again_and_again(command_server, words, tmp_path, 4, 1, seed=4)
    every_press_once(out, 4)
    made = fingerprints(out)
    planned = json.loads((out / "session.json").read_text())["plan"]["presses"]
    path.write_text(text.format(3))
    done = sautereau(*words, "--json")
    assert done.returncode == 0, done.stderr
    assert made.items() <= fingerprints(out).items()
    now = json.loads((out / "session.json").read_text())["plan"]["presses"]
    assert (now[:4], len(now)) == (planned, 6)
    levels = [row["levels"] for row in now]
    for recording, level in zip(every_press_once(out, 6), levels, strict=True):
        read = read_recording(recording)
        assert read.session.levels == level
        assert f"{read.rig.press.jack_speed} m/s" == level["press.jack_speed"]
    with (out / "design.csv").open() as record:
        rows = list(csv.DictReader(record))
    assert [row["press.jack_speed"] for row in rows] == [x["press.jack_speed"] for x in levels]
    assert [row["recording"] for row in rows] == sorted(p.name for p in out.glob("press-*.mcap"))


@pytest.mark.slow
def test_a_recovered_fragment_is_not_a_press_of_the_session(sautereau, tmp_path, bare, rig_file):
    words = ("press", rig_file(), "--scene", bare, "-n", 2, "--out", "out", "--json")
    assert sautereau(*words).returncode == 0
    second = tmp_path / "out" / "press-0002.mcap"
    fragment = second.rename(f"{second}.part")
    with fragment.open("r+b") as file:
        file.truncate(fragment.stat().st_size // 2)
    assert sautereau("recover", fragment).returncode == 0
    answer = json.loads(sautereau(*words).stdout)
    assert answer["left"] == 0
    assert answer["recordings"] == ["out/press-0001.mcap", "out/press-0003.mcap"]
    assert "press-0002.mcap is not a complete press" in "".join(answer["warnings"])


def test_another_plan_in_the_same_folder_is_refused_with_the_differences(
    sautereau, tmp_path, bare, rig_file
):
    rig, out = rig_file(), ("--warm-up", 0, "--out", "out")
    assert sautereau("press", rig, "--scene", bare, *out, "-n", 2, "--seed", 1).returncode == 0
    before = names(tmp_path / "out")
    done = sautereau("press", rig, "--scene", "ideal", *out, "-n", 1, "--seed", 2)
    assert done.returncode == 1
    for word in ("presses.1.repeats: 2 then, 1 now", "scene.string", "seed: 1 then, 2", "--out"):
        assert word in done.stderr
    other = rig_file(overlap='"0.3 mm"')
    done = sautereau("press", other, "--scene", bare, "--out", "out")
    assert "rig.plectrum.overlap" in done.stderr
    assert names(tmp_path / "out") == before


def test_a_finished_session_is_extended(sautereau, tmp_path, bare, rig_file):
    rig = rig_file()
    words = ("press", rig, "--scene", bare, "--warm-up", 0, "--out", "out", "--json", "-n")
    assert json.loads(sautereau(*words, 1).stdout)["left"] == 0
    made = fingerprints(tmp_path / "out")
    answer = json.loads(sautereau(*words, 2).stdout)
    assert [press["item"] for press in answer["presses"]] == [1, 2]
    assert answer["left"] == 0
    every_press_once(tmp_path / "out", 2)
    assert made.items() <= fingerprints(tmp_path / "out").items()
    st.stand_in(rig, bare).press(3, out=tmp_path / "out", warm_up=0)
    every_press_once(tmp_path / "out", 3)


@pytest.mark.slow
def test_the_press_after_a_lift_is_an_outlier_and_no_part_of_the_results(
    sautereau, servo, tmp_path
):
    """It starts from above the key, or pushes into it; the others, where the last has ended."""
    words = ("press", "--scene", servo, "--seed", 1, "-n", 3, "--out", "out", "--json")
    result = json.loads(sautereau(*words).stdout)
    forces = [press["forces"]["release"] for press in result["presses"]]
    (lifted,) = st.open(tmp_path / "out" / "warm-up-01.mcap")
    assert lifted.info.warm_up
    outlier = lifted.phases.plucks[0].release_force
    assert max(forces) - min(forces) < 5e-3 < 10e-3 < abs(outlier - forces[0])
    assert result["repeatability"]["presses"] == result["features"]["release_force"]["presses"] == 3
    opened = st.open(tmp_path / "out")
    assert [press.path.name for press in opened] == [f"press-000{n}.mcap" for n in (1, 2, 3)]
    page = Path(opened.report().path).read_text(encoding="utf-8")
    assert "3, and 1 for warm-up that are not on this page" in page
    none = json.loads(sautereau(*words, "--warm-up", 0).stdout)  # nothing is left to press
    assert none["presses"] == result["presses"]


def test_a_table_of_presses_with_warm_up_on_the_stand_in(sautereau, rig_file, tmp_path):
    (tmp_path / "plan.csv").write_text(
        "press.jack_speed, plectrum.overlap, repeats, notes\n"
        "0.06 m/s, , 3, slow\n"
        "0.08 m/s, 0.35 mm, , \n"
    )
    done = sautereau(
        *("press", rig_file(), "--scene", "ideal", "--table", "plan.csv", "--json"),
        *("--rest", "1 ms", "--notes", "monday", "--out", "out"),
    )
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert [press["item"] for press in result["presses"]] == [1, 2, 3, 4]
    assert result["warm_ups"] == ["out/warm-up-01.mcap", "out/warm-up-02.mcap"]
    sessions = [read_session(path) for path in sorted((tmp_path / "out").glob("*.mcap"))]
    notes = ["monday; slow"] * 3 + ["monday", "monday; slow", "monday"]
    assert [s.notes for s in sessions] == notes
    assert [(s.item, s.warm_up) for s in sessions[3:]] == [(4, False), (None, True), (None, True)]
    assert sessions[0].seed == sessions[4].seed != sessions[3].seed == sessions[5].seed
    slow, fast = result["conditions"]
    assert slow["repeatability"]["presses"] == 3
    assert "repeatability" not in fast
    assert abs(slow["duration_error"]["value"]) < 0.01
    assert abs(fast["duration_error"]["value"]) < 0.01  # a new stand-in with the other overlap
    rig = read_recording(tmp_path / "out" / "press-0004.mcap").rig
    assert (rig.press.jack_speed, rig.plectrum.overlap) == pytest.approx((0.08, 0.35e-3))


@pytest.mark.slow
def test_the_operator_sets_the_instrument_on_the_hardware(sautereau, bare, rig_file, tmp_path):
    with StandIn(load_rig(), load_scene(str(bare))) as served:
        rig = rig_file(port=f'"{served.serial_port}"', address=f'"{served.daq_address}"')
        table = "plectrum.overlap, repeats\n , 1\n0.30 mm, 1\n , 1\n"
        (tmp_path / "plan.csv").write_text(table)
        # The sensors have no AC coupling, and the rig states one: the key seems to stay down.
        command = ("press", rig, "--table", "plan.csv", "--out", "out", "--json", "--ignore-health")
        for made, value in ((1, "0.30 mm"), (2, "0.000263 m"), (3, None)):
            done = sautereau(*command)
            assert done.returncode == 0, done.stderr
            result = json.loads(done.stdout)
            assert len(result["recordings"]) == made
            assert result["left"] == 3 - made
            assert result["to_set"] == ({"plectrum.overlap": value} if value else {})
    overlaps = [read_recording(tmp_path / p).rig.plectrum.overlap for p in result["recordings"]]
    assert overlaps == pytest.approx([0.263e-3, 0.30e-3, 0.263e-3])


def test_on_a_terminal_the_session_waits_for_the_operator(command_server, bare, rig_file, tmp_path):
    with StandIn(load_rig(), load_scene(str(bare))) as served:
        rig = rig_file(port=f'"{served.serial_port}"', address=f'"{served.daq_address}"')
        factors = '[factors]\nplectrum = {wide = {plectrum.overlap = "0.30 mm"}}\n'
        (tmp_path / "plan.toml").write_text(factors)
        words = ("press", rig, "--design", "plan.toml", "--warm-up", 0, "--out", "out", "--json")
        master, slave = os.openpty()
        streams = {"stdin": slave, "stderr": slave, "stdout": subprocess.PIPE}
        with command_server.start(*words, cwd=tmp_path, **streams) as process:
            asked = b""
            while b"Enter" not in asked:
                asked += os.read(master, 1024)
            assert b"Block 1 (plectrum = wide). Set" in asked
            assert b"plectrum.overlap = 0.30 mm" in asked
            assert not (tmp_path / "out" / "session.json").exists()
            os.write(master, b"\n")
            result = json.loads(process.communicate(timeout=60)[0])
        for end in (master, slave):
            os.close(end)
    assert (len(result["recordings"]), result["left"], result["to_set"]) == (1, 0, {})


@pytest.mark.slow
@pytest.mark.parametrize("command", ["press", "learn"])
def test_a_key_pauses_the_session_and_continues_it(
    command_server, bare, servo, rig_file, tmp_path, command
):
    """No press starts after the one in which it was pressed."""
    scene = bare if command == "press" else servo  # an ideal finger has nothing to learn
    words = (command, rig_file(), "--scene", scene, "-n", 4, "--out", "out")
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with command_server.start(*words, cwd=tmp_path, **streams) as process:
        while not process.stdout.readline().startswith("press-0001"):
            pass
        process.send_signal(signal.SIGQUIT)
        assert "pausing" in process.stderr.readline()
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(timeout=8)
        assert 1 <= len(list((tmp_path / "out").glob("*.mcap"))) <= 3
        process.send_signal(signal.SIGQUIT)
        printed = process.communicate(timeout=100)[0]
    made = printed.count("recording: ")
    assert (process.returncode, made) == (0, 4) if command == "press" else made > 1


@pytest.mark.slow
def test_a_known_jitter_is_recovered_within_its_interval(bare, quick_rig, tmp_path):
    """Each press is planned with a different speed; the recordings have the nominal one."""
    presses, sigma = 10, 4e-3
    speeds = 1 + sigma * np.random.default_rng(5).standard_normal(presses)
    with StandIn(quick_rig, load_scene(str(bare))) as stand_in:
        rig = stand_in.rig
        nominal = rig.press.jack_speed
        plans = [
            plan_press(with_values(rig, {"press.jack_speed": f"{nominal * speed} m/s"}))
            for speed in speeds
        ]
        paths = make_presses(GalilController(rig), tmp_path, (Item(rig, plan) for plan in plans))
    found = repeatability([load_press(path) for path in paths], press_law(rig.press))
    spread = found.velocity_repeatability
    assert spread.low < 3 * sigma < spread.high
    assert spread.value == pytest.approx(3 * speeds.std(ddof=1), rel=0.02)
    assert found.velocity_accuracy == pytest.approx(speeds.mean() - 1, abs=3e-4)


@pytest.mark.slow
def test_sensors_noise_is_far_below_a_robots_repeatability(quick_rig, tmp_path):
    """The path depends on the time of the trigger's edge, up to a sample before the motion."""
    with StandIn(quick_rig, load_scene("paper"), 1) as stand_in:
        rig = stand_in.rig
        items = [Item(rig, plan_press(rig))] * 4
        paths = make_presses(GalilController(rig), tmp_path, items)
    found = repeatability([load_press(path) for path in paths], press_law(rig.press))
    assert found.velocity_repeatability.value < 1e-3
    assert found.path_repeatability < rig.press.jack_speed * rig.controller.sample_period

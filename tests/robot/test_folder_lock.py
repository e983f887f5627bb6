"""One session at a time in a folder; a fragment never counts as a press."""

import os
import shutil
import subprocess
import threading

import pytest

from sautereau.commands.output import printable
from sautereau.daq.source.source import open_source
from sautereau.entrance import bench as benches
from sautereau.rig.errors import SautereauError
from sautereau.rig.load import load_rig, with_values
from sautereau.rig.text import rig_text
from sautereau.robot.drivers.serial_port import open_port
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.monitor import Made
from sautereau.robot.experiment.plan import MOST_PRESSES, Plan, Row
from sautereau.robot.experiment.session_folder import LOCK, only_session
from sautereau.sim_backend.bench import StandIn
from tests.presses import QUICK, mute_scene

OWNER = ".session.owner"
HOLDER = """
import sys, time
from pathlib import Path
from sautereau.robot.experiment.session_folder import only_session
with only_session(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


def test_a_second_session_names_the_first_and_a_killed_one_leaves_no_lock(tmp_path, command_server):
    folder = tmp_path / "out"
    with command_server.start("-c", HOLDER, folder, stdout=subprocess.PIPE) as holder:
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(RobotError, match=f"process {holder.command} on"), only_session(folder):
            pass
        holder.kill()
    with only_session(folder):
        assert (folder / LOCK).exists()


def test_a_session_that_writes_nothing_leaves_no_folder(tmp_path):
    with only_session(tmp_path / "out"):
        pass
    assert not (tmp_path / "out").exists()


def test_the_name_of_the_owner_is_neither_followed_nor_read_without_limit(tmp_path):
    folder, victim = tmp_path / "out", tmp_path / "victim"
    folder.mkdir()
    victim.write_text("mine")
    (folder / OWNER).symlink_to(victim)
    with only_session(folder):
        assert victim.read_text() == "mine"
        for other in ("/dev/zero", None):
            (folder / OWNER).unlink()
            if other:
                (folder / OWNER).symlink_to(other)
            else:
                (folder / OWNER).write_text("x" * 100_000)
            with pytest.raises(RobotError, match="out: another process runs"):  # noqa: SIM117
                with only_session(folder):
                    pass
    assert victim.read_text() == "mine"


@pytest.mark.parametrize("moved", [True, False])
def test_a_folder_that_goes_away_does_not_hide_the_first_error(tmp_path, moved):
    folder = tmp_path / "out"
    with pytest.raises(ZeroDivisionError) as caught, only_session(folder):  # noqa: PT012
        if moved:
            folder.rename(tmp_path / "elsewhere")
        else:
            shutil.rmtree(folder)
        raise ZeroDivisionError
    assert "out was removed or renamed" in caught.value.__notes__[0]
    with only_session(folder):
        pass


@pytest.mark.slow
def test_a_session_holds_card_and_controller_between_presses_and_in_a_pause(
    tmp_path, command_server
):
    """What others are refused is not that of the session; it ends as without them."""
    refused = {}

    def others(when, rig):
        def attempt():
            for name, take in (
                ("card", lambda: open_source(rig.daq, 0.05).__enter__()),
                ("port", lambda: open_port(rig.controller.port, 115_200, 0.1)),
            ):
                try:
                    take()
                except SautereauError as error:
                    refused[when, name] = str(error)

        thread = threading.Thread(target=attempt)
        thread.start()
        thread.join(60)

    with StandIn(with_values(load_rig(), QUICK), mute_scene()) as stand_in:
        file = tmp_path / "rig.toml"
        file.write_text(rig_text(stand_in.rig))
        bench = benches.bench(file)
        wait = bench.control.wait

        def paused():
            if bench.control.paused:
                others("in a pause", stand_in.rig)
                done = command_server.run("acquire", file, "--out", "a.mcap", folder=tmp_path)
                refused["in a pause", "command"] = done.stderr
                bench.resume()
            wait()

        def watch(seen):
            if isinstance(seen, Made) and seen.press == 1:
                others("between presses", stand_in.rig)
                bench.pause()

        bench.control.wait = paused
        assert len(bench.press(2, out=tmp_path / "out", watch=watch)) == 2
        with open_source(stand_in.rig.daq, 0.05):
            pass
    assert len(refused) == 5
    for text in refused.values():
        assert f"process {os.getpid()} on" in text
        assert f"a session in {tmp_path / 'out'}" in text


def test_more_presses_than_anyone_makes_are_refused(rig):
    with pytest.raises(RobotError, match=f"more than {MOST_PRESSES}"):
        Plan(rig, (Row(rig, 10**8, {}, ""),))


def test_escape_sequences_are_printed_visibly():
    assert printable("a\x1b[2Jb\x9b\u202e\tc\n") == "a\\x1b[2Jb\\x9b\\u202e\tc\n"

"""One session at a time in a folder; a fragment never counts as a press."""

import subprocess

import pytest

from sautereau.commands.output import printable
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.folder_lock import LOCK, only_session
from sautereau.robot.experiment.plan import MOST_PRESSES, Plan
from sautereau.robot.experiment.plan_table import Row

HOLDER = """
import sys, time
from pathlib import Path
from sautereau.robot.experiment.folder_lock import only_session
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


def test_more_presses_than_anyone_makes_are_refused(rig):
    with pytest.raises(RobotError, match=f"more than {MOST_PRESSES}"):
        Plan(rig, (Row(rig, 10**8, {}, ""),))


def test_escape_sequences_are_printed_visibly():
    assert printable("a\x1b[2Jb\x9b\u202e\tc\n") == "a\\x1b[2Jb\\x9b\\u202e\tc\n"

"""Live views get the events of a session without delaying it, and cannot disturb a press."""

import threading
from pathlib import Path

import numpy as np
import pytest

from sautereau.daq.file.reading import read_recording
from sautereau.rig.load import load_rig, with_values
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment import monitor as live
from sautereau.robot.experiment.monitor import Fault, Feed, Made, Samples, Stage
from sautereau.robot.experiment.session import Item, make_presses
from sautereau.sim_backend.bench import StandIn
from sautereau.trajectory.press import plan_press
from tests.presses import QUICK, mute_scene


class Keeping:
    """Keeps what it is shown."""

    def __init__(self):
        self.seen, self.dropped = [], 0

    def show(self, seen, dropped):
        self.seen += seen
        self.dropped = dropped


class Failing:
    """Fails whenever it is shown something."""

    def show(self, seen, dropped):
        raise ValueError("no such colour")


class Stuck:
    """Shows nothing until it is released, like a terminal stopped by Ctrl-S."""

    def __init__(self):
        self.reached, self.released = threading.Event(), threading.Event()

    def show(self, seen, dropped):
        self.reached.set()
        self.released.wait()


def stages(n):
    return [Stage("moving", "reading", number) for number in range(n)]


def test_all_is_shown_in_order():
    view = Keeping()
    with Feed([view], period=1e-3) as feed:
        for stage in stages(200):
            feed(stage)
    assert view.seen == stages(200)
    assert (feed.dropped, feed.faults) == (0, [])


def test_what_does_not_fit_is_dropped_and_counted():
    """A view that has stopped lets the queue fill up; the session does not wait for it."""
    stuck, keeping = Stuck(), Keeping()
    with Feed([stuck, keeping], depth=10, period=1e-3) as feed:
        assert stuck.reached.wait(20)
        for stage in stages(500):
            feed(stage)
        assert feed.dropped == 490
        stuck.released.set()
    assert keeping.seen == stages(500)[:10]
    assert keeping.dropped == 490


def test_a_view_that_fails_is_reported_and_the_others_continue():
    view = Keeping()
    with Feed([Failing(), view], period=1e-3) as feed:
        feed(Fault("a"))
    assert feed.faults == ["Failing: ValueError: no such colour"]
    assert view.seen == [Fault("a")]


def test_a_view_that_never_ends_does_not_hold_the_session(monkeypatch):
    monkeypatch.setattr(live, "PATIENCE", 0.05)
    stuck = Stuck()
    with Feed([stuck], period=1e-3) as feed:
        assert stuck.reached.wait(20)
    assert feed.faults == ["a view has not shown the end of the session in 0.05 s"]
    stuck.released.set()


def press(out, watch, n=2):
    with StandIn(with_values(load_rig(), QUICK), mute_scene(), 3) as stand_in:
        item = Item(stand_in.rig, plan_press(stand_in.rig))
        return make_presses(GalilController(stand_in.rig), out, [item] * n, watch=watch)


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """Two presses, and what was seen of them."""
    seen = []
    return press(tmp_path_factory.mktemp("plain"), seen.append), seen


def test_a_session_reports_its_stages(plain):
    paths, seen = plain
    stages = [(s.arm, s.daq, s.press) for s in seen if isinstance(s, Stage)]
    one = [
        ("loading", "idle"),
        ("armed", "armed"),
        ("moving", "reading"),
        ("moving", "complete"),
        ("standing", "complete"),
    ]
    assert stages == [
        ("motors off", "idle", None),
        ("going to the start", "idle", None),
        *((*stage, 1) for stage in one),
        ("going to the start", "idle", None),
        *((*stage, 2) for stage in one),
        ("going home", "idle", None),
        ("motors off", "idle", None),
    ]
    assert [s.path for s in seen if isinstance(s, Made)] == paths
    for number, path in enumerate(paths, 1):
        blocks = [s.block for s in seen if isinstance(s, Samples) and s.press == number]
        volts = np.concatenate([block.volts for block in blocks], axis=1)
        recorded = read_recording(path).volts
        np.testing.assert_array_equal(volts, [recorded["velocity"], recorded["force"]])


@pytest.mark.slow
def test_views_that_fail_or_hang_change_no_sample(plain, tmp_path, monkeypatch):
    monkeypatch.setattr(live, "PATIENCE", 0.05)
    stuck = Stuck()
    with Feed([Failing(), stuck], depth=4, period=1e-3) as feed:
        watched = press(tmp_path / "watched", feed)
    stuck.released.set()
    assert feed.dropped > 0
    for one, other in zip(plain[0], watched, strict=True):
        for name, volts in read_recording(one).volts.items():
            assert volts.tobytes() == read_recording(other).volts[name].tobytes()


def test_what_ends_a_session_is_seen(tmp_path):
    seen = []
    (tmp_path / "file").write_text("")
    with pytest.raises(RobotError):
        press(tmp_path / "file", seen.append)
    assert isinstance(seen[-1], Fault)
    assert "session folder" in seen[-1].text
    assert Path(tmp_path / "file").read_text(encoding="utf-8") == ""


def test_an_interrupted_session_reports_the_motors(tmp_path):
    seen = []

    def interrupt(one):
        seen.append(one)
        if isinstance(one, Samples):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        press(tmp_path, interrupt, 1)
    first, *notes = seen[-1].text.splitlines()
    assert first == "interrupted"
    assert "The arm was stopped and its motors are off: the controller confirms it." in notes

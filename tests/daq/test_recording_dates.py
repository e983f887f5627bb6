"""When samples were taken, whatever the host's clocks do, and when they reach the disk."""

import itertools
import math

import numpy as np
import pytest
from mcap.records import Message

from sautereau.daq.file.container.durable import DurableFile
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recording import Block, Recording
from sautereau.daq.file.trigger_date import Counted
from tests.daq.declared import records

T0 = 1_700_000_000_000_000_000


def test_times_do_not_drift(tmp_path, paper, session):
    """51.2 kHz is 19531.25 ns a sample: sample 102,401 is at 2000019531.25 ns."""
    path = tmp_path / "press.mcap"
    with Recording(path, paper, session=session, t0_ns=T0) as recording:
        for first in range(1, 103_401, 1024):
            recording.write_block(Block(first - 1025, np.zeros((2, 1024))))
        recording.flush()
        recording.write_block(Block(recording.n_samples - 1024, np.zeros((2, 1))))
    found = [r for r in records(path) if isinstance(r, Message)]
    assert all(m.log_time == m.publish_time for m in found)
    assert max(m.log_time for m in found) - T0 == 2_000_000_000
    assert read_recording(path).t0_ns == T0


@pytest.mark.parametrize("late", [0.0, 0.004])
def test_counts_date_the_trigger(tmp_path, paper, session, late):
    """Half of 0.2 ms between question and answer, also if the device was late twice."""
    seconds, path, rate = [0.0], tmp_path / "press.mcap", 51_200
    with Recording(
        path, paper, session=session, clock=lambda: T0, monotonic=lambda: seconds[0]
    ) as recording:
        for first in (0, 1024, 2048):
            held = first + 1024
            asked = (held - 0.5) / rate + (late if first != 1024 else 0.0)
            seconds[0] = asked + 0.05
            counted = Counted(asked - 1e-4, asked + 1e-4, held)
            recording.write_block(Block(first, np.zeros((2, 1024)), (counted,)))
            assert recording.t0_ns is not None
    found = read_recording(path)
    assert abs(found.t0_ns - T0) < 1000
    assert found.t0_std == pytest.approx((2e-4 + 1 / rate) / math.sqrt(12), rel=1e-6)


def test_without_counts_no_sample_is_taken_after_it_arrived(tmp_path, paper, session):
    """A block that was read late gives no earlier date."""
    seconds = [0.0]
    path = tmp_path / "press.mcap"
    with Recording(
        path, paper, session=session, clock=lambda: T0, monotonic=lambda: seconds[0]
    ) as recording:
        for first, late in ((0, 0.03), (1024, 0.0001), (2048, 0.01)):
            seconds[0] = (first + 1023) / 51_200 + late
            recording.write_block(Block(first, np.zeros((2, 1024))))
        t0 = recording.t0_ns
    assert abs(t0 - T0 - 100_000) < 2000
    found = read_recording(path)
    assert (found.t0_ns, found.t0_std) == (t0, None)


def test_a_clock_that_jumps_disturbs_no_date(tmp_path, paper, session):
    """The host's clock is set back by a year after each look at it, which is one."""
    looks = iter(T0 - year * 31_536_000 * 10**9 for year in range(9))
    seconds = iter(np.arange(1000) * 0.02)
    path = tmp_path / "press.mcap"
    with Recording(
        path,
        paper,
        session=session,
        clock=lambda: next(looks),
        monotonic=lambda: float(next(seconds)),
    ) as recording:
        recording.event("before", "the trigger", -1.0)
        for first in range(0, 20_480, 1024):
            recording.write_block(Block(first, np.zeros((2, 1024))))
        t0 = recording.t0_ns
    times = [r.log_time for r in records(path) if isinstance(r, Message)]
    assert next(looks) == T0 - 31_536_000 * 10**9
    assert T0 - 10**9 < t0 < T0 + 3 * 10**9
    assert min(times) == t0 - 10**9
    assert max(times) < T0 + 3 * 10**9


def test_samples_are_handed_on_by_the_clock_and_by_their_number(tmp_path, paper, session):
    """After 0.2 s of an injected clock, or as many samples; the disk is asked every second."""
    now = [0.0]
    path = tmp_path / "press.mcap"
    sizes = []
    with Recording(path, paper, session=session, monotonic=lambda: now[0]) as recording:

        def give(n):
            recording.write_block(Block(recording.n_samples, np.ones((2, n))))
            sizes.append(recording.part_path.stat().st_size)

        give(10_000)
        give(300)  # 10,240 samples are 0.2 s
        give(10)
        now[0] = 0.19
        give(300)
        now[0] = 0.2
        give(10)
        give(10)
        recording.event("fault", "an event waits for the flush", 0.3)
        sizes.append(recording.part_path.stat().st_size)
        recording.flush()
        sizes.append(recording.part_path.stat().st_size)
    grown = [after > before for before, after in itertools.pairwise(sizes)]
    assert grown == [True, False, False, True, False, False, True]


def test_the_disk_is_asked_every_second(tmp_path, paper, session, monkeypatch):
    asked = []
    now = [0.0]
    monkeypatch.setattr(DurableFile, "sync", lambda self: asked.append(now[0]))
    with Recording(
        tmp_path / "press.mcap", paper, session=session, monotonic=lambda: now[0]
    ) as recording:
        for step in range(31):
            now[0] = step / 10
            recording.write_block(Block(step * 10, np.ones((2, 10))))
        assert asked == [1.0, 2.0, 3.0]

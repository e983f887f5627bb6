"""When samples were taken, whatever the host's clocks do, and when they reach the disk."""

import itertools
import math
import time
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from mcap.records import Message

from sautereau.daq.file.container.durable import DurableFile
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import date_now
from sautereau.daq.file.recording import Block, Recording
from sautereau.daq.file.trigger_date import Counted, TriggerDate
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
    """Half of 0.2 ms between question and answer; a device that was late twice may always be."""
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
    width = 2e-4 + 1 / rate
    contradiction = max(0.0, late - width)
    std = (width + 2 * contradiction) / math.sqrt(12)
    assert found.t0_std == pytest.approx(std, rel=1e-6)


def found_by(*counts, cause=-math.inf):
    """The date of the trigger by counts at 1 kHz: asked, answered, samples."""
    date = TriggerDate(1000.0)
    date.not_before(cause)
    for count in counts:
        date.add(Counted(*count))
    return date.found()


def test_counts_before_the_trigger_limit_it_although_the_device_counts_late():
    """At 1.000 s, after 40 ms in which the device was silent, as any count after them."""
    time, std = found_by((0.996, 0.997, -3), (1.045, 1.046, 1), (1.050, 1.051, 6))
    assert abs(time - 1.0) <= 1.96 * std
    assert time - math.sqrt(3) * std <= 0.999 + 1e-9


@pytest.mark.parametrize("count", [(5.0, 5.001, 500), (-math.inf, 4.0, 1)])
def test_no_date_is_before_the_command_that_caused_it(count):
    """A device that counts faster than time passes contradicts it: the uncertainty is as large."""
    time, std = found_by((4.8, 4.801, -100), count, cause=4.9)
    assert time == 4.9
    assert std > 0.3 / math.sqrt(12)


def test_a_device_that_does_not_count_gives_no_uncertainty():
    assert found_by((-math.inf, 7.0, 11), cause=6.5) == (6.99, None)
    assert found_by((-math.inf, 7.0, 1001), cause=6.5) == (6.5, None)


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


def test_presses_are_dated_in_the_time_zone_of_the_machine(monkeypatch):
    """An afternoon in California is one day, as sessions are pooled, and two in UTC."""
    with monkeypatch.context() as patch:
        patch.setenv("TZ", "PST8")
        time.tzset()
        here = date_now()
    time.tzset()
    assert here.endswith("-08:00")
    assert abs(datetime.fromisoformat(here) - datetime.now(UTC)) < timedelta(seconds=10)

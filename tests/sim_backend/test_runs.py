"""Acquisitions fed by hand, sample by controller sample."""

import threading

import numpy as np
import pytest

from rig.load import load_rig
from sim_backend.runs import SampledRun
from sim_backend.scene import load_scene
from sim_backend.world import Motions

PERIOD, STEPS = 976.5625e-6, 10
SENSORS = load_scene("paper").sensors


@pytest.fixture
def rig():
    return load_rig("paper")


def spin(time):
    return 0.4 * np.sin(30 * time)


def force(time):
    return 0.3 + 2 * time


def motions(sample):
    """What happens in one controller sample of a bench that is two formulas."""
    time = sample * PERIOD + np.arange(1, STEPS + 1) * PERIOD / STEPS
    return Motions(time, np.zeros(STEPS), spin(time), np.zeros(STEPS), force(time))


def armed(rig, *, terminals=("ai0", "ai1"), rate=51_200.0, n=2000, sensors=None, rest=0.3, seed=5):
    rig = rig if sensors else load_scene("ideal").as_wired(rig)
    changed = threading.Condition(threading.RLock())
    return SampledRun(rig, terminals, rate, n, sensors, (seed, 0), rest, changed)


def play(run, samples, first=0, releases=()):
    for sample in range(first, first + samples):
        run.feed(motions(sample), [r for r in releases if sample <= r / PERIOD < sample + 1])


def test_nothing_comes_before_the_trigger(rig):
    run = armed(rig)
    assert not run.waiting_for_time
    play(run, 5)
    assert run.wait_for(0, 0) == 0
    assert run.wait_for(1, 0) == 0
    assert run.read(0, 0).shape == (2, 0)


def test_samples_begin_at_the_trigger(rig):
    """Row by terminal; the first sample is the rest, the n-th is n / rate after the edge."""
    run = armed(rig)
    start = 7 * PERIOD
    run.trigger(start)
    assert run.waiting_for_time
    play(run, 41, first=7)
    assert run.wait_for(2000, 0) == 2000
    assert not run.waiting_for_time
    volts = run.read(0, 2000)
    time = start + np.arange(2000) / 51_200
    velocity, newtons = volts[0] * 0.025, volts[1]
    expected = spin(time) * rig.key.laser_arm
    past = time > start + PERIOD / STEPS  # before the first step's end: from rest to there
    np.testing.assert_allclose(velocity[past], expected[past], atol=1e-6)
    np.testing.assert_allclose(newtons[past], force(time)[past], rtol=1e-9)
    assert newtons[0] == 0.3


def test_no_more_samples_than_asked_for(rig):
    run = armed(rig, n=77)
    run.trigger(0.0)
    play(run, 10)
    assert run.wait_for(1000, 0) == 77
    assert run.read(0, 77).shape == (2, 77)


def test_terminals_come_in_the_order_asked_for(rig):
    both, turned = armed(rig), armed(rig, terminals=("ai1", "ai0"))
    for run in (both, turned):
        run.trigger(0.0)
        play(run, 10)
    np.testing.assert_array_equal(both.read(0, 400), turned.read(0, 400)[::-1])


@pytest.mark.parametrize("rate", [1000.0, 1024.0, 44_100.0, 1e6])
def test_any_rate(rig, rate):
    """Also one that gives no sample at all in some controller samples."""
    n = int(0.09 * rate)
    run = armed(rig, rate=rate, n=n)
    run.trigger(0.0)
    counts = []
    for sample in range(100):
        play(run, 1, first=sample)
        counts.append(run.wait_for(0, 0))
    assert counts[-1] == n
    upto = np.minimum((np.arange(1, 101) * PERIOD * rate * (1 + 1e-12)).astype(int) + 1, n)
    np.testing.assert_array_equal(counts, upto)
    time = np.arange(n) / rate
    np.testing.assert_allclose(run.read(0, n)[1][1:], force(time)[1:], rtol=1e-6)


def test_a_second_edge_changes_nothing(rig):
    run = armed(rig)
    run.trigger(0.0)
    run.trigger(0.5)
    assert run.trigger_time == 0.0


def test_a_release_is_sharp(rig):
    """The force falls between two samples, wherever in the controller's sample that is."""
    run = armed(rig, n=1000)
    run.trigger(0.0)
    release = 10.437 * PERIOD
    for sample in range(25):
        there = motions(sample)
        fallen = np.where(there.time > release, 0.1, there.finger_force)
        run.feed(
            Motions(there.time, there.angle, there.spin, there.rise, fallen),
            [release] if sample == 10 else [],
        )
    time = np.arange(1000) / 51_200
    newtons = run.read(0, 1000)[1]
    np.testing.assert_allclose(
        newtons[1:][time[1:] <= release], force(time[1:][time[1:] <= release]), rtol=1e-6
    )
    np.testing.assert_allclose(newtons[time > release], 0.1, rtol=1e-9)


def test_the_same_seed_gives_the_same_bits_whatever_is_read(rig):
    one, other, third = (armed(rig, sensors=SENSORS, seed=seed) for seed in (5, 5, 6))
    for run in (one, other, third):
        run.trigger(0.0)
    for sample in range(30):
        for run in (one, other, third):
            play(run, 1, first=sample)
        other.read(0, 5)
    np.testing.assert_array_equal(one.read(0, 1400), other.read(0, 1400))
    assert np.any(one.read(0, 1400) != third.read(0, 1400))


def test_channels_have_noise_of_their_own(rig):
    run = armed(rig, sensors=SENSORS, n=2000)
    run.trigger(0.0)
    play(run, 45)
    velocity, newtons = np.diff(run.read(0, 2000), 2)
    assert abs(np.corrcoef(velocity, newtons)[0, 1]) < 0.1


def test_reading_gives_a_copy(rig):
    run = armed(rig)
    run.trigger(0.0)
    play(run, 10)
    block = run.read(0, 100)
    block[:] = 0
    assert np.any(run.read(0, 100) != 0)


def test_stopping_ends_it(rig):
    run = armed(rig)
    run.trigger(0.0)
    play(run, 3)
    there = run.wait_for(0, 0)
    run.stop()
    play(run, 3, first=3)
    assert run.wait_for(10_000, None) == there
    assert not run.waiting_for_time
    run.stop()


def test_a_stopped_run_is_not_triggered(rig):
    run = armed(rig)
    run.stop()
    run.trigger(0.0)
    assert run.trigger_time is None

"""Acquisitions that are fed here, one controller sample at a time."""

import numpy as np
import pytest

from sautereau.rig.load import load_rig
from sautereau.sim_backend.clock import FairLock
from sautereau.sim_backend.devices.daqmx.card import ENDLESS, TaskSetup
from sautereau.sim_backend.devices.daqmx.runs import RetriggeredRun, RunFault, SampledRun, Wiring
from sautereau.sim_backend.fault_tables import Faults, Speckle
from sautereau.sim_backend.physics.events import Motions
from sautereau.sim_backend.scene import load_scene

PERIOD, STEPS = 976.5625e-6, 10
SENSORS = load_scene("paper").sensors
SPECKLE = Speckle.model_validate({"rate": "200 Hz", "duration": "1 ms", "spike": "20 mm/s"})


@pytest.fixture
def rig():
    return load_rig("paper")


def spin(time):
    return 0.4 * np.sin(30 * time)


def force(time):
    return 0.3 + 2 * time


def motions(sample):
    """The motion of one controller sample, by two formulas."""
    time = sample * PERIOD + np.arange(1, STEPS + 1) * PERIOD / STEPS
    still = np.zeros(STEPS)
    return Motions(time, still, spin(time), still, force(time), still, still)


def armed(rig, *, n=2000, terminals=("Dev1/ai0", "Dev1/ai1"), rate=51_200.0, **others):
    scene = load_scene("ideal").model_copy(
        update={name: others.get(name) for name in ("sensors", "faults")}
    )
    setup = TaskSetup(terminals, rate, n, None, others.get("before"))
    seed = others.get("seed", 5)
    rest = Motions(*np.array([[0.0], [0.0], [0.0], [0.0], [0.3], [0.0], [0.0]]))
    return SampledRun(Wiring(scene.as_wired(rig), scene, seed, FairLock()), setup, 0, rest)


def triggered(rig, samples=0, **others):
    run = armed(rig, **others)
    run.trigger(0.0)
    play(run, samples)
    return run


def play(run, samples, first=0):
    for sample in range(first, first + samples):
        run.feed(motions(sample))


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


@pytest.mark.parametrize(("edge", "kept"), [(None, 0), (30 * PERIOD, 601)])
def test_a_failure_ends_a_pretrigger_acquisition_with_an_error(rig, edge, kept):
    """Without the edge no sample is kept, however many were acquired."""
    run = armed(rig, n=1000, before=100)
    run.trigger(0.0)
    play(run, 30)
    if edge is not None:
        run.trigger(edge)
        play(run, 10, first=30)
    assert (run.over, run.wait_for(1000, 0)) == (False, 0)
    run.fail(lambda: OSError("failed"))
    assert run.over
    assert run.acquired > 1000
    assert run.wait_for(0, 0) == kept
    with pytest.raises(OSError, match="failed"):
        run.wait_for(1000, 0)


def test_terminals_come_in_the_order_asked_for(rig):
    both, turned = triggered(rig, 10), triggered(rig, 10, terminals=("Dev1/ai1", "Dev1/ai0"))
    np.testing.assert_array_equal(both.read(0, 400), turned.read(0, 400)[::-1])


@pytest.mark.parametrize("rate", [1000.0, 1024.0, 44_100.0, 1e6])
def test_any_rate(rig, rate):
    """Also one that gives no sample at all in some controller samples."""
    n = int(0.09 * rate)
    run = triggered(rig, rate=rate, n=n)
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
    run = triggered(rig)
    run.trigger(0.5)
    assert run.trigger_time == 0.0


def test_a_release_is_sharp(rig):
    """The force falls between two samples, wherever in the controller's sample that is."""
    run = triggered(rig, n=1000)
    release = 10.437 * PERIOD
    for sample in range(25):
        there = motions(sample)
        k = np.searchsorted(there.time, release) if sample == 10 else 0
        pair = [release] * (2 if sample == 10 else 0)
        time = np.insert(there.time, k, pair)
        fallen = np.where(time > release, 0.1, force(time))
        fallen[k + 1 : k + len(pair)] = 0.1
        still = np.zeros(len(time))
        run.feed(Motions(time, still, spin(time), still, fallen, still, still))
    time = np.arange(1000) / 51_200
    newtons = run.read(0, 1000)[1]
    np.testing.assert_allclose(
        newtons[1:][time[1:] <= release], force(time[1:][time[1:] <= release]), rtol=1e-6
    )
    np.testing.assert_allclose(newtons[time > release], 0.1, rtol=1e-9)


@pytest.mark.parametrize("random", [{"sensors": SENSORS}, {"faults": Faults(speckle=SPECKLE)}])
def test_the_same_seed_gives_the_same_bits_whatever_is_read(rig, random):
    """Of the noise, and of the drop-outs."""
    one, other, third = (triggered(rig, **random, seed=seed) for seed in (5, 5, 6))
    for sample in range(30):
        for run in (one, other, third):
            play(run, 1, first=sample)
        other.read(0, 5)
    np.testing.assert_array_equal(one.read(0, 1400), other.read(0, 1400))
    assert np.any(one.read(0, 1400) != third.read(0, 1400))


def test_the_memory_of_an_endless_run_is_bounded(rig):
    """And every sample is the one of a run that is read at once."""
    endless, finite = triggered(rig, n=ENDLESS), triggered(rig, 200, n=9000)
    read = []
    for first in range(0, 200, 10):
        play(endless, 10, first)
        read.append(endless.read(sum(part.shape[1] for part in read), 10**6))
    together = np.concatenate(read, axis=1)
    n = together.shape[1]
    assert n > 9000
    np.testing.assert_array_equal(together[:, :9000], finite.read(0, 9000))
    assert endless._volts.nbytes < 3 * read[-1].nbytes + 2 * read[0].nbytes


def test_stopping_ends_it(rig):
    run = triggered(rig, 3)
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


def test_a_fault_ends_the_run_at_its_sample(rig):
    """Reads before it are served; those of it raise, each time."""
    run = armed(rig)
    run.trigger(0.0, RunFault(700, lambda: ValueError("gone")))
    play(run, 30)
    assert run.over
    assert run.wait_for(700, 0) == 700
    assert run.read(600, 100).shape == (2, 100)
    for _ in range(2):
        with pytest.raises(ValueError, match="gone"):
            run.wait_for(701, 0)


def paced(rig, **settings):
    """A run of a card in real time that has been started."""
    scene = load_scene("ideal")
    setup = TaskSetup(
        ("Dev1/ai0", "Dev1/ai7"), 51_200.0, **{"n_samples": ENDLESS, "trigger": None, **settings}
    )
    return SampledRun(Wiring(scene.as_wired(rig), scene, 0, FairLock(), paced=True), setup, 0)


def test_nobody_reads_and_the_card_stops_when_its_buffer_is_full(rig):
    run = paced(rig, buffer=120)
    run.trigger(0.0)
    play(run, 2)
    assert run.waiting_for_time
    run.read(0, 60)
    play(run, 1, first=2)
    assert run.waiting_for_time  # 151 acquired, 91 of them unread
    play(run, 5, first=3)
    assert not run.waiting_for_time
    assert run.wait_for(1000, 0) - 60 > 120


def test_an_input_without_a_sensor_reads_nothing(rig):
    run = paced(rig)
    run.trigger(0.0)
    play(run, 2)
    wired, bare = run.read(0, 50)
    assert wired.any()
    assert not bare.any()


def test_a_later_sample_of_a_multiplexer_waits_for_its_conversion(rig):
    run = paced(rig, lags=(0.0, -15e-6))
    run.trigger(0.0)
    play(run, 1)
    assert run.wait_for(0, 0) == int((PERIOD - 15e-6) * 51_200) + 1


def retriggered(rig, terminals, length):
    """Return an armed acquisition of which every edge starts a part of so many samples."""
    scene = load_scene("ideal")
    wiring = Wiring(scene.as_wired(rig), scene, 0, FairLock())
    setup = TaskSetup(terminals, 51_200.0, ENDLESS, "/Dev1/PFI0", per_trigger=length)
    return RetriggeredRun(wiring, setup, 0)


def test_every_edge_starts_a_part_and_none_during_it(rig):
    run = retriggered(rig, ("Dev1/ai0", "Dev1/ai1"), 60)
    play(run, 1)
    assert run.waits_for(falling=False)
    assert run.acquired == 0
    for sample in range(1, 6):  # 50 samples of the card each; the second and fourth edge are early
        run.trigger(sample * PERIOD)
        play(run, 1, first=sample)
    assert run.acquired == 60 + 60 + 51
    assert run.waiting_for_time
    single = []
    for first in (1, 3):
        single.append(armed(rig, n=60))
        single[-1].trigger(first * PERIOD)
        play(single[-1], 2, first=first)
    np.testing.assert_array_equal(run.read(30, 60)[0, :30], single[0].read(30, 30)[0])
    np.testing.assert_array_equal(run.read(60, 60)[0], single[1].read(0, 60)[0])
    assert run.wait_for(120, 0) == 171
    assert run.read(120, 60).shape == (2, 51)
    run.stop()
    assert not run.waits_for(falling=False)


def test_an_overrun_ends_all_parts(rig):
    run = retriggered(rig, ("Dev1/ai0",), 40)
    run.trigger(0.0)
    play(run, 1)
    run.trigger(PERIOD, RunFault(15, lambda: ValueError("gone")))
    play(run, 1, first=1)
    assert run.wait_for(55, 0) == 55
    with pytest.raises(ValueError, match="gone"):
        run.wait_for(56, 0)
    assert not run.waits_for(falling=False)


def test_one_edge_starts_the_samples_and_a_later_one_is_the_reference(rig):
    scene = load_scene("ideal")
    setup = TaskSetup(
        ("Dev1/ai0",), 51_200.0, 60, "/Dev1/PFI0", before=20, start_trigger="/Dev1/PFI0"
    )
    run = SampledRun(Wiring(scene.as_wired(rig), scene, 0, FairLock()), setup, 0)
    play(run, 2)
    assert run.acquired == 0
    run.trigger(2 * PERIOD)
    play(run, 2, first=2)
    run.trigger(4 * PERIOD)
    play(run, 2, first=4)
    assert run.wait_for(60, 0) == 60
    around = run.read(0, 60)
    whole = paced(rig, n_samples=200)
    whole.trigger(2 * PERIOD)
    play(whole, 8, first=2)
    first = 100 - 20  # of the samples since the first edge, the one 20 before the second
    np.testing.assert_array_equal(around[0], whole.read(0, 160)[0, first : first + 60])

"""The stand-in's clock and its fair lock, without real time in the asserts."""

import threading
import time

import pytest

from sautereau.sim_backend.clock import Clock, FairLock


class Count:
    """A bench that is busy until a number of ticks is done."""

    def __init__(self, goal=0):
        self.lock = FairLock()
        self.ticks, self.goal = 0, goal
        self.awaited = self.line_busy = False
        self.failed = []

    @property
    def time(self):
        return self.ticks * 1e-3

    @property
    def busy(self):
        return self.ticks < self.goal

    def tick(self):
        self.ticks += 1
        if self.ticks == 777:
            raise ValueError("diverged")

    def go(self, ticks):
        """Make it busy, and wait until it is not."""
        with self.lock:
            self.goal += ticks
            self.lock.notify_all()
            assert self.lock.wait_for(lambda: not self.busy or self.failed, 10)


def clock(bench, paced=False):
    return Clock(bench, bench.lock, paced, bench.failed.append)


@pytest.mark.parametrize("paced", [False, True])
def test_time_advances_while_the_bench_is_busy_and_no_further(paced):
    bench = Count()
    with clock(bench, paced):
        for ticks in (1, 3, 50):
            bench.go(ticks)
            assert bench.ticks == bench.goal


def test_characters_on_a_line_take_real_time():
    """A host renews the watchdog in real time, in which 0.1 s of simulated time pass here."""
    bench = Count()
    bench.line_busy = True
    with clock(bench):
        start = time.perf_counter()
        bench.go(100)
        assert time.perf_counter() - start >= 0.099


def test_a_host_gets_the_lock_while_time_advances():
    """Again and again, from a clock that is always busy."""

    class Endless(Count):
        busy = True

        def tick(self):
            self.ticks += 1

    bench = Endless()
    seen = []
    with clock(bench):
        while len(seen) < 100 or seen[-1] == 0:
            with bench.lock:
                seen.append(bench.ticks)
    assert sorted(seen) == seen


def test_a_failing_bench_is_reported_and_not_advanced():
    bench = Count()
    with clock(bench):
        bench.go(2000)
    assert [str(error) for error in bench.failed] == ["diverged"]
    assert bench.ticks == 777


def test_waiting_threads_get_the_lock_in_order():
    """A thread that takes the lock again at once does not keep it from one that waits."""
    lock, greedy, done = FairLock(), [0], threading.Event()

    def take():
        while not done.is_set():
            with lock:
                greedy[0] += 1

    thread = threading.Thread(target=take)
    thread.start()
    try:
        for _ in range(200):
            with lock:
                pass
    finally:
        done.set()
        thread.join()
    assert greedy[0] > 0

"""Of several interrupts in a row the first is handled, and the others wait for the motors."""

import signal
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from sautereau.robot.drivers.safety import Interrupts


def test_those_after_the_first_wait():
    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt) as caught, Interrupts() as interrupts:  # noqa: PT012
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt as error:
            for _ in range(3):
                signal.raise_signal(signal.SIGINT)
            interrupts.hold()
            error.add_note("off")
            raise
    assert caught.value.__notes__ == ["off"]
    assert signal.getsignal(signal.SIGINT) is before


def test_one_that_came_while_all_wait_is_raised_at_the_end():
    reached = []
    with pytest.raises(KeyboardInterrupt), Interrupts() as interrupts:  # noqa: PT012
        interrupts.hold()
        signal.raise_signal(signal.SIGINT)
        reached.append("off")
    assert reached


def test_another_thread_handles_none():
    def enter():
        with Interrupts():
            assert signal.getsignal(signal.SIGINT) is before

    before = signal.getsignal(signal.SIGINT)
    thread = threading.Thread(target=enter)
    thread.start()
    thread.join()


def test_one_that_ended_in_another_thread_delays_none():
    before = signal.getsignal(signal.SIGINT)
    left_open = Interrupts().__enter__()
    try:
        left_open.hold()
        with ThreadPoolExecutor(1) as pool:
            pool.submit(left_open.__exit__, None).result()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)

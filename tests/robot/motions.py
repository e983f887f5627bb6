"""Motions of an arm in tests: a press up to its end, one that is stopped, and one that fails."""

import contextlib
import threading

import pytest

OFF = "its motors are off: the controller confirms it"
NOT_OFF = "NOT confirmed off"


def no_keep_alive(*_):
    """Do not renew the watchdog of the controller."""
    return contextlib.nullcontext()


def stop_after(controller, setpoints):
    """Start the loaded motion, stop it after some setpoints, and return where it has stopped."""
    gate, polling, calls = threading.Event(), controller.driver.polling, []
    wait = polling.sleep

    def sleep(seconds):
        calls.append(seconds)
        if len(calls) == setpoints:
            gate.set()
            controller.driver.stream.cancelled.wait(60)
        wait(seconds)

    polling.sleep = sleep
    controller.start()
    assert gate.wait(60)
    return controller.stop()


@contextlib.contextmanager
def fails(controller, kind, match, *said):
    """Switch the motors on, and expect an error that also says other texts."""
    with pytest.raises(kind, match=match) as caught, controller, controller.powered():
        yield
    for text in said:
        assert text in str(caught.value)


def ready(controller, segments):
    """Home, move to the start of a motion, and arm it."""
    controller.home()
    controller.move_to(segments.start, 100_000)
    controller.load(segments)
    controller.arm()


def press(controller, segments, before_wait=lambda: None):
    """Home, play a motion, and wait for its end."""
    ready(controller, segments)
    controller.start()
    before_wait()
    controller.wait()

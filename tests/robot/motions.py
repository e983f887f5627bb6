"""Motions of an arm in tests: a press up to its end, and one that is stopped."""

import contextlib
import threading


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


def run_to_wait(controller, segments, before_wait=lambda: None):
    """Press from the connection on, and wait for the end."""
    with controller, controller.powered():
        controller.home()
        controller.move_to(segments.start, 100_000)
        controller.load(segments)
        controller.arm()
        controller.start()
        before_wait()
        controller.wait()

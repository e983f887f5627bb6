"""Motions that the host streams, ended in the middle."""

import threading


def stop_after(controller, setpoints):
    """Start the loaded motion, stop it after some setpoints, and return where it has stopped."""
    gate, polling, calls = threading.Event(), controller.driver.polling, []
    wait = polling.sleep

    def sleep(seconds):
        calls.append(seconds)
        if len(calls) == setpoints:
            gate.set()
            controller.driver.stream.cancelled.wait(5)
        wait(seconds)

    polling.sleep = sleep
    controller.start()
    assert gate.wait(5)
    return controller.stop()

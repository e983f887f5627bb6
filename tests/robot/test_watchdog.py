"""A host that is lost: the controller switches the motors off by itself."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from sautereau.rig.load import load_rig, with_values
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.drivers.galil.line import Line
from sautereau.robot.drivers.keep_alive import KeepAlive
from sautereau.robot.drivers.polling import Polling
from sautereau.robot.drivers.serial_port import open_port
from sautereau.robot.errors import LineLost, MotionFault
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.scene import load_scene

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="no pseudo-terminals, no SIGKILL")


def test_signs_of_life_come_until_the_block_is_left():
    given = threading.Semaphore(0)
    before = threading.active_count()
    with KeepAlive(lambda keep_waiting: given.release(), 0.02):
        assert all(given.acquire(timeout=10) for _ in range(5))
    assert threading.active_count() == before


def test_a_lost_sign_of_life_does_not_end_them():
    given = threading.Semaphore(0)

    def fail(keep_waiting):
        given.release()
        raise LineLost("gone")

    with KeepAlive(fail, 0.004):
        assert all(given.acquire(timeout=10) for _ in range(5))


def test_a_wait_for_an_answer_ends_when_the_block_is_left():
    waiting = threading.Event()

    def wait(keep_waiting):
        assert keep_waiting()
        waiting.set()
        while keep_waiting():
            threading.Event().wait(0.001)

    with KeepAlive(wait, 0.004):
        assert waiting.wait(timeout=10)


def test_a_dead_thread_gives_none():
    """The thread that owns the power dies without leaving its block."""
    given = threading.Semaphore(0)
    before = threading.active_count()

    def own():
        KeepAlive(lambda keep_waiting: given.release(), 0.02).__enter__()
        given.acquire(timeout=10)

    owner = threading.Thread(target=own)
    owner.start()
    owner.join(timeout=10)
    end = time.monotonic() + 10
    while threading.active_count() > before and time.monotonic() < end:
        time.sleep(0.001)
    assert threading.active_count() == before


@contextlib.contextmanager
def pressing(port):
    command = [sys.executable, "-m", "tests.robot.pressing_host", port]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as running:
        try:
            yield running
        finally:
            running.kill()


@pytest.fixture
def paced():
    rig = with_values(load_rig(), {"controller.timeout": "10 s"})
    with StandIn(rig, load_scene("ideal"), paced=True) as stand_in:
        yield stand_in


@POSIX
@pytest.mark.parametrize(
    "kind", [signal.SIGKILL, pytest.param(signal.SIGSTOP, marks=pytest.mark.slow)]
)
def test_a_host_that_is_killed_or_frozen_in_mid_press(paced, kind):
    port = paced.serial_port
    with pressing(port) as host:
        where = host.stdout.readline().split()
        assert where[-1] == "moving"
        os.kill(host.pid, kind)
        if kind == signal.SIGKILL:
            host.wait(timeout=10)
            line = Line(open_port(port, 115200, 10.0), port, 10.0)
        else:
            import serial

            line = Line(serial.Serial(port, 115200, timeout=10), port, 10.0)
        line.send_unchecked([])
        line.ask("EO 1")
        line.echo = True
        clock = iter(range(10_000)).__next__
        Polling(clock, lambda seconds: None, "amplifiers").until(
            lambda: line.read("_MOA", "_MOB", "_XQ0") == [1, 1, -1], "the watchdog", 9000
        )
        state = line.read("_XQ0", "_XQ1", "_SCA", "_SCB", "_OFA", "@OUT[1]", "wleft")
        assert state == [-1, -1, 7, 7, 0, 0, 0]
        line.close()


def test_a_host_without_signs_of_life_gets_the_reason(paced):
    rig = with_values(paced.rig, {"controller.watchdog_period": "100 ms"})
    controller = GalilController(rig, keep_alive=lambda *_: contextlib.nullcontext())
    with controller, pytest.raises(MotionFault, match="watchdog has switched") as caught:  # noqa: PT012, SIM117
        with controller.powered():
            controller.home()
            controller.move_to([-100_000, -600_000], 20_000)
    assert "confirms it" in str(caught.value)
    assert paced.bench.firmware.motors_on == (False, False)

"""A host that is lost: the controller switches the motors off by itself."""

import threading
import time

import pytest

from sautereau.rig.load import load_rig, with_values
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.drivers.keep_alive import KeepAlive
from sautereau.robot.errors import LineLost, MotionFault
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.scene import load_scene
from tests.robot.motions import no_keep_alive


def test_signs_of_life_come_until_the_block_is_left():
    given = threading.Semaphore(0)
    before = threading.active_count()
    with KeepAlive(lambda keep_waiting: given.release(), 0.02):
        assert all(given.acquire(timeout=60) for _ in range(5))
    assert threading.active_count() == before


def test_a_lost_sign_of_life_does_not_end_them():
    given = threading.Semaphore(0)

    def fail(keep_waiting):
        given.release()
        raise LineLost("gone")

    with KeepAlive(fail, 0.004):
        assert all(given.acquire(timeout=60) for _ in range(5))


def test_a_wait_for_an_answer_ends_when_the_block_is_left():
    waiting = threading.Event()

    def wait(keep_waiting):
        assert keep_waiting()
        waiting.set()
        while keep_waiting():
            threading.Event().wait(0.001)

    with KeepAlive(wait, 0.004):
        assert waiting.wait(timeout=60)


def test_a_dead_thread_gives_none():
    """The thread that owns the power dies without leaving its block."""
    given = threading.Semaphore(0)
    before = threading.active_count()

    def own():
        KeepAlive(lambda keep_waiting: given.release(), 0.02).__enter__()
        given.acquire(timeout=60)

    owner = threading.Thread(target=own)
    owner.start()
    owner.join(timeout=60)
    end = time.monotonic() + 60
    while threading.active_count() > before and time.monotonic() < end:
        time.sleep(0.001)
    assert threading.active_count() == before


def test_a_host_without_signs_of_life_gets_the_reason():
    values = {"controller.timeout": "10 s", "controller.watchdog_period": "100 ms"}
    with StandIn(with_values(load_rig(), values), load_scene("ideal"), paced=True) as paced:
        controller = GalilController(paced.rig, keep_alive=no_keep_alive)
        with controller, pytest.raises(MotionFault, match="watchdog has switched") as caught:  # noqa: PT012, SIM117
            with controller.powered():
                controller.home()
                controller.move_to([-100_000, -600_000], 20_000)
        assert "confirms it" in str(caught.value)
        assert paced.bench.firmware.motors_on == (False, False)

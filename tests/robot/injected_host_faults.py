"""Faults of the host: signals, kills, disks, other programs, and edited rigs."""

import os
import shutil
import signal
import subprocess
import threading
import time
from functools import partial

import numpy as np

from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recording import Recording
from sautereau.rig.document import rig_json
from sautereau.rig.load import load_rig, with_values
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.experiment.plan import Plan, Row
from sautereau.robot.experiment.session_folder import SessionFolder
from tests.robot.fault_desk import HOLD
from tests.robot.injected_faults import (
    ALONE,
    FAULTS,
    HOST,
    NOT_OFF,
    OFF,
    SERIAL,
    SOON,
    TCP,
    Fault,
    fault,
)

CHILD = """
import sys
from pathlib import Path
from sautereau.rig.document import rig_from_json
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.experiment.session import Item, make_presses
from sautereau.trajectory.press import plan_press
from tests.presses import mute_scene
rig = rig_from_json(Path(sys.argv[1]).read_text())
items = [Item(rig, plan_press(rig))] * int(sys.argv[3])
make_presses(GalilController(rig), Path(sys.argv[2]), items)
"""


def interrupt(desk, pattern):
    """Press Ctrl-C when the controller takes a command."""
    desk.on_command(pattern, lambda: os.kill(os.getpid(), signal.SIGINT) or True)
    desk.press()


for where, moment, pattern in (
    ("state off", "when it is connected", "TM 1000"),
    ("state stopped", "when the motors are switched on", "SH"),
    ("homing", "when it homes", "BG"),
    ("state homed", "when it moves to the key", "PA"),
    ("loading", "while segments are sent", "PVB"),
    ("state loaded", "when the capture is prepared", "RA"),
    ("state armed", "when the motion is started", "XQ #PRESS"),
    ("reading", "when the capture is read", "QU"),
):
    off = (SOON, "interrupted") if where == "state off" else (HOST, "interrupted.*" + OFF)
    run = partial(interrupt, pattern=pattern)
    FAULTS.append(Fault(f"ctrl c in {where}", f"Ctrl-C {moment}", *off, run))


@fault("Ctrl-C 30 ms after the trigger", HOST, "interrupted.*" + OFF, quick=True)
def ctrl_c_in_the_press(desk):
    desk.at(1, 0.03, lambda: os.kill(os.getpid(), signal.SIGINT))
    desk.press()


def child_pressing(desk, end, wait=False, n=1, command=""):
    """Press from another process, and end it 30 ms after the trigger; or let it report.

    Where a command is given, it is ended when the controller receives that.
    """
    with desk.stand_in() as stand_in:
        rig_file = desk.out.with_suffix(".json")
        rig_file.write_text(rig_json(stand_in.rig))
        words = ("-c", CHILD, rig_file, desk.out, n)
        with desk.server.start(*words, stderr=subprocess.PIPE) as child:
            if command:
                desk.on_command(command, lambda: end(child) or True)
            else:
                desk.at(1, 0.03, lambda: end(child))
            deadline = time.monotonic() + 60
            while not desk.off and child.poll() is None and time.monotonic() < deadline:
                time.sleep(0.01)
            desk.await_off()
            if not wait:
                child.kill()
            _, errors = child.communicate(timeout=60)
    shown = errors.strip().partition("sautereau.robot.errors.")[2] if wait else ""
    desk.error = RuntimeError(shown or "none: the host is dead")


@fault("kill -9 of the host 30 ms after the trigger", ALONE, "dead", quick=True)
def host_killed(desk):
    child_pressing(desk, lambda child: child.kill())


@fault("the host stopped (SIGSTOP) 30 ms after the trigger", ALONE, "dead")
def host_frozen(desk):
    child_pressing(desk, lambda child: child.send_signal(signal.SIGSTOP))


@fault("the host stopped for 1.5 s 30 ms after the trigger", ALONE, f"did not renew it.*{OFF}")
def host_frozen_for_a_while(desk):
    child_pressing(desk, freeze, wait=True)


def freeze(child):
    child.send_signal(signal.SIGSTOP)
    threading.Timer(1.5, lambda: child.send_signal(signal.SIGCONT)).start()


@fault(
    "the host stopped for 1.5 s after a press, before the next",
    ALONE,
    f"not started: the controller's watchdog.*did not renew it.*{OFF}",
)
def host_frozen_between_presses(desk):
    child_pressing(desk, freeze, wait=True, n=2, command="QU trqB")


@fault(
    "another client sets gains, OE and limits 30 ms after the trigger",
    HOST,
    f"KP of axis A .joint 1. is 300, set to 6.*OE of .* is 0.*ER of .* is 1000000.*{OFF}",
    ports=TCP,
)
def settings_of_another_client(desk):
    def intrude():
        letter = desk.bench.firmware.connect(2000)
        desk.bench.firmware.receive(b"OE 0,0;ER 1000000,1000000;KP 300,300\r", letter)

    desk.at(1, 0.03, intrude)
    desk.press(n=2)


@fault(
    "the session's folder removed 30 ms after the trigger",
    HOST,
    f"press-0001.*cannot be written.*removed, with the samples.*{OFF}",
    quick=True,
)
def folder_removed_in_the_press(desk):
    desk.at(1, 0.03, lambda: shutil.rmtree(desk.out))
    desk.press()


@fault(
    "another client stops all programs 30 ms after the trigger",
    ALONE,
    "program was replaced",
    ports=TCP,
)
def program_stopped_by_another_client(desk):
    def intrude():
        desk.bench.firmware.receive(b"HX\r", desk.bench.firmware.connect(2000))

    desk.at(1, 0.03, intrude)
    desk.press(rig=HOLD)


@fault("the press's file may not grow beyond 100 kB", HOST, f"cannot be written.*{OFF}")
def disk_full_in_the_press(desk):
    with desk.stand_in() as stand_in:
        desk.at(1, 0.0, lambda: None)
        done = desk.command(stand_in, largest_file=100_000)
        desk.await_off()
    desk.error = RuntimeError(done)


@fault(
    "the host's clock set back an hour 30 ms after the trigger; the press continues to its end",
    HOST,
    "none: .*complete",
)
def host_clock_set_back(desk):
    shift = [0]
    defaults = Recording.__init__.__kwdefaults__
    desk.patch.setitem(defaults, "clock", lambda: time.time_ns() - shift[0])
    desk.at(1, 0.03, lambda: shift.append(shift.pop() + 3_600_000_000_000))
    before = time.time_ns()
    desk.press()
    assert desk.error is None
    assert shift[0] > 0
    assert before < read_recording(desk.out / "press-0001.mcap").t0_ns < time.time_ns()
    desk.error = RuntimeError("none: the recording is complete, dated by the clock at its start")


def burst(desk, pattern=None, seed=0):
    """Send 2 to 6 signals to a pressing command: from a command on, or at random."""
    random = np.random.default_rng(seed)
    with desk.stand_in() as stand_in:
        begun = threading.Event()
        if pattern is not None:
            desk.on_command(pattern, lambda: begun.set() or True)
        process = desk.start_command(stand_in)
        if pattern is None:
            end = time.monotonic() + 60
            while not desk.on and time.monotonic() < end:
                time.sleep(0.01)
            time.sleep(random.uniform(0, 1.5))
            desk.note_fault()
        else:
            assert begun.wait(60)
        for gap in random.exponential(0.02, random.integers(2, 7)):
            process.send_signal(random.choice([signal.SIGINT, signal.SIGTERM]))
            time.sleep(gap)
        _, errors = process.communicate(timeout=60)
        desk.await_off()
    assert process.returncode in (128 + signal.SIGINT, 128 + signal.SIGTERM)
    desk.error = RuntimeError(errors)


for where, moment, pattern in (
    ("power", "when the motors are switched on", "SH"),
    ("homing", "when it homes", "BG"),
    ("the press", "when the motion is started", "XQ #PRESS"),
    ("reading", "when the capture is read", "QU"),
):
    said = f"interrupted.*({OFF}|{NOT_OFF})"
    done = f"2 to 6 SIGINT or SIGTERM {moment}, about 20 ms apart"
    run = partial(burst, pattern=pattern)
    FAULTS.append(Fault(f"signals in {where}", done, HOST, said, run))


@fault("a second host opens the same port", HOST, "another program uses it: end that", ports=SERIAL)
def two_processes_on_one_port(desk):
    with desk.stand_in() as stand_in:
        first, second = GalilController(stand_in.rig), GalilController(stand_in.rig)
        with first:
            desk.attempt(second.connect)


@fault(
    "another program writes to the port during the press",
    HOST,
    "shares the line|echoed|answered",
    ports=SERIAL,
)
def stray_writer_on_the_port(desk):
    written = []

    def controller(rig):
        receive = desk.machine.receive

        def received(data, *port, **named):
            before, written[:] = b"".join(written), []
            return receive(before + data, *port, **named)

        desk.machine.receive = received
        return rig

    desk.on_command("XQ #PRESS", lambda: written.append(b"TP;") or True)
    desk.press(controller=controller)


@fault("the rig's limits are narrowed after planning", HOST, "outside arm limits.*" + OFF)
def rig_edited_between_plan_and_press(desk):
    desk.press(controller=lambda rig: with_values(rig, {"arm.upper_limits": ["80 deg", "-89 deg"]}))


@fault(
    "the rig is edited before a session is continued", SOON, "another|differ|not the same|changed"
)
def rig_edited_in_a_session(desk):
    rig = load_rig()
    edited = with_values(rig, {"press.jack_speed": "0.1 m/s"})
    SessionFolder(desk.out, Plan(rig, (Row(rig, 2),), 0, 0.0, "", {}), None, None).start()
    plan = Plan(edited, (Row(edited, 2),), 0, 0.0, "", {})
    desk.attempt(lambda: SessionFolder(desk.out, plan, None, None))


@fault("the folder cannot be written", SOON, "session folder.*not a folder; give a folder")
def no_folder_to_record_into(desk):
    desk.out.write_text("a file")
    desk.press()

"""After every fault the motors are off, a message gives the reason, and no recording is lost.

Run alone with ``SAUTEREAU_FAULTS=docs/faults.md`` and ``-m "slow or not slow"`` (that is
``make faults``) it writes the table of results. The stand-in runs in real time here, so that
the arm continues to move while the host reacts.
"""

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import sautereau.sim_backend.devices.galil.firmware as firmware_module
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recording import Recording
from sautereau.daq.file.recovery import recover
from sautereau.rig.errors import SautereauError
from sautereau.rig.load import load_rig, rig_from_json, rig_json, with_values
from sautereau.rig.text import rig_text
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.experiment.plan import Plan
from sautereau.robot.experiment.plan_table import Row
from sautereau.robot.experiment.session import Item, make_presses
from sautereau.robot.experiment.session_folder import SessionFolder
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.controller_part import ControllerUnit
from sautereau.sim_backend.devices.galil.faults import CommandError
from sautereau.sim_backend.devices.galil.motion import StopCode
from sautereau.trajectory.press import plan_press
from tests.forked import Command, CommandServer
from tests.presses import QUICK, mute_scene

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals, pseudo-terminals")

SOON = 50e-3
"""s of simulated time until the motors are off, where the controller detects the fault."""
ALONE = 0.5 + SOON
"""s of simulated time, where only the controller's watchdog detects it."""
HOST = None
"""Where the host detects it: the time depends on this machine."""
OFF = "the controller confirms it"
NOT_OFF = "NOT confirmed off"
HOLD = {"press.bottom_hold": "1 s"}
CHILD = """
import sys
from pathlib import Path
from sautereau.rig.load import rig_from_json
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.experiment.session import Item, make_presses
from sautereau.trajectory.press import plan_press
from tests.presses import mute_scene
rig = rig_from_json(Path(sys.argv[1]).read_text())
make_presses(GalilController(rig), Path(sys.argv[2]), [Item(rig, plan_press(rig))])
"""


@dataclass
class Desk:
    """A stand-in with fault injection, and what came of a press on it."""

    out: Path
    patch: pytest.MonkeyPatch
    port: str = "serial"
    server: CommandServer | None = None
    error: BaseException | None = None
    struck: float | None = None
    """s on the controller's clock, time of the fault; None for before the motors were on."""
    off: float | None = None
    """s on the controller's clock, when the motors went off for the last time."""
    on: bool = False
    was_on: bool = False
    due: list[tuple[int, float, Callable[[], object]]] = field(default_factory=list)
    begins: Callable[[], bool] = lambda: False
    """Whether the fault occurs now, where it was prepared before."""
    detected: bool = False
    """Whether the time counts from when the controller detects the fault."""

    def press(self, *, n=1, seed=0, rig=None, finger="ideal", controller=None, **faults):
        """Press; the outcome is in `error`, `struck`, `off` and `out`."""
        with self.stand_in(rig, finger, seed, faults) as stand_in:
            wired = controller(stand_in.rig) if controller else stand_in.rig
            self.attempt(
                lambda: make_presses(
                    GalilController(wired), self.out, [Item(wired, plan_press(stand_in.rig))] * n
                )
            )
            self.await_off()

    def stand_in(self, rig=None, finger="ideal", seed=0, faults=None) -> StandIn:
        """Return a stand-in whose motors and faults are observed."""
        unit = ControllerUnit(interface="ethernet") if self.port == "tcp" else None
        scene = mute_scene(finger, faults=faults, controller=unit)
        values = QUICK | {"controller.timeout": "2 s"} | HOLD | (rig or {})
        stand_in = StandIn(with_values(load_rig(), values), scene, seed, paced=True)
        self.watch(stand_in.bench, faults or {})
        return stand_in

    def watch(self, bench, faults) -> None:
        self.bench = bench
        tick, receive = bench.tick, bench.firmware.receive
        at = next((f for f in faults.values() if "press" in f and "at" in f), None)
        if at is not None and not self.detected:
            seconds = float(at["at"].removesuffix(" ms")) * 1e-3
            self.at(at["press"], seconds, lambda: None)

        def note():
            on = any(bench.firmware.motors_on)
            if self.on and not on:
                self.off = bench.firmware.now
            self.on, self.was_on = on, on or self.was_on

        def ticked():
            for each in list(self.due):
                press, later, do = each
                if bench.injection.past(press, later):
                    self.due.remove(each)
                    self.note_fault()
                    do()
            tick()
            if self.begins():
                self.note_fault()
            note()

        def received(data, *port, **named):
            answer = receive(data, *port, **named)
            note()
            return answer

        bench.tick, bench.firmware.receive = ticked, received

    def note_fault(self) -> None:
        """Note that the fault occurs now."""
        if self.struck is None and self.was_on:
            self.struck = self.bench.firmware.now

    def at(self, press, seconds, do) -> None:
        """Call ``do`` a number of seconds after the edge of a press."""
        self.due.append((press, seconds, do))

    @property
    def machine(self):
        return self.bench.firmware

    def on_command(self, pattern, do, *, times=1, occurs=True) -> None:
        """Call ``do`` in place of a command that the controller receives.

        The command is executed where ``do`` returns true; a raised CommandError refuses it. The
        fault occurs then, or when it ``begins``.
        """
        left, execute = [times], firmware_module.execute

        def hooked(machine, command, thread=None):
            if left[0] and re.match(pattern, command):
                left[0] -= 1
                if occurs:
                    self.note_fault()
                if not do():
                    return None
            return execute(machine, command, thread)

        self.patch.setattr(firmware_module, "execute", hooked)

    def start_command(self, stand_in) -> Command:
        """Start `sautereau press` on a stand-in, in a process of its own."""
        assert self.server is not None
        rig = self.out.with_suffix(".toml")
        rig.write_text(rig_text(stand_in.rig))
        words = ("press", rig, "--out", self.out)
        return self.server.start(*words, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)

    def command(self, stand_in, **limits) -> str:
        """Run `sautereau press` on a stand-in; return what it says of an error."""
        assert self.server is not None
        rig = self.out.with_suffix(".toml")
        rig.write_text(rig_text(stand_in.rig))
        done = self.server.run("press", rig, "--out", self.out, folder=self.out.parent, **limits)
        return done.stderr

    def attempt(self, act) -> None:
        """Call something that fails, as the command line does."""
        try:
            act()
        except (SautereauError, KeyboardInterrupt) as error:
            self.error = error

    def await_off(self) -> None:
        """Wait until the controller alone has switched the motors off."""
        end = time.monotonic() + 20
        while self.on and time.monotonic() < end:
            time.sleep(0.01)

    @property
    def after(self) -> float:
        """s from the fault to the motors off; 0 where they never were on."""
        assert not self.on
        if self.struck is None or self.off is None:
            return 0.0
        return max(0.0, self.off - self.struck)

    @property
    def message(self) -> str:
        assert self.error is not None, "nothing went wrong"
        kind = "interrupted: " if isinstance(self.error, KeyboardInterrupt) else ""
        return kind + "\n".join([str(self.error), *getattr(self.error, "__notes__", [])])

    @property
    def recording(self) -> str:
        """The recordings of the press, which are always readable."""
        complete = sorted(self.out.glob("*.mcap"))
        found = [f"{len(complete)} complete"] if complete else []
        for path in complete:
            read_recording(path)
        for part in sorted(self.out.glob("*.part")):
            try:
                read_recording(part)
                found.append("one incomplete, closed")
            except SautereauError:
                found.append(self._recovered(part))
        return ", ".join(found) or "none started"

    def _recovered(self, part: Path) -> str:
        try:
            recover(part, self.out / "recovered.mcap")
        except SautereauError as error:
            if not re.search("no sample of it is left|none of its samples", str(error)):
                raise
            return "one without a sample"
        return "one incomplete, `recover` reads it"


@dataclass(frozen=True)
class Fault:
    name: str
    done: str
    limit: float | None
    said: str
    run: Callable[[Desk], None]
    quick: bool = False
    ports: tuple[str, ...] = ("serial", "tcp")


FAULTS: list[Fault] = []


SERIAL, TCP = ("serial",), ("tcp",)
GARBLED = "echoed|answer|refused|holds"


def fault(done, limit, said, quick=False, ports=SERIAL + TCP):
    """Register a fault: what is done, until when the motors must be off, the message, the ports."""

    def register(run):
        name = run.__name__.replace("_", " ")
        FAULTS.append(Fault(name, done, limit, said, run, quick, ports))
        return run

    return register


# The cable and the line.


@fault("silent after 20 bytes", SOON, "did not answer.*check its power, the cable", quick=True)
def cable_out_before_anything(desk):
    desk.press(rig={"controller.timeout": "0.3 s"}, cable_out={"after_bytes": 20})


@fault("silent from FE on", ALONE, f"did not answer.*{NOT_OFF}")
def cable_out_in_homing(desk):
    desk.on_command("FE", lambda: cut(desk))
    desk.press(rig={"controller.timeout": "0.6 s"}, cable_out={"press": 99})


def cut(desk):
    """Disconnect the controller's cable after this command."""
    desk.bench._line.carry = lambda data, receive: b""
    return True


@fault("silent 30 ms after the trigger", ALONE, f"did not answer.*{NOT_OFF}")
def cable_out_in_the_press(desk):
    rig = {"controller.timeout": "0.6 s"}
    desk.press(rig=rig, cable_out={"press": 1, "at": "30 ms"})


@fault("USB adapter pulled 30 ms after the trigger", ALONE, f"lost.*check the.*cable.*{NOT_OFF}")
def adapter_out_in_the_press(desk):
    desk.press(cable_out={"press": 1, "at": "30 ms", "port_closes": True})


@fault("silent from the reading of the capture on", ALONE, f"did not answer.*{NOT_OFF}")
def cable_out_after_the_press(desk):
    desk.on_command("QU", lambda: cut(desk))
    desk.press(rig={"controller.timeout": "0.6 s"}, cable_out={"press": 99})


@fault("0.1 % of all bytes lost", HOST, GARBLED, ports=SERIAL)
def bytes_dropped(desk):
    desk.press(rig={"controller.timeout": "0.5 s"}, line={"dropped": 1e-3})


@fault("0.05 % of the bytes to the controller with a bit flipped", HOST, GARBLED, ports=SERIAL)
def bits_flipped_to_the_controller(desk):
    desk.press(line={"flipped": 5e-4, "towards": "controller"})


@fault("0.05 % of the bytes to the host with a bit flipped", HOST, GARBLED, ports=SERIAL)
def bits_flipped_to_the_host(desk):
    desk.press(line={"flipped": 5e-4, "towards": "host"})


@fault("5 % of all bytes lost from the trigger on", HOST, GARBLED, ports=SERIAL)
def bytes_dropped_in_the_press(desk):
    desk.at(1, 0.0, lambda: None)
    desk.press(rig={"controller.timeout": "0.5 s"}, line={"dropped": 0.05, "press": 1})


@fault("answers 0.5 s late, and 0.1 s is allowed", SOON, "did not answer")
def answers_late(desk):
    desk.press(rig={"controller.timeout": "0.1 s"}, line={"delay": "0.5 s"})


# The controller.


@fault("power off and on 30 ms after the trigger", SOON, "controller")
def controller_reset_in_the_press(desk):
    desk.at(1, 0.03, lambda: desk.machine.power_up())
    desk.press()


@fault("power off and on while the motion is loaded", SOON, "controller")
def controller_reset_before_the_press(desk):
    desk.on_command("RA", lambda: desk.machine.power_up() or True)
    desk.press()


@fault("BG answers ?, code 22", HOST, "refused 'BG AB'.*22.*limit is active.*" + OFF)
def command_refused(desk):
    desk.on_command("BG", lambda: refuse(22))
    desk.press()


def refuse(code):
    raise CommandError(code)


@fault(
    "two PVT segments of joint 2 are lost in the controller",
    HOST,
    "segments were sent.*FIFO took.*" + OFF,
)
def segments_lost(desk):
    desk.on_command("PVB=", lambda: False, times=2)
    desk.press()


@fault("the segment that ends the motion is lost", HOST, "FIFO took|empty FIFO")
def fifo_starved(desk):
    desk.begins = lambda: desk.machine.axes[0].stop_code == StopCode.PVT_STARVED
    desk.on_command("PV[AB]=0,0,0$", lambda: False, times=2, occurs=False)
    desk.press()


@fault("the revision is of another firmware, without PVT", SOON, "has no PVT mode.*update", True)
def firmware_without_pvt(desk):
    desk.on_command("MG _PVA$", lambda: refuse(1))
    desk.press()


@fault("something else answers on the port", SOON, "gives its revision as DMC.*correct")
def no_galil(desk):
    def controller(rig):
        receive, known = desk.machine.receive, b"DMC4020 Rev 1.3a-SIM sautereau stand-in"
        desk.machine.receive = lambda *data, **named: receive(*data, **named).replace(
            known, b"I AM A PRINTER"
        )
        return rig

    desk.press(controller=controller)


@fault("EO 1 does nothing", SOON, "does not echo what it receives", ports=SERIAL)
def no_echo(desk):
    desk.on_command("EO 1", lambda: False)
    desk.press()


@fault("SH does nothing: the emergency stop is pressed", SOON, "motors are still off.*emergency")
def motors_stay_off(desk):
    desk.on_command("SH", lambda: False)
    desk.press()


@fault("XQ #WATCH does nothing", SOON, "watchdog does not run")
def watchdog_does_not_run(desk):
    desk.on_command("XQ #WATCH", lambda: False)
    desk.press()


@fault("MO does nothing the first time", HOST, "interrupted.*" + OFF)
def motors_stay_on(desk):
    desk.at(1, 0.03, lambda: os.kill(os.getpid(), signal.SIGINT))
    desk.on_command("AB", lambda: desk.on_command("MO", lambda: False) or True)
    desk.press()


# The arm.


def limit_here(desk):
    """Set both limits of joint 1 to its position."""
    axis = desk.machine.axes[0]
    axis.settings["FL"] = axis.settings["BL"] = axis.reported


@fault("a limit of joint 1 becomes active", SOON, "joint 1 stopped by the .* limit.*remove")
def limit_hit(desk):
    desk.at(1, 0.03, lambda: limit_here(desk))
    desk.press()


@fault("the abort input becomes active", SOON, "stopped by the abort input")
def emergency_stop(desk):
    desk.press(switch_closed={"switch": "abort", "press": 1, "at": "30 ms"})


@fault("a limit switch of joint 2 closes", SOON, "joint 2 stopped by the forward limit")
def limit_switch_closes(desk):
    desk.press(switch_closed={"switch": "forward", "joint": 2, "press": 1, "at": "30 ms"})


@fault("the amplifier of joint 1 reports overcurrent", SOON, "joint 1 .*amplifier fault")
def amplifier_fault(desk):
    desk.press(amplifier_fault={"joint": 1, "press": 1, "at": "30 ms"})


def when_detected(desk):
    """Count from the sample in which the controller sees the fault: it takes motion to show."""
    desk.detected = True
    axes = range(2)
    desk.begins = lambda: any(
        desk.machine.exceeds_error_limit(i) or desk.machine.axes[i].encoder_failed for i in axes
    )


@fault("the encoder of joint 1 is lost", SOON, "joint [12] (switched off|stopped by an encoder)")
def encoder_lost(desk):
    when_detected(desk)
    desk.press(finger="servo", encoder_loss={"joint": 1, "press": 1, "at": "30 ms"})


def stall(desk, joint):
    when_detected(desk)
    desk.press(finger="servo", stall={"joint": joint, "press": 1, "at": "30 ms"})


for joint in (1, 2):
    name = f"stalled motor of joint {joint}"
    done = f"joint {joint} stalls 30 ms after the trigger"
    said = f"joint {joint} switched off by a following error.*remove"
    FAULTS.append(Fault(name, done, SOON, said, partial(stall, joint=joint)))


@fault("the encoder reads 30,000 counts less", SOON, "joint 2 switched off by a following error")
def encoder_slips_far(desk):
    slip = {"joint": 2, "counts": -30_000, "press": 1, "at": "30 ms"}
    desk.press(finger="servo", slip=slip)


@fault("the encoder reads 500 counts more; home is checked", HOST, "home switch of joint 1.*slipp")
def encoder_slips_a_little(desk):
    with desk.stand_in(HOLD, "servo", 0, {"slip": {"joint": 1, "counts": 500}}) as stand_in:
        controller = GalilController(stand_in.rig)

        def look():
            with controller, controller.powered():
                controller.home()
                desk.note_fault()
                desk.bench.plant.slip(1, 500)
                controller.check_home()

        desk.attempt(look)


# The card.


@fault("the card is unplugged at sample 5000", HOST, "-201003.*" + OFF, quick=True)
def daq_gone(desk):
    desk.at(1, 5000 / 51200, lambda: None)
    desk.press(device_gone={"press": 1, "sample": 5000})


@fault("the gRPC server dies at sample 5000", HOST, "no answer while reading.*" + OFF)
def daq_server_gone(desk):
    desk.at(1, 5000 / 51200, lambda: None)
    desk.press(server_gone={"press": 1, "sample": 5000})


@fault("samples are overwritten from 5000 on", HOST, "-200279.*" + OFF)
def daq_overrun(desk):
    desk.at(1, 5000 / 51200, lambda: None)
    desk.press(overrun={"press": 1, "sample": 5000})


@fault("no server is at the card's address", HOST, "daq.address.*no server")
def daq_not_there(desk):
    desk.press(controller=lambda rig: with_values(rig, {"daq.address": "127.0.0.1:9"}))


@fault("the edge does not reach the card", HOST, "no edge on /Dev1/PFI0.*cable.*" + OFF)
def trigger_missing(desk):
    desk.at(1, 0.0, lambda: None)
    desk.press(rig={"daq.trigger_timeout": "0.4 s"}, trigger_missing={"press": 1})


# The host.


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


def child_pressing(desk, end, wait=False):
    """Press from another process, and end it 30 ms after the trigger; or let it report."""
    with desk.stand_in() as stand_in:
        rig_file = desk.out.with_suffix(".json")
        rig_file.write_text(rig_json(stand_in.rig))
        words = ("-c", CHILD, rig_file, desk.out)
        with desk.server.start(*words, stderr=subprocess.PIPE) as child:
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


@fault("the host stopped for 1.5 s 30 ms after the trigger", ALONE, f"no sign of life.*{OFF}")
def host_frozen_for_a_while(desk):
    def freeze(child):
        child.send_signal(signal.SIGSTOP)
        threading.Timer(1.5, lambda: child.send_signal(signal.SIGCONT)).start()

    child_pressing(desk, freeze, wait=True)


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
    FAULTS.append(Fault(f"signals in {where}", done, HOST, said, run, where == "the press"))


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


@fault("the folder cannot be written", SOON, "session folder.*give a folder that can be written")
def no_folder_to_record_into(desk):
    desk.out.write_text("a file")
    desk.press()


RESULTS: dict[tuple[str, str], tuple[float, str, str]] = {}
"""Of each fault and port: s until off, recordings and message."""


def cases():
    """Return the faults over each port; those that the quick run skips are marked slow."""
    return [
        pytest.param(
            each,
            port,
            id=f"{each.name.replace(' ', '-')}-{port}",
            marks=() if each.quick and port == each.ports[0] else pytest.mark.slow,
        )
        for each in FAULTS
        for port in each.ports
    ]


@pytest.mark.parametrize(("each", "port"), cases())
def test_the_arm_ends_off_and_a_message_says_why(each, port, tmp_path, monkeypatch, command_server):
    desk = Desk(tmp_path / "out", monkeypatch, port, command_server)
    each.run(desk)
    message = " ".join(desk.message.split())
    ports = r"/dev/\S*\d|(tcp://)?127\.0\.0\.1:\d+"
    message = re.sub(ports, "PORT", message).replace(str(tmp_path), "OUT")
    RESULTS[each.name, port] = desk.after, desk.recording, message
    assert re.search(each.said, message)
    assert not desk.on
    if each.limit is not None:
        assert desk.after <= each.limit


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_signals_at_any_time_leave_the_arm_off_and_say_so(
    seed, tmp_path, monkeypatch, command_server
):
    desk = Desk(tmp_path / "out", monkeypatch, ("serial", "tcp")[seed % 2], command_server)
    burst(desk, seed=seed)
    assert re.search(f"{OFF}|{NOT_OFF}", desk.message)
    assert not desk.on


def table() -> str:
    """Return the rows of the page."""
    rows = []
    for each in FAULTS:
        found = [RESULTS[each.name, port] for port in each.ports]
        off = {
            port: f"{after * 1e3:.0f}"
            for port, (after, _, _) in zip(each.ports, found, strict=True)
        }
        who = {SOON: "50", ALONE: "550", HOST: "host"}[each.limit]
        _, recording, message = found[0]
        shown = message.replace("|", "/")
        rows.append(
            f"| {each.name} | {each.done} | {who} | {off.get('serial', '-')} |"
            f" {off.get('tcp', '-')} | {recording} | {shown} |"
        )
    return "\n".join(rows)


@pytest.fixture(scope="module", autouse=True)
def _page():
    """Write the table if it is requested and every fault has been injected."""
    yield
    path = os.environ.get("SAUTEREAU_FAULTS")
    if path and all((each.name, port) in RESULTS for each in FAULTS for port in each.ports):
        page = Path(path)
        head, _, _ = page.read_text(encoding="utf-8").partition("| fault |")
        titles = ("fault", "what was done", "limit, ms", "serial, ms", "TCP, ms", "recording")
        head += f"| {' | '.join((*titles, 'message'))} |\n|{'---|' * 7}\n"
        page.write_text(f"{head}{table()}\n", encoding="utf-8")


@pytest.mark.slow
def test_the_stand_in_itself_presses_without_a_fault(tmp_path, monkeypatch):
    desk = Desk(tmp_path / "out", monkeypatch)
    desk.press()
    assert desk.error is None
    assert desk.recording == "1 complete"
    assert rig_from_json(rig_json(load_rig())) == load_rig()

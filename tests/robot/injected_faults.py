"""The faults: what is done, until when the motors must be off, and what the message says."""

import os
import signal
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from sautereau.rig.load import with_values
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.sim_backend.devices.galil.answers import CommandError
from sautereau.sim_backend.devices.galil.motion import StopCode
from tests.robot.fault_desk import HOLD, Desk

SOON = 50e-3  # s of simulated time until the motors are off, where the controller detects the fault
ALONE = 0.5 + SOON  # s of simulated time, where only the controller's watchdog detects it
HOST = None  # Where the host detects it: the time depends on this machine
OFF = "the controller confirms it"
NOT_OFF = "NOT confirmed off"


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


def press_with_answers(desk, known, other):
    """Press with a controller that answers one text in place of another."""

    def controller(rig):
        receive = desk.machine.receive
        desk.machine.receive = lambda *data, **named: receive(*data, **named).replace(known, other)
        return rig

    desk.press(controller=controller)


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


@fault(
    "the revision is of another firmware, without PVT", SOON, "has no PVT mode.*without -FAST", True
)
def firmware_without_pvt(desk):
    press_with_answers(desk, b"Rev 1.3a-SIM", b"Rev 1.3a-FAST-SIM")


@fault("something else answers on the port", SOON, "gives its revision as DMC.*correct")
def no_galil(desk):
    press_with_answers(desk, b"DMC4020 Rev 1.3a-SIM sautereau stand-in", b"I AM A PRINTER")


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

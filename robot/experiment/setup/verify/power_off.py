"""Group A, with the power of the amplifiers cut: identity, wiring, line, and timing."""

import math
import time

import numpy as np

from sautereau.daq.errors import DaqError
from sautereau.rig.load import with_values
from sautereau.robot.drivers.galil.arrays import VOLTS_RECORDED
from sautereau.robot.drivers.galil.dmc import FAULT, LONGEST_LINE, PRESS, PUSHES, RATE, WATCH
from sautereau.robot.drivers.galil.driver import GalilDriver
from sautereau.robot.drivers.serial_port import open_port
from sautereau.robot.errors import CommandRefused
from sautereau.robot.experiment.setup.step import Declined
from sautereau.robot.experiment.setup.verify.workbench import VerifyStep, Workbench

_KEPT = ("_TM", "_BWA", "_BWB", "_CN0", "_CN1", "_OEA", "_OEB", "_LDA", "_LDB", "_AGA", "_AGB")
_BITS = {
    "_LFA": "the forward limit switch of joint 1",
    "_LRA": "the reverse limit switch of joint 1",
    "_LFB": "the forward limit switch of joint 2",
    "_LRB": "the reverse limit switch of joint 2",
    "_HMA": "the home switch of joint 1",
    "_HMB": "the home switch of joint 2",
    "_AB": "the abort input (emergency stop)",
}
_ROWS = 24
_EVERY = 4  # samples between two rows of the timing program
_TIMING = (
    "#TIMES",
    "AT 0",
    *(f"AT -{_EVERY},1;vtime[{row}]=TIME" for row in range(_ROWS)),
    "timed=1",
    "EN",
    "#BUSY",
    "busy=busy+1",
    "JP #BUSY,timed=0",
    "EN",
)
_RECORDED = 16  # rows


def look(bench: Workbench) -> None:
    """Look at a controller before it is set up; nothing is changed but its echo."""
    settings = bench.rig.controller
    port = open_port(settings.port, settings.baud_rate, settings.timeout)
    driver = GalilDriver(bench.rig, port, time.perf_counter, time.sleep)
    try:
        identity = driver.introduce()
        line = driver.line
        off = line.read("_MOA", "_MOB")
        absent = driver.model.absent if driver.model else frozenset()
        names = [name for name in _KEPT if name[1:3] not in absent]
        kept = dict(zip(names, line.read(*names), strict=True))
        threads = [line.read(f"_XQ{n}")[0] for n in range(8)]
        program = "\n".join(line.listing())
        if off != [1, 1]:
            driver.abort()
    finally:
        driver.close()
    bench.say(f"{identity}, {', '.join(f'{name} = {value:g}' for name, value in kept.items())}")
    bench.expect(
        off == [1, 1],
        "its motors were on before anything was sent",
        "end the other program that uses it; if it switches them on by itself, burn MO: send MO,"
        " then BN, and switch it off and on",
    )
    running = [n for n, at in enumerate(threads) if at >= 0]
    if "#AUTO" in program or running:
        start = "begins with #AUTO, so that it starts by itself," if "#AUTO" in program else ""
        runs = f"runs now in threads {running}" if running else ""
        what = f"The program in the controller {start} {runs}".strip()
        if not bench.ask.confirm(f"{what}. May it be stopped and replaced until the next reset?"):
            raise Declined(f"setup verify, step {bench.step}: {what}, and it was not to be stopped")
        bench.warn(f"{what}; burn no program (BP) if this bench is the controller's only use")


def set_up(bench: Workbench) -> None:
    """Connect as a press does: settings, limits and program are set and read back."""
    bench.controller.connect()
    driver = bench.driver
    bench.values["controller.verified"] = driver.record
    bench.values["controller.verified_settings"] = driver.settings.memory_text
    bench.figures["torque_limit_volts"] = driver.settings.torque
    room, due = min(driver.line.read("_PVA", "_PVB")), bench.rig.controller.segment_limit
    bench.expect(
        room >= due,
        f"its FIFO has room for {room:g} segments, and controller.segment_limit is {due}",
        "correct the rig file, or switch the controller off and on",
    )
    bench.say(f"{driver.record}: settings, limits and program read back as sent")
    memory = driver.settings.memory
    if not (memory["KIA"] and memory["KIB"]):
        bench.warn("KI is 0: an encoder that fails at rest is not detected; burn a KI above 0")


def inputs(bench: Workbench) -> None:
    """Read every switch at rest, then have each closed by hand: one bit may change."""
    none = bench.rig.controller.limit_switches == "none"
    limits = [name for name in _BITS if name.startswith("_L")]
    rest = dict(zip(_BITS, bench.line.read(*_BITS), strict=True))
    bench.expect(rest["_AB"] == 1, "the abort input is active at rest", "release the e-stop")
    active = [_BITS[name] for name in limits if not rest[name]]
    bench.expect(
        none or not active,
        f"active at rest: {', '.join(active)}",
        "move the arm off them; if it is off, correct controller.limit_switches",
    )
    for name, what in _BITS.items():
        if none and name in limits:
            continue
        if not bench.by_hand(f"Change {what} by hand and hold it."):
            break
        now = dict(zip(_BITS, bench.line.read(*_BITS), strict=True))
        changed = [_BITS[bit] for bit in _BITS if now[bit] != rest[bit]]
        bench.expect(
            changed == [what],
            f"{what} was changed, and the controller sees {', '.join(changed) or 'nothing'}",
            "correct the wiring",
        )
        bench.by_hand("Release it.")
    bench.say("limit switches and abort input allow motion at rest")


def encoders(bench: Workbench) -> None:
    """Have each joint lifted by hand: its own count must rise."""
    due = bench.driver.limits.in_counts(math.radians(5))
    for joint in (0, 1):
        before = bench.driver.positions()
        if not bench.by_hand(f"Turn joint {joint + 1} counter-clockwise by about 5 deg."):
            return
        moved = bench.driver.positions() - before
        seen = f"joint {joint + 1} was turned, and the encoders moved by {moved[0]}, {moved[1]}"
        bench.expect(
            moved[joint] > due / 100 and abs(moved[1 - joint]) < abs(moved[joint]) / 4,
            seen,
            "swap the encoders' cables, or reverse the encoder with CE",
        )
        bench.expect(
            due / 2.5 < moved[joint] < due * 2.5,  # by eye
            f"{seen}, where {due:.0f} counts are 5 deg",
            "correct arm.counts_per_revolution, or connect the encoder's second channel",
        )
    bench.say("each joint's own encoder counts up counter-clockwise")


def line_length(bench: Workbench) -> None:
    """Send the longest line that the driver sends, and one that is too long by the reference."""
    line = bench.line
    line.ask("NO " + "x" * (LONGEST_LINE - 3))
    try:
        line.ask("NO " + "x" * (LONGEST_LINE - 1))
        refused = False
    except CommandRefused:
        refused = True
    also = "" if refused else ", and longer ones too"
    bench.say(f"lines of {LONGEST_LINE} characters are accepted{also}")


def upload(bench: Workbench) -> None:
    """Upload an array, and compare its duration with the watchdog's period."""
    line, rig = bench.line, bench.rig.controller
    line.ask("DA *[]")
    line.ask(f"DM vtime[{_ROWS}]")
    (before,) = line.read("TIME")
    text = line.ask(f"QU vtime[],0,{_ROWS - 1},1")
    (after,) = line.read("TIME")
    duration = max(after - before, 1) * rig.sample_period
    bench.expect(
        len(text.replace("\x1a", " ").replace(",", " ").split()) == _ROWS,
        f"an array of {_ROWS} elements was uploaded as {text[:40]!r}...",
        "compare QU with the command reference of this firmware",
    )
    rate = len(text) / duration
    ended = "ends with control-Z" if "\x1a" in text else "has no control-Z"
    bench.say(f"an upload {ended}; {rate:.0f} characters per second")
    bench.figures["upload_rate"] = rate
    longest = min(line.piece, 4000) / _ROWS * duration  # Elements that a press uploads
    bench.expect(
        longest < rig.watchdog_period / 2,
        f"a piece of an upload takes {longest:.3g} s, too long for the watchdog's"
        f" {rig.watchdog_period:g} s",
        "raise the baud rate of the controller and controller.baud_rate, or watchdog_period",
    )


def refused_command(bench: Workbench) -> None:
    """Let the program meet an error: only its thread may end, and the watchdog survives."""
    driver, line, ends = bench.driver, bench.line, (FAULT, f"_XQ{PRESS}", f"_XQ{WATCH}")

    def ended() -> bool:
        code, press, watch = line.read(*ends)
        return (code != 0 and press < 0) or watch < 0

    driver.start_watchdog()
    line.ask(f"{PUSHES}=0", f"{RATE}=1", f"{FAULT}=0")
    line.ask(f"XQ #PRESS,{PRESS}")  # the motors are off, so that it cannot start
    bench.until(ended, 5)
    code, press, watch = line.read(*ends)
    driver.abort()
    bench.expect(
        code > 0 and press < 0 and watch >= 0,
        f"after an error in its thread, _XQ{PRESS} is {press:g}, _XQ{WATCH} is {watch:g} and"
        f" #CMDERR noted code {code:g}, instead of -1, 0 or more, and the code",
        "update the controller's firmware: its watchdog does not survive a refused command",
    )
    bench.say(f"a refused command (code {code:g}) ends its thread only, and #CMDERR runs")


def timing(bench: Workbench) -> None:
    """Measure the steps of AT in samples, alone and with three busy threads."""
    line = bench.line
    line.download(_TIMING)
    for others in (0, 3):
        line.ask("timed=0", "busy=0")
        line.ask("XQ #TIMES,0")
        for thread in range(1, others + 1):
            line.ask(f"XQ #BUSY,{thread}")
        bench.until(lambda: line.read("timed")[0] != 0, 10)
        steps = np.diff(line.upload("vtime", _ROWS))
        late = float(np.abs(steps - _EVERY).max())
        bench.say(f"AT -{_EVERY},1 with {others} other threads: {steps.mean():.3f}, +-{late:g}")
        bench.figures[f"at_jitter_{others}"] = late * bench.rig.controller.sample_period
        bench.expect(
            abs(float(steps.mean()) - _EVERY) < 0.1,
            f"AT -{_EVERY},1 lasts {steps.mean():.3g} samples on average",
            "update the firmware: AT does not count samples",
        )
        bench.expect(
            late < _EVERY,
            f"AT -{_EVERY},1 is up to {late:g} samples late, more than it waits",
            "update the firmware, or play no torques with a motion",
        )
    bench.driver.download()


def torque_record(bench: Workbench) -> None:
    """Compare the recorded torque with the operand, for a small offset."""
    line, controller = bench.line, bench.controller
    volts = 0.02 * bench.rig.controller.full_torque
    with controller.powered():
        line.ask("DA *[]")
        line.ask(f"DM vtrq[{_RECORDED}]")
        line.ask("RA vtrq[]")
        line.ask("RD _TTA")
        line.ask(f"OF {volts:.4f},0")
        line.ask("RC 6")  # 1 s, so that the joint has settled at the end
        bench.driver.await_record()
        (told,) = line.read("_TTA")
        line.ask("OF 0,0")
        recorded = line.upload("vtrq", _RECORDED)
    mean = sum(recorded[-4:]) / 4 * VOLTS_RECORDED
    bench.expect(
        abs(mean - told) <= max(0.1 * abs(told), 0.02),
        f"a command of {told:.4g} V was recorded as {mean:.4g} V at 32767 for 10 V",
        "compare RD with the command reference of this firmware",
    )
    bench.say(f"recorded torque: {mean:.4g} V, and _TTA is {told:.4g} V")


def trigger(bench: Workbench) -> None:
    """Set and clear the trigger output, and see which gives the acquisition its edge."""
    daq, output = bench.rig.daq, bench.rig.controller.trigger_output
    other = "falling" if daq.trigger_edge == "rising" else "rising"
    try:
        seen = daq.trigger_edge if _triggers(bench, "CB", "SB") else None
        if seen is None and _triggers(bench, "SB", "CB"):
            seen = other
    except DaqError as error:
        bench.warn(f"the acquisition cannot be used: {error}")
        return
    finally:
        bench.line.ask(f"CB {output}")
    bench.expect(
        seen is not None,
        f"output {output} reaches the acquisition at {daq.trigger_source} by no edge",
        "check the wire, controller.trigger_output and daq.trigger_source",
    )
    if seen == other:
        bench.values["daq.trigger_edge"] = other
    bench.say(f"setting output {output} gives a {seen} edge at {daq.trigger_source}")


def _triggers(bench: Workbench, before: str, then: str) -> bool:
    """Return whether a command of the output triggers the acquisition."""
    from sautereau.daq.source.source import open_source

    output = bench.rig.controller.trigger_output
    quick = with_values(bench.rig, {"daq.trigger_timeout": "0.5 s", "daq.pre_trigger": "0 s"})
    bench.line.ask(f"{before} {output}")
    try:
        with open_source(quick.daq, 0.02) as acquisition:
            acquisition.start()
            bench.line.ask(f"{then} {output}")
            return sum(1 for _ in acquisition.blocks()) > 0
    except DaqError as error:
        if "no edge" not in str(error):
            raise
        return False


STEPS = (
    VerifyStep("A1", "look", "identity, burned parameters, burned or running program", look),
    VerifyStep("A2", "settings", "DL and LS return the program; every setting reads back", set_up),
    VerifyStep("A3", "inputs", "CN, _LF, _LR, _HM, _AB: each switch changes its own bit", inputs),
    VerifyStep("A4", "encoders", "each joint lifted by hand: its own TP rises", encoders),
    VerifyStep("A5", "line length", "a line may have 79 characters", line_length),
    VerifyStep("A6", "upload", "QU's terminator, separators and speed", upload),
    VerifyStep("A7", "refused command", "#CMDERR runs, thread 0 survives", refused_command),
    VerifyStep("A8", "timing", "AT counts samples; its jitter with 1 and 4 threads", timing),
    VerifyStep("A9", "torque record", "RD _TT is an integer, 32767 for 10 V", torque_record),
    VerifyStep("A10", "trigger", "the edge at the acquisition when the output is set", trigger),
)

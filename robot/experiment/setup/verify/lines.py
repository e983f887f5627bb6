"""Group A: the line and the program's timing, without any motion."""

import numpy as np

from sautereau.robot.drivers.galil.dmc import LONGEST_LINE
from sautereau.robot.drivers.galil.program import FAULT, PRESS, PUSHES, RATE, WATCH
from sautereau.robot.errors import CommandRefused
from sautereau.robot.experiment.setup.verify.workbench import VerifyStep, Workbench

_ROWS = 24
_LARGEST = 4000  # elements of an array that a press uploads
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
    longest = min(line.piece, _LARGEST) / _ROWS * duration
    bench.expect(
        longest < rig.watchdog_period / 2,
        f"a piece of an upload takes {longest:.3g} s, too long for the watchdog's"
        f" {rig.watchdog_period:g} s",
        "raise the baud rate of the controller and controller.baud_rate, or watchdog_period",
    )


def refused_command(bench: Workbench) -> None:
    """Let the program meet an error: only its thread may end, and the watchdog survives."""
    driver, line, ends = bench.driver, bench.line, (FAULT, f"_XQ{PRESS}", f"_XQ{WATCH}")
    driver.start_watchdog()
    line.ask(f"{PUSHES}=0", f"{RATE}=1", f"{FAULT}=0")
    line.ask(f"XQ #PRESS,{PRESS}")  # the motors are off, so that it cannot start
    bench.until(lambda: _ended(*bench.line.read(*ends)), 5)
    code, press, watch = line.read(*ends)
    driver.abort()
    bench.expect(
        code > 0 and press < 0 and watch >= 0,
        f"after an error in its thread, _XQ{PRESS} is {press:g}, _XQ{WATCH} is {watch:g} and"
        f" #CMDERR noted code {code:g}, instead of -1, 0 or more, and the code",
        "update the controller's firmware: its watchdog does not survive a refused command",
    )
    bench.say(f"a refused command (code {code:g}) ends its thread only, and #CMDERR runs")


def _ended(code: float, press: float, watch: float) -> bool:
    return (code != 0 and press < 0) or watch < 0


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


STEPS = (
    VerifyStep("A5", "line length", "a line may have 79 characters", line_length),
    VerifyStep("A6", "upload", "QU's terminator, separators and speed", upload),
    VerifyStep("A7", "refused command", "#CMDERR runs, thread 0 survives", refused_command),
    VerifyStep("A8", "timing", "AT counts samples; its jitter with 1 and 4 threads", timing),
)

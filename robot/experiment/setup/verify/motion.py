"""Group B, motors on with little torque: what stops the arm, and how."""

import time

import numpy as np

from sautereau.robot.drivers.galil.dmc import CLEAR_SEGMENTS, PRESS, PUSHES, RATE
from sautereau.robot.errors import CommandRefused
from sautereau.robot.experiment.setup.verify.workbench import VerifyStep, Workbench

_SMALL_ERROR = 0.05  # rad, following error at which the motors go off
_STEP = 0.02  # rad, of a small motion
_HOMINGS = 5
_FAST = 7  # logarithm to base 2 of the samples of a fast motion
_LONGEST = 10  # s, until a small motion has ended
_ROWS = 32  # of a record
_FROZEN = 0.5  # s, after which the stand-in's time counts as stopped


def holding(bench: Workbench) -> None:
    """Switch on with a small limit of the following error: a wrong sign runs away and trips it."""
    driver, line = bench.driver, bench.line
    driver.settings.limit_error(round(driver.limits.in_counts(_SMALL_ERROR)))
    start = driver.positions()
    with bench.controller.powered():
        _wait(bench, 0.5)
        off = line.read("_MOA", "_MOB")
        moved = np.abs(driver.positions() - start)
    bench.expect(
        off == [0, 0],
        f"the motors went off while the arm was to stand; it moved by {moved.max()} counts",
        "if it ran away, the encoder counts against the torque: change MT or CE. If it sank, its"
        " weight needs more torque: check arm.torque_limit and controller.full_torque",
    )
    bench.say(f"the arm holds its position within {moved.max()} counts")


def watchdog(bench: Workbench) -> None:
    """Stop renewing the watchdog, and measure the time to motors off on the controller's clock."""
    driver, line, rig = bench.driver, bench.line, bench.rig.controller
    with bench.controller.powered():
        driver.renew()
        driver.silent = True
        (begun,) = line.read("TIME")
        deadline = time.perf_counter() + 10 * rig.watchdog_period + 10
        start = time.perf_counter()
        while True:
            now, *off = line.read("TIME", "_MOA", "_MOB")
            if off == [1, 1] or time.perf_counter() > deadline:
                break
            frozen = now == begun and time.perf_counter() > start + _FROZEN
            if frozen and bench.controller.simulated:
                bench.warn("not measured: the stand-in's time does not advance without pacing")
                driver.silent = False
                return
        driver.abort()
        driver.silent = False
    took = (now - begun) * rig.sample_period
    bench.expect(
        off == [1, 1] and took <= rig.watchdog_period + 0.05,  # s, to switch off
        f"the motors went off {took:.3g} s after the watchdog was last renewed, and"
        f" controller.watchdog_period is {rig.watchdog_period:g} s",
        "do not use this controller without a watchdog relay",
    )
    bench.figures["watchdog_time"] = took
    bench.say(f"motors off {took:.3f} s after the watchdog was last renewed")


def segments(bench: Workbench) -> None:
    """Send an odd segment without playing it: refused, or truncated."""
    line = bench.line
    line.ask(*CLEAR_SEGMENTS)
    try:
        line.ask("PVA=10,101,11")
        found = "accepted (the driver never sends one)"
    except CommandRefused as error:
        found = f"refused, code {error.code}"
    line.ask(*CLEAR_SEGMENTS)
    bench.say(f"a segment with odd velocity and time is {found}")


def homing(bench: Workbench) -> None:
    """Find home, then cross its edges again and again."""
    with bench.controller.powered():
        bench.controller.home()
        places = np.array([bench.driver.approach_home() for _ in range(_HOMINGS)])
    spread = np.ptp(places, axis=0)
    tolerance = bench.rig.controller.home_tolerance
    bench.expect(
        spread.max() <= tolerance,
        f"home was found {_HOMINGS} times within {spread[0]} and {spread[1]} counts",
        "fix and clean the switches, or raise controller.home_tolerance",
    )
    bench.figures["home_repeatability"] = float(spread.max()) * bench.rig.arm.radians_per_count
    bench.say(f"home was found {_HOMINGS} times within {spread[0]} and {spread[1]} counts")


def underrun(bench: Workbench) -> None:
    """Play a motion whose segments end without the end mark."""
    with bench.controller.powered():
        bench.controller.home()
        _load(bench, end="")
        bench.line.ask(f"XQ #PRESS,{PRESS}")
        _await_program(bench)
        codes = bench.line.read("_SCA", "_SCB")
    bench.expect(
        {31, 32}.issuperset(codes) or 7 in codes,
        f"a motion without its end mark ended with stop codes {codes[0]:g} and {codes[1]:g}",
        "compare SC with the command reference of this firmware",
    )
    bench.say("a motion without its end mark stops, and the motors are off or at rest")


def stop_in_segment(bench: Workbench) -> None:
    """Stop inside a segment: the arm must come to rest, motors on."""
    driver, line = bench.driver, bench.line
    with bench.controller.powered():
        bench.controller.home()
        _load(bench, end=",,0")
        line.ask(f"XQ #PRESS,{PRESS}")
        driver.halt()
        state = line.read("_BGA", "_BGB", "_SCA", "_SCB")
    bench.expect(state[:2] == [0, 0], f"after ST the axes read {state}", "do not use PVT here")
    bench.say(f"ST inside a segment: at rest, stop codes {state[2]:g} and {state[3]:g}")


def soft_limit(bench: Workbench) -> None:
    """Play a motion that crosses a software limit: both motors must go off."""
    driver = bench.driver
    with bench.controller.powered():
        bench.controller.home()
        at, reach = driver.positions(), round(driver.limits.in_counts(_STEP) / 2)
        driver.settings.limit_travel(at - reach, at + reach)
        _load(bench, end=",,0")
        off = _off_after(bench, f"XQ #PRESS,{PRESS}")
        driver.abort()
    _reset(bench)
    bench.expect(
        off, "a motion crossed a software limit and the motors stayed on", "use limit switches"
    )
    bench.say("a software limit inside a motion switches both motors off")


def following_error(bench: Workbench) -> None:
    """Play a motion again with a limit below its following error: both motors must go off."""
    driver, line = bench.driver, bench.line
    with bench.controller.powered():
        bench.controller.home()
        _load(bench, end=",,0", record="_TEA", exponent=_FAST)
        line.ask(f"XQ #PRESS,{PRESS}")
        _await_program(bench)
        errors = np.abs(line.upload("vrec", _ROWS))
        limit = round(errors.max() / 2)
        if limit <= max(abs(error) for error in line.read("_TEA", "_TEB")):
            bench.warn("not measured: the motion had no following error")
            return
        driver.settings.limit_error(limit)
        _load(bench, end=",,0", exponent=_FAST)
        off = _off_after(bench, f"XQ #PRESS,{PRESS}")
        played = min(line.read("_BTA", "_BTB"))  # at rest behind it ER acts, too
        driver.abort()
    _reset(bench)
    bench.expect(
        off and played < 2,
        f"a motion had a following error of {errors.max():g} counts, twice ER, and continued",
        "do not use PVT with this firmware",
    )
    bench.say(f"a following error above {limit} counts inside a motion switches both motors off")


def _await_program(bench: Workbench) -> None:
    """Wait until the motion and the program that plays it have ended."""
    bench.expect(
        bench.until(lambda: bench.line.read(f"_XQ{PRESS}")[0] < 0, _LONGEST),
        f"a motion of a quarter of a second has not ended after {_LONGEST} s",
        "check that the arm moves freely",
    )


def _reset(bench: Workbench) -> None:
    """Set the controller up again, after a step that has changed its settings."""
    bench.controller.disconnect()
    bench.controller.connect()


def by_hand(bench: Workbench) -> None:
    """Have the arm pushed away, and an encoder unplugged: both motors must go off."""
    blind = 2 * round(bench.driver.limits.in_counts(_SMALL_ERROR))
    for what, then in (
        ("Push the arm away from its place by hand", ("NO",)),
        # At rest, a lost encoder is only noticed when the torque rises.
        ("Unplug the encoder of joint 1", (f"PR {blind},0", "BG A")),
    ):
        with bench.controller.powered():
            if not bench.by_hand(f"{what} (motors on, little torque)."):
                return
            off = _off_after(bench, *then)
            bench.driver.abort()
        bench.expect(off, f"after {what!r} a motor is still on", "check ER, OE, OA and KI")
        bench.say(f"{what}: both motors off")
    bench.by_hand("Plug the encoder of joint 1 in again.")


def _load(bench: Workbench, end: str, record: str = "_TPA", exponent: int = 9) -> None:
    """Load a small motion and back, of 2^exponent samples each, with an end mark or without."""
    line, counts = bench.line, round(bench.driver.limits.in_counts(_STEP))
    line.ask(*CLEAR_SEGMENTS)
    for axis in "AB":
        for step in (counts, -counts):
            line.ask(f"PV{axis}={step},0,{2**exponent}")
        if end:
            line.ask(f"PV{axis}={end}")
    line.ask("DA *[]")
    line.ask(f"DM vrec[{_ROWS}]")
    line.ask("RA vrec[]")
    line.ask(f"RD {record}")
    line.ask(f"{PUSHES}=0", f"{RATE}={exponent - 4}")


def _off_after(bench: Workbench, *commands: str) -> bool:
    """Return whether both motors go off within 3 s after commands."""
    for command in commands:
        bench.line.ask(command)
    return bench.until(lambda: bench.line.read("_MOA", "_MOB") == [1, 1], 3)


def _wait(bench: Workbench, duration: float) -> None:
    """Wait on the controller's clock."""
    (start,) = bench.line.read("TIME")
    samples = duration / bench.rig.controller.sample_period
    begun = time.perf_counter()
    while (now := bench.line.read("TIME")[0]) - start < samples:
        if now == start and time.perf_counter() - begun > _FROZEN:
            return


STEPS = (
    VerifyStep("B1", "holding", "the sign of the encoders against the torque", holding),
    VerifyStep("B2", "watchdog", "time from the host's silence to motors off", watchdog),
    VerifyStep("B3", "segments", "whether odd segments are refused", segments),
    VerifyStep("B4", "homing", "FE finds home; repeatability of five searches", homing),
    VerifyStep("B5", "underrun", "what ends a motion without its end mark", underrun),
    VerifyStep("B6", "stop", "ST inside a segment comes to rest", stop_in_segment),
    VerifyStep("B7", "software limit", "a limit inside a motion: both motors off", soft_limit),
    VerifyStep("B8", "following error", "ER inside a motion: both motors off", following_error),
)
BY_HAND = (VerifyStep("B10", "by hand", "ER and OA switch both motors off", by_hand),)

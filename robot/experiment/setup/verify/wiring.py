"""Group A: switches, encoders, torque record and trigger, with the amplifiers' power cut."""

import math

from sautereau.daq.errors import DaqError
from sautereau.rig.load import with_values
from sautereau.robot.drivers.galil.capture import VOLTS_RECORDED
from sautereau.robot.experiment.setup.verify.workbench import VerifyStep, Workbench

_BITS = {
    "_LFA": "the forward limit switch of joint 1",
    "_LRA": "the reverse limit switch of joint 1",
    "_LFB": "the forward limit switch of joint 2",
    "_LRB": "the reverse limit switch of joint 2",
    "_HMA": "the home switch of joint 1",
    "_HMB": "the home switch of joint 2",
    "_AB": "the abort input (emergency stop)",
}
_LIFT = math.radians(5)
_BY_EYE = 2.5  # Dimensionless, factor by which a joint that is turned by hand may turn less or more
_PROBE = 0.02  # of the torque limit
_RECORDED = 16  # rows


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
    due = bench.driver.limits.in_counts(_LIFT)
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
            due / _BY_EYE < moved[joint] < due * _BY_EYE,
            f"{seen}, where {due:.0f} counts are 5 deg",
            "correct arm.counts_per_revolution, or connect the encoder's second channel",
        )
    bench.say("each joint's own encoder counts up counter-clockwise")


def torque_record(bench: Workbench) -> None:
    """Compare the recorded torque with the operand, for a small offset."""
    line, controller = bench.line, bench.controller
    volts = _PROBE * bench.rig.controller.full_torque
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


BY_HAND = (
    VerifyStep("A3", "inputs", "CN, _LF, _LR, _HM, _AB: each switch changes its own bit", inputs),
    VerifyStep("A4", "encoders", "each joint lifted by hand: its own TP rises", encoders),
)
STEPS = (
    VerifyStep("A9", "torque record", "RD _TT is an integer, 32767 for 10 V", torque_record),
    VerifyStep("A10", "trigger", "the edge at the acquisition when the output is set", trigger),
)

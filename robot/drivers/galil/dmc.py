"""Limits, profiles and segments as commands of Galil's DMC language."""

from sautereau.robot.drivers.limits import Limits
from sautereau.trajectory.segments import Segments

END_OF_MOTION = ("PVA=0,0,0", "PVB=0,0,0")
"""Ends PVT mode after the segments before it."""
CLEAR_SEGMENTS = ("PVA=0,0,-1", "PVB=0,0,-1")
"""Empties the FIFO of both axes."""
NO_LIMITS = ("FL 2147483647,2147483647", "BL -2147483648,-2147483648")
"""Switches the software limits off."""
NORMAL_ENDS = frozenset({0, 1, 31})
"""Stop codes of a move or a PVT motion that came to its end."""
HOMED_ENDS = NORMAL_ENDS | {10}
"""Stop codes of an axis that has found its home switch."""
_STEP_OF_ACCELERATION = 1024  # counts/s^2, resolution of AC and DC
_LARGEST_ACCELERATION = 1_073_740_800  # counts/s^2
_STOP_CODES = {
    0: "running, or never moved",
    1: "at the commanded position",
    2: "stopped by the forward limit",
    3: "stopped by the reverse limit",
    4: "stopped by ST",
    6: "stopped by the abort input",
    7: "stopped by AB",
    8: "switched off by a following error over ER",
    9: "stopped after finding an edge",
    10: "stopped after homing",
    11: "stopped by the selective abort input",
    12: "stopped by an encoder failure",
    15: "stopped by an amplifier fault",
    30: "running in PVT mode",
    31: "at the end of a PVT motion",
    32: "left PVT mode on an empty FIFO",
    99: "timed out on its way",
}


def stop_reason(code: float) -> str:
    """Return the meaning of a stop code (`_SCA`)."""
    return f"{_STOP_CODES.get(int(code), 'unknown stop code')} (stop code {code:g})"


def profile(limits: Limits, speed: float) -> tuple[str, str, str]:
    """Return SP, AC and DC for a move at ``speed`` counts per second.

    The controller takes even speeds and multiples of 1024 counts/s^2: both are
    rounded down, but not below the smallest value that it takes.
    """
    even = max(2, int(speed) // 2 * 2)
    rate = _rate(limits.move_acceleration(speed))
    return f"SP {even},{even}", f"AC {rate},{rate}", f"DC {rate},{rate}"


def halting(limits: Limits) -> str:
    """Return DC for a decelerated stop, at the arm's limit of acceleration."""
    rate = _rate(limits.acceleration)
    return f"DC {rate},{rate}"


def _rate(acceleration: float) -> int:
    steps = int(min(acceleration, _LARGEST_ACCELERATION)) // _STEP_OF_ACCELERATION
    return max(1, steps) * _STEP_OF_ACCELERATION


def software_limits(limits: Limits) -> tuple[str, str]:
    """Return FL and BL, beyond which the controller stops by itself."""
    (low_a, low_b), (high_a, high_b) = limits.lower, limits.upper
    return f"FL {high_a},{high_b}", f"BL {low_a},{low_b}"


def software_limit_settings(limits: Limits) -> dict[str, float]:
    """Return what the controller should read back of `software_limits`."""
    (low_a, low_b), (high_a, high_b) = limits.lower.tolist(), limits.upper.tolist()
    return {"_FLA": high_a, "_FLB": high_b, "_BLA": low_a, "_BLB": low_b}


def segment_commands(segments: Segments) -> list[str]:
    """Write segments as `PVA=p,v,t` and `PVB=p,v,t`, in turn.

    p is in counts from the end of the previous segment, v in counts per second at its end,
    t in controller samples.
    """
    return [
        f"PV{axis}={step},{velocity},{samples}"
        for steps, velocities, samples in zip(
            segments.steps, segments.velocities, segments.samples, strict=True
        )
        for axis, step, velocity in zip("AB", steps, velocities, strict=True)
    ]

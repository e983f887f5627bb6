"""The string at the plucking point: static stiffness, and the motion after release."""

from rig.schema import String


def release_speed(string: String, lift: float) -> float:
    """Return the speed [m/s] with which an ideal string leaves a static displacement.

    Vosc = c h / (2 L b (1 - b)) with c = 2 L f: the paper's section 2.4 with all modes.

    Args:
        string: The string.
        lift: m, displacement at the plucking point when it is released.
    """
    b = string.plucking_point / string.length
    wave_speed = 2 * string.length * string.frequency
    return wave_speed * lift / (2 * string.length * b * (1 - b))

"""Names of the parameters that can be fitted and of the hidden ones, and their natural bounds."""

import re

# Values of the rig.
STIFFNESS = "plectrum.bending_stiffness"
MODULUS = "plectrum.youngs_modulus"
OVERLAP = "plectrum.overlap"
FRICTION = "plectrum.friction"
FINGERTIP = "arm.fingertip_friction"
WIDTH = "plectrum.width"
CLEARANCE = "jack.string_clearance"
INERTIA = "key.inertia"
CONTACT = "plectrum.contact"
# Errors of the measurement.
TIME = "offset.time"  # Delay of the force after the motion (s)
FORCE = "offset.force"  # Zero of the force (N)
FORCE_GAIN = "offset.force_gain"  # True force divided by measured force; hidden
VELOCITY_GAIN = "offset.velocity_gain"  # True velocity divided by measured velocity; hidden
SLIDING = "offset.sliding"
"""Relative error of the force's moment on the key, per newton (1/N): the finger of a compliant arm
slides along the key while the force bends the arm; hidden."""
LATE_SLIDING = "offset.late_sliding"
"""The same for the lagged force, since a servo-driven arm deflects later (1/N); hidden."""
# Errors of the model.
CLOTH = "offset.foot"  # Compliance of the cloth under the jack (m/N); hidden
MODE = "offset.mode"  # Start of the names of the elastic modes' parameters; hidden
RELEASE = "offset.release"
"""Relative error of the height at which the static string is released; hidden."""
VIBRATION = "offset.vibration"
"""Vibration of the held strings divided by that of undamped strings; hidden."""
DAMPER = "offset.damper"  # True stiffness of the dampers divided by the rig's; hidden
DAMPER_LIFT = "offset.damper_lift"  # Lift of the first damper (m); hidden
OF_STRING = ("offset.string{}.stiffness", "offset.string{}.overlap", "offset.string{}.clearance")
"""For a further string, numbered from 2: true stiffness and true overlap of its plectrum, each
divided by the rig's, and the error of its clearance (m); hidden."""
TIME_RANGE = 1e-3  # Largest delay between force and motion (s)
_FURTHER = re.compile(r"(?:string(\d+)|more_choirs\.(\d+))\.((?:plectrum|jack)\..+)")
ENDS = {
    FRICTION: (0.0, 0.5),
    FINGERTIP: (-0.6, 0.6),
    TIME: (-TIME_RANGE, TIME_RANGE),
    VIBRATION: (0.0, 1.5),
}
"""Bounds of the parameters that have a natural range, SI."""
MEASURED = (
    *("key.press_arm", "key.laser_arm", "key.jack_arm", "key.jack_surface_height"),
    *("plectrum.length", WIDTH, "plectrum.thickness"),
    *("string.tension", "string.length", "string.plucking_point", "string.diameter"),
)
"""Numbers of the rig that are measured with a ruler or a gauge: freeing one is never suggested."""
NAMES = (
    MODULUS,
    STIFFNESS,
    OVERLAP,
    FRICTION,
    INERTIA,
    "key.pivot_coulomb_friction",
    "key.pivot_viscous_friction",
    "key.gravity_moment",
    "jack.mass",
    "jack.register_friction",
    CLEARANCE,
    FINGERTIP,
    *MEASURED,
    TIME,
    FORCE,
)
"""Names of all parameters that can be requested. Those of plectrum and jack are of string 1; those
of the next string start with `string2.`, and so on. `offset.force` has one value for each press; it
is always fitted if the force is AC-coupled."""


def canonical(name: str) -> str:
    """Return the one spelling of a name: `string2.jack.mass` for `more_choirs.0.jack.mass`.

    Names without a number are those of string 1.
    """
    found = _FURTHER.fullmatch(name)
    if found is None:
        return name
    number = int(found[1]) if found[1] else int(found[2]) + 2
    return found[3] if number == 1 else f"string{number}.{found[3]}"


def split_name(name: str) -> tuple[int, str]:
    """Return the number of a parameter's string, and its name for the first string."""
    found = _FURTHER.fullmatch(name)
    return (int(found[1]), found[3]) if found and found[1] else (1, name)


def rig_key(name: str) -> str:
    """Return the dotted key of the rig file for a parameter of the rig."""
    string, own = split_name(name)
    return own if string == 1 else f"more_choirs.{string - 2}.{own}"


def is_name(name: str) -> bool:
    """Return whether a parameter can be requested by this name, in a rig of enough strings."""
    return name in NAMES or (split_name(name)[0] > 1 and split_name(name)[1] in NAMES)

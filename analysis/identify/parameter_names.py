"""Names of the parameters that can be fitted and of the hidden ones, and their natural bounds."""

# Values of the rig.
STIFFNESS = "plectrum.bending_stiffness"
MODULUS = "plectrum.youngs_modulus"
OVERLAP = "plectrum.overlap"
FRICTION = "plectrum.friction"
FINGERTIP = "arm.fingertip_friction"
CLEARANCE = "jack.string_clearance"
INERTIA = "key.inertia"
CONTACT = "plectrum.contact"
# Errors of the measurement.
TIME = "offset.time"
"""Delay of the force after the motion (s)."""
FORCE = "offset.force"
"""Zero of the force (N)."""
FORCE_GAIN = "offset.force_gain"
"""True force divided by measured force; hidden."""
VELOCITY_GAIN = "offset.velocity_gain"
"""True velocity divided by measured velocity; hidden."""
SLIDING = "offset.sliding"
"""Relative error of the force's moment on the key, per newton (1/N): the finger of a compliant arm
slides along the key while the force bends the arm; hidden."""
LATE_SLIDING = "offset.late_sliding"
"""The same for the lagged force, since a servo-driven arm deflects later (1/N); hidden."""
# Errors of the model.
CLOTH = "offset.foot"
"""Compliance of the cloth under the jack (m/N); hidden."""
MODE = "offset.mode"
"""Start of the names of the elastic modes' parameters; hidden."""
RELEASE = "offset.release"
"""Relative error of the height at which the static string is released; hidden."""
VIBRATION = "offset.vibration"
"""Vibration of the held strings divided by that of undamped strings; hidden."""
OUTWARD = "offset.outward"
"""Where Coulomb's law holds the string or lets it slide to the clamp: fraction of the friction that
points to the tip nevertheless; hidden."""
DAMPER = "offset.damper"
"""True stiffness of the dampers divided by the rig's; hidden."""
DAMPER_LIFT = "offset.damper_lift"
"""Lift of the first damper (m); hidden."""
CHOIR = ("offset.choir{}.stiffness", "offset.choir{}.overlap", "offset.choir{}.clearance")
"""For a further choir, numbered from 1: true stiffness and true overlap of its plectrum, each
divided by the rig's, and the error of its clearance (m); hidden."""
TIME_RANGE = 1e-3
"""Largest delay between force and motion (s)."""
ENDS = {
    FRICTION: (0.0, 0.5),
    FINGERTIP: (-0.6, 0.6),
    TIME: (-TIME_RANGE, TIME_RANGE),
    VIBRATION: (0.0, 1.5),
    OUTWARD: (0.0, 1.0),
}
"""Bounds of the parameters that have a natural range, SI."""
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
    TIME,
    FORCE,
)
"""Names of all parameters that can be requested. `offset.force` has one value for each press; it is
always fitted if the force is AC-coupled."""

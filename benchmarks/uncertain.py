"""Benches of the independent simulator whose fixed numbers differ from the rig's in their ranges.

The experimenter states the rig with the ranges `RANGES`, and the clearance of the string as a
recording shows it, with the lever lengths of that rig. True values are drawn from the ranges.
"""

from dataclasses import replace

import numpy as np

from benchmarks.independent import FORCE, VELOCITY, Choir, Conditions, Pressed, press
from benchmarks.simulated import judged_press
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases, find_phases

RANGES: dict[str, tuple[float, float]] = {
    "key.front_arm": (0.180, 0.190),
    "key.press_arm": (0.166, 0.176),
    "key.laser_arm": (0.077, 0.087),
    "key.jack_arm": (0.210, 0.220),
    "key.jack_surface_height": (5e-3, 20e-3),
    "jack.mass": (4e-3, 12e-3),
    "jack.register_friction": (0.0, 60e-3),
    "plectrum.length": (4.4e-3, 4.6e-3),
    "plectrum.thickness": (0.45e-3, 0.51e-3),
    "string.tension": (63.6, 70.3),
}
"""SI, of the numbers that the experimenter did not measure."""
OF_MODEL: dict[str, tuple[float, float]] = {
    "plectrum.youngs_modulus": (2.3e9, 3.5e9),
    "plectrum.width": (0.7e-3, 0.8e-3),
    "plectrum.overlap": (0.213e-3, 0.313e-3),
}
"""SI, of numbers that are known only if nothing is fitted."""
CLEARANCE_STD = 0.1e-3  # m, by which the clearance differs from the rig's
NOMINAL = Conditions()  # What the experimenter believes


def true(rng: np.random.Generator, ranges: dict[str, tuple[float, float]]) -> dict[str, float]:
    """Return true values by dotted key, drawn from their ranges, or else as the rig states them.

    The place of the balance pin shifts the three lengths from the front edge.
    """
    (choir,) = NOMINAL.choirs
    found = {
        "key.front_arm": NOMINAL.front_arm,
        "key.jack_arm": choir.arm,
        "key.jack_surface_height": NOMINAL.jack_surface_height,
        "jack.mass": choir.mass,
        "jack.register_friction": choir.register_friction,
        "plectrum.length": choir.length,
        "plectrum.thickness": choir.thickness,
        "string.tension": choir.tension,
        **{name: float(rng.uniform(*ends)) for name, ends in ranges.items()},
    }
    shift = found["key.front_arm"] - NOMINAL.front_arm
    arms = {"key.press_arm": NOMINAL.press_arm, "key.laser_arm": NOMINAL.laser_arm}
    return found | {name: arm + shift for name, arm in arms.items()}


def conditions(
    rng: np.random.Generator, values: dict[str, float], base: Conditions = NOMINAL
) -> Conditions:
    """Return a bench with these values, and with gains and delays that differ from the rig's."""
    (choir,) = base.choirs
    choir = replace(
        choir,
        arm=values["key.jack_arm"],
        clearance=choir.clearance + CLEARANCE_STD * float(rng.standard_normal()),
        mass=values["jack.mass"],
        register_friction=values["jack.register_friction"],
        length=values["plectrum.length"],
        thickness=values["plectrum.thickness"],
        width=values.get("plectrum.width", choir.width),
        modulus=values.get("plectrum.youngs_modulus", choir.modulus),
        overlap=values.get("plectrum.overlap", choir.overlap),
        tension=values["string.tension"],
    )
    return replace(
        base,
        choirs=(choir,),
        press_arm=values["key.press_arm"],
        laser_arm=values["key.laser_arm"],
        front_arm=values["key.front_arm"],
        jack_surface_height=values["key.jack_surface_height"],
        velocity=replace(
            VELOCITY,
            gain=1 + 0.01 * float(rng.standard_normal()),
            delay_error=20e-6 * float(rng.standard_normal()),
        ),
        force=replace(
            FORCE,
            gain=1 + 0.01 * float(rng.standard_normal()),
            delay_error=3e-6 * float(rng.standard_normal()),
        ),
    )


def inertia_of(c: Conditions) -> float:
    """Return the inertia of the key with the mass in front of the transducer [kg m^2]."""
    return c.inertia + c.tip_mass * c.press_arm**2


def recorded(
    c: Conditions, seeds: range, ranges: dict[str, tuple[float, float]], **stated: float
) -> tuple[list[Press], list[Phases]]:
    """Return presses of a bench, with the rig of its experimenter, and their phases.

    Args:
        ranges: Assumed ranges of that rig.
        stated: SI, further values of that rig: `inertia`, `coulomb`.
    """
    made = [judged_press(each, _stated(each, **stated)) for each in (press(c, s) for s in seeds)]
    rig = made[0].rig.model_copy(update={"assumed": dict(ranges)})
    pressed = [replace(each, rig=rig) for each in made]
    return pressed, [find_phases(each) for each in pressed]


def _stated(made: Pressed, inertia: float, coulomb: float) -> dict[str, str | float]:
    real, plain = made.conditions, Choir()
    (choir,) = real.choirs
    lever = (plain.arm / NOMINAL.laser_arm) / (choir.arm / real.laser_arm)
    lengths = {
        "key.front_arm": NOMINAL.front_arm,
        "key.press_arm": NOMINAL.press_arm,
        "key.laser_arm": NOMINAL.laser_arm,
        "key.jack_arm": plain.arm,
        "key.jack_surface_height": NOMINAL.jack_surface_height,
        "plectrum.length": plain.length,
        "plectrum.width": plain.width,
        "plectrum.thickness": plain.thickness,
        "plectrum.overlap": plain.overlap,
        "jack.string_clearance": plain.clearance * lever,
    }
    stds = {
        key.replace(".delay", ".delay_std").replace(".scale", ".gain_std"): value
        for key, value in made.rig_uncertainties.items()
    }
    return {
        **{name: f"{value} m" for name, value in lengths.items()},
        "plectrum.contact": "surface",
        "plectrum.youngs_modulus": f"{plain.modulus} Pa",
        "jack.mass": f"{plain.mass} kg",
        "jack.register_friction": f"{plain.register_friction} N",
        "string.tension": f"{plain.tension} N",
        "key.inertia": f"{inertia} kg m^2",
        "key.pivot_coulomb_friction": f"{coulomb} N m",
        **stds,
    }

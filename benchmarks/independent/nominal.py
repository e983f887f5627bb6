"""What the experimenter wrote in the rig file about a simulated bench."""

from .conditions import Choir, Conditions


def _choir(prefix: str, c: Choir, friction_factor: float) -> dict[str, str | float]:
    values: dict[str, str | float] = {
        "jack.mass": f"{c.mass * 1e3:.9g} g",
        "jack.register_friction": f"{c.register_friction / friction_factor * 1e3:.9g} mN",
        "jack.string_clearance": f"{c.clearance / c.clearance_factor * 1e3:.9g} mm",
        "jack.damper.stiffness": f"{c.damper_stiffness:.9g} N/m",
        "jack.damper.lift": f"{c.damper_lift * 1e3:.9g} mm",
        "jack.damper.decay": f"{c.damper_decay:.9g} 1/s",
        "plectrum.length": f"{c.length * 1e3:.9g} mm",
        "plectrum.width": f"{c.width * 1e3:.9g} mm",
        "plectrum.thickness": f"{c.thickness * 1e3:.9g} mm",
        "plectrum.youngs_modulus": f"{c.modulus / c.modulus_factor / 1e9:.9g} GPa",
        "plectrum.poisson_ratio": 0.35,
        "plectrum.density": "1247 kg/m^3",
        "plectrum.overlap": f"{c.overlap / c.overlap_factor * 1e3:.9g} mm",
        "plectrum.friction": float(c.rig_friction),
        "string.tension": f"{c.tension:.9g} N",
        "string.length": f"{c.string_length * 1e3:.9g} mm",
        "string.plucking_point": f"{c.plucking_point * 1e3:.9g} mm",
        "string.frequency": f"{c.frequency:.9g} Hz",
        "string.diameter": f"{c.diameter * 1e3:.9g} mm",
    }
    return {prefix + key: value for key, value in values.items()}


def rig_values(c: Conditions) -> dict[str, str | float]:
    """Return the rig file's entries by dotted key; entries of lists are named by their index."""
    values: dict[str, str | float] = {
        "key.press_arm": f"{(c.press_arm + c.rig_press_arm_error) * 1e3:.9g} mm",
        "key.laser_arm": f"{c.laser_arm * 1e3:.9g} mm",
        "key.jack_arm": f"{c.choirs[0].arm * 1e3:.9g} mm",
        "key.front_arm": f"{c.front_arm * 1e3:.9g} mm",
        "key.surface_height": f"{c.surface_height * 1e3:.9g} mm",
        "key.jack_surface_height": f"{c.jack_surface_height * 1e3:.9g} mm",
        "key.inertia": f"{c.inertia / c.inertia_factor:.9g} kg m^2",
        "key.gravity_moment": f"{c.gravity_moment / c.gravity_factor * 1e3:.9g} mN m",
        "key.pivot_coulomb_friction": f"{c.pivot_coulomb / c.friction_factor * 1e3:.9g} mN m",
        "key.pivot_viscous_friction": f"{c.pivot_viscous / c.friction_factor * 1e3:.9g} mN m s/rad",
        "key.dip": f"{c.dip * 1e3:.9g} mm",
        "press.jack_speed": f"{c.speed:.9g} m/s",
        "press.jack_rise": f"{c.rise * 1e3:.9g} mm",
        "press.return_speed": f"{c.return_speed:.9g} m/s",
        "press.bottom_hold": f"{c.hold * 1e3:.9g} ms",
        "daq.sample_rate": f"{c.rate:.9g} Hz",
        "daq.pre_trigger": f"{c.pre_trigger * 1e3:.9g} ms",
    }
    for index, (sensor, unit) in enumerate(((c.velocity, "m/s/V"), (c.force, "N/V"))):
        values |= {
            f"daq.channels.{index}.scale": f"{sensor.scale:.9g} {unit}",
            f"daq.channels.{index}.range": f"{sensor.range:.9g} V",
            f"daq.channels.{index}.delay": f"{sensor.delay * 1e6:.9g} us",
            f"daq.channels.{index}.low_pass": f"{sensor.low_pass:.9g} Hz",
            f"daq.channels.{index}.low_pass_order": sensor.low_pass_order,
            f"daq.channels.{index}.high_pass": f"{sensor.high_pass:.9g} Hz",
        }
    values |= _choir("", c.choirs[0], c.friction_factor)
    for index, choir in enumerate(c.choirs[1:]):
        values[f"more_choirs.{index}.jack_arm"] = f"{choir.arm * 1e3:.9g} mm"
        values |= _choir(f"more_choirs.{index}.", choir, c.friction_factor)
    return values


def rig_uncertainties(c: Conditions) -> dict[str, str | float]:
    """Return standard uncertainties that the experimenter knows; of scales as a fraction."""
    return {
        "daq.channels.0.delay": "20 us",
        "daq.channels.1.delay": "3 us",
        "daq.channels.0.scale": 0.01,
        "daq.channels.1.scale": 0.01,
    }

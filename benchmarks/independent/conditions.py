"""Every factor of a simulated press, and what the experimenter wrote of them in the rig file."""

from dataclasses import dataclass
from itertools import pairwise

RigValue = str | float | list[str]


@dataclass(frozen=True)
class Choir:
    """One jack with plectrum and string; SI, true values.

    A `_factor` is the true value over that in the rig.
    """

    arm: float = 0.215
    mass: float = 6e-3
    clearance: float = 1.944e-3
    cloth_stiffness: float = 1e7
    """N/m, under the jack's foot."""
    cloth_damping: float = 0.1
    """Fraction of critical damping of the jack on its cloth."""
    register_friction: float = 0.02
    length: float = 4.5e-3
    width: float = 0.75e-3
    thickness: float = 0.48e-3
    """m, at the clamp."""
    carving: tuple[tuple[float, float], ...] = ()
    """Of the bottom, under a straight top: places over the length, from 0 to 1, with the thickness
    there over that at the clamp, linear between; empty for a uniform plectrum."""
    modulus: float = 2.9e9
    overlap: float = 0.263e-3
    friction: float = 0.0
    rig_friction: float = 0.0
    """What the rig says of the plectrum's friction."""
    modulus_factor: float = 1.0
    overlap_factor: float = 1.0
    clearance_factor: float = 1.0
    on_surface: bool = True
    """Whether the wire lies on the plectrum's surface; otherwise on its mid-line."""
    tension: float = 66.95
    string_length: float = 0.46
    plucking_point: float = 0.108
    frequency: float = 365.0
    diameter: float = 0.31e-3
    modes: int = 25
    """Of the string per direction; 0 for a quasi-static spring."""
    decay: float = 2.0
    """1/s, of the first mode; mode n has decay (1 + 0.02 n^2)."""
    damper_stiffness: float = 0.0
    """N/m; 0 without a damper."""
    damper_lift: float = 1e-3
    damper_decay: float = 60.0

    @property
    def bending_stiffness(self) -> float:
        """N m^2, at the clamp."""
        return self.modulus * self.width * self.thickness**3 / 12

    @property
    def equivalent_stiffness(self) -> float:
        """N m^2, of the uniform plectrum whose tip turns as much under a small load on it."""
        # the turn is the integral of (1 - x) / t^3, exact for linear t
        turn = 0.5 if not self.carving else 0.0
        for (x, t), (end, tip) in pairwise(self.carving):
            turn += (end - x) * ((1 - x) * tip + (1 - end) * t) / (2 * t**2 * tip**2)
        return self.bending_stiffness / (2 * turn)

    @property
    def offset(self) -> float:
        """m, from the plectrum's mid-line to the wire's centre."""
        return (self.thickness + self.diameter) / 2 if self.on_surface else 0.0

    @property
    def string_stiffness(self) -> float:
        """N/m, T / (L b (1 - b))."""
        b = self.plucking_point / self.string_length
        return self.tension / (self.string_length * b * (1 - b))


@dataclass(frozen=True)
class Sensor:
    """One channel's chain: true behaviour, and what the rig says of it."""

    noise: float
    """Rms within the band of the low-pass."""
    pink: float = 0.0
    """Rms of 1/f noise between 1 Hz and 1 kHz."""
    hum: float = 0.0
    """Amplitude."""
    hum_frequency: float = 50.0
    drift: float = 0.0
    """Unit per second."""
    gain: float = 1.0
    """True sensitivity over the calibrated one."""
    delay: float = 0.0
    """s, of the rig."""
    delay_error: float = 0.0
    """s, true delay minus that of the rig."""
    low_pass: float = 22e3
    low_pass_order: int = 2
    high_pass: float = 0.5
    """Hz, first order; 0 for none."""
    drop_outs: float = 0.0
    """Fraction of time."""
    drop_out: float = 100e-6
    """s, mean duration of one."""
    cross_talk: float = 0.0
    """Of the other channel's signal, derived in time where that is a velocity."""
    scale: float = 1.0
    """Unit per volt."""
    range: float = 10.0
    """V."""
    bits: int = 24


VELOCITY = Sensor(5e-5, delay=1.1e-3, high_pass=0.5, scale=0.025, range=4.0)
FORCE = Sensor(5e-3, delay=10e-6, high_pass=0.1, scale=1.0, range=10.0)


@dataclass(frozen=True)
class Conditions:
    """One press; SI, true values. A `_factor` is the true value over that in the rig."""

    choirs: tuple[Choir, ...] = (Choir(),)
    speed: float = 0.072
    rise: float = 10e-3
    run_up: float = 12e-3
    hold: float = 30e-3
    return_speed: float = 0.08
    rest: float = 40e-3
    """s, recorded before the push."""
    pre_trigger: float = 0.0
    """s, recorded before the trigger; the push starts ``rest`` after it."""
    # Key.
    press_arm: float = 0.171
    laser_arm: float = 0.082
    front_arm: float = 0.185
    back_arm: float = 0.235
    surface_height: float = 0.01
    jack_surface_height: float = 0.01
    inertia: float = 7e-4
    inertia_factor: float = 1.0
    gravity_moment: float = -2e-3
    gravity_factor: float = 1.0
    key_mass: float = 0.05
    pivot_coulomb: float = 0.5e-3
    pivot_viscous: float = 0.1e-3
    friction_factor: float = 1.0
    """Of pivot and register."""
    rig_press_arm_error: float = 0.0
    """m, of the rig's press arm."""
    bending_frequency: float = float("inf")
    """Hz, of the free-free key's first mode; infinite for a rigid key."""
    bending_damping: float = 0.01
    second_mode: bool = True
    heave_frequency: float = float("inf")
    heave_damping: float = 0.1
    rail_stiffness: float = 2e5
    rail_damping: float = 20.0
    felt_stiffness: float = 2e4
    felt_damping: float = 10.0
    dip: float = 8.2e-3
    # Finger.
    arm_mass: float = 0.08
    servo_stiffness: float = 2700.0
    """N/m at the fingertip; infinite for an arm that follows its plan exactly."""
    servo_damping: float = 0.7
    servo_integral: float = 5.0
    """1/s, Ki / Kp."""
    servo_period: float = 976.5625e-6
    servo_lag: float = 0.4e-3
    """s, first order, of amplifier and motor."""
    encoder: float = 0.38e-6
    """m, at the fingertip."""
    tip_mass: float = 4e-3
    transducer_frequency: float = 8e3
    """Hz, of the tip's mass on the transducer."""
    transducer_damping: float = 0.02
    pad_stiffness: float = 1e6
    """N/m, secant at 0.5 N."""
    pad_exponent: float = 1.0
    pad_loss: float = 0.3
    """Fraction of the critical damping of the tip's mass on its pad at 0.5 N."""
    finger_friction: float = 0.0
    preload: float = 0.4
    """Of the force that lifts the key off its rail; negative for a gap of as many mm."""
    # Sensors.
    velocity: Sensor = VELOCITY
    force: Sensor = FORCE
    rate: float = 51200.0
    anti_alias: bool = False
    """Whether the converter has a steep linear-phase filter at 0.45 of the rate."""
    step: float = 2.5e-6
    """s, of the integration."""


def _choir(prefix: str, c: Choir, friction_factor: float) -> dict[str, RigValue]:
    values: dict[str, RigValue] = {
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
    if c.carving:
        outline = {
            "x": [x * c.length for x, _ in c.carving],
            "top": [c.thickness / 2] * len(c.carving),
            "bottom": [(0.5 - t) * c.thickness for _, t in c.carving],
        }
        for name, row in outline.items():
            values[f"plectrum.outline.{name}"] = [f"{each * 1e3:.9g} mm" for each in row]
    return {prefix + key: value for key, value in values.items()}


def rig_values(c: Conditions) -> dict[str, RigValue]:
    """Return the rig file's entries by dotted key; entries of lists are named by their index."""
    values: dict[str, RigValue] = {
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

"""Every factor of a simulated press, and how they are drawn."""

from dataclasses import dataclass, replace

import numpy as np


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
        """N m^2."""
        return self.modulus * self.width * self.thickness**3 / 12

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


STIFF = Conditions()


def _all(choir_changes: dict, **changes) -> Conditions:
    return replace(STIFF, choirs=(replace(Choir(), **choir_changes),), **changes)


def _velocity(**changes) -> Conditions:
    return replace(STIFF, velocity=replace(VELOCITY, **changes))


def _force(**changes) -> Conditions:
    return replace(STIFF, force=replace(FORCE, **changes))


ONE_FACTOR: dict[str, Conditions] = {
    "all stiff": STIFF,
    "key bends at 1200 Hz": replace(STIFF, bending_frequency=1200.0),
    "key bends at 800 Hz": replace(STIFF, bending_frequency=800.0),
    "key bends at 350 Hz": replace(STIFF, bending_frequency=350.0),
    "key bends at 220 Hz": replace(STIFF, bending_frequency=220.0),
    "key heaves at 120 Hz": replace(STIFF, heave_frequency=120.0),
    "jack on cloth of 400 kN/m": _all({"cloth_stiffness": 4e5}),
    "jack on cloth of 60 kN/m": _all({"cloth_stiffness": 6e4}),
    "jack on cloth of 15 kN/m": _all({"cloth_stiffness": 1.5e4}),
    "sampled at 5 kHz": replace(STIFF, rate=5e3),
    "sampled at 10 kHz": replace(STIFF, rate=10e3),
    "sampled at 100 kHz": replace(STIFF, rate=100e3),
    "sampled at 200 kHz": replace(STIFF, rate=200e3),
    "vibrometer delay off by 50 us": _velocity(delay_error=50e-6),
    "speckle 1 %": _velocity(drop_outs=0.01),
    "damper": _all({"damper_stiffness": 15.0}),
    "hum": _force(hum=10e-3),
    "1/f noise": replace(
        STIFF, velocity=replace(VELOCITY, pink=1e-4), force=replace(FORCE, pink=5e-3)
    ),
    "noise floor x 4": replace(
        STIFF, velocity=replace(VELOCITY, noise=2e-4), force=replace(FORCE, noise=20e-3)
    ),
    "gain off by 2 %": replace(
        STIFF, velocity=replace(VELOCITY, gain=0.98), force=replace(FORCE, gain=1.02)
    ),
    "transducer rings at 1 kHz": replace(
        STIFF, transducer_frequency=1000.0, transducer_damping=0.01
    ),
    "inertia +20 %": replace(STIFF, inertia=8.4e-4, inertia_factor=1.2),
    "inertia -20 %": replace(STIFF, inertia=5.6e-4, inertia_factor=0.8),
    "cross-talk": _force(cross_talk=0.002),
    "soft pad": replace(STIFF, pad_stiffness=3e4, pad_exponent=1.5),
    "quasi-static string": _all({"modes": 0}),
    "string on the mid-line": _all({"on_surface": False}),
    "plectrum friction 0.2": _all({"friction": 0.2}),
    "16 bits": replace(STIFF, velocity=replace(VELOCITY, bits=16), force=replace(FORCE, bits=16)),
}
"""The conditions of one factor at a time."""


def random_conditions(rng: np.random.Generator) -> Conditions:
    """Draw every factor; see docs/independent.md for the ranges."""

    def among(low, high):
        return float(rng.uniform(low, high))

    def log(low, high):
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    def chance(probability):
        return bool(rng.random() < probability)

    infinite = float("inf")
    friction = among(0, 0.3) if chance(0.5) else 0.0
    strings = 0 if chance(0.2) else 25
    cloth = 1e7 if chance(0.2) else log(1.5e4, 1e6)
    on_surface = chance(0.8)
    frequency = log(150, 1000)
    strength = log(0.2, 4) if chance(0.2) else 1.0
    choir = Choir(
        mass=among(4e-3, 12e-3),
        clearance=among(1e-3, 3e-3),
        cloth_stiffness=cloth,
        cloth_damping=among(0.05, 0.4),
        register_friction=among(0, 0.06),
        thickness=among(0.36e-3, 0.55e-3),
        modulus=among(2.2e9, 3.6e9) * strength,
        overlap=among(0.12e-3, 0.4e-3),
        friction=friction,
        rig_friction=friction if chance(0.5) else 0.0,
        modulus_factor=log(0.8, 1.25),
        overlap_factor=log(0.8, 1.25),
        clearance_factor=among(0.9, 1.1),
        on_surface=on_surface,
        frequency=frequency,
        string_length=0.46 * (365 / frequency) ** 0.8,
        plucking_point=0.108 * (365 / frequency) ** 0.6,
        tension=among(40, 90) * strength,
        modes=strings,
        decay=log(0.5, 5),
        damper_stiffness=among(5, 40) if chance(0.4) else 0.0,
        damper_lift=among(0.3e-3, 0.9e-3),
    )
    choirs = [choir]
    if chance(0.4):
        choirs.append(
            replace(
                choir,
                arm=choir.arm - among(0.012, 0.022),
                clearance=choir.clearance + among(-0.2e-3, 2.0e-3),
                overlap=among(0.12e-3, 0.4e-3),
                overlap_factor=log(0.8, 1.25),
                thickness=choir.thickness * among(0.9, 1.1),
                plucking_point=choir.plucking_point * among(1.0, 1.4),
            )
        )
    speed = log(0.02, 0.3)
    rise = 10e-3
    if chance(0.06):
        rise = choir.clearance * among(0.7, 1.2)
    bending = infinite if chance(0.2) else log(150, 1500)
    arm_mass = log(0.04, 0.2)
    return Conditions(
        choirs=tuple(choirs),
        speed=speed,
        rise=rise,
        run_up=max(among(8e-3, 20e-3), 1.5 * speed / among(8, 20)),
        hold=among(20e-3, 60e-3),
        return_speed=among(0.05, 0.15),
        rest=among(25e-3, 80e-3),
        pre_trigger=among(0, 20e-3) if chance(0.5) else 0.0,
        rig_press_arm_error=among(-0.5e-3, 0.5e-3),
        inertia=among(5e-4, 10e-4),
        inertia_factor=among(0.8, 1.2),
        gravity_moment=among(-12e-3, 4e-3),
        gravity_factor=among(0.7, 1.3),
        key_mass=among(0.04, 0.09),
        pivot_coulomb=among(0, 2e-3),
        pivot_viscous=among(0, 1e-3),
        friction_factor=among(0.5, 2.0),
        bending_frequency=bending,
        bending_damping=log(0.005, 0.05),
        second_mode=chance(0.7),
        heave_frequency=infinite if chance(0.4) else log(100, 400),
        heave_damping=among(0.03, 0.3),
        rail_stiffness=log(5e4, 3e5),
        felt_stiffness=log(1e4, 6e4),
        felt_damping=among(3, 20),
        arm_mass=arm_mass,
        servo_stiffness=arm_mass * log(180, 380) ** 2,
        servo_damping=among(0.5, 0.9),
        tip_mass=among(2e-3, 12e-3),
        transducer_frequency=log(1000, 10000),
        transducer_damping=log(0.005, 0.05),
        pad_stiffness=log(2e4, 1e6),
        pad_exponent=float(rng.choice([1.0, 1.25, 1.5])),
        pad_loss=among(0.1, 0.5),
        finger_friction=among(0, 0.3),
        preload=among(0.0, 0.8) if chance(0.7) else -among(0.02, 0.5),
        velocity=replace(
            VELOCITY,
            noise=log(2e-5, 2e-4),
            pink=log(1e-5, 1e-4),
            hum=log(1e-6, 2e-5),
            gain=1 + 0.01 * float(rng.standard_normal()),
            delay=among(0.0, 1.2e-3),
            delay_error=20e-6 * float(rng.standard_normal()),
            low_pass=float(rng.choice([5e3, 10e3, 22e3])),
            low_pass_order=int(rng.choice([1, 2, 4])),
            high_pass=float(rng.choice([0.0, 0.5])),
            drop_outs=0.0 if chance(0.6) else log(5e-4, 1e-2),
            drop_out=log(30e-6, 300e-6),
            scale=0.025 if speed < 0.15 else 0.125,
            bits=int(rng.choice([16, 24])),
        ),
        force=replace(
            FORCE,
            noise=log(1e-3, 2e-2) * min(strength, 1),
            pink=log(3e-4, 5e-3) * min(strength, 1),
            hum=log(2e-4, 1e-2) * min(strength, 1),
            hum_frequency=float(rng.choice([50.0, 60.0])),
            drift=among(-0.05, 0.05),
            gain=1 + 0.01 * float(rng.standard_normal()),
            delay=among(0.0, 1e-4),
            delay_error=3e-6 * float(rng.standard_normal()),
            low_pass=float(rng.choice([5e3, 10e3, 22e3])),
            low_pass_order=int(rng.choice([1, 2, 4])),
            high_pass=float(rng.choice([0.0, 0.1, 1.0])),
            cross_talk=among(-0.002, 0.002),
            scale=1.0 if strength > 1.5 else float(rng.choice([1.0, 0.316])),
            bits=int(rng.choice([16, 24])),
        ),
        rate=float(rng.choice([5e3, 10e3, 20e3, 51.2e3, 100e3, 200e3])),
        anti_alias=chance(0.4),
    )

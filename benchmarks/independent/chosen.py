"""Conditions of one factor at a time, and those with every factor drawn at random."""

from dataclasses import replace

import numpy as np

from .conditions import FORCE, VELOCITY, Choir, Conditions


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
        speed = min(speed, 0.06)
    bending = infinite if chance(0.2) else log(150, 1500)
    arm_mass = log(0.04, 0.2)
    return Conditions(
        choirs=tuple(choirs),
        speed=speed,
        rise=rise,
        run_up=max(among(8e-3, 20e-3), 1.5 * speed / among(8, 20)),
        hold=among(20e-3, 60e-3),
        return_speed=among(0.05, 0.15) * rise / 10e-3,
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


def random_carved(rng: np.random.Generator) -> Conditions:
    """Draw every factor as `random_conditions` does, and then the carving of the plectra."""
    c = random_conditions(rng)
    begin, slope, thickness, taper = rng.uniform((0.1, 0.05, 0.55, 0.8), (0.5, 0.2, 1.0, 1.0))
    points = ((0.0, 1.0), (begin, 1.0), (begin + slope, thickness), (1.0, thickness * taper))
    carving = tuple((float(x), float(t)) for x, t in points)
    return replace(c, choirs=tuple(replace(each, carving=carving) for each in c.choirs))


def random_two_strings(rng: np.random.Generator) -> Conditions:
    """Draw every factor as `random_conditions` does, and a second string in any order to the first.

    Contacts are up to 2 mm apart, forces differ by the plectra's thickness and overlap. The rig's
    errors of clearance are those of the key, and of each jack.
    """
    c = random_conditions(rng)
    first, (arm, gap, overlap, thickness) = (
        c.choirs[0],
        rng.uniform((-0.022, -2e-3, 0.12e-3, 0.8), (0.022, 2e-3, 0.4e-3, 1.25)),
    )
    others = 0.05e-3 * rng.standard_normal(2)
    second = replace(
        first,
        arm=first.arm + float(arm),
        clearance=max(0.8e-3, first.clearance + float(gap)),
        overlap=float(overlap),
        overlap_factor=float(np.exp(rng.uniform(np.log(0.8), np.log(1.25)))),
        thickness=first.thickness * float(thickness),
        plucking_point=first.plucking_point * float(rng.uniform(1.0, 1.4)),
    )
    choirs = tuple(
        replace(each, clearance_factor=1 / (1 / each.clearance_factor + error / each.clearance))
        for each, error in zip((first, second), others.tolist(), strict=True)
    )
    return replace(c, choirs=choirs, rise=10e-3)


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
    "carved plectrum": _all({"carving": ((0.0, 1.0), (0.4, 1.0), (0.5, 0.75), (1.0, 0.65))}),
    "16 bits": replace(STIFF, velocity=replace(VELOCITY, bits=16), force=replace(FORCE, bits=16)),
}
"""The conditions of one factor at a time."""

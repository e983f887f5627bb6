"""The conditions of one factor at a time."""

from dataclasses import replace

from .conditions import FORCE, VELOCITY, Choir, Conditions

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

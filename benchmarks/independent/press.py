"""One press: the true motion of the bench, and what its sensors recorded."""

from dataclasses import dataclass

import numpy as np

from .conditions import Choir, Conditions
from .elastica import shape, static_pluck
from .kernel import GRAVITY, run
from .key import KeyModel, key_model
from .nominal import rig_uncertainties, rig_values
from .parameters import Body, Choirs, Strings, strings_at_rest
from .plan import jack_rise, key_angle
from .sensors import measure

SETTLE = 0.04
"""s, of strongly damped motion before the recording, to reach static equilibrium."""
TAIL = 0.03
"""s, recorded after the plan."""


@dataclass(frozen=True)
class Pluck:
    """One pluck that happened; times in s after the trigger."""

    choir: int
    contact: float
    """First nonzero force between plectrum and string."""
    last_contact: float
    """Start of the contact that lasted until the release; later where the string bounced."""
    release: float
    """The string leaves the tip."""
    release_force: float
    """N, vertical force of the plectrum on the jack at release."""


@dataclass(frozen=True)
class Truth:
    """What happened on the bench; arrays at the recorded samples' times."""

    plucks: tuple[Pluck, ...]
    """In the order of their releases."""
    unreleased: tuple[tuple[int, float], ...]
    """Choir and time of the contacts that did not end in a release."""
    rise: np.ndarray
    """m, of each jack; shape (choirs, n)."""
    jack_speed: np.ndarray
    """m/s; shape (choirs, n)."""
    load: np.ndarray
    """N, of each plectrum on its jack; shape (choirs, n)."""
    velocity: np.ndarray
    """m/s, of the key at the laser, downwards; shape (n,)."""
    force: np.ndarray
    """N, through the transducer; shape (n,)."""
    push: float
    """s, start of the planned push after the trigger."""
    bottom: float
    """s, end of the planned rise after the trigger."""


@dataclass(frozen=True)
class Pressed:
    """One recorded press. Sample k is at k / rate - t0 after the trigger."""

    conditions: Conditions
    seed: int
    rate: float
    """Hz."""
    t0: float
    """s, of the trigger after the first sample."""
    velocity_volts: np.ndarray
    force_volts: np.ndarray
    truth: Truth
    rig_values: dict[str, str | float]
    """What the experimenter wrote, by dotted key of the rig file; lists by index."""
    rig_uncertainties: dict[str, str | float]
    """Standard uncertainty of entries of ``rig_values``, by the same key."""

    @property
    def times(self) -> np.ndarray:
        """Time after the trigger, s; shape (n,)."""
        return np.arange(len(self.velocity_volts)) / self.rate - self.t0

    @property
    def velocity(self) -> np.ndarray:
        """Volts by the nominal calibration, m/s; delay and coupling are not undone."""
        return self.velocity_volts * self.conditions.velocity.scale

    @property
    def force(self) -> np.ndarray:
        """Volts by the nominal calibration, N; delay and coupling are not undone."""
        return self.force_volts * self.conditions.force.scale


@dataclass(frozen=True)
class Motion:
    """The true motion at the step of the integration."""

    step: float
    out: np.ndarray
    """Rows of `kernel.run`."""
    events: np.ndarray
    """Rows of choir, kind, time after the first sample, load."""
    strings: Strings
    """At the end."""


def build_key(c: Conditions) -> KeyModel:
    """Return the key of the conditions."""
    bending = ()
    if np.isfinite(c.bending_frequency):
        ratio = (7.853204624095838 / 4.730040744862704) ** 2
        modes = ((c.bending_frequency, c.bending_damping),)
        bending = modes + ((c.bending_frequency * ratio, c.bending_damping),) * c.second_mode
    return key_model(
        c.inertia,
        c.key_mass,
        -c.gravity_moment / (c.key_mass * GRAVITY),
        c.front_arm,
        c.back_arm,
        c.heave_frequency,
        c.heave_damping,
        bending,
    )


def _body(c: Conditions, key: KeyModel) -> Body:
    every = max(round(c.servo_period / c.step), 1)
    stiffness = c.servo_stiffness if np.isfinite(c.servo_stiffness) else 0.0
    damping = 2 * c.servo_damping * np.sqrt(stiffness * c.arm_mass)
    gains = [
        stiffness,
        stiffness * c.servo_integral,
        damping,
        c.encoder,
        every * c.step,
        c.servo_lag,
    ]
    transducer = c.tip_mass * (2 * np.pi * c.transducer_frequency) ** 2
    lossy = 2 * c.transducer_damping * np.sqrt(transducer * c.tip_mass)
    pad = c.pad_stiffness * (c.pad_stiffness / 0.5) ** (c.pad_exponent - 1)
    loss = 2 * c.pad_loss * np.sqrt(c.pad_stiffness * c.tip_mass)
    return Body(
        c.arm_mass,
        c.arm_mass + c.tip_mass + c.inertia / c.inertia_factor / c.press_arm**2,
        every,
        np.array(gains),
        np.array([transducer, lossy, c.tip_mass]),
        np.array([pad, c.pad_exponent, loss, c.finger_friction, c.surface_height]),
        np.linalg.inv(key.mass),
        np.ascontiguousarray(key.stiffness),
        np.ascontiguousarray(key.damping),
        key.rotation,
        c.gravity_moment,
        np.array([c.pivot_coulomb, c.pivot_viscous]),
        key.at(-c.press_arm),
        key.at(c.back_arm),
        key.at(-c.laser_arm),
        np.array([c.rail_stiffness, c.rail_damping]),
        np.array([c.felt_stiffness, c.felt_damping, c.dip]),
    )


def string_modes(choir: Choir, step: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return shapes with inverse modal masses, exact propagators, and the residual compliance."""
    count = max(choir.modes, 1)
    k = np.arange(1, count + 1)
    at = np.sin(k * np.pi * choir.plucking_point / choir.string_length)
    density = choir.tension / (2 * choir.string_length * choir.frequency) ** 2
    mass = density * choir.string_length / 2
    omega = 2 * np.pi * choir.frequency * k
    residual = 1 / choir.string_stiffness - float(np.sum(at**2 / (mass * omega**2)))
    propagators = []
    for extra in (0.0, choir.damper_decay):
        decay = choir.decay * (1 + 0.02 * k**2) + extra
        damped = np.sqrt(omega**2 - decay**2)
        e, c, s = np.exp(-decay * step), np.cos(damped * step), np.sin(damped * step) / damped
        rows = [e * (c + decay * s), e * s, -e * omega**2 * s, e * (c - decay * s)]
        propagators.append(np.stack(rows, axis=-1))
    modal = np.stack([at, np.full(count, 1 / mass)], axis=-1)
    return modal, np.array(propagators), residual


def _choirs(c: Conditions, key: KeyModel) -> Choirs:
    modal = [string_modes(each, c.step) for each in c.choirs]
    count = max(len(each[0]) for each in modal)
    if min(len(each[0]) for each in modal) < count:
        raise ValueError("choirs: the strings have different numbers of modes; give all the same")
    static = [
        static_pluck(
            each.length,
            each.overlap,
            each.bending_stiffness,
            each.string_stiffness,
            each.friction,
            each.offset,
        )
        for each in c.choirs
    ]
    points = 400
    heights = [np.linspace(0, each.release_height, points) for each in static]
    return Choirs(
        np.array([key.at(each.arm) for each in c.choirs]),
        np.array(
            [
                [
                    each.arm,
                    c.jack_surface_height,
                    each.mass,
                    each.cloth_stiffness,
                    2 * each.cloth_damping * np.sqrt(each.cloth_stiffness * each.mass),
                    each.register_friction,
                    each.clearance,
                ]
                for each in c.choirs
            ]
        ),
        np.array(
            [
                [p.bending_stiffness, p.length, p.length - p.overlap, p.offset, p.friction]
                for p in c.choirs
            ]
        ),
        np.array([shape(each.friction) for each in c.choirs]),
        np.array([[m[2], float(each.modes == 0)] for m, each in zip(modal, c.choirs, strict=True)]),
        np.array([each[0] for each in modal]),
        np.array([each[1] for each in modal]),
        np.array(heights),
        np.array([np.interp(h, s.height, s.load) for h, s in zip(heights, static, strict=True)]),
        np.array([[each.damper_stiffness, each.damper_lift] for each in c.choirs]),
        np.array([[0.015, 0.15e-3] for _ in c.choirs]),
    )


def simulate(c: Conditions, settle: float = SETTLE) -> tuple[Motion, float, float]:
    """Integrate one press; return its motion, and when the push starts and ends (s)."""
    key = build_key(c)
    start = c.pre_trigger + c.rest
    first = c.choirs[0]
    _, length = jack_rise(np.zeros(1), c.speed, c.rise, c.run_up, c.hold, c.return_speed)
    steps = round((start + length + TAIL) / c.step)
    times = np.arange(steps) * c.step - start
    rise, _ = jack_rise(times, c.speed, c.rise, c.run_up, c.hold, c.return_speed)
    down = c.press_arm * key_angle(np.clip(rise, 0, None), first.arm, c.jack_surface_height)
    speed = np.gradient(down, c.step)
    out = np.zeros((5 + 3 * len(c.choirs), steps))
    events = np.zeros((1000, 4))
    weight = sum(each.mass * each.arm for each in c.choirs) * GRAVITY
    lifts = (weight - c.gravity_moment) / c.press_arm
    choirs = _choirs(c, key)
    strings = strings_at_rest(len(c.choirs), choirs.modes.shape[1])
    found = run(
        c.step,
        steps,
        round(settle / c.step),
        _body(c, key),
        choirs,
        strings,
        down,
        speed,
        np.gradient(speed, c.step),
        np.array(
            [
                c.preload * lifts if c.preload > 0 else c.preload,
                float(not np.isfinite(c.servo_stiffness)),
            ]
        ),
        out,
        events,
    )
    if not np.all(np.isfinite(out)):
        raise ArithmeticError("the simulation diverged; choose a smaller step")
    motion = Motion(c.step, out, events[:found], strings)
    return motion, start, start + length - c.hold - 1.4 * c.rise / c.return_speed


def plucks_of(events: np.ndarray, trigger: float):
    """Return the plucks and the contacts without a release; times after the trigger."""
    plucks, unreleased = [], []
    for choir in range(int(events[:, 0].max(initial=-1)) + 1):
        first = last = None
        for _, kind, time, load in events[events[:, 0] == choir]:
            if kind == 0:
                first = time if first is None else first
                last = time
            elif kind == 1:
                at = (float(t - trigger) for t in (first, last, time))
                plucks.append(Pluck(choir, *at, float(load)))
                first = None
        if first is not None:
            unreleased.append((choir, float(first - trigger)))
    return tuple(sorted(plucks, key=lambda each: each.release)), tuple(unreleased)


def press(conditions: Conditions, seed: int) -> Pressed:
    """Simulate one press and its recording.

    Args:
        conditions: Every factor.
        seed: Of the sensors' random numbers; the motion has none.

    Raises:
        ValueError: The conditions cannot be simulated, e.g. a plectrum too long for its overlap.
        ArithmeticError: The integration diverged.
    """
    motion, start, bottom = simulate(conditions)
    trigger = conditions.pre_trigger
    rng = np.random.default_rng(seed)
    fine = 1 / motion.step
    volts = measure(rng, motion.out[0], motion.out[1], conditions, fine)
    grid = np.arange(motion.out.shape[1]) * motion.step
    sampled = np.arange(len(volts[0])) / conditions.rate

    def at(rows):
        return np.array([np.interp(sampled, grid, row) for row in rows])

    plucks, unreleased = plucks_of(motion.events, trigger)
    truth = Truth(
        plucks,
        unreleased,
        at(motion.out[5::3]),
        at(motion.out[6::3]),
        at(motion.out[7::3]),
        at(motion.out[:1])[0],
        at(motion.out[1:2])[0],
        start - trigger,
        bottom - trigger,
    )
    return Pressed(
        conditions,
        seed,
        conditions.rate,
        trigger,
        *volts,
        truth,
        rig_values(conditions),
        rig_uncertainties(conditions),
    )

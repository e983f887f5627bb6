"""One press: the true motion of the bench, and what its sensors recorded."""

from dataclasses import dataclass

import numpy as np

from .assembly import body_of, choirs_of, key_model
from .conditions import Conditions, RigValue, rig_uncertainties, rig_values
from .kernel import GRAVITY, run
from .parameters import Strings, strings_at_rest
from .sensors import measure
from .strings import CONTACT, RELEASE

SETTLE = 0.04  # s, of strongly damped motion before the recording, to reach static equilibrium
TAIL = 0.03  # s, recorded after the plan


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
    """Choir and time of contacts that did not end in a release, such as that of a weak press,
    or of a string that still vibrates when the plectrum has returned below it."""
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
    rig_values: dict[str, RigValue]
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


def simulate(c: Conditions, settle: float = SETTLE) -> tuple[Motion, float, float]:
    """Integrate one press; return its motion, and when the push starts and ends (s)."""
    key = key_model(c)
    start = c.pre_trigger + c.rest
    first = c.choirs[0]
    _, length = jack_rise(c, np.zeros(1))
    steps = round((start + length + TAIL) / c.step)
    times = np.arange(steps) * c.step - start
    rise, _ = jack_rise(c, times)
    down = c.press_arm * key_angle(np.clip(rise, 0, None), first.arm, c.jack_surface_height)
    speed = np.gradient(down, c.step)
    out = np.zeros((5 + 3 * len(c.choirs), steps))
    events = np.zeros((1000, 4))
    weight = sum(each.mass * each.arm for each in c.choirs) * GRAVITY
    lifts = (weight - c.gravity_moment) / c.press_arm
    choirs = choirs_of(c, key)
    strings = strings_at_rest(choirs)
    found = run(
        c.step,
        steps,
        round(settle / c.step),
        body_of(c, key),
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
        np.zeros((5, len(key.mass))),
        np.zeros((4, len(c.choirs))),
        out,
        events,
    )
    if not np.all(np.isfinite(out)):
        raise ArithmeticError("the simulation diverged; choose a smaller step")
    motion = Motion(c.step, out, events[:found], strings)
    return motion, start, start + length - c.hold - 1.4 * c.rise / c.return_speed


def plucks_of(
    events: np.ndarray, trigger: float
) -> tuple[tuple[Pluck, ...], tuple[tuple[int, float], ...]]:
    """Return the plucks and the contacts without a release; times after the trigger."""
    plucks, unreleased = [], []
    for choir in range(int(events[:, 0].max(initial=-1)) + 1):
        contacts: list[float] = []
        for _, kind, time, load in events[events[:, 0] == choir]:
            if kind == CONTACT:
                contacts.append(float(time - trigger))
            elif kind == RELEASE:
                release = float(time - trigger)
                plucks.append(Pluck(choir, contacts[0], contacts[-1], release, float(load)))
                contacts = []
        if contacts:
            unreleased.append((choir, contacts[0]))
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


def _blend(u: np.ndarray) -> np.ndarray:
    """Return the integral of the smooth step 3 u^2 - 2 u^3 from 0 to u."""
    return u**3 - u**4 / 2


def jack_rise(c: Conditions, times: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the planned rise of the jack and the time at which the plan ends.

    The blend to rest at the end takes twice as long as the run-up where the rise allows it.

    Args:
        times: s after the start of the push; shape (n,).
    """
    speed, rise, return_speed = c.speed, c.rise, c.return_speed
    run_up = min(c.run_up, 0.6 * rise / speed)
    run_down = min(2 * run_up, 0.8 * rise / speed)
    cruise = rise / speed - run_up / 2 - run_down / 2

    def up(t):
        t = np.clip(t, 0, run_up + cruise + run_down)
        y = speed * run_up * _blend(np.clip(t / run_up, 0, 1))
        y = y + speed * np.clip(t - run_up, 0, cruise)
        end = np.clip((t - run_up - cruise) / run_down, 0, 1)
        return y + speed * run_down * (end - _blend(end))

    pressed = run_up + cruise + run_down
    blend = 0.4 * rise / return_speed
    steady = rise / return_speed - blend

    def down(t):
        y = return_speed * blend * _blend(np.clip(t / blend, 0, 1))
        y = y + return_speed * np.clip(t - blend, 0, steady)
        end = np.clip((t - blend - steady) / blend, 0, 1)
        return y + return_speed * blend * (end - _blend(end))

    return up(times) - down(times - pressed - c.hold), pressed + c.hold + 2 * blend + steady


def key_angle(rise: np.ndarray, jack_arm: float, surface_height: float) -> np.ndarray:
    """Return the angle of a rigid key at which a slider at ``jack_arm`` has risen by ``rise``.

    rise = b tan a + h (1 / cos a - 1), solved by Newton's method.
    """
    angle = rise / jack_arm
    for _ in range(6):
        error = jack_arm * np.tan(angle) + surface_height * (1 / np.cos(angle) - 1) - rise
        slope = jack_arm / np.cos(angle) ** 2 + surface_height * np.sin(angle) / np.cos(angle) ** 2
        angle = angle - error / slope
    return angle

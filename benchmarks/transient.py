"""Sources of the oscillations in presses of the independent simulator.

Attribution is judged alone: the phases come from the truth. The truth of an oscillation is the
mode of the coupled linear bench nearest to it, by where that mode has most of its elastic energy.
"""

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import eigh

from benchmarks.figures import Figure
from benchmarks.independent import Choir, Conditions, Pressed, press, random_conditions
from benchmarks.independent.assembly import body_of, key_model, string_modes
from benchmarks.simulated import judged_press
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import HeldString, Phases
from sautereau.analysis.transient.attribute import Attributed, Source, attribute
from sautereau.analysis.transient.evidence import Oscillation, combine, examine

CASES = 24
NEAR = 0.08  # Relative distance of an oscillation from its true mode
ALIKE = 0.02  # Relative distance within which modes of two sources are not distinguished
INSTANT_STD = 20e-6  # s, uncertainty given to the true instants


def true_phases(pressed: Pressed, loaded: Press) -> Phases:
    """Return the phases of a press from its truth."""
    time = loaded.time
    rise, speed = (loaded.samples[name] for name in ("jack_rise", "jack_speed"))
    held = tuple(
        HeldString(p.last_contact, p.release, INSTANT_STD, INSTANT_STD, 0.0, 0.0, 0.0, 0.0)
        for p in pressed.truth.plucks
    )
    start, bottom = (float(time[np.argmax(rise > part * rise.max())]) for part in (0.005, 0.995))
    contact = held[0].contact if held else bottom
    free = float(np.median(speed[(time > (start + contact) / 2) & (time < contact)]))
    return Phases(start, bottom, held, free, None, None, ())


def true_modes(c: Conditions, force: float, choir: Choir, held: bool) -> list[tuple[float, Source]]:
    """Return frequency [Hz] and source of the modes of the bench, linear about a state.

    Args:
        force: N, of the finger, which the stiffness of the pad depends on.
        choir: The one choir whose jack stands on the key.
        held: Whether its string is held by the plectrum.
    """
    key = key_model(c)
    body = body_of(c, key)
    secant, exponent, _, _, _ = body.pad
    pad = exponent * secant ** (1 / exponent) * max(force, 1e-3) ** (1 - 1 / exponent)
    n, strings = len(key.mass), choir.modes if held else 0
    arm, tip, jack, size = n, n + 1, n + 2, n + 3 + strings
    mass = np.zeros((size, size))
    mass[:n, :n] = key.mass
    mass[arm, arm], mass[tip, tip], mass[jack, jack] = c.arm_mass, c.tip_mass, choir.mass
    springs: dict[str, np.ndarray] = {name: np.zeros((size, size)) for name in ("key", "string")}
    springs["key"][:n, :n] = key.stiffness

    def spring(name, stiffness, *ends):
        row = np.zeros(size)
        for at, weight in ends:
            row[at] += weight
        springs[name] = springs.get(name, 0) + stiffness * np.outer(row, row)

    pressing, at_jack = key.at(-c.press_arm), key.at(choir.arm)
    spring("finger", min(c.servo_stiffness, 1e9), (arm, 1))
    spring("transducer", body.transducer[0], (arm, 1), (tip, -1))
    spring("finger", pad, (tip, 1), (slice(0, n), pressing))
    spring("key", choir.cloth_stiffness, (jack, 1), (slice(0, n), -at_jack))
    if held and strings:
        modal, _, _ = string_modes(choir, c.step)
        omega = 2 * np.pi * choir.frequency * np.arange(1, strings + 1)
        place = np.arange(n + 3, size)
        mass[place, place] = 1 / modal[:, 1]
        springs["string"][place, place] = omega**2 / modal[:, 1]
        plectrum = 3 * choir.bending_stiffness / (choir.length - choir.overlap) ** 3
        spring("string", plectrum, (jack, 1), (place, -modal[:, 0]))
    values, vectors = eigh(sum(springs.values()), mass)
    return [
        (float(np.sqrt(value)) / (2 * np.pi), _source(mass, springs, vectors[:, k], tip))
        for k, value in enumerate(values)
        if value > 1.0
    ]


def _source(mass, springs, vector, tip) -> Source:
    if mass[tip, tip] * vector[tip] ** 2 > 0.5:  # the vectors have unit modal mass
        return Source.TRANSDUCER
    energy = {name: float(vector @ each @ vector) for name, each in springs.items()}
    energy["finger"] += energy.pop("transducer")
    return Source(max(energy, key=lambda name: energy[name]))


def truth_of(found: Oscillation, pressed: Pressed) -> Source | None:
    """Return the true source of an oscillation; None where no mode, or several, are near."""
    c, truth, time = pressed.conditions, pressed.truth, pressed.times
    phases = {each.phase for each in found.observed}
    known = [(k / c.servo_period, Source.FINGER) for k in (1, 2, 3)]
    for pluck in truth.plucks:
        choir = c.choirs[pluck.choir]
        times = {
            "free": (pluck.contact - 20e-3, pluck.contact),
            "held": (pluck.last_contact, pluck.release),
            "released": (pluck.release, truth.bottom),
        }
        for phase in phases & set(times):
            start, stop = times[phase]
            force = truth.force[(time > start) & (time < stop)]
            for part in (0.25, 0.5, 0.75) if len(force) else ():
                known += true_modes(c, float(np.quantile(force, part)), choir, phase == "held")
    near = sorted((abs(np.log(found.frequency / f)), s.value) for f, s in known)
    away, source = near[0]
    hum = c.force.hum_frequency
    if any(abs(np.log(found.frequency / (k * hum))) < min(away, 0.01) for k in (1, 3)):
        return Source.MAINS
    single = all(s == source for distance, s in near if distance < max(2 * away, ALIKE))
    return Source(source) if away < NEAR and single else None


@dataclass(frozen=True)
class Study:
    """How often each true source was attributed to each; the key None is undecided, no mode."""

    table: Counter
    benches: int

    def right(self) -> float:
        """Return the fraction of right ones among the decided oscillations of known source."""
        decided = self._decided()
        return sum(n for (a, b), n in decided.items() if a is b) / sum(decided.values())

    def decided(self) -> float:
        """Return the fraction of the oscillations of known source that were decided."""
        known = sum(n for (a, _), n in self.table.items() if a)
        return sum(self._decided().values()) / known

    def _decided(self) -> dict:
        return {pair: n for pair, n in self.table.items() if pair[0] and pair[1]}


def attributed(*presses: Pressed) -> list[Attributed]:
    """Return the attributed oscillations of presses of one bench of the independent simulator."""
    loaded = [judged_press(each) for each in presses]
    examined = [
        examine(press, true_phases(each, press), number)
        for number, (press, each) in enumerate(zip(loaded, presses, strict=True))
    ]
    return attribute(combine(examined), loaded[0].rig)


def one_soft_part(rng: np.random.Generator) -> Conditions:
    """Return a bench in which one part oscillates besides the string."""

    def log(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    frequency = log(200, 600)
    choir = Choir(
        frequency=frequency,
        string_length=0.46 * (365 / frequency) ** 0.8,
        plucking_point=0.108 * (365 / frequency) ** 0.6,
    )
    soft = (
        {},
        {"bending_frequency": log(200, 1500)},
        {"heave_frequency": log(100, 300), "heave_damping": 0.03},
        {"pad_stiffness": log(3e4, 1e6), "pad_loss": 0.1},
        {"transducer_frequency": log(1000, 3000), "pad_stiffness": 3e4, "pad_loss": 0.05},
    )
    part = soft[int(rng.integers(len(soft)))]
    return Conditions(choirs=(choir,), speed=float(rng.uniform(0.04, 0.09)), **part)


def study(seeds: range, soft: bool) -> Study:
    """Attribute the oscillations of random benches.

    Args:
        soft: Whether each has one soft part and is pressed at two speeds; otherwise every factor is
            random, with one press.
    """
    table, benches = Counter(), 0
    for seed in seeds:
        rng = np.random.default_rng([16, soft, seed])
        c = one_soft_part(rng) if soft else random_conditions(rng)
        speeds = (c.speed, 1.4 * c.speed) if soft else (c.speed,)
        try:
            presses = [press(replace(c, speed=speed), seed) for speed in speeds]
        except (ArithmeticError, ValueError):
            continue
        if c.rise < 1e-3 or not all(each.truth.plucks for each in presses):
            continue
        benches += 1
        found = attributed(*presses)
        table.update((truth_of(each.oscillation, presses[0]), each.source) for each in found)
    return Study(table, benches)


def confusion(found: Study) -> str:
    """Return the table of true sources (rows) against attributed ones (columns)."""
    columns = [*Source, None]
    names = [str(s) if s else "undecided" for s in columns]
    rows = ["".join([f"{'truth':12}", *(f"{name:>12}" for name in names)])]
    for true in columns:
        counts = [found.table[true, each] for each in columns]
        rows.append("".join([f"{true or 'no single':12}", *(f"{n:12}" for n in counts)]))
    return "\n".join(rows)


def run() -> list[Figure]:
    """Return how many attributions are right, and how many are decided; print the tables."""
    figures = []
    for soft, name in ((True, "one soft part"), (False, "all random")):
        found = study(range(CASES), soft)
        print(f"{name}, {found.benches} benches\n{confusion(found)}", flush=True)
        right = Figure(f"{name}: right, of those decided", found.right(), "", "at least", 0.9)
        figures += [right, Figure(f"{name}: decided", found.decided(), "", "all", 1.0)]
    return figures

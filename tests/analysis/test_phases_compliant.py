"""Phases on a key that bends, heaves and rings; most presses are of the independent simulator."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.independent import ONE_FACTOR, press
from benchmarks.independent.conditions import Choir
from benchmarks.independent_phases import judge, random_press
from benchmarks.simulated import judged_press
from sautereau.analysis.phases import find_phases
from sautereau.analysis.phases.event import refine_event
from sautereau.analysis.phases.response import pole, ringing_in
from sautereau.analysis.phases.signals import Signals
from sautereau.analysis.phases.slow import Slow
from tests.budget import slow

pytest.importorskip("numba")  # without it the independent simulator takes half a minute a press


def signals_around(force, velocity, rate, noise):
    time = np.linspace(0, len(force) / rate, len(force), endpoint=False)
    zero, none = np.zeros(len(force)), np.zeros(len(force), bool)
    moving, noises = (zero, zero, zero, 0.1), (noise[0], noise[1], 1 / rate)
    return Signals(time, rate, force, velocity, *moving, *noises, none, none)


@pytest.mark.parametrize("other", [None, 2.5e-3])
def test_an_event_is_found_with_its_modes(other):
    """Two modes in force and velocity, which grow until then; perhaps another event before."""
    rate, noise, instant = 50e3, (5e-3, 1e-4), 6.0123e-3
    time = np.arange(600) / rate

    def event(at, poles):
        since = np.maximum(time - at, 0)[:, None]
        return np.exp(since * poles) - 1 - poles * since

    poles = np.array([pole(500.0, 0.1), pole(1100.0, 0.2)])
    modes = event(instant, poles) @ [0.3 - 0.2j, 0.1j]
    if other is not None:
        modes = modes + event(other, poles) @ [0.2 + 0.2j, 0.1]
    random = np.random.default_rng(0)
    force = 0.5 + 20 * time + modes.real + noise[0] * random.standard_normal(600)
    velocity = 0.05 + 0.03 * modes.imag + noise[1] * random.standard_normal(600)
    signals = signals_around(force, velocity, rate, noise)
    others = [] if other is None else [other]
    found = refine_event(signals, instant + 0.2e-3, 0.3e-3, 0.5, 0.0, time[-1], others)
    assert found.time == pytest.approx(instant, abs=20e-6)
    assert found.noise < 2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "contact", "release"),
    [
        ("all stiff", 0.2, 0.05),
        ("key heaves at 120 Hz", 0.5, 0.1),
        ("jack on cloth of 15 kN/m", 0.5, 0.5),
        ("sampled at 5 kHz", 1.0, 0.2),
        *(
            slow(*case)
            for case in (
                ("key bends at 1200 Hz", 0.3, 0.2),
                ("key bends at 350 Hz", 1.0, 0.1),
                ("key bends at 220 Hz", 0.5, 0.1),
                ("jack on cloth of 60 kN/m", 1.0, 0.3),
                ("speckle 1 %", 1.0, 0.1),
            )
        ),
    ],
)
def test_one_imperfection_at_a_time(name, contact, release):
    """Limits in ms."""
    found = judge(ONE_FACTOR[name], 0)
    assert found.right
    ((of_contact, of_release, *_),) = found.errors * 1e3
    assert abs(of_contact) < contact
    assert abs(of_release) < release


@pytest.mark.parametrize(
    "name",
    ["jack on cloth of 400 kN/m", *map(slow, ("transducer rings at 1 kHz", "sampled at 10 kHz"))],
)
def test_the_force_drop_of_a_stiff_key_that_rings_is_that_of_the_string(name):
    conditions = ONE_FACTOR[name]
    pressed = press(conditions, 1)
    phases = find_phases(judged_press(pressed))
    (held,), (true,) = phases.plucks, pressed.truth.plucks
    drop = true.release_force * conditions.choirs[0].arm / conditions.press_arm
    assert held.force_drop == pytest.approx(drop, rel=0.02)
    assert abs(held.force_drop - drop) < 2 * held.force_drop_std < 0.06 * drop


def test_two_strings_that_hide_each_other():
    """Held at once, on a key that heaves: neither explains the load alone."""
    first = replace(Choir(), clearance=2e-3)
    both = first, replace(first, arm=0.199, clearance=3.4e-3)
    heaving = ONE_FACTOR["key heaves at 120 Hz"]
    found = judge(replace(heaving, choirs=both, speed=0.086), 0)
    assert found.right
    assert np.abs(found.errors[:, :2]).max() < 0.5e-3


def two_strings(first, second):
    """Return strings at two clearances in m."""
    front = replace(Choir(), clearance=first)
    return front, replace(front, arm=0.199, clearance=second)


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        {"choirs": two_strings(2e-3, 3.4e-3), "speed": 0.08, "rise": 7.4e-3, "dip": 5.37e-3},
        {
            "choirs": two_strings(3.2e-3, 4.4e-3),
            "speed": 0.02,
            "servo_stiffness": 900.0,
            "rise": 8.5e-3,
            "dip": 6.3e-3,
        },
    ],
    ids=["felt close behind the strings", "key swings back between two releases"],
)
def test_what_follows_a_release_disturbs_no_pluck(changes):
    errors = []
    for seed in range(3):
        found = judge(replace(ONE_FACTOR["key heaves at 120 Hz"], **changes), seed)
        assert found.right
        assert found.phases.fit is not None
        assert found.phases.fit.verdict == "fair"
        assert np.abs(found.errors[:, 0]).max() < 0.6e-3
        errors.append(np.abs(found.errors[:, 1]))
    assert np.mean(errors) < 0.05e-3
    assert np.max(errors) < 0.15e-3


@pytest.mark.slow
@pytest.mark.parametrize("key", ["key heaves at 120 Hz", "key bends at 350 Hz"])
def test_contacts_that_may_be_exchanged_are_uncertain(key):
    """The string touched first is released last, 1 ms after the other."""
    long = replace(Choir(), clearance=2e-3, overlap=0.35e-3, length=5.5e-3)
    short = replace(Choir(), arm=0.199, clearance=2.3e-3, overlap=0.15e-3)
    conditions = replace(ONE_FACTOR[key], choirs=(long, short), speed=0.08, rise=9e-3, dip=6.5e-3)
    off, stds = [], []  # standard uncertainties that each release is off, and these uncertainties
    for seed in range(5):
        pressed = press(conditions, seed)
        first, last = pressed.truth.plucks
        assert last.contact < first.contact - 5e-3 < first.release < last.release
        phases = find_phases(judged_press(pressed))
        for held, true in zip(phases.plucks, (first, last), strict=True):
            assert abs(held.contact - true.contact) < 2.5 * held.contact_std < 10e-3
            stds.append(held.release_std)
            off.append(abs(held.release - true.release) / held.release_std)
        assert any("explain the load as well if they are exchanged" in w for w in phases.warnings)
    assert np.mean(stds) < 0.4e-3
    assert np.sum(np.array(off) > 2) <= 2  # of 10; 3 or more have a probability of 1 %
    assert max(off) < 3


def test_a_slight_growth_is_no_pluck():
    """The contact of a string with a twelfth of the force would be wrong by 20 ms."""
    strong, weak = two_strings(2e-3, 3.6e-3)
    both = strong, replace(weak, width=0.04e-3)
    phases = judge(replace(ONE_FACTOR["key heaves at 120 Hz"], choirs=both), 0).phases
    assert len(phases.plucks) == 1
    assert any("1 of the rig's 2 strings" in warning for warning in phases.warnings)


def test_a_string_that_is_held_to_the_end_of_the_recording_has_no_pluck():
    pressed = press(ONE_FACTOR["key bends at 350 Hz"], 0)
    (pluck,), whole = pressed.truth.plucks, judged_press(pressed)
    until = pluck.contact + 0.7 * (pluck.release - pluck.contact)
    rows = slice(0, int(np.searchsorted(whole.time, until)))
    samples = {name: column[rows] for name, column in whole.samples.items()}
    phases = find_phases(replace(whole, time=whole.time[rows], samples=samples))
    assert not phases.plucks
    assert any("record for longer" in warning for warning in phases.warnings)


def test_a_pause_before_the_pluck_hides_no_release(make_press):
    """A jack that waits below its string makes the way down four times as long."""
    from sautereau.analysis.phases.compliant import compliant_plucks
    from sautereau.analysis.phases.expected import expected
    from sautereau.analysis.phases.signals import signals_of, way_down

    rate, moved = 10e3, 0.4e-3
    once = make_press(rate=rate, force_noise=2e-3)
    time = np.arange(round(0.1 * rate)) / rate
    creep = moved * np.pi / 0.2 * np.sin(np.pi * time / 0.1)
    still = round(0.4 * rate)
    velocity = np.concatenate([creep, np.zeros(still), once.samples["velocity"]])
    before = np.full(len(time) + still, once.samples["force"][:200].mean())
    force = np.concatenate([before, once.samples["force"]])
    signals = signals_of(make_press.build(velocity, force, rate))
    way = way_down(signals)
    assert way is not None
    ((contact, release),), _ = compliant_plucks(expected(once.rig), signals, way)
    shift = (len(time) + still) / rate
    assert contact.time - shift == pytest.approx(0.052, abs=2 * contact.std)
    assert release.time - shift == pytest.approx(0.072, abs=0.2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [10153, 10237], ids=["impact on the felt", "short press"])
def test_an_impact_hides_no_pluck_and_a_press_that_reaches_no_string_has_none(seed):
    assert random_press(seed).right


@pytest.mark.slow
def test_a_pluck_that_is_too_slight_is_not_silent():
    found = random_press(221)
    assert found.right or any("no pluck was found there" in w for w in found.phases.warnings)


def test_the_smoothed_derivatives_belong_to_the_smoothed_signal(make_press):
    from sautereau.analysis.phases.signals import signals_of

    signals = signals_of(make_press())
    slow = Slow(signals, 1500, 6000)
    wave, turn = np.sin(300.0 * slow.hops), 300.0
    for order in (1, 2, 4):
        expected = np.real(turn**order * 1j**order * np.exp(1j * turn * slow.time) * -1j)
        got = slow.smooth(wave, order)[10:-10]
        assert got == pytest.approx(expected[10:-10], abs=0.05 * turn**order)


@pytest.mark.parametrize("bending", [700.0, 900.0, 1200.0])  # Hz
def test_an_event_behind_a_spring_that_throws_off_the_finger(bending):
    """The jack's half of a key is released; finger and laser are at the other half."""
    rate, noise, instant, fine = 50e3, (5e-3, 5e-5), 6.0123e-3, 20
    masses, stiff = (0.012, 0.0215), (2 * np.pi * bending) ** 2 * 0.006
    pad, load = 1e5, np.array([0.1, 0.7])  # N/m; N, of key and string
    speed, place, force, velocity = np.zeros(2), -load.sum() / pad * np.ones(2), [], []
    place[1] -= load.sum() / stiff
    for step in range(600 * fine):
        finger = max(0.0, -pad * place[0])
        if step % fine == 0:
            force.append(finger)
            velocity.append(0.03 + speed[0] / 2)
        bent = stiff * (place[0] - place[1]) + 2.0 * (speed[0] - speed[1])
        held = load.sum() if step < instant * rate * fine else load[0]
        speed += np.array([finger - bent, bent - held]) / masses / rate / fine
        place += speed / rate / fine
    random = np.random.default_rng(0)
    signals = signals_around(
        np.array(force) + noise[0] * random.standard_normal(600),
        np.array(velocity) + noise[1] * random.standard_normal(600),
        *(rate, noise),
    )
    found = refine_event(signals, instant + 0.2e-3, 0.7e-3, 0.7, 0.0, signals.time[-1])
    assert min(force) == 0.0
    assert abs(found.time - instant) < min(60e-6, 2 * found.std)


def test_modes_are_found_in_the_ringing_on_both_sides_of_an_event():
    """Both signals ring in two modes about a parabola; the event changes all amplitudes."""
    random = np.random.default_rng(3)
    step, known = 40e-6, np.array([pole(320.0, 0.03), pole(1400.0, 0.08)])
    parts = []
    for count in (90, 60):
        time = step * np.arange(count)[:, None]
        waves = np.exp(time * known) @ (
            random.normal(size=(2, 2)) + 1j * random.normal(size=(2, 2))
        )
        curves = (time / 4e-3) ** np.arange(3) @ random.normal(size=(3, 2))
        parts.append((waves.real + curves + random.normal(0, 1e-3, (count, 2))).T / 1e-3)
    found = ringing_in(parts, step)
    for each in known:
        assert np.abs(found - each).min() < 0.01 * abs(each)


@pytest.mark.parametrize("sizes", [(0, 5), (3, 11), (0, 12), (90, 0), (40, 40)])
@pytest.mark.parametrize("level", [0.0, 1.0])
def test_short_parts_and_constants_do_not_ring(sizes, level):
    parts = [np.full((2, size), level) for size in sizes]
    assert np.isfinite(ringing_in(parts, 40e-6)).all()

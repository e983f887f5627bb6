"""What the rig does not expect is said by name, and no result is wrong in silence.

The presses are of the independent simulator, whose conditions are the truth; the rig's values
differ from them as stated.
"""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.independent import ONE_FACTOR, Conditions, press, random_conditions
from benchmarks.independent.conditions import rig_values
from benchmarks.simulated import judged_press, random_case, simulated_press
from sautereau.analysis.phases import find_phases
from sautereau.daq.file.recorded import Event
from sautereau.rig.load import load_rig
from sautereau.sim_backend.scene import load_scene
from tests.budget import slow

pytest.importorskip("numba")  # without it the independent simulator takes half a minute a press

KEYS = ("all stiff", "key bends at 350 Hz", "key heaves at 120 Hz")
SPEED = "the jack's speed"
RISE = "the jack's rise"
INERTIA = "the inertia of key and jacks"
FORCE = "the force drop"
LATE = "ms late, compared with the"
HELD = "string 1 was touched, and is not released at the end of the "
FAR = 3.0  # Standard uncertainties beyond which a result counts as wrong


def of_channel(base: Conditions, name: str, **changes) -> Conditions:
    return replace(base, **{name: replace(getattr(base, name), **changes)})


def with_strings(base: Conditions, *changes) -> Conditions:
    """Return conditions whose strings differ from the first one."""
    return replace(base, choirs=tuple(replace(base.choirs[0], **each) for each in changes))


def second(base: Conditions, later: float, **changes) -> dict:
    """Return a second string that a jack of constant speed touches so much later [s]."""
    clearance = (base.choirs[0].clearance + base.speed * later) * 0.199 / 0.215
    return {"arm": 0.199, "clearance": clearance, "thickness": 0.42e-3} | changes


def found_in(conditions: Conditions, values=None, strings=None):
    """Return the plucks that happened, and the phases found in a press that an arm made.

    Args:
        values: Of the rig, by dotted key, that are not those of the conditions.
        strings: Conditions with the strings of the rig; those that happen by default.
    """
    pressed = press(conditions, 0)
    if strings is not None:
        own = {k: v for k, v in pressed.rig_values.items() if not k.startswith("more_choirs")}
        more = {k: v for k, v in rig_values(strings).items() if k.startswith("more_choirs")}
        pressed = replace(pressed, rig_values=own | more)
    recorded = judged_press(pressed, values)
    return pressed, find_phases(replace(recorded, motion=Event(0.0, "motion", "an edge")))


def wrong(pressed, phases) -> bool:
    """Return whether a number, an instant or a force drop is not what happened."""
    truth, plucks = pressed.truth.plucks, phases.plucks
    if len(truth) != len(plucks):
        return True
    choirs, arm = pressed.conditions.choirs, pressed.conditions.press_arm
    drops = [p.release_force * choirs[p.choir].arm / arm for p in truth]
    off = [
        (
            (held.contact - true.contact) / held.contact_std,
            (held.release - true.release) / held.release_std,
            (held.force_drop - drop) / np.hypot(held.force_drop_std, 0.01 * drop),
        )
        for held, true, drop in zip(plucks, truth, drops, strict=True)
    ]
    return bool(np.abs(off).max(initial=0.0) > FAR)


UNEXPECTED = {
    "force twice": (lambda c: of_channel(c, "force", gain=2.0), None, (INERTIA, FORCE)),
    "force half": (lambda c: of_channel(c, "force", gain=0.5), None, (INERTIA,)),
    "velocity twice": (
        lambda c: of_channel(c, "velocity", gain=2.0, range=16.0),
        None,
        (SPEED, RISE, INERTIA),
    ),
    "velocity half": (lambda c: of_channel(c, "velocity", gain=0.5), None, (SPEED, INERTIA)),
    "arm 25 % long": (lambda c: c, {"key.laser_arm": "102.5 mm"}, (SPEED,)),
    "arm 25 % short": (lambda c: c, {"key.laser_arm": "61.5 mm"}, (SPEED, RISE)),
    "force late": (lambda c: of_channel(c, "force", delay_error=1e-3), None, (LATE,)),
    "velocity late": (lambda c: of_channel(c, "velocity", delay_error=1e-3), None, (LATE,)),
    "velocity at 1 Hz": (
        lambda c: of_channel(c, "velocity", high_pass=1.0),
        {"daq.channels.0.high_pass": "0.1 Hz"},
        (),
    ),
    "force at 1 Hz": (
        lambda c: of_channel(c, "force", high_pass=1.0),
        {"daq.channels.1.high_pass": "0.1 Hz"},
        (),
    ),
    "three times the force": (
        lambda c: with_strings(c, {"modulus": 8.7e9, "modulus_factor": 3.0}),
        None,
        (FORCE,),
    ),
    "bare rail": (
        lambda c: replace(c, felt_stiffness=3e5, felt_damping=5.0, dip=4.5e-3),
        None,
        (RISE,),
    ),
    "muted string": (lambda c: with_strings(c, {"decay": 300.0}), None, ()),
    "half a press": (lambda c: replace(c, rise=2.3e-3, speed=0.05), None, (HELD + "motion",)),
}
"""Conditions, values of the rig that differ from them, and what is said."""


QUICK = ("force twice", "force late", "half a press")
"""What is tested on a stiff key in the quick tests too."""


@pytest.mark.parametrize(
    ("key", "name"),
    [
        (key, name) if key == "all stiff" and name in QUICK else slow(key, name)
        for key in KEYS
        for name in UNEXPECTED
    ],
)
def test_what_the_rig_does_not_expect_is_said(key, name):
    conditions, values, said = UNEXPECTED[name]
    pressed, phases = found_in(conditions(ONE_FACTOR[key]), values)
    for subject in said:
        assert any(subject in warning for warning in phases.warnings), (subject, phases.warnings)
    assert phases.warnings or not wrong(pressed, phases)


@pytest.mark.parametrize("name", ["force", slow("velocity")])
@pytest.mark.parametrize("error", [0.4e-3, slow(0.0), slow(-0.4e-3)])
def test_a_channel_that_is_slightly_late_is_said(name, error):
    conditions = of_channel(ONE_FACTOR["all stiff"], name, delay_error=error)
    _, phases = found_in(conditions)
    late = error if name == "force" else -error
    assert phases.fit.lag == pytest.approx(late, abs=3 * phases.fit.lag_std)
    assert any(LATE in warning for warning in phases.warnings) == bool(error)


@pytest.mark.parametrize("seed", [4, *map(slow, (14, 18, 21, 99, 106, 115, 129, 143, 184, 195))])
def test_the_front_felt_is_no_lag(seed):
    recorded, _ = simulated_press(*random_case(seed), seed)
    phases = find_phases(recorded)
    assert abs(phases.fit.lag) < 3 * phases.fit.lag_std
    assert not any(LATE in warning for warning in phases.warnings)


def test_a_low_sampling_rate_is_a_cause_of_a_poor_fit():
    phases = find_phases(judged_press(press(ONE_FACTOR["sampled at 5 kHz"], 0)))
    (poor,) = phases.warnings
    assert "5 kHz is a low sampling rate" in poor
    assert "sample faster" in poor


def test_a_recording_that_ends_while_a_string_is_held():
    pressed = press(ONE_FACTOR["all stiff"], 0)
    (pluck,) = pressed.truth.plucks
    end = round((pressed.t0 + 0.3 * pluck.contact + 0.7 * pluck.release) * pressed.rate)
    volts = {n: getattr(pressed, n)[:end] for n in ("velocity_volts", "force_volts")}
    phases = find_phases(judged_press(replace(pressed, **volts)))
    assert not phases.plucks
    assert phases.bottomed is None
    assert any(HELD + "recording" in warning for warning in phases.warnings)
    assert not any("check the strings" in warning for warning in phases.warnings)


@pytest.mark.parametrize("seed", [20, *map(slow, (68, 152))])
def test_a_key_that_still_accelerates_shows_no_wrong_zero(seed):
    conditions = random_conditions(np.random.default_rng([15, seed]))
    assert conditions.force.high_pass == 0
    _, phases = found_in(conditions)
    assert phases.plucks
    assert not any("the zero of the sensor" in warning for warning in phases.warnings)


def test_speed_and_rise_of_a_key_that_no_arm_pressed_are_remarks():
    pressed = press(replace(ONE_FACTOR["all stiff"], rate=10e3), 0)
    phases = find_phases(judged_press(pressed, {"press.jack_speed": "0.03 m/s"}))
    assert not phases.warnings
    assert any(f"{SPEED}, 0.072 m/s, is 2.4 times" in remark for remark in phases.remarks)


def test_a_rise_on_a_wrong_scale_is_the_first_warning():
    """No arm made the press, which goes about as far as any."""
    conditions = of_channel(replace(ONE_FACTOR["all stiff"], rate=10e3), "velocity", gain=0.4)
    phases = find_phases(judged_press(press(conditions, 0)))
    assert phases.warnings[0].startswith(RISE)
    assert "0.4 times" in phases.warnings[0]


@pytest.mark.slow
@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("later", [1e-3, 2e-3, 3e-3, 5e-3, -1e-3, -2e-3, -3e-3, -5e-3])
def test_two_strings_nearly_at_once_are_right_or_warned(key, later):
    base = ONE_FACTOR[key]
    both = with_strings(base, {}, second(base, later, overlap=0.2e-3))
    pressed, phases = found_in(both)
    assert phases.warnings or not wrong(pressed, phases)


@pytest.mark.parametrize("key", [KEYS[0], *map(slow, KEYS[1:])])
def test_strings_released_at_once_are_said_where_the_rig_has_one(key):
    """The force drop is 1.93 times that of the rig, which one string may also have."""
    base = ONE_FACTOR[key]
    both = with_strings(base, {}, second(base, -2e-3, thickness=0.48e-3))
    pressed, phases = found_in(both, strings=base)
    assert np.ptp([pluck.release for pluck in pressed.truth.plucks]) < 0.2e-3
    assert len(phases.plucks) == 1
    assert any(FORCE in warning and "at once" in warning for warning in phases.warnings)


@pytest.mark.parametrize("dip", ["2.4 mm", slow("2.6 mm"), slow("2.9 mm"), slow("3 mm")])
def test_an_obstacle_is_no_release(dip):
    """A rail of the stand-in, on which the force climbs and the key stops."""
    truth = {"key.dip": dip, "key.felt_stiffness": "150 kN/m"}
    scene = load_scene("paper").model_copy(update={"truth": truth})
    recorded, happened = simulated_press(load_rig("paper"), scene)
    phases = find_phases(recorded)
    released = np.array([event.time for event in happened.release_events])
    assert all(np.abs(pluck.release - released).min(initial=1.0) < 1e-3 for pluck in phases.plucks)
    stopped = any("an obstacle stops the key" in warning for warning in phases.warnings)
    assert stopped or phases.plucks


@pytest.mark.slow
@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("later", [-2e-3, -1e-3, 1e-3, 2e-3])
@pytest.mark.parametrize("overlap", [0.15e-3, 0.2e-3])
def test_a_string_that_the_rig_lacks_is_said_where_both_are_one_pluck(key, later, overlap):
    base = ONE_FACTOR[key]
    both = with_strings(base, {}, second(base, later, overlap=overlap))
    pressed, phases = found_in(both, strings=base)
    assert len(pressed.truth.plucks) == 2
    assert any("string" in warning for warning in phases.warnings)


@pytest.mark.parametrize(("speed", "hum"), [(0.06, 20e-3), slow(0.1, 26e-3), slow(0.1, 43e-3)])
def test_hum_is_no_string(speed, hum):
    """The load of a key that heaves with hum is explained better by two strings than by one."""
    base = replace(ONE_FACTOR["key heaves at 120 Hz"], speed=speed)
    _, phases = found_in(of_channel(base, "force", hum=hum))
    assert len(phases.plucks) == 1
    assert not any("another string" in warning for warning in phases.warnings)


@pytest.mark.slow
@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("later", [3e-3, 20e-3])
def test_a_string_more_or_less_than_in_the_rig_is_said(key, later):
    base = ONE_FACTOR[key]
    both = with_strings(base, {}, second(base, later))
    pressed, phases = found_in(both, strings=base)
    assert len(pressed.truth.plucks) == 2
    assert any("string" in warning for warning in phases.warnings)
    pressed, phases = found_in(base, strings=both)
    assert len(pressed.truth.plucks) == 1
    assert phases.warnings

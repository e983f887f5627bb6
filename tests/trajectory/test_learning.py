"""Corrections of the rise, and their learning, on plants whose answer is known in closed form."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import butter, sosfilt

from sautereau.rig.load import load_rig, with_values
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.learning import (
    CUTOFF,
    NEVER,
    Correction,
    Learner,
    corrected,
    residual,
    speed_error,
)
from sautereau.trajectory.press import draft_press, plan_press, sent_motion
from sautereau.trajectory.timing import press_law

RIG = load_rig("paper")
LAW = press_law(RIG.press)
PERIOD = RIG.controller.sample_period
RATE = 10_000.0
TIME = np.arange(0, LAW.law.duration, 1 / RATE)
CRUISE = np.abs(2 * TIME - LAW.cruise_start - LAW.cruise_end) < LAW.cruise_end - LAW.cruise_start
MIDDLE = (LAW.cruise_start + LAW.cruise_end) / 2
DIP = -0.01 * np.exp(-(((TIME - MIDDLE) / 0.01) ** 2))
"""m/s, change of the jack's speed by a string."""

KNOTS = np.linspace(LAW.start, LAW.return_start, 60)


def commanded(correction):
    law = LAW if correction is None else correction.onto(LAW)
    return law.law.at(TIME).velocity


def run(plant, presses=8):
    """Press with learning; return the learner."""
    learner, used = Learner(LAW, PERIOD), None
    for press in range(presses):
        sent = commanded(used)
        used = learner.learn(used, TIME, sent, plant(sent, press))
        if used is None:
            break
    return learner


def test_the_error_of_a_perfect_press_is_none():
    assert speed_error(LAW, TIME, commanded(None)) < 1e-3  # the low-pass rounds the corners


def test_the_error_is_the_rms_over_the_cruise():
    speed = commanded(None) + 1e-3 * CRUISE
    assert speed_error(LAW, TIME, speed) == pytest.approx(1e-3 / 0.072, rel=0.02)


def test_the_error_is_that_while_a_string_is_held():
    held = np.array([[0.05, 0.06], [0.055, 0.08]])
    inside = (TIME > 0.045) & (TIME < 0.085)  # beyond the edges of the filter
    speed = commanded(None) + np.where(inside, 1e-3, 20e-3) * CRUISE
    assert speed_error(LAW, TIME, speed, held) == pytest.approx(1e-3 / 0.072, rel=0.02)
    assert speed_error(LAW, TIME, speed) > 0.2


def after(speed, held=NEVER):
    """Return the correction after a press with a speed."""
    return corrected(LAW, [residual(LAW, TIME, commanded(None), speed, PERIOD, held)], PERIOD)


def test_a_slow_disturbance_is_learned_at_once():
    second = after(commanded(None) + DIP)
    left = (commanded(second) + DIP - commanded(None))[CRUISE]
    assert np.abs(left).max() < 0.02 * np.abs(DIP).max()


def test_the_correction_vanishes_before_the_return():
    found = after(commanded(None) + DIP)
    assert found.rise[0] == found.rise[-1] == 0
    assert found.rise.max() == pytest.approx(np.sqrt(np.pi) * 0.01 * 0.01, rel=0.02)


def test_a_string_is_touched_at_its_rise_and_not_at_its_time():
    """A spring holds the jack of a soft arm back in proportion to the rise above its contact: the
    rise is known in closed form. One correction removes it, although the release comes earlier."""
    contact, release, share = 2e-3, 3.4e-3, 0.4

    def press(used):
        law = LAW if used is None else used.onto(LAW)
        sent, _, _ = law.law.at(TIME)
        off = int(np.argmax(sent > contact + (release - contact) * (1 + share)))
        rise = sent - np.clip(sent - contact, 0, None) * share / (1 + share)
        rise[off:] = sent[off:] - (sent - rise)[off - 1] * np.exp(-(TIME[off:] - TIME[off]) / 3e-3)
        rise[LAW.bottom < TIME] = sent[LAW.bottom < TIME]
        held = TIME[[int(np.argmax(sent > contact)), off - 1]][None]
        return law.law.at(TIME).velocity, np.gradient(rise, TIME), held

    sent, speed, held = press(None)
    first = corrected(LAW, [residual(LAW, TIME, sent, speed, PERIOD, held)], PERIOD)
    _, again, then = press(first)
    assert held[0, 1] - then[0, 1] > 0.006
    inner = [then[0] + [5e-3, -5e-3]]  # the corners at contact and release are above the cut-off
    assert speed_error(LAW, TIME, speed, np.array(inner)) > 0.25
    assert speed_error(LAW, TIME, again, np.array(inner)) < 0.02


def test_a_motion_that_follows_in_part_and_late_is_learned_in_three():
    """The arm follows half of a correction, 3 ms late: each press alone would leave half of it."""

    def arm(speed, _):
        late = np.interp(TIME - 3e-3, TIME, speed - commanded(None))
        return commanded(None) + 0.5 * late + DIP

    errors = run(arm, 4).errors
    assert errors[1] > 0.4 * errors[0]
    assert errors[3] < 0.1 * errors[0]


@given(gain=st.floats(0.3, 1.6), lag=st.floats(0, 1.5e-3), noise=st.floats(0, 2e-4))
def test_learning_improves_the_speed_and_stops_when_it_worsens(gain, lag, noise):
    """A plant of unknown gain and lag, with noise: learning stops once the error grows."""
    random = np.random.default_rng(7)

    def plant(speed, _):
        late = np.interp(TIME - lag, TIME, speed)
        return (
            commanded(None)
            + gain * (late - commanded(None))
            + DIP
            + noise * random.normal(size=len(TIME))
        )

    learner = run(plant)
    assert min(learner.errors) < 0.5 * learner.errors[0]
    assert learner.errors[-1] <= 1.5 * min(learner.errors) or "grew" in learner.stopped


@pytest.mark.parametrize("counts", [20_000, 262_144, 2_000_000])
def test_a_coarse_encoder_is_learned_to_its_rounding(counts):
    """A rigid arm plays the rounded plan, and the string adds a dip that learning removes."""
    changes = {"arm.counts_per_revolution": counts, "press.speed_tolerance": 0.03}
    rig = with_values(RIG, changes)
    learner, used, rounding = Learner(LAW, PERIOD), None, []
    for _ in range(4):
        plan = plan_press(rig, None, used)
        ticks = np.minimum(TIME / PERIOD, plan.segments.total_samples)
        sent = sent_motion(rig, plan.segments, ticks).velocity
        rounding.append(plan.cruise.rms_error)
        used = learner.learn(used, TIME, sent, sent + DIP)
        if used is None:
            break
    best = int(np.argmin(learner.errors))
    assert learner.errors[0] > 0.045
    assert best > 0
    assert learner.errors[best] <= 1.2 * rounding[best] + 2e-3  # the cut-off of the filter
    assert learner.scatter < 1e-4  # the filter rounds the corners of the plan


def test_the_scatter_is_that_of_the_presses():
    random, rms = np.random.default_rng(3), 1e-3
    learner = run(lambda speed, _: speed + DIP + rms * random.normal(size=len(TIME)), 6)
    # Butterworth's gain of order 2, forwards and backwards: the integral of 1 / (1 + x^4)^2.
    band = 3 * np.pi / (8 * np.sqrt(2)) * CUTOFF / (RATE / 2)
    assert learner.scatter == pytest.approx(rms * np.sqrt(band) / 0.072, rel=0.2)


def test_a_second_order_arm_with_a_sudden_release():
    sos = butter(2, 120, fs=RATE, output="sos")
    jump = sosfilt(sos, np.where(TIME > MIDDLE, 0.008, -0.008) * CRUISE)

    def arm(speed, _):
        return commanded(None) + sosfilt(sos, speed - commanded(None)) + jump

    learner = run(arm)
    assert learner.errors[0] > 0.05
    assert min(learner.errors) < 0.02


def soft_arm(sent):
    """Return speed, contact and release, and force of an arm that a string pushes back.

    The arm's fingertip yields as a mass of 0.15 kg on 1500 N/m and 9 N s/m; the string pushes with
    1 N per mm between 2 and 3.5 mm of rise.
    """
    step = 1 / RATE
    place = np.cumsum(sent) * step
    lag = speed = 0.0
    force, rise, plucked = np.zeros_like(place), np.zeros_like(place), False
    for i, at in enumerate(place):
        rise[i] = at - lag
        plucked |= rise[i] > 3.5e-3
        force[i] = 0.0 if plucked else max(0.0, (rise[i] - 2e-3) * 1e3)
        speed += step * (force[i] - 1500 * lag - 9 * speed) / 0.15
        lag += step * speed
    released = int(np.argmax(rise > 3.5e-3))
    contact = int(np.argmax(force > 0))
    measured = np.gradient(rise, step)
    return measured, TIME[[[contact, released]]], force


@pytest.mark.parametrize("known", [True, False])
def test_the_measured_force_shows_how_a_soft_arm_yields(known):
    learner, used = Learner(LAW, PERIOD), None
    for _ in range(3):
        sent = commanded(used)
        speed, held, force = soft_arm(sent)
        used = learner.learn(used, TIME, sent, speed, held, force if known else None)
    assert learner.errors[0] > 0.2
    assert (learner.errors[2] < 0.02) == known


def test_a_plant_with_inverse_response_stops_learning():
    learner = run(lambda speed, _: 2 * commanded(None) - speed + DIP)
    assert "grew" in learner.stopped
    assert learner.best is None
    assert len(learner.errors) <= 3


def test_noise_alone_stops_learning():
    random = np.random.default_rng(1)
    learner = run(lambda speed, _: speed + 2e-3 * random.normal(size=len(TIME)))
    assert learner.stopped


@pytest.mark.parametrize(
    ("time", "speed", "says"),
    [
        (TIME[:500], TIME[:500], "do not cover"),
        (TIME, np.full(len(TIME), np.inf), "not finite"),
        (TIME, TIME[:-1], "shape"),
    ],
)
def test_measured_speeds_that_are_none_are_refused(time, speed, says):
    with pytest.raises(TrajectoryError, match=says):
        speed_error(LAW, time, speed)


def hump(height=2e-4):
    return height * np.sin(np.pi * (KNOTS - KNOTS[0]) / (KNOTS[-1] - KNOTS[0])) ** 4


def addition(height=2e-4):
    rise = hump(height)
    rise[-1] = 0.0
    return Correction(KNOTS, rise)


def test_the_corrected_law_is_the_sum():
    law = addition().onto(LAW)
    np.testing.assert_allclose(
        law.law.at(KNOTS).position, LAW.law.at(KNOTS).position + hump(), atol=1e-15
    )
    fine = np.linspace(0, LAW.law.duration, 40001)
    motion = law.law.at(fine)
    for value, rate in ((motion.position, motion.velocity), (motion.velocity, motion.acceleration)):
        step = fine[1] - fine[0]  # trapezoids are exact but for the corners of the acceleration
        steps = np.diff(value) - step * (rate[1:] + rate[:-1]) / 2
        np.testing.assert_allclose(steps, 0, atol=3000 * step**2)


def test_a_corrected_press_is_planned_and_checked():
    plan = plan_press(RIG, correction=addition(5e-5))
    assert plan.cruise.error <= RIG.press.speed_tolerance
    assert plan.segments.end.tolist() == plan_press(RIG).segments.end.tolist()


@pytest.mark.parametrize(
    ("time", "rise", "says"),
    [
        (KNOTS, np.ones(60), "at its ends"),
        (KNOTS[::-1], np.zeros(60), "do not increase"),
        (KNOTS, np.full(60, np.nan), "not finite"),
        (KNOTS, np.zeros(59), "shape"),
        (KNOTS[:2], np.zeros(2), "3 or more"),
    ],
)
def test_corrections_that_do_not_fit_are_refused(time, rise, says):
    with pytest.raises(TrajectoryError, match=says):
        Correction(time, rise)


def test_a_correction_of_another_press_is_refused():
    with pytest.raises(TrajectoryError, match="another press"):
        Correction(KNOTS + 0.05, np.zeros_like(KNOTS)).onto(LAW)


def test_a_correction_beyond_the_limits_fails_the_checks():
    assert not all(check.holds for check in draft_press(RIG, correction=addition(8e-3)).checks)

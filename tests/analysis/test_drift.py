"""Drift removal for a noisy, AC-coupled velocity with an offset."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from sautereau.analysis.loading.drift import AT_START, find_rests, force_at_rest, without_drift
from sautereau.daq.signals.calibration import restored
from sautereau.rig.load import load_rig
from sautereau.sim_backend.scene import load_scene
from sautereau.sim_backend.sensors.chain import SensorChain

RATE = 51_200.0
VELOCITY, FORCE = load_rig("paper").daq.channels
SENSORS = load_scene("paper").sensors


def motion(time, back=True, start=0.02):
    """Velocity at the laser, m/s: 3.8 mm down in 0.15 s, at rest, and back by 0.5 s."""

    def stroke(begin, length, width):
        u = np.clip((time - begin) / length, 0, 1)
        return width / length * (1 - np.cos(2 * np.pi * u)) * ((u > 0) & (u < 1))

    return stroke(start, 0.15, 3.8e-3) - back * stroke(start + 0.2, 0.28, 3.8e-3)


def sampled(seed=0, offset=0.0, back=True, until=0.53, channel=VELOCITY):
    """Volts of the simulated sensor on that motion; ``offset`` in V comes after the coupling."""
    chain = SensorChain(channel, SENSORS, RATE, 0.0, np.random.default_rng(seed))
    fine = np.arange(1, int(until * 4 * RATE)) / (4 * RATE)
    chain.input.extend(fine, motion(fine, back))
    return chain.volts(0, int(until * RATE)) + offset


def deflection(velocity):
    return cumulative_trapezoid(velocity, dx=1 / RATE, initial=0)


def held(volts, place=AT_START, channel=VELOCITY, tolerance=0.0):
    velocity = restored(volts, channel, RATE)
    rests = find_rests(velocity, RATE)
    return without_drift(velocity, rests, RATE, 0.0, channel.high_pass, place, tolerance)


@pytest.mark.parametrize("offset", [0.0, 0.5e-3, -2e-3])
def test_the_deflection_drifts_by_less_than_5_um(offset):
    """With the noise of the scene `paper`, and offsets of 0, 12.5 and 50 um/s."""
    worst = unheld = 0.0
    for seed in range(20):
        volts = sampled(seed, offset)
        velocity, drift, warnings = held(volts)
        truth = deflection(motion(np.arange(len(velocity)) / RATE))
        worst = max(worst, np.abs(deflection(velocity) - truth).max())
        alone = restored(volts, VELOCITY, RATE)
        unheld = max(unheld, np.abs(deflection(alone) - truth).max())
        assert warnings == []
        assert abs(drift.closure) < 5e-6
    assert worst < 2e-6
    assert unheld > min(5e-6, abs(offset) * 0.025 * 0.5) / 2


@pytest.mark.parametrize("offset", [1e-3, 3e-3, -5e-3])
def test_a_large_offset_of_a_dc_coupled_vibrometer_is_subtracted(offset):
    """Up to 10 % of the largest speed, 50 mm/s, equal at both ends."""
    time = np.arange(int(0.7 * RATE)) / RATE
    noise = 5e-5 * np.random.default_rng(1).standard_normal(len(time))
    channel = VELOCITY.model_copy(update={"high_pass": 0.0, "delay": 0.0, "low_pass": 0.0})
    volts = (motion(time) + offset + noise) / VELOCITY.scale
    velocity, drift, warnings = held(volts, channel=channel)
    assert warnings == []
    assert drift.velocity == pytest.approx(abs(offset), abs=2e-5)
    assert deflection(velocity) == pytest.approx(deflection(motion(time)), abs=5e-6)


@pytest.mark.parametrize("returns", [True, False])
def test_the_deflection_of_a_key_that_stays_down_is_kept(returns):
    """Whether planned or not; if a return was planned there is a warning."""
    velocity, drift, warnings = held(sampled(back=False), AT_START if returns else None)
    assert deflection(velocity)[-1] == pytest.approx(3.8e-3, abs=5e-6)
    assert drift.closure is None
    assert len(warnings) == returns
    if returns:
        assert warnings[0].doubt
        assert "the key did not return: 3.8 mm of" in warnings[0].text


def test_without_a_rest_before_nothing_is_subtracted():
    volts = sampled()[2000:]
    velocity, drift, (warning,) = held(volts)
    alone = restored(volts, VELOCITY, RATE)
    assert np.array_equal(velocity, alone)
    assert drift.before is None
    assert drift.velocity == drift.deflection == 0
    assert warning.doubt
    assert "start recording before the motion" in warning.text


@pytest.mark.parametrize("tolerance", [0.0, 0.01])
def test_without_a_rest_after_the_offset_is_that_before(tolerance):
    """50 um/s, which the coupling makes grow, are 21 um of 3.8 mm."""
    volts = sampled(offset=2e-3, until=0.3)
    velocity, drift, (remark,) = held(volts, tolerance=tolerance)
    truth = deflection(motion(np.arange(len(velocity)) / RATE))
    assert np.abs(deflection(velocity) - truth).max() < 5e-6
    assert drift.after is None
    assert "without a check at the end, 0.021 mm of 3.8 mm" in remark.text
    assert remark.doubt == (tolerance == 0.0)


def test_a_key_does_not_rise_above_its_rest():
    """An AC coupling of 2 Hz that the rig does not state: the integral falls below its start."""
    volts = sampled(channel=VELOCITY.model_copy(update={"high_pass": 2.0}))
    dc = VELOCITY.model_copy(update={"high_pass": 0.0})
    velocity, drift, (remark,) = held(volts, channel=dc, tolerance=0.01)
    assert drift.after is None
    assert remark.doubt
    assert f"rise by {-deflection(velocity).min() * 1e3:.2g} mm above its rest" in remark.text


def test_a_key_that_never_moved_has_no_rests():
    noise = 5e-5 * np.random.default_rng(0).standard_normal(20_000)
    for velocity in (noise, np.zeros(20_000), np.full(20_000, 0.03), np.zeros(10), np.empty(0)):
        rests = find_rests(velocity, RATE)
        assert len(velocity[rests.before]) == len(velocity[rests.after]) == 0


def test_a_cruise_at_the_end_of_the_recording_is_no_rest():
    time = np.arange(20_000) / RATE
    rests = find_rests(0.027 * np.clip((time - 0.05) / 0.01, 0, 1), RATE)
    assert len(time[rests.before]) > 2000
    assert len(time[rests.after]) == 0


def test_a_wrong_corner_frequency_gives_a_warning():
    """A sensor of 0.6 Hz calibrated as 0.5 Hz: the rests and the return contradict."""
    volts = sampled(channel=VELOCITY.model_copy(update={"high_pass": 0.6}))
    _, _, warnings = held(volts)
    assert len(warnings) == 1
    assert "corner" in warnings[0].text


@pytest.mark.parametrize("tolerance", [0.0, 0.01])
def test_a_velocity_that_cannot_be_an_offset_is_not_treated_as_one(tolerance):
    """A key that creeps by 0.2 mm/s in its rests, and yet returns, by 10 um of 3.8 mm."""
    time = np.arange(int(0.53 * RATE)) / RATE
    creep = 2e-4 * ((time < 0.02) | (time > 0.5))
    velocity, drift, (remark,) = without_drift(
        motion(time) + creep, find_rests(motion(time), RATE), RATE, 0.0, 0.0, AT_START, tolerance
    )
    assert drift.velocity < 2e-5
    assert "no offset of the sensor explains both" in remark.text
    assert remark.doubt == (tolerance == 0.0)
    assert abs(deflection(velocity)[-1]) < 1e-5


def test_a_key_that_the_finger_holds_below_its_start_is_left_there():
    """By a servo that leaves it 60 um too deep, and returns at 0.5 mm/s; the sensor's offset is
    20 um/s."""
    time = np.arange(int(0.53 * RATE)) / RATE
    late = np.clip(time - 0.5, 0.0, None)
    true = motion(time) + np.where(time > 0.3, 75e-6 / 0.2, 0.0) * (time < 0.5) - 5e-4 * (late > 0)
    rests = find_rests(motion(time), RATE)
    depth = deflection(true)[rests.after].mean()
    assert 60e-6 < depth < 75e-6
    velocity, drift, said = without_drift(true + 2e-5, rests, RATE, 0.0, 0.0, (depth + 3e-6, 5e-6))
    assert said == []
    assert deflection(velocity)[rests.after].mean() == pytest.approx(depth, abs=3.5e-6)
    assert drift.velocity == pytest.approx(2e-5, abs=1e-5)


def rest_of(level, slope, seconds, seed=0):
    time = np.arange(int(seconds * RATE)) / RATE
    return level + slope * time + 0.005 * np.random.default_rng(seed).standard_normal(len(time))


@pytest.mark.parametrize("seed", range(5))
def test_an_offset_stays_and_an_earlier_force_decays(seed):
    """0.1 N in a rest of 0.3 s: 0.1 Hz lets it decay by 63 mN/s."""
    w = 2 * np.pi * 0.1
    assert force_at_rest(rest_of(0.1, 0.0, 0.3, seed), 0.005, RATE, 0.1) == (
        pytest.approx(0.1, abs=1e-3),
        True,
    )
    level, is_offset = force_at_rest(rest_of(0.1, -w * 0.1, 0.3, seed), 0.005, RATE, 0.1)
    assert not is_offset
    assert level == pytest.approx(0.1 - 0.15 * w * 0.1, abs=1e-3)


def test_in_a_short_rest_the_level_counts_as_an_offset():
    assert force_at_rest(rest_of(0.01, -0.006, 0.02), 0.005, RATE, 0.1)[1]


def test_a_rest_with_1_over_f_noise_is_found():
    """Its block means scatter by 50 um/s, of which the white noise explains 5."""
    random, time = np.random.default_rng(3), np.arange(int(0.7 * RATE)) / RATE
    spectrum = np.fft.rfft(random.standard_normal(len(time)))
    pink = np.fft.irfft(spectrum / np.sqrt(np.maximum(np.arange(len(spectrum)), 1.0)), len(time))
    slow = motion(time, start=0.06) / 4
    white = 20e-6 * random.standard_normal(len(time))
    rests = find_rests(slow + 60e-6 * pink / pink.std() + white, RATE)
    assert rests.before.stop == pytest.approx(0.06 * RATE, abs=0.02 * RATE)

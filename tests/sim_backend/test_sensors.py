"""The sensor chain against the closed forms of its parts."""

import math

import numpy as np
import pytest

from sautereau.daq.signals.calibration import to_si, undo_high_pass
from sautereau.rig.load import load_rig
from sautereau.sim_backend.parts import Transducer
from sautereau.sim_backend.physics.observation import observe
from sautereau.sim_backend.scene import load_scene
from sautereau.sim_backend.sensors.chain import IDEAL_CONVERTER, SensorChain, Signal
from sautereau.sim_backend.sensors.simulated import SIMULATED

RATE = 51_200.0
SILENT = load_scene("paper").sensors.model_copy(
    update={"velocity_noise": 0.0, "force_noise": 0.0, "hum": 0.0}
)
PLAIN = {"delay": 0.0, "low_pass": 0.0, "high_pass": 0.0}
VELOCITY, FORCE = load_rig("paper").daq.channels


def chain(channel=FORCE, sensors=None, rest=0.0, seed=0, rate=RATE, transducer=None, **chart):
    channel = channel.model_copy(update={**PLAIN, **chart})
    random = np.random.default_rng(seed)
    return SensorChain(channel, sensors, rate, rest, random, transducer=transducer)


def fed(chain, function, duration, step=None):
    """Feed a function of time, at the samples' own instants unless a step is given."""
    time = np.arange(1, round(duration / (step or 1 / chain.rate)) + 1) * (step or 1 / chain.rate)
    chain.input.extend(time, function(time))
    return chain


def test_a_signal_is_linear_between_instants_and_at_rest_before():
    signal = Signal(3.0)
    signal.extend(np.array([1.0, 2.0]), np.array([5.0, 4.0]))
    np.testing.assert_allclose(signal.at(np.array([-9.0, 0.0, 0.5, 1.0, 1.75])), [3, 3, 4, 5, 4.25])


@pytest.mark.parametrize("delay", [0.0, 3.7e-6, 10e-6, 1.1e-3, 0.0123])
def test_the_delay_is_exact_to_a_fraction_of_a_sample(delay):
    """Of a sine of 40 Hz, known every 2 us: linear in between errs by (w dt)^2 / 8."""
    sensor = chain(delay=delay)
    w = 2 * math.pi * 40
    fed(sensor, lambda t: np.sin(w * t), 0.1, step=2e-6)
    time = np.arange(5000) / RATE
    expected = np.where(time > delay, np.sin(w * (time - delay)), 0)
    np.testing.assert_allclose(sensor.volts(0, 5000), expected, atol=1e-7)


@pytest.mark.parametrize("corner", [0.1, 0.5, 5.0])
def test_ac_coupling_of_a_step_is_an_exponential(corner):
    """Half a sample before the first, on average, the step was."""
    sensor = fed(chain(high_pass=corner), np.ones_like, 0.5)
    volts = sensor.volts(0, 25_600)
    time = (np.arange(25_600) - 0.5) / RATE
    np.testing.assert_allclose(volts[1:], np.exp(-2 * math.pi * corner * time[1:]), rtol=1e-6)


def test_a_force_that_was_there_before_is_no_step():
    """AC coupling has forgotten it; the low-pass and the direct way show it."""
    coupled = fed(chain(rest=0.4, high_pass=0.1, low_pass=5000.0), lambda t: 0.4 + 0 * t, 0.01)
    np.testing.assert_allclose(coupled.volts(0, 500), 0, atol=1e-12)
    direct = fed(chain(rest=0.4, low_pass=5000.0), lambda t: 0.4 + 0 * t, 0.01)
    np.testing.assert_allclose(direct.volts(0, 500), 0.4, rtol=1e-12)


@pytest.mark.parametrize("corner", [500.0, 5000.0, 20_000.0])
def test_low_pass_is_3_db_at_its_corner(corner):
    """And first order: 1 / sqrt(1 + tan^2 / tan^2) of the half angles, below and above."""
    n = 51_200
    for factor in (0.1, 1.0, 1.2):
        frequency = round(corner * factor)
        sensor = fed(chain(low_pass=corner), lambda t, f=frequency: np.sin(2 * np.pi * f * t), 1.0)
        volts = sensor.volts(0, n)[n // 2 :]
        gain = np.sqrt(2 * np.mean(volts**2))
        ratio = math.tan(math.pi * frequency / RATE) / math.tan(math.pi * corner / RATE)
        assert gain == pytest.approx(1 / math.sqrt(1 + ratio**2), rel=1e-4)
        if factor == 1:
            assert 20 * math.log10(gain) == pytest.approx(-3.0103, abs=1e-3)


@pytest.mark.parametrize("corner", [200.0, 3000.0, 22_000.0, 40_000.0])
@pytest.mark.parametrize("order", range(1, 9))
def test_a_low_pass_of_an_order_lags_behind_a_ramp_as_the_rig_states(corner, order):
    sensor = fed(
        chain(rest=0.4, low_pass=corner, low_pass_order=order), lambda t: 0.4 + 50 * t, 0.3
    )
    found = np.concatenate([sensor.volts(0, 7), sensor.volts(7, 15_000)]) * FORCE.scale
    lag = sensor.channel.lag
    time = np.arange(len(found)) / RATE
    assert found[0] == pytest.approx(0.4, abs=1e-3)
    late = time > 0.25
    np.testing.assert_allclose(found[late], 0.4 + 50 * (time[late] - lag), atol=1e-8)


@pytest.mark.parametrize("order", [1, 2, 4, 8])
def test_a_low_pass_of_an_order_attenuates_as_a_butterworth_filter(order):
    """1 / sqrt(1 + (f / corner)^2n), at 1 kHz; it is sampled fast, so that warping is small."""
    for frequency in (500, 1000, 1200):
        w = 2 * np.pi * frequency
        sensor = chain(low_pass=1000.0, low_pass_order=order, rate=1e6)
        volts = fed(sensor, lambda t, w=w: np.sin(w * t), 0.1).volts(0, 100_000)[50_000:]
        gain = np.sqrt(2 * np.mean(volts**2)) * FORCE.scale
        expected = 1 / math.sqrt(1 + (frequency / 1000) ** (2 * order))
        assert gain == pytest.approx(expected, rel=2e-4)


@pytest.mark.parametrize("resonance", [30.0, 1500.0, 40_000.0, 1e6])
@pytest.mark.parametrize("damping", [1e-4, 0.02, 0.999])
def test_a_transducer_answers_a_ramp_like_an_oscillator(resonance, damping):
    """y = t - 2 zeta / w + exp(-zeta w t) / w (2 zeta cos + (2 zeta^2 - 1) / sqrt(1 - zeta^2) sin)
    at any rate of the samples, after a force at rest; also where the resonance is above it."""
    part = Transducer.model_construct(resonance=resonance, damping=damping)
    sensor = fed(chain(rest=0.4, transducer=part), lambda t: 0.4 + 50 * t, 0.1)
    time = np.arange(5000) / RATE
    w, root = 2 * math.pi * resonance, math.sqrt(1 - damping**2)
    decay = np.exp(-damping * w * time) / w
    swing = 2 * damping * np.cos(root * w * time)
    swing += (2 * damping**2 - 1) / root * np.sin(root * w * time)
    expected = 0.4 + 50 * (time - 2 * damping / w + decay * swing)
    found = np.concatenate([sensor.volts(0, 7), sensor.volts(7, 4993)]) * FORCE.scale
    np.testing.assert_allclose(found, expected, atol=1e-9)


@pytest.mark.parametrize(("channel", "rms"), [(VELOCITY, 0.05e-3), (FORCE, 5e-3)])
def test_noise_has_its_rms_and_is_white(channel, rms):
    sensors = SILENT.model_copy(update={"velocity_noise": 0.05e-3, "force_noise": 5e-3})
    n = 100_000
    values = fed(chain(channel, sensors), np.zeros_like, 2).volts(0, n) * channel.scale
    assert values.std() == pytest.approx(rms, rel=0.01)
    assert values.mean() == pytest.approx(0, abs=4 * rms / math.sqrt(n))
    next_to = np.mean(values[1:] * values[:-1]) / rms**2
    assert next_to == pytest.approx(0, abs=4 / math.sqrt(n))


def test_hum_is_one_line_on_the_force_alone():
    sensors = SILENT.model_copy(update={"hum": 1e-3, "hum_frequency": 60.0})
    n = 51_200
    volts = fed(chain(FORCE, sensors), np.zeros_like, 1).volts(0, n)
    spectrum = np.abs(np.fft.rfft(volts)) / n * 2
    assert np.argmax(spectrum) == 60
    assert spectrum[60] == pytest.approx(1e-3, rel=1e-3)
    assert np.abs(fed(chain(VELOCITY, sensors), np.zeros_like, 1).volts(0, n)).max() == 0


def test_the_range_clips():
    sensor = fed(chain(VELOCITY, SILENT), lambda t: 0.3 * np.sin(300 * t), 0.1)
    volts = sensor.volts(0, 5000)
    assert volts.max() == pytest.approx(4, abs=2e-6)
    assert volts.min() == pytest.approx(-4, abs=2e-6)
    assert np.mean(np.abs(volts) > 3.999) > 0.5


ADC_RANGE = IDEAL_CONVERTER.range
STEP = 2 * ADC_RANGE / 2**24  # V, of a converter with 24 bits over +-10 V


def test_the_converter_stays_within_its_codes():
    """No code is above +10 V less one step."""
    sensor = fed(chain(FORCE, SILENT, range=50.0), lambda t: 1000 * np.sin(300 * t), 0.1)
    volts = sensor.volts(0, 5000)
    assert volts.max() == ADC_RANGE - STEP
    assert volts.min() == -ADC_RANGE


def test_the_converter_rounds_to_its_step():
    sensor = fed(chain(FORCE, SILENT), lambda t: 0.37 * t, 0.1)
    volts = sensor.volts(0, 5000)
    codes = volts / STEP
    np.testing.assert_array_equal(codes, np.rint(codes))
    error = volts - 0.37 * np.arange(5000) / RATE
    assert np.abs(error).max() <= STEP / 2 * (1 + 1e-6)
    assert error.std() == pytest.approx(STEP / math.sqrt(12), rel=0.05)


NOISY = load_scene("paper").sensors


def noisy(seed=0):
    sensor = chain(FORCE, NOISY, seed=seed, delay=10e-6, low_pass=22_000.0, high_pass=0.1)
    return fed(sensor, lambda t: np.sin(40 * t), 0.1)


@pytest.mark.parametrize("block", [1, 50, 4999])
def test_blocks_do_not_change_a_bit(block):
    whole, parts = noisy(), noisy()
    expected = whole.volts(0, 5000)
    assert parts.volts(0, 0).shape == (0,)
    found = [parts.volts(i, min(block, 5000 - i)) for i in range(0, 5000, block)]
    np.testing.assert_array_equal(np.concatenate(found), expected)


@pytest.mark.parametrize(("channel", "corner"), [(VELOCITY, 0.5), (FORCE, 0.1), (VELOCITY, 1.0)])
def test_what_the_chain_droops_the_correction_restores(channel, corner):
    """A press of 500 ms: down, hold, back; to 0.2 % of its height."""

    def course(t):
        return channel.scale * (np.tanh((t - 0.05) * 100) - np.tanh((t - 0.4) * 80))

    sensor = fed(chain(channel, SILENT, rest=course(0.0), high_pass=corner), course, 0.5)
    volts = sensor.volts(0, 25_600)
    time = np.arange(25_600) / RATE
    expected = course(time)
    restored = undo_high_pass(to_si(volts, sensor.channel), sensor.channel.high_pass, RATE)
    assert np.abs(volts * channel.scale - expected).max() > 0.1 * expected.max()
    np.testing.assert_allclose(restored, expected, atol=2e-3 * expected.max())


def test_motion_of_the_keys_front_in_its_three_quantities():
    """In blocks of any size; the acceleration's integral is the velocity, over its jumps."""
    rig = load_rig("paper")
    motions = observe(rig, load_scene("ideal")).motions
    found = {name: [] for name in ("displacement", "velocity", "acceleration", "sound_pressure")}
    sources = {name: SIMULATED.get(name).source(rig) for name in found}
    for part in np.array_split(np.arange(len(motions.time)), 37):
        block = type(motions)(**{name: values[part] for name, values in vars(motions).items()})
        for name, source in sources.items():
            found[name].append(source(block))
    joined = {name: np.concatenate(values) for name, values in found.items()}
    steps = np.diff(motions.time)
    velocity, acceleration = joined["velocity"], joined["acceleration"]
    path = np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * steps)
    np.testing.assert_allclose(joined["displacement"][1:], path, atol=1e-6)
    mean_velocity = np.cumsum(acceleration[1:] * steps)
    jumps = np.cumsum(np.where(steps == 0, np.diff(velocity), 0))
    np.testing.assert_allclose(mean_velocity, (velocity - velocity[0])[1:] - jumps, atol=1e-9)
    assert not joined["sound_pressure"].any()


def test_a_jump_is_kept_sharp():
    """Two equal instants: no sample lies on a slope between them, and one there is after it."""
    signal = Signal(0.0)
    signal.extend(np.array([1.0, 2.0]), np.array([1.0, 2.0]))
    signal.extend(np.array([2.6, 2.6, 4.0]), np.array([2.6, 0.5, 0.5]))
    found = signal.at(np.array([2.3, 2.5999, 2.6, 2.6001, 3.0, 3.7]))
    np.testing.assert_allclose(found, [2.3, 2.5999, 0.5, 0.5, 0.5, 0.5], atol=1e-9)

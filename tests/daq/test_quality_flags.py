"""Flags in signals with known faults, and none in signals without."""

import numpy as np
import pytest

from sautereau.daq.signals.quality_flags import (
    FLAT,
    QualityFlag,
    find_quality_flags,
    quality_warnings,
)

RATE = 51_200.0
NOISE = {"velocity": 0.002, "force": 0.005}  # V, of the scene `paper`


def press(n=25_600, seed=0, noise=0.002):
    """Volts of a key that goes down and up, with the vibrometer's noise."""
    time = np.arange(n) / RATE
    down, up = (np.exp(-(((time - at) / width) ** 6)) for at, width in ((0.1, 0.06), (0.35, 0.08)))
    return 1.1 * down - 0.8 * up + noise * np.random.default_rng(seed).standard_normal(n)


def samples(flag, channel):
    return tuple(round((t + channel.lag) * RATE, 6) for t in (flag.start, flag.stop))


def test_clipping_finds_both_ends_of_the_range(force):
    volts = np.zeros(200)
    volts[:2] = 10.0
    volts[5] = -9.995
    volts[8:11] = 10.005
    volts[12] = 9.98
    volts[198:] = -10.0
    found = find_quality_flags(volts, force, RATE)
    assert [flag.kind for flag in found] == ["clipped"] * 4
    assert [samples(m, force) for m in found] == [(0, 2), (5, 6), (8, 11), (198, 200)]


def test_times_are_the_motions(velocity):
    volts = np.zeros(100)
    volts[40:50] = 4.0
    (flag,) = find_quality_flags(volts, velocity, RATE, first_sample=-30)
    assert flag == QualityFlag("clipped", "velocity", 10 / RATE - 1.1e-3, 20 / RATE - 1.1e-3)


def test_beyond_the_range_is_an_overload(velocity):
    """The input takes 10 V, the sensor 4 V."""
    time = np.arange(2000) / RATE
    found = find_quality_flags(5 * np.sin(2 * np.pi * 50 * time), velocity, RATE)
    assert {flag.kind for flag in found} == {"overload"}
    assert len(found) == 4


@pytest.mark.parametrize("end", [7.0, 0.7])
def test_a_saturated_amplifier_is_flat_below_the_range(force, end):
    """A charge amplifier at its end, far below the range of the card, without noise there."""
    time = np.arange(25_600) / RATE
    noise = 7e-4 * end * np.random.default_rng(0).standard_normal(len(time))
    volts = np.clip(1.3 * end * np.sin(2 * np.pi * 8 * time) + noise, -9.9, end)
    found = find_quality_flags(volts, force, RATE)
    assert {flag.kind for flag in found} == {"overload"}
    marked = sum(m.stop - m.start for m in found) * RATE
    assert marked == pytest.approx(np.count_nonzero(volts == end), rel=0.02)


@pytest.mark.parametrize("depth", [1.0, 0.5, 0.05])
def test_drop_outs_are_found_where_they_are(velocity, depth):
    """50 of 0.1 to 1 ms, by a fraction of 1.1 V: 25 sigma for the least. All are found."""
    random = np.random.default_rng(1)
    volts = 1.1 + 0.002 * random.standard_normal(51_200)
    starts = 500 + 1000 * np.arange(50)
    stops = starts + random.integers(5, 51, 50)
    for start, stop in zip(starts, stops, strict=True):
        volts[start:stop] -= depth * 1.1
    found = find_quality_flags(volts, velocity, RATE)
    assert {flag.kind for flag in found} == {"drop-out"}
    edges = np.array([samples(flag, velocity) for flag in found])
    np.testing.assert_allclose(edges, np.stack([starts, stops], 1), atol=2)


def test_a_spike_of_one_sample(velocity):
    volts = press()
    volts[5000] += 0.1
    (flag,) = find_quality_flags(volts, velocity, RATE)
    assert flag.kind == "drop-out"
    assert samples(flag, velocity) == (5000, 5001)


@pytest.mark.parametrize("noise", [0.0002, 0.002, 0.02])
@pytest.mark.parametrize("bits", [8, 10, 12])
def test_rounding_to_few_bits_is_no_drop_out(velocity, bits, noise):
    """Of an input of +-4 V; but a press has a drop-out of 0.3 ms where the signal is lost."""
    count = 8.0 / 2**bits
    for seed in range(4):
        volts = press(seed=seed, noise=noise)
        assert find_quality_flags(np.round(volts / count) * count, velocity, RATE) == []
        volts[5000:5015] = 0.0
        (flag,) = find_quality_flags(np.round(volts / count) * count, velocity, RATE)
        assert flag.kind == "drop-out"
        assert samples(flag, velocity) == (5000, 5015)


def test_a_force_has_no_drop_outs(force):
    volts = press()
    volts[5000:5010] += 0.5
    assert find_quality_flags(volts, force, RATE) == []


@pytest.mark.parametrize("name", ["velocity", "force"])
def test_none_in_two_million_samples_of_clean_noise(paper, name):
    """40 s of it; a drop-out needs a jump of 7 sigma, probability 1e-12 per sample."""
    channel = paper.daq.channel(name)
    for seed in (0, 1):
        noise = NOISE[name] * np.random.default_rng(seed).standard_normal(1_000_000)
        assert find_quality_flags(noise, channel, RATE) == []


def flags_of(speed, velocity, rate):
    """Return the flags of a speed [m/s] with the vibrometer's noise."""
    noise = 5e-5 * np.random.default_rng(0).standard_normal(len(speed))
    return find_quality_flags((speed + noise) / velocity.scale, velocity, rate)


@pytest.mark.parametrize("rate", [5e3, 10e3, 51.2e3, 200e3])
def test_a_release_is_no_drop_out_at_any_rate(velocity, rate):
    """It changes the acceleration by 12 m/s^2, and a key rings at 350 Hz from then on."""
    time = np.arange(round(0.1 * rate)) / rate
    since = np.maximum(time - 0.05, 0)
    speed = 0.03 + 12 * np.minimum(since, 1e-3)
    speed += 5e-3 * np.exp(-60 * since) * np.sin(2 * np.pi * 350 * since)
    assert flags_of(speed, velocity, rate) == []


@pytest.mark.parametrize("rate", [2e3, 5e3, 10e3])
def test_an_impact_is_no_drop_out_in_few_samples(velocity, rate):
    """A key of 0.08 m/s meets its front felt, and comes to rest with 150 Hz: 75 m/s^2."""
    for start in np.linspace(0.05, 0.05 + 1 / rate, 5):
        time = np.arange(round(0.2 * rate)) / rate
        since = np.maximum(time - start, 0)
        speed = 0.08 * np.exp(-300 * since) * np.cos(2 * np.pi * 150 * since)
        assert flags_of(speed, velocity, rate) == []


def test_a_drop_out_in_few_samples(velocity):
    speed = np.full(500, 0.06) + 5e-5 * np.random.default_rng(0).standard_normal(500)
    speed[200:204] = 0.0
    (flag,) = find_quality_flags(speed / velocity.scale, velocity, 5e3)
    assert flag.kind == "drop-out"
    assert (flag.start + velocity.lag, flag.stop + velocity.lag) == pytest.approx((0.04, 0.0408))


def test_a_bouncing_key_has_no_drop_outs(velocity):
    """It falls on its rail again and again: each impact reverses it at once, the fall does not."""
    time = np.arange(0, 0.1, 1 / RATE)
    bounces = 0.02 - 20 * (time % 2e-3)
    since = np.maximum(time - 0.05, 0)
    ringing = 0.03 * np.exp(-300 * since) * np.sin(2 * np.pi * 1200 * since)
    assert flags_of(np.where(time < 0.05, bounces, ringing), velocity, RATE) == []


def test_quiet_data_of_16_bits_are_no_overload(force):
    """A slow force: many neighbouring samples have the same count."""
    count = 20 / 2**16
    volts = 4 + np.sin(2 * np.pi * 2 * np.arange(51_200) / RATE)
    volts = volts + 0.6 * count * np.random.default_rng(0).standard_normal(len(volts))
    assert find_quality_flags(np.round(volts / count) * count, force, RATE) == []


@pytest.mark.parametrize(("samples", "flags"), [(FLAT - 1, 0), (FLAT, 1), (FLAT + 1, 1)])
def test_the_shortest_saturation(force, samples, flags):
    volts = 3 + press(2000)
    volts[900 : 900 + samples] = 3.5
    assert len(find_quality_flags(volts, force, RATE)) == flags


@pytest.mark.parametrize("n", [0, 1, 2, 3, 50, 153, 154])
def test_short_signals(velocity, n):
    assert find_quality_flags(np.zeros(n), velocity, RATE) == []
    if n:
        assert len(find_quality_flags(np.full(n, 4.0), velocity, RATE)) == 1


def test_what_is_no_number_is_no_fault_of_the_search(velocity):
    volts = press()
    volts[300:310] = np.nan
    volts[400] = np.inf
    assert "overload" in {flag.kind for flag in find_quality_flags(volts, velocity, RATE)}


def test_warnings_say_how_often_and_what_to_do():
    flags = [
        QualityFlag("clipped", "force", 0.01, 0.011),
        QualityFlag("clipped", "force", 0.02, 0.022),
        QualityFlag("drop-out", "velocity", 0.03, 0.0301),
        QualityFlag("drop-out", "velocity", 0.04, 0.0402),
    ]
    clipped, dropped = quality_warnings(flags)
    assert clipped.startswith("force: clipped in 2 stretches, 3 ms in total, first at 10 ms after")
    assert dropped.startswith("velocity: drop-out in 2 stretches, 0.3 ms in total, first at 30 ms")


def test_a_key_that_turns_round_sharply_is_no_drop_out(velocity):
    """A kink as at release: 10 m/s^2 under the laser, and back."""
    time = np.arange(5120) / RATE
    noise = 0.002 * np.random.default_rng(0).standard_normal(len(time))
    kink = -10 / 0.025 * np.maximum(0, 1e-3 - np.abs(time - 0.05))
    assert find_quality_flags(1.1 + kink + noise, velocity, RATE) == []


def test_none_in_clean_presses(velocity):
    """Also without noise, as ideal sensors show them."""
    for volts in (press(noise=0.0), *(press(seed=seed) for seed in range(20))):
        assert find_quality_flags(volts, velocity, RATE) == []

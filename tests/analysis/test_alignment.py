"""The start of a motion, found in samples that no edge has started."""

import numpy as np
import pytest

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.alignment import find_start
from sautereau.rig.load import load_rig
from sautereau.trajectory.press import plan_press

RATE, FIRST, LATEST = 10_000.0, -0.1, 0.1


@pytest.fixture(scope="module")
def rig():
    paper = load_rig()
    channels = tuple(
        channel.model_copy(update={"delay": 0.0, "high_pass": 0.0, "low_pass": None})
        for channel in paper.daq.channels
    )
    return paper.replaced({"daq.channels": channels})


@pytest.fixture(scope="module")
def press(rig):
    return plan_press(rig)


def volts_of(rig, press, start, gap=0.0):
    """Return the channels' volts of a press that starts at ``start`` s; noise, and a gap [m]."""
    clock = FIRST + np.arange(int(0.95 * RATE)) / RATE
    angle = np.interp(clock - start, press.time, press.angle.position)
    slack = gap / rig.key.press_arm
    deflection = np.maximum(0.0, angle - slack) * rig.key.laser_arm
    noise = np.random.default_rng(1).normal(0, 1e-4, len(clock))
    velocity = rig.daq.channel("velocity")
    volts = np.zeros((len(rig.daq.channels), len(clock)))
    volts[rig.daq.channels.index(velocity)] = np.gradient(deflection, 1 / RATE) + noise
    return volts / velocity.scale


def readings(press, *, jitter=0.0, count=0.0, every=4):
    """Return times and angles that the host reads: late by noise, and rounded to counts [rad]."""
    period = press.time[1]
    times = np.arange(-100, len(press.time) + 10, every) * period
    q = np.stack([np.interp(times, press.time, press.joints.position[:, j]) for j in (0, 1)], -1)
    late = np.random.default_rng(2).normal(0, jitter, len(times))
    return times + late, np.rint(q / count) * count if count else q


def found(rig, press, start, gap=0.0, **noise):
    volts = volts_of(rig, press, start, gap)
    return find_start(rig, volts, FIRST, RATE, *readings(press, **noise), LATEST)


@pytest.mark.parametrize("start", [-0.0305, 0.0, 0.0123456])
def test_the_start_is_found_between_samples(rig, press, start):
    at, std = found(rig, press, start)
    assert at == pytest.approx(start, abs=50e-6)
    assert std == pytest.approx(0.5 / RATE, rel=0.05)


@pytest.mark.parametrize(
    ("noise", "least"),
    [({"jitter": 1e-3}, 60e-6), ({"count": 2 * np.pi / 4096}, 50e-6), ({"gap": 0.2e-3}, 50e-6)],
)
def test_jitter_resolution_and_a_gap_are_in_the_uncertainty(rig, press, noise, least):
    at, std = found(rig, press, 0.0123, **noise)
    assert least <= std < 3e-3
    assert abs(at - 0.0123) < 3 * std


def test_samples_without_the_motion_give_no_start(rig, press):
    rest = np.random.default_rng(3).normal(0, 1e-3, (len(rig.daq.channels), 9500))
    with pytest.raises(AnalysisError, match="do not show the same motion"):
        find_start(rig, rest, FIRST, RATE, *readings(press), LATEST)
    few = readings(press, every=50)
    with pytest.raises(AnalysisError, match="too few"):
        find_start(rig, rest, FIRST, RATE, *few, LATEST)

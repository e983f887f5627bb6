"""The low-pass of a sensor in the fit of a release."""

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from benchmarks.simulated import simulated_press
from sautereau.analysis.phases import find_phases
from sautereau.analysis.phases.signals import LowPass, slow_low_pass
from sautereau.rig.load import with_values
from sautereau.sim_backend.scene import load_scene
from tests.budget import slow

STEP = 40e-6


def filtered_channel(rig, corner, order):
    values = {}
    for name in ("velocity", "force"):
        number = [channel.name for channel in rig.daq.channels].index(name)
        values[f"daq.channels.{number}.low_pass"] = f"{corner} Hz"
        values[f"daq.channels.{number}.low_pass_order"] = order
    return with_values(rig, values)


def test_a_filtered_column_is_that_of_a_fine_digital_filter(paper):
    rng = np.random.default_rng(1)
    for _ in range(30):
        corner, order = (
            float(np.exp(rng.uniform(np.log(50), np.log(2400)))),
            int(rng.integers(1, 9)),
        )
        low_pass = slow_low_pass(filtered_channel(paper, corner, order).daq.channel("force"))
        assert isinstance(low_pass, LowPass)
        n, start, turn = 200, rng.uniform(1e-3, 4e-3), rng.uniform(100, 3000)

        def column(time, start=start, turn=turn):
            since = np.maximum(time - start, 0.0)
            return (since / 1e-3) ** 2 * np.cos(turn * since)

        rows = column(np.arange(n + low_pass.ahead(STEP)) * STEP)
        found = low_pass.filtered(rows[:, None], STEP, n)[:, 0]
        rate = 100 * max(corner, 2e4)
        fine = np.arange(round((n * STEP + 2 * low_pass.delay) * rate)) / rate
        after = sosfilt(butter(order, corner, fs=rate, output="sos"), column(fine))
        expected = np.interp(np.arange(n) * STEP + low_pass.delay, fine, after)
        # Error of a column that is linear between rows: its curvature times the step squared / 8.
        bound = 2e-3 * np.abs(rows).max()
        assert np.abs(found - expected).max() < bound, (corner, order)


def test_a_line_stays_the_same_line():
    """The delay of slow motions is compensated, exactly for a line far after its start."""
    for corner, order in ((200, 1), (1000, 2), (2400, 8)):
        low_pass = LowPass(corner, order, 1 / (2 * np.pi * corner * np.sin(np.pi / 2 / order)))
        n = 2000
        line = np.arange(float(n + low_pass.ahead(STEP)))
        found = low_pass.filtered(np.stack([line, line * 1j], 1), STEP, n)[-500:]
        assert found[:, 0].real == pytest.approx(line[n - 500 : n], abs=1.0)
        assert np.diff(found[:, 1].imag) == pytest.approx(1.0, abs=1e-9)


def test_a_fast_low_pass_or_one_of_unknown_order_is_not_applied(paper):
    assert slow_low_pass(None) is None
    assert slow_low_pass(filtered_channel(paper, 1000, 0).daq.channel("force")) is None
    assert slow_low_pass(filtered_channel(paper, 20e3, 2).daq.channel("force")) is None


@pytest.mark.parametrize(
    ("corner", "order"), [(1000, 2), slow(2000, 8), slow(1000, 8), slow(500, 2)]
)
def test_releases_behind_a_slow_low_pass_are_found(paper, corner, order):
    """Within 0.15 ms and three standard uncertainties; they were up to 0.5 ms early."""
    rig = filtered_channel(paper, corner, order)
    press, truth = simulated_press(rig, load_scene("paper"), 3)
    (pluck,) = find_phases(press).plucks
    error = pluck.release - truth.releases[0]
    assert abs(error) < min(0.15e-3, 3 * pluck.release_std)

"""Phases on a key that bends, heaves and rings; most presses are of the independent simulator."""

import numpy as np
import pytest

from benchmarks.independent import ONE_FACTOR
from benchmarks.independent_phases import judge
from sautereau.analysis.phases.event_fit import EventFit
from sautereau.analysis.phases.response import Columns, pole
from sautereau.analysis.phases.signals import Rows
from sautereau.analysis.phases.slow import Slow

pytest.importorskip("numba")  # without it the independent simulator takes half a minute a press


def rows_of_load(load, step, noise):
    n = len(load)
    time = (np.arange(n) + 0.5) * step
    zero = np.zeros(n)
    return Rows(time, step, load, zero, zero, zero, np.full(n, noise**2), np.zeros(n - 1))


@pytest.mark.parametrize("samples", [1, 8])
def test_a_row_is_the_mean_of_the_response(samples):
    """Against sums over fine steps."""
    step, p = 1e-4, pole(700.0, 0.1)
    rows = rows_of_load(np.zeros(40), step, 1.0)
    columns = Columns(rows, 0.0, samples)
    fine = (np.arange(-2000, 2000) + 0.5) / 2000 * step  # about the middle of a row
    weight = (np.abs(fine) < step / 2) * 1.0 if samples == 1 else 1 - np.abs(fine) / step
    at, instant = rows.time[12], rows.time[12] - 0.3 * step
    since = at + fine - instant
    ring = np.where(since > 0, np.exp(p * np.maximum(since, 0)), 0)
    expected = (weight * ring).sum() / weight.sum()
    assert columns.ring(np.array([instant]), p)[0, 12] == pytest.approx(expected, rel=1e-3)
    expected = (weight * (since > 0)).sum() / weight.sum()
    assert columns.step(np.array([instant]))[0, 12] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("frequency", [500.0, 900.0])
def test_an_event_with_a_mode_is_found_with_its_instant_and_its_pole(frequency):
    """A load that grows, and then rings about a lower level, with white noise."""
    step, noise, instant = 5e-5, 5e-3, 4.0123e-3
    time = (np.arange(140) + 0.5) * step
    since, p = np.maximum(time - instant, 0), pole(frequency, 0.05)
    ringing = (np.exp(p * since) * (1 - 0.3j)).real * 0.4
    load = np.where(time > instant, 0.1 + ringing, 0.1 + 30 * (time - instant) + 0.6)
    load = load + noise * np.random.default_rng(0).standard_normal(len(time))
    fit = EventFit(rows_of_load(load, step, noise), 4e-3, 1)
    start = fit.refine(np.array([0.0]), np.zeros(0, complex))
    found, gain = fit.another(start)
    assert gain > 100
    best = fit.refine(np.zeros(1), np.array([found]))
    assert best.instant == pytest.approx(instant - 4e-3, abs=step / 2)
    assert np.abs(best.poles[0]) == pytest.approx(np.abs(p), rel=0.05)


def test_the_smoothed_derivatives_belong_to_the_smoothed_signal(make_press):
    from sautereau.analysis.phases.signals import signals_of

    signals = signals_of(make_press())
    slow = Slow(signals, 1500, 6000)
    wave, turn = np.sin(300.0 * slow.hops), 300.0
    for order in (1, 2, 4):
        expected = np.real(turn**order * 1j**order * np.exp(1j * turn * slow.time) * -1j)
        got = slow.smooth(wave, order)[10:-10]
        assert got == pytest.approx(expected[10:-10], abs=0.05 * turn**order)


@pytest.mark.parametrize(
    ("name", "contact", "release"),
    [
        ("all stiff", 0.2, 0.05),
        ("key bends at 350 Hz", 1.0, 0.1),
        ("key bends at 220 Hz", 2.0, 0.1),
        ("key heaves at 120 Hz", 2.0, 0.1),
        ("jack on cloth of 15 kN/m", 1.0, 0.5),
        ("sampled at 5 kHz", 1.0, 0.2),
        ("speckle 1 %", 1.0, 0.1),
    ],
)
def test_one_imperfection_at_a_time(name, contact, release):
    """Limits in ms."""
    found = judge(ONE_FACTOR[name], 0)
    assert found.right
    ((of_contact, of_release, *_),) = found.errors * 1e3
    assert abs(of_contact) < contact
    assert abs(of_release) < release

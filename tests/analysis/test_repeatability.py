"""Repeatability of presses whose spread and drift are known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.press import Press
from sautereau.analysis.results.comparison import repeatability_lines
from sautereau.analysis.session.repeatability import Spread, Trend, repeatability, step_of, trend_of
from sautereau.daq.file.recorded import Event
from sautereau.trajectory.timing import press_law
from tests.presses import with_data


@pytest.fixture(scope="module")
def law(paper):
    return press_law(paper.press)


def presses(paper, law, offsets, speeds):
    """Make presses equal to the plan except for an offset [m] and a factor of the speed."""
    time = np.arange(0, law.law.duration, 1e-4)
    plan = law.law.at(time)
    made = []
    for offset, factor in zip(offsets, speeds, strict=True):
        rise = offset + factor * plan.position
        samples = {"jack_rise": rise, "jack_speed": factor * plan.velocity}
        made.append(Press(Path("p.mcap"), paper, True, time, samples, 1e4))
    return made


def test_equal_presses_have_no_spread(paper, law):
    found = repeatability(presses(paper, law, np.zeros(5), np.ones(5)), law)
    assert found.presses == 5
    assert found.path_repeatability == pytest.approx(0, abs=1e-15)
    assert found.path_accuracy < 1e-8
    assert found.velocity_repeatability.value == pytest.approx(0, abs=1e-12)
    assert abs(found.velocity_accuracy) < 1e-6
    assert not found.rise_drift.significant


def test_a_motion_that_starts_after_the_trigger_is_on_the_planned_path(paper, law):
    """At 0.072 m/s each millisecond would count as 72 um."""
    late = []
    for press, start in zip(
        presses(paper, law, np.zeros(3), np.ones(3)), (0.4e-3, 0.5e-3, 1.4e-3), strict=True
    ):
        late.append(replace(press, time=press.time + start, motion=Event(start, "motion", "")))
    found = repeatability(late, law)
    assert found.path_accuracy < 1e-8
    assert found.path_repeatability < 1e-8


def test_known_offsets_and_speeds(paper, law):
    offsets = np.array([-1e-5, 0, 1e-5])
    found = repeatability(presses(paper, law, offsets, np.ones(3)), law)
    distance = np.abs(offsets)
    assert found.path_repeatability == pytest.approx(
        distance.mean() + 3 * distance.std(ddof=1), rel=1e-6
    )
    speeds = np.array([0.99, 1.0, 1.02, 1.01])
    found = repeatability(presses(paper, law, np.zeros(4), speeds), law)
    assert found.velocity_repeatability.value == pytest.approx(3 * speeds.std(ddof=1), rel=1e-6)
    assert found.velocity_accuracy == pytest.approx(speeds.mean() - 1, rel=1e-4)


def test_a_small_spread_and_drift_keep_their_digits(paper, law):
    """With three decimals the drift and both ends of its interval were -0.001 %."""
    found = replace(
        repeatability(presses(paper, law, np.zeros(3), np.ones(3)), law),
        velocity_repeatability=Spread(1.2e-5, 0.6e-5, 7.5e-5),
        speed_drift=Trend(-0.9e-5, -1.3e-5, -0.5e-5),
    )
    said = "\n".join(repeatability_lines(found))
    assert "0.0012 % (95 %: 0.0006 % to 0.0075 %)" in said
    assert "-0.0009 % per press (95 %: -0.0013 % to -0.0005 %)" in said


def test_a_slow_press_is_less_accurate(paper, law):
    found = repeatability(presses(paper, law, np.zeros(3), np.full(3, 0.9)), law)
    assert found.velocity_accuracy == pytest.approx(-0.1, rel=1e-3)
    assert found.path_accuracy == pytest.approx(0.1 * law.law.at(law.cruise_end).position, rel=0.02)


def test_intervals_cover_a_known_jitter(paper, law):
    """95 % intervals of the spread contain the true value in about 95 % of sessions."""
    random = np.random.default_rng(3)
    sigma, sessions = 2e-3, 120
    held = 0
    for _ in range(sessions):
        speeds = 1 + sigma * random.standard_normal(8)
        spread = repeatability(presses(paper, law, np.zeros(8), speeds), law).velocity_repeatability
        held += spread.low <= 3 * sigma <= spread.high
    assert 0.88 <= held / sessions <= 1.0


def test_a_significant_drift_is_reported(paper, law):
    offsets = 1e-6 * np.arange(20) + 1e-7 * np.random.default_rng(0).standard_normal(20)
    found = repeatability(presses(paper, law, offsets, np.ones(20)), law)
    assert found.rise_drift.significant
    assert found.rise_drift.low < 1e-6 < found.rise_drift.high
    assert not found.speed_drift.significant


def test_too_few_or_too_short(paper, law):
    with pytest.raises(AnalysisError, match="at least 3"):
        repeatability(presses(paper, law, np.zeros(2), np.ones(2)), law)
    made = presses(paper, law, np.zeros(3), np.ones(3))
    short = with_data(made[0], made[0].data.iloc[:300])
    with pytest.raises(AnalysisError, match=r"p\.mcap ends at"):
        repeatability([*made[1:], short], law)


def test_a_step_between_two_presses_has_its_place_and_means():
    values = np.r_[np.full(4, 0.78), np.full(6, 0.58)] + 1e-3 * np.tile([1, -1], 5)
    found = step_of(values)
    assert (found.before, found.first, found.second) == pytest.approx((4, 0.78, 0.58))
    assert step_of(np.full(10, 0.78)) is None
    assert step_of(values[:2]) is None


@pytest.mark.parametrize("n", [3, 5, 20])
def test_steps_are_said_of_one_in_a_thousand_sets_without_one(n):
    random = np.random.default_rng(n)
    sets = 4000
    found = sum(step_of(random.standard_normal(n)) is not None for _ in range(sets))
    assert found / sets < 1e-3 + 3 * np.sqrt(1e-3 / sets)


@pytest.mark.parametrize("n", [3, 6, 20])
def test_drifts_are_said_of_one_in_a_hundred_sets_without_one(n):
    """Five quantities are tested: of 95 in 100 sessions without one no drift is named."""
    random, sets = np.random.default_rng(n), 4000
    found = sum(trend_of(random.standard_normal(n)).significant for _ in range(sets))
    assert found / sets == pytest.approx(0.01, abs=3 * np.sqrt(0.01 / sets))


def test_a_straight_drift_is_no_step():
    random = np.random.default_rng(0)
    drifts = (np.arange(20) + random.standard_normal(20) for _ in range(200))
    assert sum(step_of(values) is not None for values in drifts) <= 1

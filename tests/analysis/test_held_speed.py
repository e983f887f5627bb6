"""The jack's speed while a string is held, of motions whose speed is known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import HeldString, Phases
from sautereau.analysis.press.features import OF_SPEED, held_speeds
from sautereau.analysis.results.press import held_speed
from sautereau.daq.file.recorded import Event
from sautereau.rig.quantities import QUANTITIES
from sautereau.trajectory.timing import press_law

START = 2e-3  # s, of the motion


def press_of(paper, speed):
    """Return a press whose jack has a speed [m/s] over the time from the start of the motion."""
    time = np.arange(0, 0.13, 1 / 51_200)
    rise = np.concatenate([[0.0], np.cumsum(speed(time[:-1])) / 51_200])
    motion = Event(START, "motion", "")
    return Press(
        Path("p.mcap"), paper, True, time + START, {"jack_rise": rise}, 51_200, motion=motion
    )


def holding(*times):
    """Return phases with strings held between these times [s] from the start of the motion."""
    plucks = (HeldString(a + START, b + START, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0) for a, b in times)
    return Phases(0.0, 0.1, tuple(plucks), 0.072, None, None, ())


def planned(paper):
    return lambda time: press_law(paper.press).law.at(time).velocity


def test_a_jack_on_its_plan_has_no_error(paper):
    found = held_speeds(press_of(paper, planned(paper)), holding((0.05, 0.07)))
    assert found["held_speed_error"] == pytest.approx(0, abs=1e-4)
    assert [found[name] for name in OF_SPEED[:3]] == pytest.approx([0.072] * 3, rel=1e-4)


@pytest.mark.parametrize("lost", [0.1, 0.475])
def test_an_oscillating_jack_has_its_rms(paper, lost):
    """A period of 20 ms: averaging over 1 ms leaves sinc(1/20) of the amplitude."""
    speed = planned(paper)
    press = press_of(paper, lambda t: speed(t) * (1 - lost * np.sin(np.pi * t / 0.01)))
    found = held_speeds(press, holding((0.04, 0.06), (0.06, 0.1)))
    averaged = lost * np.sinc(1 / 20)
    assert found["held_speed_error"] == pytest.approx(averaged / np.sqrt(2), rel=1e-3)
    assert QUANTITIES["held_speed_error"].displayed == (100, "%")
    assert found["held_speed_mean"] == pytest.approx(0.072, rel=1e-3)
    # The extremes lie within half an average of 1 ms of the middle of one.
    beside = 0.072 * averaged * (1 - np.cos(np.pi / 20))
    assert found["held_speed_min"] == pytest.approx(0.072 * (1 - averaged), abs=beside)
    assert found["held_speed_max"] == pytest.approx(0.072 * (1 + averaged), abs=beside)


def test_only_the_time_in_which_a_string_is_held_counts(paper):
    """The jack stops between two strings, which the verdict does not contain."""
    speed = planned(paper)
    press = press_of(paper, lambda t: speed(t) * ~((t > 0.06) & (t < 0.07)))
    apart = held_speeds(press, holding((0.04, 0.06), (0.07, 0.09)))
    assert apart["held_speed_error"] == pytest.approx(0, abs=1e-3)
    both = held_speeds(press, holding((0.04, 0.065), (0.05, 0.08)))
    assert both["held_speed_error"] == pytest.approx(np.sqrt(0.01 / 0.04), rel=0.01)
    assert both["held_speed_min"] == pytest.approx(0, abs=1e-6)


def test_without_a_pluck_or_a_planned_motion_there_is_no_verdict(paper):
    press = press_of(paper, planned(paper))
    assert set(held_speeds(press, holding()).values()) == {None}
    assert held_speed(press, held_speeds(press, holding())) is None
    imported = replace(press, motion=None)
    found = held_speed(imported, held_speeds(imported, holding((0.05, 0.07))))
    assert found is not None
    assert found["mean"] == pytest.approx(0.072, rel=1e-4)
    assert found["rms_error"] is found["reached"] is None

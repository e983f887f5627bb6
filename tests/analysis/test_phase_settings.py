"""Each setting of the phases changes what is found; what changes nothing is no setting."""

import math
from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest

from benchmarks.independent import ONE_FACTOR
from benchmarks.independent import press as independent
from benchmarks.simulated import judged_press, random_case, simulated_press
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases import Phases, find_phases
from sautereau.analysis.phases.settings import SETTINGS
from sautereau.daq.file.recorded import Event
from tests.analysis.test_unexpected import UNEXPECTED, of_channel, second, with_strings

NAMES = [field.name for field in fields(SETTINGS)]


def scaled(value: float | tuple[float, ...], factor: float) -> float | tuple[float, ...]:
    """Return a setting times a factor; a number of things is changed by 1 at least."""
    if isinstance(value, tuple):
        return tuple(factor * each for each in value)
    rounded = math.ceil if factor > 1 else math.floor
    return rounded(factor * value) if isinstance(value, int) else factor * value


@cache
def corpus() -> list[Press]:
    """Return presses of both simulators: keys, strings held at once, scales, delays, drop-outs."""
    stiff, bends, heaves = (
        ONE_FACTOR[name] for name in ("all stiff", "key bends at 350 Hz", "key heaves at 120 Hz")
    )
    together = [
        with_strings(base, {}, second(base, later, overlap=0.2e-3))
        for base, later in ((heaves, -1e-3), (stiff, 1e-3), (bends, -2e-3))
    ]
    alone = [stiff, bends, *(ONE_FACTOR[name] for name in ("hum", "damper", "speckle 1 %"))]
    unexpected = [
        UNEXPECTED[name][0](stiff)
        for name in ("force twice", "three times the force", "velocity half")
    ]
    late = of_channel(stiff, "force", delay_error=0.4e-3)
    presses = [judged_press(independent(each, 7)) for each in (*alone, *together)]
    for base, seed in ((stiff, 0), (bends, 2)):  # two strings on a rig of one
        more = independent(with_strings(base, {}, second(base, 20e-3)), seed)
        own = {k: v for k, v in more.rig_values.items() if not k.startswith("more_choirs")}
        presses.append(judged_press(replace(more, rig_values=own)))
    half = UNEXPECTED["half a press"][0](bends)
    for each in (*unexpected, late, half, replace(bends, speed=0.2), replace(stiff, rate=5e3)):
        pressed = judged_press(independent(each, 0))
        presses.append(replace(pressed, motion=Event(0.0, "motion", "an edge")))
    presses += [simulated_press(*random_case(seed), seed)[0] for seed in range(400, 430)]
    return presses


def answer(phases: Phases) -> tuple[list[float], tuple[object, ...]]:
    """Return the numbers of phases, and what is said."""
    ends = [phases.start, phases.bottom, phases.bottomed or 0.0, phases.peak_force or 0.0]
    names = ("contact", "release", "contact_std", "release_std", "force_drop", "force_drop_std")
    plucks = [getattr(held, name) or 0.0 for held in phases.plucks for name in names]
    plucks += [held.string_probability or 0.0 for held in phases.plucks]
    return ends + plucks, (phases.warnings, phases.remarks)


@cache
def unchanged() -> list[tuple[list[float], tuple[object, ...]]]:
    return [answer(find_phases(press)) for press in corpus()]


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("name", NAMES)
def test_a_setting_changes_what_is_found(name):
    pytest.importorskip("numba")
    for factor in (1.5, 1 / 1.5):
        settings = replace(SETTINGS, **{name: scaled(getattr(SETTINGS, name), factor)})
        for press, (numbers, said) in zip(corpus(), unchanged(), strict=True):
            again, also_said = answer(find_phases(press, settings))
            if also_said != said or len(again) != len(numbers):
                return
            if not np.allclose(again, numbers, rtol=1e-3, atol=1e-9):
                return
    pytest.fail(f"{name} changes nothing: it is no setting")


def test_settings_are_few():
    assert len(NAMES) <= 50

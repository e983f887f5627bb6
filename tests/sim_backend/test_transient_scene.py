"""The scene `transient`: its oscillations have the frequencies of its parts, and are attributed."""

import numpy as np
import pytest

from benchmarks.simulated import simulated_press
from sautereau.analysis.phases import find_phases
from sautereau.analysis.transient.attribute import Source, attribute
from sautereau.analysis.transient.evidence import combine, examine
from sautereau.sim_backend.scene import load_scene
from tests.sim_backend.scenes import RIG


@pytest.mark.slow
def test_its_oscillations_are_attributed_to_their_parts():
    scene = load_scene("transient")
    presses = [simulated_press(RIG, scene, seed)[0] for seed in range(3)]
    examined = [examine(press, find_phases(press), i) for i, press in enumerate(presses)]
    found = attribute(combine(examined), presses[0].rig)
    decided = [(each.oscillation.frequency, each.source) for each in found if each.source]

    def of(source):
        return [frequency for frequency, its in decided if its is source]

    # The finger holds the front, so that only the back with its jack moves, on a string that is
    # held or free.
    inertia, bending = RIG.key.inertia, scene.bending
    spring = (2 * np.pi * bending.frequency) ** 2 * inertia / 4
    back = inertia / 2 + RIG.jack.mass * RIG.key.jack_arm**2
    alone = np.sqrt(spring / back) / (2 * np.pi)
    assert any(f == pytest.approx(alone, rel=0.06) for f in of(Source.KEY))
    assert any(f == pytest.approx(417, rel=0.02) for f in of(Source.STRING))
    assert any(f == pytest.approx(2500, rel=0.01) for f in of(Source.TRANSDUCER))
    rate = 1 / RIG.controller.sample_period
    assert any(f == pytest.approx(rate, rel=0.01) for f in of(Source.FINGER))

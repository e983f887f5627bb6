"""Values beside a drop-out: those of the sensor without it."""

import numpy as np
import pytest

from sautereau.analysis.loading.press import lost_samples, without_delay
from sautereau.daq.signals.calibration import restored
from sautereau.daq.signals.quality_flags import QualityFlag

RATE = 10e3


@pytest.mark.parametrize("delay", [0.0, 0.3e-3, 0.345e-3])
@pytest.mark.parametrize("early", [0, 2])
def test_a_drop_out_in_a_ramp_changes_only_the_values_beside_it(paper, delay, early):
    channel = paper.daq.channel("velocity").model_copy(update={"delay": delay})
    time = np.arange(2000) / RATE
    noise = np.random.default_rng(1).normal(0, 1e-3, 2000)
    noise[799:807] = 0.0
    true = 20 * np.maximum(time - 0.02, 0) + noise
    volts = true.copy()
    volts[800:806] = -1.0
    start, stop = ((sample - 50) / RATE - channel.lag for sample in (800, 806))
    flags = [
        QualityFlag("drop-out", channel.name, start, stop),
        QualityFlag("clipped", channel.name, 0.1, 0.2),
    ]
    lost = lost_samples(flags, channel, RATE, -50, len(volts))
    assert np.flatnonzero(lost).tolist() == list(range(800, 806))
    found = without_delay(volts, lost, channel, RATE, early)
    lag = channel.lag * RATE + early
    expected = restored(true, channel, RATE, early)
    recorded = restored(volts, channel, RATE, early)
    beside = slice(800 - int(np.ceil(lag)), 806 - int(lag))
    apart = np.ones(len(found), bool)
    apart[beside] = False
    # The line through both sides of the drop-out is the ramp.
    np.testing.assert_allclose(found[apart], expected[apart], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found[beside], recorded[beside])


def test_a_recording_that_is_one_drop_out_stays_as_it_was_recorded(paper):
    channel = paper.daq.channel("velocity")
    volts = np.random.default_rng(2).normal(size=500)
    recorded = restored(volts, channel, RATE)
    found = without_delay(volts, np.ones(500, bool), channel, RATE, 0)
    np.testing.assert_array_equal(found, recorded)

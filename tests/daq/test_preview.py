"""Previews do not depend on how the signal was cut into blocks, and hold no aliases."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader

from sautereau.daq.file.log_order import ATTENUATION, PASS_BAND, Decimator, low_pass
from sautereau.daq.file.schemas import FRAME
from sautereau.daq.file.survey import LAYOUT, describe
from tests.daq.declared import declared_class

HALF = 326  # Samples, half the filter at 51.2 kHz


@given(st.lists(st.integers(0, 700), max_size=12))
def test_the_filter_is_carried_across_blocks(lengths):
    values = np.arange(float(sum(lengths)))
    preview = Decimator(51_200.0, 1)
    assert (preview.factor, preview.margin) == (52, HALF)
    found = [preview.feed(part[None]) for part in np.split(values, np.cumsum(lengths))[:-1]]
    places = np.concatenate([np.empty(0), *(place for place, _ in found)])
    filtered = np.concatenate([np.empty(0), *(value[0] for _, value in found)])
    assert len(places) == max(0, (len(values) - 2 * HALF - 1) // 52 + 1)
    # A ramp is left as it is, in single precision, and not delayed.
    np.testing.assert_allclose(places, HALF + 52 * np.arange(len(places)))
    np.testing.assert_allclose(filtered, places, rtol=1e-6)


@pytest.mark.parametrize(("rate", "factor"), [(1000.0, 1), (1000.1, 2), (1e6, 1000)])
def test_a_preview_is_never_faster_than_1_khz(rate, factor):
    assert Decimator(rate, 2).factor == factor


@pytest.mark.parametrize(("frequency", "gain"), [(50.0, 1.0), (190.0, 1.0), (984.6, 0.0)])
def test_a_tone_is_passed_or_gone(frequency, gain):
    """984.6 Hz is the preview's rate: a mean of groups would let it through as an offset."""
    time = np.arange(51_200) / 51_200
    places, values = Decimator(51_200.0, 1).feed(np.sin(2 * np.pi * frequency * time)[None])
    assert len(places) == 973
    expected = gain * np.sin(2 * np.pi * frequency * places / 51_200)
    np.testing.assert_allclose(values[0], expected, atol=2e-3)


def test_infinities_of_both_signs_are_no_fault():
    values = np.zeros((2, 2000))
    values[0, 100:103] = np.inf, -np.inf, np.nan
    _, found = Decimator(51_200.0, 2).feed(values)
    assert np.isnan(found[0, :3]).any()
    assert (found[1] == 0).all()


def test_the_layout_shows_what_there_is(tmp_path, record, volts):
    """Every path of the layout for Foxglove is a topic of the recording, and a field of it."""
    path = record(tmp_path / "press.mcap", volts)
    assert describe(path)["layout"] == str(LAYOUT)
    layout = json.loads(LAYOUT.read_text())
    panels = layout["configById"]
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    schemas = {c.topic: summary.schemas[c.schema_id] for c in summary.channels.values()}
    paths = [path["value"] for panel in panels.values() for path in panel.get("paths", [])]
    assert len(paths) == 6
    for topic, _, field in (path.partition(".") for path in paths):
        message = declared_class(schemas[topic].data, schemas[topic].name)
        assert field in message.DESCRIPTOR.fields_by_name
    assert schemas[panels["RosOut!events"]["topicToRender"]].name == "foxglove.Log"
    assert [schemas[topic].name for topic in panels["3D!scene"]["topics"]] == [
        "foxglove.SceneUpdate"
    ]
    assert panels["3D!scene"]["followTf"] == FRAME
    assert set(_leaves(layout["layout"])) == set(panels)


def _leaves(place):
    if isinstance(place, str):
        return [place]
    return _leaves(place["first"]) + _leaves(place["second"])


@pytest.mark.parametrize("factor", [2, 3, 52, 1000])
def test_the_filter_is_what_it_says(factor):
    """On its frequency response, at frequencies as fractions of the preview's rate."""
    weights = low_pass(factor)
    n = 16 * 2 ** int(np.ceil(np.log2(len(weights))))
    response, frequency = np.abs(np.fft.rfft(weights, n)), np.fft.rfftfreq(n) * factor
    assert 20 * np.log10(response[frequency >= 0.5].max()) < -ATTENUATION
    assert np.abs(response[frequency <= PASS_BAND] - 1).max() < 2e-3

"""The WAV file: read back by scipy, its pitch, its decay, its level."""

import math

import numpy as np
import pytest
from scipy.io import wavfile

from sautereau.analysis.errors import AnalysisError, ModelError
from sautereau.analysis.press.sound import LEVEL, SAMPLE_RATE, sound_of, write_sound
from sautereau.rig.load import load_rig
from sautereau.sim_backend.scene import load_scene

RIG = load_rig()


def spectrum(signal):
    """Return the lines' frequencies [Hz] and sizes of a windowed signal."""
    window = np.hanning(len(signal))
    return np.fft.rfftfreq(len(signal), 1 / SAMPLE_RATE), np.abs(np.fft.rfft(signal * window))


@pytest.fixture(scope="module")
def sound():
    return sound_of(RIG, duration=2.0)


def test_the_file_contains_the_force_at_the_stated_level(tmp_path, sound):
    path = tmp_path / "new" / "pluck.wav"
    write_sound(path, sound)
    rate, samples = wavfile.read(path)
    assert (rate, samples.dtype, samples.shape) == (48_000, np.int16, (96_000,))
    assert 20 * math.log10(np.abs(samples).max() / 32767) == pytest.approx(LEVEL, abs=1e-3)
    np.testing.assert_allclose(
        samples / 32767 * sound.full_scale, sound.force, atol=sound.full_scale / 60_000
    )


def test_it_is_silent_until_contact_and_loudest_after_release(sound):
    (release,) = sound.releases
    time = np.arange(len(sound.force)) / SAMPLE_RATE
    assert not sound.force[time < 0.02].any()
    assert release == pytest.approx(0.040, abs=1e-4)
    assert time[np.argmax(np.abs(sound.force))] >= release - 1e-3
    assert sound.duration == 2.0


def test_its_pitch_is_the_strings(sound):
    after = sound.force[round(0.1 * SAMPLE_RATE) :]
    frequency, size = spectrum(after)
    for n in (1, 2, 3, 7):
        near = np.abs(frequency - 365 * n) < 100
        found = frequency[near][np.argmax(size[near])]
        assert found == pytest.approx(365 * n, abs=0.6)  # of the lines' distance
    # A string has no partial between its own.
    assert size[np.abs(frequency - 550) < 50].max() < 1e-3 * size.max()


def test_dampers_end_it():
    ended = sound_of(RIG, duration=0.9, held=0.2)
    assert np.abs(ended.force[-480:]).max() < 1e-6 * ended.full_scale


def test_all_choirs_are_heard():
    rig = load_scene("two-choirs").true_rig(RIG)
    both = sound_of(rig, duration=0.3)
    assert len(both.releases) == len(both.modes) == 2
    first, second = both.releases
    alone = sound_of(RIG, duration=0.3)
    before = slice(0, round((first + (second - first) / 4) * SAMPLE_RATE))
    np.testing.assert_allclose(both.force[before], alone.force[before], atol=1e-9)
    assert np.abs(both.force - alone.force).max() > 0.1


@pytest.mark.parametrize("duration", [0.0, -1.0, 61.0, math.nan])
def test_a_duration_out_of_range_is_refused(duration):
    with pytest.raises(AnalysisError, match=r"duration: .* between 0 and 60 s"):
        sound_of(RIG, duration=duration)


def test_a_sound_that_ends_before_the_release_is_refused():
    with pytest.raises(AnalysisError, match="ends before the last release"):
        sound_of(RIG, duration=0.03)


def test_held_before_the_release_is_refused():
    with pytest.raises(ModelError, match="before the release"):
        sound_of(RIG, duration=1.0, held=-0.1)


def test_another_kind_of_file_is_refused(tmp_path, sound):
    with pytest.raises(AnalysisError, match=r"extension \.wav"):
        write_sound(tmp_path / "pluck.mp3", sound)
    assert not list(tmp_path.iterdir())


def test_a_string_higher_than_hearing_is_refused():
    with pytest.raises(ModelError):
        sound_of(RIG.replaced({"string.frequency": 25e3}), duration=0.2)


def test_the_partials_of_a_stiff_wire_are_stretched():
    b = 6e-5
    string = RIG.string.model_copy(update={"inharmonicity": b})
    heard = sound_of(RIG.model_copy(update={"string": string}), duration=1.2)
    frequency, size = spectrum(heard.force[round(0.1 * SAMPLE_RATE) :])
    for n in (1, 7, 15):
        near = np.abs(frequency - 365 * n) < 150
        found = frequency[near][np.argmax(size[near])]
        assert found == pytest.approx(365 * n * math.sqrt(1 + b * n**2), abs=0.6)

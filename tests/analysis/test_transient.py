"""Sources of oscillations against presses whose truth is known."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import lfilter
from scipy.stats import norm

from benchmarks.independent import ONE_FACTOR, press
from benchmarks.simulated import judged_press, simulated_press
from benchmarks.transient import true_phases
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.phases import Phases, find_phases
from sautereau.analysis.results.transient import Transient
from sautereau.analysis.transient.attribute import (
    MODELS,
    Source,
    attribute,
    free_frequencies,
    held_frequencies,
)
from sautereau.analysis.transient.evidence import combine, examine
from sautereau.commands.fit import transient
from sautereau.commands.output import FileOutput
from sautereau.rig.errors import UsageError
from sautereau.rig.load import load_rig
from sautereau.sim_backend.scene import load_scene

HELD = (417.1, 809.6, 1141.2)
"""Hz, the lowest partials of the string of `rig/paper.toml` on its plectrum."""


@pytest.fixture(scope="module")
def pressed():
    """Presses of the independent simulator by their factor: recording, truth and phases."""
    names = ("all stiff", "quasi-static string", "key bends at 350 Hz")
    rates = {"quasi-static string": 20e3}  # without a string's partials a low rate is enough
    made = {
        name: press(replace(ONE_FACTOR[name], rate=rates.get(name, 51.2e3)), seed=1)
        for name in names
    }
    loaded = {name: judged_press(each) for name, each in made.items()}
    return {n: (loaded[n], made[n], true_phases(made[n], loaded[n])) for n in names}


@pytest.fixture(scope="module")
def examined(pressed):
    """What a press shows, by its factor; each examined once."""

    @cache
    def of_press(name):
        loaded, _, phases = pressed[name]
        return examine(loaded, phases)

    return of_press


@pytest.fixture
def found_in(pressed, examined):
    def found(name):
        loaded, made, _ = pressed[name]
        return attribute(combine([examined(name)]), loaded.rig), made

    return found


def of(source, found):
    return [each.oscillation for each in found if each.source is source]


def test_the_string_is_found_while_it_is_held(found_in):
    found, _ = found_in("all stiff")
    partials = of(Source.STRING, found)
    assert len(partials) >= 2
    for partial, expected in zip(partials, HELD, strict=False):
        assert partial.frequency == pytest.approx(expected, rel=0.02)
        assert {o.phase for o in partial.observed} == {"held"}


def test_a_string_without_inertia_has_no_mode(found_in):
    found, _ = found_in("quasi-static string")
    assert of(Source.STRING, found) == []
    assert len(of(Source.FINGER, found)) == 1


def test_a_bending_key_is_attributed(found_in):
    found, _ = found_in("key bends at 350 Hz")
    key = of(Source.KEY, found)
    assert any(o.frequency == pytest.approx(762, rel=0.02) for o in key)


def test_a_measured_mode_decides(pressed, examined):
    loaded, _, _ = pressed["key bends at 350 Hz"]
    oscillations = combine([examined("key bends at 350 Hz")])
    low = min(oscillations, key=lambda o: o.frequency)
    (alone,), (known,) = (
        attribute([low], loaded.rig, {Source.KEY: modes} if modes else None)
        for modes in ([], [low.frequency])
    )
    assert alone.source is None
    assert known.source is Source.KEY


@pytest.mark.parametrize(
    ("frequency", "channel", "size", "source"),
    [
        (150.0, "force", 20e-3, Source.MAINS),
        (350.0, "force", 20e-3, Source.STEADY),
        (520.0, "force", 30e-3, Source.STEADY),
        (310.0, "velocity", 1e-3, Source.STEADY),
    ],
)
def test_a_tone_that_the_rest_has_too_is_found(pressed, frequency, channel, size, source):
    """It is part of the spectrum of the rest, but no noise."""
    loaded, _, phases = pressed["quasi-static string"]
    wave = size * np.sin(2 * np.pi * frequency * loaded.time + 1)
    samples = {**loaded.samples, channel: loaded.samples[channel] + wave}
    found = attribute(combine([examine(replace(loaded, samples=samples), phases)]), loaded.rig)
    (tone,) = of(source, found)
    assert tone.frequency == pytest.approx(frequency, rel=3e-3)
    assert tone.seen["rest"] == 1
    of_channel = [
        abs(o.mode.amplitude[("force", "velocity").index(channel)]) for o in tone.observed
    ]
    assert np.median(of_channel) == pytest.approx(size, rel=0.1)
    others = [each for each in found if each.oscillation is not tone]
    assert all(abs(o.oscillation.frequency / frequency - 1) > 0.03 for o in others)


def test_coloured_noise_is_no_oscillation(pressed):
    """The rest shows its band, wider than a line."""
    loaded, _, phases = pressed["quasi-static string"]
    pole = np.exp((-0.3 + 1j) * 2 * np.pi * 300 / loaded.rate)
    noise = np.random.default_rng(4).standard_normal(len(loaded.time))
    noise = lfilter([1], [1, -2 * pole.real, abs(pole) ** 2], noise)
    samples = {**loaded.samples, "force": loaded.samples["force"] + 0.01 * noise / noise.std()}
    found = combine([examine(replace(loaded, samples=samples), phases)])
    without = combine([examine(loaded, phases)])
    assert len(found) <= len(without)


def test_presses_are_combined(examined):
    first = examined("all stiff")
    second = replace(first, observed=tuple(replace(each, press=1) for each in first.observed))
    once, twice = combine([first]), combine([first, second])
    assert [o.frequency for o in once] == pytest.approx([o.frequency for o in twice])
    for one, both in zip(once, twice, strict=True):
        assert both.presses == 2
        assert both.frequency_std < one.frequency_std


def test_the_stand_ins_string_is_found():
    rig, scene = load_rig(), load_scene("paper").model_copy(update={"string": "modal"})
    made, _ = simulated_press(rig, scene, 3)
    found = attribute(combine([examine(made, find_phases(made))]), rig)
    partials = of(Source.STRING, found)
    assert any(o.frequency == pytest.approx(HELD[0], rel=0.03) for o in partials)


def test_known_modes_are_checked_together():
    with pytest.raises(UsageError) as raised:
        transient([], known=["key=3 m", "string=300 Hz", "finger=-2 Hz", "key=350 Hz"])
    text = str(raised.value)
    assert all(name in text for name in ("key=3 m", "string=300 Hz", "finger=-2 Hz"))
    assert "key=350" not in text


def test_a_negative_damping_is_explained(pressed, examined):
    """Noise makes the estimate of a weak damping negative; the JSON keeps the estimate."""
    loaded, _, _ = pressed["all stiff"]
    one = examined("all stiff")
    found = attribute(combine([one]), loaded.rig)[0]
    for damping, cell in {-0.004: "< 0.6", -0.02: "grows", 0.004: "0.4 +- 0.3"}.items():
        wave = replace(found.oscillation, damping=damping, damping_std=0.003)
        shown = replace(found, oscillation=wave)
        result = Transient((one,), (shown,))
        text = str(result)
        assert f"  {cell}  " in text
        assert ("not damped measurably (estimate -0.4 +- 0.3 %)" in text) == (damping == -0.004)
        assert ("it grows (damping -2.0 +- 0.3 %)" in text) == (damping == -0.02)
        (answer,) = result.document["oscillations"]
        assert answer["damping"] == damping


def test_passive_parts_do_not_grow(pressed, examined):
    """The probabilities follow the damping as the integral over all true dampings above 0."""
    rig, (wave, *_) = pressed["all stiff"][0].rig, combine([examined("all stiff")])
    string, noise = norm(scale=MODELS[Source.STRING].damping_std), 0.003

    def expected(damping, prior):
        return quad(lambda true: prior(true) * norm.pdf(damping, true, noise), 0, 0.1)[0]

    odds = {}
    for damping in (-0.004, 0.004, 0.02):
        (each,) = attribute([replace(wave, damping=damping, damping_std=noise)], rig)
        p = each.probability
        odds[damping] = [p[source] / p[Source.OTHER] for source in (Source.STRING, Source.KEY)]
    for damping in (-0.004, 0.004):
        for n, prior in enumerate((string.pdf, lambda _: 1.0)):
            assert odds[damping][n] / odds[0.02][n] == pytest.approx(
                expected(damping, prior) / expected(0.02, prior), rel=1e-6
            )
    (grows,) = attribute([replace(wave, damping=-0.02, damping_std=noise)], rig)
    assert grows.source is None
    assert grows.probability[Source.OTHER] > 0.99


def test_a_recording_is_examined(write_session, tmp_path, capsys):
    files = write_session(tmp_path, 1)
    assert transient(files, plot=tmp_path / "transient.png", output=FileOutput(json=True)) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["schema"] == 1
    assert [press["path"] for press in answer["presses"]] == [str(path) for path in files]
    assert (tmp_path / "transient.png").stat().st_size > 10_000


def test_a_key_that_does_not_move_is_refused(make_press):
    with pytest.raises(AnalysisError, match="does not move down"):
        examine(make_press(), Phases(0.0, 0.0, (), 0.0, None, None, ()))


def test_held_partials_lie_between_those_of_a_free_and_a_stopped_string(paper):
    def with_modulus(factor):
        modulus = paper.plectrum.youngs_modulus * factor
        plectrum = paper.plectrum.model_copy(update={"youngs_modulus": modulus})
        return held_frequencies(paper.model_copy(update={"plectrum": plectrum}), 3000.0)

    free = free_frequencies(paper, 3000.0)
    np.testing.assert_allclose(with_modulus(1e-9), free[free < 2950], rtol=1e-6)
    speed = 2 * paper.string.length * paper.string.frequency
    parts = (paper.string.plucking_point, paper.string.length - paper.string.plucking_point)
    stopped = sorted(speed / (2 * part) * k for part in parts for k in (1, 2, 3, 4, 5))
    np.testing.assert_allclose(with_modulus(1e6)[:4], stopped[:4], rtol=1e-3)
    np.testing.assert_allclose(with_modulus(1.0)[:3], HELD, rtol=1e-3)

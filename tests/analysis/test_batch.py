"""Many predictions at once, against the single prediction."""

import numpy as np
import pytest

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.batch import DERIVED, VARIABLES, Status, predict_many
from sautereau.analysis.model.predict import predict
from sautereau.rig.instrument import Choir
from tests.budget import slow

SCALARS = (
    "pluck_duration",
    "plectrum_force",
    "release_lift",
    "release_angle",
    "peak_force",
    "v_osc",
)


def changed(rig, values):
    """Return the rig with SI values by their dotted names, unchecked."""
    sections = {}
    for name, value in values.items():
        section, field = name.split(".")
        sections.setdefault(section, {})[field] = float(value)
    update = {s: getattr(rig, s).model_copy(update=fields) for s, fields in sections.items()}
    return rig.model_copy(update=update)


def one_by_one(rig, values, index):
    """Return the status and the prediction of one case, by `predict`."""
    case = {n: np.asarray(v).flat[index if np.ndim(v) else 0] for n, v in values.items()}
    try:
        found = predict(changed(rig, case))
    except ModelError as error:
        for words, status in (
            ("still held", Status.STILL_HELD),
            ("jumps", Status.JUMPS),
            ("jack_rise", Status.PRESS_TOO_SHORT),
            ("would be lifted", Status.STRING_OUT_OF_RANGE),
        ):
            if words in str(error):
                return status, None
        raise
    return (Status.RELEASED_AT_FOLD if found.choirs[0].released_at_fold else Status.RELEASED), found


@pytest.mark.parametrize("friction", [0.0, slow(0.1), 0.5])
def test_each_case_is_the_single_prediction(paper, friction):
    """Of every value that can be varied, about the paper's."""
    random, n = np.random.default_rng(1), 60
    values = {}
    for name in VARIABLES:
        section, field = name.split(".")
        values[name] = getattr(getattr(paper, section), field) * random.uniform(0.8, 1.25, n)
    values["press.jack_speed"] = 10 ** random.uniform(np.log10(0.005), 0, n)
    values["plectrum.friction"] = friction
    found = predict_many(paper, values)
    assert set(found.status) == {Status.RELEASED}
    for i in range(n):
        _, expected = one_by_one(paper, values, i)
        for name in SCALARS:
            # The single prediction takes the finger's peak at its instants.
            rel = 1e-5 if name == "peak_force" else 1e-9
            assert getattr(found, name)[i] == pytest.approx(getattr(expected, name), rel=rel)


@pytest.mark.parametrize("friction", [*(slow(mu) for mu in (0.0, 0.5)), 0.05])
def test_extremes_end_as_the_single_prediction_does(paper, friction):
    random, n = np.random.default_rng(2), 80
    values = {
        "plectrum.friction": friction,
        "plectrum.youngs_modulus": 10 ** random.uniform(6, 12, n),
        "plectrum.thickness": 10 ** random.uniform(np.log10(0.05e-3), -3, n),
        "plectrum.overlap": np.where(
            np.arange(n) % 2,
            10 ** random.uniform(-6, np.log10(4.4995e-3), n),
            random.uniform(1e-6, 4.4995e-3, n),
        ),
        "string.tension": 10 ** random.uniform(0, 3.5, n),
        "press.jack_rise": 15e-3,
    }
    found = predict_many(paper, values)
    assert len(np.unique(found.status)) >= 3
    for i in range(n):
        status, expected = one_by_one(paper, values, i)
        assert found.status[i] == status
        for name in SCALARS:
            value = getattr(found, name)[i]
            if expected is None:
                assert np.isnan(value)
            elif name != "peak_force":
                # The angle at a fold is where a maximum lies, known to half of the digits.
                assert value == pytest.approx(getattr(expected, name), rel=1e-6)
            else:
                assert value == pytest.approx(expected.peak_force, rel=1e-4)


def test_values_broadcast(paper):
    overlap, speed = np.linspace(0.1e-3, 0.6e-3, 4), np.array([[0.01], [0.072], [1.0]])
    found = predict_many(paper, {"plectrum.overlap": overlap, "press.jack_speed": speed})
    for name in (*SCALARS, "status"):
        assert getattr(found, name).shape == (3, 4)
    np.testing.assert_array_equal(found.plectrum_force[0], found.plectrum_force[2])
    duration = found.pluck_duration * speed
    np.testing.assert_allclose(duration[0], duration[2], rtol=1e-12)
    assert predict_many(paper, {}).plectrum_force.shape == ()


def test_derived_values_stand_for_what_they_follow_from(paper):
    bending, stiffness = paper.plectrum.bending_stiffness, paper.string.static_stiffness
    found = predict_many(paper, dict(zip(DERIVED, (bending, stiffness), strict=True)))
    assert found.plectrum_force == predict_many(paper, {}).plectrum_force


@pytest.mark.parametrize(
    ("name", "bad", "status"),
    [
        ("plectrum.overlap", 5e-3, Status.OVERLAP_OUT_OF_RANGE),
        ("plectrum.overlap", 0.0, Status.OVERLAP_OUT_OF_RANGE),
        ("plectrum.overlap", np.nan, Status.OVERLAP_OUT_OF_RANGE),
        ("plectrum.youngs_modulus", -1.0, Status.PLECTRUM_OUT_OF_RANGE),
        ("plectrum.length", np.inf, Status.PLECTRUM_OUT_OF_RANGE),
        ("string.tension", 0.0, Status.STRING_OUT_OF_RANGE),
        ("string.plucking_point", 0.46, Status.STRING_OUT_OF_RANGE),
        ("press.jack_speed", 0.0, Status.PRESS_OUT_OF_RANGE),
        ("press.jack_rise", 3e-3, Status.PRESS_TOO_SHORT),
        ("press.jack_rise", np.nan, Status.PRESS_TOO_SHORT),
        ("key.press_arm", 0.0, Status.KEY_OUT_OF_RANGE),
        ("jack.register_friction", np.nan, Status.KEY_OUT_OF_RANGE),
    ],
)
def test_a_case_out_of_range_leaves_the_others_alone(paper, name, bad, status):
    section, field = name.split(".")
    good = getattr(getattr(paper, section), field)
    found = predict_many(paper, {name: np.array([good, bad, good])})
    np.testing.assert_array_equal(found.status, [Status.RELEASED, status, Status.RELEASED])
    single = predict(paper)
    for scalar in SCALARS:
        array = getattr(found, scalar)
        assert np.isnan(array[1])
        assert array[0] == array[2] == pytest.approx(getattr(single, scalar), rel=1e-9)


def test_what_is_wrong_with_the_call_is_said_at_once(paper):
    two = paper.model_copy(
        update={
            "more_choirs": (
                Choir.model_construct(
                    jack_arm=0.2, jack=paper.jack, plectrum=paper.plectrum, string=paper.string
                ),
            )
        }
    )
    with pytest.raises(ModelError) as error:
        predict_many(two, {"plectrum.colour": 1.0, "plectrum.friction": [0.1, 0.2]})
    for words in ("plectrum.colour cannot be varied", "one number within 0 to 0.5", "more_choirs"):
        assert words in str(error.value)
    with pytest.raises(ModelError, match="shapes do not fit together"):
        predict_many(paper, {"plectrum.overlap": np.ones(3), "press.jack_speed": np.ones(4)})

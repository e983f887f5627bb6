"""Parameters: names, bounds, priors, and writing them into a rig file."""

import pytest

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.parameters import (
    NAMES,
    Prior,
    parameters,
    read_prior,
    rig_values,
    value_of,
    with_parameters,
)
from sautereau.analysis.model.choirs import choirs
from sautereau.rig.instrument import Outline
from sautereau.rig.load import parse_rig, with_values
from sautereau.rig.text import rig_text


def test_bounds_are_the_assumed_ranges_else_a_decade_either_way(paper):
    inertia, modulus, friction = parameters(
        paper, ["key.inertia", "plectrum.youngs_modulus", "plectrum.friction"]
    )
    assert (inertia.low, inertia.high) == pytest.approx((5e-4, 10e-4))
    assert (modulus.low, modulus.high) == pytest.approx((1.8e9, 3.8e9))
    assert (friction.low, friction.high, friction.start) == (0, 0.5, 0)
    assert modulus.unit == "Pa"


@pytest.mark.parametrize("name", [name for name in NAMES if name != "offset.force"])
def test_every_name_can_be_fitted(paper, name):
    (parameter,) = parameters(paper, [name])
    assert parameter.low <= parameter.start <= parameter.high
    assert parameter.low < parameter.high


def test_priors_set_bounds_or_an_expectation(paper):
    name, bounds = read_prior("plectrum.overlap = 0.1 mm to 0.5 mm")
    assert (name, bounds.low, bounds.high) == ("plectrum.overlap", 1e-4, 5e-4)
    name, spread = read_prior("key.inertia=7e-4 kg m^2 +- 1e-4 kg m^2")
    assert (spread.mean, spread.std) == pytest.approx((7e-4, 1e-4))
    _, plain = read_prior("plectrum.friction=0.0 to 0.2")
    assert (plain.low, plain.high) == (0, 0.2)
    (fitted,) = parameters(paper, ["key.inertia"], {"key.inertia": Prior(mean=12e-4, std=1e-4)})
    assert fitted.start == pytest.approx(12e-4)
    assert fitted.high == pytest.approx(12e-4)


def test_a_friction_below_0_is_refused_as_given(paper):
    name, prior = read_prior("plectrum.friction=-0.1 to 0.5")
    with pytest.raises(AnalysisError, match=r"plectrum\.friction: -0\.1 is not within 0 to 0\.5"):
        parameters(paper, [name], {name: prior})


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("key.inertia", "a range or a standard uncertainty"),
        ("key.inertia=5", "a range or a standard uncertainty"),
        ("key.inertai=1 mm to 2 mm", "did you mean 'key.inertia'"),
        ("key.inertia=1 mm to 2 mm", "dimension"),
        ("", "a range or a standard uncertainty"),
    ],
)
def test_an_invalid_prior_is_refused_with_an_example(text, words):
    with pytest.raises(AnalysisError, match=words):
        read_prior(text)


def test_all_faults_are_reported_together(paper):
    with pytest.raises(AnalysisError) as caught:
        parameters(
            paper,
            ["plectrum.overlp", "key.inertia", "key.inertia", "mass"],
            {"jack.mass": Prior(low=1e-3), "key.inertia": Prior(low=2.0, high=1.0)},
        )
    text = str(caught.value)
    for words in (
        "plectrum.overlp: no parameter has this name; did you mean 'plectrum.overlap'?",
        "did you mean 'jack.mass'?",
        "key.inertia: given twice",
        "prior of jack.mass: it is not fitted",
        "2 to 1 kg*m**2 is an empty range",
    ):
        assert words in text


def test_modulus_and_stiffness_together_are_refused(paper):
    with pytest.raises(AnalysisError, match="one determines the other"):
        parameters(paper, ["plectrum.youngs_modulus", "plectrum.bending_stiffness"])


@pytest.mark.parametrize("names", [[], ["offset.force"]])
def test_nothing_free_is_refused(paper, names):
    with pytest.raises(AnalysisError, match="no parameter is free; name at least one of"):
        parameters(paper, names)


def test_a_value_of_zero_without_a_range_needs_one(paper):
    bare = with_parameters(paper, {"key.pivot_viscous_friction": 0.0}).model_copy(
        update={"assumed": {}}
    )
    with pytest.raises(AnalysisError, match="a prior with a range if the value of the rig is 0"):
        parameters(bare, ["key.pivot_viscous_friction"])


def test_values_go_into_the_rig_and_back_into_a_file(paper):
    values = {"plectrum.bending_stiffness": 1.5e-5, "key.inertia": 8e-4, "plectrum.friction": 0.1}
    changed = with_parameters(paper, values)
    for name, value in values.items():
        assert value_of(changed, name) == pytest.approx(value, rel=1e-12)
    written = with_values(paper, rig_values(paper, values))
    for name, value in values.items():
        assert value_of(written, name) == pytest.approx(value, rel=1e-12)


def test_a_rig_written_as_text_is_the_same_rig(paper):
    """With its sources, choirs, tongue and outline."""
    again = parse_rig(rig_text(paper))
    assert again == paper
    assert again.assumed == paper.assumed
    assert again.sources == paper.sources
    outline = Outline.model_construct(
        x=(0.0, 4.5e-3), top=(0.24e-3, 0.1e-3), bottom=(-0.24e-3, -0.1e-3)
    )
    carved = paper.plectrum.model_copy(update={"outline": outline})
    rig = paper.model_copy(update={"plectrum": carved, "more_choirs": choirs(paper)})
    text = rig_text(rig)
    assert "[jack.tongue]" in text
    again = parse_rig(text)
    assert again.more_choirs == rig.more_choirs
    assert again.plectrum.outline == outline
    assert again.jack.tongue == paper.jack.tongue

"""The packaged rig holds the numbers of the paper."""

import pytest

from sautereau.rig.disk import packaged_names
from sautereau.rig.load import load_rig
from sautereau.rig.units import GRAVITY


def test_stiffness_and_mass_of_string_and_plectrum(paper):
    assert paper.string.plucking_point / paper.string.length == pytest.approx(0.2348, abs=5e-5)
    assert paper.string.static_stiffness == pytest.approx(810.0, rel=1e-3)
    assert paper.string.linear_density == pytest.approx(5.937e-4, rel=1e-4)
    assert paper.plectrum.bending_stiffness == pytest.approx(2.0045e-5, rel=1e-4)
    cantilever = 3 * paper.plectrum.bending_stiffness / paper.plectrum.length**3
    assert cantilever == pytest.approx(660.0, rel=1e-3)
    element = paper.string.linear_density * paper.plectrum.width
    assert element == pytest.approx(4.45e-7, rel=1e-3)


def test_the_key_rests_on_its_back_rail(paper):
    weight = paper.jack.mass * GRAVITY * paper.key.jack_arm
    assert weight - paper.key.gravity_moment > paper.key.pivot_coulomb_friction


def test_assumed_ranges_hold_their_values(paper):
    assert len(paper.assumed) > 20
    for key, (low, high) in paper.assumed.items():
        value = paper
        for part in key.split("."):
            value = value[int(part)] if part.isdigit() else getattr(value, part)
        assert low <= value <= high, key
        assert low < high, key
    assert paper.assumed["jack.mass"] == pytest.approx((0.004, 0.012))
    assert paper.assumed["daq.channels.1.delay"] == pytest.approx((10e-6, 225e-6))


def test_sources_are_kept_by_key(paper):
    assert paper.sources["string.tension"].startswith("Table 1")
    assert "confirm it" in paper.sources["daq.channels.0.scale"]


def test_the_paper_is_packaged_and_the_default(paper):
    assert "paper" in packaged_names("sautereau.rig")
    assert load_rig() == paper

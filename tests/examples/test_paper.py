"""The paper's figures and numbers, and what the pages say about them."""

import re

import numpy as np
import pytest

from examples import paper, table_1
from examples.paper_numbers import (
    candidates,
    draw_errors,
    first_mode,
    model_errors,
    string_speed,
)
from examples.session import study
from sautereau.rig.load import load_rig

RIG = load_rig()
EI = RIG.plectrum.bending_stiffness


def written(name: str) -> tuple[str, str]:
    """Return a page as it is, and its day."""
    text = (paper.DOCS / name).read_text(encoding="utf-8")
    (day,) = re.findall(r"^Written by .* on (\d{4}-\d\d-\d\d)", text, re.MULTILINE)
    return text, day


def test_no_one_plectrum_has_duration_vosc_and_vs():
    """Vs by the principle of virtual work: the string's power is that of the jack without the
    plectrum's, so that the string moves by tip / (tip + string) of the jack, if straight."""
    string = RIG.string.static_stiffness
    for name, release in candidates(RIG).items():
        assert release.duration == pytest.approx(20e-3, rel=1e-6)
        tip = 3 * release.bending_stiffness / RIG.plectrum.length**3
        assert string_speed(release) == pytest.approx(0.072 * tip / (tip + string), rel=0.2), name
    read, soft, softer, _ = candidates(RIG).values()
    assert string_speed(read) == pytest.approx(0.03, abs=0.5e-3)
    assert read.v_osc * first_mode(RIG) > 1.5 * 0.46
    for release, v_osc in ((soft, soft.v_osc * first_mode(RIG)), (softer, softer.v_osc)):
        assert v_osc == pytest.approx(0.46, rel=1e-6)
        assert string_speed(release) < 0.7 * 0.03


def test_the_slope_is_that_of_two_springs_in_series():
    """By hand: the tip's stiffness 3 EI / L^3 in series with that of the string."""
    string = RIG.string.static_stiffness
    tip = 3 * EI / RIG.plectrum.length**3
    for name, release in candidates(RIG).items():
        soft = tip * release.bending_stiffness / EI
        expected = (tip / (tip + string)) / (soft / (soft + string)) - 1
        slope = model_errors(RIG, release.rig)[0]
        assert slope == pytest.approx(expected, rel=0.12, abs=0.01), name


def test_a_model_with_little_force_and_long_contact_has_a_low_slope():
    """Of instruments whose levers are known, as the page concludes; and none of them is 37.5 %
    off."""
    errors = draw_errors(RIG, levers=False, surface=False, draws=300)
    assert errors.as_said.any()
    # The growth is the slope times the way, up to the curvature and the last step.
    np.testing.assert_allclose(
        1 + errors.rise, (1 + errors.slope) * (1 + errors.duration), rtol=1e-3
    )
    assert errors.slope[errors.as_said].max() < 1e-3
    assert errors.slope.min() > -0.375


def test_the_page_of_table_1_says_what_the_software_says():
    """Where this fails, run python -m examples.paper FOLDER; so for the next test."""
    text, day = written("table-1.md")
    assert table_1.page(RIG, day) == text


@pytest.mark.slow
def test_the_page_and_the_figures(tmp_path):
    pressed = study()
    text, day = written("paper.md")
    assert paper.page(RIG, pressed, day) == text
    for name, figure in paper.figures(RIG, pressed).items():
        figure.savefig(tmp_path / name)
    assert len(list(tmp_path.iterdir())) == 5

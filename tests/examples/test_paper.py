"""The paper's figures and numbers."""

import pytest

from examples import paper
from examples.session import study
from sautereau.rig.load import load_rig


def test_the_first_modes_reading_explains_the_printed_slope():
    """By hand: the tip's stiffness 3 EI / L^3 in series with that of the string."""
    rig = load_rig()
    string = rig.string.static_stiffness
    tip = 3 * rig.plectrum.bending_stiffness / rig.plectrum.length**3
    for reading in paper.readings(rig):
        soft = tip * reading.release.bending_stiffness / rig.plectrum.bending_stiffness
        expected = (tip / (tip + string)) / (soft / (soft + string)) - 1
        assert reading.slope_error == pytest.approx(expected, rel=0.12)
        assert reading.release.duration == pytest.approx(20e-3, rel=1e-6)


@pytest.mark.slow
def test_the_page_and_the_figures(tmp_path):
    rig, pressed = load_rig(), study(1, scene="ideal")
    text = paper.page(rig, pressed, "2026-01-01")
    assert "| contact (ms) | 27 | 27 |" in text
    assert "60 % that the paper prints" in text
    for name, figure in paper.figures(rig, pressed).items():
        figure.savefig(tmp_path / name)
    assert len(list(tmp_path.iterdir())) == 3

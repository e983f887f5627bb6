"""What the paper's three scalars alone say of the plectrum."""

import numpy as np
import pytest

from examples.paper_scalars import CONTACT, RELEASE, V_OSC, explain, lines, overlap_at
from examples.release_fit import fit_release


@pytest.mark.parametrize(("first_mode", "share"), [(False, 0.24), (True, 0.47)])
def test_stiffness_is_told_and_the_overlap_hangs_on_the_friction(paper, first_mode, share):
    said = explain(paper, first_mode=first_mode, draws=40)
    assert said.unexplained == 0
    stiffness = said.stiffness / paper.plectrum.bending_stiffness
    assert np.median(stiffness) == pytest.approx(share, rel=0.05)
    assert np.ptp(stiffness) < 0.35 * share
    assert said.clearance.mean() == pytest.approx(CONTACT * paper.press.jack_speed, rel=0.02)
    assert np.corrcoef(said.overlap, said.friction)[0, 1] < -0.4


def test_draws_lie_around_the_fit_of_the_printed_values(paper):
    """Without friction, which only ever shortens the overlap."""
    printed = fit_release(paper, RELEASE - CONTACT, V_OSC)
    said = explain(paper, first_mode=False, draws=40)
    assert said.overlap.min() < printed.overlap < said.overlap.max() * 1.1


def test_the_duration_alone_fits_any_stiffness(paper):
    overlaps = [overlap_at(paper, share) for share in (0.25, 1.0, 4.0)]
    assert overlaps == sorted(overlaps, reverse=True)
    assert overlaps[1] == pytest.approx(paper.plectrum.overlap, rel=0.01)


def test_the_text_has_both_readings(paper):
    text = "\n".join(lines(paper, draws=5))
    assert "the speed of all modes (0 of 5 unexplained)" in text
    assert "the speed of the first mode alone" in text

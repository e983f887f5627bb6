"""What the paper's three scalars determine about the plectrum."""

import numpy as np
import pytest

from examples.paper_numbers import CONTACT, RELEASE, V_OSC, explain, overlap_at
from examples.release_fit import fit_release


@pytest.fixture(scope="module")
def explained(paper):
    """Return the explanations with Vosc of all modes, and of the first mode."""
    return [explain(paper, all_modes=all_modes, draws=40) for all_modes in (True, False)]


@pytest.mark.parametrize(("first_mode", "share"), [(False, 0.24), (True, 0.47)])
def test_stiffness_is_identifiable_and_the_overlap_depends_on_the_friction(
    paper, explained, first_mode, share
):
    found = explained[first_mode]
    assert found.unexplained == 0
    stiffness = found.stiffness / paper.plectrum.bending_stiffness
    assert np.median(stiffness) == pytest.approx(share, rel=0.05)
    assert np.ptp(stiffness) < 0.35 * share
    assert found.clearance.mean() == pytest.approx(CONTACT * paper.press.jack_speed, rel=0.02)
    assert np.corrcoef(found.overlap, found.friction)[0, 1] < -0.4


def test_draws_lie_around_the_fit_of_the_printed_values(paper, explained):
    """Without friction, which only ever shortens the overlap."""
    printed = fit_release(paper, RELEASE - CONTACT, V_OSC)
    found = explained[False]
    assert found.overlap.min() < printed.overlap < found.overlap.max() * 1.1


def test_the_duration_alone_fits_any_stiffness(paper):
    overlaps = [overlap_at(paper, share) for share in (0.25, 1.0, 4.0)]
    assert overlaps == sorted(overlaps, reverse=True)
    assert overlaps[1] == pytest.approx(paper.plectrum.overlap, rel=0.01)

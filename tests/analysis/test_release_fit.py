"""Modulus and overlap from duration and Vosc."""

import pytest

from examples.release_fit import fit_release, release_as_is
from sautereau.analysis.errors import ModelError
from sautereau.rig.load import load_rig

RIG = load_rig()
EI = RIG.plectrum.bending_stiffness


def with_plectrum(**changes):
    return RIG.model_copy(update={"plectrum": RIG.plectrum.model_copy(update=changes)})


def test_the_papers_two_scalars():
    found = fit_release(RIG, duration=20e-3, v_osc=0.46)
    assert found.bending_stiffness == pytest.approx(0.24 * EI, rel=0.05)
    assert found.overlap == pytest.approx(0.31e-3, rel=0.05)
    assert found.duration == pytest.approx(20e-3, rel=1e-9)
    assert found.v_osc == pytest.approx(0.46, rel=1e-9)


def test_table_1_cannot_give_both():
    slow = fit_release(RIG, 20e-3)
    assert slow.overlap == pytest.approx(0.263e-3, abs=0.5e-6)
    assert slow.v_osc > 2 * 0.46
    fast = fit_release(RIG, v_osc=0.46)
    assert fast.lift == pytest.approx(0.226e-3, abs=0.5e-6)
    assert fast.duration == pytest.approx(7.0e-3, abs=0.05e-3)


@pytest.mark.parametrize("level", ["elastica", "rods", "beam", "two-beam"])
@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_a_known_plectrum_is_found_again(level, friction):
    """Two scalars are made by one plectrum, and fitted from another."""
    truth = release_as_is(with_plectrum(overlap=0.4e-3, youngs_modulus=1.7e9, friction=friction),
                          level)  # fmt: skip
    start = with_plectrum(friction=friction)
    found = fit_release(start, truth.duration, truth.v_osc, level)
    assert found.overlap == pytest.approx(0.4e-3, rel=1e-6)
    assert found.rig.plectrum.youngs_modulus == pytest.approx(1.7e9, rel=1e-6)


@pytest.mark.parametrize("overlap", [0.05e-3, 0.263e-3, 0.9e-3])
def test_an_overlap_is_found_again(overlap):
    truth = release_as_is(with_plectrum(overlap=overlap))
    assert fit_release(RIG, truth.duration).overlap == pytest.approx(overlap, rel=1e-6)
    assert fit_release(RIG, v_osc=truth.v_osc).overlap == pytest.approx(overlap, rel=1e-6)


@pytest.mark.parametrize(
    ("duration", "v_osc"), [(0.0, 0.46), (20e-3, -1.0), (float("nan"), 0.46), (20e-3, float("inf"))]
)
def test_what_is_no_release_is_refused(duration, v_osc):
    with pytest.raises(ModelError, match="must be finite and above 0"):
        fit_release(RIG, duration, v_osc)


@pytest.mark.parametrize(
    "ask",
    [
        lambda: fit_release(RIG, 7e-3, 3.0),  # the lift alone is more than the jack rises
        lambda: fit_release(RIG, 1.0, 0.46),  # the tip's deflection would exceed its length
        lambda: fit_release(RIG, 1.0),
        lambda: fit_release(RIG, v_osc=20.0),
    ],
)
def test_what_no_plectrum_gives_is_refused(ask):
    with pytest.raises(ModelError, match="no force up to"):
        ask()

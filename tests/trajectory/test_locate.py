"""Calibration of the base: exact for exact touches, with a true uncertainty otherwise."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from sautereau.rig.load import load_rig
from sautereau.trajectory.arm import joints_holding_point
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.motion import Motion
from sautereau.trajectory.mount.locate import UNKNOWNS, locate_base
from tests.budget import slow

PAPER = load_rig()
POINTS = np.linspace(-0.183, -0.130, 6)


def touching(points, offsets=(0.0, 0.0), noise=None, rig=PAPER):
    """Return the joints' readings with the fingertip at points, shape (m, 2)."""
    height = rig.key.surface_height + rig.arm.fingertip_radius
    centre = np.stack([points, np.full_like(points, height)], -1)
    still = np.zeros_like(centre)
    path = Motion(centre if noise is None else centre + noise, still, still)
    return joints_holding_point(rig.arm, path).position - np.array(offsets)


def estimates(found):
    return np.array([found.base_x, found.base_z, *found.offsets])[: len(found.estimated)]


@pytest.mark.parametrize(
    ("points", "offsets"),
    [
        (POINTS[[0, -1]], (0.0, 0.0)),
        (POINTS[[0, -1]], (0.02, 0.0)),
        (POINTS[[0, 2, -1]], (-0.03, 0.05)),
        (POINTS, (0.3, -0.2)),
    ],
)
def test_exact_touches_give_the_exact_base(points, offsets):
    found = locate_base(PAPER, touching(points, offsets), points)
    assert found.base_x == pytest.approx(PAPER.arm.base_x, abs=1e-10)
    assert found.base_z == pytest.approx(PAPER.arm.base_z, abs=1e-10)
    assert found.offsets == pytest.approx(offsets, abs=1e-10)
    assert found.residual < 1e-12
    assert found.touch == 0.1e-3
    assert found.estimated == UNKNOWNS[: min(4, len(points) + 1)]


@pytest.mark.parametrize("offsets", [slow(0), slow(1), 2])
def test_the_uncertainty_covers_the_truth(offsets):
    random = np.random.default_rng(42)
    points = np.linspace(-0.183, -0.130, 20)
    truth = np.array([PAPER.arm.base_x, PAPER.arm.base_z, 0, 0])[: 2 + offsets]
    inside = []
    for _ in range(500):
        noise = random.normal(0, 0.1e-3, (len(points), 2))
        found = locate_base(PAPER, touching(points, noise=noise), points, offsets=offsets)
        inside.append(np.abs(estimates(found) - truth) < 1.96 * found.std)
    coverage = np.mean(inside, axis=0)
    assert ((coverage > 0.92) & (coverage < 0.98)).all(), coverage


def test_touches_worse_than_stated_widen_the_uncertainty():
    noise = np.random.default_rng(0).normal(0, 1e-3, (len(POINTS), 2))
    joints = touching(POINTS, noise=noise)
    found = locate_base(PAPER, joints, POINTS)
    assert found.touch > 0.5e-3
    assert any("disagree" in warning for warning in found.warnings)
    stated = locate_base(PAPER, joints, POINTS, touch=2e-3)
    assert stated.touch == 2e-3
    assert not any("disagree" in warning for warning in stated.warnings)


def test_the_covariance_is_that_of_the_sensitivities():
    """By differences of the estimate over each touch."""
    step, columns = 1e-6, []
    for index in range(2 * len(POINTS)):
        noise = np.zeros((len(POINTS), 2))
        noise.ravel()[index] = step
        ahead = locate_base(PAPER, touching(POINTS, noise=noise), POINTS)
        behind = locate_base(PAPER, touching(POINTS, noise=-noise), POINTS)
        columns.append((estimates(ahead) - estimates(behind)) / (2 * step))
    sensitivity = np.array(columns).T
    found = locate_base(PAPER, touching(POINTS), POINTS)
    expected = (0.1e-3) ** 2 * sensitivity @ sensitivity.T
    assert found.covariance == pytest.approx(expected, rel=1e-4, abs=1e-16)
    assert found.std**2 == pytest.approx(np.diag(expected), rel=1e-4)


def test_close_touches_leave_joint_2_alone():
    points = np.array([-0.180, -0.179, -0.178])
    found = locate_base(PAPER, touching(points), points)
    assert found.estimated == UNKNOWNS[:3]
    assert "do not determine the zero of joint 2" in found.warnings[0]
    assert any("hardly determine the zero of joint 1" in warning for warning in found.warnings)
    with pytest.raises(TrajectoryError, match="do not determine the zero of joint 2"):
        locate_base(PAPER, touching(points), points, offsets=2)


@pytest.mark.parametrize(
    ("points", "values", "fault"),
    [
        ([-0.17], {}, "1 touches, and 2 are needed"),
        ([], {}, "0 touches"),
        ([-0.17, -0.15], {"offsets": 2}, "2 touches, and 3 are needed"),
        ([-0.17, -0.17, -0.17], {}, "span 0 mm"),
        ([-0.17, -0.1695], {}, "touch points further apart"),
        ([0.17, 0.15], {}, "negative"),
        ([-0.3, -0.15], {}, "not on the key's front"),
        ([-0.17, np.nan], {}, "not finite"),
        ([-0.17, -0.15], {"touch": 0.0}, "touching uncertainty"),
        ([-0.17, -0.15], {"offsets": 3}, "give 0, 1 or 2"),
    ],
)
def test_touches_that_determine_nothing_are_refused(points, values, fault):
    joints = np.tile([0.5, -1.5], (len(points), 1))
    with pytest.raises(TrajectoryError, match=fault):
        locate_base(PAPER, joints, np.array(points), **values)


def test_shapes_that_do_not_fit_are_refused():
    with pytest.raises(TrajectoryError, match=r"give \(m, 2\) and \(m,\)"):
        locate_base(PAPER, np.zeros((3, 2)), np.zeros(2))


@given(
    st.lists(
        st.tuples(st.floats(-7, 7), st.floats(-7, 7), st.floats(-0.185, -0.001)),
        min_size=2,
        max_size=8,
    )
)
def test_any_touches_give_numbers_or_a_message(touches):
    table = np.array(touches)
    try:
        found = locate_base(PAPER, table[:, :2], table[:, 2])
    except TrajectoryError:
        return
    assert np.isfinite(estimates(found)).all()
    assert np.isfinite(found.std).all()
    assert (found.std > 0).all()
    assert np.isfinite(found.covariance).all()


@given(st.floats(-0.29, -0.26), st.floats(0.15, 0.18), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2))
def test_any_base_is_found(x, z, first, second):
    rig = PAPER.replaced({"arm.base_x": x, "arm.base_z": z})
    points = np.linspace(-0.183, -0.14, 5)
    assume(np.hypot(x + 0.14, z - 0.014) < 0.21)
    found = locate_base(PAPER, touching(points, (first, second), rig=rig), points)
    assert estimates(found) == pytest.approx([x, z, first, second], abs=1e-9)


def test_more_touches_reduce_the_uncertainty():
    wide = locate_base(PAPER, touching(POINTS), POINTS)
    twice = np.repeat(POINTS, 4)
    more = locate_base(PAPER, touching(twice), twice)
    assert more.std == pytest.approx(wide.std / 2, rel=1e-9)
    known = locate_base(PAPER, touching(POINTS), POINTS, offsets=0)
    assert known.std == pytest.approx([0.1e-3 / np.sqrt(6)] * 2)

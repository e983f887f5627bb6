"""The string by itself: its speeds, its modes, and that they are carried exactly."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.string.string import (
    ModalState,
    ModalString,
    first_mode_release_speed,
    release_speed,
)
from sautereau.rig.load import load_rig

STRING = load_rig().string
B = STRING.plucking_point / STRING.length


def triangle(modes):
    """Return the amplitudes of a string held at 1 m where it is plucked, by quadrature."""
    x = np.linspace(0, 1, 200_001)
    shape = np.where(x < B, x / B, (1 - x) / (1 - B))
    n = np.arange(1, modes + 1)[:, None]
    return 2 * np.mean((shape * np.sin(n * np.pi * x))[:, :-1], axis=1)


def moving(seed, modes=30):
    random = np.random.default_rng(seed)
    n = np.arange(1, modes + 1)
    return ModalState(
        random.normal(size=(2, modes)) * 1e-3 / n**2, random.normal(size=(2, modes)) / n
    )


def advance(step, state, before, after):
    """Return the state after a propagator's step, with the forces [N] at its start and end."""
    (q, v), before, after = state, before[:, None], after[:, None]
    return ModalState(
        step.qq * q + step.qv * v + step.q_from * before + step.q_to * after,
        step.vq * q + step.vv * v + step.v_from * before + step.v_to * after,
    )


def test_the_first_mode_leaves_at_its_part_of_the_triangle():
    expected = 2 * np.pi * STRING.frequency * np.sin(np.pi * B) * triangle(1)[0]
    assert first_mode_release_speed(STRING, 1.0) == pytest.approx(expected, rel=1e-6)
    assert first_mode_release_speed(STRING, 1.0) / release_speed(STRING, 1.0) == pytest.approx(
        0.576, abs=5e-4
    )


@pytest.mark.parametrize("modes", [1, 7, 30, 200])
def test_modes_and_residual_are_the_spring(modes):
    """A constant force is balanced by 1 / K for any number of modes."""
    string = ModalString(STRING, modes)
    moved = np.sum(string.shape**2 / (string.mass * string.omega**2))
    assert moved + string.residual == pytest.approx(1 / STRING.static_stiffness, rel=1e-12)
    assert string.residual > 0
    # The series' tail falls as 1 / n.
    assert string.residual * STRING.static_stiffness * modes < 2 / (np.pi**2 * B * (1 - B))


@pytest.mark.parametrize("decay", [0.0, 40.0])
def test_a_step_under_a_linear_force_is_exact(decay):
    string = ModalString(STRING, 5, decay)
    before, after, step = np.array([0.1, -0.2]), np.array([-0.3, 0.5]), 3.1e-4
    start = moving(1, 5)
    found = advance(string.propagator(step), start, before, after)

    def right(t, y):
        q, v = y.reshape(2, 2, 5)
        force = (before + (after - before) * t / step)[:, None]
        a = string.shape * force / string.mass - 2 * decay * v - string.omega**2 * q
        return np.stack([v, a]).ravel()

    solution = solve_ivp(right, (0, step), np.ravel(start), "DOP853", rtol=1e-12, atol=1e-15)
    q, v = solution.y[:, -1].reshape(2, 2, 5)
    np.testing.assert_allclose(found.q, q, rtol=1e-8, atol=1e-13)
    np.testing.assert_allclose(found.v, v, rtol=1e-8, atol=1e-9)


def test_energy_stays_without_damping_and_falls_with_it():
    still = np.zeros(2)
    string, state = ModalString(STRING), moving(3)
    transition, start = string.propagator(37e-6), string.energy(state)
    for _ in range(5_000):
        state = advance(transition, state, still, still)
    assert string.energy(state) == pytest.approx(start, rel=1e-9)
    damped = ModalString(STRING, decay=5.0)
    energies = damped.energy(damped.free(moving(3), [0.0, 0.3]))
    # Averaged over a swing, energy falls as exp(-2 decay t).
    assert energies[1] / energies[0] == pytest.approx(np.exp(-2 * 5.0 * 0.3), rel=0.02)


def test_the_held_string_loads_the_bridge_by_its_fraction():
    """A static force F is carried by the ends as F (1 - b) and F b."""
    string = ModalString(STRING, 20_000)
    q = string.shape / (string.mass * string.omega**2)
    assert string.bridge_force(q) == pytest.approx(B, rel=1e-3)


@pytest.mark.parametrize("modes", [0, -3])
def test_no_modes_are_refused(modes):
    with pytest.raises(ModelError, match=r"number of modes is .* at least 1"):
        ModalString(STRING, modes)


@pytest.mark.parametrize("decay", [-1.0, 2400.0, np.nan])
def test_an_overdamped_mode_is_refused(decay):
    with pytest.raises(ModelError, match="decay"):
        ModalString(STRING, 30, decay)


def test_after_a_period_all_is_as_before_and_after_half_of_one_mirrored():
    string, state = ModalString(STRING, 60), moving(4, 60)
    period, x = 1 / STRING.frequency, 0.2
    q = string.free(state, [0.0, period / 2, period]).q
    here = string.displacement(q, x)
    there = string.displacement(q, STRING.length - x)
    np.testing.assert_allclose(here[:, 2], here[:, 0], atol=1e-15)
    np.testing.assert_allclose(there[:, 1], -here[:, 0], atol=1e-15)


def test_steps_compose():
    """One step, or ten, or free motion in one go, lead to the same state."""
    string, start, still = ModalString(STRING, decay=3.0), moving(2), np.zeros(2)
    state = start
    for _ in range(10):
        state = advance(string.propagator(1e-4), state, still, still)
    once = advance(string.propagator(1e-3), start, still, still)
    free = string.free(start, [1e-3])
    np.testing.assert_allclose(state.q, once.q, atol=1e-15)
    np.testing.assert_allclose(free.q[:, 0], once.q, atol=1e-15)
    np.testing.assert_allclose(free.v[:, 0], once.v, atol=1e-12)


def test_a_stiff_wires_partials_are_those_of_a_beam_under_tension():
    """mu w^2 = T k^2 + E I k^4, of a steel wire with E = 200 GPa, pinned at its ends."""
    modulus, d = 200e9, STRING.diameter
    b = np.pi**3 * modulus * d**4 / (64 * STRING.tension * STRING.length**2)
    string = ModalString(STRING.model_copy(update={"inharmonicity": b}), 60)
    k = np.arange(1, 61) * np.pi / STRING.length
    rigidity = modulus * np.pi * d**4 / 64
    squares = (STRING.tension * k**2 + rigidity * k**4) / STRING.linear_density
    np.testing.assert_allclose(string.omega, np.sqrt(squares), rtol=1e-12)
    # The support carries T u' - E I u'''.
    q = np.eye(60)
    force = -(STRING.tension * k + rigidity * k**3) * np.cos(k * STRING.length)
    np.testing.assert_allclose(string.bridge_force(q), force, rtol=1e-12)


def test_a_wide_plectrum_drives_the_mean_of_a_shape():
    width = 4e-3
    string = ModalString(STRING, 80, width=width)
    places = STRING.plucking_point + width * (np.arange(2000) + 0.5 - 1000) / 2000
    means = np.sin(np.outer(string.order, places) * np.pi / STRING.length).mean(axis=1)
    np.testing.assert_allclose(string.shape, means, atol=1e-6)
    moved = np.sum(string.shape**2 / (string.mass * string.omega**2))
    assert moved + string.residual == pytest.approx(1 / STRING.static_stiffness, rel=1e-12)

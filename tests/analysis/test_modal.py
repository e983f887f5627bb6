"""The pluck of the moving string against a spring, against travelling waves, and in energy."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid, solve_ivp
from scipy.optimize import fsolve

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.modal_pluck import modal_pluck
from sautereau.analysis.model.plectrum.levels import plectrum_map
from sautereau.analysis.model.predict import rig_pluck
from sautereau.analysis.model.string.string import release_speed
from sautereau.rig.load import load_rig
from tests.budget import slow

RIG = load_rig()


def rig_at(speed, **plectrum):
    press = RIG.press.model_copy(update={"jack_speed": speed})
    plectrum = RIG.plectrum.model_copy(update=plectrum)
    return RIG.model_copy(update={"press": press, "plectrum": plectrum})


def duration(rig):
    return rig_pluck(rig).release_height / rig.press.jack_speed


@cache
def pluck(speed=0.072):
    """Return the pluck of the rig at a jack speed [m/s]."""
    return modal_pluck(rig_at(speed))


def errors(speed):
    """Return by how many % duration and force at release exceed the spring's."""
    rig = rig_at(speed)
    modal, static = pluck(speed), rig_pluck(rig)
    by = modal.release / duration(rig), modal.plectrum_force / static.force[-1]
    return (np.array(by) - 1) * 100


@pytest.mark.parametrize(("speed", "percent"), [(0.072, 0.24), (0.15, 0.9), (0.3, 2.6), (1.0, 8.0)])
def test_how_long_the_spring_is_wrong(speed, percent):
    assert percent / 1.5 < errors(speed)[0] < percent * 1.5


def test_a_slow_pluck_is_the_springs():
    rig = rig_at(0.01)
    modal, static = modal_pluck(rig, modes=5), rig_pluck(rig)
    force = np.interp(modal.height, static.height, static.force)
    np.testing.assert_allclose(modal.force, force, atol=1.5e-3 * static.force[-1])
    assert modal.release == pytest.approx(duration(rig), rel=5e-4)


@pytest.mark.parametrize("speed", [0.072, 1.0])
def test_the_jacks_work_is_in_string_and_plectrum(speed):
    rig = rig_at(speed)
    modal = pluck(speed)
    string = modal.string
    # Of the elastica: EI/2 times the integral of its curvature squared, psi'^2 F / EI.
    s, force, ei = modal.position[-1], modal.force[-1], rig.plectrum.bending_stiffness
    xi = s * np.sqrt(force / ei)
    bent = solve_ivp(
        lambda _, y: [y[1], np.cos(y[0]), y[1] ** 2], (0, xi), [0, 0, 0], rtol=1e-10, atol=1e-14
    ).y[2, -1]
    plectrum = ei / 2 * (xi / s) * bent
    left_out = string.residual * force**2 / 2
    work = cumulative_trapezoid(modal.force * np.cos(modal.angle), x=modal.height)[-1]
    total = float(np.sum(string.energy(modal.state))) + left_out + plectrum
    assert work == pytest.approx(total, rel=2e-5)


def test_the_string_leaves_at_the_speed_of_all_its_modes():
    """Soon after a slow release, on average over the shortest swing that the modes know."""
    modal = modal_pluck(rig_at(0.05), modes=40)
    time = np.linspace(0, 2e-4, 400)
    place, _ = modal.free.motion(time)
    slope = np.polyfit(time, place[:, 1], 1)[0]
    lift = modal.displacement[-1, 1]
    assert -slope == pytest.approx(release_speed(RIG.string, lift), rel=0.03)


@pytest.mark.parametrize("level", ["rods", "beam", "two-beam"])
def test_every_level_plucks(level):
    rig = rig_at(0.1)
    held = rig_pluck(rig, level).release_height / 0.1
    assert modal_pluck(rig, level).release == pytest.approx(held, rel=0.02)


def test_friction_releases_like_the_spring():
    rig = rig_at(0.05, friction=0.1)
    modal, static = modal_pluck(rig, modes=10, step=8e-5), rig_pluck(rig)
    assert modal.release == pytest.approx(duration(rig), rel=2e-3)
    assert modal.plectrum_force == pytest.approx(static.string_force[-1], rel=3e-3)


def test_damping_stills_the_held_string():
    """What swings about the steady rise dies out as exp(-decay t), from about its middle on."""

    def swing(modal):
        late = modal.time > modal.release / 2
        time, speed = modal.time[late], modal.velocity[late, 1]
        return np.std(speed - np.polyval(np.polyfit(time, speed, 3), time))

    assert swing(modal_pluck(RIG, decay=200.0)) < 0.2 * swing(pluck())


@pytest.mark.parametrize("speed", [0.005, 1.0])
@pytest.mark.parametrize(
    ("overlap", "thickness"), [(1e-5, 0.2e-3), (1e-5, 0.9e-3), (2e-3, 0.2e-3), (2e-3, 0.9e-3)]
)
def test_extremes_give_numbers_or_a_model_error(speed, overlap, thickness):
    rig = rig_at(speed, overlap=overlap, thickness=thickness)
    try:
        modal = modal_pluck(rig, modes=30 if speed > 0.1 else 1)
    except ModelError:
        return
    for values in (modal.time, modal.force, modal.position, modal.displacement, modal.velocity):
        assert np.isfinite(values).all()
    assert (modal.force >= 0).all()


def test_a_stiff_plectrum_does_not_stir_the_modes_up():
    """Steps of more than 0.4 of the shortest period do, whence the limit."""
    rig = rig_at(0.15, thickness=2.5e-3, overlap=2e-5)
    static = rig_pluck(rig)
    modal = modal_pluck(rig, step=0.34 / RIG.string.frequency / 30)
    force = np.interp(modal.height, static.height, static.force)
    assert np.abs(modal.force - force).max() < 0.1 * static.force[-1]
    assert modal.release == pytest.approx(duration(rig), rel=5e-3)
    with pytest.raises(ModelError, match="fewer modes"):
        modal_pluck(rig, step=0.4 / RIG.string.frequency / 30)


@pytest.mark.parametrize("step", [0.0, -1e-6, 1.0, np.nan, 1e-12])
def test_a_step_out_of_range_is_refused(step):
    with pytest.raises(ModelError, match="step"):
        modal_pluck(RIG, step=step)


def by_waves(rig, steps):
    """Return release [s] and force [N] with the string as travelling waves, all modes in it.

    At the plucking point a force moves an endless string by w = integral of F c / 2T; the
    fixed ends add its images, late by the way there and back: w of every 2kL, and -w of
    every 2 (p + kL). Trapezoidal rule; contact by scipy's general solver of equations.
    """
    string, plectrum = rig.string, plectrum_map(rig.plectrum, "elastica")
    c = 2 * string.length * string.frequency
    speed = rig.press.jack_speed
    dt = rig_pluck(rig).release_height / speed / steps
    rest = plectrum.length - rig.plectrum.overlap
    k = np.arange(-100, 101)
    image = np.concatenate([k[k != 0] * string.length, string.plucking_point + k * string.length])
    late = 2 * np.abs(image) / c
    sign = np.concatenate([np.ones(len(k) - 1), -np.ones(len(k))])
    sign, late = sign[late < 2 * steps * dt], late[late < 2 * steps * dt]
    time, w, force = np.arange(2 * steps) * dt, np.zeros((2, 2 * steps)), np.zeros((2, 2 * steps))
    give = dt / 4 * c / string.tension
    now = last = np.array([rest, 0.0])
    for i in range(1, 2 * steps):
        echo = [sign @ np.interp(time[i] - late, time[:i], moved[:i], left=0.0) for moved in w]
        free = w[:, i - 1] + give * force[:, i - 1] + echo

        def apart(unknown, free=free, i=i):
            s, f = unknown
            bend = plectrum.bend(s, f)
            return [
                (bend.x - rest - free[0] + give * f * np.sin(bend.theta)) * 1e3,
                (bend.z + speed * time[i] - free[1] - give * f * np.cos(bend.theta)) * 1e3,
            ]

        ahead = fsolve(apart, np.maximum(2 * now - last, 0), xtol=1e-12)
        if ahead[0] >= plectrum.length:
            share = (plectrum.length - now[0]) / (ahead[0] - now[0])
            return time[i - 1] + share * dt, now[1] + share * (ahead[1] - now[1])
        last, now = now, ahead
        theta = plectrum.bend(*now).theta
        force[:, i] = now[1] * np.array([-np.sin(theta), np.cos(theta)])
        w[:, i] = w[:, i - 1] + give * (force[:, i - 1] + force[:, i])
    raise AssertionError("no release")


@pytest.mark.parametrize("speed", [slow(0.3), 1.0])
def test_travelling_waves_agree(speed):
    release, force = by_waves(rig_at(speed), 300)
    modal = pluck(speed)
    assert modal.release == pytest.approx(release, rel=2e-5)
    assert modal.plectrum_force == pytest.approx(force, rel=5e-5)


def test_the_step_converges_at_second_order():
    rig = rig_at(1.0)
    held = duration(rig)
    releases = [modal_pluck(rig, step=held / n).release for n in (100, 200, 400, 1200)]
    first, second, third = np.abs(np.array(releases[:-1]) - releases[-1])
    assert np.log2(first / third) / 2 == pytest.approx(2.0, abs=0.2)
    assert first > second > third
    assert third < 1e-6 * held


def test_the_modes_converge_faster_than_their_residual():
    """The left-out modes are there as a spring, so that their number matters little."""
    rig = rig_at(1.0)
    step = duration(rig) / 300
    forces = [modal_pluck(rig, modes=n, step=step).plectrum_force for n in (5, 10, 20, 40, 160)]
    off = np.abs(np.array(forces[:-1]) / forces[-1] - 1)
    assert off[0] < 2e-3
    assert off[3] < 1e-5
    assert np.log2(off[0] / off[3]) / 3 > 1.5


def test_the_free_motion_continues_that_of_the_held_string():
    modal = pluck()
    place, speed = modal.free.motion([0.0, 1e-7, 2e-7])
    # What the left-out modes held jumps back at release.
    left_out = modal.string.residual * modal.force[-1]
    assert np.hypot(*(place[0] - modal.displacement[-1])) == pytest.approx(left_out, rel=1e-6)
    np.testing.assert_allclose((place[2] - place[0]) / 2e-7, speed[1], rtol=1e-5)

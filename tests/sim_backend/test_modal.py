"""The modal string in the stand-in: held, released, vibrating, damped and touched again."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from sautereau.analysis.model.choirs import choirs
from sautereau.analysis.model.plectrum.elastica import Elastica
from sautereau.analysis.model.predict import rig_pluck
from sautereau.rig.load import with_values
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.events import PluckEvents
from sautereau.sim_backend.physics.rigid.modal import ModalPlucking
from sautereau.sim_backend.scene import Scene
from tests.budget import slow
from tests.sim_backend.scenes import RIG

CLEARANCE = RIG.jack.string_clearance * 1e3
FREQUENCY = RIG.string.frequency


def strung(rig=RIG, modes=30, level="elastica", **parts):
    """Return the string of a rig's first choir."""
    push = {"force": "1 N", "duration": "1 s"}
    values = {"finger": "push", "push": push, "plectrum": level, "string": "modal"}
    values |= {"friction": False, "felt": False, "step": "10 us"}
    scene = Scene.model_validate(values | parts)
    return ModalPlucking(choirs(rig)[0], scene, 0, PluckEvents(), modes)


def rising(speed, growth=0.0, start=0.0):
    """Return a jack [mm] that is at the string's rest at time 0, at speeds in m/s and m/s^2."""
    return lambda time: CLEARANCE + start + (speed * time + growth * time**2 / 2) * 1e3


def drive(string, rise, times, until=lambda events: False):
    """Move the jack along a path [mm] of time as an engine does; return the forces [N]."""
    time, *ends = times.tolist()
    forces = []
    for end in ends:
        while not string.low <= rise(end) <= string.high:
            upwards = rise(end) > string.high
            bound = string.high if upwards else string.low
            late = (rise(time) > bound) if upwards else (rise(time) < bound)
            at = time if late or rise(time) == bound else brentq(
                lambda t, bound=bound: rise(t) - bound, time, end, xtol=1e-15
            )  # fmt: skip
            if at > time:
                string.force(rise(at), rise(time), time, at - time)
            string.cross(upwards, at)
            string.force(rise(at), rise(at), at, 0.0)
            time = at
        forces.append(string.force(rise(end), rise(time), time, end - time))
        time = end
        if until(string.events):
            break
    return np.array(forces)


def pluck(rise, step, end=0.05, string=None):
    """Return a string that the jack's path has plucked, and the forces [N] on the way."""
    string = string or strung()
    forces = drive(string, rise, np.arange(0, end, step), lambda events: events.releases)
    assert [e.force for e in string.events.contacts] == [0.0]
    assert [e.time for e in string.events.contacts] == pytest.approx([0.0], abs=1e-12)
    return string, forces


def total_energy(swing):
    return float(swing.string.string.energy(swing.string.state))


@cache
def integrated(speed, growth=0.0, modes=8):
    """Return release [s], force on the jack [N], q and v there, and the force over time.

    The modes by scipy's integrator at 1e-10; its right-hand side solves the massless plectrum and
    the static modes, independently of the code under test.
    """
    string, plectrum = RIG.string, Elastica(RIG.plectrum)
    n = np.arange(1, modes + 1)
    shape = np.sin(n * np.pi * string.plucking_point / string.length)
    mass = string.tension / (2 * string.length * FREQUENCY) ** 2 * string.length / 2
    omega = 2 * np.pi * FREQUENCY * n
    give = 1 / string.static_stiffness - np.sum(shape**2 / mass / omega**2)
    rest = plectrum.length - RIG.plectrum.overlap
    last = np.array([rest, 0.0])

    def contact(time, y):
        nonlocal last
        x, z = y[: 2 * modes].reshape(2, -1) @ shape
        height = speed * time + growth * time**2 / 2
        s, f = last
        for _ in range(50):
            b = plectrum.bend(s, max(f, 0.0))
            out, up = -np.sin(b.theta), np.cos(b.theta)
            gap = [b.x - rest - x - give * f * out, b.z + height - z - give * f * up]
            by_s = [b.x_s + give * f * up * b.theta_s, b.z_s - give * f * out * b.theta_s]
            by_f = [
                b.x_f - give * (out - f * up * b.theta_f),
                b.z_f - give * (up + f * out * b.theta_f),
            ]
            ds, df = np.linalg.solve(np.transpose([by_s, by_f]), gap)
            s, f = s - ds, f - df
            if abs(ds) < 1e-13 * rest:
                break
        last = np.array([s, f])
        return s, f * out, f * up

    def rates(time, y):
        q = y[: 2 * modes].reshape(2, -1)
        pushed = np.outer(contact(time, y)[1:], shape) / mass - omega**2 * q
        return np.concatenate([y[2 * modes :], pushed.ravel()])

    def tip(time, y):
        return contact(time, y)[0] - plectrum.length

    tip.terminal = True
    found = solve_ivp(
        rates, (0, 0.05), np.zeros(4 * modes), "DOP853", rtol=1e-10, atol=1e-14, events=tip
    )
    release, state = found.t_events[0][0], found.y_events[0][0]
    forces = [contact(t, y)[2] for t, y in zip(found.t, found.y.T, strict=True)]
    q, v = state.reshape(2, 2, modes)
    return release, contact(release, state)[2], q, v, (found.t, np.array(forces))


PATHS = [(0.3, 0.0), (0.05, 60.0)]  # m/s and m/s^2: constant, and accelerated


@pytest.mark.slow
@pytest.mark.parametrize("path", PATHS)
def test_an_integrator_of_the_same_equations_agrees(path):
    release, force, q, v, (time, forces) = integrated(*path)
    step = 2e-6
    string, found = pluck(rising(*path), step, string=strung(modes=8))
    (event,) = string.events.releases
    assert event.time == pytest.approx(release, rel=1e-7)
    assert event.force == pytest.approx(force, rel=1e-6)
    state = string.swings[-1].string.state
    np.testing.assert_allclose(state.q, q, atol=1e-6 * np.abs(q).max())
    np.testing.assert_allclose(state.v, v, atol=2e-5 * np.abs(v).max())
    ends = step * np.arange(1, len(found))
    inside = (time > 20 * step) & (time < ends[-1])
    between = np.interp(time[inside], ends, found[:-1])
    np.testing.assert_allclose(between, forces[inside], atol=2e-5 * force)


@pytest.mark.parametrize("factor", [1e-3, 0.1, 10.0, 1e3])
def test_strings_of_any_stiffness_are_converged_or_refused(factor):
    rig = with_values(RIG, {"string.tension": f"{RIG.string.tension * factor} N"})
    try:
        string = strung(rig)
    except SceneError:
        return
    end = min(1.5 * rig_pluck(rig).release_height / 0.3, 0.03)
    momenta, released = [], []
    for step in (2e-5, 1e-5):
        string = strung(rig)
        forces = drive(string, rising(0.3), np.arange(0, end, step))
        assert np.isfinite(forces).all()
        lost = (np.cumsum(forces) - forces / 2) * step
        momenta.append(lost[round(2e-5 / step) - 1 :: round(2e-5 / step)])
        released.append([e.time for e in string.events.releases])
    assert released[0] == pytest.approx(released[1], rel=1e-4)
    ends = min(map(len, momenta))
    off = np.sort(np.abs(momenta[0][:ends] - momenta[1][:ends]))
    assert off[-2 if released[0] else -1] < 2e-4 * momenta[1].max()


def test_a_compliant_plectrum_is_followed_over_its_fold():
    """The slower the jack, the nearer to the fold of the spring string is the release."""
    tension = f"{RIG.string.tension * 300 / RIG.string.static_stiffness} N"
    rig = with_values(RIG, {"string.tension": tension, "plectrum.overlap": "3.5 mm"})
    static = rig_pluck(rig)
    assert static.released_at_fold
    late = []
    for speed in (0.1, 0.02):
        string, forces = pluck(rising(speed), 1e-4, 1.0, strung(rig, modes=5))
        late.append(string.events.releases[0].time * speed / static.release_height - 1)
    assert forces.max() == pytest.approx(static.vertical_force.max(), rel=5e-3)
    assert 0 < late[1] < 0.4 * late[0] < 0.02


@pytest.mark.parametrize("level", ["rods", "beam", "two-beam", "fe"])
def test_every_level_plucks(level):
    string, _ = pluck(rising(0.1), 2e-4, string=strung(modes=5, level=level))
    (event,) = string.events.releases
    assert event.time * 0.1 == pytest.approx(rig_pluck(RIG, level).release_height, rel=0.02)


def up_and_down(top=2.0, speed=0.072, stay=0.02):
    """Return a path [mm] from under the string to a top over it, and back down to rest."""
    peak = (top + 1.0) / (speed * 1e3)
    corners = [0, peak, peak + stay, 2 * peak + stay, 2 * peak + stay + CLEARANCE / speed / 1e3]
    rises = [CLEARANCE - 1, CLEARANCE + top, CLEARANCE + top, CLEARANCE - 1, 0.0]
    return lambda time: float(np.interp(time, corners, rises)), corners[-1]


def test_the_damper_acts_below_its_lift():
    path, end = up_and_down()
    lift, decay = RIG.jack.damper.lift * 1e3, RIG.jack.damper.decay
    string = strung(damper=True, tongue=True)
    drive(string, path, np.arange(0, end + 0.2, 1e-4))
    last = string.swings[-1]
    down = brentq(lambda t: path(t) - lift, end - 0.05, end)
    assert last.start == pytest.approx(down, abs=1e-12)
    assert last.string.string.decay == pytest.approx(decay)
    time = np.linspace(0, 0.1, 4000)
    place, _ = last.string.motion(time)
    highest = [np.abs(place[a : a + 400, 1]).max() for a in range(0, 3600, 400)]
    slope = np.polyfit(time[:3600:400], np.log(highest), 1)[0]
    assert slope == pytest.approx(-decay, rel=0.03)
    assert all(s.string.string.decay[0] == 0 for s in string.swings[:-1])


def test_a_vibrating_string_is_plucked_again():
    """Its energy never exceeds the work of the jack."""
    path, end = up_and_down()
    string = strung(tongue=True)
    work = 0.0
    for press in range(3):
        times = np.arange(0, end, 1e-5)

        def later(time, press=press):
            return path(time - press * end)

        forces = drive(string, later, times + press * end)
        rises = np.array([path(t) for t in times])
        work += float(np.sum((forces[1:] + forces[:-1]) / 2 * np.diff(rises[1:]))) / 1e3
        assert np.isfinite(forces).all()
        energy = total_energy(string.swings[-1])
        assert energy <= work * (1 + 1e-3)
    events = string.events
    assert len(events.contacts) == len(events.releases) == len(events.returns) == 3
    order = np.ravel([[e.time for e in kind] for kind in (events.contacts, events.releases)], "F")
    assert (np.diff(order) > 0).all()


@pytest.mark.parametrize("tongue", [True, False])
def test_the_plectrum_passes_the_string_by_its_tongue(tongue):
    path, end = up_and_down()
    string = strung(tongue=tongue, damper=True)
    forces = drive(string, path, np.arange(0, end, 1e-5))
    (event,) = string.events.returns
    law, plectrum = RIG.jack.tongue, RIG.plectrum
    lever = plectrum.length - plectrum.overlap
    turned = plectrum.overlap / law.pivot if tongue else 0.0
    assert path(event.time) == pytest.approx(CLEARANCE - lever * turned * 1e3, abs=1e-9)
    most = (law.bristle_moment + law.bristle_stiffness * turned) / lever if tongue else 0.0
    assert event.force == pytest.approx(-most)
    if tongue:
        passing = forces[forces < 0]
        assert passing.min() >= -most * (1 + 1e-9)
        assert passing.max() <= -law.bristle_moment / lever


def test_a_jack_that_reverses_releases_nothing():
    speed, peak = 0.05, 0.01

    def path(time):
        return CLEARANCE + speed * (peak - abs(time - peak)) * 1e3

    string = strung(modes=5)
    forces = drive(string, path, np.arange(0, 2.5 * peak, 5e-5))
    assert not string.events.releases
    assert forces.max() == pytest.approx(float(rig_pluck(RIG).force_on_jack(5e-4)), rel=0.05)
    assert (forces > -1e-3).all()
    assert forces[-1] == 0


def test_a_string_at_rest_has_no_free_vibration():
    string = strung(damper=True)
    drive(string, lambda t: 1.5 * np.sin(300 * t) ** 2, np.arange(0, 0.05, 1e-4))
    assert string.swings == []
    assert string.events == PluckEvents()


def test_an_overcritical_damper_is_refused():
    rig = with_values(RIG, {"jack.damper.decay": "3000 1/s"})
    with pytest.raises(SceneError, match="decay"):
        strung(rig, damper=True)


def test_a_string_that_is_never_plucked_is_refused():
    with pytest.raises(SceneError, match=r"plectrum\.overlap"):
        strung(with_values(RIG, {"plectrum.overlap": "4.4999 mm"}))


def test_a_path_that_is_not_finite_is_refused():
    string, _ = pluck(rising(0.072), 1e-4, end=5e-3)
    with pytest.raises(SceneError, match="height"):
        string.force(np.nan, CLEARANCE + 0.3, 5e-3, 1e-4)


@pytest.mark.parametrize("seed", [*range(4), *(slow(n) for n in range(4, 12))])
def test_random_motion_of_the_jack_is_followed(seed):
    random = np.random.default_rng(seed)
    rises = np.concatenate([[0], CLEARANCE + random.normal(0, 1.2, random.integers(6, 20))])
    speed, step = 10 ** random.uniform(1, 3.3), 10 ** random.uniform(-4.5, -3)
    corners = np.concatenate([[0], np.cumsum(np.maximum(np.abs(np.diff(rises)) / speed, 1e-5))])
    string = strung(tongue=bool(seed % 2), damper=bool(seed % 3))
    times = np.arange(0, min(corners[-1], 2000 * step), step)
    forces = drive(string, lambda t: float(np.interp(t, corners, rises)), times)
    assert np.isfinite(forces).all()
    events, swings = string.events, string.swings
    assert len(events.releases) <= len(events.contacts)
    for kind in (events.contacts, events.releases, events.returns):
        assert (np.diff([e.time for e in kind]) > 0).all()
    ends = [s.end for s in swings]
    assert (np.array([s.start for s in swings[1:]]) >= np.array(ends[:-1]) - 1e-12).all()
    assert all(np.isfinite(total_energy(s)) for s in swings)


@pytest.mark.parametrize("path", [PATHS[0], slow(PATHS[1])])
def test_release_and_state_converge_at_second_order(path):
    release, force, _, v, _ = integrated(*path)
    errors = []
    for step in (8e-5, 4e-5, 2e-5):
        string, _ = pluck(rising(*path), step, string=strung(modes=8))
        (event,) = string.events.releases
        off = np.abs(string.swings[-1].string.state.v - v).max()
        errors.append([abs(event.time - release), abs(event.force - force), off])
    orders = np.log2(np.array(errors[0]) / errors[2]) / 2
    assert (orders > 1.7).all(), (errors, orders)


def test_a_free_string_keeps_its_energy_for_a_second():
    """A damper without decay, lowered after a second, requires the string's state."""
    damper = {"jack.damper.lift": f"{CLEARANCE + 1.5} mm", "jack.damper.decay": "0 1/s"}
    path, _ = up_and_down(stay=1.0)
    string = strung(with_values(RIG, damper), damper=True)
    drive(string, path, np.arange(0, 1.06, 1e-4))
    *_, held, later = string.swings
    assert later.start == held.end > held.start + 1.0
    assert total_energy(later) == pytest.approx(total_energy(held), rel=1e-9)
    modes = held.string.string
    energy = modes.energy(modes.free(held.string.state, [0.1234, 0.777, 1.00031]))
    np.testing.assert_allclose(energy, total_energy(held), rtol=1e-9)


def test_a_slow_pluck_is_the_springs():
    rig_slow, speed, step = rig_pluck(RIG), 0.005, 1e-4
    string, forces = pluck(rising(speed), step, 0.5, strung(modes=5))
    (event,) = string.events.releases
    assert event.time * speed == pytest.approx(rig_slow.release_height, rel=5e-4)
    heights = speed * step * np.arange(1, len(forces))
    static = rig_slow.force_on_jack(heights)
    np.testing.assert_allclose(forces[:-1], static, atol=2e-3 * static.max())


@pytest.mark.parametrize("step", [2e-4, 5e-5])
def test_the_forces_of_long_steps_carry_the_same_momentum(step):
    """Leap-frog impulses extend over half a step, so that the total momentum is exact."""
    _, fine = pluck(rising(0.3), 1e-6)
    string, coarse = pluck(rising(0.3), step)
    assert len(string.events.releases) == 1
    assert np.sum(coarse) * step == pytest.approx(np.sum(fine) * 1e-6, rel=2e-5)

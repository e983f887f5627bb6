"""The reference solution against closed forms, conservation laws and other formulations."""

import math

import numpy as np
import pytest
from scipy.integrate import LSODA, quad, simpson
from scipy.optimize import brentq, lsq_linear

from sautereau.analysis.model.choirs import choir_pluck, choirs
from sautereau.analysis.model.key import finger_force
from sautereau.rig.load import with_values
from sautereau.rig.section import GRAVITY
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.drive import LEAD, PressDrive
from sautereau.sim_backend.physics.reference.drive_segments import DriveSegment
from sautereau.sim_backend.physics.reference.jack import JackLaw, PluckLaw, StringMode
from sautereau.sim_backend.physics.reference.linkage import Linkage
from sautereau.sim_backend.physics.reference.mode import Felt, ForceModes, JackMode
from sautereau.sim_backend.physics.reference.observe import observed, reference, solve
from sautereau.sim_backend.physics.reference.switch import resolve_impacts, select_mode
from sautereau.sim_backend.physics.reference.system import System
from sautereau.sim_backend.physics.servo import PositionLoops
from sautereau.trajectory.arm import fingertip_motion
from sautereau.trajectory.dynamics import joint_torques, mass_matrix
from sautereau.trajectory.key import angle_of_rise, key_under_fingertip, rise_of_angle
from sautereau.trajectory.motion import Motion
from sautereau.trajectory.press import plan_press
from tests import key_oracle
from tests.sim_backend.scenes import BARE, MUTE, RIG, press_solved, pushed, scene_of, slow

PERIOD = RIG.controller.sample_period


def when(solution, name):
    return [time for time, why in solution.switches if why == name]


@pytest.fixture(scope="module")
def ideal():
    return press_solved("return")


@pytest.fixture(scope="module")
def paper():
    return press_solved("paper")


# A push in closed form.


def test_a_pushed_key_moves_by_its_energy():
    """(I + m r'^2) w^2 / 2 = (F a_p + H) a - m g r(a), and the time is the integral of 1 / w."""
    key, mass = RIG.key, RIG.jack.mass
    moved = solve(RIG, pushed(1.2, 40 * PERIOD, **BARE))
    angle, spin = np.array(moved.states)[:, :2].T
    moment = 1.2 * key.press_arm + key.gravity_moment

    def speed(a):
        stored = moment * a - mass * GRAVITY * key_oracle.rise(key, a)
        return math.sqrt(2 * stored / (key.inertia + mass * key_oracle.slope(key, a) ** 2))

    np.testing.assert_allclose(spin, [speed(a) for a in angle], rtol=1e-10)
    # a = u^2 takes the root out of the integrand at rest.
    took, _ = quad(lambda u: 2 * u / speed(u * u), 0, math.sqrt(angle[-1]), epsabs=0, epsrel=1e-12)
    assert took == pytest.approx(moved.times[-1], rel=1e-10)


def test_a_light_jacks_key_swings_on_the_felt_as_a_spring():
    """To the felt in sqrt(2 I dip / P); then half a period plus the phase lags at both ends."""
    changes = {"jack.mass": "1e-12 kg", "key.gravity_moment": "0 N m"}
    changes["key.felt_damping"] = "0 N s/m"
    scene = pushed(1.0, 0.06, **{**BARE, "felt": True}, truth=changes)
    moved = solve(RIG, scene)
    key = RIG.key
    moment, dip = key.press_arm, key.dip / key.press_arm
    stiffness = key.felt_stiffness * key.press_arm**2
    omega, contact = math.sqrt(stiffness / key.inertia), math.sqrt(2 * key.inertia * dip / moment)
    speed = moment * contact / key.inertia
    lag = math.atan(moment / stiffness * omega / speed)
    assert when(moved, "contact of key and felt")[0] == pytest.approx(contact, rel=1e-8)
    assert when(moved, "the key stops")[0] - contact == pytest.approx(
        (math.pi / 2 + lag) / omega, rel=1e-8
    )
    assert when(moved, "the felt pushes or not")[0] - contact == pytest.approx(
        (math.pi + 2 * lag) / omega, rel=1e-8
    )
    depth = max(state[0] for state in moved.states) - dip
    mean = moment / stiffness
    assert depth == pytest.approx(mean + math.hypot(mean, speed / omega), rel=1e-7)


def test_a_jack_in_flight_is_ballistic():
    """A key with a large moment to the back falls faster, and is on its rail before the jack."""
    truth = {"key.gravity_moment": "-50 mN m"}
    moved = solve(RIG, pushed(1.0, 20 * PERIOD, 0.2, **BARE, truth=truth))
    times, states = np.array(moved.times), np.array(moved.states)
    start = int(np.argmin(abs(times - 20 * PERIOD)))
    t0, (a0, w0, y0, v0) = times[start], states[start]
    assert t0 == 20 * PERIOD
    fall = 0.05 / RIG.key.inertia
    assert fall * RIG.key.jack_arm > 1.5 * GRAVITY
    times, states = times[start:] - t0, states[start:]
    down = (w0 + math.sqrt(w0**2 + 2 * fall * a0)) / fall
    lands = (v0 + math.sqrt(v0**2 + 2 * GRAVITY * y0)) / GRAVITY
    assert when(moved, "contact of key and rail")[0] - t0 == pytest.approx(down, abs=1e-11)
    assert when(moved, "the jack lands")[-1] - t0 == pytest.approx(lands, abs=1e-11)
    air = times <= lands
    parabola = y0 + v0 * times - GRAVITY * times**2 / 2
    np.testing.assert_allclose(states[air, 2], parabola[air], atol=1e-13)
    late = times > lands + 1e-9
    assert late.any()
    assert not states[late].any()


@pytest.mark.parametrize(("factor", "moves"), [(1 - 1e-9, False), (1 + 1e-6, True)])
def test_friction_holds_the_key_up_to_its_limit(factor, moves):
    """The moment at the start is tau + f b + m g b - H."""
    limit = key_oracle.static_moment(RIG, friction=1)
    moved = solve(RIG, pushed(factor * limit / RIG.key.press_arm, 0.05, **MUTE))
    assert (max(state[0] for state in moved.states) > 0) == moves


def test_friction_holds_the_key_where_it_stops():
    truth = {"key.pivot_coulomb_friction": "20 mN m"}
    moved = solve(RIG, pushed(1.0, 0.02, 0.3, **MUTE, truth=truth))
    stopped = when(moved, "the key stops")
    still = [s for t, s in zip(moved.times, moved.states, strict=True) if t > stopped[-1]]
    assert len(still) > 1000
    assert still[0][0] > 0.01
    assert all(state == still[0] for state in still)


def test_without_friction_the_pluck_takes_its_work():
    """F a_p a = kinetic + potential energy + the pluck's own work, to 1e-9, at release."""
    moved = solve(RIG, pushed(1.2, 0.03, friction=False))
    release = moved.events.releases[0]
    balance = _balance(RIG, moved, release.time, 1.2, friction=False)
    assert balance == pytest.approx(0, abs=1e-9)


def test_with_friction_the_difference_is_heat():
    moved = solve(RIG, pushed(1.5, 0.03))
    release = moved.events.releases[0]
    assert _balance(RIG, moved, release.time, 1.5) == pytest.approx(0, abs=1e-9)
    pluck = choir_pluck(choirs(RIG)[0])
    assert release.force == pytest.approx(float(pluck.vertical_force[-1]), rel=1e-12)


def _balance(rig, moved, time, force, friction=True):
    """Return the energy balance at a time, relative to the work of the push."""
    key, jack = rig.key, rig.jack
    times = np.array(moved.times)
    i = int(np.argmin(abs(times - time)))
    assert times[i] == pytest.approx(time, abs=1e-15)
    states = np.array(moved.states)
    angle, _, rise, _ = states[i]
    stored = key_oracle.energy(rig, *states[i])
    heat = key.pivot_coulomb_friction * angle + jack.register_friction * rise
    heat += key.pivot_viscous_friction * simpson(states[: i + 1, 1] ** 2, x=times[: i + 1])
    work = force * key.press_arm * angle
    pluck = choir_pluck(choirs(rig)[0]).work
    return (work - stored - pluck - friction * heat) / work


@pytest.mark.slow
def test_a_finer_tolerance_changes_no_event():
    """Through pluck, felt, flight, landing, tongue, damper and rail."""
    scene = pushed(1.5, 0.15, 0.15, tongue=True, damper=True)
    coarse, fine = (solve(RIG, scene, tolerance=tolerance) for tolerance in (1e-10, 1e-12))
    assert [name for _, name in coarse.switches] == [name for _, name in fine.switches]
    times = [np.array([time for time, _ in moved.switches]) for moved in (coarse, fine)]
    np.testing.assert_allclose(*times, rtol=0, atol=1e-9)
    assert len(fine.events.returns) == 1
    assert {"the jack lands", "contact of key and rail"} <= {name for _, name in fine.switches}


# The ideal finger.


def planned(drive, time):
    joints = drive.joints(np.atleast_1d(time))
    centre = fingertip_motion(RIG.arm, joints)
    return key_under_fingertip(RIG.key, RIG.arm.fingertip_radius, centre)


def reaches(drive, rise, after, before):
    angle = float(angle_of_rise(RIG.key, rise))
    return brentq(lambda t: planned(drive, t).position[0] - angle, after, before, xtol=1e-14)


def test_an_ideal_finger_plucks_where_it_was_planned(ideal):
    moved, drive = ideal
    clearance, law = RIG.jack.string_clearance, plan_press(RIG).law
    start, top = LEAD * PERIOD, LEAD * PERIOD + law.return_start
    height = choir_pluck(choirs(RIG)[0]).release_height
    lever = RIG.plectrum.length - RIG.plectrum.overlap
    travel = lever * RIG.plectrum.overlap / RIG.jack.tongue.pivot
    for found, rise, after, before in (
        (moved.events.contacts, clearance, start, top),
        (moved.events.releases, clearance + height, start, top),
        (moved.events.returns, clearance - travel, top, moved.times[-1]),
    ):
        assert [e.choir for e in found] == [0]
        assert found[0].time == pytest.approx(reaches(drive, rise, after, before), abs=1e-9)


def test_an_ideal_fingers_force_is_the_models(ideal):
    """Inverse dynamics of analysis.model.key, except for damper and tongue."""
    moved, drive = ideal
    seen = observed(moved, RIG.key.press_arm).motions
    release = moved.events.releases[0].time
    lifted = when(moved, "the damper")[0]
    going = (seen.time > lifted) & (seen.time < release)
    time = seen.time[going]
    angle = planned(drive, time)
    force = finger_force(RIG, angle, seen.string_force[going])
    # The model's lever is the press arm; the finger's is at the contact point.
    centre = fingertip_motion(RIG.arm, drive.joints(time)).position
    lever = -centre[:, 0] * np.cos(angle.position) - centre[:, 1] * np.sin(angle.position)
    expected = force * RIG.key.press_arm / lever
    np.testing.assert_allclose(seen.finger_force[going], expected, rtol=1e-7)
    law = PluckLaw(choir_pluck(choirs(RIG)[0]))
    height = seen.rise[going] - RIG.jack.string_clearance
    string = [law.force(h) if h > 0 else 0.0 for h in height]
    np.testing.assert_allclose(seen.string_force[going], string, atol=1e-12)


def test_a_key_without_its_finger_moves_freely():
    """The finger rises faster than the key, and touches it again later."""
    rig = with_values(
        RIG, {"press.run_down_acceleration": "10 m/s^2", "press.run_down_jerk": "4000 m/s^3"}
    )
    moved = solve(rig, scene_of("ideal", **MUTE))
    left = when(moved, "the finger leaves the key")[0]
    contact = next(t for t in when(moved, "contact of finger and key") if t > left)
    between = [
        (s, now)
        for t, s, now in zip(moved.times, moved.states, moved.instants, strict=True)
        if left < t <= contact
    ]
    assert len(between) > 10
    for state, now in between:
        assert now.finger == 0
        assert state[0] >= now.contact.angle - 1e-12
    # In between, the free key decelerates by its own equation.
    above = RIG.key.dip / RIG.key.press_arm - 1e-9
    rows = [
        (s[0], s[1], now.acceleration)
        for s, now in between
        if s[1] > 1e-9 and s[0] < above and now.jacks[0].mode is JackMode.STANDS
    ]
    assert len(rows) > 10
    alone = finger_force(rig, Motion(*np.array(rows).T), np.zeros(len(rows)))
    np.testing.assert_allclose(alone, 0, atol=1e-12)


# The servo.


def test_the_arms_equation_is_the_trajectorys():
    random = np.random.default_rng(5)
    rig = with_values(
        RIG, {"arm.gear_ratios": [30, 20], "arm.rotor_inertias": ["1e-6 kg m^2", "2e-6 kg m^2"]}
    )
    linkage = Linkage(rig)
    for _ in range(20):
        q = np.array([random.uniform(-0.3, 0.6), random.uniform(-1.6, -0.9)])
        d, s = random.normal(size=2), random.normal(size=2)
        own = linkage.inertia(*q, *d)
        inertia = np.array([[own.m11, own.m12], [own.m12, own.m22]])
        expected = joint_torques(rig.arm, Motion(q, d, s))
        np.testing.assert_allclose(inertia @ s + [own.load1, own.load2], expected, rtol=1e-12)
        np.testing.assert_allclose(own.solve(*(inertia @ s)), s, rtol=1e-10)
        touch = linkage.key_under_fingertip(*q, *d)
        joints = Motion(*(np.array([v]) for v in (q, d, s)))
        centre = fingertip_motion(rig.arm, joints)
        key = key_under_fingertip(rig.key, rig.arm.fingertip_radius, centre)
        assert touch.angle == pytest.approx(key.position[0], rel=1e-12)
        assert touch.angular_velocity == pytest.approx(key.velocity[0], rel=1e-11)
        acceleration = touch.slope1 * s[0] + touch.slope2 * s[1] + touch.bias
        assert acceleration == pytest.approx(key.acceleration[0], rel=1e-10)


def sampled_states(solution, drive):
    """Return the states at the controller's samples, the one at 0 included."""
    times = np.array(solution.times)
    start = [0.0, 0.0, 0.0, 0.0, *drive.start, 0.0, 0.0]
    rows = np.searchsorted(times, np.arange(1, drive.samples + 1) * PERIOD - 1e-9)
    return np.vstack([start, np.array(solution.states)[rows]])


def test_the_motors_give_what_the_position_loops_say(paper):
    """The engine's position loops with the same encoder counts give the same torques."""
    solution, drive = paper
    loops = PositionLoops(scene_of("paper").servo, RIG.arm, PERIOD)
    loops.engage(drive.start)
    times = np.array(solution.times)
    for i, state in enumerate(sampled_states(solution, drive)[:-1]):
        torques = _play(loops, drive, i, state)
        segment = solution.segments[int(np.searchsorted(times, (i + 0.5) * PERIOD))]
        assert segment.torques == pytest.approx(torques, rel=1e-9, abs=1e-12)


def _play(loops, drive, sample, state):
    radians = 2 * math.pi / RIG.arm.counts_per_revolution
    counts, speeds = drive.reference(sample)(np.array([0.0, 1.0]))
    error = [counts[0, j] - round((state[4 + j] - drive.start[j]) / radians) for j in (0, 1)]
    spin = (speeds[1] - speeds[0]) * radians / PERIOD**2
    return loops.torque((float(error[0]), float(error[1])), (float(spin[0]), float(spin[1])))


def test_the_motors_work_is_energy_and_heat(paper):
    """From contact of finger and key to the release."""
    solution, _ = paper
    key, jack = RIG.key, RIG.jack
    times, states = np.array(solution.times), np.array(solution.states)
    first = int(np.searchsorted(times, when(solution, "contact of finger and key")[0] + 1e-6))
    last = int(np.argmin(abs(times - solution.events.releases[0].time)))
    legs = solution.segments
    work = 0.0
    for i in range(first + 1, last + 1):  # constant over a drive segment
        work += float(np.dot(legs[i].torques, states[i, 4:6] - states[i - 1, 4:6]))

    def stored(state):
        arm = key_oracle.arm_energy(RIG.arm, Motion(state[4:6], state[6:8], np.zeros(2)))
        return arm + key_oracle.energy(RIG, *state[:4])

    turned, lifted = states[last, 0] - states[first, 0], states[last, 2] - states[first, 2]
    heat = key.pivot_coulomb_friction * turned + jack.register_friction * lifted
    heat += key.pivot_viscous_friction * simpson(
        states[first : last + 1, 1] ** 2, x=times[first : last + 1]
    )
    pluck = choir_pluck(choirs(RIG)[0]).work
    change = stored(states[last]) - stored(states[first])
    assert work == pytest.approx(change + heat + pluck, abs=1e-9 * abs(work))


def test_a_multiplier_formulation_agrees(paper):
    """Joints and key as separate coordinates with a contact force, at another tolerance."""
    solution, drive = paper
    first = math.ceil(when(solution, "contact of finger and key")[0] / PERIOD)
    loops = PositionLoops(scene_of("paper").servo, RIG.arm, PERIOD)
    loops.engage(drive.start)
    rows = sampled_states(solution, drive)
    for i in range(first):
        _play(loops, drive, i, rows[i])
    state = rows[first]
    z = np.array([state[4], state[5], state[0], state[6], state[7], state[1]])
    pluck = choir_pluck(choirs(RIG)[0])
    release = solution.events.releases[0].time
    top = RIG.jack.string_clearance + pluck.release_height
    found = None
    for i in range(first, int(release / PERIOD) + 2):
        torques = _play(loops, drive, i, [0.0] * 4 + list(z[:2]))
        solver = LSODA(
            lambda t, y, torques=torques: _multiplied(y, torques, pluck),
            i * PERIOD, z, (i + 1) * PERIOD, rtol=1e-9, atol=1e-12,
        )  # fmt: skip
        while solver.status == "running" and found is None:
            solver.step()
            dense = solver.dense_output()

            def over(t, dense=dense):
                return float(rise_of_angle(RIG.key, dense(t)[2])) - top

            if over(solver.t) > 0:
                found = brentq(over, solver.t_old, solver.t, xtol=1e-14)
        z = solver.y
        if found is not None:
            break
        place = [z[2], z[5], z[0], z[1]]
        np.testing.assert_allclose(place, rows[i + 1][[0, 1, 4, 5]], rtol=0, atol=1e-7)
    assert found == pytest.approx(release, abs=1e-7)


def _multiplied(z, torques, pluck):
    """Solve M u = forces + G' force, G u = -G' v, with the contact's height g = 0 above the key."""
    key, jack, arm = RIG.key, RIG.jack, RIG.arm
    q, a, d, w = z[:2], z[2], z[3:5], z[5]
    joints = Motion(q, d, np.zeros(2))
    motion = fingertip_motion(arm, joints)
    slope = key_oracle.slope(key, a)
    bend = key_oracle.curvature(key, a) * w * w
    height = key_oracle.rise(key, a) - jack.string_clearance
    string = float(pluck.force_on_jack(np.array([height]))[0])
    load = jack.mass * (GRAVITY + bend) + string + jack.register_friction
    moment = key.gravity_moment - key.pivot_viscous_friction * w - key.pivot_coulomb_friction
    moment -= slope * load
    normal, tangent = np.array([-np.sin(a), np.cos(a)]), np.array([np.cos(a), np.sin(a)])
    total = q[0] + q[1]
    lower = arm.lower_length * np.array([-np.sin(total), np.cos(total)])
    upper = arm.upper_length * np.array([-np.sin(q[0]), np.cos(q[0])])
    row = np.array([normal @ (upper + lower), normal @ lower, -motion.position @ tangent])
    # d2/dt2 of C . n(a), without the accelerations.
    known = normal @ motion.acceleration - 2 * w * (tangent @ motion.velocity)
    known -= w * w * (normal @ motion.position)
    matrix = np.zeros((4, 4))
    matrix[:2, :2] = mass_matrix(arm, q)
    matrix[2, 2] = key.inertia + jack.mass * slope**2
    matrix[:3, 3], matrix[3, :3] = -row, row
    right = np.array([*(torques - joint_torques(arm, joints)), moment, -known])
    return np.concatenate([d, [w], np.linalg.solve(matrix, right)[:3]])


# Impacts and modes.


def bench(*jacks, dry=0.0, friction=0.0):
    laws = tuple(
        JackLaw(mass, friction, arm, 0.01, 1.0, None, 0.0, 0.0, 0.0, lift, stiffness)
        for mass, arm, lift, stiffness in jacks
    )
    return System("bench", 7e-4, 4e-3, 1e-4, dry, 0.171, math.inf, 1.0, 0.0, laws, None)


def test_a_landing_conserves_momentum():
    """A jack lands on a key that carries another jack, which then leaves the key."""
    system = bench((6e-3, 0.215, -math.inf, 0.0), (4e-3, 0.225, -math.inf, 0.0))
    a, w = 0.02, 1.0
    (y1, s1, _), (y2, s2, _) = (jack.kinematics(a) for jack in system.jacks)
    after = resolve_impacts(system, DriveSegment(0.0, 1.0), 0.0, [a, w, y1, -0.3, y2, s2 * w])
    expected = (7e-4 * w - 6e-3 * s1 * 0.3) / (7e-4 + 6e-3 * s1**2)
    assert after[1] == pytest.approx(expected, rel=1e-12)
    assert after[3] == pytest.approx(s1 * expected, rel=1e-12)
    assert after[5] == pytest.approx(s2 * w, rel=1e-12)
    # A key that rises against two resting jacks carries both.
    after = resolve_impacts(system, DriveSegment(0.0, 1.0), 0.0, [a, w, y1, 0.0, y2, 0.0])
    expected = 7e-4 * w / (7e-4 + 6e-3 * s1**2 + 4e-3 * s2**2)
    np.testing.assert_allclose(after[1::2], [expected, s1 * expected, s2 * expected], rtol=1e-12)


@pytest.mark.parametrize("seed", range(40))
def test_a_mode_is_the_one_of_least_constraint(seed):
    """Gauss's principle by its dual, a bounded least-squares problem, from rest."""
    random = np.random.default_rng(seed)
    masses, dampers = random.uniform(2e-3, 9e-3, 2), random.uniform(0, 60, 2)
    dry, friction = random.uniform(0, 3e-3), random.uniform(0, 0.06)
    system = bench(
        (masses[0], 0.215, 0.02, dampers[0]), (masses[1], 0.225, 0.02, dampers[1]),
        dry=dry, friction=friction,
    )  # fmt: skip
    a = 0.0 if seed % 3 == 0 else 0.03
    segment = DriveSegment(0.0, 1.0, moment=random.uniform(-0.03, 0.05))
    feet = [jack.kinematics(a) for jack in system.jacks]
    x = [a, 0.0, feet[0][0], 0.0, feet[1][0], 0.0]
    force_modes = ForceModes((StringMode.BELOW,) * 2, (True, True), Felt.OFF)
    equations = select_mode(system, segment, 0.0, x, force_modes)
    now = equations.at(0.0, x)
    mass = np.diag([system.inertia, *masses])
    forces = [segment.moment + system.gravity_moment]
    forces += [dampers[k] * (0.02 - feet[k][0]) - masses[k] * GRAVITY for k in (0, 1)]
    rows = np.array([
        [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 0], [-feet[0][1], 1, 0], [-feet[1][1], 0, 1]
    ])  # fmt: skip
    low = np.array([-dry, -friction, -friction, 0, 0, 0])
    high = np.array([dry, friction, friction, np.inf, np.inf, np.inf])
    if a > 0:  # off the rail
        rows, low, high = (np.delete(array, 3, axis=0) for array in (rows, low, high))
    root = np.diag(np.diag(mass) ** -0.5)
    dual = lsq_linear(root @ rows.T, -root @ forces, (low, high), method="bvls", tol=1e-15)
    expected = (forces + rows.T @ dual.x) / np.diag(mass)
    found = [now.acceleration, *(jack.acceleration for jack in now.jacks)]
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)


# Refused scenes, and extremes.


def test_a_modal_string_is_refused():
    with pytest.raises(SceneError, match=r'string = "modal".*set string = "spring"'):
        reference(RIG, scene_of("ideal", string="modal"))


def test_a_key_that_turns_over_is_refused():
    with pytest.raises(SceneError, match=r"has turned by 1.2 rad.*lower the push"):
        reference(RIG, pushed(90.0, 0.2, **BARE))


def test_an_arm_that_reaches_the_pin_is_refused():
    linkage = Linkage(with_values(RIG, {"arm.base_x": "-120 mm", "arm.base_z": "105 mm"}))
    with pytest.raises(SceneError, match="no angle gives a contact"):
        linkage.key_under_fingertip(0.0, -math.pi / 2, 0.0, 0.0)


def test_too_stiff_a_scene_is_refused(monkeypatch):
    monkeypatch.setattr("sautereau.sim_backend.physics.reference.integrate.MOST_STEPS", 500)
    with pytest.raises(SceneError, match=r"after 501 steps of 500 at most.*lower its stiffness"):
        reference(RIG, pushed(1.5, 0.1, truth={"key.pivot_viscous_friction": "1e4 N m s/rad"}))


@pytest.mark.parametrize("finger", [slow("push"), "ideal", "paper"])
def test_diverging_motion_is_refused(finger):
    truth = {"key.pivot_viscous_friction": "1e200 N m s/rad"}
    scene = pushed(1.5, 0.1, truth=truth) if finger == "push" else scene_of(finger, truth=truth)
    with pytest.raises(SceneError, match=r"diverged|stopped at|chatters"):
        reference(RIG, scene)


def test_a_reference_that_jumps_is_refused():
    """From 15 mm above the key into it."""
    drive = PressDrive(RIG, plan_press(RIG).segments)
    deep = drive.reference(LEAD + 150)
    usual = drive.reference
    drive.reference = lambda sample: usual(sample) if sample < 5 else deep
    with pytest.raises(SceneError, match=r"suddenly .* within the key.*reference jumps"):
        reference(RIG, scene_of("ideal"), drive)


EXTREMES = {
    "heavy": {"jack.mass": "60 kg"},
    "light": {"jack.mass": "2e-3 kg", "key.gravity_moment": "0 N m"},
    "hard felt": {"key.felt_stiffness": "20 MN/m"},
    "soft felt": {"key.felt_stiffness": "20 N/m"},
    "hard string": {"string.tension": "66.95 kN"},
    "hard plectrum": {"plectrum.youngs_modulus": "2900 GPa"},
    "soft plectrum": {"plectrum.youngs_modulus": "2.9 MPa"},
    "hard damper": {"jack.damper.stiffness": "15 kN/m"},
}


@pytest.mark.parametrize("name", EXTREMES)
@pytest.mark.parametrize("finger", ["push", slow("ideal"), slow("paper")])
def test_extremes_are_finite(finger, name):
    changes = {"truth": EXTREMES[name], "tongue": True, "damper": True}
    scene = pushed(1.5, 0.08, 0.02, **changes) if finger == "push" else scene_of(finger, **changes)
    moved = reference(RIG, scene)
    for values in vars(moved.motions).values():
        assert np.isfinite(values).all()
    assert np.all(np.diff(moved.motions.time) > 0)
    assert moved.motions.angle.min() >= -1e-14
    assert moved.motions.finger_force.min() >= -1e-9
    if name == "heavy" and finger != "ideal":
        assert moved.motions.angle.max() == 0
    if name in ("hard felt", "hard string", "soft plectrum"):
        assert len(moved.events.contacts) == len(moved.events.releases) == 1


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.005, 1.0])
@pytest.mark.parametrize("finger", ["ideal", "paper"])
def test_slowest_and_fastest_presses(finger, speed):
    """At 1 m/s, with raised limits of arm and planner."""
    changes = {"press.jack_speed": f"{speed} m/s"}
    if speed == 1.0:
        changes |= FAST
    rig = with_values(RIG, changes)
    scene = scene_of(finger)
    moved = reference(rig, scene)
    assert len(moved.events.contacts) == len(moved.events.releases) == 1
    assert all(np.isfinite(values).all() for values in vars(moved.motions).values())


FAST = {
    "press.run_up_acceleration": "2000 m/s^2", "press.run_up_jerk": "1e8 m/s^3",
    "press.run_down_acceleration": "2000 m/s^2", "press.run_down_jerk": "1e8 m/s^3",
    "arm.speed_limit": "100 rad/s", "arm.acceleration_limit": "1e6 rad/s^2",
    "arm.jerk_limit": "1e10 rad/s^3", "arm.torque_limit": "1000 N m",
}  # fmt: skip

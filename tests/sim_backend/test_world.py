"""The bench's physics, driven without any protocol, against model, closed forms and energy."""

import math

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.optimize import brentq

from analysis.model.key import finger_force
from analysis.model.predict import rig_pluck
from rig.load import load_rig, with_values
from rig.schema import GRAVITY
from sim_backend.errors import SceneError
from sim_backend.scene import load_scene
from sim_backend.servo import weight_torque
from sim_backend.world import Motions, World
from trajectory.arm import fingertip_motion
from trajectory.key import jack_motion, key_under_fingertip, rise_of_angle, rise_slope
from trajectory.motion import Motion
from trajectory.press import plan_press

RIG = load_rig("paper")
PERIOD = RIG.controller.sample_period
RADIANS = 2 * math.pi / RIG.arm.counts_per_revolution
PLAN = plan_press(RIG)
MUTE = {"plectrum": "none", "string": "none"}
LEAD = 20
"""Controller samples for which the arm stands before the plan begins."""
RUN_UP = LEAD + int(np.ceil(PLAN.law.start / PERIOD))
"""Controller samples until the fingertip leaves its rest."""
CRUISE = (0.0125, 0.114)
"""s from the run-up."""


class Player:
    """A planned press played into a world; nothing else is between planner and physics."""

    def __init__(self, scene="ideal", start=None, **changes):
        points = np.vstack([[0, 0], np.cumsum(PLAN.segments.steps, axis=0)]).astype(float)
        speeds = np.vstack([[0, 0], PLAN.segments.velocities]) * PERIOD
        ends = LEAD + np.concatenate([[0], np.cumsum(PLAN.segments.samples)])
        self.spline = CubicHermiteSpline(ends, points, speeds)
        self.ends = ends[0], ends[-1]
        self.start = (PLAN.segments.start if start is None else start) * RADIANS
        offset = tuple((self.start - np.array(RIG.arm.home_angles)).tolist())
        scene = load_scene(scene).model_copy(update={"start_offset": offset, **changes})
        self.world = World(RIG, scene)
        self.begun = 0

    def press(self, fractions):
        sample = self.world.samples - self.begun + fractions
        inside = np.clip(sample, *self.ends)
        moving = (sample >= self.ends[0]) & (sample < self.ends[1])
        return self.spline(inside), self.spline(inside, 1) * moving[:, None]

    def stand(self, fractions):
        return np.zeros((len(fractions), 2)), np.zeros((len(fractions), 2))

    def run(self, reference=None, samples=None, powered=True):
        """Advance; return what happened in one table."""
        samples = samples or int(self.ends[1]) + LEAD
        parts = [self.world.advance(reference or self.press, powered) for _ in range(samples)]
        names = ("time", "angle", "spin", "rise", "finger_force")
        return Motions(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))

    def planned(self, time):
        """Return the key's motion [rad] that the fingertip's path prescribes."""
        sample = np.clip(np.asarray(time) / PERIOD, *self.ends)
        joints = Motion(
            self.start + self.spline(sample) * RADIANS,
            self.spline(sample, 1) * RADIANS / PERIOD,
            self.spline(sample, 2) * RADIANS / PERIOD**2,
        )
        centre = fingertip_motion(RIG.arm, joints)
        return key_under_fingertip(RIG.key, RIG.arm.fingertip_radius, centre)

    def reaches(self, rise):
        """Return when the planned jack has come to a rise [m]."""

        def short(time):
            angle = self.planned(np.array([time])).position
            return float(rise_of_angle(RIG.key, angle)[0]) - rise

        return brentq(short, LEAD * PERIOD + 1e-3, LEAD * PERIOD + PLAN.law.bottom, xtol=1e-12)


def after_start(time):
    return time - RUN_UP * PERIOD


def in_cruise(time):
    return (after_start(time) > CRUISE[0]) & (after_start(time) < CRUISE[1])


@pytest.fixture(scope="module")
def ideal():
    player = Player("ideal")
    return player, player.run()


@pytest.fixture(scope="module")
def paper():
    player = Player("paper")
    return player, player.run()


# An ideal finger.


def test_the_key_follows_the_fingertip(ideal):
    player, happened = ideal
    planned = player.planned(happened.time)
    down = (after_start(happened.time) > 0.002) & (
        after_start(happened.time) < PLAN.law.bottom - PLAN.law.start
    )
    np.testing.assert_allclose(happened.angle[down], planned.position[down], atol=1e-6)
    settled = in_cruise(happened.time)
    np.testing.assert_allclose(happened.angle[settled], planned.position[settled], atol=2e-9)
    np.testing.assert_allclose(happened.spin[settled], planned.velocity[settled], atol=5e-5)


def test_the_jack_stands_on_the_key(ideal):
    _, happened = ideal
    np.testing.assert_allclose(happened.rise, rise_of_angle(RIG.key, happened.angle), atol=1e-6)


def test_contact_and_release_are_the_models(ideal):
    player, _ = ideal
    clearance = RIG.jack.string_clearance
    height = rig_pluck(RIG).release_height
    events = player.world.events
    assert len(events.contacts) == len(events.releases) == 1
    assert events.contacts[0] == pytest.approx(player.reaches(clearance), abs=1e-6)
    assert events.releases[0] == pytest.approx(player.reaches(clearance + height), abs=1e-6)
    assert events.releases[0] - events.contacts[0] == pytest.approx(0.020, rel=5e-3)


@pytest.mark.parametrize("step", [20e-6, 250e-6, 1e-3])
def test_contact_and_release_hardly_depend_on_the_step(step):
    player = Player("ideal", step=step)
    player.run(samples=RUN_UP + 70)
    clearance, height = RIG.jack.string_clearance, rig_pluck(RIG).release_height
    assert player.world.step <= step
    assert player.world.events.contacts == [pytest.approx(player.reaches(clearance), abs=20e-6)]
    assert player.world.events.releases == [
        pytest.approx(player.reaches(clearance + height), abs=20e-6)
    ]


def modelled_force(player, happened, rig=RIG):
    pluck = rig_pluck(rig)
    height = happened.rise - rig.jack.string_clearance
    released = player.world.events.releases or [0.0]
    string = pluck.force_on_jack(height) * (happened.time < released[0])
    return finger_force(rig, player.planned(happened.time), string)


def test_finger_force_is_the_models(ideal):
    player, happened = ideal
    expected = modelled_force(player, happened)
    cruise = in_cruise(happened.time)
    np.testing.assert_allclose(happened.finger_force[cruise], expected[cruise], rtol=0.01)
    error = (happened.finger_force - expected)[cruise]
    assert np.sqrt(np.mean(error**2)) < 1e-3 * expected[cruise].max()


def test_without_friction_the_force_is_the_models_without_friction():
    player = Player("ideal", friction=False)
    happened = player.run(samples=RUN_UP + 110)
    smooth = with_values(
        RIG,
        {
            "key.pivot_coulomb_friction": "0 N m",
            "key.pivot_viscous_friction": "0 N m s/rad",
            "jack.register_friction": "0 N",
        },
    )
    expected = modelled_force(player, happened, smooth)
    cruise = in_cruise(happened.time)
    np.testing.assert_allclose(happened.finger_force[cruise], expected[cruise], rtol=0.01)


def test_the_fingers_work_is_energy_and_heat(ideal):
    """Up to contact, to release and to the end of the cruise."""
    player, happened = ideal
    key, jack = RIG.key, RIG.jack
    power = happened.finger_force * key.press_arm * happened.spin
    speed = happened.spin * rise_slope(key, happened.angle)
    clearance, pluck = RIG.jack.string_clearance, rig_pluck(RIG)
    string = pluck.force_on_jack(happened.rise - clearance)
    string = string * (happened.time < player.world.events.releases[0])
    heat = (
        key.pivot_viscous_friction * happened.spin**2
        + key.pivot_coulomb_friction * np.abs(happened.spin)
        + jack.register_friction * np.abs(speed)
        + string * speed
    )
    stored = (
        key.inertia * happened.spin**2 / 2
        + jack.mass * speed**2 / 2
        + jack.mass * GRAVITY * happened.rise
        - key.front_heaviness * happened.angle
    )
    balance = np.cumsum(power - heat) * player.world.step - stored
    done = np.cumsum(power) * player.world.step
    for time in (
        *player.world.events.contacts,
        *player.world.events.releases,
        RUN_UP * PERIOD + 0.11,
    ):
        i = np.searchsorted(happened.time, time)
        assert balance[i] == pytest.approx(0, abs=0.01 * done[i])


def test_repetition_is_bit_identical(ideal):
    player, happened = ideal
    again = Player("ideal")
    repeated = again.run()
    for name in ("time", "angle", "spin", "rise", "finger_force"):
        np.testing.assert_array_equal(getattr(repeated, name), getattr(happened, name))
    assert again.world.events == player.world.events


def test_a_second_press_plucks_again():
    """The string is back in reach once the jack has come down."""
    player = Player("ideal")
    player.run()
    player.begun = player.world.samples
    player.run()
    events = player.world.events
    assert len(events.contacts) == len(events.releases) == 2
    apart = player.begun * PERIOD
    assert events.contacts[1] - events.contacts[0] == pytest.approx(apart, abs=2e-6)
    assert events.releases[1] - events.releases[0] == pytest.approx(apart, abs=2e-6)


def test_a_mute_scene_has_no_events():
    player = Player("ideal", **MUTE)
    happened = player.run(samples=RUN_UP + 110)
    assert player.world.events.contacts == player.world.events.releases == []
    expected = finger_force(RIG, player.planned(happened.time), np.zeros_like(happened.time))
    cruise = in_cruise(happened.time)
    np.testing.assert_allclose(happened.finger_force[cruise], expected[cruise], rtol=0.01)


def test_truth_changes_the_bench_and_not_the_plan():
    """A clearance of 2.5 mm that the rig does not know of."""
    player = Player("ideal", truth={"jack.string_clearance": "2.5 mm"})
    player.run(samples=RUN_UP + 110)
    assert player.world.events.contacts[0] == pytest.approx(player.reaches(2.5e-3), abs=1e-6)


def test_nothing_drifts(ideal, paper):
    """Pin, register and elbow hold to 1e-3 mm over the whole press."""
    for player, _ in (ideal, paper):
        key, jack = player.world.key, player.world.jack
        assert key.position.length < 1e-3
        assert jack.position.x == pytest.approx(RIG.key.jack_arm * 1e3, abs=1e-3)
        assert jack.angle == 0
    finger = paper[0].world.finger
    elbow = finger.upper.local_to_world((RIG.arm.upper_length * 500, 0))
    assert elbow.get_distance(finger.lower.local_to_world((-RIG.arm.lower_length * 500, 0))) < 1e-3
    base = finger.upper.local_to_world((-RIG.arm.upper_length * 500, 0))
    assert base.get_distance((RIG.arm.base_x * 1e3, RIG.arm.base_z * 1e3)) < 1e-3


# Key, jack and felt alone.


@pytest.mark.parametrize("scene", ["ideal", "paper"])
def test_a_key_at_rest_stays_at_rest(scene):
    player = Player(scene, start=PLAN.hover)
    happened = player.run(player.stand, samples=300)
    np.testing.assert_allclose(happened.angle, 0, atol=1e-7)
    np.testing.assert_allclose(happened.rise, 0, atol=1e-7)
    np.testing.assert_array_equal(happened.finger_force, 0)
    assert player.world.events.contacts == []


def let_go(**changes):
    """Press a mute key, and take the finger away at the bottom; return what happens then."""
    player = Player("ideal", friction=False, **MUTE, **changes)
    player.run(samples=RUN_UP + int(0.19 / PERIOD))
    away = PLAN.hover - PLAN.segments.start

    def aside(fractions):
        return np.tile(away.astype(float), (len(fractions), 1)), np.zeros((len(fractions), 2))

    began = player.world.time
    happened = player.run(aside, samples=200)
    return player, happened, happened.time - began


def test_the_jack_falls_freely_when_the_key_drops_away():
    """A back-heavy key falls faster than the jack: both then fall by themselves."""
    moment = -0.05
    player, happened, time = let_go(truth={"key.front_heaviness": f"{moment} N m"})
    key = RIG.key
    falling = moment / key.inertia
    assert key.jack_arm * abs(falling) > 1.5 * GRAVITY
    air = (time > 1e-3) & (time < 0.03)
    lag = player.world.step / 2 + 1e-6
    bottom = happened.rise[0]
    jack = bottom - GRAVITY * time**2 / 2
    np.testing.assert_allclose(happened.rise[air], jack[air], atol=2e-5 + GRAVITY * 0.03 * lag)
    top = happened.angle[0]
    expected = top + falling * time**2 / 2
    np.testing.assert_allclose(
        happened.angle[air], expected[air], atol=2e-4 + abs(falling) * 0.03 * lag
    )
    speed = np.gradient(happened.rise, time)
    np.testing.assert_allclose(np.polyfit(time[air], speed[air], 1)[0], -GRAVITY, rtol=1e-3)


def test_key_and_jack_fall_back_together():
    """(I + m b^2) a'' = -(m g b - front heaviness) where a is small, and no energy is lost."""
    _, happened, time = let_go()
    key, jack = RIG.key, RIG.jack
    begun = time < 0.02
    inertia = key.inertia + jack.mass * key.jack_arm**2
    expected = -(jack.mass * GRAVITY * key.jack_arm - key.front_heaviness) / inertia
    assert 2 * np.polyfit(time[begun], happened.angle[begun], 2)[0] == pytest.approx(
        expected, rel=5e-3
    )
    np.testing.assert_allclose(happened.rise, rise_of_angle(key, happened.angle), atol=2e-6)
    speed = happened.spin * rise_slope(key, happened.angle)
    energy = (
        key.inertia * happened.spin**2 / 2
        + jack.mass * speed**2 / 2
        + jack.mass * GRAVITY * happened.rise
        - key.front_heaviness * happened.angle
    )
    falls = np.cumsum(happened.angle < 0.002) == 0
    np.testing.assert_allclose(energy[falls], energy[0], rtol=0.01)
    # The back rail stops it without a bounce; a step's way is how far it sinks in.
    assert happened.angle[~falls].max() < 0.002
    assert happened.angle[time > 0.15] == pytest.approx(0, abs=1e-5)
    assert happened.angle.min() > -1.5 * abs(happened.spin).max() * 1e-4


def test_the_felt_stops_the_finger_at_the_bottom():
    """A dip of 7 mm that the plan does not know of: its spring through the press arm."""
    dip = 7e-3
    player = Player("ideal", friction=False, truth={"key.dip": "7 mm"}, **MUTE)
    happened = player.run(samples=RUN_UP + int(0.195 / PERIOD))
    key = RIG.key
    angle = happened.angle[-1]
    depth = angle - dip / key.press_arm
    assert depth > 0
    still = Motion(*(np.array([v]) for v in (angle, 0.0, 0.0)))
    weight = finger_force(RIG, still, np.zeros(1))[0]
    felt = key.felt_stiffness * key.press_arm * depth
    assert happened.finger_force[-1] == pytest.approx(weight + felt, rel=1e-3)
    without = Player("ideal", friction=False, felt=False, truth={"key.dip": "7 mm"}, **MUTE)
    bare = without.run(samples=RUN_UP + int(0.195 / PERIOD))
    assert bare.finger_force[-1] == pytest.approx(weight, rel=1e-3)


def test_numbers_that_run_away_are_an_error():
    """A friction far past the step's limit of stability: told, with time and step."""
    player = Player("paper", truth={"key.pivot_viscous_friction": "100 N m s/rad"})
    with pytest.raises(
        SceneError, match=r"lost its numbers at .* s with steps of 97\.66 us; lower"
    ):
        player.run()


def test_the_clock_is_counted_not_summed():
    player = Player("ideal", start=PLAN.hover, **MUTE)
    happened = player.run(player.stand, samples=1024)
    assert player.world.time == 1.0
    assert happened.time[-1] == pytest.approx(1.0, abs=1e-12)
    assert np.all(np.diff(happened.time) > 0)


# The servo.


def test_the_jack_slows_while_the_string_is_held(paper):
    """By 10 to 30 % of its speed, and by less than that before."""
    player, happened = paper
    contact, release = player.world.events.contacts[0], player.world.events.releases[0]
    speed = happened.spin * rise_slope(RIG.key, happened.angle)

    def mean(start, end):
        return speed[(happened.time > start) & (happened.time < end)].mean()

    before = mean(contact - 3e-3, contact)
    assert before == pytest.approx(0.072, rel=0.1)
    assert 0.10 < 1 - mean(release - 2e-3, release) / before < 0.30
    free = mean(contact - 10e-3, contact - 5e-3)
    assert abs(before / free - 1) < 0.10


def test_the_servos_press_comes_to_the_same_end(paper):
    player, happened = paper
    planned = player.planned(happened.time)
    at_bottom = np.searchsorted(happened.time, LEAD * PERIOD + PLAN.law.return_start)
    assert happened.angle[at_bottom] == pytest.approx(planned.position[at_bottom], abs=3e-4)
    assert len(player.world.events.contacts) == len(player.world.events.releases) == 1


def test_the_servos_finger_pushes_as_the_model_says(paper):
    """Inverse dynamics of the motion that really was, smoothed over a millisecond."""
    player, happened = paper
    acceleration = np.gradient(happened.spin, happened.time)
    angle = Motion(happened.angle, happened.spin, acceleration)
    pluck = rig_pluck(RIG)
    string = pluck.force_on_jack(happened.rise - RIG.jack.string_clearance)
    release = player.world.events.releases[0]
    string = string * (happened.time < release)
    expected = finger_force(RIG, angle, string)
    smooth = np.full(10, 0.1)
    error = np.convolve(happened.finger_force - expected, smooth, "same")
    held = (happened.time > player.world.events.contacts[0]) & (happened.time < release - 2e-3)
    assert np.sqrt(np.mean(error[held] ** 2)) < 0.02 * expected[held].max()


@pytest.mark.parametrize("powered", [True, False])
def test_a_standing_arm_is_held(powered):
    player = Player("paper", start=PLAN.hover)
    before = player.world.finger.joints()
    player.run(player.stand, samples=500, powered=powered)
    after = player.world.finger.joints()
    np.testing.assert_allclose(after, before, atol=10 * RADIANS)
    assert player.world.finger.settled
    expected = weight_torque(RIG.arm, before) if powered else (0.0, 0.0)
    np.testing.assert_allclose(player.world.finger.torques(), expected, atol=5e-3)


def stepped(counts):
    player = Player("paper", start=PLAN.hover)
    player.run(player.stand, samples=20)
    jump = np.array([counts, -counts], float)

    def reference(fractions):
        return np.tile(jump, (len(fractions), 1)), np.zeros((len(fractions), 2))

    joints, torques = [], []
    for _ in range(1500):
        player.world.advance(reference, True)
        joints.append(player.world.finger.joints())
        torques.append(player.world.finger.torques())
    return (np.array(joints) - player.start) / RADIANS / jump, np.array(torques), player


def test_a_step_settles():
    """1 mrad: not wild on the way, and there within a second and a half."""
    response, torques, player = stepped(318)
    assert np.abs(torques).max() < RIG.arm.torque_limit
    assert response.min() > -0.5
    assert response.max() < 2
    late = response[1000:]
    np.testing.assert_allclose(late, 1, atol=0.05)
    assert np.ptp(late[:250], axis=0).max() >= np.ptp(late[250:], axis=0).max()
    assert player.world.finger.settled


def test_a_step_past_the_torque_limit_is_held_to_it():
    """0.1 rad asks for more than the amplifiers give."""
    response, torques, _ = stepped(31_831)
    assert np.abs(torques).max() == pytest.approx(RIG.arm.torque_limit, rel=1e-12)
    assert np.isfinite(response).all()
    np.testing.assert_allclose(response[1200:], 1, atol=0.05)


def test_the_jacks_motion_is_the_keys_in_closed_form(ideal):
    """Rise from the world, speed from the trajectory's own law: two ways to the same motion."""
    player, happened = ideal
    jack = jack_motion(RIG.key, player.planned(happened.time))
    cruise = in_cruise(happened.time)
    np.testing.assert_allclose(happened.rise[cruise], jack.position[cruise], atol=1e-7)
    slope = np.polyfit(happened.time[cruise], happened.rise[cruise], 1)[0]
    assert slope == pytest.approx(PLAN.cruise.speed, rel=1e-3)

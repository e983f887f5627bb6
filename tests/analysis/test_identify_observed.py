"""Input of a fit: signals smoothed alike, and excluded where the model is not valid."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.independent import Conditions
from benchmarks.independent import press as simulated
from benchmarks.simulated import judged_press
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.elastic import CLOTH_STD, Mode, mode_parameters
from sautereau.analysis.identify.fit import inverse_dynamics
from sautereau.analysis.identify.observed import MIN_INSTANTS, landing, observed
from sautereau.analysis.identify.parameters import CLOTH, FORCE, MODULUS, NAMES, hidden, parameters
from sautereau.analysis.identify.residuals import InverseDynamics
from sautereau.analysis.model.key import finger_force
from sautereau.analysis.phases import find_phases
from sautereau.daq.file.recorded import Joints
from sautereau.daq.signals.quality_flags import QualityFlag
from sautereau.rig.load import load_rig
from sautereau.trajectory.arm import joints_holding_point
from sautereau.trajectory.key import surface_axes
from sautereau.trajectory.motion import Motion


@pytest.fixture(scope="module")
def press(make_press):
    return make_press(until=0.25)


@pytest.fixture(scope="module")
def taken(press):
    return observed(press, find_phases(press))


def oscillating(press, rate):
    """Return a press whose force is the model's own, of an oscillating key without friction."""
    rig = press.rig
    rig = rig.replaced(
        {
            "key.pivot_coulomb_friction": 0.0,
            "key.dip": 1.0,
            "key.inertia": 8e-4,
            "jack.register_friction": 0.0,
        }
    )
    time = np.arange(round(0.4 * rate)) / rate
    swing, omega = 0.02, 2 * np.pi * 20
    motion = Motion(
        swing * (1 - np.cos(omega * time)),
        swing * omega * np.sin(omega * time),
        swing * omega**2 * np.cos(omega * time),
    )
    force = finger_force(rig, motion, np.zeros_like(time))
    samples = {
        "velocity": motion.velocity * rig.key.laser_arm,
        "force": force,
        "angle": motion.position,
        "jack_rise": motion.position * rig.key.jack_arm,
        "jack_speed": motion.velocity * rig.key.jack_arm,
    }
    return replace(press, rig=rig, time=time, samples=samples, rate=rate), force


@pytest.mark.parametrize("rate", [10e3, 25.6e3, 51.2e3, 102.4e3])
def test_the_residual_of_an_oscillating_key_is_zero(press, rate):
    """Force and acceleration are smoothed by the same window, which therefore cancels."""
    swinging, force = oscillating(press, rate)
    phases = replace(find_phases(press), plucks=())
    taken = observed(swinging, phases)
    dynamics = InverseDynamics(
        swinging.rig, parameters(swinging.rig, ["key.inertia"]), [taken], "elastica"
    )
    (residual,), rises = dynamics.residuals(np.array([swinging.rig.key.inertia]))
    assert len(rises) == 0
    assert np.abs(residual).max() < 1e-4 * np.abs(force).max()


def test_captured_joints_give_the_lever_of_a_finger_that_slides(press):
    swinging, force = oscillating(press, 51.2e3)
    key, arm = swinging.rig.key, swinging.rig.arm
    slide = 1e-3 * np.sin(2 * np.pi * 5 * swinging.time) ** 2  # m, from 0
    tangent, normal = surface_axes(swinging.samples["angle"])
    along, above = slide - key.press_arm, key.surface_height + arm.fingertip_radius
    centre = along[:, None] * tangent + above * normal
    still = np.zeros_like(centre)
    angles = joints_holding_point(arm, Motion(centre, still, still)).position
    lever = 1 - slide / key.press_arm
    samples = {**swinging.samples, "force": force / lever}
    slid = replace(swinging, samples=samples, joints=Joints(swinging.time, *angles.T))
    phases, free = replace(find_phases(press), plucks=()), parameters(press.rig, ["key.inertia"])

    def left(pressed):
        dynamics = InverseDynamics(pressed.rig, free, [observed(pressed, phases)], "elastica")
        (residual,), _ = dynamics.residuals(np.array([pressed.rig.key.inertia]))
        return np.abs(residual).max() / np.abs(force).max()

    assert left(slid) < 1e-4
    assert left(replace(slid, joints=None)) > 4e-3


def test_instants_outside_the_model_are_excluded(press, taken):
    assert taken.used.sum() > MIN_INSTANTS
    (release,) = taken.releases
    assert release == pytest.approx(0.072, abs=1e-4)
    assert np.abs(taken.time[taken.used] - release).min() > 2.5e-3
    travel = press.rig.key.press_arm * taken.motion.position[taken.used]
    assert travel.max() < press.rig.key.dip
    assert np.all(taken.motion.velocity[taken.used] > 0)
    assert taken.release_stds[0] >= 1e-6


def test_flagged_samples_are_excluded(press):
    phases = find_phases(press)
    gap = QualityFlag("drop-out", "velocity", 0.100, 0.102)
    taken = observed(replace(press, quality_flags=(gap,)), phases)
    inside = (taken.time > 0.099) & (taken.time < 0.103)
    assert not taken.used[inside].any()
    assert taken.used[taken.time > 0.105].any()
    # An AC-coupled force has another level after clipped samples: the longer part is fitted.
    for start, kept in ((0.100, taken.time > 0.101), (0.165, taken.time < 0.165)):
        clipped = QualityFlag("clipped", "force", start, start + 1e-3)
        parted = observed(replace(press, quality_flags=(clipped,)), phases)
        assert parted.used[kept].any()
        assert not (parted.used & ~kept).any()


def test_a_press_of_nothing_is_refused(press):
    still = dict.fromkeys(press.samples, np.zeros(len(press.time)))
    with pytest.raises(AnalysisError, match="check whether the key was pressed"):
        observed(replace(press, samples=still), replace(find_phases(press), plucks=()))


@pytest.mark.parametrize("modes", [[], mode_parameters(0, Mode(150.0, 0.05, 0.3, -0.6, -0.5, 0.1))])
def test_a_residual_does_not_depend_on_what_was_computed_before(press, modes):
    """Strings and modes are kept from point to point, for all parameters that leave them as is."""
    names = [name for name in NAMES if name not in (FORCE, MODULUS)]
    dynamics = inverse_dynamics([press], [find_phases(press)], names)
    cloth = hidden(CLOTH, 0.0, CLOTH_STD, (0.0, 10 * CLOTH_STD), "m/N")
    free = [*dynamics.free, *([cloth, *modes] if modes else [])]
    dynamics = dynamics.with_free(free)
    point = np.array([p.start for p in free])
    before, _ = dynamics.residuals(point)
    for number, parameter in enumerate(free):
        moved = point.copy()
        moved[number] += 1e-2 * parameter.scale(parameter.start)
        forces, rises = dynamics.residuals(moved)
        fresh = dynamics.with_free(free).residuals(moved)
        np.testing.assert_array_equal(forces, fresh[0], err_msg=parameter.name)
        np.testing.assert_array_equal(rises, fresh[1], err_msg=parameter.name)
    np.testing.assert_array_equal(dynamics.residuals(point)[0], before)


def test_a_press_until_an_instant_has_the_same_residuals_up_to_it(press):
    phases = find_phases(press)
    dynamics = inverse_dynamics([press], [phases], ["key.inertia"])
    taken = dynamics.presses[0]
    end = int(np.searchsorted(taken.time, phases.plucks[0].release))
    until = InverseDynamics(dynamics.rig, dynamics.free, [taken.until(end)], "elastica")
    point = np.array([p.start for p in dynamics.free])
    forces = dynamics.residuals(point)[0][0]
    count = np.count_nonzero(taken.used[:end])
    np.testing.assert_allclose(until.residuals(point)[0][0], forces[:count], rtol=0, atol=1e-12)


def test_presses_of_different_lengths_are_fitted_as_each_alone(press):
    phases = find_phases(press)
    shorter = replace(
        press,
        time=press.time[:-500],
        samples={name: values[:-500] for name, values in press.samples.items()},
    )
    dynamics = inverse_dynamics([press, shorter], [phases, phases], ["key.inertia"])
    point = np.array([p.start for p in dynamics.free])
    for alone, forces in zip((press, shorter), dynamics.residuals(point)[0], strict=True):
        own = inverse_dynamics([alone], [phases], ["key.inertia"])
        np.testing.assert_allclose(own.residuals(point)[0][0], forces, rtol=0, atol=1e-12)


def test_a_thrown_jack_lands_after_its_ballistic_flight():
    """A key that stops at a speed v of its jack gets it back after 2 v / g."""
    key, speed, stop = load_rig().key, 0.15, 0.02
    time = np.arange(0, 0.1, 1e-5)
    rate, halt = speed / key.jack_arm, 5e-4
    velocity = rate * np.clip((stop - time) / (2 * halt) + 0.5, 0, 1)
    slope = np.where(np.abs(time - stop) < halt, -rate / (2 * halt), 0.0)
    motion = Motion(np.cumsum(velocity) * 1e-5, velocity, slope)
    found = landing(key, time, motion, contact=1.0)
    assert found == pytest.approx(stop + 2 * speed / 9.81, abs=1.5e-3)
    assert landing(key, time, motion, contact=stop / 2) is None


@pytest.mark.parametrize("speed", [0.072, 0.118])
def test_a_key_that_the_finger_has_lost_is_not_fitted(speed):
    """At the end of these presses it flies on: below 15 mN the transducer feels its own mass."""
    pressed = simulated(replace(Conditions(), speed=speed, return_speed=0.04), 0)
    made = judged_press(pressed)
    phases = find_phases(made)
    taken = observed(made, phases)
    force = np.interp(taken.time, pressed.times, pressed.truth.force)
    down = (taken.time > phases.plucks[0].release) & (taken.motion.velocity > 0)
    assert np.sum(down & (force < 15e-3)) > 20
    assert not np.any(taken.used & down & (force < 15e-3))
    assert np.sum(taken.used & down) > MIN_INSTANTS

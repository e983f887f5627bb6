"""Elastic modes in the identification: their response, and fits of the independent simulator."""

from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks.identify import FREE, RESULTS, one_factor_case
from benchmarks.independent import FORCE, press
from benchmarks.simulated import judged_press
from benchmarks.uncertain import NOMINAL, inertia_of, recorded
from sautereau.analysis.identify.compliant import compliant
from sautereau.analysis.identify.elastic import Mode, bending, driven, mode_parameters, noise_gain
from sautereau.analysis.identify.fit import inverse_dynamics
from sautereau.analysis.identify.identified import identify
from sautereau.analysis.identify.parameters import (
    FINGERTIP,
    FORCE_GAIN,
    VELOCITY_GAIN,
    value_of,
)
from sautereau.analysis.phases import find_phases
from sautereau.analysis.results.fit import Fit

ARM, INERTIA = 0.17, 8e-4
STATED = {"inertia": 7e-4, "coulomb": 1e-3}  # What the rigs say of the fitted numbers


def test_a_mode_follows_its_equation_from_its_state_at_the_lift():
    mode = Mode(180.0, 0.03, 1.4, -0.6, -0.8, cosine=0.1, sine=-0.05)
    time = np.arange(-100, 500) / 8e3
    finger = 0.3 * np.sin(2 * np.pi * 25 * np.clip(time, 0, 0.02)) ** 2
    strings = 0.02 * np.clip(time / 0.03, 0, 1) ** 2
    press = Mock(substep_time=time, lift_off=0.0, step=1 / 8e3, substep_force=lambda _: finger)
    angle, rise = bending(
        [mode], INERTIA, driven([mode], press, 0.0, 1.0, ARM), strings, press.step
    )
    turn = 2 * np.pi * mode.frequency

    def push(t):
        at = np.interp(t, time, finger), np.interp(t, time, strings)
        return (ARM * at[0] - mode.jack_by_finger * at[1]) / (INERTIA * turn**2)

    def equation(t, y):
        return [y[1], turn**2 * (push(t) - y[0]) - 2 * mode.damping * turn * y[1]]

    # At the lift the ringing is that of the complex pole.
    pole = turn * complex(-mode.damping, np.sqrt(1 - mode.damping**2))
    state = complex(mode.cosine, -mode.sine) * ARM / (INERTIA * turn**2)
    start = [state.real, (pole * state).real]
    after = time >= 0
    solved = solve_ivp(
        equation, (0, time[-1]), start, t_eval=time[after], rtol=1e-9, atol=1e-15, max_step=5e-4
    )
    scale = np.abs(solved.y[0]).max()
    found = angle[0][after][1:] / mode.weight
    np.testing.assert_allclose(found, solved.y[0][1:], atol=5e-3 * scale)
    np.testing.assert_allclose(rise, angle[0] * mode.jack_by_laser, atol=1e-12)
    rate = np.gradient(angle[0][after][1:], time[1] - time[0])
    np.testing.assert_allclose(angle[1][after][2:-1], rate[1:-1], atol=0.01 * np.abs(rate).max())


def test_noise_of_the_force_is_amplified_by_its_mobile_modes():
    """Far above its frequency a mode of weight r adds r times the force; far below, nothing."""
    assert noise_gain([], 0.1) == 1
    assert noise_gain([Mode(1e5, 0.05, 2.0, -0.6, -0.6)], 0.1) == pytest.approx(1, abs=1e-3)
    assert noise_gain([Mode(0.1, 0.9, 2.0, -0.6, -0.6)], 1e9) == pytest.approx(3, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "frequency"), [("key bends at 350 Hz", 179.0), ("key heaves at 120 Hz", 110.0)]
)
def test_plectrum_and_inertia_are_identified_on_a_compliant_key(name, frequency):
    """Frequencies are those of the key with its jack and the mass in front of the transducer."""
    pressed, phases, truth = one_factor_case(name)
    found = identify(pressed, phases, FREE, starts=1)
    assert found.quality.fits
    assert found.modes
    assert min(abs(mode.frequency / frequency - 1) for mode in found.modes) < 0.1
    for estimate in found.estimates:
        assert estimate.rig_value == value_of(pressed[0].rig, estimate.name)
        if estimate.name in RESULTS:
            # Three presses do not determine the plectrum to 5 %.
            assert estimate.name == "key.inertia" or not estimate.identifiable
            assert estimate.low < truth[estimate.name] < estimate.high
            assert estimate.value == pytest.approx(truth[estimate.name], rel=0.05)


@pytest.mark.parametrize(
    ("wrong", "force", "named"),
    [
        ({}, {"delay_error": 0.5e-3}, "offset.time: the fit, 0.49"),
        ({}, {"drift": 50e-3, "high_pass": 0.0}, "offset.force"),
        ({"press_arm": 0.88 * NOMINAL.press_arm}, {"high_pass": 0.0}, "key.press_arm"),
    ],
)
def test_a_wrong_calibration_or_lever_is_named_and_taken_for_no_mode(wrong, force, named):
    """Each left a residual of four times the noise, which up to three modes explained."""
    made = replace(NOMINAL, force=replace(FORCE, **force), **wrong)
    pressed, phases = recorded(made, range(1, 3), {}, **STATED)
    found = identify(pressed, phases, FREE, starts=1)
    assert found.modes == ()
    assert not found.quality.fits
    assert named in found.quality.reasons[0]
    assert "elastic modes" in found.quality.reasons[-1]
    text = str(Fit(pressed[0].rig, False, (), None, found))
    assert ("nothing is suggested" in text) == (not found.suggested)
    estimates = {e.name: e for e in found.estimates}
    choir = made.choirs[0]
    truth = choir.bending_stiffness, choir.overlap, inertia_of(made)
    for name, value in zip(RESULTS, truth, strict=True):
        assert abs(estimates[name].value - value) < 3 * estimates[name].std
    if "offset" in named:  # freed as the message says
        right = identify(pressed, phases, [*FREE, named.partition(":")[0]], starts=1)
        assert right.quality.fits
        assert right.modes == ()


def test_a_tapered_plectrum_is_taken_for_no_mode_and_its_shape_named():
    """The rig says that it is uniform: two modes explained what only the held string leaves."""
    choir = replace(NOMINAL.choirs[0], carving=((0.0, 1.0), (1.0, 0.5)))
    made = replace(NOMINAL, choirs=(choir,), force=replace(FORCE, high_pass=0.0), speed=0.03)
    pressed, _ = recorded(made, range(1, 4), {}, **STATED)
    pressed = [replace(p, rig=p.rig.replaced({"plectrum.outline": None})) for p in pressed]
    found = identify(pressed, [find_phases(p) for p in pressed], FREE, starts=1)
    assert not found.quality.fits
    assert found.modes == ()
    assert "shape of the plectrum" in found.quality.reasons[0]


def test_presses_of_two_plectra_are_named():
    """A mode explained their forces, and left their releases 7 standard uncertainties apart."""
    pressed = []
    for factor in (1.0, 0.75):
        choir = NOMINAL.choirs[0]
        choir = replace(choir, modulus=factor * choir.modulus, modulus_factor=factor)
        made = replace(NOMINAL, choirs=(choir,), speed=0.05)
        pressed += recorded(made, range(1, 3), {}, **STATED)[0]
    pressed = [replace(p, rig=pressed[0].rig) for p in pressed]
    found = identify(pressed, [find_phases(p) for p in pressed], FREE, starts=1)
    assert not found.quality.fits
    assert "presses of one plectrum" in found.quality.reasons[0]


def test_friction_of_the_fingertip_acts_like_a_gain_of_the_force_before_the_release():
    """In the weights of the residuals and the bending of the key as well."""
    made = compliant(inverse_dynamics(*recorded(NOMINAL, range(1, 2), {}, **STATED), FREE))
    assert made is not None
    mode = mode_parameters(0, Mode(200.0, 0.05, 0.5, -0.6, -0.6))
    made = made.with_free([*made.free, *mode])
    names, start = [p.name for p in made.free], np.array([p.start for p in made.free])
    rubbing, gained, key = start.copy(), start.copy(), made.rig.key
    rubbing[names.index(FINGERTIP)] = 0.3
    gained[names.index(FORCE_GAIN)] = 1 + 0.3 * key.surface_height / key.press_arm
    residuals = made.joined(rubbing)
    assert residuals == pytest.approx(made.joined(gained), abs=1e-9)
    assert np.abs(residuals - made.joined(start)).max() > 1e-3


def test_a_gain_does_not_move_the_key_onto_its_felt():
    """Its force was a kink of the residual, at which a gain stuck, with hardly an uncertainty."""
    made = inverse_dynamics(*recorded(NOMINAL, range(1, 2), {}, **STATED), FREE)
    point = np.array([p.start * (1.2 if p.name == VELOCITY_GAIN else 1.0) for p in made.free])
    deep = made.on(made.rig.replaced({"key.dip": 20e-3}))
    assert made.joined(point) == pytest.approx(deep.joined(point), abs=1e-12)


def test_a_friction_of_the_register_stated_too_large_is_found():
    """No friction of the pivot fits: the gain of the force took up the rest."""
    choir = replace(NOMINAL.choirs[0], register_friction=8e-3)
    made = replace(NOMINAL, choirs=(choir,), return_speed=0.04, speed=0.05)
    pressed, phases = recorded(made, range(1, 3), {}, **STATED)
    found = identify(pressed, phases, FREE, starts=1)
    assert found.quality.fits
    (register,) = (e for e in found.also_fitted if e.name == "jack.register_friction")
    dry = made.pivot_coulomb + choir.register_friction * choir.arm
    values = {e.name: e.value for e in found.estimates}
    fitted = values["key.pivot_coulomb_friction"] + register.value * choir.arm
    assert fitted == pytest.approx(dry, rel=0.2)
    assert values["key.inertia"] == pytest.approx(inertia_of(made), rel=0.02)
    text = str(Fit(pressed[0].rig, False, (), None, found))
    assert "rig: 20 mN, without a range" in text
    assert "key.press_arm, 171 mm without a range, counts as exact" in text


@pytest.mark.slow
@pytest.mark.parametrize("fall", [0.0, 4e-3])
def test_a_force_that_falls_slowly_before_the_release_does_not_fit(fall):
    """The force of a worn tip falls within 4 ms, and the overlap was 17 % too small."""
    made = []
    for seed in (1, 2):
        one = press(NOMINAL, seed)
        end = one.truth.plucks[0].release
        part = np.clip((one.times - end) / fall + 1, 0.0, 1.0) if fall else np.zeros(len(one.times))
        lost = one.truth.load[0] * part**2 * (3 - 2 * part) * NOMINAL.choirs[0].arm
        volts = one.force_volts - lost / NOMINAL.press_arm / NOMINAL.force.scale
        made.append(judged_press(replace(one, force_volts=volts), {"plectrum.contact": "surface"}))
    phases = [find_phases(p) for p in made]
    found = identify(made, phases, FREE, starts=1)
    assert found.quality.fits == (fall == 0)
    if fall:
        assert "at once on a rigid key" in found.quality.reasons[0]
    doubted = str(Fit(made[0].rig, False, (), None, found, warned=(True, True)))
    assert doubted.index("doubtful in 2 of 2 presses") < doubted.index(found.quality.verdict)


@pytest.mark.slow
def test_a_fit_with_modes_says_that_no_rigid_key_fits():
    pressed, phases, _ = one_factor_case("soft pad")
    found = identify(pressed, phases, FREE, starts=1)
    assert found.quality.fits
    text = str(Fit(found.rig, False, (), None, found))
    assert "no rigid key fits, with other delays" in text

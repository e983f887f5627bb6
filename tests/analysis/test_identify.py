"""Fits to presses of a bench that differs from its rig by known amounts."""

from dataclasses import replace

import numpy as np
import pytest

import sautereau as st
from benchmarks.identify import FREE, measured
from benchmarks.simulated import sensed
from benchmarks.spinet import SPINET
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.compliant import before_release
from sautereau.analysis.identify.fit import fit, inverse_dynamics, refined
from sautereau.analysis.identify.identified import evaluate, identify, profile
from sautereau.analysis.identify.observed import observed
from sautereau.analysis.identify.parameters import Prior, rig_values, value_of, with_parameters
from sautereau.analysis.identify.residuals import InverseDynamics
from sautereau.analysis.loading.press import load_press
from sautereau.analysis.model.predict import predict
from sautereau.analysis.phases import find_phases
from sautereau.analysis.results.fit import Fit
from sautereau.analysis.session.analysed import jack_speeds
from sautereau.analysis.session.compare import compare
from sautereau.rig.load import load_rig, with_values
from sautereau.rig.text import rig_text
from sautereau.sim_backend.physics.observation import observe
from sautereau.sim_backend.scene import load_scene
from tests.presses import with_data

TRUTH = {
    "plectrum.youngs_modulus": "2.2 GPa",
    "plectrum.overlap": "0.34 mm",
    "key.inertia": "8.6e-4 kg m^2",
    "key.pivot_coulomb_friction": "1.4 mN m",
}


@pytest.fixture(scope="module")
def rig():
    return measured(load_rig())


@pytest.fixture(scope="module")
def scene():
    return load_scene("paper").model_copy(update={"truth": TRUTH})


@pytest.fixture(scope="module")
def true(rig, scene):
    return scene.true_rig(rig)


@pytest.fixture(scope="module")
def five(rig, scene):
    """Five noisy presses of one motion, and their phases."""
    seen = observe(rig, scene)
    pressed = [sensed(rig, scene, seen, seed)[0] for seed in range(5)]
    return pressed, [find_phases(press) for press in pressed]


@pytest.fixture(scope="module")
def two(five):
    """The first two of them, which are quicker to fit."""
    return [part[:2] for part in five]


@pytest.fixture(scope="module")
def made(two):
    return refined(fit(inverse_dynamics(*two, FREE), 1))


@pytest.fixture(scope="module")
def found(made):
    return evaluate(made)


def shown(found):
    """Return the result of an identification as its readers get it."""
    return Fit(found.rig, True, (), None, found)


def free_key(rig, seed=0):
    """Return a press of a key without strings, and its phases."""
    scene = load_scene("paper").model_copy(update={"plectrum": "none", "string": "none"})
    press = sensed(rig, scene, observe(rig, scene), seed)[0]
    return press, find_phases(press)


def by_name(found):
    return {e.name: e for e in found.estimates}


@pytest.mark.slow
@pytest.mark.parametrize(("strings", "softer"), [(1, 1), (1, 3), (2, 1), (2, 3)])
def test_the_plectrums_friction_is_found_by_a_finger_that_yields_along_the_key(
    tmp_path, strings, softer
):
    rig = load_rig() if strings == 1 else SPINET
    rig = with_values(rig, {"plectrum.contact": "surface", "plectrum.friction": 0.1})
    scene = load_scene("paper")
    servo = {
        "stiffness": tuple(value / softer for value in scene.servo.stiffness),
        "damping": tuple(value / softer**0.5 for value in scene.servo.damping),
    }
    scene = scene.model_copy(update={"servo": scene.servo.model_copy(update=servo)})
    with st.stand_in(rig, scene=scene, seed=1) as bench:
        bench.press(2, out=tmp_path, warm_up=0)
    presses = [load_press(path) for path in sorted(tmp_path.glob("press-*.mcap"))]
    rig = rig.model_copy(update={"assumed": {}})
    presses = [replace(press, rig=rig) for press in presses]
    names = ["plectrum.youngs_modulus", "plectrum.friction", "plectrum.overlap"]
    found = by_name(identify(presses, list(map(find_phases, presses)), names, starts=1))
    for name in names:
        assert abs(found[name].value - value_of(rig, name)) < 2.6 * found[name].std, name
    assert found["plectrum.friction"].std < 0.01


@pytest.mark.slow
def test_the_noise_of_the_acceleration_does_not_make_a_slow_keys_inertia_small():
    """An ideal finger accelerates it for 3 ms of run-up and 15 ms of run-down only."""
    rig = SPINET.model_copy(update={"more_choirs": (), "assumed": {}})
    scene = load_scene("paper").model_copy(update={"finger": "ideal", "servo": None})
    seen = observe(rig, scene)
    presses = [sensed(rig, scene, seen, seed)[0] for seed in range(8)]
    phases = list(map(find_phases, presses))
    names = ["key.inertia", "key.pivot_coulomb_friction", "key.pivot_viscous_friction"]
    found = []
    for pair in (slice(k, k + 2) for k in range(0, 8, 2)):
        fitted = by_name(identify(presses[pair], phases[pair], names, starts=1))
        found.append([(fitted[n].value - value_of(rig, n)) / fitted[n].std for n in names])
    assert np.abs(np.mean(found, axis=0)).max() < 1.3  # 2.6 standard errors of the mean of four
    assert np.abs(found).max() < 2.6


def test_plectrum_inertia_and_friction_are_identified_from_two_noisy_presses(found, true):
    assert [e.name for e in found.estimates] == list(FREE)
    assert found.quality.fits
    assert not found.suggested
    for estimate in found.estimates:
        # A gain of force of 1 % is one of 3 % in the dry friction, and that is its uncertainty.
        assert estimate.identifiable == (estimate.name != "key.pivot_coulomb_friction")
        assert not estimate.at_bound
        if estimate.identifiable:
            assert estimate.value == pytest.approx(value_of(true, estimate.name), rel=0.03)
        assert estimate.low < value_of(true, estimate.name) < estimate.high
    assert found.residual < found.residual_before / 5
    assert np.allclose(np.diag(found.correlation), 1)
    assert np.abs(found.correlation).max() <= 1 + 1e-9
    assert not found.warnings


def test_a_fit_that_starts_elsewhere_reports_the_values_of_the_rig(made, rig):
    """As the fit of a compliant key, which starts from that of a rigid one."""
    problem = made.problem
    moved = [replace(p, start=(p.start + p.high) / 2) for p in problem.dynamics.free]
    elsewhere = replace(problem, dynamics=problem.dynamics.with_free(moved))
    for estimate in evaluate(replace(made, problem=elsewhere)).estimates:
        assert estimate.rig_value == value_of(rig, estimate.name)


def test_the_residual_before_is_that_of_the_rig_and_of_the_fitted_samples(made):
    """As on a compliant key, whose fit starts elsewhere and ends with the first release."""
    problem = made.problem
    whole = problem.dynamics
    moved = [replace(p, start=(p.start + p.high) / 2) for p in whole.free]
    cut, _ = before_release(whole.presses)
    before = [
        fit(InverseDynamics(whole.rig, free, cut, whole.level), 1).residual_before
        for free in (whole.free, moved)
    ]
    assert before[1] == pytest.approx(before[0], rel=0.05)
    assert before[0] != pytest.approx(made.residual_before, rel=0.2)


def test_results_for_a_string_on_the_mid_line_state_what_the_surface_would_change(found):
    """The friction of the plectrum imitates the surface, so that no residual may show it."""
    assert "plectrum.overlap by" in found.contact_warning
    surface = with_values(found.rig, {"plectrum.contact": "surface"})
    assert replace(found, rig=surface).contact_warning is None


def test_the_slope_error_falls_from_tens_of_per_cent_to_under_three(two, found, rig):
    pressed, phases = two
    speeds = [jack_speeds(*each)[0] for each in zip(pressed, phases, strict=True)]
    before, after = (
        compare(phases, [predict(r, speed=speed) for speed in speeds]).slope_error.value
        for r in (rig, found.rig)
    )
    assert before > 0.15
    assert abs(after) < 0.03


@pytest.mark.slow
def test_the_profile_of_an_identifiable_parameter_is_a_parabola(made, found):
    estimate = by_name(found)["plectrum.overlap"]
    drawn = profile(made, found, "plectrum.overlap")
    assert drawn.low == pytest.approx(estimate.low, abs=0.1 * estimate.std)
    assert drawn.high == pytest.approx(estimate.high, abs=0.1 * estimate.std)
    middle = int(np.argmin(drawn.rises))
    assert np.all(np.diff(drawn.rises[middle:]) > 0)
    with pytest.raises(AnalysisError, match=r"jack\.mass: it was not fitted"):
        profile(made, found, "jack.mass")


def test_a_picture_shows_every_part(made, found):
    figure = Fit(made.problem.dynamics.rig, True, (), made, found).plot()
    assert "SIMULATED" in figure.get_suptitle()
    labels = {label for axes in figure.axes for label in axes.get_legend_handles_labels()[1]}
    assert {"recorded", "model before", "model fitted"} <= labels


def test_every_written_value_has_its_source_and_without_values_nothing_is_written(
    made, found, rig, tmp_path
):
    """Also a value that the rig states without a source."""
    plain = rig.model_copy(update={"sources": {}, "assumed": {}})
    fitted = Fit(plain, True, (), made, found)
    written, edited, none = (tmp_path / name for name in ("new.toml", "old.toml", "none.toml"))
    edited.write_text(rig_text(plain))
    for path in (written, edited):
        fitted.write(path)
        sources = load_rig(path).sources
        assert {"plectrum.overlap", "key.inertia"} <= set(fitted.values) <= set(sources)
        assert set(sources) == set(load_rig(path).assumed)
        assert all(text.startswith("identified from SIMULATED ") for text in sources.values())
        overlap = next(e for e in found.estimates if e.name == "plectrum.overlap")
        assert load_rig(path).plectrum.overlap == pytest.approx(overlap.value, abs=overlap.std / 20)
    replace(fitted, found=replace(found, estimates=())).write(none)
    assert not none.exists()


def test_a_written_friction_has_no_range_and_quantities_have_units_and_digits_of_rig_files(
    made, found, tmp_path
):
    """A rig file refuses a range of a number without a unit."""
    overlap = next(e for e in found.estimates if e.name == "plectrum.overlap")
    values = {"name": "plectrum.friction", "unit": ""}
    rubbing = replace(overlap, value=0.09512345, std=0.004, **values)
    overlap = replace(overlap, value=0.33412345e-3, std=4.2e-6)
    free = [replace(p, low=0.0, high=0.5, **values) for p in made.problem.free[:1]]
    dynamics = made.problem.dynamics.with_free([*made.problem.free, *free])
    fitted = Fit(
        *(found.rig, True, (), replace(made, problem=replace(made.problem, dynamics=dynamics))),
        replace(found, estimates=(overlap, rubbing), also_fitted=()),
    )
    fitted.write(tmp_path / "rig.toml")
    text = (tmp_path / "rig.toml").read_text()
    assert 'overlap = {value = "0.3341 mm"' in text
    assert 'assumed = ["0.3268 mm", "0.3414 mm"]' in text
    assert "friction = {value = 0.0951, source" in text


@pytest.mark.slow
def test_two_frictions_with_the_same_effect_are_not_identifiable(two):
    """Dry friction of pivot and register differ by the lever of the jack, which hardly changes."""
    found = identify(*two, [*FREE, "jack.register_friction"], starts=1)
    estimates = by_name(found)
    assert estimates["plectrum.overlap"].identifiable
    assert not estimates["key.pivot_coulomb_friction"].identifiable
    *_, worst = found.combinations
    assert not worst.identifiable
    assert found.combinations[0].identifiable
    assert abs(worst.weights["key.pivot_coulomb_friction"]) > 0.5
    text = str(shown(found))
    assert "not all parameters are identifiable" in text
    assert "not identifiable from these recordings" in text


@pytest.mark.slow
def test_a_weight_that_only_shifts_the_force_is_undetermined(two):
    """The level of an AC-coupled force is unknown, and the gravity moment only changes it."""
    pressed, phases = two
    found = identify(pressed[:1], phases[:1], ["key.gravity_moment", *FREE], starts=1)
    unseen = by_name(found)["key.gravity_moment"]
    assert (unseen.std, unseen.low, unseen.high, unseen.identifiable) == (None, None, None, False)
    assert found.combinations[-1].std is None
    assert by_name(found)["key.inertia"].identifiable
    assert by_name(found)["key.inertia"].measurements == ()
    assert unseen.measurements == ()
    assert "no single measurement would change this" in str(shown(found))
    summary = shown(found).document
    assert summary["parameters"]["key.gravity_moment"]["ci95"] is None
    assert summary["identifiable"]["all"] is False


def test_a_prior_determines_what_the_data_do_not(two, true):
    pressed, prior = [replace(press, rig=true) for press in two[0]], Prior(mean=6e-3, std=1e-3)
    names = ["key.gravity_moment"]
    found = identify(pressed, two[1], names, {"key.gravity_moment": prior}, starts=1)
    (estimate,) = found.estimates
    assert estimate.value == pytest.approx(6e-3, rel=1e-3)
    assert estimate.std == pytest.approx(1e-3, rel=1e-3)
    assert not estimate.identifiable
    assert estimate.unaided is None
    certain = replace(estimate, std=estimate.needed / 2)
    text = str(shown(replace(found, estimates=(certain,))))
    assert "is needed, and without its own prior it is undetermined" in text


def test_a_parameter_at_a_bound_gives_a_warning(two):
    prior = Prior(low=4e-4, high=7.5e-4)
    dynamics = inverse_dynamics(*two, ["key.inertia"], {"key.inertia": prior})
    found = evaluate(refined(fit(dynamics, 1)))
    (estimate,) = found.estimates
    assert estimate.at_bound
    assert estimate.value == pytest.approx(7.5e-4, rel=1e-6)
    assert any("key.inertia: the fit reached a bound" in warning for warning in found.warnings)


def test_a_friction_of_0_is_no_reason_to_widen_a_range(two):
    """The plectrum is softer than the rig's, which no friction imitates."""
    found = evaluate(refined(fit(inverse_dynamics(*two, ["plectrum.friction"]), 1)))
    (text,) = (each for each in found.warnings if "reached a bound at 0, of 0 to 0.5" in each)
    assert "no lower one" in text
    assert "widen" not in text


@pytest.mark.slow
def test_a_delay_of_the_force_is_found(two):
    press, phases = (part[0] for part in two)
    data = press.data.copy()
    data["force"] = np.interp(data.index - 0.2e-3, data.index, data["force"])
    late = with_data(press, data)
    names = [*FREE, "offset.time"]
    on_time = by_name(identify([press], [phases], names, starts=1))["offset.time"].value
    found = identify([late], [find_phases(late)], names, starts=1)
    assert by_name(found)["offset.time"].value - on_time == pytest.approx(0.2e-3, abs=10e-6)
    values = rig_values(found.rig, {"offset.time": 0.2e-3})
    assert values == {"daq.channels.0.delay": f"{1.1e-3 - 0.2e-3!r} s"}


@pytest.mark.slow
def test_without_a_pluck_the_key_is_identifiable_and_the_plectrum_is_not(rig):
    # The friction of the pivot must be known as well.
    press, phases = free_key(rig.model_copy(update={"assumed": {}}))
    found = identify([press], [phases], ["key.inertia", "plectrum.overlap"], starts=1)
    estimates = by_name(found)
    assert estimates["key.inertia"].identifiable
    assert estimates["key.inertia"].value == pytest.approx(rig.key.inertia, rel=0.03)
    assert estimates["plectrum.overlap"].std is None
    assert found.rise_residual is None
    assert any("no press has a pluck" in warning for warning in found.warnings)


def test_noise_alone_is_refused(rig):
    press, _ = free_key(rig)
    random = np.random.default_rng(1)
    data = press.data.copy()
    data["force"] = 5e-3 * random.standard_normal(len(data))
    data["velocity"] = 5e-5 * random.standard_normal(len(data))
    for name in ("angle", "deflection", "jack_rise", "jack_speed"):
        data[name] = 0.0
    still = with_data(press, data)
    with pytest.raises(AnalysisError, match=r"the key moves freely in only .*, and 20 are needed"):
        identify([still], [find_phases(still)], ["key.inertia"], starts=1)


def test_samples_that_are_not_numbers_and_no_press_are_refused(two):
    pressed, phases = two
    data = pressed[0].data.copy()
    data.iloc[100, 0] = np.nan
    with pytest.raises(AnalysisError, match="not finite numbers"):
        identify([with_data(pressed[0], data)], phases[:1], ["key.inertia"])
    with pytest.raises(AnalysisError, match="there is no press to fit"):
        identify([], [], ["key.inertia"])


def test_a_press_that_cannot_be_fitted_is_omitted_with_a_warning(two, true):
    """The result is that of the other press alone."""
    (press, other), phases = [replace(press, rig=true) for press in two[0]], two[1]
    still = dict.fromkeys(press.samples, np.zeros(len(press.time)))
    still = replace(press, samples=still)
    found = identify([still, other], phases, ["key.inertia"], starts=1)
    alone = identify([other], phases[1:], ["key.inertia"], starts=1)
    (warning,) = set(found.warnings) - set(alone.warnings)
    assert warning.startswith(f"not fitted: press {still.path}: the key moves freely in only 0")
    assert found.presses == alone.presses
    assert found.estimates == alone.estimates


def test_a_press_that_is_too_short_before_its_release_is_named(two):
    """A compliant key is fitted before its release only."""
    long, short = (observed(press, found) for press, found in zip(*two, strict=True))
    late = short.used & (short.time > short.releases[0])
    usable, faults = before_release([long, replace(short, used=late)])
    assert [press.name for press in usable] == [long.name]
    assert faults == [
        f"press {short.name}: the key moves freely in only 0 steps of 0.5 ms before its first"
        " release, and 20 are needed; on a compliant key, press more slowly"
    ]
    assert before_release([long])[1] == []


def test_presses_of_different_instruments_are_refused(two):
    pressed, phases = two
    other = with_parameters(pressed[0].rig, {"plectrum.overlap": 0.3e-3})
    mixed = [pressed[0], replace(pressed[1], path=pressed[1].path, rig=other)]
    with pytest.raises(AnalysisError, match=r"its plectrum differ.* from those of"):
        identify(mixed, phases, ["key.inertia"])


@pytest.mark.slow
def test_a_robust_fit_is_less_affected_by_a_disturbance(two, true):
    pressed, phases = two
    data = pressed[0].data.copy()
    data.loc[0.370:0.372, "force"] += 0.1
    known = {name: value_of(true, name) for name in FREE[:2]}
    rig = with_parameters(pressed[0].rig, known)
    broken = [with_data(pressed[0], data, rig=rig), replace(pressed[1], rig=rig)]
    plain = refined(fit(inverse_dynamics(broken, phases, FREE[2:]), 1)).values[:2]
    robust = [e.value for e in identify(broken, phases, FREE[2:], starts=1, robust=True).estimates]
    expected = np.array([value_of(true, name) for name in FREE[2:]])
    disturbed, error = (np.abs(found / expected - 1).max() for found in (plain, np.array(robust)))
    assert error < 0.1
    assert error < disturbed


@pytest.mark.slow
def test_friction_that_the_rig_does_not_know_is_suggested_and_then_fits(rig):
    """Friction of 0.15 makes the overlap a fifth too large, with residuals of 2 mN."""
    truth = TRUTH | {"plectrum.friction": 0.15}
    scene = load_scene("paper").model_copy(update={"truth": truth})
    seen = observe(rig, scene)
    pressed = [sensed(rig, scene, seen, seed)[0] for seed in range(2)]
    phases, true = [find_phases(press) for press in pressed], scene.true_rig(rig)
    wrong = identify(pressed, phases, FREE, starts=1)
    assert not wrong.quality.fits
    assert all(e.low is None and e.std for e in wrong.estimates)
    assert by_name(wrong)["plectrum.overlap"].value > 1.1 * true.plectrum.overlap
    friction = next(s for s in wrong.suggested if s.name == "plectrum.friction")
    assert friction.value == pytest.approx(0.15, abs=0.08)
    text = str(shown(wrong))
    assert "THE MODEL DOES NOT FIT" in text
    assert "suggested: free plectrum.friction" in text
    assert shown(wrong).document["fits"] is False
    right = identify(pressed, phases, [*FREE, "plectrum.friction"], starts=1)
    assert right.quality.fits
    assert right.suggested == ()
    for name in FREE[:3]:
        assert by_name(right)[name].value == pytest.approx(value_of(true, name), rel=0.05)
    assert by_name(right)["plectrum.friction"].value == pytest.approx(0.15, abs=0.02)


@pytest.mark.slow
def test_a_little_friction_is_found_unasked_where_the_string_lies_on_the_surface():
    """Friction of 0.035 hides in the noise, and made the overlap 8 % too large."""
    rig = with_values(measured(load_rig()), {"plectrum.contact": "surface"})
    truth = TRUTH | {"plectrum.contact": "surface", "plectrum.friction": 0.035}
    scene = load_scene("paper").model_copy(update={"truth": truth, "step": 50e-6})
    press, _ = sensed(rig, scene, observe(rig, scene), 0)
    made = identify([press], [find_phases(press)], FREE, starts=1)
    assert made.quality.fits
    assert [e.name for e in made.estimates] == [*FREE, "plectrum.friction"]
    for name in (*FREE[:3], "plectrum.friction"):
        estimate = by_name(made)[name]
        assert estimate.identifiable
        assert estimate.low < value_of(scene.true_rig(rig), name) < estimate.high
    assert by_name(made)["plectrum.overlap"].value == pytest.approx(0.34e-3, rel=0.05)
    assert made.rig.plectrum.friction == by_name(made)["plectrum.friction"].value
    effects = shown(made).document["sensitivity"]["key.press_arm"]["effects"]
    assert set(effects) == set(by_name(made))


def test_the_intervals_contain_the_calibrations_and_the_table_shows_each(two, found):
    """A gain of force is one of inertia and of friction; twice its uncertainty widens both."""
    pressed, phases = two
    table = {s.name: s for s in found.sensitivity}
    gain = table["offset.force_gain"]
    assert gain.effects["key.inertia"] == pytest.approx(gain.change, rel=0.5)
    assert gain.stated
    # Dry friction of the register at its arm is dry friction of the pivot.
    register = table["jack.register_friction"].effects["key.pivot_coulomb_friction"]
    pivot = by_name(found)["key.pivot_coulomb_friction"].value
    change = table["jack.register_friction"].change
    assert register == pytest.approx(-change * 0.215 / pivot, rel=0.05)
    assert table["plectrum.friction"].effects["plectrum.overlap"] < -0.05
    channels = tuple(
        c.model_copy(update={"gain_std": 10 * c.gain_std}) for c in pressed[0].rig.daq.channels
    )
    rough = [replace(p, rig=p.rig.replaced({"daq.channels": channels})) for p in pressed]
    wider = by_name(identify(rough, phases, FREE, starts=1))
    for name in FREE[:3]:
        assert wider[name].std > 1.2 * by_name(found)[name].std
    text = "\n".join(shown(found).lines(every=True))
    assert "offset.velocity_gain" in text
    assert "plectrum.contact" in text
    assert "(* its standard uncertainty)" in " ".join(text.split())
    assert set(shown(found).document["sensitivity"]) == set(table)


@pytest.mark.slow
def test_gains_and_lags_within_their_uncertainties_keep_the_results(two, true):
    """A gain of -1 % made EI 5 % too large; now it is part of the interval."""
    pressed, _ = two
    shifted = []
    for press in pressed:
        data = press.data.copy()
        data[["velocity", "angle", "deflection", "jack_rise", "jack_speed"]] *= 0.99
        data["force"] = np.interp(data.index - 20e-6, data.index, data["force"])
        shifted.append(with_data(press, data))
    found = by_name(identify(shifted, [find_phases(p) for p in shifted], FREE, starts=1))
    for name in FREE[:3]:
        estimate, value = found[name], value_of(true, name)
        assert estimate.low < value < estimate.high
        assert estimate.value == pytest.approx(value, rel=0.05)


@pytest.mark.slow
def test_a_string_on_the_surface_of_a_rig_with_the_mid_line_is_suggested(rig):
    truth = TRUTH | {"plectrum.contact": "surface"}
    scene = load_scene("paper").model_copy(update={"truth": truth})
    press, _ = sensed(rig, scene, observe(rig, scene), 0)
    wrong = identify([press], [find_phases(press)], FREE, starts=1)
    assert not wrong.quality.fits
    assert wrong.suggested[0].name == "plectrum.contact"
    assert 'suggested: set plectrum.contact = "surface"' in str(shown(wrong))


@pytest.mark.slow
def test_one_press_is_enough_and_five_are_more_certain(five, rig, true):
    """If the friction of the register is known, which the pivot's resembles."""
    known = rig.assumed | {"jack.register_friction": (19.9e-3, 20.1e-3)}
    pressed = [replace(p, rig=rig.model_copy(update={"assumed": known})) for p in five[0]]
    phases = five[1]
    one = identify(pressed[:1], phases[:1], FREE, starts=1)
    all_five = identify(pressed, phases, FREE, starts=1)
    for alone, together in zip(one.estimates, all_five.estimates, strict=True):
        assert alone.value == pytest.approx(value_of(true, alone.name), rel=0.05)
        assert together.value == pytest.approx(value_of(true, alone.name), rel=0.03)
        assert alone.std > together.std

"""Contact and release in presses with known instants."""

import numpy as np
import pytest

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.figures.phases import phases_figure
from sautereau.analysis.loading.presses import first_press
from sautereau.analysis.phases import find_phases
from sautereau.analysis.phases.release import find_falls
from sautereau.analysis.phases.rows import Rows
from sautereau.analysis.results.press import press_summary
from tests.budget import slow
from tests.plots import texts
from tests.presses import with_data

CONTACT, RELEASE = 0.052, 0.072
LAG = 1 / (2 * np.pi * 22e3)
NOISY = {"force_noise": 5e-3, "velocity_noise": 5e-5, "hum": 1e-3}
RATES = [10e3, 20e3, 51.2e3, 100e3, 200e3]


def only_pluck(press):
    phases = find_phases(press)
    assert len(phases.plucks) == 1
    return phases.plucks[0], phases


def assert_finite(phases):
    numbers = [phases.start, phases.bottom, phases.free_speed]
    numbers += [v for v in (phases.held_speed, phases.released_speed) if v is not None]
    for held in phases.plucks:
        numbers += [value for name, value in vars(held).items() if name != "string"]
        assert held.contact_std > 0
        assert held.contact < held.release
    assert np.isfinite(numbers).all()


def cut(press, rows):
    return with_data(press, press.data.iloc[rows])


@pytest.mark.parametrize("rate", RATES)
def test_a_clean_press_is_known_to_a_sample(make_press, rate):
    held, phases = only_pluck(make_press(rate=rate))
    # The string's force is straight, and that of the rig's plectrum is not.
    assert held.contact == pytest.approx(CONTACT, abs=0.3 / rate)
    assert held.release == pytest.approx(RELEASE, abs=0.7 / rate)
    # Sampling, a delay of the low-pass that the calibration may omit, and the two delays' own.
    known = np.hypot(np.hypot(1 / rate, 2 * LAG) / np.sqrt(12), 20e-6 * np.sqrt(2))
    assert known * (1 - 1e-9) <= held.release_std < 1.3 * known
    assert held.pluck_duration == pytest.approx(0.020, abs=0.7 / rate)
    assert held.contact_force == pytest.approx(0.33, abs=1e-3)
    assert held.release_force == pytest.approx(0.33 + 27 * 0.02, abs=27 / rate)
    assert held.force_drop == pytest.approx(27 * 0.02, abs=2 * 27 / rate)
    assert phases.start == pytest.approx(0.030, abs=2e-6)
    assert phases.free_speed == pytest.approx(0.072, rel=1e-4)
    assert phases.held_speed == pytest.approx(0.072, rel=1e-4)
    assert phases.released_speed == pytest.approx(0.072, rel=1e-4)
    assert not phases.warnings


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("seed", range(2))
def test_a_noisy_press(make_press, rate, seed):
    held, phases = only_pluck(make_press(rate=rate, seed=seed, **NOISY))
    limit = 0.3e-3 if rate > 20e3 else 0.5e-3
    assert held.contact == pytest.approx(CONTACT, abs=limit)
    assert held.release == pytest.approx(RELEASE, abs=max(0.1e-3, 1 / rate))
    assert held.force_drop == pytest.approx(0.54, abs=0.02)
    assert phases.free_speed == pytest.approx(0.072, rel=1e-3)
    assert_finite(phases)


@pytest.mark.parametrize(
    ("slope", "limit"), [(5, 1.0e-3), (10, 0.5e-3), (50, 0.1e-3), (200, 0.03e-3)]
)
def test_weak_and_strong_strings(make_press, slope, limit):
    held, _ = only_pluck(make_press(slope=slope, **NOISY))
    assert held.contact == pytest.approx(CONTACT, abs=limit)
    assert held.release == pytest.approx(RELEASE, abs=0.1e-3)
    on_deflection = slope / (0.072 * 82 / 215)
    assert held.force_slope == pytest.approx(on_deflection, rel=0.02)


@pytest.mark.parametrize("curvature", [-500.0, 300.0, 1000.0])
def test_a_force_that_bends(make_press, curvature):
    """Regression: with a first guess outside the search, contact was half a millisecond late."""
    held, _ = only_pluck(make_press(slope=20, curvature=curvature))
    assert held.contact == pytest.approx(CONTACT, abs=1e-5)
    errors = [
        only_pluck(make_press(slope=20, curvature=curvature, seed=seed, **NOISY))[0].contact
        - CONTACT
        for seed in range(8)
    ]
    assert abs(np.mean(errors)) < 0.1e-3


@pytest.mark.parametrize(
    ("speed", "contact", "release", "slope", "rate"),
    [
        (0.005, 0.5, 0.9, 1.25, 51.2e3),
        (0.02, 0.12, 0.19, 7, 51.2e3),
        (0.072, 0.052, 0.072, 27, 51.2e3),
        (0.15, 0.043, 0.053, 50, 51.2e3),
        (0.3, 0.039, 0.044, 100, 51.2e3),
        (1.0, 0.0335, 0.0365, 167, 51.2e3),
        (1.0, 0.0335, 0.0365, 167, 200e3),
    ],
)
def test_speeds(make_press, speed, contact, release, slope, rate):
    times = {"contact": contact, "release": release, "until": release + 0.5}
    held, phases = only_pluck(make_press(speed=speed, slope=slope, rate=rate, **times, **NOISY))
    assert held.contact == pytest.approx(contact, abs=max(0.1e-3, 3 * held.contact_std))
    assert held.contact == pytest.approx(contact, abs=0.6e-3)
    assert held.release == pytest.approx(release, abs=0.1e-3)
    if speed < 1.0:  # which has its contact in the run-up
        assert phases.free_speed == pytest.approx(speed, rel=0.01)
        assert phases.held_speed == pytest.approx(speed, rel=0.01)


@pytest.mark.parametrize(
    ("before", "peak"), [(0.0, 0.0), (0.0, 0.1), (0.12, 0.0), (0.12, 0.1), (0.2, 0.0), (0.2, 0.1)]
)
def test_the_press_of_the_papers_figure_7(make_press, paper, before, peak):
    """The force increases before contact, has a peak there, and diminishes after the release.

    The jack is slower while the string is held, by up to a sixth.
    """
    random, rate = np.random.default_rng(1), 51_200.0
    time = np.arange(round(0.35 * rate)) / rate
    start, contact, release, end = 0.05, 0.077, 0.097, 0.19
    inside = [time < start, time < contact, time < release, time < end]
    speed = np.select(inside, [0, 0.072, 0.060, 0.070], 0)
    window = np.hanning(round(6e-3 * rate))
    speed = np.convolve(speed, window / window.sum(), "same")
    load = before * np.clip((time - start) / (contact - start), 0, None)  # springs and cloth
    load += np.where((time > contact) & (time < release), 17.5 * (time - contact), 0)
    load += peak * np.exp(-0.5 * ((time - contact) / 0.8e-3) ** 2)
    load *= np.where(time < release, 1, np.exp(-(time - release) / 0.05))
    arm, inertia = paper.key.jack_arm, paper.key.inertia + paper.jack.mass * paper.key.jack_arm**2
    force = load + inertia / paper.key.press_arm * np.gradient(speed / arm, 1 / rate)
    velocity = speed * paper.key.laser_arm / arm
    noises = (5e-5 * random.standard_normal(len(time)), 5e-3 * random.standard_normal(len(time)))
    held, phases = only_pluck(make_press.build(velocity + noises[0], force + noises[1], rate))
    assert held.contact == pytest.approx(contact, abs=0.4e-3)
    assert held.release == pytest.approx(release, abs=0.1e-3)
    assert not held.doubtful
    assert not phases.warnings


@pytest.mark.parametrize(
    "change",
    [
        {"slope": 30, "curvature": -400},
        *(slow(change) for change in ({}, {"slope": 10}, {"rate": 10e3}, {"rate": 100e3})),
    ],
)
def test_the_uncertainty_agrees_with_repeated_presses(make_press, change):
    """Their errors in units of the standard uncertainty have an rms of about 1."""
    presses = (make_press(seed=seed, **{**NOISY, "hum": 0.0, **change}) for seed in range(30))
    held = [only_pluck(press)[0] for press in presses]
    scores = [(h.contact - CONTACT) / h.contact_std for h in held]
    assert 0.5 < np.sqrt(np.mean(np.square(scores))) < 1.4
    errors = [h.contact - CONTACT for h in held]
    bias = 0.5 * held[0].contact_std  # by the curvature that the rig's model expects
    assert abs(np.mean(errors)) < 3 * np.std(errors) / np.sqrt(30) + bias


@pytest.mark.parametrize("noise", [{}, NOISY, {"force_noise": 0.05}, {"hum": 0.02}])
def test_a_press_without_a_string_has_no_pluck(make_press, noise):
    phases = find_phases(make_press(slope=0, **noise))
    assert phases.plucks == ()
    assert phases.held_speed is None
    assert phases.released_speed is None
    assert phases.start == pytest.approx(0.030, abs=0.1e-3)
    assert phases.free_speed == pytest.approx(0.072, rel=2e-3)
    assert not phases.warnings


@pytest.mark.parametrize("at", [0.045, 0.060, 0.090])
def test_a_spike_beside_a_pluck_leaves_the_release(make_press, at):
    press = make_press(**NOISY)
    force = press.data["force"].to_numpy().copy()
    force[round(at * press.rate)] += 1
    held, _ = only_pluck(make_press.build(press.data["velocity"].to_numpy(), force, press.rate))
    assert held.release == pytest.approx(RELEASE, abs=0.1e-3)
    assert held.contact == pytest.approx(CONTACT, abs=max(0.3e-3, 3 * held.contact_std))


def test_nothing_moves(make_press):
    zeros = np.zeros(4000)
    phases = find_phases(make_press.build(zeros, zeros, 51_200.0))
    assert phases.plucks == ()
    assert "did not move down" in phases.warnings[0]
    assert_finite(phases)


def test_a_vibrometer_of_the_wrong_sign_gives_a_warning(make_press):
    press = make_press()
    velocity, force = (press.data[name].to_numpy() for name in ("velocity", "force"))
    phases = find_phases(make_press.build(-velocity, force, press.rate))
    assert "sign of the vibrometer" in phases.warnings[0]
    assert " 0 mm" in phases.warnings[0]


def test_noise_of_a_key_at_rest_is_no_further_press(make_press):
    noise = np.random.default_rng(1).standard_normal(60_000)
    press = make_press.build(5e-5 * noise, np.zeros(60_000), 51_200.0)
    assert first_press(press) is press


@pytest.mark.parametrize("slope", [0, 30])
def test_a_force_of_the_wrong_sign_gives_one_warning(make_press, slope):
    press = make_press(**NOISY, slope=slope)
    velocity, force = (press.data[name].to_numpy() for name in ("velocity", "force"))
    phases = find_phases(make_press.build(velocity, -force, press.rate))
    assert "the force transducer has the wrong sign" in phases.warnings[0]
    assert phases.plucks == phases.warnings[1:] == phases.missed == ()


@pytest.mark.parametrize(
    ("first", "rows"),
    [
        (0, (0, 1, 2, 5, 16, 50, 200, 1000, 1500, 1600, 1700, 2000, 3000, 3680, 3690, 3750)),
        (2000, (16, 40, 60, 100, 300)),
    ],
    ids=["from nothing to just after release", "in the middle"],
)
def test_a_part_of_a_press(make_press, first, rows):
    """Found, or none and a warning, never a crash."""
    press = make_press(**NOISY)
    for n in rows:
        phases = find_phases(cut(press, slice(first, first + n)))
        assert_finite(phases)
        assert phases.warnings or (phases.plucks and not first)


@pytest.mark.parametrize(("contact", "release"), [(0.029, 0.072), (0.029, 0.0375), (0.027, 0.031)])
def test_contact_in_the_run_up_is_not_claimed(make_press, contact, release):
    """Inertia hides it: the uncertainty covers the possible instants, and a warning says why."""
    phases = find_phases(make_press(contact=contact, release=release, slope=60, **NOISY))
    assert_finite(phases)
    for held in phases.plucks:
        assert abs(held.contact - contact) < 3 * held.contact_std
        assert any("run-up" in warning for warning in phases.warnings)


@pytest.mark.parametrize("column", ["force", "velocity"])
def test_samples_that_are_not_numbers_are_refused(make_press, column):
    press = make_press()
    data = press.data.copy()
    data.loc[data.index[[7, 1000]], column] = np.nan
    broken = with_data(press, data)
    with pytest.raises(AnalysisError, match=rf"press-0001\.mcap: 2 samples of its {column}"):
        find_phases(broken)


def test_random_force_on_a_moving_key_is_no_pluck(make_press):
    velocity = make_press().data["velocity"].to_numpy()
    for seed in range(5):
        force = np.random.default_rng(seed).standard_normal(len(velocity))
        phases = find_phases(make_press.build(velocity, force, 51_200.0))
        assert phases.plucks == ()


@pytest.mark.parametrize(
    ("peak", "press", "limit"),
    [
        (50.0, {"force_noise": 5e-3}, 0.1e-3),
        (0.1, {"force_noise": 1e-4}, 0.1e-3),
        (5e-3, {"level": 5e-3, "force_noise": 5e-5, "velocity_noise": 1e-6}, 0.3e-3),
        (5.0, {"level": 5.0, "force_noise": 0.05, "velocity_noise": 1e-6}, 0.3e-3),
    ],
)
def test_forces_from_5_mn_to_50_n(make_press, peak, press, limit):
    held, _ = only_pluck(make_press(slope=peak / 0.020, **press))
    assert held.contact == pytest.approx(CONTACT, abs=limit)
    assert held.release == pytest.approx(RELEASE, abs=0.03e-3)
    assert held.force_drop == pytest.approx(peak, rel=0.02)


def test_a_pluck_of_a_millinewton_is_not_found(make_press):
    """It is smaller than the errors of the model, as docs/phases.md states."""
    phases = find_phases(make_press(slope=1e-3 / 0.020))
    assert phases.plucks == ()
    assert_finite(phases)


def test_pure_noise_is_no_press(make_press):
    random = np.random.default_rng(0)
    press = make_press.build(1e-3 * random.standard_normal(9000), random.standard_normal(9000), 5e4)
    phases = find_phases(press)
    assert phases.plucks == ()
    assert phases.warnings


def test_a_gradual_fall_is_no_pluck_but_a_warning_that_says_where(make_press):
    """As in the force curve of a computer key."""
    press = make_press(slope=0)
    time = press.time
    press.samples["force"] += np.interp(time, [0.06, 0.10, 0.13], [0, 0.6, 0.2]) * (time < 0.15)
    phases = find_phases(press)
    assert phases.plucks == ()
    assert phases.fit.verdict == "poor"
    assert any("climbs by" in warning for warning in phases.warnings)
    ((start, stop),) = phases.missed
    assert start == pytest.approx(0.06, abs=10e-3)
    assert stop == pytest.approx(0.15, abs=3e-3)
    assert press_summary(press, phases)["missed"] == [[start, stop]]
    named = f"load without a pluck: {start * 1e3:.4g} to {stop * 1e3:.4g} ms"
    assert named in texts(phases_figure([press], [phases]))


@pytest.mark.parametrize("second", [False, True])
def test_more_plucks_than_the_rig_has_strings_give_a_warning(make_press, second):
    press = make_press(**NOISY)
    held = (press.time >= 0.09) & (press.time < 0.115)
    press.samples["force"] += np.where(second & held, 27 * (press.time - 0.09), 0)
    phases = find_phases(press)
    assert len(phases.plucks) == 1 + second
    assert any("the rig has 1 string:" in text for text in phases.warnings) == second


@pytest.mark.parametrize("height", [0.3, 1.0, 10.0])
@pytest.mark.parametrize("width", [1, 2])
def test_a_spike_is_no_pluck(make_press, height, width):
    press = make_press(slope=0, **NOISY)
    force = press.data["force"].to_numpy().copy()
    force[3000 : 3000 + width] += height
    force[5000 : 5000 + width] -= height
    phases = find_phases(make_press.build(press.data["velocity"].to_numpy(), force, press.rate))
    assert phases.plucks == ()


def test_finding_does_not_change_the_press(make_press):
    press = make_press(**NOISY)
    before = {name: signal.copy() for name, signal in press.samples.items()}
    first = find_phases(press)
    for name, signal in press.samples.items():
        np.testing.assert_array_equal(signal, before[name])
    assert find_phases(press) == first


@pytest.mark.parametrize(("contact", "release"), [(150, 250), (100, 108), (100, 300)])
def test_a_load_falls_at_a_release_and_not_at_a_contact(contact, release):
    row, zero = np.arange(400.0), np.zeros(400)
    held = (row >= contact) & (row < release)
    load = np.where(held, (row - contact) / (release - contact), 0.0)
    load += np.random.default_rng(0).normal(0, 1e-3, 400)
    found = find_falls(Rows(row * 1e-4, 1e-4, load, zero, zero, zero[1:], zero, zero))
    assert np.abs(np.array(found) - release).tolist() == pytest.approx([0], abs=2)


def test_a_pluck_unlike_the_rigs_string_gives_a_warning(make_press):
    """The rig's string is at 1.9 mm of rise, not at 5.2 mm."""
    unlike = find_phases(make_press(contact=0.1, release=0.115, **NOISY))
    assert len(unlike.plucks) == 1
    assert any("not like the rig's string" in warning for warning in unlike.warnings)
    alike = find_phases(make_press(**NOISY))
    assert not any("not like the rig's string" in warning for warning in alike.warnings)


def test_the_noise_of_a_differentiated_displacement_hides_no_pluck(make_press):
    """Its density grows with the frequency, so that rows of 80 us have a noise of several N."""
    clean = make_press(rate=25_600.0, force_noise=3e-3)
    noise = 0.5e-6 * np.random.default_rng(0).standard_normal(len(clean.time) + 1)
    velocity = clean.samples["velocity"] + np.diff(noise) * clean.rate
    phases = find_phases(make_press.build(velocity, clean.samples["force"], clean.rate))
    (held,) = phases.plucks
    assert held.contact == pytest.approx(CONTACT, abs=3 * held.contact_std)
    assert held.release == pytest.approx(RELEASE, abs=3 * held.release_std)


def test_a_second_press_is_cut_off_with_a_warning(make_press):
    once = make_press(until=0.2)
    down = once.samples["velocity"]
    twice = [np.concatenate(parts) for parts in ((down, -down, down), [once.samples["force"]] * 3)]
    press = make_press.build(*twice, once.rate)
    assert first_press(once) is once
    cut = first_press(press)
    assert cut.time[-1] == pytest.approx(0.4, abs=0.04)
    assert len(cut.samples["force"]) == len(cut.time)
    assert any("goes down again after" in warning for warning in cut.warnings)
    (held,) = find_phases(cut).plucks
    assert held.release == pytest.approx(RELEASE, abs=1e-4)

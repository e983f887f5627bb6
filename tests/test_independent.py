"""The judge of the analysis: its physics against closed forms and other solvers; its sensors."""

import ast
import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_bvp, solve_ivp
from scipy.linalg import eigh
from scipy.optimize import brentq
from scipy.signal import find_peaks

from benchmarks import independent
from benchmarks.independent import (
    ONE_FACTOR,
    Choir,
    Conditions,
    press,
    random_carved,
    random_conditions,
)
from benchmarks.independent.assembly import key_model, string_modes
from benchmarks.independent.elastica import shape, solve_contact, static_pluck
from benchmarks.independent.press import plucks_of, simulate
from sautereau.rig.load import load_rig
from tests.budget import amount, slow

INFINITE = float("inf")
QUICK = Conditions(speed=0.2, rest=5e-3, hold=0.0, return_speed=1.0)  # A press of about 60 ms


def test_it_shares_no_code_with_what_it_judges():
    for path in Path(independent.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and not node.level:
                assert not (node.module or "").startswith("sautereau")
            if isinstance(node, ast.Import):
                assert not any(name.name.startswith("sautereau") for name in node.names)


@pytest.mark.parametrize("carving", [(), ONE_FACTOR["carved plectrum"].choirs[0].carving])
def test_a_slow_press_is_the_quasi_static_pluck(carving):
    choir = Choir(clearance=0.3e-3, decay=400.0, friction=0.1, carving=carving)
    slow = replace(QUICK, choirs=(choir,), speed=0.02, rise=3e-3, servo_stiffness=INFINITE)
    motion, _, _ = simulate(slow)
    contact, release = motion.events[:2]
    static = static_pluck(choir)
    times = np.arange(motion.out.shape[1]) * motion.step
    height = np.interp(release[2], times, motion.out[5]) - choir.clearance
    assert np.interp(contact[2], times, motion.out[5]) == pytest.approx(choir.clearance, abs=1e-8)
    rising = slice(int(contact[2] / motion.step) + 1, int(release[2] / motion.step))
    heights = motion.out[5, rising] - choir.clearance
    expected = np.interp(heights, static.height, static.load)
    assert motion.out[7, rising] == pytest.approx(expected, abs=2e-3 * static.release_force)
    assert height == pytest.approx(static.release_height, rel=2e-3)
    assert release[3] == pytest.approx(static.release_force, rel=2e-3)


def test_energy_is_conserved_from_the_arm_to_string_and_plectrum():
    """What the arm does and friction does not take is stored, or in the string and the plectrum."""
    choir = Choir(decay=1e-9)
    motion, _, _ = simulate(
        replace(QUICK, choirs=(choir,), bending_frequency=350.0, heave_frequency=200.0)
    )
    release = motion.events[motion.events[:, 1] == 1][0]
    modes, _, residual = string_modes(choir, motion.step)
    omega = 2 * np.pi * choir.frequency * np.arange(1, choir.modes + 1)
    speed, position = motion.strings.velocity[0], motion.strings.position[0]
    string = np.sum((speed**2 + omega**2 * position**2) / modes[:, 1]) / 2

    def bent(force):
        xi = choir.length * np.sqrt(force / choir.bending_stiffness)
        solved = solve_ivp(
            lambda _, y: [y[1], np.cos(y[0]), np.sin(y[0])],
            (0, xi),
            [0] * 3,
            rtol=1e-11,
            atol=1e-13,
        )
        return xi, solved.y[0, -1], solved.y[2, -1]

    force = brentq(lambda f: f * np.cos(bent(f)[1]) - release[3], 0.5 * release[3], 3 * release[3])
    xi, _, sine = bent(force)
    plectrum = choir.bending_stiffness * xi * sine / choir.length
    after = int(release[2] / motion.step) + 10
    stored, work, lost = motion.out[2:5, after] - motion.out[2:5, 0]
    spent = stored + lost + string + plectrum + residual * force**2 / 2
    assert spent == pytest.approx(work, rel=1e-4)


def test_an_untouched_key_rings_at_the_frequencies_of_the_coupled_system():
    """Key on its rail with the jack on its cloth, dropped; the finger does not touch it."""
    choir = Choir(cloth_stiffness=4e5, cloth_damping=0.003, register_friction=0.0)
    bench = Conditions(
        choirs=(choir,),
        preload=-2.0,
        rest=0.25,
        speed=0.2,
        rise=1e-3,
        hold=0.0,
        return_speed=1.0,
        bending_frequency=300.0,
        bending_damping=1e-3,
        second_mode=False,
        pivot_coulomb=0.0,
        rail_damping=0.5,
        inertia=7e-4,
    )
    key = key_model(bench)
    motion, start, _ = simulate(bench, settle=0.0)
    foot = np.append(key.at(choir.arm), -1.0)
    rail = np.append(key.at(bench.back_arm), 0.0)
    mass = np.pad(key.mass, (0, 1))
    mass[-1, -1] = choir.mass
    stiffness = np.pad(key.stiffness, (0, 1)) + choir.cloth_stiffness * np.outer(foot, foot)
    stiffness += bench.rail_stiffness * np.outer(rail, rail)
    expected = np.sqrt(eigh(stiffness, mass, eigvals_only=True)) / (2 * np.pi)
    ringing = motion.out[0, : int(start / motion.step)]
    count = 1 << 21
    spectrum = np.abs(np.fft.rfft(ringing * np.hanning(len(ringing)), count))
    peaks, _ = find_peaks(spectrum, height=spectrum.max() * 2e-3)
    frequencies = peaks / (count * motion.step)
    for frequency in expected:
        assert np.min(np.abs(frequencies / frequency - 1)) < 3e-3


def test_finer_steps_move_no_event_by_a_microsecond():
    events = [
        simulate(replace(QUICK, step=step, encoder=1e-13))[0].events for step in (5e-6, 2.5e-6)
    ]
    assert events[0][:, :2].tolist() == events[1][:, :2].tolist()
    assert np.max(np.abs(events[0][:2, 2] - events[1][:2, 2])) < 1e-6


def test_a_press_is_the_same_for_the_same_seed_and_its_sensors_lag_as_they_say():
    quiet = replace(
        QUICK,
        velocity=replace(QUICK.velocity, noise=0.0, high_pass=0.0, low_pass_order=1),
        force=replace(QUICK.force, noise=0.0, high_pass=0.0, gain=1.02),
    )
    first, again, other = (press(each, seed) for each, seed in ((QUICK, 1), (QUICK, 1), (QUICK, 2)))
    assert np.array_equal(first.force_volts, again.force_volts)
    assert not np.array_equal(first.force_volts, other.force_volts)
    made = press(quiet, 1)
    lag = 1.1e-3 + 1 / (2 * np.pi * 22e3)
    steady = slice(400, 900)
    expected = np.interp(made.times - lag, made.times, made.truth.velocity)
    assert made.velocity[steady] == pytest.approx(expected[steady], abs=2e-5)
    pressed = (made.times > 0.01) & (made.times < 0.025)
    gain = np.sum(made.force[pressed]) / np.sum(made.truth.force[pressed])
    assert gain == pytest.approx(1.02, abs=5e-3)


def test_each_choir_is_plucked_and_a_weak_press_plucks_nothing():
    second = Choir(arm=0.2, clearance=2.4e-3)
    both = press(replace(QUICK, choirs=(Choir(), second)), 1)
    assert [pluck.choir for pluck in both.truth.plucks] == [0, 1]
    assert both.truth.plucks[1].contact < both.truth.plucks[0].release
    assert not press(replace(QUICK, speed=0.05, rise=1.2e-3, return_speed=0.05), 1).truth.plucks
    held = press(replace(QUICK, speed=0.03, rise=2.6e-3, return_speed=0.05), 1).truth
    assert not held.plucks
    assert held.unreleased


def test_the_files_are_readable(tmp_path):
    rng = np.random.default_rng(5)
    conditions = random_conditions(rng)
    while len(conditions.choirs) < 2:
        conditions = random_conditions(rng)
    made = press(conditions, 1)
    command = independent.write_csv(made, tmp_path / "press.csv")
    independent.write_rig(made, tmp_path / "press.toml")
    rig = load_rig(tmp_path / "press.toml")
    assert len(rig.more_choirs) == 1
    assert rig.key.inertia == pytest.approx(conditions.inertia / conditions.inertia_factor)
    volts = np.loadtxt(tmp_path / "press.csv", delimiter=",", skiprows=1)[:, 1:]
    assert volts[:, 1] == pytest.approx(made.force_volts, abs=1e-8)
    assert "--rig" in command


@pytest.mark.slow
def test_events_converge_with_the_step():
    """Order 2 for most events, and below 0.5 us in the median at the step of the presses.

    Where a damped contact closes within a step (a finger with a gap to the key, a jack back on its
    cloth), its force jumps, and the order of the events after it is 1.
    """
    rng = np.random.default_rng(11)
    errors = []
    for conditions in [random_conditions(rng) for _ in range(10)]:
        found = []
        for step in (10e-6, 2.5e-6, 1.25e-6, 0.3125e-6):
            finer = replace(conditions, step=step, encoder=1e-13, servo_period=98 * 10e-6)
            plucks, _ = plucks_of(simulate(finer)[0].events, 0.0)
            found.append(np.array([(each.contact, each.release) for each in plucks]).ravel())
        errors.append(np.abs(np.array(found[:-1]) - found[-1]))
    rough, used, fine = np.concatenate(errors, axis=1)
    assert np.median(used) < 0.5e-6
    assert np.max(used) < 5e-6
    assert np.median(np.log(rough / np.maximum(fine, 1e-12)) / np.log(8)) > 1.7
    assert np.sum(fine) < np.sum(rough) / 8


@pytest.mark.slow
def test_all_conditions_can_be_simulated():
    rng = np.random.default_rng(0)
    missing = 0
    for seed in range(amount(40, 150)):
        conditions = random_conditions(rng)
        made = press(conditions, seed)
        assert np.all(np.isfinite(made.velocity_volts + made.force_volts))
        missing += len(made.truth.plucks) < len(conditions.choirs)
    assert missing < seed / 6


@pytest.mark.parametrize(("force", "friction"), [(0.02, 0.0), (0.6, 0.0), (0.6, 0.25), (1.5, 0.1)])
def test_the_elastica_solves_its_boundary_value_problem(force, friction):
    """In the clamp's frame: EI angle'' = -F (cos(end - angle) + mu sin(end - angle))."""
    stiffness, s, offset = 2e-5, 4.4e-3, 0.4e-3

    def beam(_, y, end):
        turn = end[0] - y[0]
        moment = -force * s**2 / stiffness * (np.cos(turn) + friction * np.sin(turn))
        return np.stack([y[1], moment, np.cos(y[0]), np.sin(y[0])])

    def ends(left, right, end):
        return np.array([left[0], right[1], left[2], left[3], right[0] - end[0]])

    grid = np.linspace(0, 1, 30)
    found = solve_bvp(beam, ends, grid, np.zeros((4, 30)), p=[0.1], tol=1e-10)
    end, x, depth = found.p[0], s * found.y[2, -1], s * found.y[3, -1]
    wire = (x + offset * np.sin(end), -depth + offset * np.cos(end))
    w, place, theta = solve_contact(shape(friction), *wire, offset, 0.1)
    assert place == pytest.approx(s, rel=1e-8)
    assert stiffness * w / place**2 == pytest.approx(force, rel=1e-7)
    assert theta == pytest.approx(end, rel=1e-7)


def oracle(name):
    with (Path(__file__).parent / "oracles/plucks.csv").open(encoding="utf-8") as file:
        row = next(row for row in csv.DictReader(file) if row["case"] == name)
    return [float(row[name]) for name in ("height", "lift", "work")]


WEDGE = Choir(carving=((0.0, 1.0), (2 / 4.5, 1.0), (1.0, 0.28 / 0.48)))
STICKING = Choir(thickness=0.304e-3, modulus=5.15e9, overlap=0.101e-3, friction=0.123)
CARVED = Choir(
    length=4e-3,
    thickness=0.5e-3,
    width=0.8e-3,
    overlap=0.35e-3,
    tension=50.0,
    string_length=0.4,
    plucking_point=0.09,
    diameter=0.25e-3,
    carving=((0.0, 1.0), (2.2 / 4, 1.0), (2.3 / 4, 0.64), (1.0, 0.64)),
)


@pytest.mark.parametrize(
    ("name", "choir"),
    [
        ("uniform 11", STICKING),
        slow("wedge", WEDGE),
        slow("carved", CARVED),
        ("carved + friction 0.1", replace(CARVED, friction=0.1)),
    ],
)
def test_plectra_pluck_as_in_another_solution_of_their_equations(name, choir):
    pluck = static_pluck(choir)
    height, lift, work = oracle(name)
    assert pluck.release_height == pytest.approx(height, rel=1e-7)
    assert pluck.release_force / choir.string_stiffness == pytest.approx(lift, rel=1e-7)
    assert np.trapezoid(pluck.load, pluck.height) == pytest.approx(work, rel=2e-6)


def test_a_carving_that_removes_nothing_changes_nothing():
    plain = Choir(friction=0.1)
    kept = static_pluck(replace(plain, carving=((0.0, 1.0), (0.3, 1.0), (1.0, 1.0))))
    for name in ("height", "load", "position"):
        assert getattr(kept, name) == pytest.approx(getattr(static_pluck(plain), name), rel=1e-9)


def test_a_string_that_leaves_the_last_piece_of_a_carving_is_refused():
    with pytest.raises(ValueError, match="last piece"):
        static_pluck(Choir(carving=((0.0, 1.0), (0.97, 1.0), (1.0, 0.9))))


def test_the_rig_knows_the_carving(tmp_path):
    conditions = random_carved(np.random.default_rng(0))
    made = press(conditions, 1)
    independent.write_rig(made, tmp_path / "press.toml")
    choir, rig = conditions.choirs[0], load_rig(tmp_path / "press.toml")
    outline = rig.plectrum.outline
    thickness = np.subtract(outline.top, outline.bottom) / choir.thickness
    written = np.column_stack([outline.x, thickness]) / [choir.length, 1]
    assert written == pytest.approx(np.array(choir.carving), rel=1e-7)


def test_a_stiff_plectrum_under_a_small_load_is_a_beam():
    choir = Choir(overlap=0.02e-3, tension=2.5e7, on_surface=False)
    pluck = static_pluck(choir)
    cantilever = 3 * choir.bending_stiffness / choir.length**3
    assert pluck.release_force / pluck.release_height == pytest.approx(cantilever, rel=0.03)

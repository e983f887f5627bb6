"""Properties of a press on the stand-in, from the trigger to the phases."""

from functools import cache

import numpy as np
import pytest

from sautereau.analysis.loading.press import load_press
from sautereau.analysis.model.predict import predict
from sautereau.analysis.phases import find_phases
from sautereau.daq.file.reading import read_recording
from sautereau.rig.load import load_rig, with_values
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.scene import load_scene
from sautereau.trajectory.press import plan_press
from tests.budget import slow
from tests.presses import QUICK, press_on


def test_ideal_jack_cruises_at_the_requested_speed(ideal):
    for path in ideal[0]:
        press = load_press(path)
        phases = find_phases(press)
        speed = press.data["jack_speed"]
        held = phases.plucks[0]
        planned = plan_press(press.rig).cruise
        cruise = speed[(speed.index > planned.start) & (speed.index < planned.end)]
        assert phases.free_speed == pytest.approx(0.072, rel=1e-3)
        assert cruise.mean() == pytest.approx(0.072, rel=1e-3)
        assert phases.held_speed == pytest.approx(0.072, rel=1e-3)
        assert held.pluck_duration == pytest.approx(20.0e-3, abs=0.1e-3)


def test_ideal_contact_release_and_force_are_the_models(ideal):
    prediction = predict(load_rig())
    for path, truth in zip(*ideal, strict=True):
        press = load_press(path)
        phases = find_phases(press)
        held = phases.plucks[0]
        assert held.contact - phases.start == pytest.approx(1.944e-3 / 0.072, abs=0.1e-3)
        assert held.contact == pytest.approx(truth.contacts[0], abs=0.1e-3)
        assert held.release == pytest.approx(truth.releases[0], abs=0.1e-3)
        rise = np.interp([held.contact, held.release], press.data.index, press.data["jack_rise"])
        assert np.diff(rise)[0] == pytest.approx(1.440e-3, rel=0.005)
        # The moment of the string's 0.536 N, normal to a plectrum at 15.5 deg, on the key.
        expected = 0.536 * np.cos(np.radians(15.5)) * 215 / 171
        assert held.force_drop == pytest.approx(expected, rel=0.005)
        assert held.release_force == pytest.approx(prediction.peak_force, rel=0.005)


def test_encoders_followed_the_plan(ideal):
    recorded = read_recording(ideal[0][0])
    for name in ("q1", "q2"):
        planned = np.interp(recorded.joints.t, recorded.plan.t, getattr(recorded.plan, name))
        assert np.abs(getattr(recorded.joints, name) - planned).max() < 3e-5


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 8])
def test_contact_and_release_behind_a_slow_low_pass_are_those_of_the_key(order, tmp_path):
    """Of 2 kHz in both channels, which delays by more than the limit."""
    scene = load_scene("ideal").model_copy(update={"sensors": load_scene("paper").sensors})
    calibration = {"low_pass": "2 kHz", "low_pass_order": order}
    slow_sensors = {f"daq.channels.{i}.{k}": v for i in (0, 1) for k, v in calibration.items()}
    with StandIn(with_values(load_rig(), QUICK | slow_sensors), scene) as stand_in:
        (path,) = press_on(stand_in, tmp_path)
        (truth,) = stand_in.truth()
    press = load_press(path)
    force = press.rig.daq.channel("force")
    assert force.lag > force.delay + 0.1e-3
    held = find_phases(press).plucks[0]
    assert held.contact == pytest.approx(truth.contacts[0], abs=0.1e-3)
    assert held.release == pytest.approx(truth.releases[0], abs=0.1e-3)


@pytest.fixture(scope="module")
def paper(bench, servo, tmp_path_factory):
    """Return a press of the scene `servo` with a seed, and its truth; pressed once."""
    folder = tmp_path_factory.mktemp("paper")

    @cache
    def press(seed: int):
        paths, truths = bench(str(servo), folder / str(seed), 1, seed)
        return paths[0], truths[0]

    return press


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes_and_another_does_not(bench, servo, paper, tmp_path):
    paths, _ = bench(str(servo), tmp_path, 2, 0)
    again, second = (read_recording(path).volts for path in paths)
    first, other = (read_recording(paper(seed)[0]).volts for seed in (0, 1))
    for name in ("velocity", "force"):
        assert first[name].tobytes() == again[name].tobytes()
        assert len({volts[name].tobytes() for volts in (first, second, other)}) == 3


@pytest.mark.slow
@pytest.mark.parametrize("seeds", [2, slow(20)])
def test_paper_phases_are_found_on_every_seed(paper, seeds):
    for path, truth in map(paper, range(seeds)):
        phases = find_phases(load_press(path))
        held = phases.plucks[0]
        assert held.contact == pytest.approx(truth.contacts[0], abs=0.3e-3)
        assert held.release == pytest.approx(truth.releases[0], abs=0.3e-3)
        assert not phases.warnings


def test_paper_jack_slows_down_while_the_string_is_held(paper):
    press = load_press(paper(0)[0])
    held = find_phases(press).plucks[0]
    speed = press.data["jack_speed"].rolling(51, center=True).mean()
    before = speed.loc[held.contact - 3e-3 : held.contact].mean()
    at_release = speed.loc[held.release - 2e-3 : held.release - 1e-3].mean()
    assert 0.10 < 1 - at_release / before < 0.30


def test_truth_apart_from_the_rig_is_seen_in_the_recording(quick_rig, tmp_path):
    truth = {"plectrum.overlap": "0.35 mm", "jack.string_clearance": "2.5 mm"}
    scene = load_scene("ideal").model_copy(update={"truth": truth})
    with StandIn(quick_rig, scene) as stand_in:
        assert stand_in.rig.plectrum.overlap == load_rig().plectrum.overlap
        (path,) = press_on(stand_in, tmp_path)
    phases = find_phases(load_press(path))
    expected = predict(with_values(load_rig(), truth))
    assert phases.plucks[0].pluck_duration == pytest.approx(expected.pluck_duration, abs=0.1e-3)
    assert phases.plucks[0].contact - phases.start == pytest.approx(2.5 / 72, abs=0.1e-3)


def test_numbers_continue_after_the_last_of_a_folder(bench, tmp_path):
    (tmp_path / "press-0007.mcap.part").write_bytes(b"left behind")
    paths, _ = bench("ideal", tmp_path, 1)
    assert [path.name for path in paths] == ["press-0008.mcap"]
    assert (tmp_path / "press-0007.mcap.part").read_bytes() == b"left behind"

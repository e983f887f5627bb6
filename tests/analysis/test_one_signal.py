"""Presses of which the force alone, or the velocity alone, was recorded."""

import json
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.simulated import acquired, simulated_press
from sautereau.analysis.errors import AnalysisError, MissingSignalError
from sautereau.analysis.loading.press import SIGNALS, partial_press_of, press_of
from sautereau.analysis.phases import find_phases
from sautereau.analysis.phases.one_signal import find_partial_phases
from sautereau.analysis.press.features import NEED, UNITS, features
from sautereau.analysis.press.string_start import OF_START
from sautereau.analysis.results.press import press_line, press_summary
from sautereau.entrance.session import open as open_session
from sautereau.rig.load import load_rig, with_values
from sautereau.sim_backend.physics.observation import observe
from sautereau.sim_backend.scene import load_scene
from tests.presses import with_data
from tests.recordings import write_recording


def simulated(scene, speed=0.072, *, mute=False):
    """Return a press with both signals, what the card acquired, and the truth."""
    rig = with_values(load_rig(), {"press.jack_speed": f"{speed} m/s"})
    changes: dict[str, object] = {"sensors": load_scene("paper").sensors}
    if scene != "paper":
        changes["engine"] = "exact"
    if mute:
        changes |= {"plectrum": "none", "string": "none", "tongue": False}
    made = load_scene(scene).model_copy(update=changes)
    recorded, truth = acquired(rig, made, observe(rig, made))
    return recorded, truth


def without(recorded, missing):
    """Return a recording whose rig has no channel for a signal."""
    kept = tuple(c for c in recorded.rig.daq.channels if c.quantity != missing)
    volts = {c.name: recorded.volts[c.name] for c in kept}
    return replace(recorded, rig=recorded.rig.replaced({"daq.channels": kept}), volts=volts)


def only(press, missing, rows=slice(None)):
    """Return some rows of a press without a signal."""
    data = press.data[["force"]] if missing == "velocity" else press.data.drop(columns="force")
    return with_data(press, data.iloc[rows], missing=missing)


@pytest.fixture(scope="module")
def paper_press():
    return simulated("paper")


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "speed"), [("ideal", 0.072), ("paper", 0.03), ("paper", 0.12)])
def test_plucks_in_the_force_alone(scene, speed):
    recorded, truth = simulated(scene, speed)
    press = partial_press_of(without(recorded, "velocity"))
    assert list(press.data.columns) == ["force"]
    (held,) = find_partial_phases(press).plucks
    assert held.contact == pytest.approx(truth.contacts[0], abs=2 * held.contact_std)
    assert held.release == pytest.approx(truth.releases[0], abs=2 * held.release_std)
    assert abs(held.release - truth.releases[0]) < 0.05e-3
    assert abs(held.contact - truth.contacts[0]) < 0.05 * held.pluck_duration
    # Wider than with both signals.
    (both,) = find_phases(press_of(recorded)).plucks
    assert held.contact_std > 2 * both.contact_std


def test_two_strings_in_the_force_alone():
    recorded, truth = simulated("two-choirs")
    plucks = find_partial_phases(partial_press_of(without(recorded, "velocity"))).plucks
    assert len(plucks) == 2
    for held, contact, release in zip(plucks, truth.contacts, truth.releases, strict=True):
        assert held.contact == pytest.approx(contact, abs=2 * held.contact_std)
        assert held.release == pytest.approx(release, abs=2 * held.release_std)


def test_a_release_in_the_velocity_alone(paper_press):
    recorded, truth = paper_press
    press = partial_press_of(without(recorded, "force"))
    assert "force" not in press.data
    (held,) = find_partial_phases(press).plucks
    assert held.release == pytest.approx(truth.releases[0], abs=3 * held.release_std)
    assert held.release_std < 0.1e-3
    # The contact is that of the rig: 2 mm within some tenths of a millimetre.
    assert held.contact == pytest.approx(truth.contacts[0], abs=2 * held.contact_std)
    assert 0.2e-3 < held.contact_std * 0.072 < 0.5e-3


def test_a_string_that_does_not_slow_the_key_is_not_seen_in_the_velocity_and_that_is_said():
    recorded, _ = simulated("ideal")
    found = find_partial_phases(partial_press_of(without(recorded, "force")))
    assert found.plucks == ()
    assert found.fit is None
    assert "there may have been a pluck; record the force as well" in found.warnings[0]


@pytest.mark.parametrize("missing", SIGNALS)
@pytest.mark.parametrize("scene", ["ideal", "paper"])
def test_no_pluck_without_a_string(scene, missing):
    recorded, _ = simulated(scene, mute=True)
    assert find_partial_phases(partial_press_of(without(recorded, missing))).plucks == ()


@pytest.mark.parametrize("missing", SIGNALS)
def test_what_needs_the_missing_signal_is_omitted(paper_press, missing):
    recorded, _ = paper_press
    press = partial_press_of(without(recorded, missing))
    phases = find_partial_phases(press)
    row, document = features(press, phases), press_summary(press, phases)
    assert set(row) == set(UNITS)
    optional = {"bottomed", "returned", "held_speed_error", *OF_START}  # no motion, no string
    assert {n for n, v in row.items() if v is None} - optional == set(NEED[missing]) - optional
    json.dumps([row, document], allow_nan=False)
    assert phases.warnings[0].startswith(f"no {missing} was recorded: ")
    assert document["plucks"][0]["force_slope"] is None
    assert (document["forces"]["release"] is None) == (missing == "force")
    assert (document["speeds"]["free"] is None) == (missing == "velocity")
    assert press_line(press, phases).endswith(f"no {missing}  simulated")
    assert " - " in press_line(press, phases)


@pytest.mark.parametrize("missing", SIGNALS)
def test_other_analyses_say_what_is_missing(paper_press, missing):
    recorded = without(paper_press[0], missing)
    with pytest.raises(MissingSignalError, match=f"it has no {missing} channel"):
        press_of(recorded)
    with pytest.raises(MissingSignalError, match=f"it has no {missing}"):
        find_phases(partial_press_of(recorded))
    with pytest.raises(AnalysisError, match="both signals"):
        find_partial_phases(press_of(paper_press[0]))


def test_a_recording_with_neither_is_refused(paper_press):
    neither = without(without(paper_press[0], "force"), "velocity")
    with pytest.raises(AnalysisError, match="no force and no velocity channel"):
        partial_press_of(neither)


@pytest.mark.slow
def test_any_part_of_a_press_gives_finite_numbers():
    press, _ = simulated_press(load_rig(), load_scene("paper"), 1)
    random = np.random.default_rng(0)
    for missing in SIGNALS:
        for _ in range(6):
            first, last = np.sort(random.integers(0, len(press.data), 2))
            part = only(press, missing, slice(first, max(last, first + 16)))
            found = find_partial_phases(part)
            document = [features(part, found), press_summary(part, found)]
            json.dumps(document, allow_nan=False)
            assert press_line(part, found)


@pytest.mark.parametrize("missing", SIGNALS)
def test_a_file_has_phases_and_features_and_no_comparison(paper_press, tmp_path, missing):
    recorded = without(paper_press[0], missing)
    volts = list(recorded.volts.values())
    path = write_recording(
        tmp_path / "press-0001.mcap", recorded.rig, volts, session=recorded.session
    )
    session = open_session([path])
    assert f"no {missing}" in str(session[0])
    assert len(session[0].document["plucks"]) == 1
    assert session.features["plucks"].tolist() == [1]
    assert session.features["force_slope"].tolist() == [None]
    for refused in (session.compare, session.plot, lambda: session.identify(["key.inertia"])):
        with pytest.raises(MissingSignalError, match=f"0001.mcap: it has no {missing} channel"):
            refused()

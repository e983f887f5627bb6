"""The pictures of a comparison and of phases, and that what was simulated says so on them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.figures.comparison import comparison_figure
from sautereau.analysis.figures.phases import phases_figure
from sautereau.analysis.phases import find_phases
from sautereau.rig.load import with_values
from tests.plots import texts


@pytest.fixture(scope="module")
def figure(make_press, prediction):
    press = make_press()
    return comparison_figure([press], [find_phases(press)], prediction)


def test_simulated_is_written_on_the_picture(figure):
    assert "simulated" in texts(figure)
    assert "Rig paper: 1 press, SIMULATED" in texts(figure)
    assert not any("measured" in text for text in texts(figure))
    for name in ("free", "string held", "string released", "finger force (N)"):
        assert name in texts(figure)


def test_measured_presses_are_called_measured(make_press, prediction):
    press = make_press(simulated=False)
    figure = comparison_figure([press, press], [find_phases(press)] * 2, prediction)
    assert "Rig paper: 2 presses, measured" in texts(figure)
    assert not any("simulated" in text.lower() for text in texts(figure))


def test_one_simulated_press_among_measured_ones_is_enough(make_press, prediction):
    presses = [make_press(simulated=False), make_press(simulated=True)]
    figure = comparison_figure(presses, [find_phases(p) for p in presses], prediction)
    assert "simulated" in texts(figure)


def test_all_curves_meet_at_contact(figure, prediction):
    """On the right, every deflection is counted from its own contact."""
    *_, right = figure.axes
    predicted = np.interp(prediction.contact, prediction.time, prediction.finger_force)
    for line, contact_force in zip(right.lines, (0.33, predicted), strict=True):
        x, y = line.get_data()
        assert x[0] < 0 < x[-1]
        assert np.interp(0, x, y) == pytest.approx(contact_force, abs=0.02)


def test_no_press_is_refused(prediction):
    with pytest.raises(AnalysisError, match="no press to draw"):
        comparison_figure([], [], prediction)


def test_a_boundary_is_shown_with_its_uncertainty(make_press):
    press = make_press(force_noise=5e-3)
    phases = find_phases(press)
    figure = phases_figure([press], [phases])
    labels = [line.get_label() for axes in figure.axes for line in axes.get_lines()]
    (told,) = (label for label in labels if str(label).startswith("contact"))
    held = phases.plucks[0]
    assert told == f"contact, string 1: {held.contact * 1e3:.3f} ± {held.contact_std * 1e3:#.2g} ms"
    assert "SIMULATED" in figure.get_suptitle()


def test_presses_with_and_without_a_pluck_go_into_a_file(make_press, tmp_path):
    presses = [make_press(simulated=False), make_press(slope=0, simulated=False)]
    path = tmp_path / "phases.png"
    phases_figure(presses, [find_phases(press) for press in presses]).savefig(path)
    assert path.stat().st_size > 10_000


def test_presses_of_two_folders_and_rigs_have_names_of_their_own(make_press):
    rigs = [with_values(make_press().rig, {"name": name}) for name in ("a4", "c4")]
    presses = [
        replace(make_press(), path=Path(rig.name) / "press-0001.mcap", rig=rig) for rig in rigs
    ]
    figure = phases_figure(presses, [find_phases(press) for press in presses])
    assert figure.get_suptitle().startswith("Rig a4 and c4")
    titles = [a.get_legend().get_title().get_text() for a in figure.axes[4:]]
    assert [title.partition(",")[0] for title in titles] == [str(p.path) for p in presses]


def test_phases_of_no_press_and_of_too_many_are_refused(make_press):
    with pytest.raises(AnalysisError, match="no press to draw"):
        phases_figure([], [])
    press = make_press()
    with pytest.raises(AnalysisError, match="9 presses are too many"):
        phases_figure([press] * 9, [find_phases(press)] * 9)


@pytest.mark.parametrize("peak", [0.3, 2.67])
def test_a_force_before_contact_that_is_out_of_range_is_written(make_press, peak):
    """The forces of the pluck fill the axes; a larger one in the run-up is named by its value."""
    press = make_press()
    phases = find_phases(press)
    force = press.samples["force"].copy()
    force[np.searchsorted(press.time, phases.plucks[0].contact - 15e-3)] = peak
    changed = replace(press, samples={**press.samples, "force": force})
    axes = phases_figure([changed], [replace(phases, peak_force=None)]).axes[0]
    said = [text.get_text() for text in axes.texts if "peak" in text.get_text()]
    out = bool(peak > force[press.time > phases.plucks[0].contact].max())
    assert said == ["peak 2.7 N"] * out
    assert (axes.get_ylim()[1] < peak) == out

"""The picture of phases: boundaries, their uncertainty, and that it says what is simulated."""

import pytest

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.figures.phases import phases_figure
from sautereau.analysis.phases import find_phases


def test_a_boundary_is_shown_with_its_uncertainty(make_press):
    press = make_press(force_noise=5e-3)
    phases = find_phases(press)
    figure = phases_figure([press], [phases])
    labels = [line.get_label() for axes in figure.axes for line in axes.get_lines()]
    (told,) = (label for label in labels if str(label).startswith("contact 1"))
    held = phases.plucks[0]
    assert told == f"contact 1: {held.contact * 1e3:.3f} ± {held.contact_std * 1e3:.2g} ms"
    assert "SIMULATED" in figure.get_suptitle()


def test_presses_with_and_without_a_pluck_go_into_a_file(make_press, tmp_path):
    presses = [make_press(simulated=False), make_press(slope=0, simulated=False)]
    path = tmp_path / "phases.png"
    phases_figure(presses, [find_phases(press) for press in presses]).savefig(path)
    assert path.stat().st_size > 10_000


def test_no_press_and_too_many_are_refused(make_press):
    with pytest.raises(AnalysisError, match="no press to draw"):
        phases_figure([], [])
    press = make_press()
    with pytest.raises(AnalysisError, match="9 presses are too many"):
        phases_figure([press] * 9, [find_phases(press)] * 9)

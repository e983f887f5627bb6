"""The picture, and that what was simulated says so on it."""

import numpy as np
import pytest

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.figures.comparison import comparison_figure
from sautereau.analysis.model.predict import predict
from sautereau.analysis.phases import find_phases
from tests.plots import texts


@pytest.fixture(scope="module")
def prediction(paper):
    return predict(paper)


@pytest.fixture(scope="module")
def figure(make_press, prediction):
    press = make_press()
    return comparison_figure([press], [find_phases(press)], prediction)


def test_simulated_is_written_on_the_picture(figure):
    assert "simulated" in texts(figure)
    assert "Rig paper: 1 press, SIMULATED, made on the stand-in" in texts(figure)
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


def test_a_mute_press_is_drawn(make_press, prediction):
    press = make_press(slope=0)
    shown = texts(comparison_figure([press], [find_phases(press)], prediction))
    assert "free" in shown
    assert "string held" not in shown


def test_a_file_appears(tmp_path, make_press, prediction):
    press = make_press()
    path = tmp_path / "picture.pdf"
    comparison_figure([press], [find_phases(press)], prediction).savefig(path)
    assert path.read_bytes().startswith(b"%PDF")


def test_no_press_is_refused(prediction):
    with pytest.raises(AnalysisError, match="no press to draw"):
        comparison_figure([], [], prediction)

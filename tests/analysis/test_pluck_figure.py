"""The picture of a pluck: that its curves are the plucks, and that it hides no level."""

import numpy as np
import pytest

from benchmarks.spinet import SPINET
from sautereau.analysis.errors import ModelError
from sautereau.analysis.figures.pluck import pluck_figure
from sautereau.analysis.model.predict import rig_pluck
from sautereau.rig.load import load_rig

RIG = load_rig()
LEVELS = ["elastica", "rods", "beam", "two-beam"]


def with_plectrum(**changes):
    return RIG.model_copy(update={"plectrum": RIG.plectrum.model_copy(update=changes)})


def legend(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def curves(axes):
    """Return the lines that are more than a mark or an entry of the legend."""
    return [line.get_xydata() for line in axes.lines if len(line.get_xdata()) > 2]


def test_the_curves_are_the_pluck():
    angle, path, force = pluck_figure(RIG, ["elastica"]).axes[:3]
    (above,) = angle.child_axes
    assert above.get_xlabel() == "time after contact (ms)"
    assert above._functions[0](1.44) == pytest.approx(20.0)  # mm over m/s are ms
    pluck = rig_pluck(RIG, "elastica")
    height = pluck.height * 1e3
    (drawn,) = curves(angle)
    np.testing.assert_allclose(drawn, np.column_stack([height, np.degrees(pluck.angle)]))
    (drawn,) = curves(path)
    np.testing.assert_allclose(drawn, np.column_stack([pluck.shift, pluck.lift]) * 1e3)
    norm, along = curves(force)
    np.testing.assert_allclose(norm[:, 1], pluck.force, atol=1e-9)
    # Without friction the other part is the downward force.
    down = np.sqrt(norm[:, 1] ** 2 - along[:, 1] ** 2)
    np.testing.assert_allclose(down, pluck.vertical_force, atol=1e-9)


def test_all_levels_are_over_each_other():
    figure = pluck_figure(RIG, LEVELS)
    for axes, number in zip(figure.axes[:3], (4, 4, 8), strict=True):
        assert len(curves(axes)) == number
    assert [text.split(":")[0] for text in legend(figure)] == LEVELS
    assert "elastica: 19.99 ms, 0.5354 N" in legend(figure)


def test_a_level_out_of_range_is_named(tmp_path):
    rig = with_plectrum(overlap=1.6e-3, thickness=0.35e-3)
    figure = pluck_figure(rig, LEVELS)
    assert "beam: out of range" in legend(figure)
    assert "two-beam: out of range" in legend(figure)
    assert "beam: plectrum.overlap" in figure.get_suptitle()
    assert len(curves(figure.axes[0])) == 2
    figure.savefig(tmp_path / "pluck.png")
    assert (tmp_path / "pluck.png").read_bytes().startswith(b"\x89PNG")


def test_what_a_level_ignores_and_which_string_it_is_are_said():
    carved = SPINET.replaced({"plectrum.tip_thickness": 0.3e-3, "plectrum.tip_length": 1.5e-3})
    figure = pluck_figure(carved, ["elastica", "beam"])
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert ["without tip_thickness" in label for label in labels] == [False, True]
    assert "string 1 (8') of 2" in figure.get_suptitle()


def test_nothing_to_draw_is_refused():
    rig = with_plectrum(overlap=1.6e-3, thickness=0.35e-3)
    with pytest.raises(ModelError, match=r"(?s)no level has a pluck.*beam: .*two-beam: "):
        pluck_figure(rig, ["beam", "two-beam"])
    with pytest.raises(ModelError, match="no level"):
        pluck_figure(RIG, [])

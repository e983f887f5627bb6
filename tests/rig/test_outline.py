"""Contours of carved plectra: traced, photographed, and refused with the reason."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sautereau.rig.document import rig_from_json, rig_json
from sautereau.rig.errors import RigError
from sautereau.rig.load import load_rig
from sautereau.rig.outline import split
from tests.budget import amount, examples

WEDGE = [(0, -0.24), (2, -0.2), (4.5, -0.15), (4.5, 0.15), (2, 0.2), (0, 0.24)]
"""mm, thickness 0.48 at the clamp, 0.4 at 2 mm, 0.3 at the tip."""


def csv(points, header="x [mm], z [mm]"):
    return "\n".join([header, *(f"{x}, {z}" for x, z in points)]) + "\n"


@pytest.fixture
def outline_of(paper_text, tmp_path):
    """Return a function that reads the paper's rig with a contour's file beside it."""

    def read(text, table='{ file = "contour.csv" }'):
        (tmp_path / "contour.csv").write_text(text, encoding="utf-8")
        path = tmp_path / "bench.toml"
        head = "[plectrum]\n"
        assert paper_text.count(head) == 1
        path.write_text(paper_text.replace(head, f"{head}outline = {table}\n"), encoding="utf-8")
        return load_rig(path).plectrum.outline

    return read


def thickness(outline, x):
    return np.interp(x, outline.x, outline.top) - np.interp(x, outline.x, outline.bottom)


@pytest.mark.parametrize("turned", [0, 2, 5])
@pytest.mark.parametrize("backwards", [False, True])
def test_a_tracing_may_begin_anywhere_and_go_either_way(outline_of, turned, backwards):
    points = WEDGE[turned:] + WEDGE[:turned]
    outline = outline_of(csv(points[::-1] if backwards else points))
    np.testing.assert_allclose(outline.x, [0, 2e-3, 4.5e-3])
    np.testing.assert_allclose(outline.top, [0.24e-3, 0.2e-3, 0.15e-3])
    np.testing.assert_allclose(outline.bottom, [-0.24e-3, -0.2e-3, -0.15e-3])


def test_the_header_gives_the_unit_and_the_first_point_may_come_again(outline_of):
    points = [(x * 1e3, z * 1e3) for x, z in [*WEDGE, WEDGE[0]]]
    assert outline_of(csv(points, "x [um], z [um]")).top[1] == pytest.approx(0.2e-3)


def test_edges_with_points_at_different_places(outline_of):
    points = [(0, -0.2), (1, -0.2), (4.5, -0.2), (4.5, 0.1), (3, 0.2), (0, 0.2)]
    outline = outline_of(csv(points))
    np.testing.assert_allclose(outline.x, [0, 1e-3, 3e-3, 4.5e-3])
    np.testing.assert_allclose(outline.top, [0.2e-3, 0.2e-3, 0.2e-3, 0.1e-3])
    np.testing.assert_allclose(outline.bottom, -0.2e-3)


def test_what_lies_behind_the_clamp_is_cut_off_and_the_mid_line_begins_at_zero(outline_of):
    points = [(-3, 0.7), (4.5, 0.7), (4.5, 1.0), (0, 1.3), (-3, 1.4)]
    outline = outline_of(csv([*points, (-3, 1.0)]))
    np.testing.assert_allclose(outline.x, [0, 4.5e-3])
    np.testing.assert_allclose(outline.top, [0.3e-3, 0.0], atol=1e-18)
    np.testing.assert_allclose(outline.bottom, -0.3e-3)


def test_a_pointed_tip_is_blunted(outline_of):
    points = [(0, -0.2), (2, -0.2), (4.5, 0), (2, 0.2), (1, 0.2), (0, 0.2)]
    outline = outline_of(csv(points))
    assert outline.x[-1] == pytest.approx(4.5e-3, rel=1e-15)
    assert outline.top[-1] == pytest.approx(0.05 * 0.2e-3)
    assert outline.bottom[-1] == pytest.approx(-0.05 * 0.2e-3)


@pytest.mark.parametrize("left", [False, True])
def test_the_contour_of_a_photograph(outline_of, left):
    """Read to within a pixel of 0.01 mm, though the edges are pixelated."""
    x = np.arange(-60, 451)
    half = np.round(24 - 9 * np.maximum(x, 0) / 450).astype(int)
    up, down = np.column_stack([x, 8 - half]), np.column_stack([x, 8 + half])
    end = [(450, row) for row in range(8 - half[-1], 8 + half[-1])]
    contour = np.concatenate([up, end, down[::-1]])
    contour = contour * [-1, 1] + [1000, 500] if left else contour + np.array([212, 632])
    clamp = [1000, 508] if left else [212, 640]
    outline = outline_of(
        csv(contour, "x [px], y [px]"),
        f'{{ file = "contour.csv", scale = "0.01 mm", clamp = {clamp} }}',
    )
    assert len(outline.x) == 17
    assert outline.x[-1] == pytest.approx(4.5e-3)
    places = np.linspace(0, 4.5e-3, 50)
    np.testing.assert_allclose(
        thickness(outline, places), 0.48e-3 - 0.18e-3 * places / 4.5e-3, atol=10e-6
    )
    assert max(np.abs(np.add(outline.top, outline.bottom))) < 1e-6


def test_the_top_of_a_photograph_is_its_upper_edge(outline_of):
    contour = [(0, 60), (100, 60), (450, 60), (450, 40), (100, 20), (0, 20)]
    table = '{ file = "contour.csv", scale = "10 um", clamp = [0, 40] }'
    outline = outline_of(csv(contour, "x, y"), table)
    assert outline.top[-1] < outline.top[0]
    assert outline.bottom[-1] == outline.bottom[0]


@pytest.mark.parametrize(
    ("points", "reason"),
    [
        (WEDGE[:4], "4 different points are too few for a contour; trace at least 6"),
        ([(x + 1, z) for x, z in WEDGE], "reaches from x = 1 to 5.5 mm, which is not from the"),
        ([(-x, z) for x, z in WEDGE], "reaches from x = -4.5 to"),
        (
            [(0, -0.2), (2, 0.2), (4.5, 0.2), (4.5, -0.2), (2, -0.2), (0, 0.2)],
            "the contour crosses itself near x = 1 mm, z = 0 mm",
        ),
        (
            [(0, -0.2), (4.5, -0.2), (4.5, 0.2), (2, 0.2), (3, 0.3), (1, 0.4), (0, 0.2)],
            "the contour folds back over itself at x = 2 mm",
        ),
        ([(x, math.inf) for x, _ in WEDGE], "line 2: z: 'inf mm' is not a number with a unit"),
    ],
)
def test_no_plectrum_is_refused_with_the_reason(outline_of, points, reason):
    with pytest.raises(RigError) as raised:
        outline_of(csv(points))
    assert "plectrum.outline: outline file" in str(raised.value)
    assert "line " in str(raised.value)
    assert reason in str(raised.value)


@pytest.mark.parametrize(
    ("table", "reasons"),
    [
        ('{ file = "other.csv" }', ["cannot be read"]),
        ('{ file = "contour.csv", scal = "1 mm" }', ["scal: unknown key", "scale and clamp"]),
        ('{ file = "contour.csv", clamp = [0, 0] }', ["scale: '' is not a number"]),
        ('{ file = "contour.csv", scale = "1 s" }', ["'1 s' has the dimension", "clamp: None"]),
        (
            '{ file = "contour.csv", scale = "-1 mm", clamp = [0, "1"] }',
            ["not above 0", "[0, '1']"],
        ),
        ('{ file = "contour.csv", scale = "1 mm", clamp = [0, 0] }', ["has no column y"]),
    ],
)
def test_a_wrong_table_is_refused_with_the_reason(outline_of, table, reasons):
    with pytest.raises(RigError) as raised:
        outline_of(csv(WEDGE), table)
    for reason in reasons:
        assert reason in str(raised.value)


def test_pixels_are_no_lengths(outline_of):
    table = '{ file = "contour.csv", scale = "1 mm", clamp = [0, 0] }'
    with pytest.raises(RigError, match="is not a number of pixels"):
        outline_of(csv(WEDGE, "x [mm], y [mm]"), table)


POINTS = st.lists(st.tuples(st.integers(-3, 9), st.integers(-3, 3)), max_size=12)
"""Integers, so that points and edges often coincide."""


@given(POINTS)
@examples(60, amount(400, 2000))
def test_any_points_are_an_outline_or_refused(points):
    try:
        x, top, bottom = split(1e-3 * np.array(points, float).reshape(-1, 2))
    except ValueError:
        return
    assert x[0] == 0
    assert np.all(np.diff(x) > 0)
    assert np.all(top >= bottom)


def test_a_rig_with_an_outline_reads_back(paper_text, tmp_path, outline_of):
    outline_of(csv(WEDGE))
    rig = load_rig(tmp_path / "bench.toml")
    assert rig_from_json(rig_json(rig)) == rig


def test_an_outline_in_a_wrong_unit_is_asked_to_be_confirmed(tmp_path, caplog):
    (tmp_path / "contour.csv").write_text(csv(WEDGE, "x [mm], z [um]"), encoding="utf-8")
    own = 'name = "own"\nbase = "paper"\nplectrum = { outline = { file = "contour.csv" } }\n'
    (tmp_path / "own.toml").write_text(own, encoding="utf-8")
    load_rig(tmp_path / "own.toml")
    assert "line 3: plectrum.thickness: 480 nm is not within 50 µm to 5 mm" in caplog.text


def test_an_outline_of_another_choir(paper_text, tmp_path):
    (tmp_path / "contour.csv").write_text(csv(WEDGE), encoding="utf-8")
    sections = {}
    for part in paper_text.split("\n["):
        name, _, body = part.partition("]")
        sections[name] = body.strip()
    choir = '\n[[more_choirs]]\njack_arm = "225 mm"\n'
    for name in ("jack", "plectrum", "string"):
        choir += f"[more_choirs.{name}]\n{sections[name]}\n"
    choir = choir.replace(
        "[more_choirs.plectrum]\n", '[more_choirs.plectrum]\noutline = { file = "contour.csv" }\n'
    )
    (tmp_path / "bench.toml").write_text(paper_text + choir, encoding="utf-8")
    rig = load_rig(tmp_path / "bench.toml")
    assert rig.plectrum.outline is None
    outline = rig.more_choirs[0].plectrum.outline
    assert outline is not None
    assert outline.x[-1] == pytest.approx(4.5e-3, rel=1e-15)

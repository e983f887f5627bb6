"""Outlines from micrographs that an independent program draws, and pictures that are refused."""

import dataclasses
import json
import math

import numpy as np
import pytest
from PIL import Image

from benchmarks.micrographs import Camera, carved, draw
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.results.outlined import outline
from sautereau.rig.disk import named_text
from sautereau.rig.load import load_rig
from tests.budget import slow

STRONG = (0.3, -0.25, 0.2)


def photograph(folder, seed=3, **camera):
    shape = carved(np.random.default_rng(seed))
    drawn = draw(shape, Camera(seed=seed, **camera))
    return drawn, drawn.save(folder / "photo.png")


def options(drawn, **more):
    found = {"pixels_per_mm": f"{1 / drawn.pixel!r}"}
    return found | more


def clicked(drawn, off=(0.0, 0.0)):
    column, row = np.add(drawn.clamp, off).tolist()
    return f"{column!r},{row!r}"


@pytest.mark.parametrize("jack", [True, False])
@pytest.mark.parametrize(
    ("left", "upside_down"), [(True, True), slow(False, False), slow(False, True)]
)
@pytest.mark.parametrize(("pixel", "tilt"), [(9e-3, -6.0), slow(4e-3, 7.5)])
def test_the_outline_is_that_of_the_drawing(tmp_path, jack, left, upside_down, pixel, tilt):
    """To a tenth of a pixel in thickness and half a pixel in place."""
    drawn, photo = photograph(
        tmp_path,
        pixel=pixel,
        tilt=math.radians(tilt),
        light=STRONG,
        jack=jack,
        left=left,
        upside_down=upside_down,
        noise=0.04,
    )
    own = options(drawn) if jack else options(drawn, clamp=clicked(drawn))
    found = outline(photo, **own).found
    assert (found.tip_left, found.upside_down, found.face_found) == (left, upside_down, jack)
    assert found.warnings == ()
    assert abs(found.tilt.value - drawn.tilt) < max(4 * found.tilt.std, 1e-4)
    assert np.hypot(*(found.clamp - drawn.clamp)) < 0.5
    edges, shape = found.edges, drawn.shape
    assert edges.x[-1] * 1e3 == pytest.approx(shape.length, abs=0.5 * pixel)
    depth = np.interp(edges.x * 1e3, shape.x, shape.top - shape.bottom)
    off = (edges.top - edges.bottom) * 1e3 - depth
    assert abs(off.mean()) < 0.1 * pixel
    assert np.std(off) < 0.15 * pixel


@pytest.mark.parametrize("dark", [(0.12, 0.8), slow((0.75, 0.2))])
def test_a_soft_shadow_beside_the_plectrum_moves_no_edge(tmp_path, dark):
    """A third of the light is missing below; it moved the edges by 1.4 pixels."""
    drawn, photo = photograph(
        tmp_path, pixel=6e-3, dark=dark, shadow=0.35, shadow_at=(0.1, 0.15, 0.1)
    )
    found = outline(photo, **options(drawn)).found
    depth = np.interp(found.edges.x * 1e3, drawn.shape.x, drawn.shape.top - drawn.shape.bottom)
    off = (found.edges.top - found.edges.bottom) * 1e3 - depth
    assert abs(off.mean()) < 0.15 * drawn.pixel
    assert found.edges.x[-1] * 1e3 == pytest.approx(drawn.shape.length, abs=0.2 * drawn.pixel)


def test_a_rig_takes_length_and_thickness_from_the_file(tmp_path):
    paper_text = named_text("paper", "sautereau.rig", "rig", ValueError)[0]
    drawn, photo = photograph(tmp_path)
    found = outline(photo, **options(drawn))
    found.write(tmp_path / "outline.csv")
    lines = [
        line
        for line in paper_text.splitlines()
        if not line.startswith(('length = { value = "4.5', "thickness ="))
    ]
    assert len(lines) == len(paper_text.splitlines()) - 2
    text = "\n".join(lines).replace("[plectrum]", '[plectrum]\noutline = { file = "outline.csv" }')
    (tmp_path / "bench.toml").write_text(text, encoding="utf-8")
    plectrum = load_rig(tmp_path / "bench.toml").plectrum
    assert plectrum.length == pytest.approx(found.found.edges.x[-1], rel=1e-6)
    assert plectrum.thickness == pytest.approx(found.found.edges.thickness, rel=1e-6)
    assert len(plectrum.ensemble) == len(found.found.ensemble) == 30
    lengths = [own.length for own in plectrum.ensemble]
    np.testing.assert_allclose(lengths, [own.x[-1] for own in found.found.ensemble], rtol=1e-6)
    assert all(own.outline.ensemble == () for own in plectrum.ensemble)


def test_each_way_to_the_scale(tmp_path):
    drawn, photo = photograph(tmp_path, tilt=math.radians(3))
    exact = drawn.pixel * 1e-3
    rows = drawn.image.shape[0]
    for scale, std in (
        ({"pixels_per_mm": "250 +/- 0.5"}, 0.002),
        ({"pixels_per_mm": "250 px/mm +/- 0.5 px/mm"}, 0.002),
        ({"ruler": f"100,{rows - 20} 1350,{rows - 20} 5 mm"}, math.sqrt(2) * 0.7 / 1250),
        ({"length": f"{drawn.shape.length} +/- 0.01 mm"}, 0.01 / drawn.shape.length),
        ({"thickness": f"{drawn.shape.thickness} mm +/- 2 um"}, 0.004),
    ):
        found = outline(photo, **scale).found
        assert found.scale.value == pytest.approx(exact, rel=3e-3)
        assert found.scale.relative == pytest.approx(std, rel=0.5)
        lengths = [own.x[-1] for own in found.ensemble]
        assert np.std(lengths) <= 1.5 * found.edges.x[-1] * max(std, 2e-4)


@pytest.mark.parametrize("off", [-3.0, 3.0])
def test_a_face_that_leans_over_the_root_is_no_part_of_the_plectrum(tmp_path, off):
    """With a given direction that differs from the normal of the jack's face."""
    drawn, photo = photograph(tmp_path, tilt=math.radians(2))
    found = outline(photo, **options(drawn, tilt=f"{2 + off} deg")).found
    assert found.edges.thickness * 1e3 == pytest.approx(drawn.shape.thickness, abs=4e-3)


def test_without_a_jack_the_length_gives_the_clamp(tmp_path):
    drawn, photo = photograph(tmp_path, jack=False, tilt=math.radians(-4))
    found = outline(photo, **options(drawn, length=f"{drawn.shape.length} mm")).found
    assert np.hypot(*(found.clamp - drawn.clamp)) < 2


def _canvas(value=0.8, noise=0.03):
    rng = np.random.default_rng(0)
    return value + rng.normal(0, noise, (500, 900))


def _saved(folder, image):
    path = folder / "photo.png"
    Image.fromarray(np.round(255 * np.clip(image, 0, 1)).astype(np.uint8)).save(path)
    return path, {"pixels_per_mm": "250"}


def _bad_canvas(kind):
    def make(folder):
        image = _canvas()
        y, x = np.mgrid[:500, :900]
        if kind == "flat":
            image[:] = 0.8
        elif kind == "light":
            image *= 1 - 0.5 * x / 900
        elif kind == "disc":
            image[np.hypot(x - 450, y - 250) < 150] = 0.1
        elif kind == "dots":
            image[(x % 200 < 80) & (y % 200 < 80) & (x > 20) & (y > 20)] = 0.1
        elif kind == "hair":
            image[np.abs(y - 250 - 120 * np.sin(x / 60)) < 4] = 0.1
        elif kind == "upright":
            image[:400, 400:500] = 0.1
        return _saved(folder, image)

    return make


def _bad_camera(change=None, own=None, **camera):
    def make(folder):
        drawn, path = photograph(folder, **camera)
        image = drawn.image / 255
        if change:
            path, _ = _saved(folder, change(image, drawn))
        return path, options(drawn, **(own(drawn) if own else {}))

    return make


def _twice(image, drawn):
    return np.vstack([image, image[::-1]])


def _cut(image, drawn):
    return image[:, : -int(1.2 / drawn.pixel)]


def _lower_half(image, drawn):
    return image[: int(drawn.clamp[1]) + 20]


def _ruler(image, drawn):
    row = int(drawn.clamp[1] + 0.15 / drawn.pixel)
    image[row : row + 120] = 0.2
    return image


def _doubled(image, drawn):
    return (image + np.roll(image, (14, 9), (0, 1))) / 2


def _broken(image, drawn):
    column = int(drawn.clamp[0] + 1.5 / drawn.pixel)
    image[:, column : column + 20] = 0.8
    return image


def _moved(image, drawn):
    return np.mean([np.roll(image, i, 0) for i in range(25)], axis=0)


def _finger(image, drawn):
    image[int(drawn.clamp[1]) :, int(drawn.clamp[0] + 2.5 / drawn.pixel) :][:, :200] = 0.1
    return image


def _text(folder):
    (folder / "photo.png").write_text("no picture", encoding="utf-8")
    return folder / "photo.png", {"pixels_per_mm": "250"}


BAD = {
    "one brightness": (_bad_canvas("flat"), "no plectrum"),
    "noise": (_bad_canvas("noise"), "low contrast"),
    "uneven light alone": (_bad_canvas("light"), "low contrast|no plectrum|cut off|objects"),
    "a disc": (_bad_canvas("disc"), "no clamp"),
    "many objects": (_bad_canvas("dots"), "objects"),
    "a hair": (_bad_canvas("hair"), "cut off|fold"),
    "upright": (_bad_canvas("upright"), "upright"),
    "two plectra": (_bad_camera(_twice, jack=False), "2 objects"),
    "tip cut off": (_bad_camera(_cut), "cut off"),
    "lower side cut off": (_bad_camera(_lower_half, jack=False), "cut off|wrong clamp|no clamp"),
    "low contrast": (_bad_camera(dark=(0.77, 0.8), noise=0.002), "low contrast"),
    "noisy": (_bad_camera(dark=(0.6, 0.8), noise=0.08), "low contrast"),
    "out of focus": (_bad_camera(blur=9.0), "out of focus"),
    "tilted": (
        _bad_camera(own=lambda d: {"clamp": clicked(d)}, tilt=math.radians(18), jack=False),
        "tilted by",
    ),
    # So high a face leans over more than half a thickness, and is not found.
    "tilted a little": (_bad_camera(tilt=math.radians(10)), "tilted by|no face"),
    "clamp outside": (_bad_camera(own=lambda d: {"clamp": "-200,300"}), "outside the picture"),
    "clamp on the background": (
        _bad_camera(own=lambda d: {"clamp": clicked(d, (300, 200))}, jack=False),
        "not on the plectrum",
    ),
    "clamp in the jack": (
        _bad_camera(own=lambda d: {"clamp": clicked(d, (-60, 0))}),
        "behind the jack's face",
    ),
    "clamp in front of the jack": (
        _bad_camera(own=lambda d: {"clamp": clicked(d, (60, 0))}),
        "in front of the jack's face",
    ),
    "clamp near the tip": (
        _bad_camera(own=lambda d: {"clamp": clicked(d, (800, 0))}, jack=False),
        "thicknesses from the tip",
    ),
    "no clamp": (_bad_camera(jack=False), "no clamp"),
    "another length": (_bad_camera(own=lambda d: {"length": "5.6 mm"}), "check the clamp"),
    "the wrong side up": (_bad_camera(own=lambda d: {"upper": "down"}), "cut from below"),
    "another scale": (_bad_camera(own=lambda d: {"pixels_per_mm": "40"}), "check the scale"),
    "overexposed": (_bad_camera(exposure=3.0), "overexposed"),
    "a shadow with a sharp edge": (
        _bad_camera(shadow=0.5, shadow_at=(0.12, 0.2, 0.004)),
        "as a shadow",
    ),
    "a defocused disc": (_bad_camera(defocus=14.0), "out of focus"),
    "a ruler across": (_bad_camera(_ruler), "cut off"),
    "dark by a vignette": (_bad_camera(light=(0.0, 0.0, -1.1)), "no clamp|cut off|contrast"),
    "exposed twice": (_bad_camera(_doubled), "out of focus|as a shadow"),
    "broken": (_bad_camera(_broken), "2 objects"),
    "moved while exposed": (_bad_camera(_moved), "out of focus"),
    "a finger at the tip": (_bad_camera(_finger), "cut off"),
    "underexposed": (_bad_camera(exposure=0.04, noise=0.01), "low contrast"),
    "no picture": (_text, "cannot be read"),
}


QUICK = (
    "one brightness", "noise", "a disc", "many objects", "two plectra", "tip cut off",
    "out of focus", "overexposed", "clamp outside", "no clamp", "another length", "no picture",
)  # fmt: skip


@pytest.mark.parametrize("name", [n if n in QUICK else slow(n) for n in BAD])
def test_a_bad_picture_is_refused_or_warned_about(tmp_path, name):
    make, reason = BAD[name]
    path, own = make(tmp_path)
    try:
        said = " ".join(outline(path, **own).found.warnings)
    except AnalysisError as error:
        said = str(error)
    assert said
    assert any(part in said for part in reason.split("|")), said


def test_faults_of_the_options_are_listed_together(tmp_path):
    with pytest.raises(AnalysisError) as raised:
        outline("no.png", pixels_per_mm="-3", length="4 s", clamp="1;2", ruler="1,2 3 mm")
    for part in ("pixels-per-mm: -3", "length: '4 s'", "clamp: '1;2'", "ruler: '1,2 3 mm'"):
        assert part in str(raised.value)


def test_the_result_as_json_frame_text_and_overlay(tmp_path):
    drawn, photo = photograph(tmp_path)
    found = outline(photo, **options(drawn))
    assert json.loads(json.dumps(found.document, allow_nan=False))["clamp_found"]
    assert found.to_frame().attrs["units"]["top"] == "m"
    assert "30 more" in str(found)
    assert len(found.plot().axes) == 3
    assert dataclasses.is_dataclass(found)

"""The report's slow motion: its numbers, and its first frame without a script."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

from sautereau.analysis.loading.press import load_press
from sautereau.analysis.phases import find_phases
from sautereau.analysis.report.build import About, build_report
from sautereau.analysis.report.contents import gather
from sautereau.analysis.report.slow_motion import about, readings, slow_motion
from sautereau.rig.load import with_values
from sautereau.sim_backend.scene import load_scene
from tests.budget import slow
from tests.presses import with_data

MOST_DATA = 150_000  # Bytes of the page for one choir, pictures and numbers


def page_of(paths):
    """Build a page, and return the parts of its slow motion."""
    found = gather(paths, "elastica")
    text = build_report(found, About("a", "0"))
    data = "".join(re.findall('id="slow-motion-data">(.*?)</script>', text, re.S))
    (section,) = re.findall('<section aria-labelledby="slow">.*?</section>', text, re.S)
    pictures = [ElementTree.fromstring(svg) for svg in re.findall("<svg.*?</svg>", section, re.S)]
    return SimpleNamespace(
        shown=found.slow_motion,
        pictures=pictures,
        parts={e.get("id"): e for picture in pictures for e in picture.iter() if e.get("id")},
        moves=json.loads(data or "{}"),
        section=section,
        size=len(section) + len(data),
        named=re.findall("<dt>(.*?)</dt>", text),
    )


@pytest.fixture(scope="module")
def two(write_session, tmp_path_factory):
    paths = write_session(tmp_path_factory.mktemp("two"), 2)
    return page_of(paths), paths


def places(points):
    """Return an SVG's points, shape (n, 2), with z up again."""
    pairs = [pair.split(",") for pair in points.split()]
    return np.array(pairs, float) * (1, -1)


def shift(transform):
    """Return by how much [m] a transform moves upwards in the picture of the head."""
    return -float(transform.removeprefix("translate(0 ").split(")")[0]) * 1e-6


def test_every_moving_part_is_drawn_and_has_every_frame(two):
    page, _ = two
    for name, attributes in page.moves.items():
        assert f'id="{name}"' in page.section
        for values in attributes.values():
            assert len(values) == 101
    assert page.size < MOST_DATA


def test_the_initial_frame_is_that_before_release(two):
    page, _ = two
    frame = page.shown.at_release
    release = page.shown.scene.phases.plucks[0].release
    time = page.shown.scene.time
    assert time[frame] < release <= time[frame + 1]
    for name, element in page.parts.items():
        if name in page.moves:
            for attribute, values in page.moves[name].items():
                assert element.get(attribute) == values[frame]
    assert f'value="{frame}"' in page.section
    assert page.moves["reading-2"][""][frame] == "string held"
    assert page.moves["reading-2"][""][frame + 1] == "string released"


def test_the_readings_are_the_recorded_values(two):
    page, paths = two
    data = load_press(paths[0]).data
    time = page.shown.scene.time
    for name, column, scale, digits in (("3", "force", 1, 3), ("4", "jack_speed", 1e3, 1)):
        seen = np.interp(time, data.index, data[column]) * scale
        values = [float(text.split()[0]) for text in page.moves[f"reading-{name}"][""]]
        np.testing.assert_allclose(values, seen, atol=0.51 * 10**-digits)
    assert page.moves["frame"]["aria-valuetext"][0] == ", ".join(
        page.moves[f"reading-{number}"][""][0] for number in (1, 2, 3, 4)
    )


def test_the_parts_have_the_positions_of_the_press(two):
    """To a micrometre: jack, plectrum and wire; the key's angle to a thousandth of a degree."""
    page, _ = two
    scene = page.shown.scene
    (motion,) = scene.choirs
    plectrum, radius = motion.choir.plectrum, motion.choir.string.diameter / 2
    clamp = plectrum.overlap - plectrum.length
    moves = page.moves
    for frame in range(101):
        body = moves["head-1-body"]["transform"][frame]
        assert shift(body) == pytest.approx(motion.height[frame], abs=1e-6)
        drawn = places(moves["head-1-plectrum"]["points"][frame]) * 1e-6
        lower = (clamp, -radius - plectrum.thickness / 2)
        np.testing.assert_allclose(drawn, motion.outline[frame] + lower, atol=1e-6)
        wire = places(moves["head-1-path"]["points"][frame]) * 1e-6
        np.testing.assert_allclose(wire, motion.wire[frame], atol=1e-6)
        turned = float(moves["key-key"]["transform"][frame][7:-1])
        assert turned == pytest.approx(-np.degrees(scene.angle[frame]), abs=1e-3)


def test_recorded_and_simulated_parts_are_named(two, write_session, tmp_path):
    page, _ = two
    assert "Press 1 (SIMULATED)" in page.section
    assert page.section.count(">SIMULATED</text>") == len(page.pictures)
    assert "Recorded: key, force and speed" in page.section
    assert "Computed by the model" in page.section
    measured = page_of(write_session(tmp_path, 1, simulated=False))
    assert "Press 1 (measured)" in measured.section
    assert "SIMULATED" not in measured.section


@pytest.mark.parametrize(
    ("clearance", "scale", "reason"),
    [("2 mm", 0.0, "no press has a pluck."), ("9.9 mm", 1.0, "press.jack_rise: 10 mm ends before")],
    ids=["no pluck", "the model has none"],
)
def test_where_no_plectrum_can_be_drawn_the_reason_is_given(
    write_session, tmp_path, clearance, scale, reason
):
    rig = with_values(write_session.one.rig, {"jack.string_clearance": clearance})
    page = page_of(write_session(tmp_path, 2, rig=rig, scale=scale))
    assert not page.pictures
    assert f"No press can be shown in slow motion: {reason}" in page.section


@pytest.mark.parametrize("more", [1, slow(3)])
def test_every_choir_is_shown(more, write_session, tmp_path):
    rig = load_scene("two-choirs").true_rig(write_session.one.rig)
    rig = rig.model_copy(update={"more_choirs": rig.more_choirs * more})
    page = page_of(write_session(tmp_path, 1, rig=rig))
    assert len(page.pictures) == 2 * (1 + more) + 2
    assert f"All {1 + more} strings are shown, 1 of them plucked" in page.section
    assert "string 2 from nut to bridge, at rest: no pluck was found" in page.section
    assert page.size < 2 * MOST_DATA
    strings = [f"string {number}" for number in range(1, 2 + more)]
    assert [name for name in page.named if "string" in name] == [
        each for name in strings for each in (f"plectrum of {name}", name)
    ]


def test_a_pluck_at_the_recordings_end_is_shown_to_the_end(make_press):
    press = make_press()
    phases = find_phases(press)
    (held,) = phases.plucks
    short = with_data(press, press.data.loc[held.contact : held.release + 1e-3])
    shown = slow_motion(1, short, phases)
    assert shown.scene.time[0] == short.data.index[0]
    assert shown.scene.time[-1] == short.data.index[-1]
    complete = slow_motion(1, press, phases)
    assert complete.scene.time[-1] >= held.release + 4e-3
    assert shown.scene.time[shown.at_release] < held.release


def test_a_pluck_without_a_string_is_reported(make_press):
    """The rig has one string, and a second pluck was found."""
    press = make_press()
    phases = find_phases(press)
    (held,) = phases.plucks
    later = replace(held, contact=held.contact + 0.05, release=held.release + 0.05, string=None)
    shown = slow_motion(1, press, replace(phases, plucks=(held, later)))
    assert "2 plucks were found, and 1 can be assigned" in about(shown)
    assert readings(shown)["phase"][shown.at_release] == "string 1 held"
    assert readings(shown)["phase"][-1] == "2 of 2 strings released"

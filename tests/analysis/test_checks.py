"""Warnings and remarks about the phases of a press."""

from dataclasses import replace

import pytest

from benchmarks.independent import ONE_FACTOR, press
from benchmarks.simulated import judged_press
from sautereau.analysis.phases import find_phases
from sautereau.analysis.phases.checks import about_exchange, about_flags, about_instants
from sautereau.analysis.phases.contact import Contact
from sautereau.analysis.phases.found import HeldString
from sautereau.analysis.phases.signals import signals_of
from sautereau.analysis.remark import Remark, divided
from sautereau.analysis.results.press import press_line, press_summary
from sautereau.daq.signals.quality_flags import QualityFlag
from tests.budget import slow


def held(contact, release, contact_std=0.1e-3, release_std=0.1e-3):
    return HeldString(contact, release, contact_std, release_std, 0.1, 0.6, 0.5, 100.0)


def contacts_of(plucks, exchange_std=0.0):
    return [Contact(p.contact, p.contact_std, 99.0, 0.5, 1.0, 0.0, exchange_std) for p in plucks]


def instants(*plucks, exchange_std=0.0):
    plucks = [replace(pluck, string=number) for number, pluck in enumerate(plucks, 1)]
    contacts = contacts_of(plucks, exchange_std)
    return [*about_instants(plucks, contacts, 0.01, None), *about_exchange(contacts, plucks)]


def test_uncertainties_above_a_millisecond_are_one_warning_for_each_pluck():
    assert instants(held(0.05, 0.08, 0.9e-3, 0.9e-3)) == []
    (said,) = instants(held(0.05, 0.08, 1.2e-3, 1.1e-3))
    assert said.text.startswith("uncertainty of contact 1.2 ms and of release 1.1 ms, above 1 ms:")
    (said,) = instants(held(0.05, 0.06), held(0.07, 0.09, release_std=2e-3))
    assert said.plucks == (1,)
    assert said.text.startswith("string 2: uncertainty of release 2 ms, above 1 ms: check")


def test_strings_held_at_once_are_no_warning_unless_the_contact_is_uncertain():
    first = held(0.05, 0.08)
    assert instants(first, held(0.06, 0.09)) == []
    (said,) = instants(first, held(0.06, 0.09, contact_std=2e-3))
    assert "the string before, released at 80 ms, is held at the same time" in said.text


def test_two_releases_within_a_millisecond_may_be_one():
    assert instants(held(0.05, 0.08), held(0.06, 0.0811)) == []
    (said,) = instants(held(0.05, 0.08), held(0.06, 0.0809))
    assert said.plucks == (0, 1)
    assert said.text.startswith(
        "string 1 and string 2: their releases are 0.9 ms apart, below 1 ms,"
    )


def test_contacts_that_may_be_exchanged_have_one_warning_about_both():
    said = instants(held(0.05, 0.08, 3e-3), held(0.06, 0.09, 3e-3), exchange_std=2.9e-3)
    assert [remark.plucks for remark in said] == [(0, 1)]
    assert said[0].text.startswith("contacts of string 1 and of string 2: ")
    assert "half their distance, 2.9 ms" in said[0].text


@pytest.mark.parametrize(
    ("kind", "start", "doubt"),
    [
        ("drop-out", 0.0499, False),
        ("drop-out", 0.0799, True),
        ("drop-out", 0.065, None),
        ("clipped", 0.0499, True),
        ("clipped", 0.065, True),
        ("overload", 0.095, None),
    ],
    ids=["at contact", "at release", "between", "at contact too", "before release", "after it"],
)
def test_a_quality_flag_is_a_warning_where_it_can_change_a_result(make_press, kind, start, doubt):
    press = make_press()
    mark = QualityFlag(kind, "velocity", start, start + 0.2e-3)
    said = about_flags(signals_of(press), [mark], [held(0.05, 0.08)], (0.02, 0.12))
    assert [remark.doubt for remark in said] == ([] if doubt is None else [doubt])


def test_a_stretch_at_two_plucks_is_one_warning(make_press):
    mark = QualityFlag("drop-out", "velocity", 0.0799, 0.0801)
    plucks = [replace(held(0.05, 0.08), string=2), held(0.0802, 0.1)]
    (said,) = about_flags(signals_of(make_press()), [mark], plucks, (0.02, 0.12))
    where = "at the release of string 2 and the contact of pluck 2 (unknown string)"
    assert f"79.9 to 80.1 ms, {where}: only" in said.text
    assert said.plucks == (0,)


def test_remarks_are_no_warnings():
    said = [Remark("a"), Remark("b", doubt=False), Remark("c", (0,))]
    assert divided(said) == (("a", "c"), ("b",))


@pytest.mark.parametrize("key", ["key heaves at 120 Hz", slow("key bends at 350 Hz")])
def test_a_compliant_key_without_a_string_has_no_warning(key):
    """The rig has a string at 2 mm, the instrument has none within reach."""
    pytest.importorskip("numba")  # without it the independent simulator takes half a minute
    conditions = ONE_FACTOR[key]
    mute = replace(conditions, choirs=(replace(conditions.choirs[0], clearance=20e-3),))
    pressed = press(mute, 0)
    assert not pressed.truth.plucks
    recorded = judged_press(pressed, {"jack.string_clearance": "2 mm"})
    phases = find_phases(recorded)
    assert phases.plucks == phases.warnings == phases.missed == ()
    assert (phases.fit.model, phases.fit.verdict) == ("compliant", "fair")
    assert not press_line(recorded, phases).rstrip().endswith("!")


def test_doubtful_plucks_are_marked(make_press):
    """The pluck is where the rig has no string."""
    press = make_press(contact=0.1, release=0.115, force_noise=3e-3, velocity_noise=1e-4)
    phases = find_phases(press)
    (pluck,) = phases.plucks
    assert phases.warnings
    assert pluck.doubtful
    assert "!" in press_line(press, phases)
    assert press_summary(press, phases)["plucks"][0]["doubtful"]
    certain = replace(phases, plucks=(replace(pluck, doubtful=False),))
    assert "!" not in press_line(press, certain)
    assert len(press_line(press, certain)) == len(press_line(press, phases))


def test_remarks_mark_no_pluck(make_press):
    """A drop-out far from the pluck, and one at its contact."""
    press = make_press(force_noise=3e-3, velocity_noise=1e-4)
    (pluck,) = find_phases(press).plucks
    at = QualityFlag("drop-out", "velocity", pluck.contact - 1e-4, pluck.contact + 1e-4)
    marked = replace(press, quality_flags=(at,), remarks=("velocity: drop-out in 1 stretch",))
    phases = find_phases(marked)
    said = [", at the contact: only the other channel shows it;" in text for text in phases.remarks]
    assert sum(said) == 1
    assert not phases.warnings
    assert not phases.plucks[0].doubtful
    assert "!" not in press_line(marked, phases)
    assert press_summary(marked, phases)["remarks"] == [*marked.remarks, *phases.remarks]

"""Contact and release set by hand, beside the recording."""

from dataclasses import replace

import pytest

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.phases import find_phases
from sautereau.analysis.phases.by_hand import path_by_hand, write_by_hand
from sautereau.analysis.results.press import press_line, press_summary


@pytest.fixture
def press(make_press, tmp_path):
    """A press whose recording lies in a folder."""
    return replace(make_press(), path=tmp_path / "press.mcap")


def test_instants_set_by_hand_are_used_until_their_file_is_deleted(press):
    found = find_phases(press)
    write_by_hand(press.path, ["50 ms +- 0.3 ms to 0.071 s +- 50 us"])
    phases = find_phases(press)
    (held,) = phases.plucks
    assert (held.contact, held.contact_std) == pytest.approx((0.05, 0.3e-3))
    assert (held.release, held.release_std) == pytest.approx((0.071, 50e-6))
    assert press_summary(press, phases)["fit"]["model"] == "by hand"
    assert "by hand" in press_line(press, phases)
    write_by_hand(press.path, ["52 ms +- 0.3 ms to 72 ms +- 50 us"])
    (held,) = find_phases(press).plucks
    assert held.force_drop == pytest.approx(found.plucks[0].force_drop, rel=0.03)
    assert held.release_force == pytest.approx(found.plucks[0].release_force, rel=0.01)
    path_by_hand(press.path).unlink()
    assert find_phases(press) == found


def test_a_press_without_a_pluck_can_be_set(press):
    write_by_hand(press.path, [])
    assert find_phases(press).plucks == ()


@pytest.mark.parametrize(
    "texts",
    [
        ["52 ms to 72 ms"],
        ["52 ms +- 1 mm to 72 ms +- 1 ms"],
        ["72 ms +- 1 ms to 52 ms +- 1 ms"],
        ["52 ms +- 0 s to 72 ms +- 1 ms"],
        ["52 ms +- 1 ms to 72 ms +- 1 ms", "53 ms +- 1 ms to 71 ms +- 1 ms"],
    ],
)
def test_texts_that_are_no_pluck_are_refused(press, texts):
    with pytest.raises(AnalysisError, match="--at"):
        write_by_hand(press.path, texts)
    assert not path_by_hand(press.path).exists()


@pytest.mark.parametrize("release", ["300 ms", "900 ms"])
def test_a_pluck_after_the_way_down_is_refused(press, release):
    write_by_hand(press.path, [f"52 ms +- 0.3 ms to {release} +- 0.1 ms"])
    with pytest.raises(AnalysisError, match=f"52 to {release} is not within"):
        find_phases(press)


def test_a_damaged_file_is_an_error_that_says_how_to_continue(press):
    path_by_hand(press.path).write_text("plucks = [{contact = 3}]")
    with pytest.raises(AnalysisError, match="pluck 1"):
        find_phases(press)

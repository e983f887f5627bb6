"""Designed experiments: every combination the right number of times, in random order in blocks."""

from collections import Counter
from itertools import groupby, pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some
from scipy.stats import chisquare

import sautereau as st
from sautereau.rig.load import load_rig, with_values
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.design import read_design
from tests.budget import examples, slow

RIG = load_rig()
OVERLAPS = ["0.2 mm", "0.25 mm", "0.3 mm", "0.35 mm"]
SPEEDS = ["0.03 m/s", "0.05 m/s", "0.07 m/s"]


def documents(rows):
    return [row.document() for row in rows]


def in_blocks(rows):
    return [(block, list(own)) for block, own in groupby(rows, lambda row: row.block)]


@examples(20, 100)
@given(
    some.integers(1, 4), some.integers(1, 3), some.integers(1, 3), some.integers(1, 3),
    some.integers(0, 2**64 - 1),
)  # fmt: skip
def test_every_combination_in_random_order_within_blocks(overlaps, speeds, repeats, set_ups, seed):
    factors = {"overlap": OVERLAPS[:overlaps], "jack_speed": SPEEDS[:speeds]}
    set_ups = set_ups if overlaps > 1 else 1
    design = st.design(factors, repeats, seed=seed, set_ups=set_ups)
    rows = design.rows(RIG)
    assert len(rows) == len(design)
    counts = Counter((row.rig.plectrum.overlap, row.rig.press.jack_speed) for row in rows)
    assert len(counts) == overlaps * speeds
    assert set(counts.values()) == {repeats * set_ups}
    blocks = in_blocks(rows)
    assert [block for block, _ in blocks] == list(range(1, overlaps * set_ups + 1))
    held = [{row.levels["overlap"] for row in own} for _, own in blocks]
    assert all(len(levels) == 1 for levels in held)
    assert all(a != b for a, b in pairwise(held))  # otherwise nothing is set up again
    assert documents(design.rows(RIG)) == documents(rows)


@examples(15, 100)
@given(some.data())
def test_more_repeats_and_levels_continue_what_is_planned(data):
    first = st.design({"overlap": OVERLAPS[:2], "jack_speed": SPEEDS[:2]}, 2, seed=1).rows(RIG)
    kept = documents(first[: data.draw(some.integers(0, len(first)))])
    repeats, set_ups = data.draw(some.integers(2, 4)), data.draw(some.integers(1, 2))
    design = st.design({"overlap": OVERLAPS[:3], "jack_speed": SPEEDS}, repeats, set_ups=set_ups)
    rows = design.rows(RIG, kept)
    assert documents(rows)[: len(kept)] == kept
    counts = Counter(tuple(row.levels.values()) for row in rows)
    assert set(counts.values()) == {repeats * set_ups}
    held = [{row.levels["overlap"] for row in own} for _, own in in_blocks(rows)]
    assert all(len(levels) == 1 for levels in held)


@pytest.mark.parametrize("seeds", [150, slow(1000)])
def test_all_orders_are_equally_probable(seeds):
    """Of 3 speeds, each of the 6 orders, with p > 1e-4."""
    design = [st.design({"jack_speed": SPEEDS}, seed=seed).rows(RIG) for seed in range(seeds)]
    orders = Counter(tuple(row.levels["jack_speed"] for row in rows) for rows in design)
    assert len(orders) == 6
    assert chisquare(list(orders.values())).pvalue > 1e-4


def test_a_smaller_design_than_the_planned_one_is_refused():
    planned = documents(st.design({"jack_speed": SPEEDS}, 2, seed=1).rows(RIG))
    said = r"(?s)0\.03 m/s: 1 presses more.*0\.07 m/s: 2 presses more.*--out"
    with pytest.raises(RobotError, match=said):
        st.design({"jack_speed": SPEEDS[:2]}, 1).rows(RIG, planned)


def test_blocks_are_factors_that_change_the_instrument_unless_given():
    factors = {"overlap": OVERLAPS[:2], "jack_speed": SPEEDS[:2]}
    assert st.design(factors).block == ("overlap",)
    assert st.design(factors, block=()).block == ()
    assert st.design(factors, block="jack_speed").block == ("jack_speed",)
    assert {row.block for row in st.design({"jack_speed": SPEEDS}).rows(RIG)} == {1}


def test_a_group_that_is_also_the_table_of_a_dotted_key_is_to_be_renamed(tmp_path):
    (tmp_path / "design.toml").write_text(
        '[factors]\nplectrum.overlap = ["0.2 mm"]\n'
        '[factors.plectrum]\nthin = {plectrum.thickness = "0.35 mm"}\n'
    )
    with pytest.raises(RobotError, match=r"line 3.*rename one of the two, such as a group"):
        read_design(tmp_path / "design.toml")


def test_levels_of_named_values_numbers_and_rig_files(tmp_path):
    (tmp_path / "thick.toml").write_text(
        'name = "thick"\nbase = "paper"\n[plectrum]\nthickness = "0.45 mm"\noverlap = "0.3 mm"\n'
    )
    (tmp_path / "design.toml").write_text(
        "repeats = 2\nseed = 3\n[factors]\n"
        "press.jack_speed = [0.03, 0.050000000000000003]\n"
        'plectrum = {thin = {plectrum.thickness = "0.35 mm"}, thick = "thick.toml"}\n'
    )
    rows = read_design(tmp_path / "design.toml").rows(RIG)
    assert len(rows) == 8
    levels = {"press.jack_speed": "0.05 m/s", "plectrum": "thick"}
    thick = next(row for row in rows if row.levels == levels)
    assert thick.rig == with_values(RIG, {
        "plectrum.thickness": "0.45 mm", "plectrum.overlap": "0.3 mm",
        "press.jack_speed": "0.05 m/s",
    })  # fmt: skip
    assert thick.set_up.keys() == {"plectrum.thickness", "plectrum.overlap"}


def test_every_fault_of_a_design_is_listed(tmp_path):
    factors = {
        "plectrum.overlapp": ["1 mm"], "jack_speed": ["0.1 m/s", "0.1 m/s"], "empty": {},
        "hold": "point", "rise": ["10 mm", "1 cm"], "named": {"a": {"jack_speed": "0.2 m/s"}},
    }  # fmt: skip
    with pytest.raises(RobotError) as caught:
        st.design(factors, 0, block="plectra", set_ups=2)
    for words in (
        "overlap'", "given twice", "1 cm is given twice, as 10 mm", "empty: no levels",
        "hold: no levels", "2 factors change it", "plectra is no factor", "repeats: 0", "set_ups",
    ):  # fmt: skip
        assert words in str(caught.value)
    path = tmp_path / "design.toml"
    path.write_text('repeat = 2\nseed = -1\n[factors]\n"press.jack_speed" = ["0.1 m/s"]\n')
    with pytest.raises(RobotError, match=rf"(?s){path}.*line 1: repeat.*line 2: seed"):
        read_design(path)
    with pytest.raises(RobotError, match="jack_speed = -1 m/s"):
        st.design({"jack_speed": ["-1 m/s"]}).rows(RIG)
    with pytest.raises(RobotError, match=r"none\.toml: cannot be read"):
        read_design(tmp_path / "none.toml")


def test_a_level_is_a_rig_with_a_carved_plectrum(tmp_path):
    """The base has no outline; the level's is the same as in its own file."""
    contour = ["x [mm],z [mm]", *("0,0.25", "2,0.25", "4.5,0.25", "4.5,-0.1", "2,-0.2", "0,-0.25")]
    (tmp_path / "contour.csv").write_text("\n".join(contour))
    level = 'name = "carved"\nbase = "paper"\n[plectrum]\noutline = { file = "contour.csv" }\n'
    (tmp_path / "carved.toml").write_text(level)
    path = tmp_path / "design.toml"
    path.write_text('[factors.plectrum]\nplain = {}\ncarved = "carved.toml"\n')
    carved = load_rig(tmp_path / "carved.toml").plectrum
    found = {row.levels["plectrum"]: row.rig.plectrum for row in read_design(path).rows(RIG)}
    assert found == {"plain": RIG.plectrum, "carved": carved}


def test_presses_of_a_block_do_not_follow_the_order_of_the_levels():
    """Within blocks, place in the order and level are independent (mean place, z < 4.5)."""
    rows = st.design({"jack_speed": SPEEDS}, 100, seed=5).rows(RIG)
    places = {s: np.flatnonzero([r.levels["jack_speed"] == s for r in rows]) for s in SPEEDS}
    n = len(rows)
    std = np.sqrt((n**2 - 1) / 12 / 100 * (n - 100) / (n - 1))
    assert all(abs(own.mean() - (n - 1) / 2) < 4.5 * std for own in places.values())

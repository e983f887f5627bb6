"""Files, recordings and sessions of version 0.1, whose rig has a key under its old name."""

import logging
import shutil
from pathlib import Path

import pytest

from sautereau.rig.document import RENAMED_KEYS, current_key, rename_keys
from sautereau.rig.edit import edit_rig
from sautereau.rig.errors import RigError
from sautereau.rig.load import load_rig, parse_rig, with_values
from sautereau.robot.experiment.plan import read_plan_table

OLD = Path(__file__).parents[1] / "data" / "written_by_0.1"
MOMENT = 4e-3  # N m, in all of them


def test_a_rig_file_is_read_with_a_note_on_what_to_rename(caplog):
    with caplog.at_level(logging.WARNING):
        rig = load_rig(OLD / "rig.toml")
    assert rig.key.gravity_moment == MOMENT
    assert rig.assumed["key.gravity_moment"] == (0.0, 12e-3)
    assert [record.getMessage() for record in caplog.records] == [
        f"{OLD / 'rig.toml'}: line 26: rename key.front_heaviness to gravity_moment"
    ]


def test_a_key_under_both_names_is_refused():
    text = (OLD / "rig.toml").read_text()
    both = text.replace("front_heaviness", 'gravity_moment = "1 mN m"\nfront_heaviness', 1)
    with pytest.raises(RigError, match=r"line 27: key\.front_heaviness: unknown key"):
        parse_rig(both)


def test_an_edit_of_an_old_file_keeps_its_name_of_the_key(tmp_path):
    path = Path(shutil.copy(OLD / "rig.toml", tmp_path))
    edit = edit_rig(path, {"key.gravity_moment": "5 mN m"})
    assert [line for line in edit.difference.splitlines() if line.startswith("+front")]
    assert parse_rig(edit.after).key.gravity_moment == 5e-3


def test_values_may_be_given_by_the_old_key():
    changed = with_values(load_rig(), {"key.front_heaviness": "5 mN m"})
    assert changed.key.gravity_moment == 5e-3


def test_a_plan_table_with_the_old_key(tmp_path):
    path = tmp_path / "plan.csv"
    path.write_text("key.front_heaviness\n5 mN m\n")
    (row,) = read_plan_table(path, load_rig(), 1)
    assert row.rig.key.gravity_moment == 5e-3
    assert list(row.set_up) == ["key.gravity_moment"]


def test_every_new_name_exists_and_no_old_one_does():
    for old, new in RENAMED_KEYS.items():
        assert current_key(old) == new
        with_values(load_rig(), {new: "1 mN m"})
        assert rename_keys({"name": "a rig without tables"}) == []

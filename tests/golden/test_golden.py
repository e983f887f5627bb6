"""The answers are the stored ones; and the net notices changes."""

import copy

import pytest

from sautereau.commands.app import app
from tests.golden import store
from tests.golden.commands import COMMANDS, UNCOVERED
from tests.golden.corpus import Corpus
from tests.golden.groups import GROUPS, QUICK, answers, compared
from tests.golden.tolerances import CHANGED

LARGEST = 1_000_000  # Bytes of all answers


def check(group, names, folder):
    """Fail with a list of what differs."""
    found = list(compared(group, names, answers(group, names, Corpus(folder))))
    assert not found, "\n".join(map(str, found))


@pytest.mark.parametrize("group", QUICK)
def test_some_answers_are_the_stored_ones(group, tmp_path):
    if group == "stand-in":
        pytest.importorskip("numba")  # without it the stand-in's rigid bodies give other samples
    check(group, QUICK[group], tmp_path)


@pytest.mark.parametrize("kinds", [("csv", "wav", "tdms"), ("parquet", "npz", "h5")])
def test_some_files_are_converted_as_before(kinds, tmp_path):
    names = [f"{what} {kind}" for what in ("import", "export") for kind in kinds]
    check("commands", [name for name in names if name in COMMANDS], tmp_path)


@pytest.mark.slow
def test_all_answers_are_the_stored_ones(tmp_path):
    """In one corpus, since groups use the results of each other's commands."""
    pytest.importorskip("numba")
    corpus = Corpus(tmp_path)
    found = []
    for group, cases in GROUPS.items():
        found += compared(group, list(cases), answers(group, list(cases), corpus))
    assert not found, "\n".join(map(str, found))


def changed(group, name, change):
    """Return the differences of a case after a change of its answer."""
    now = copy.deepcopy(store.load(group))
    change(now[name])
    return list(compared(group, [name], now))


def test_an_unchanged_answer_has_no_differences():
    for group, cases in GROUPS.items():
        stored = store.load(group)
        assert list(stored) == list(cases)
        assert not list(compared(group, list(cases), stored))


@pytest.mark.parametrize(("part", "noticed"), [(0.2, True), (0.05, False)])
def test_an_instant_has_a_part_of_its_uncertainty_as_tolerance(part, noticed):
    def change(answer):
        answer["contact"][0] += part * answer["contact_std"][0]

    fields = [each.field for each in changed("stand-in", "paper, 72 mm/s", change)]
    assert fields == ["contact[0]"] * noticed


def test_the_subject_of_a_warning_is_exact():
    (found,) = changed("stand-in", "free-key", lambda a: a["warnings"].__setitem__(0, "no motion"))
    assert (found.field, found.now, found.tolerance[:5]) == ("warnings[0]", "no motion", "exact")
    (found,) = changed("stand-in", "free-key", lambda a: a["warnings"].append("more"))
    assert found.field == "warnings, number of elements"


def test_keys_of_json_and_words_of_texts_are_exact():
    def rename(answer):
        answer["json"]["moment"] = answer["json"].pop("contact")

    found = changed("commands", "predict", rename)
    assert {each.field for each in found} == {"json.contact", "json.moment"}

    def reword(answer):
        answer["text"][0] = answer["text"][0].replace("plectrum", "quill")

    assert [each.field for each in changed("commands", "predict", reword)] == ["text[0]"]


def test_a_byte_on_the_wire_is_exact():
    def change(answer):
        answer["first"][2] = answer["first"][2].replace("\x16", "\x17")

    assert [each.field for each in changed("wire", "press", change)] == ["first[2]"]
    (found,) = changed("wire", "press", lambda a: a.update(sha=a["sha"][:-1] + "x"))
    assert (found.field, found.tolerance) == ("sha", "exact")


def test_the_model_has_a_tight_tolerance():
    def change(answer):
        answer["scalars"]["release"] *= 1 + 1e-8

    assert [f.field for f in changed("model", "beam", change)] == ["scalars.release"]


def test_other_samples_are_no_other_analysis():
    def change(answer):
        answer["sampled"]["force"]["sums"][0] += 1e-5
        answer["contact"][0] += 1
        answer["warnings"] = ["other"]

    (found,) = changed("stand-in", "paper, 72 mm/s", change)
    assert (found.field, found.stored) == ("sampled", CHANGED)


def test_the_answers_are_small():
    sizes = {path.stem: path.stat().st_size for path in store.FOLDER.iterdir()}
    assert sizes.keys() == GROUPS.keys()
    assert sum(sizes.values()) < LARGEST


def test_every_command_is_covered_or_has_a_reason():
    covered = {words.split()[0] for words in COMMANDS.values()}
    assert covered | UNCOVERED.keys() == set(app)
    assert not covered & UNCOVERED.keys()

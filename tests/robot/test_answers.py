"""Answers to questions that are given in advance."""

import pytest

from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.steps import Answers, answers_of


def test_a_question_is_named_by_its_beginning_and_the_longest_name_counts():
    answers = Answers({"Is": "yes", "Is its way": "no", "Name?": ["a", "b"]})
    assert answers.take("Is it homed?").answer == "yes"
    assert answers.take("Is its way free?").answer == "no"
    assert [answers.take("Name?").answer for _ in range(2)] == ["a", "b"]
    assert answers.unused == []


def test_a_missing_answer_and_unknown_questions_are_listed_together():
    answers = Answers({"Name?": ["a"], "Nmae?": "b", "Other": "c", "More": ["d", "e"]}, "x.toml")
    answers.take("Name?")
    answers.take("More")
    unused = r"'Nmae\?': no such.*'Other': no.*'More': 2 answers, and asked 1 times"
    with pytest.raises(RobotError, match=rf"(?s)x\.toml: 4 faults.*question 2 of .*{unused}"):
        answers.take("Name?")
    with pytest.raises(RobotError, match="no answer to 'Which'"):
        answers.take("Which")


def test_an_answer_that_is_not_possible_is_refused():
    with pytest.raises(RobotError, match="'maybe' is no answer to 'Free'; give yes or no"):
        Answers({"Free": "maybe"}).take("Free", "yes", "no")


def test_a_file_of_answers(tmp_path):
    path = tmp_path / "answers.toml"
    path.write_text('"Its name?" = ["delrin", "quill"]\n', encoding="utf-8")
    found = answers_of(path).take("Its name?")
    assert (found.answer, found.by) == ("delrin", f"answers {path}")
    for text, said in (
        ('a = 1\n"" = "x"\nb = []\nc = ["d", 2]\n', "4 faults"),
        ("a = ", "not valid TOML"),
    ):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(RobotError, match=said):
            answers_of(path)
    with pytest.raises(RobotError, match=r"none\.toml: cannot be read"):
        answers_of(tmp_path / "none.toml")

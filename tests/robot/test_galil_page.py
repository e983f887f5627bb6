"""docs/galil.md explains everything that the driver sends, and is up to date."""

import re

from docs.galil import COMMANDS, OPERANDS, PAGE, ROUTINES, page, sent
from sautereau.robot.drivers.galil.dmc import controller_program


def test_the_page_is_up_to_date():
    assert PAGE.read_text(encoding="utf-8") == page(), "run: python -m docs.galil"


def test_every_operand_and_program_line_is_explained_and_nothing_else():
    commands, operands = sent()
    assert set(operands) == OPERANDS
    assert set(commands) == COMMANDS
    for line in controller_program(1):
        if line.startswith("#"):
            assert line in ROUTINES or line[1:5].isalpha()
        for command in line.split(";"):
            if command.startswith("#"):
                continue
            found = re.match(r"[A-Z]{2}(?= |$)", command)
            assert "=" in command if found is None else found[0] in COMMANDS


def test_a_press_sends_only_what_is_explained(lines):
    for sent_line, _ in [*lines.press, *lines.home]:
        for command in sent_line.split(";"):
            if command and command.isascii() and command.isprintable() and command[0] != "#":
                found = re.match(r"[A-Z]{2}", command)
                assert found is None or found[0] in COMMANDS, command

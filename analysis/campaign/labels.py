"""Levels of touch in the words of musicians, and the judgements in an operator's notes."""

import re

LEVELS = ("soft", "medium", "hard")  # Values of the column `TOUCH`, in increasing order
TOUCH = "touch"  # Column of the judgements; null without a judgement
_LINE = re.compile(rf"^\s*touch\s*[:=]\s*({'|'.join(LEVELS)})\s*$", re.IGNORECASE | re.MULTILINE)


def touch_in(notes: str) -> str | None:
    """Return the last judgement in an operator's notes, a line such as `touch: hard`, or None."""
    found = _LINE.findall(notes)
    return found[-1].lower() if found else None

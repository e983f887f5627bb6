"""Text from outside, made fit for a page: every character is seen, and none of them acts."""

from typing import Any

from markupsafe import Markup

MOST = 500
"""Characters of one text that a page shows; the recording holds the rest."""


def shown(value: Any, most: int = MOST) -> Any:
    """Return a value as a page shows it: a text without unseen characters, cut where it is long.

    Escaping is left to the template. What is markup already, or no text, stays as it is.

    Args:
        value: Of a recording, or of the page itself.
        most: Characters of the text that are kept.
    """
    if isinstance(value, Markup) or not isinstance(value, str):
        return value
    kept = "".join(c if c.isprintable() or c in "\n\t" else _escape(c) for c in value[:most])
    return kept if len(value) <= most else f"{kept} … ({len(value):,} characters in all)"


def _escape(character: str) -> str:
    number = ord(character)
    return f"\\x{number:02x}" if number < 0x100 else f"\\u{{{number:x}}}"

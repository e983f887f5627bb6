"""Checksum and numbers in a line of the ASCII protocol."""

LARGEST = 1e10
"""Largest magnitude of a number that is accepted."""


def checksum(text: str) -> int:
    """Return the exclusive or of a line's bytes."""
    found = 0
    for byte in text.encode("latin-1"):
        found ^= byte
    return found


def number(word: str) -> float | None:
    """Return a number, or None for a text that is none, or too large a number."""
    try:
        value = float(word)
    except ValueError:
        return None
    return value if abs(value) <= LARGEST else None


def numbers(text: str) -> list[float]:
    """Return the leading numbers after a command's letter."""
    found = []
    for word in text[1:].split():
        if (value := number(word)) is None:
            break
        found.append(value)
    return found

"""Mutations of bytes, texts and JSON: hostile values where the format expects ordinary ones."""

import json
import random
import re
import struct
from typing import Any

NUMBERS = (
    "0", "-0", "-1", "1", "2", "0.5", "1e-3", "1e3", "1e6", "1e9", "1e-9", "1e18", "1e-18",
    "1e308", "-1e308", "1e400", "-1e400", "5e-324", "1e-400", "nan", "inf", "-inf", "Infinity",
    "2147483648", "9007199254740993", "9223372036854775808", "18446744073709551616", "9" * 400,
    "1_000", "0x10", "1e1_0", "٣", "½", "1,5", "--1", "1e", "+", ".",
)  # fmt: skip
UNITS = (
    "m", "mm", "s", "ms", "kg", "g", "N", "mN", "V", "rad", "deg", "Hz", "kHz", "m/s", "rad/s",
    "N*m", "kg m^2", "%", "degC", "dB", "delta_degC", "m**99", "m**(9**9**9)", "m^-99", "1/m",
    "lightyear", "planck_length", "µm", "counts", "m m", "pi", "e", "__class__", "0 m", "m;",
)  # fmt: skip
TEXTS = (
    "", " ", "\t", "\0", "\x1b[2J", "\r", "\n", "\u2028", "\u202e", "\ufeff", "\ud7ff", "é", "😀",
    "=1+1", "@SUM(A1)", "../../x", "/dev/zero", "/dev/stdin", ".", "~", "-", "--", "%s", "{0}",
    "null", "true", "NaN", "a" * 70_000, "[" * 5000, "{" * 5000, '"', "'", '"""', "'''", "#",
)  # fmt: skip
DEEPEST = 20  # Levels of a document in which values are changed
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
_TOKEN = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?|\w+|[^\w\s]")


def of_bytes(data: bytes, dice: random.Random) -> bytes:
    """Overwrite, cut, repeat or move bytes, or put an integer or a double without sense."""
    found = bytearray(data)
    size = max(1, len(found))
    for _ in range(dice.choice((1, 1, 2, 5))):
        at = dice.choice((dice.randrange(size), dice.randrange(min(size, 64))))
        stop = min(len(found), at + dice.choice((1, 4, 16, 256, size)))
        match dice.randrange(7):
            case 0:
                found[at : at + 1] = bytes([dice.randrange(256)])
            case 1:
                del found[at:]
            case 2:
                del found[at:stop]
            case 3:
                found[at:at] = found[at:stop][: 1 << 20]
            case 4:
                found[at:stop] = bytes(stop - at)
            case 5:
                found[at : at + 8] = struct.pack("<d", float(dice.choice(NUMBERS[:24])))
            case 6:
                width, order = dice.choice((1, 2, 4, 8)), dice.choice(("little", "big"))
                value = dice.choice((0, 1, 127, 255, 2**31 - 1, 2**31, 2**63, -1, size, size // 2))
                found[at : at + width] = (value % 256**width).to_bytes(width, order)
        size = max(1, len(found))
    return bytes(found)


LARGEST = 10**7  # Characters; of one line only, a text grows 300-fold at once


def of_text(text: str, dice: random.Random, words: tuple[str, ...] = ()) -> str:
    """Change numbers, words, lines of a text, or nest something in it.

    Args:
        text: Of the format.
        dice: Random numbers.
        words: Of the format, to put in.
    """
    for _ in range(dice.choice((1, 1, 1, 2, 4))):
        kind = dice.randrange(9)
        tokens = list((_NUMBER if kind < 3 else _TOKEN).finditer(text))
        lines = text.split("\n")
        place = dice.randrange(len(lines))
        if kind < 5 and tokens:
            token = dice.choice(tokens)
            other = dice.choice(tokens)[0]
            new = dice.choice(NUMBERS) if kind < 3 else dice.choice((*words, *UNITS, *TEXTS, other))
            text = text[: token.start()] + new + text[token.end() :]
        elif kind == 5:
            del lines[place]
            text = "\n".join(lines)
        elif kind == 6:
            line, times = lines[dice.randrange(len(lines))], dice.choice((1, 2, 300))
            lines[place:place] = [line] * min(times, 1 + LARGEST // (1 + len(line)))
            text = "\n".join(lines)
        elif kind == 7:
            at = dice.randrange(len(text) + 1)
            text = text[:at] + dice.choice(TEXTS) + text[at:]
        else:
            at = dice.randrange(len(text) + 1)
            text = dice.choice((text[:at], text[at:]))
    return text


def hostile(dice: random.Random) -> Any:
    """Return a JSON value that is probably refused."""
    return dice.choice((
        None, True, False, 0, -1, 1, 2**31, 2**53 + 1, 2**63, 2**64, 10**300, 10**400, 0.5, -0.0,
        1e308, -1e308, 5e-324, float("nan"), float("inf"), -float("inf"), [], {}, [[]], [{}],
        [None], [0] * 5000, {"": 0}, {"a": {"b": {}}}, "1e400", "nan",
        dice.choice(NUMBERS), f"{dice.choice(NUMBERS)} {dice.choice(UNITS)}", dice.choice(TEXTS),
        nested(dice.choice((30, 900, 5000))),
    ))  # fmt: skip


def nested(depth: int) -> Any:
    found: Any = 0
    for _ in range(depth):
        found = [found]
    return found


def of_tree(value: Any, dice: random.Random) -> Any:
    """Return a JSON document with some values replaced, removed, repeated or exchanged."""
    for _ in range(dice.choice((1, 1, 2, 3))):
        places = list(_places(value, DEEPEST))
        if not places:
            return hostile(dice)
        holder, key = dice.choice(places)
        match dice.randrange(6):
            case 0:
                del holder[key]
            case 1 if isinstance(holder, list):
                holder.insert(dice.randrange(len(holder) + 1), holder[key])
            case 1:
                holder[dice.choice((dice.choice(TEXTS), f"{key}_"))] = holder[key]
            case 2:
                other, name = dice.choice(places)
                if name in other if isinstance(other, dict) else name < len(other):
                    holder[key] = other[name]
            case 3 if isinstance(holder[key], str):
                holder[key] = of_text(holder[key], dice)
            case _:
                holder[key] = hostile(dice)
    return value


def _places(value: Any, depth: int) -> Any:
    """Yield container and key of every value; of a long list only the ends."""
    if isinstance(value, dict):
        keys = list(value)
    elif isinstance(value, list):
        keys = [*range(min(3, len(value))), *range(max(3, len(value) - 2), len(value))]
    else:
        return
    for key in keys if depth else ():
        yield value, key
        yield from _places(value[key], depth - 1)


def of_json(text: str, dice: random.Random) -> bytes:
    """Change a JSON document in its values, or as a text."""
    if dice.random() < 0.15:
        return of_text(text, dice).encode("utf-8", "surrogatepass")
    return json_text(of_tree(json.loads(text), dice)).encode()


def json_text(value: Any) -> str:
    """Return a document as JSON; a text that no parser ends where it is too deep to write."""
    try:
        return json.dumps(value)
    except (RecursionError, ValueError):  # too deep, or a part of itself
        return '{"a": ' * 3000


def as_bytes(text: str, dice: random.Random) -> bytes:
    """Encode a text, in one of twenty cases as no program should."""
    encoding = dice.choice(("utf-16", "latin-1", "utf-8-sig")) if dice.random() < 0.05 else "utf-8"
    data = text.encode(encoding, "replace")
    return of_bytes(data, dice) if dice.random() < 0.05 else data

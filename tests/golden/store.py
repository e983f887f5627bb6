"""The stored answers: a file for each group, a field of an answer in a line where it fits."""

import json
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).with_name("answers")
WIDTH = 180  # Characters of a line that holds a list or an object as one piece


def load(group: str, folder: Path = FOLDER) -> dict[str, Any]:
    """Return the stored answers of a group by the name of their case."""
    path = folder / f"{group}.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def save(group: str, answers: dict[str, Any], folder: Path = FOLDER) -> None:
    """Store the answers of a group."""
    folder.mkdir(exist_ok=True)
    text = readable(answers) + "\n"
    (folder / f"{group}.json").write_text(text, encoding="utf-8")


def readable(value: Any, indent: str = "") -> str:
    """Return JSON in which what fits into a line is in a line."""
    text = json.dumps(value, ensure_ascii=False, separators=(",", ":"))
    if len(text) + len(indent) <= WIDTH or not isinstance(value, dict | list) or not value:
        return text
    inner = indent + " "
    if isinstance(value, dict):
        parts = [
            f"{inner}{json.dumps(name, ensure_ascii=False)}:{readable(each, inner)}"
            for name, each in value.items()
        ]
        return "{\n" + ",\n".join(parts) + f"\n{indent}}}"
    return "[\n" + ",\n".join(inner + readable(each, inner) for each in value) + f"\n{indent}]"

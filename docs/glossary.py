"""The tables of quantities on docs/glossary.md, whose other text is written by hand.

`python -m docs.glossary` rewrites them; a test checks that they are up to date.
"""

import re
from pathlib import Path

from sautereau.rig.quantities import SECTIONS, Quantity

PAGE = Path(__file__).with_suffix(".md")
_TABLES = re.compile(r"^### .*?(?=^## )", re.DOTALL | re.MULTILINE)


def page() -> str:
    """Return the text of the page."""
    tables = "".join(_table(heading, [*each.values()]) for heading, each in SECTIONS.items())
    return _TABLES.sub(lambda _: tables, PAGE.read_text(encoding="utf-8"))


def _table(heading: str, quantities: list[Quantity]) -> str:
    head = "| name | symbol | unit | label | definition |\n|---|---|---|---|---|\n"
    rows = "".join(
        f"| `{q.name}` | {q.symbol and f'`{q.symbol}`'} | {q.unit} | {q.label} | {q.definition} |\n"
        for q in quantities
    )
    return f"### {heading}\n\n{head}{rows}\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")

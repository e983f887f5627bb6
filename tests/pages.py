"""Pages of the documentation: their text, and their blocks of code."""

import re
import textwrap
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
_FENCE = re.compile(
    r"^(?P<indent> *)```(?P<language>[\w.+-]*)(?P<rest>[^\n]*)\n(?P<body>.*?)^(?P=indent)```",
    re.DOTALL | re.MULTILINE,
)
_INDENTED = re.compile(r"(?:^ {4}.*\n)+", re.MULTILINE)


@dataclass(frozen=True)
class Block:
    """A fenced block of a page; an indented one counts as a fence without a language."""

    language: str
    title: str
    """Name of the file that it shows; empty for none."""
    body: str


@dataclass(frozen=True)
class Page:
    path: Path
    text: str
    blocks: tuple[Block, ...]

    @property
    def prose(self) -> str:
        """The page without its blocks."""
        return _FENCE.sub("", self.text)

    @property
    def indented(self) -> list[str]:
        """The blocks that are only indented."""
        return [textwrap.dedent(found) for found in _INDENTED.findall(self.prose)]

    def bodies(self, language: str) -> list[str]:
        """The bodies of the blocks of a language."""
        return [block.body for block in self.blocks if block.language == language]


@cache
def read_page(path: Path | str) -> Page:
    """Return a page; a name without its folder is one of docs/."""
    path = ROOT / "docs" / path
    text = path.read_text(encoding="utf-8")
    blocks = []
    for found in _FENCE.finditer(text):
        title = re.search(r'title="([^"]+)"', found["rest"])
        body = textwrap.dedent(found["body"])
        blocks.append(Block(found["language"], title[1] if title else "", body))
    return Page(path, text, tuple(blocks))

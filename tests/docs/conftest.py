"""The pages of the documentation: their commands, snippets and prose."""

import re
import textwrap
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
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


LONG = ("campaigns", "ci", "pictures", "transient")
"""Pages whose commands take many seconds, and are tested as commands elsewhere."""


def read_page(path: Path) -> Page:
    text = path.read_text(encoding="utf-8")
    blocks = []
    for found in _FENCE.finditer(text):
        title = re.search(r'title="([^"]+)"', found["rest"])
        body = textwrap.dedent(found["body"])
        blocks.append(Block(found["language"], title[1] if title else "", body))
    return Page(path, text, tuple(blocks))


@pytest.fixture(name="read_page", scope="session")
def page_reader():
    """`read_page`."""
    return read_page


def _paths() -> list[Path]:
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Parametrize tests by page: all pages, or those with commands that are run."""
    pages = [read_page(path) for path in _paths()]
    if "page" in metafunc.fixturenames:
        metafunc.parametrize("page", pages, ids=[p.path.stem for p in pages])
    if "run_page" in metafunc.fixturenames:
        run = [p for p in pages if any(b.language == "console" for b in p.blocks)]
        marked = [
            pytest.param(p, marks=pytest.mark.slow) if p.path.stem in LONG else p for p in run
        ]
        metafunc.parametrize("run_page", marked, ids=[p.path.stem for p in run])

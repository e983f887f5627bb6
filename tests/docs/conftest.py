"""The pages of the documentation: their commands, snippets and prose."""

import pytest

from tests.pages import ROOT, read_page

LONG = (
    "README",
    "bench",
    "campaigns",
    "choosing",
    "ci",
    "exchange",
    "first-press",
    "pictures",
    "transient",
)
"""Pages whose commands take many seconds, and are tested as commands elsewhere."""


PAGES = [read_page(ROOT / "README.md"), *map(read_page, sorted((ROOT / "docs").rglob("*.md")))]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Parametrize tests by page: all pages, or those with commands that are run."""
    if "page" in metafunc.fixturenames:
        metafunc.parametrize("page", PAGES, ids=[p.path.stem for p in PAGES])
    if "run_page" in metafunc.fixturenames:
        run = [p for p in PAGES if any(b.language == "console" for b in p.blocks)]
        marked = [
            pytest.param(p, marks=pytest.mark.slow) if p.path.stem in LONG else p for p in run
        ]
        metafunc.parametrize("run_page", marked, ids=[p.path.stem for p in run])

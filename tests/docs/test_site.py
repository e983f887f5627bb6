"""The site: it holds every page, every link has a target, nothing is loaded from elsewhere."""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from examples.gallery import pictures
from sautereau.commands.app import app
from sautereau.rig.faults import model_keys
from sautereau.rig.schema import Rig
from sautereau.sim_backend.scene import Scene

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
GENERATED = {"rig-file.md", "scene-file.md", "commands.md", "tutorial.md"}
_LINK = re.compile(r"\]\((?!https?:)([^)#\s]+)(?:#[^)]*)?\)")


@pytest.fixture(scope="module")
def hooks():
    spec = importlib.util.spec_from_file_location("hooks", DOCS / "hooks.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def written(hooks):
    """Names of the pages and pictures that the hooks generate."""
    rooms = {f"api/{room}/index.md" for room in hooks.ROOMS}
    modules = {
        f"api/{room}/{name.partition('.')[2]}.md"
        for room in hooks.ROOMS
        for name in hooks.modules(room)
    }
    drawn = {f"gallery/{name}" for name in pictures()}
    return GENERATED | rooms | modules | drawn


def test_every_page_is_in_the_navigation(written):
    def leaves(node):
        if isinstance(node, dict):
            node = list(node.values())
        return (
            [leaf for inner in node for leaf in leaves(inner)] if isinstance(node, list) else [node]
        )

    listed = set(leaves(yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"]))
    pages = {path.name for path in DOCS.glob("*.md")}
    assert listed == pages | GENERATED


def test_every_relative_link_leads_to_a_page(written):
    for path in DOCS.rglob("*.md"):
        for target in _LINK.findall(path.read_text(encoding="utf-8")):
            found = (path.parent / target).resolve()
            assert found.exists() or str(found.relative_to(DOCS)) in written, (path.name, target)


def test_the_page_of_the_rig_file_has_every_key(hooks):
    page = hooks.rig_page()
    assert "| `jack_speed` | m/s | >=&nbsp;0.005, <= 1 | needed | 0.072 m/s (paper) |" in page
    assert "12 mm (assumed 6 mm to 20 mm)" in page
    assert _missing_keys(page, Rig) == []


def test_the_page_of_the_scene_file_has_every_key(hooks):
    page = hooks.scene_page()
    assert "| `finger` |  | one&nbsp;of push, ideal, servo | needed | `push` is a constant" in page
    assert "| `two-choirs` | ideal finger on a key with two choirs" in page
    missing = _missing_keys(page, Scene)
    assert all(key.startswith("more_choirs.") for key in missing), missing


def _missing_keys(page, model):
    """Return the keys of a model that are neither in a row nor in a heading of its page."""
    names = {key: key.rpartition(".")[2] for key in model_keys(model)}
    return [key for key, name in names.items() if not re.search(rf"`{name}`|[.[]{name}]", page)]


def test_the_page_of_the_commands_has_every_command(hooks):
    page = hooks.commands_page()
    for name in app:
        assert name.startswith("-") or f"sautereau {name}" in page


def test_measured_tables_are_those_of_the_figures(hooks):
    text = (DOCS / "choosing.md").read_text(encoding="utf-8")
    shown = hooks.on_page_markdown(text, None, None, None)
    assert "<!-- figures" in text
    assert "<!-- figures" not in shown
    assert "| | error of plectrum force | error of pluck duration |" in shown
    assert re.search(r"\| beam \| 22\.\d+ % \|", shown)
    assert "| what | measured |" in shown
    with pytest.raises(hooks.PluginError, match="no such thing"):
        hooks.measured("no such thing")
    with pytest.raises(hooks.PluginError, match="weight"):
        hooks.measured("Levels of the plectrum", "weight")


def test_equations_need_no_script(hooks):
    inline = r'<p>with <span class="arithmatex">\(a &lt; b\)</span></p>'
    html = inline + r'<div class="arithmatex">\[x^2\]</div>'
    drawn = hooks.on_page_content(html, None, None, None)
    assert drawn.count("<math") == 2
    assert "arithmatex" not in drawn


@pytest.mark.slow
def test_the_site_builds_without_a_warning(tmp_path):
    subprocess.run(["make", "-s", "links"], cwd=ROOT, check=True)
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)],
        cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    assert (tmp_path / "api" / "trajectory" / "press.html").is_file()
    tutorial = (tmp_path / "tutorial.html").read_text(encoding="utf-8")
    first = (tmp_path / "first-press.html").read_text(encoding="utf-8")
    assert "Model error" in tutorial
    assert "tutorial/1.png" in tutorial
    assert "first-press/press-0001-to-press-0003.png" in first
    assert "..." not in first.partition("press-0001.mcap")[2].partition("\n")[0]
    for page in tmp_path.rglob("*.html"):
        html = page.read_text(encoding="utf-8")
        assert not re.search(r'<(?:script|link|img)[^>]+(?:src|href)="https?://', html), page

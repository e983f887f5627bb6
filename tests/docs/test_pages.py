"""Every command of README and docs runs, or at least parses; every snippet is valid.

A ```console block is run: its `$ ` lines in bash, all of a page in one folder and in order, on
the stand-in. The output shown beneath a command must be the real one, except for numbers that
depend on the machine, which the page writes as `...`. A block with title="NAME" is that file.
Recipes of `make` are checked with `make -n`: the docs run their commands. Commands in other blocks
need the hardware, or hours: they must parse.
"""

import ast
import doctest
import importlib
import json
import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml
from cyclopts import CycloptsError

from sautereau.analysis.model.plectrum.levels import LEVELS
from sautereau.commands.app import app
from tests.pages import ROOT, read_page

BIN = Path(sys.executable).parent
MARK = "@@ command "
FORKED = ROOT / "tests" / "forked.py"
PROLOGUE = f"""
set -eo pipefail
sautereau() {{ {sys.executable} -S {FORKED} run "$SERVER" "$@"; }}
make() {{ command make -C {ROOT} -s -o .venv/installed -n BIN={BIN} OUT="$PWD/out" "$@"; }}
trap 'kill $(jobs -p) 2>/dev/null || true' EXIT
"""
LONGEST = 280  # s, timeout of a page's commands on a busy machine; alone they take a tenth of it


@pytest.fixture
def server(command_server):
    """Path of the socket of the command server."""
    return command_server.path


@pytest.mark.skipif(sys.platform == "win32", reason="the pages are written for bash")
def test_what_a_page_runs_works_and_prints_what_it_shows(run_page, server, tmp_path):
    script, shown = [PROLOGUE], []
    for block in run_page.blocks:
        if block.title:
            script.append(f"mkdir -p {shlex.quote(str(Path(block.title).parent))}")
            script.append(f"cat > {shlex.quote(block.title)} <<'@@END'\n{block.body}@@END")
        elif block.language == "console":
            for command, output in _session(block.body):
                script += [f"echo '{MARK}{len(shown)}'", command]
                shown.append((command, output))
    done = _bash("\n".join([*script, f"echo '{MARK}end'"]), tmp_path, server)
    assert done.returncode == 0, done.stdout
    printed = re.split(rf"{MARK}\w+\n", done.stdout)[1:]
    options = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    for (command, output), got in zip(shown, printed, strict=False):
        if output and not doctest.OutputChecker().check_output(output, got, options):
            pytest.fail(f"$ {command}\nis shown with\n{output}\nand printed\n{got}")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="the steps are written for bash")
def test_the_steps_of_the_workflow_work(server, tmp_path):
    page = read_page("ci.md")
    files = {block.title: block.body for block in page.blocks if block.title}
    workflow = yaml.safe_load(files.pop(".github/workflows/press.yml"))
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    steps = [step["run"] for step in workflow["jobs"]["press"]["steps"] if "run" in step]
    own = [step for step in steps if "pip install" not in step]
    assert len(own) == len(steps) - 1
    script = [PROLOGUE, "set -x", "sautereau init my-rig.toml", *own]
    done = _bash("\n".join(script), tmp_path, server)
    assert done.returncode == 0, done.stdout
    assert "ideal.json: pluck duration, model error" in done.stdout


def _bash(script: str, folder: Path, server: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["bash", "-c", script],
        cwd=folder,
        env=os.environ
        | {"PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}", "NO_COLOR": "1", "SERVER": server},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=LONGEST,
        check=False,
    )


def _session(body: str) -> list[tuple[str, str]]:
    """Return the commands of a session, each with the output shown beneath it."""
    found = []
    for part in re.split(r"(?m)^\$ ", body)[1:]:
        command, _, output = re.sub(r"\\\n", "", part).partition("\n")
        found.append((command, output))
    return found


def _commands(page) -> list[str]:
    """Return every line of a page that is a sautereau command."""
    texts = [re.sub(r"\\\n", "", block.body) for block in page.blocks]
    texts += [re.sub(r"\\\n", "", text) for text in page.indented]
    pattern = r"(?m)^(?:\$ |- run: | *run: )?(sautereau .*)$"
    return [line for text in texts for line in re.findall(pattern, text)]


def test_commands_parse(page, monkeypatch):
    if LEVELS.group in page.text:  # the page adds a level
        monkeypatch.setattr(LEVELS, "unknown", lambda level: "")
    for line in _commands(page):
        alone = re.split(r"\s(?:\|\||&&|[|&>;])", line.rstrip(" &"))[0]
        words = [w for w in shlex.split(alone, comments=True)[1:] if not w.startswith("[")]
        if not words or words in (["--help"], ["--version"]) or "-h" in words:
            continue
        try:
            app.parse_args(words, print_error=False, exit_on_error=False)
        except (CycloptsError, SystemExit) as error:
            pytest.fail(f"{page.path.name}: {line}\n{error}")


def test_commands_in_the_text_exist(page):
    known = {name for name in app if not name.startswith("-")}
    for name in re.findall(r"`sautereau ([\w-]+)", page.prose):
        assert name in known or name.startswith("-"), f"{page.path.name}: sautereau {name}"


def test_snippets_are_valid(page):
    readers = {"toml": tomllib.loads, "json": json.loads, "yaml": yaml.safe_load}
    for block in page.blocks:
        if reader := readers.get(block.language):
            reader(block.body)
        elif block.language == "python":
            _imports_exist(ast.parse(block.body))


def _imports_exist(tree: ast.AST) -> None:
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            module = importlib.import_module(node.module)
            missing = [a.name for a in node.names if not hasattr(module, a.name)]
            assert not missing, f"{node.module} has no {missing}"
        elif isinstance(node, ast.Import):
            for alias in node.names:
                importlib.import_module(alias.name)


def test_links_from_the_readme_lead_to_files():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", text):
        assert target.startswith("http") or (ROOT / target).exists(), target

"""Pages whose code runs when the site is built: their outputs and pictures are the present ones."""

import ast
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import chdir, redirect_stdout
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any

MOST_ROWS, MOST_COLUMNS, WIDTH = 12, 8, 100  # Of a table that a page shows
Pictures = dict[str, bytes]  # Content by name in the site
_CONSOLE = re.compile(r"^```console\n(.*?)^```", re.DOTALL | re.MULTILINE)
_PICTURE = re.compile(r"<!-- picture: (\S+) (.*?) -->")
_MARK = "@@ command "


def notebook(path: Path) -> tuple[str, Pictures]:
    """Run a notebook; return it as a page with its outputs, and its pictures."""
    parts = [f"This page is the notebook [{path.name}]({path.name}), run when the site was built."]
    pictures: Pictures = {}
    names: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
            text = "".join(cell["source"])
            if cell["cell_type"] == "markdown":
                parts.append(text)
                continue
            parts.append(f"```python\n{text}\n```")
            printed, shown = _run(text, names)
            if printed:
                parts.append(f"```text\n{printed}\n```")
            if shown:
                name = f"{path.stem}/{len(pictures) + 1}.png"
                pictures[name] = shown
                parts.append(f"![What this cell shows]({name})")
    heading = parts.pop(1)
    return "\n\n".join([heading, *parts]) + "\n", pictures


def _run(source: str, names: dict[str, Any]) -> tuple[str, bytes]:
    """Run a cell; return what it prints and shows as text, and the picture that it shows."""
    tree, value, picture = ast.parse(source), None, b""
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    with redirect_stdout(StringIO()) as printed:
        exec(compile(tree, "cell", "exec"), names)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
    text = printed.getvalue()
    if hasattr(value, "savefig"):
        drawn = BytesIO()
        value.savefig(drawn, format="png", dpi=100)  # pyright: ignore
        picture = drawn.getvalue()
    elif value is not None:
        text += "\n".join(_shown(value))
    return text.rstrip(), picture


def _shown(value: Any) -> Iterator[str]:
    """Yield the lines that show a value, as a notebook does: a table with its first rows."""
    frame = value
    if hasattr(value, "to_frame") and not hasattr(value, "to_string"):
        yield repr(value)
        frame = value.to_frame()
    if not hasattr(frame, "to_string"):
        yield repr(value)
        return
    size = {} if frame.ndim == 1 else {"max_cols": MOST_COLUMNS, "line_width": WIDTH}
    yield frame.head(MOST_ROWS).to_string(**size)
    if len(frame) > MOST_ROWS:
        yield f"... {len(frame) - MOST_ROWS} more rows"


def console(path: Path) -> tuple[str, Pictures]:
    """Run the console blocks of a page in one folder; return it with their outputs, and pictures.

    A comment `<!-- picture: FILE TEXT -->` becomes the picture that the commands have written.

    Raises:
        RuntimeError: A command has failed.
    """
    page = path.read_text(encoding="utf-8")
    commands = [
        re.sub(r"\\\n", "", part).partition("\n")[0]
        for block in _CONSOLE.findall(page)
        for part in re.split(r"(?m)^\$ ", block)[1:]
    ]
    script = ["set -eo pipefail"]
    for command in commands:
        script += [f"echo '{_MARK}'", command]
    where = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            ["bash", "-c", "\n".join(script)], cwd=folder, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True, check=False,
            env=os.environ | {"PATH": where, "NO_COLOR": "1"},
        )  # fmt: skip
        if done.returncode:
            raise RuntimeError(f"{path.name}: a command has failed:\n{done.stdout[-2000:]}")
        pictures = {
            f"{path.stem}/{Path(name).name}": Path(folder, name).read_bytes()
            for name, _ in _PICTURE.findall(page)
        }
    outputs = iter(done.stdout.split(f"{_MARK}\n")[1:])

    def filled(block: re.Match[str]) -> str:
        parts = re.split(r"(?m)^\$ ", block[1])[1:]
        own = (re.sub(r"\\\n", "", part).partition("\n")[0] for part in parts)
        return "```console\n" + "".join(f"$ {c}\n{next(outputs)}" for c in own) + "```"

    page = _CONSOLE.sub(filled, page)
    page = _PICTURE.sub(lambda p: f"![{p[2]}]({path.stem}/{Path(p[1]).name})", page)
    return page, pictures

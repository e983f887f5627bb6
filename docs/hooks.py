"""Pages and pictures that the site generates from the program, and equations without a script."""

import ast
import re
import tempfile
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

from latex2mathml.converter import convert
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from docs import executed
from sautereau.rig.disk import named_text
from sautereau.rig.load import load_rig
from sautereau.rig.text import KeyDescription, TableDescription, describe
from sautereau.sim_backend.scene import Scene, load_scene, packaged_scenes

ROOT = Path(__file__).parents[1]
ROOMS = ("entrance", "rig", "trajectory", "daq", "analysis", "sim_backend", "robot")
_FIGURES = re.compile(r"<!-- figures: ([^:]*?)(?:: (.*?))? -->")
_EQUATION = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Add every decision and every module to the navigation."""
    decisions = sorted((Path(config.docs_dir) / "decisions").glob("0*.md"))
    rooms = [
        {room: [_page(room), *({module: _page(module)} for module in modules(room))]}
        for room in ROOMS
    ]
    config.nav = [
        *(config.nav or []),
        {"Programming": rooms},
        {"Decisions": ["decisions/index.md", *(f"decisions/{page.name}" for page in decisions)]},
    ]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages."""
    tutorial, shown = executed.notebook(Path(config.docs_dir) / "tutorial.ipynb")
    first, drawn = executed.console(Path(config.docs_dir) / "first-press.md")
    if (written := files.get_file_from_path("first-press.md")) is not None:
        files.remove(written)
    pages = {
        "rig-file.md": rig_page(),
        "scene-file.md": scene_page(),
        "commands.md": commands_page(),
        "tutorial.md": tutorial,
        "first-press.md": first,
    }
    for room in ROOMS:
        pages[_page(room)] = room_page(room)
        pages |= {_page(name): f"# {name}\n\n::: {name}\n" for name in modules(room)}
    for name, text in pages.items():
        files.append(File.generated(config, name, content=text))
    for name, picture in chain((shown | drawn).items(), pictures(Path(config.docs_dir))):
        files.append(File.generated(config, name, content=picture))
    return files


def pictures(docs: Path) -> Iterator[tuple[str, bytes]]:
    """Draw and yield the gallery's pictures, except those in the repository."""
    from examples.gallery import pictures as draws

    with tempfile.TemporaryDirectory() as folder:
        for name, draw in draws().items():
            if not (docs / "gallery" / name).exists():
                path = Path(folder) / name
                draw(path)
                yield f"gallery/{name}", path.read_bytes()


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Insert tables of measured figures where a page requests them."""
    return _FIGURES.sub(lambda asked: measured(asked[1], asked[2] or ""), markdown)


def measured(heading: str, columns: str = "") -> str:
    """Return the table below one heading of docs/figures.md.

    Args:
        heading: First words of the heading.
        columns: Figures to show of each subject, separated by commas, if figures are named
            `subject: figure`; each subject then has one row. Empty for the table as it is.

    Raises:
        PluginError: There is no such heading, or no such figure below it.
    """
    sections = (ROOT / "docs" / "figures.md").read_text(encoding="utf-8").split("\n## ")
    found = [text for text in sections if text.startswith(heading)]
    if len(found) != 1:
        raise PluginError(f"docs/figures.md has {len(found)} headings that start with {heading!r}")
    table = "\n".join(line for line in found[0].splitlines() if line.startswith("|"))
    return _by_subject(table, [name.strip() for name in columns.split(",")]) if columns else table


def _by_subject(table: str, columns: list[str]) -> str:
    """Return a table of figures with one row per subject and the requested columns."""
    subjects: dict[str, dict[str, str]] = {}
    for row in table.splitlines()[2:]:
        name, value, *_ = (cell.strip() for cell in row.strip("|").split("|"))
        subject, _, figure = name.partition(": ")
        subjects.setdefault(subject, {})[figure] = value
    known = {figure for row in subjects.values() for figure in row}
    if missing := [name for name in columns if name not in known]:
        raise PluginError(f"docs/figures.md has no figure {', '.join(missing)}")
    rows = [
        f"| {subject} | {' | '.join(row.get(name, '') for name in columns)} |"
        for subject, row in subjects.items()
    ]
    head = [f"| | {' | '.join(columns)} |", "|---" * (len(columns) + 1) + "|"]
    return "\n".join([*head, *rows])


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Convert TeX to MathML, which browsers display without a script."""

    def drawn(match: re.Match[str]) -> str:
        tex = match[2].replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&")
        if match[1] == "span":
            return convert(tex)
        # A formula itself does not scroll, so it is cut off on a narrow page without a box.
        return f'<div class="equation">{convert(tex, display="block")}</div>'

    return _EQUATION.sub(drawn, html)


def modules(room: str) -> dict[str, str]:
    """Return the modules of a package by dotted name, with the first lines of their docstrings."""
    found = {}
    folder = _folder(room)
    for path in sorted(folder.rglob("*.py")):
        parts = ("sautereau", room, *path.relative_to(folder).with_suffix("").parts)
        if path.name != "__init__.py" and not any(part.startswith("_") for part in parts):
            docstring = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
            found[".".join(parts)] = docstring.partition("\n")[0]
    return found


def room_page(room: str) -> str:
    """Return the page with the list of a package's modules."""
    head = ast.get_docstring(ast.parse((_folder(room) / "__init__.py").read_text(encoding="utf-8")))
    rows = [f"| [{name}]({_page(name)}) | {what} |" for name, what in modules(room).items()]
    return "\n".join([f"# {room}", "", head or "", "", "| module | |", "|---|---|", *rows]).replace(
        f"(api/{room}/", "("
    )


def _folder(room: str) -> Path:
    return ROOT / ("sautereau/entrance" if room == "entrance" else room)


def _page(module: str) -> str:
    room, _, rest = module.removeprefix("sautereau.").partition(".")
    return f"api/{room}/{rest or 'index'}.md"


def commands_page() -> str:
    """Return the help texts of all commands."""
    from sautereau.commands.app import GROUPS, app

    text = app.generate_docs(output_format="markdown", flatten_commands=True)
    title, _, rest = text.partition("## Table of Contents")
    commands = rest[rest.index(f"**{next(iter(GROUPS))}**:") :]
    page = f"# Commands\n{title.partition(chr(10))[2]}{commands}"
    return re.sub(r"(?m)^# sautereau ", "## sautereau ", page)


def rig_page() -> str:
    """Return the reference of the rig file."""
    return "\n".join(_rig_lines())


def _rig_lines() -> Iterator[str]:
    yield from (
        "# The rig file",
        "",
        "A rig file contains every number of a bench, in TOML. `sautereau init my-rig.toml` writes",
        "a file in which each key is explained as below. All errors in a file (wrong units,",
        "unknown keys, values out of range) are reported at once, with their lines.",
        "",
        'A quantity is a number with a unit: `"14 mm"`, `"0.072 m/s"`. Any unit of the right',
        "dimension is accepted. Every key with a unit takes a quantity; the limits below are in",
        "the SI unit of the column *unit*. To state the origin of a value, write a table with",
        "its `source`, or with the `assumed` range if there is no source:",
        "",
        "```toml",
        "[jack]",
        'mass = { value = "6 g", assumed = ["4 g", "12 g"] }',
        "```",
        "",
        "## Files that inherit",
        "",
        "```toml",
        'name = "a4"',
        'base = "paper"  # or a file, seen from this one, or a list: ["bench.toml", "g4.toml"]',
        "",
        "[plectrum]",
        'overlap = "0.31 mm"  # without the range and the source of the base',
        "tip_thickness = false  # removes an optional value or table of the base",
        "",
        "[daq.channels.1]  # the second one of the base; [[daq.channels]] replaces all of them",
        'scale = "1.02 N/V"',
        "```",
        "",
        "What a file does not set is that of its `base`, except `name`. Recordings and reports",
        "contain the complete rig, so that they do not need the base. `setup` and `identify --out`",
        "write what they found into the file itself, and leave its base as it is.",
        "",
        "## Keys",
        "",
        "The column *in `paper`* gives the values of the packaged rig `paper` with their sources.",
        "",
    )
    import tomllib

    document = tomllib.loads(named_text("paper", "sautereau.rig", "rig", ValueError)[0])
    sources = load_rig().sources
    for table in describe():
        if table.name.startswith("more_choirs."):
            continue
        yield from _head_lines(table)
        if table.name == "more_choirs":
            yield "Each has its own tables `jack`, `plectrum` and `string`, with the keys below."
            yield ""
        yield "| key | unit | value | default | in `paper` | meaning |"
        yield "|---|---|---|---|---|---|"
        for entry in table.entries:
            key = f"{table.name}.{entry.name}".lstrip(".")
            yield _row(entry, _in_paper(document, key.split("."), sources.get(key, "")))
        yield ""


def scene_page() -> str:
    """Return the reference of the scene file."""
    return "\n".join(_scene_lines())


def _scene_lines() -> Iterator[str]:
    yield from (
        "# The scene file",
        "",
        "A scene defines what the [stand-in](stand-in.md) simulates. `--scene` takes the path of a",
        "file, or the name of one of these packaged scenes:",
        "",
        "| scene | description |",
        "|---|---|",
        *(f"| `{name}` | {load_scene(name).description} |" for name in packaged_scenes()),
        "",
        "Quantities are written as in [the rig file](rig-file.md).",
        "",
    )
    for table in describe(Scene):
        if table.name.startswith("more_choirs."):
            continue
        yield from _head_lines(table)
        if table.entries:
            yield "| key | unit | value | default | meaning |"
            yield "|---|---|---|---|---|"
            yield from map(_row, table.entries)
            yield ""
        if table.name == "more_choirs":
            yield "Its tables are those of the rig file."
            yield ""


def _head_lines(table: TableDescription) -> Iterator[str]:
    brackets = "[[{}]]" if table.repeated else "[{}]"
    yield f"## {brackets.format(table.name)}" if table.name else "## At the top"
    yield ""
    if table.name:
        yield f"{table.meaning}{'' if table.needed else ' Optional.'}"
        yield ""


def _row(entry: KeyDescription, *more: str) -> str:
    default = "needed" if entry.default is None else f"`{entry.default}`" if entry.default else ""
    kind = "" if entry.kind == "quantity" else entry.kind
    value = ", ".join(filter(None, (kind, entry.limits))).replace(" ", "&nbsp;", 1)
    cells = (f"`{entry.name}`", entry.unit, value, default, *more, entry.meaning)
    return f"| {' | '.join(cell.replace('|', '&#124;') for cell in cells)} |"


def _in_paper(node: object, keys: list[str], source: str) -> str:
    for key in keys:
        if not isinstance(node, dict) or key not in node:
            return ""
        node = node[key]
    if isinstance(node, dict):
        origin = " to ".join(node.get("assumed", ()))
        origins = [f"assumed {origin}"] if origin else []
        return f"{node.get('value')} ({'; '.join([*origins, *([source] if source else [])])})"
    return str(node)

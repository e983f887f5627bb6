"""Every text of the project uses the words that readers of the field know.

One table: what to look for, and what to write instead. It is applied to prose only: docstrings,
comments, string literals of two words or more, names of tests, Markdown, comments of rig files,
templates and notebooks. Identifiers and `code in backticks` are not prose.

`python tests/test_language.py FOLDER...` prints what it finds in those folders or files.
"""

import ast
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[1]
INTEGER = "numbers?|samples?|counts?|periods?|steps?|multiples?|milliseconds?|seconds?|bytes?"
PER = "second|minute|hour|day|year"

INSTEAD = {
    # quantities: one name each
    r"\bpeak N\b": "release force (N)",
    r"\bfinger_force_peak\b": "release_force",
    r"\bcontact_duration\b|\btime the string is held\b": "pluck duration",
    r"\bgrowth of (the )?force\b": "force slope",
    r"\bforce_step\b": "force_drop",
    r"\bmisfits?\b": "residual",
    r"\bmiss(es|ed)\b": "residual; for an event that did not happen: lost, not found, not reached",
    r"\bpredicted / measured\b": "model error, (model - measured) / measured",
    # rewrites by rule
    r"\btold apart\b|\btell\w* apart\b": "separated, distinguished",
    r"\btold\b|\btells?\b|\btelling\b": "is reported, is given, shows, reports, says",
    r"\bmend(s|ed|ing)?\b": "fix",
    r"\bremed(y|ies)\b": "how to fix it",
    r"\blets? go\b|\bletting go\b": "released, release",
    r"\btouched by the plectrum\b": "contact",
    r"(?<!condition )\b(is|are|was|were|be|been) met\b|\bmet (by|and)\b": "contact, reached",
    rf"\bwhole\b(?! ({INTEGER})\b)": "complete, entire",
    r"\bbegun\b": "started",
    r"\b(goes|go|going|went|gone) on\b(?! strike)": "continues",
    r"\b(has|have|had|having) to be\b": "must be",
    r"\bsome \d": "about",
    r"\b(gives?|gave|giving|given) way\b": "deflects, is compliant",
    r"\bcharts?\b": "calibration; for a drawing: plot",
    r"\bsuffix(es)?\b": "file extension",
    rf"\b\d+( \w+)? an? ({PER})\b|\b(once|twice|times) an? ({PER})\b": "per second",
    r"\bcounts a sample\b": "counts per sample",
    r"\bclock on the wall\b|\bwall's clock\b": "real time",
    r"\b(lost|loses?|losing) its numbers\b": "diverged",
    r"\b(left|leaves?|leaving) out\b": "disabled, omitted",
    r"\banew\b": "again; regenerated",
    r"\bshares? of\b": "fraction of",
    r"\b(not|never) beaten\b|\bunbeaten\b": "Pareto-optimal",
    r"\bwanted\b": "requested, expected, needed",
    # metaphors, archaic and inverted phrases
    r"\bhappenings?\b": "event",
    r"\bheaviness\b": "static gravity moment",
    r"\bwho needs\b": "waiting threads",
    r"\bsave (for|that|in|when|where|if|the)\b(?! (plot|page|file|picture|result))": "except",
    r"\bround and round\b": "loops",
    r"\bstands? still\b|\bstood still\b|\bstanding still\b": "is at rest, stops",
    r"\ba thing that\b|\bthings that\b": "name the thing",
    r"\bin any case\b": "always",
    r"\bfloors? (between|of the) (rooms?|house)\b": "layers",
    r"\bit is there\b": "exists, is present",
    r"\bguessed at\b|\bby whatever way\b|\bin whatever way\b": "estimated; however",
    r"\b30 faults\b|\b48 faults\b|\b50 faults\b|\b(thirty|forty-eight|fifty) faults\b": "no number",
    r"\bplucks one\b": "the stand-in plucks any number of choirs",
}
FORBIDDEN = {re.compile(p, re.IGNORECASE): instead for p, instead in INSTEAD.items()}
# All of them, for a quick first look at text in lower case: each starts at the start of a word.
_INNER = [re.sub(r"(^|[|])\\b", r"\1", pattern.lower()) for pattern in INSTEAD]
_ANY = re.compile(rf"\b(?:{'|'.join(_INNER)})")
_COMMENTS = re.compile(r"(?m)(?:^[ \t]*#.*\n?)+|[^\s#].*?[ \t]{2}#(?: .*)$")
_TEST_NAMES = re.compile(r"\btest_\w+")

# (file, text in which the word is used in another sense, why it may stay)
EXCEPTIONS: list[tuple[str, str, str]] = [
    ("*", "MISSED", "the mark of a benchmark that misses its limit"),
    ("*", "missed limit", "the same, in prose"),
    ("*", "share of the variance", "the field's term in variance components"),
]

SEARCHED = {".py", ".md", ".toml", ".jinja", ".js", ".css", ".yml", ".yaml", ".cff", ".ipynb"}
SKIPPED = {"build", "site", "out", "node_modules", "__pycache__", "written_by_0.1"}


class Finding(NamedTuple):
    path: str
    line: int
    found: str
    instead: str
    text: str

    def __str__(self) -> str:
        where = f"{self.path}:{self.line}"
        return f"{where}: {self.found!r} -> {self.instead}\n    {self.text}"


def files(roots: list[Path]) -> Iterator[Path]:
    """Every file with text, outside hidden and generated folders."""
    for root in roots:
        for path in sorted(root.rglob("*")) if root.is_dir() else [root]:
            parts = path.relative_to(ROOT).parts
            hidden = any(
                p.startswith(".") or p in SKIPPED or p.endswith(".egg-info") for p in parts
            )
            text = path.suffix in SEARCHED or path.name == "Makefile"
            if text and not hidden and path != Path(__file__).resolve():
                yield path


def python_prose(source: str) -> Iterator[tuple[int, str]]:
    """Line and text of every docstring, comment block, message and test name."""
    for node in ast.walk(ast.parse(source)):
        text = node.value if isinstance(node, ast.Constant) else None
        if isinstance(text, str) and re.search(r"[A-Za-z]{2}.*\s.*[A-Za-z]{2}", text, re.DOTALL):
            yield node.lineno, text
    for block in _COMMENTS.finditer(source):
        yield source.count("\n", 0, block.start()) + 1, re.sub(r"(?m)^.*?#", "", block[0])
    for name in _TEST_NAMES.finditer(source):
        yield source.count("\n", 0, name.start()) + 1, name[0].replace("_", " ")


def suspicious(source: str) -> bool:
    """Return whether a file can hold a forbidden word, identifiers included: a quick first look."""
    names = " ".join(_TEST_NAMES.findall(source)).replace("_", " ")
    text = re.sub(r"(?:\\n|\n)[ \t#|]*", " ", f"{source} {names}")
    text = re.sub(r" {2,}", " ", text)
    return bool(_ANY.search(text.lower()))


def prose(path: Path) -> Iterator[tuple[int, str]]:
    """Line number and text of each piece of prose in a file."""
    source = path.read_text(encoding="utf-8")
    if path.suffix == ".py" and suspicious(source):
        yield from python_prose(source)
    elif path.suffix == ".py":
        return
    elif path.suffix == ".ipynb":
        for number, cell in enumerate(json.loads(source)["cells"], 1):
            text = "".join(cell["source"])
            pieces = python_prose(text) if cell["cell_type"] == "code" else [(1, text)]
            yield from ((number, piece) for _, piece in pieces)
    elif path.suffix == ".js":
        for comment in re.finditer(r"//.*|/\*.*?\*/", source):
            yield source.count("\n", 0, comment.start()) + 1, comment[0]
    else:
        yield 1, source


def findings(roots: list[Path]) -> list[Finding]:
    """Return every forbidden word in the prose of these folders and files."""
    found = []
    for path in files(roots):
        name = path.relative_to(ROOT).as_posix()
        for line, raw in prose(path):
            text = re.sub(r"`[^`\n]+`", lambda code: "_" * len(code[0]), raw)
            joined = re.sub(r"\n[ \t#|]*", lambda gap: " " * len(gap[0]), text)
            joined = re.sub(r" {2,}", lambda gap: " " + "\0" * (len(gap[0]) - 1), joined)
            squeezed = joined.replace("\0", "")
            if not _ANY.search(squeezed.lower()):
                continue
            places = [at for at, letter in enumerate(joined) if letter != "\0"]
            for pattern, instead in FORBIDDEN.items():
                for match in pattern.finditer(squeezed):
                    around = squeezed[max(0, match.start() - 50) : match.end() + 50]
                    if not any(
                        allowed in around and where in ("*", name)
                        for where, allowed, _ in EXCEPTIONS
                    ):
                        at = line + raw.count("\n", 0, places[match.start()])
                        found.append(Finding(name, at, match[0], instead, around.strip()))
    return found


@pytest.mark.parametrize("folder", sorted(p.name for p in ROOT.iterdir() if p.name[0] != "."))
def test_texts_use_the_fields_words(folder):
    found = findings([ROOT / folder])
    assert not found, f"{len(found)} findings:\n" + "\n".join(map(str, found))


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("'''The string is let\n    go at once.'''", 1),
        ("# the whole\n# thing", 1),
        ("raise ValueError(f'{a} is told {b}')", 1),
        ("told = whole.suffix", 0),
        ("'''Read `told`, a whole number of samples.'''", 0),
        ("def test_a_chart_is_drawn(): pass", 1),
    ],
)
def test_it_reads_prose_and_not_identifiers(text, found, tmp_path, monkeypatch):
    (tmp_path / "it.py").write_text(text)
    monkeypatch.setitem(globals(), "ROOT", tmp_path)
    assert len(findings([tmp_path])) == found


if __name__ == "__main__":
    everything = findings([Path(a).resolve() for a in sys.argv[1:]] or [ROOT])
    print(*everything, f"{len(everything)} findings", sep="\n")  # noqa: T201
    sys.exit(bool(everything))

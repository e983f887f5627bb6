"""Every text table is imported sample by sample, or refused: random dialects from a fixed seed.

`python -m tests.daq.test_import_dialects N` judges N tables, and prints the share that was imported
of each dialect, then the smallest table of each fault.
"""

import contextlib
import functools
import io
import re
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from sautereau.__main__ import main
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recorded import Recorded
from tests.budget import amount, slow
from tests.daq.dialects import BLANKS, UNIX, Dialect, Table, draw, simpler, write
from tests.forked import unwrapped

# The command line is called in this process, which is five times as fast as a process for each.
pytestmark = pytest.mark.filterwarnings("ignore:Cyclopts application invoked")
CHANNELS = {"v": "velocity", "f": "force"}
DATE = "2026-02-03T04:05:06+01:00"
STATED = ("(u)", "[u]", "/ u", "row of units", "keysight")
SILENT = ("seed", "rows", "preamble", "place", "bad_column")  # say little about a table
# Words of the libraries and of Python, which say nothing to the user of a table.
INTERNAL = re.compile(
    r"Traceback|\wError\b|[aA]rrow|numpy|pandas|dtype|NoneType|codec|could not convert|In CSV|"
    r"conversion error|invalid literal|parse error|Expected \d+ columns|passing `|isoformat"
)


@dataclass(frozen=True)
class Outcome:
    """What happened to a table."""

    read: bool
    fault: str = ""
    """Kind of the fault; empty for none."""
    detail: str = ""
    words: tuple[str, ...] = ()


def run(*words: str) -> tuple[int, str]:
    """Run a command in this process; return its status, and its messages or its result."""
    out, error = io.StringIO(), io.StringIO()
    before, sys.argv = sys.argv, ["sautereau", *words]
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
            main()
        status = 0
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
    finally:
        sys.argv = before
    return status, unwrapped(error.getvalue() + (out.getvalue() if status == 0 else ""))


def options(d: Dialect, table: Table, said: str, attempt: int) -> list[str]:
    """Return the options of a user who sees the file, and has read a message for each attempt."""
    words = ["--rig", "paper", "--measured", f"--trigger={trigger(d, table)} s"]
    stated = d.header in STATED and not d.unit_given and not attempt
    for kind, channel in CHANNELS.items():
        if kind not in d.imported:
            words += ["--without", channel]
            continue
        words += [f"--column.{channel}={called(d, table, kind, said, attempt)}"]
        words += [] if stated else [f"--unit.{channel}", table.units[kind]]
    if d.time != "ignored":
        words += ["--time", called(d, table, "t", said, attempt)]
        words += ["--time-unit", "ms"] if d.time == "ms" and not stated else []
    if d.time != "iso":
        words += ["--started", "1970-01-01T00:00:00+00:00" if d.time == "unix" else DATE]
    if d.rate_given or (d.time == "ignored" and (not d.states_rate or attempt)):
        words += ["--rate", f"{d.rate} Hz"]
    return words + (["--complete"] if not d.last_end and not d.cut else [])


def called(d: Dialect, table: Table, kind: str, said: str, attempt: int) -> str:
    """Return the name that a user gives for a column; a message may have listed other names."""
    listed = re.findall(r"'([^']*)'", said.rpartition(" it has ")[2])
    if attempt > 1 and len(listed) == len(d.columns):
        return listed[d.columns.index(kind)]
    return table.names[kind][max(0, min(attempt - 1, len(table.names[kind]) - 1))]


def trigger(d: Dialect, table: Table) -> object:
    """Return the time of the trigger in s, on the axis of the file."""
    since = table.times[trigger_row(d)]
    return since - table.times[0] if d.time in ("clock", "iso", "local", "ignored") else since


def trigger_row(d: Dialect) -> int:
    """Return the sample of the trigger: late, so that it does not show that others were lost."""
    return max(1, d.rows * 3 // 4)


def judge(d: Dialect) -> Outcome:
    """Import a table, and compare the recording with its truth."""
    table = write(d)
    with tempfile.TemporaryDirectory() as folder:
        file, out = Path(folder, "a.csv"), Path(folder, "o.mcap")
        file.write_bytes(table.data)
        words, text = [], ""
        for attempt in range(4):
            words = options(d, table, text, attempt)
            try:
                status, text = run("import", str(file), "--out", str(out), *words)
            except Exception as error:  # noqa: BLE001 (the user would see a traceback)
                return Outcome(False, "traceback", repr(error), tuple(words))
            if status == 0 or "options" not in text:
                break
        if status:
            fault = refusal(status, text, file, out)
            return Outcome(False, fault, text, tuple(words))
        kind, detail = compare(d, table, read_recording(out), text)
        return Outcome(True, kind, detail, tuple(words))


def refusal(status: int, text: str, file: Path, out: Path) -> str:
    """Return the fault of a refusal."""
    if INTERNAL.search(text):
        return "text of a library"
    if status not in (1, 2) or file.name not in text:
        return "refusal without the name of the file"
    return "refused, but a recording was left" if out.exists() else ""


def compare(d: Dialect, table: Table, recorded: Recorded, text: str) -> tuple[str, str]:
    """Return the fault of a recording, and its detail."""
    n = recorded.n_samples
    for kind, true in table.values.items():
        channel = CHANNELS[kind]
        read = recorded.volts[channel] * recorded.rig.daq.channel(channel).scale
        seen = f"{channel} {read[:3]} ..., {n} of {d.rows} rows; true {true[:3]}; said: {text!r}"
        if n > d.rows:
            return "more rows than the file", seen
        starts = [i for i in range(d.rows - n + 1) if close(read, true[i : i + n])]
        if not starts:
            return "altered values", seen
        missing = rf"\b{d.rows - n}\b|\b{d.rows} rows\b.*\b{n}\b"
        if n < d.rows and not ("warning" in text and re.search(missing, text)):
            return "fewer rows without a warning", seen
    if documented(d) and n < d.rows:
        return "fewer rows of a documented table", text
    if abs(recorded.rate - table.rate) > table.rate_error:
        return "wrong rate", f"{recorded.rate!r} Hz, true {table.rate} Hz"
    if n == d.rows and d.time != "clock":
        return dates(d, table, recorded)
    return "", ""


def close(read: np.ndarray, true: np.ndarray) -> bool:
    """Return whether values are those printed; 1e-12 allows for the conversion of units."""
    return np.allclose(read, true, rtol=1e-12, atol=0)


def dates(d: Dialect, table: Table, recorded: Recorded) -> tuple[str, str]:
    """Compare the place of the trigger, and its date."""
    row = trigger_row(d)
    if recorded.first_sample != -row:
        return "wrong trigger", f"first sample {recorded.first_sample}, true {-row}"
    start = datetime.fromisoformat(DATE).timestamp()
    if d.time in ("iso", "unix"):
        start = datetime.fromtimestamp(int(UNIX), UTC).timestamp()
    true = start + float(table.times[row] - (UNIX if d.time == "unix" else 0))
    late = recorded.t0_ns / 1e9 - true
    return ("", "") if abs(late) < 2e-6 else ("wrong date", f"{late} s late")  # spacing of doubles


def damaged(d: Dialect) -> bool:
    """Return whether a number is missing, so that the table must be refused or warned of."""
    used = d.imported + ("t" if d.time != "ignored" else "")
    return bool(d.cut or d.missing or (d.bad is not None and d.bad_column in used))


def documented(d: Dialect) -> bool:
    """Return whether the pages of the documentation say that such a table is imported."""
    odd = (d.middle, d.odd_text, d.trailing, d.footer, d.group, d.sign, d.bad, d.constant)
    return (
        not any(odd)
        and not damaged(d)
        and d.rows >= 8
        and d.separator in (",", ";", "\t", *BLANKS)
        and not (d.decimal == "," and (d.separator == "," or len(d.columns) == 1))
        and not (d.header == "(u)" and d.separator in BLANKS)
        and d.encoding in ("utf-8", "utf-8-sig", "cp1252")
        and d.numbers in ("fixed", "exponent", "signed", "integers")
        and d.time in ("s", "ms", "negative", "iso", "ignored")
        and d.header != "commented"
        and not (d.header == "none" and (d.preamble or d.count or d.states_rate))
    )


def traits(d: Dialect) -> list[str]:
    """Return what distinguishes a table from the plainest one."""
    found = ["documented"] if documented(d) else []
    found += ["complete"] if not damaged(d) else []
    found += [f"rows={d.rows}"] if d.rows < 8 else []
    for field in fields(d):
        value = getattr(d, field.name)
        if field.name not in SILENT and value != field.default:
            found.append(f"{field.name}={value!r}")
    return found


@functools.cache
def outcomes(n: int) -> dict[Dialect, Outcome]:
    """Judge the tables of the seeds 0 to n - 1."""
    return {d: judge(d) for d in map(draw, range(n))}


def smallest(d: Dialect, fault: str, tries: int = 200) -> Dialect:
    """Return the plainest table with the same fault."""
    seen = {d}
    while tries > 0:
        for other in simpler(d):
            if other in seen:
                continue
            seen.add(other)
            tries -= 1
            if judge(other).fault == fault:
                d = other
                break
        else:
            break
    return d


def report(d: Dialect, outcome: Outcome, tries: int = 200) -> str:
    """Return the smallest table with a fault, as text."""
    small = smallest(d, outcome.fault, tries)
    seen = judge(small)
    words = " ".join(f"'{word}'" if " " in word else word for word in seen.words)
    return (
        f"{outcome.fault}: {', '.join(traits(small))} (seed {d.seed})\n  {write(small).data!r}\n"
        f"  sautereau import a.csv --out o.mcap {words}\n  {seen.detail}"
    )


@pytest.mark.parametrize("n", [25, slow(amount(100, 300))])
def test_a_table_is_imported_sample_by_sample_or_refused(n):
    faults = [(d, outcome) for d, outcome in outcomes(n).items() if outcome.fault]
    kinds = dict(Counter(outcome.fault for _, outcome in faults))
    first = {outcome.fault: (d, outcome) for d, outcome in reversed(faults)}
    reports = [report(*found, 30) for found in first.values()]
    assert not reports, "\n".join([f"{kinds} of {n} tables", *reports])


@pytest.mark.parametrize("n", [25, slow(amount(100, 300))])
def test_documented_dialects_are_imported(n):
    refused = [
        f"{', '.join(traits(d))}: {outcome.detail}\n  {write(d).data!r}\n  {outcome.words}"
        for d, outcome in outcomes(n).items()
        if documented(d) and not outcome.read
    ]
    assert sum(map(documented, outcomes(n))) > n // 3
    assert not refused, "\n".join(refused)


def print_all(n: int) -> None:
    """Print the share that was imported of each dialect, and all faults."""
    tried, read = Counter[str](), Counter[str]()
    for d, outcome in outcomes(n).items():
        tried.update(traits(d))
        read.update(traits(d) if outcome.read and not outcome.fault else [])
    lines = [f"{read[trait]:4d} of {tried[trait]:4d} imported: {trait}" for trait in sorted(tried)]
    found = [report(d, outcome) for d, outcome in outcomes(n).items() if outcome.fault]
    lines += [
        f"refused: {', '.join(traits(d))} (seed {d.seed})\n  {write(d).data!r}\n  {outcome.detail}"
        for d, outcome in outcomes(n).items()
        if not damaged(d) and not outcome.read and not outcome.fault
    ]
    lines += list({re.sub(r"seed \d+", "", text): text for text in found}.values())
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    print_all(int(sys.argv[1]))

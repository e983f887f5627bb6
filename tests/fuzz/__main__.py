"""Try hostile input on the formats and protocols, and count it.

python -m tests.fuzz [--seconds 60] [--first 0] [--count N] [FORMAT...]

The time is divided equally between the formats. The first number of the cases is the time of the
start, so that each run tries others; `--first` repeats. It ends with status 1 if a case fails:
put its format and number into found.txt, which the tests repeat, and fix what it shows.
"""

import argparse
import sys
import time

from tests.fuzz.run import run
from tests.fuzz.targets import TARGETS


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz")
    parser.add_argument("formats", nargs="*", metavar="FORMAT", help=", ".join(TARGETS))
    parser.add_argument("--seconds", type=float, default=60.0, help="in all")
    parser.add_argument("--first", type=int, default=int(time.time()) * 1000)
    parser.add_argument("--count", type=int, default=10**9, help="of each format")
    parser.add_argument("--tracebacks", action="store_true")
    given = parser.parse_args()
    names = given.formats or list(TARGETS)
    unknown = set(names) - set(TARGETS)
    if unknown:
        parser.error(f"unknown: {', '.join(unknown)}; known: {', '.join(TARGETS)}")
    share = given.seconds / len(names)
    cases = failures = 0
    print(f"{'format':14} {'cases':>8} {'failed':>7} {'longest':>8} {'peak':>8}")  # noqa: T201
    for name in names:
        tally = run(name, TARGETS[name](), given.first, share, given.count)
        cases, failures = cases + tally.cases, failures + len(tally.failures)
        outcomes = ", ".join(f"{k} {v}" for k, v in tally.outcomes.most_common())
        print(  # noqa: T201
            f"{name:14} {tally.cases:8} {len(tally.failures):7} {tally.longest:6.1f} s"
            f" {tally.memory / 2**20:4.0f} MiB  {outcomes}",
            flush=True,
        )
        seen = set()
        for number, text in tally.failures.items():
            place = _place(text)
            print(f"  FAILED {name} {number}: {place}", flush=True)  # noqa: T201
            if given.tracebacks and place not in seen:
                print(text, flush=True)  # noqa: T201
            seen.add(place)
    print(f"{cases} cases, {failures} failed")  # noqa: T201
    return bool(failures)


def _place(text: str) -> str:
    """Return the last line of a traceback, and the place in the project where it arose."""
    lines = text.strip().splitlines() or [text]
    places = [line.strip() for line in lines if "File" in line and "site-packages" not in line]
    ours = [line for line in places if "/lib/python" not in line]
    return f"{lines[-1][:160]}  {ours[-1][-70:] if ours else ''}"


if __name__ == "__main__":
    sys.exit(main())

"""Compare today's answers with the stored ones, or store them.

python -m tests.golden                     compare all; exit status 1 with a list of differences
python -m tests.golden --only wire model   some groups, or cases such as "commands/phases old"
python -m tests.golden --write             store the answers
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[2]))

from tests.golden import store
from tests.golden.corpus import Corpus
from tests.golden.groups import GROUPS, SIMULATED, answers, compared
from tests.golden.tolerances import ROUNDING

OTHER_PROCESSOR = {
    "OPENBLAS_CORETYPE": "Prescott",
    "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL"
    " AVX512_ICL",
}
"""Environment in which numpy rounds as on a processor without these vector instructions."""


def chosen(only: list[str]) -> dict[str, list[str]]:
    """Return the cases by group that `--only` names; all without names."""
    every = {group: list(cases) for group, cases in GROUPS.items()}
    if not only:
        return every
    found: dict[str, list[str]] = {}
    for name in only:
        group, _, case = name.partition("/")
        if group not in every or (case and case not in every[group]):
            raise SystemExit(f"--only {name}: no such group or case; groups: {', '.join(every)}")
        found.setdefault(group, []).extend([case] if case else every[group])
    return found


def mark_sensitive(group: str) -> None:
    """Mark the presses whose samples are others on another processor: bouncing enlarges rounding.

    These are compared only where their samples are the stored ones.
    """
    command = [sys.executable, "-m", "tests.golden", "--only", group]
    shown = subprocess.run(  # its own command
        command, env=os.environ | OTHER_PROCESSOR, capture_output=True, text=True, check=False
    ).stdout
    kept = store.load(group)
    for name in re.findall(rf"^{group}/(.*): sampled$", shown, re.MULTILINE):
        kept[name][ROUNDING] = True
    store.save(group, kept)


def main(arguments: list[str]) -> int:
    """Return 1 if an answer differs from the stored one."""
    parser = argparse.ArgumentParser(prog="python -m tests.golden", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--write", action="store_true", help="store the answers")
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help="GROUP or GROUP/CASE")
    parser.add_argument("--folder", type=Path, help="keep the files of the corpus here")
    given = parser.parse_args(arguments)
    warnings.simplefilter("ignore")
    found = []
    with tempfile.TemporaryDirectory(prefix="sautereau-golden-") as temporary:
        folder = (given.folder or Path(temporary)).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        corpus = Corpus(folder)
        for group, names in chosen(given.only).items():
            now = answers(group, names, corpus)
            if given.write:
                kept = store.load(group)
                made = {**{n: kept[n] for n in GROUPS[group] if n in kept}, **now}
                store.save(group, {name: made[name] for name in GROUPS[group] if name in made})
                if group in SIMULATED:
                    mark_sensitive(group)
            else:
                found += compared(group, names, now)
            print(f"{group}: {len(names)} cases", file=sys.stderr)  # noqa: T201
    for difference in found:
        print(difference)  # noqa: T201
    if found:
        print(f"{len(found)} differences; where a change is right: --write, and say why")  # noqa: T201
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

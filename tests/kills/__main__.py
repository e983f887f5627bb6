"""Kill commands at random moments, cut their power, give them again, and count what is lost.

python -m tests.kills [--kills 200] [--cuts 50] [--seed 0] [COMMAND...]

Each command runs on the stand-in, is killed (SIGKILL) a few times in a row, and then runs to its
end. After a power cut only what was flushed is sure to be there, see tests/kills/disk.py. What a
command has named as written must stay as it was, and the end must be as without a break. It
ends with status 1 if anything was lost. Linux only.
"""

import argparse
import os
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

from tests.forked import CommandServer
from tests.kills.commands import COMMANDS
from tests.kills.run import Breaker


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.kills")
    parser.add_argument("commands", nargs="*", metavar="COMMAND", help=", ".join(COMMANDS))
    parser.add_argument("--kills", type=int, default=200, help="in all")
    parser.add_argument("--cuts", type=int, default=50, help="power cuts in all")
    parser.add_argument("--seed", type=int, default=int(time.time()))
    given = parser.parse_args()
    names = given.commands or list(COMMANDS)
    if unknown := set(names) - set(COMMANDS):
        parser.error(f"unknown: {', '.join(unknown)}; known: {', '.join(COMMANDS)}")
    say = partial(print, flush=True)
    start, all_kills, all_cuts, failed = time.monotonic(), 0, 0, 0
    os.environ["PYTHONUNBUFFERED"] = "1"
    say(f"seed {given.seed}")
    say(f"{'command':10} {'kills':>6} {'cuts':>5} {'runs':>5} {'failed':>7}")
    with tempfile.TemporaryDirectory(prefix="sautereau-kills-") as name:
        place = Path(name)
        with CommandServer(str(place / "socket")) as server:
            breaker = Breaker(server, place, given.seed)
            for i, command in enumerate(names):
                kills, cuts = (
                    n * (i + 1) // len(names) - n * i // len(names)
                    for n in (given.kills, given.cuts)
                )
                tally = breaker.run(command, kills, cuts, say)
                n = len(tally.failures)
                say(f"{command:10} {tally.kills:6} {tally.cuts:5} {tally.runs:5} {n:7}")
                all_kills, all_cuts = all_kills + tally.kills, all_cuts + tally.cuts
                failed += n
    minutes = (time.monotonic() - start) / 60
    say(f"{all_kills} kills, {all_cuts} power cuts, {failed} failed, in {minutes:.1f} min")
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())

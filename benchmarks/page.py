"""The page of a session over an hour of presses in real time, open in Chromium.

The session, its stand-in and the browser have a network of their own (`unshare`), in which only the
loopback exists. Each packet of the session that would leave it is counted, before Chromium starts,
which looks for a route to the internet with each page of any server; then each request of the
browser. Texts of the rig, of the notes and of the folder's name are hostile. `python -m
benchmarks.page 300` measures five minutes. Linux only.

Growth is counted from the second tenth, when the report shows its largest number of presses.
Nothing was retained before the process gave memory back: in 150 reports back to back, its memory
stayed within 1 MiB with one arena of glibc's allocator and a fixed threshold of `mmap`, and varied
by 35 MiB with the defaults.
"""

import json
import os
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.figures import Figure, check, table
from benchmarks.recording import memory
from sautereau.rig.load import load_rig
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.scene import load_scene

if TYPE_CHECKING:
    from playwright.sync_api import Dialog

HOUR = 3600.0  # s
REST = 10  # s, between presses
PLAIN = 5  # Number of presses without the page
PERIOD = 10.0  # s, between two looks
GROWTH = 10.0  # MiB, limit: of its largest memory, from the second tenth to the last
HOSTILE = '</script><script>alert(1)</script><img src="http://192.0.2.1/x.png" onerror=alert(2)>'
RIG = """base = "paper"
name = {name}
[controller]
port = "{port}"
watchdog_period = "5 s"
timeout = "5 s"
[daq]
address = "{address}"
"""


def run(seconds: float = HOUR) -> list[Figure]:
    """Return what the page's process uses, and what would have left the machine."""
    script = 'ip link set lo up && exec "$0" -m benchmarks.page inside "$1"'
    command = ("unshare", "-rn", "sh", "-c", script, sys.executable, f"{seconds:g}")
    done = subprocess.run(command, stdout=subprocess.PIPE, check=True, encoding="utf-8")
    found = json.loads(done.stdout.splitlines()[-1])
    presses, used = found["presses"], found["memory"]
    check(presses > seconds / 20, f"only {presses} presses in {seconds:g} s")
    check(found["shown"] == presses, f"the page shows {found['shown']} of {presses} presses")
    check(not found["faults"], f"faults in the browser: {found['faults'][:3]}")
    check(found["requests"] > presses / 2, "the browser has requested no reports")
    # A report that is being built takes 50 MiB, so that a look at one instant is not repeatable.
    tenth = len(used) // 10
    warm, last = max(used[tenth : 2 * tenth]), max(used[-tenth:])
    what = f"page, {seconds / 60:.3g} min, {presses} presses"
    with_page, without = found["times"]
    return [
        Figure(f"{what}: time of a press", with_page, "s", "without the page", without),
        Figure(f"{what}: longer by", max(0.0, 100 * (with_page / without - 1)), "%", "limit", 2.0),
        Figure(f"{what}: memory of its process grows by", last - warm, "MiB", "limit", GROWTH),
        Figure(f"{what}: largest memory of the last tenth", last, "MiB", "of the second", warm),
        Figure(
            f"{what}: open files at the end", found["files"][-1], "", "limit", found["files"][1]
        ),
        Figure(f"{what}: requests of the browser elsewhere", found["elsewhere"], "", "limit", 0.0),
        Figure(
            f"session of {PLAIN} presses: packets that would leave", found["left"], "", "limit", 0.0
        ),
        Figure(f"{what}: dialogs and scripts of hostile texts", found["dialogs"], "", "limit", 0.0),
        Figure(f"{what}: processor time of its process", found["spent"], "s", "run", seconds),
    ]


def inside(seconds: float) -> dict[str, object]:
    """Press and watch, in a network that ends at the loopback."""
    from playwright.sync_api import sync_playwright

    with (
        tempfile.TemporaryDirectory() as name,
        StandIn(load_rig(), load_scene("paper"), paced=True) as bench,
        sync_playwright() as driver,
    ):
        folder = Path(name) / "evening <script>alert(3)<"
        rig = folder.with_name("rig.toml")
        places = {"port": bench.serial_port, "address": bench.daq_address}
        rig.write_text(RIG.format(name=json.dumps(HOSTILE), **places), encoding="utf-8")
        plain = folder.with_name("plain")
        check(_start(rig, plain, PLAIN).wait() == 0, "the session without the page has failed")
        session = _start(rig, folder, 1000, "--page")
        address = _address(session)
        page_process = next(_descendants(session.pid, "spawn_main"))
        while len(list(folder.glob("press-*.mcap"))) < PLAIN and session.poll() is None:
            time.sleep(1)
        left = _left()
        browser = driver.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        requests, faults, dialogs = [], [], []
        page.on("request", lambda request: requests.append(request.url))
        page.on("pageerror", lambda error: faults.append(str(error)))

        def refuse(dialog: "Dialog") -> None:
            dialogs.append(dialog.message)
            dialog.dismiss()

        page.on("dialog", refuse)
        page.goto(address)
        used, files, start = [], [], time.monotonic()
        while time.monotonic() - start < seconds and session.poll() is None:
            page.wait_for_timeout(1e3 * PERIOD)
            used.append(memory("VmRSS", Path(f"/proc/{page_process}/status").read_text("utf-8")))
            files.append(len(os.listdir(f"/proc/{page_process}/fd")))  # noqa: PTH208
            if len(used) % 30 == 0:
                sys.stderr.write(
                    f"{used[-1]:.1f} MiB, {files[-1]} files, {len(requests)} requests\n"
                )
        ticks = Path(f"/proc/{page_process}/stat").read_text("utf-8").rpartition(")")[2].split()
        session.send_signal(signal.SIGQUIT)  # pause: the press is completed
        page.wait_for_timeout(3e3 * REST)
        presses = len(list(folder.glob("press-*.mcap")))
        times = _press_time(folder), _press_time(plain)
        shown = page.get_by_text(f"of {presses}").count() and presses
        session.terminate()
        session.wait(60)
        browser.close()
    own = (address, "data:", "blob:", "about:")
    return {
        "presses": presses, "shown": shown, "memory": used, "files": files, "faults": faults,
        "times": times, "dialogs": len(dialogs), "requests": len(requests), "left": left,
        "elsewhere": sum(not url.startswith(own) for url in requests),
        "spent": (int(ticks[11]) + int(ticks[12])) / os.sysconf("SC_CLK_TCK"),
    }  # fmt: skip


def _start(rig: Path, folder: Path, n: int, *more: str) -> subprocess.Popen[str]:
    words = ["press", str(rig), "-n", str(n), "--rest", f"{REST} s", "--out", str(folder)]
    command = [sys.executable, "-m", "sautereau", *words, "--notes", HOSTILE, *more]
    errors = subprocess.PIPE if more else None
    return subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=errors, encoding="utf-8", errors="replace"
    )


def _press_time(folder: Path) -> float:
    """Return the median time from one recording to the next without the rest between them, s."""
    written = sorted(path.stat().st_mtime for path in folder.glob("press-*.mcap"))
    return statistics.median(b - a for a, b in pairwise(written)) - REST


def _address(session: subprocess.Popen[str]) -> str:
    """Return the page's address, and continue to read what the session says."""
    errors = session.stderr or ()
    for line in errors:
        sys.stderr.write(line)
        if "page: open " in line:
            rest = threading.Thread(target=sys.stderr.writelines, args=(errors,))
            rest.daemon = True
            rest.start()
            return line.partition("page: open ")[2].split()[0]
    raise RuntimeError("the session has ended without a page")


def _descendants(process: int, word: str) -> Iterator[int]:
    """Yield the processes below one whose command line contains a word."""
    listed = Path(f"/proc/{process}/task/{process}/children").read_text("utf-8").split()
    for child in map(int, listed):
        if word in Path(f"/proc/{child}/cmdline").read_text("utf-8"):
            yield child
        yield from _descendants(child, word)


def _left() -> int:
    """Return the number of packets for which this network has no route."""
    head, counts, *_ = (
        line.split() for line in Path("/proc/net/snmp").read_text("utf-8").splitlines()
    )
    six = Path("/proc/net/snmp6").read_text("utf-8").split()
    return int(counts[head.index("OutNoRoutes")]) + int(six[six.index("Ip6OutNoRoutes") + 1])


if __name__ == "__main__":
    if sys.argv[1] == "inside":
        print(json.dumps(inside(float(sys.argv[2]))))
    else:
        print(table("The page over an hour", run(float(sys.argv[1]))))

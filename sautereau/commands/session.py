"""Output of a session: while it runs, and its summary."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sautereau.analysis.figures.comparison import PICTURED, ROWS
from sautereau.analysis.results.comparison import Comparison
from sautereau.analysis.results.press import HEADER
from sautereau.analysis.text import grouped
from sautereau.commands.common import Recorded
from sautereau.commands.live.process import watching
from sautereau.commands.output import Output
from sautereau.entrance.devices import Connected
from sautereau.entrance.pressing import Observer, Pressing
from sautereau.rig.disk import read_limited, write_durably
from sautereau.robot.experiment.monitor import Watch
from sautereau.robot.experiment.run import Place
from sautereau.robot.experiment.session import WARM_UPS
from sautereau.robot.experiment.session_folder import SessionFolder

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class SessionReport(Observer):
    """Prints every press of a session when it is recorded, and a summary at the end."""

    def __init__(self, pressing: Pressing, output: Output, views: Recorded):
        self._pressing, self._output, self._views = pressing, output, views
        self._show: Callable[[float], None] = lambda fraction: None
        self._said = [*pressing.planner.warnings]
        self._headed = False
        self._of_warm_ups: list[tuple[str, str]] = []
        self._reached = ""
        self._announced = False

    def begin(self, folder: SessionFolder) -> None:
        """Print what the folder holds."""
        total = self._pressing.plan.total
        if folder.resumed:
            of = "" if total is None else f" of {total}"
            self._output.say(
                f"session {folder.session}: {len(folder.done)}{of} presses are in {folder.path}"
            )
        for path in folder.left_behind:
            self._output.say(f"not changed: {path}, from an interrupted press")
        for path in folder.incomplete:
            text = f"{path} is not a complete press; the file is kept, and the press is repeated"
            self._said.append(text)
            self._output.warn(text)
        if folder.others:
            self._output.say(f"not changed: {folder.others} recordings from other sessions")

    def on(self, bench: Connected) -> None:
        """Print the bench of the next presses."""
        self._reached = bench.reached
        if not self._announced:
            self._output.say(f"rig {bench.rig.name} on {bench.where}")
            if bench.reached:
                self._output.say(bench.reached)
            self._announced = True

    def pressed(self, place: Place, path: Path) -> None:
        """Analyse a press, and print its results."""
        if not self._headed:
            self._output.say(HEADER)
        self._headed = True
        press = self._pressing.open(path)
        self._output.say(press.line)
        if path.match(WARM_UPS):
            self._of_warm_ups += [(path.name, text) for text in press.phases.warnings]
        if total := self._pressing.plan.total:
            self._show(len(self._pressing.folder.done) / total)

    @contextmanager
    def watching(self) -> Iterator[Watch]:
        """Show progress, or live views, while the presses of one set-up are made."""
        where = self._pressing.bench.where
        views = [name for name in ("view", "live", "page") if getattr(self._views, name)]
        bar = "view" not in views and (self._pressing.plan.total or 0) > 1
        with (
            self._output.progress("pressing", shown=bar) as self._show,
            watching(where, views) as watch,
        ):
            yield watch

    def end(self) -> int:
        """Print the summary of all presses of the session; return 1 if it was halted, else 0."""
        folder, run = self._pressing.folder, self._pressing.result
        numbers = sorted(folder.done)
        session = self._pressing.session
        with self._output.progress("reading recordings"):
            session.read()
        total, to_set = self._pressing.plan.total, run.to_set
        left = None if total is None else total - len(numbers)
        found = [text for text in self._pressing.warnings if text not in self._said]
        result: dict[str, Any] = {
            "session": folder.session,
            "recordings": [str(press.path) for press in session],
            "presses": [
                press.document | {"item": number}
                for number, press in zip(numbers, session, strict=True)
            ],
            "warm_ups": [str(path) for path in folder.warm_ups],
            "simulated": session.simulated,
            "seed": folder.seed,
            "reached": self._reached,
            "left": left,
            "left_behind": [str(path) for path in folder.left_behind],
            "to_set": to_set,
            "question": run.unanswered,
            "halted": run.halted,
            "warnings": [*self._said, *found],
        }
        warnings = [(p.path.name, warning) for p in session for warning in p.phases.warnings]
        warnings = grouped([*self._of_warm_ups, *warnings], "press")
        lines = [f"warning: {text}" for text in [*warnings, *found]]
        if len(session):
            compared = session.compare()
            drawn = _pictures(compared, folder.path)
            result = compared.document | {"pictures": list(map(str, drawn))} | result
            loops = session.position_loops
            result |= {"position_loops": loops and asdict(loops)}
            result |= {"picture": str(drawn[0])} if drawn else {}
            lines += compared.lines(features=False, remarks=False)
            if loops and self._pressing.plan.rig.arm.servo_stiffness is None:
                lines.append(
                    f"position loops: {loops}; for `plan` to predict the speed error, write them"
                    " into the rig with `sautereau setup RIG loops --recording PRESS --save`"
                )
            lines += [f"picture:    {path}" for path in drawn]
        lines += [f"recording:  {press.path}" for press in session]
        lines += [f"warm-up:    {path}" for path in folder.warm_ups]
        if to_set or run.unanswered:
            values = ", ".join(f"{key} = {value}" for key, value in to_set.items())
            needed = f"set {values} on the instrument" if to_set else f"answer: {run.unanswered}"
            presses = "presses are" if left is None else f"{left} press{'es' * (left > 1)}"
            again = f"run the same command again, with --out {folder.path}"
            lines.append(f"{presses} left: {needed}, then {again}")
        return self._output.answer(result, lines, faults=self._pressing.faults)


def _pictures(compared: Comparison, folder: Path) -> list[Path]:
    """Save a plot of each condition with a comparison, of many conditions one, as paths."""
    found = [(n, c) for n, c in enumerate(compared.found.conditions, 1) if c.comparison]
    if len(found) > ROWS:
        numbered = [(None, sorted(p.press.path.stem for _, c in found for p in c.counted))]
    else:
        numbered = [(n, [p.press.path.stem for p in c.counted[:PICTURED]]) for n, c in found]
    return [
        _saved(folder, "-to-".join(dict.fromkeys((names[0], names[-1]))), compared.plot(number))
        for number, names in numbered
    ]


def _saved(folder: Path, name: str, figure: "Figure") -> Path:
    """Save a plot under the first name that no other file has, and return its path.

    A session that is continued finds the plots that it has saved before.
    """
    held = BytesIO()
    figure.savefig(held, format="png", dpi=120)
    content = held.getvalue()
    number = 1
    while True:
        path = folder / f"{name}{f'-{number}' * (number > 1)}.png"
        with suppress(FileExistsError):
            write_durably(path, content)
            return path
        with suppress(OSError):  # a folder, a device, or larger
            if not path.is_symlink() and read_limited(path, len(content)) == content:
                return path
        number += 1

"""Output of a session: while it runs, and its summary."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from sautereau.analysis.figures.comparison import comparison_figure
from sautereau.analysis.loading.press import Press, load_press
from sautereau.analysis.model.predict import predict
from sautereau.analysis.phases import Phases, find_phases
from sautereau.analysis.session.compare import compare, predict_each
from sautereau.analysis.session.repeatability import LEAST, repeatability
from sautereau.analysis.summary import session as summary
from sautereau.analysis.summary.press import HEADER, press_line, press_summary
from sautereau.commands import common
from sautereau.robot.experiment.session_folder import SessionFolder
from sautereau.trajectory.timing import press_law

PICTURED = 8
"""Number of presses of a row that its plot shows, the first ones."""
BESIDE = 1e-3
"""s, kept of the other presses before and after the cruise."""


class SessionReport:
    """Prints every press of a session when it is recorded, and a summary at the end."""

    def __init__(self, folder: SessionFolder, warnings: list[str], as_json: bool):
        self._folder = folder
        self._warnings = warnings
        self._json = as_json
        self._found: dict[int, tuple[Press, Phases]] = {}
        self._places = {p.number: p for places in folder.plan.set_ups for p in places}
        self._pictured = {
            place.number
            for row in range(len(folder.plan.rows))
            for place in [p for p in self._places.values() if p.row == row and not p.warm_up][
                :PICTURED
            ]
        }
        self._reached = ""
        self._headed = False

    def begin(self) -> None:
        """Print what the folder holds."""
        folder = self._folder
        if folder.resumed:
            self._say(
                f"session {folder.session}: {len(folder.done)} of {len(self._places)} presses are"
                f" in {folder.path}"
            )
        for path in folder.left_behind:
            self._say(f"not changed: {path}, of an interrupted press")
        for path in folder.incomplete:
            text = f"{path} is not a complete press; it is kept, and the press is made again"
            self._warnings.append(text)
            common.warn(not self._json, text)
        if folder.others:
            self._say(f"not changed: {folder.others} recordings of other sessions")

    def on(self, bench: common.Bench) -> None:
        """Print the bench of the next presses."""
        self._reached = bench.reached
        if not self._headed:
            self._say(f"rig {bench.rig.name} on {bench.where}")
            if bench.reached:
                self._say(bench.reached)
            self._say(HEADER)
            self._headed = True

    def pressed(self, number: int, path: Path) -> None:
        """Analyse a press of the plan, and print its results."""
        self._folder.done[number] = path
        both = self._take(number, path)
        self._say(press_line(*both) + "  warm-up" * self._places[number].warm_up)

    def end(self, to_set: dict[str, Any]) -> None:
        """Print the summary of all presses of the session, including earlier runs.

        Args:
            to_set: Rig keys and values that the operator must set before the session continues.
        """
        folder = self._folder
        earlier = [number for number in folder.done if number not in self._found]
        with common.bar(len(earlier)) as step:
            for number in earlier:
                self._take(number, folder.done[number])
                step()
        order = sorted(self._found)
        recordings = [str(folder.done[number]) for number in order]
        left = len(self._places) - len(order)
        result: dict[str, Any] = {
            "session": folder.session,
            "recordings": recordings,
            "presses": [
                press_summary(*self._found[number])
                | {"item": number, "warm_up": self._places[number].warm_up}
                for number in order
            ],
            "simulated": any(self._found[number][0].simulated for number in order),
            "seed": folder.seed,
            "reached": self._reached,
            "left": left,
            "left_behind": [str(path) for path in folder.left_behind],
            "to_set": to_set,
            "warnings": self._warnings,
        }
        lines = [warning for number in order for warning in self._found[number][1].warnings]
        summaries = []
        for index in range(len(folder.plan.rows)):
            found, row_lines = self._row(index)
            if found:
                summaries.append(found)
                lines += row_lines
        if len(folder.plan.rows) == 1 and summaries:
            result |= {key: value for key, value in summaries[0].items() if key != "recordings"}
        else:
            result["rows"] = summaries
        lines += [f"recording:  {path}" for path in recordings]
        if to_set:
            values = ", ".join(f"{key} = {value}" for key, value in to_set.items())
            lines.append(
                f"{left} press{'es' * (left > 1)} left: set {values} on the instrument, then run"
                " the same command again"
            )
        common.answer(self._json, result, lines)

    def _row(self, index: int) -> tuple[dict[str, Any], list[str]]:
        """Return results and lines on all presses of one row."""
        row = self._folder.plan.rows[index]
        numbers = [
            number
            for number in sorted(self._found)
            if self._places[number].row == index and not self._places[number].warm_up
        ]
        if not numbers:
            return {}, []
        both = [self._found[number] for number in numbers]
        pressed, found = [p for p, _ in both], [f for _, f in both]
        paths = [press.path for press in pressed]
        result: dict[str, Any] = {"recordings": [str(path) for path in paths]}
        lines = []
        if len(self._folder.plan.rows) > 1:
            result |= {"values": dict(row.values), "notes": row.notes}
            lines.append(", ".join(f"{key} = {value}" for key, value in row.values.items()) + ":")
        if any(f.plucks for f in found):
            prediction = predict(row.rig)
            comparison = compare(found, predict_each(pressed, found, row.rig))
            drawn = len(self._pictured.intersection(numbers))
            names = dict.fromkeys((paths[0].stem, paths[drawn - 1].stem))
            picture = self._folder.path / f"{'-to-'.join(names)}.png"
            figure = comparison_figure(pressed[:drawn], found[:drawn], prediction)
            figure.savefig(picture, dpi=120)
            result |= summary.comparison_summary(comparison) | {"picture": str(picture)}
            lines += [
                *summary.comparison_lines(comparison, prediction.level),
                f"picture:    {picture}",
            ]
        else:
            lines.append("no press has a pluck; nothing to compare with the model")
        if len(numbers) >= LEAST and row.rig.press.gesture is None:
            spread = repeatability(pressed, press_law(row.rig.press))
            result["repeatability"] = summary.repeatability_summary(spread)
            lines += summary.repeatability_lines(spread)
        return result, lines

    def _take(self, number: int, path: Path) -> tuple[Press, Phases]:
        """Analyse a press; of presses not plotted, keep only the jack's rise in the cruise."""
        press = load_press(path)
        phases = find_phases(press)
        if number not in self._pictured:
            law = press_law(press.rig.press)
            cruise = slice(law.cruise_start - BESIDE, law.cruise_end + BESIDE)
            press = replace(press, data=press.data.loc[cruise, ["jack_rise"]].copy())
        self._found[number] = press, phases
        return press, phases

    def _say(self, line: str) -> None:
        common.say(not self._json, line)

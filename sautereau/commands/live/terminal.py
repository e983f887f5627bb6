"""A live view of a session in the terminal."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.text import Text

from sautereau.analysis.report.pictures import envelope
from sautereau.robot.experiment.monitor import Made, Samples, Seen, Stage
from sautereau.robot.experiment.session import WARM_UPS

_DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
"""Bits of a Braille pattern, by column and by row from the top."""


class TerminalView:
    """Shows arm, acquisition, faults, and the traces of the last press.

    Use it as a context manager.
    """

    def __init__(self, title: str, console: Console | None = None):
        self._console = console or Console(stderr=True)
        self._title = title
        self._live: Live | None = None
        self._arm, self._daq, self._press, self._made = "", "", 0, 0
        self._traces: dict[str, list[NDArray[np.float64]]] = {}
        self._dropped, self._fault = 0, ""

    def __enter__(self) -> "TerminalView":
        self._live = Live(self._drawn(), console=self._console, auto_refresh=False)
        self._live.__enter__()
        return self

    def __exit__(self, *exception: object) -> None:
        live, self._live = self._live, None
        if live is not None:
            live.stop()

    def show(self, seen: Sequence[Seen], dropped: int) -> None:
        """Show everything new since the last call."""
        for one in seen:
            match one:
                case Stage():
                    self._arm, self._daq = one.arm, one.daq
                    if one.press is not None and one.press != self._press:
                        self._press = one.press
                        self._traces = {}
                case Samples():
                    for channel, volts in zip(one.channels, one.block.volts, strict=True):
                        label = f"{channel.name} ({channel.unit})"
                        drawn = envelope(volts, 2 * len(volts) // 32)
                        self._traces.setdefault(label, []).append(volts[drawn] * channel.scale)
                case Made():
                    self._made += not one.path.match(WARM_UPS)
                case _:
                    self._arm, self._daq = "see below", "ended"
                    # The answer of a device must not contain control characters for the terminal.
                    self._fault = "".join(
                        c if c.isprintable() or c == "\n" else "?" for c in one.text
                    )
        changed = bool(seen) or dropped != self._dropped
        self._dropped = dropped
        if self._live is not None and changed:
            self._live.update(self._drawn(), refresh=True)

    def _drawn(self) -> RenderableType:
        state = Text.assemble(
            ("arm ", "dim"),
            f"{self._arm or 'not connected':<18} ",
            ("acquisition ", "dim"),
            f"{self._daq or '-':<9} ",
            ("press ", "dim"),
            f"{self._press or '-':<5} ",
            ("made ", "dim"),
            f"{self._made}",
        )
        lines = [state]
        if self._dropped:
            lines.append(Text(f"{self._dropped} events are not shown", "yellow"))
        if self._fault:
            lines.append(Text(self._fault, "bold red"))
        width = max(10, self._console.width - 6)
        for label, parts in self._traces.items():
            values = np.concatenate(parts)
            ends = "nothing"
            if not np.isnan(values).all():
                ends = f"{np.nanmin(values):.4g} to {np.nanmax(values):.4g}"
            lines.append(Text(f"{label}: {ends}", "dim"))
            lines += [Text(line) for line in trace_lines(values, width, 5)]
        return Panel(Group(*lines), title=Text(self._title), title_align="left")


def trace_lines(values: NDArray[np.float64], width: int, height: int) -> list[str]:
    """Draw a signal in Braille, two columns and four rows of dots to a character.

    Every column shows the range from the smallest to the largest of its samples.

    Args:
        values: Signal, shape (n,), n >= 1; NaN and infinity are not drawn.
        width: In characters.
        height: In lines.
    """
    rows, columns = 4 * height, min(2 * width, len(values))
    finite = values[np.isfinite(values)]
    cells = np.full((height, width), 0x2800)  # A blank pattern
    if not len(finite):
        return ["".join(map(chr, line)) for line in cells]
    low, span = float(finite.min()), float(np.ptp(finite)) or 1.0
    for column, part in enumerate(np.array_split(values, columns)):
        part = part[np.isfinite(part)]
        if not len(part):
            continue
        ends = ((part.min() - low) / span, (part.max() - low) / span)
        bottom, top = (round(fraction * (rows - 1)) for fraction in ends)
        for row in range(rows - 1 - top, rows - bottom):
            cells[row // 4, column // 2] |= _DOTS[column % 2][row % 4]
    return ["".join(map(chr, line)) for line in cells]

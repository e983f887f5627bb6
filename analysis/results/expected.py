"""The uncertainties that presses would reach, before they are made."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify import forecast as forecasts
from sautereau.analysis.identify.forecast import (
    Planned,
    WhiteNoise,
    forecast,
    together,
)
from sautereau.analysis.identify.information import IDENTIFIABLE, MORE, USEFUL, Uncertainty
from sautereau.analysis.identify.parameters import (
    FORCE,
    canonical,
    check_names,
    read_prior,
    unit_of_parameter,
    value_of,
)
from sautereau.analysis.model.predict import expected_of
from sautereau.analysis.results.result import Result, drawing, frame_of, named, plain, shown
from sautereau.analysis.text import counted, in_rig_units, table
from sautereau.rig.faults import fault_list
from sautereau.rig.schema import Rig
from sautereau.rig.units import parse_quantity
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.press import plan_press

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Choice:
    """Presses that could be made, or a number that could be measured first."""

    what: str
    stds: dict[str, float | None]
    """SI, standard uncertainties by parameter, without its own prior; None if undetermined."""


@dataclass(frozen=True, repr=False)
class Expected(Result):
    """What a fit to planned presses would reach; the choices, the best first."""

    rig: Rig
    presses: int
    noise: WhiteNoise
    instruments: int
    """Number of drawn instruments."""
    parameters: tuple[Uncertainty, ...]
    choices: tuple[Choice, ...]
    """By the geometric mean of the uncertainties."""
    warnings: tuple[str, ...]

    def __repr__(self) -> str:
        good = sum(p.identifiable for p in self.parameters)
        return (
            f"<Expected of {counted(self.presses, 'press')} of rig {self.rig.name}:"
            f" {good} of {counted(len(self.parameters), 'parameter')} identifiable>"
        )

    @property
    def document(self) -> dict[str, Any]:
        """The expectation as JSON; SI units."""
        return {
            "presses": self.presses,
            "jack_speed": self.rig.press.jack_speed,
            "sample_rate": self.rig.daq.sample_rate,
            "noise": plain(self.noise),
            "instruments": self.instruments,
            "parameters": named(self.parameters),
            "choices": plain(self.choices),
            "warnings": list(self.warnings),
        }

    def lines(self) -> list[str]:
        """Return the expectation as text."""
        force, velocity = self.noise.force * 1e3, self.noise.velocity * 1e3
        rows: list[tuple[str, ...]] = [
            ("", "rig", "std noise", "inputs", "total", "needed", "unit")
        ]
        for p in self.parameters:
            stds = p.std_noise, p.std_inputs, p.std, p.needed
            value, spreads, unit = in_rig_units(p.value, p.std, p.unit, stds)
            rows.append((p.name, value, *spreads, unit))
        names = [p.name for p in self.parameters]
        compared: list[tuple[str, ...]] = [
            ("standard uncertainty of", *(n.rpartition(".")[2] for n in names))
        ]
        for choice in self.choices:
            cells = []
            for p in self.parameters:
                std = choice.stds[p.name]
                percent = 100 * IDENTIFIABLE * (std or 0.0) / p.needed
                text = f"{percent:.0f} %" if percent >= 100 else f"{percent:.2g} %"
                cells.append("-" if std is None else text + "*" * (std < p.needed))
            compared.append((choice.what, *cells))
        return [
            f"rig {self.rig.name}: {counted(self.presses, 'press')} at"
            f" {self.rig.press.jack_speed:.4g} m/s and {self.rig.daq.sample_rate / 1e3:.4g} kHz,"
            f" noise of {force:.3g} mN and {velocity:.3g} mm/s; mean of"
            f" {counted(self.instruments, 'instrument')} within"
            " what the rig states",
            *table(rows, left=(0, 6), indent=2, gap=1),
            "choices, the best first, by the uncertainties that they leave (* identifiable):",
            *table(compared, indent=2),
            *(f"warning: {warning}" for warning in self.warnings),
        ]

    def to_frame(self) -> "pd.DataFrame":
        """Return the standard uncertainty of each parameter after each choice, SI."""
        names = [p.name for p in self.parameters]
        rows = [[c.what, *(c.stds[name] for name in names)] for c in self.choices]
        return frame_of(
            rows, ["choice", *names], "choice", {p.name: p.unit for p in self.parameters}
        )

    def plot(self) -> "Figure":
        """Return a figure of the uncertainties of each choice over the needed ones."""
        figure = drawing(10, 0.5 * len(self.choices) + 2)
        axes, at = figure.subplots(), np.arange(len(self.choices))[::-1]
        for number, p in enumerate(self.parameters):
            ratios = [(c.stds[p.name] or np.nan) / p.needed for c in self.choices]
            axes.plot(ratios, at, "osD^vP*X"[number % 8], label=p.name)
        axes.axvline(1.0, color="black", lw=0.8)
        axes.set_yticks(at, [c.what for c in self.choices])
        axes.set(
            xscale="log", xlabel="standard uncertainty over the one below which it is identifiable"
        )
        axes.legend()
        return shown(figure)


def expected(
    rig: Rig,
    names: Sequence[str],
    priors: Sequence[str],
    presses: int,
    speeds: Sequence[str],
    force_noise: str,
    velocity_noise: str,
) -> Expected:
    """Return the uncertainties that presses of a rig's plan would reach; see `Plan.expected`."""
    names = list(map(canonical, names))
    known_of = dict(map(read_prior, priors))
    check_names(names, known_of)
    noise, others = _read(presses, speeds, force_noise, velocity_noise)
    plan_press(rig, expected_of(rig)[0])
    speed, warnings = rig.press.jack_speed, []
    kinds = [Planned(speed), Planned(speed, muted=True)]
    # Half and double the planned speed.
    for other in others or [speed * factor for factor in (0.5, 2.0)]:
        slower = rig.replaced({"press.jack_speed": other})
        try:
            plan_press(slower, expected_of(slower)[0])
            kinds.append(Planned(other))
        except TrajectoryError as error:
            reason = str(error).partition("\n")[2].strip() or str(error)
            warnings.append(f"presses at {other:.4g} m/s are not compared: {reason}")
    counts = _counts(kinds, presses)
    first, *_ = counts
    shown_names = [name for name in names if name != FORCE]
    parts, scales, left = [], [], defaultdict(list)
    for problem, data in forecast(rig, names, kinds, known_of, noise):
        free = [p.name for p in problem.free]
        own = [free.index(name) for name in shown_names]
        scale = problem.scales[own]
        for what, count in counts.items():
            known = together(problem, data, count)
            left[what].append([known.std(k) for k in own] * scale)
        known = together(problem, data, counts[first])
        stds, by_noise = known.stds[own] * scale, known.noise_stds[own] * scale
        parts.append([stds, by_noise, np.sqrt(np.maximum(stds**2 - by_noise**2, 0.0))])
        scales.append(scale)
        for how, which in known.measurable().items():
            if set(own).isdisjoint(which):
                left[how.partition(",")[0]].append([known.std(k, which) for k in own] * scale)
    if without := forecasts.DRAWS - len(parts):
        warnings.append(
            f"{without} of {forecasts.DRAWS} drawn instruments have no such press, or no pluck"
        )
    needed = IDENTIFIABLE * np.mean(scales, axis=0)
    means = {what: np.mean(every, axis=0) for what, every in left.items()}
    # Compared by the geometric mean; nothing is gained where all stay undetermined.
    sizes = {what: float(np.mean(np.log(each / needed))) for what, each in means.items()}
    useful = [w for w in means if w in counts or sizes[w] < sizes[first] + np.log(USEFUL)]
    columns = zip(shown_names, *np.mean(parts, axis=0), needed, means[first], strict=True)
    return Expected(
        rig,
        presses,
        noise,
        len(parts),
        tuple(
            Uncertainty(
                name,
                unit_of_parameter(name),
                value_of(rig, name),
                *(_known(each) for each in stds),
                needed=float(limit),
                identifiable=bool(unaided < limit),
            )
            for name, *stds, limit, unaided in columns
        ),
        tuple(
            Choice(what, dict(zip(shown_names, map(_known, means[what]), strict=True)))
            for what in sorted(useful, key=sizes.__getitem__)
        ),
        tuple(warnings),
    )


def _known(std: float) -> float | None:
    return float(std) if np.isfinite(std) else None


def _counts(kinds: Sequence[Planned], presses: int) -> dict[str, tuple[int, ...]]:
    """Return the number of presses of each kind for each choice; the first is as planned."""
    planned, half = kinds[0], presses // 2

    def of(count: int, kind: int = 0, others: int = 0) -> tuple[int, ...]:
        return tuple(count * (k == kind) + others * (k == 0) for k in range(len(kinds)))

    found = {f"{counted(presses, 'press')} as planned": of(presses)}
    found[f"{MORE * presses} presses"] = of(MORE * presses)
    for k, kind in enumerate(kinds[1:], 1):
        if kind.muted:
            what = "without the string"
        else:
            found[f"{presses} at {kind.speed:.4g} m/s"] = of(presses, k)
            what = f"at {kind.speed:.4g} m/s"
        if half:
            name = f"{presses - half} at {planned.speed:.4g} m/s, {half} {what}"
            found[name] = of(half, k, presses - half)
    return found


def _read(
    presses: int, speeds: Sequence[str], force: str, velocity: str
) -> tuple[WhiteNoise, list[float]]:
    """Return the noise and other speeds [m/s].

    Raises:
        AnalysisError: Reports all faults.
    """
    faults, found = [], []
    if presses < 1:
        faults.append(f"presses: {presses} is not 1 or more")
    given = [("force_noise", force, "N"), ("velocity_noise", velocity, "m/s")]
    for name, text, unit in [*given, *(("speeds", speed, "m/s") for speed in speeds)]:
        try:
            found.append(parse_quantity(text, unit))
            if not found[-1] > 0:
                faults.append(f"{name}: {text} is not above 0")
        except ValueError as error:
            faults.append(f"{name}: {error}")
    if faults:
        raise AnalysisError(fault_list("expected", faults))
    return WhiteNoise(*found[:2]), found[2:]

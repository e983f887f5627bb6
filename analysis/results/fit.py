"""Values of a rig that were fitted to recordings."""

from dataclasses import dataclass
from datetime import date
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sautereau.analysis.alike import INSTRUMENT
from sautereau.analysis.figures import palette
from sautereau.analysis.identify import fit as fitting
from sautereau.analysis.identify.fixed import SUGGESTED, Suggestion
from sautereau.analysis.identify.identified import (
    Estimate,
    Identified,
    Profile,
    profile,
)
from sautereau.analysis.identify.information import IDENTIFIABLE
from sautereau.analysis.identify.observed import coupled_force
from sautereau.analysis.identify.parameters import CONTACT, rig_numbers, rig_values, values_of_rig
from sautereau.analysis.identify.quality import Quality
from sautereau.analysis.results.prediction import Predicted, predicted
from sautereau.analysis.results.result import (
    Result,
    drawing,
    frame_of,
    json_of,
    named,
    plain,
    shown,
)
from sautereau.analysis.results.rig import Rig
from sautereau.analysis.session.conditions import doubtful_presses
from sautereau.analysis.text import (
    SOME_SIMULATED,
    counted,
    in_rig_units,
    quantity_in_rig,
    table,
    visible,
)
from sautereau.rig import schema
from sautereau.rig.disk import write_durably
from sautereau.rig.document import current_key, rig_document
from sautereau.rig.edit import edit_rig, edited_text
from sautereau.rig.errors import RigError
from sautereau.rig.load import parse_rig
from sautereau.rig.quantities import QUANTITIES
from sautereau.rig.text import rig_text

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

NOTHING_SUGGESTED = (
    f"  nothing is suggested: freeing a fixed number, lengths and tension apart, would reduce the"
    f" weighted sum of squares by less than {SUGGESTED:g}, or give an impossible value"
)
PRESS_ARM = "key.press_arm"
TOGETHER = 2  # Number of results in one table of effects, which then fits into 80 columns
COLUMNS = (
    *("name", "unit", "value", "std", "std_noise", "std_inputs", "low", "high", "rig_value"),
    *("at_bound", "identifiable"),
)  # Columns of the table of parameters


@dataclass(frozen=True, repr=False)
class Fit(Result):
    """A fit; `found` has all its results."""

    nominal: schema.Rig
    """Rig of the recordings."""
    simulated: bool
    """Whether the stand-in made any of the presses."""
    mixed: tuple[str, ...]
    """Keys in which the presses differ although they were fitted together: the day, the scene."""
    made: fitting.Fit
    found: Identified
    profiles: tuple[Profile, ...] = ()
    """Profile likelihoods of the parameters; empty unless they were requested."""
    warned: tuple[bool, ...] = ()
    """Whether each press has warnings of its own."""

    def __repr__(self) -> str:
        values = ", ".join(f"{e.name} {_stated(e)}" for e in self.found.estimates)
        presses = counted(len(self.found.presses), "press")
        return f"<Fit to {presses}: {values}; {self.found.quality.verdict}>"

    @property
    def params(self) -> "pd.DataFrame":
        """Each parameter with value, total uncertainty and its parts, and 95 % interval, SI."""
        rows = [[getattr(e, name) for name in COLUMNS] for e in self.found.estimates]
        return frame_of(rows, COLUMNS, "name")

    @property
    def identifiable(self) -> dict[str, bool]:
        """Whether each parameter is certain enough without its own prior."""
        return {e.name: e.identifiable for e in self.found.estimates}

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about doubtful results."""
        more = []
        if self.mixed:
            more.append(f"fitted together, although the presses differ in {', '.join(self.mixed)}")
        if not self.simulated and self.found.contact_warning:
            more.append(self.found.contact_warning)
        return (*doubtful_presses(self.warned), *self.found.warnings, *more)

    @property
    def document(self) -> dict[str, Any]:
        """The fit as JSON; SI units."""
        found, names = self.found, [e.name for e in self.found.estimates]
        correlation = zip(names, found.correlation.tolist(), strict=True)
        own = ("rig", "estimates", "combinations", "warnings")
        result = {name: plain(v) for name, v in vars(found).items() if name not in own} | {
            "parameters": named(found.estimates),
            "correlation": {name: dict(zip(names, row, strict=True)) for name, row in correlation},
            "identifiable": {
                "all": all(c.identifiable for c in found.combinations),
                "identifiable_below": IDENTIFIABLE,
                "combinations": plain(found.combinations),
            },
            "also_fitted": named(found.also_fitted),
            "instrument": {k: v for k, v in rig_document(self.nominal).items() if k in INSTRUMENT},
            "fits": found.quality.fits,
            "quality": json_of(found.quality, "repetition", "quiet", "repeats"),
            "sensitivity": named(found.sensitivity),
            "simulated": self.simulated,
            "warnings": list(self.warnings),
        }
        if self.profiles:
            result["profiles"] = {
                p.name: json_of(p, "name", "low", "high") | {"ci95": [p.low, p.high]}
                for p in self.profiles
            }
        return result

    def lines(self, *, every: bool = False) -> list[str]:
        """Return the fit as text.

        Args:
            every: Whether to add the table of the fixed numbers' effects.
        """
        found, doubts = self.found, any(self.warned)
        warnings = [f"warning: {warning}" for warning in self.warnings]
        lines = [
            *([SOME_SIMULATED] * self.simulated),
            f"rig {found.rig.name}, plectrum model {found.level}, fitted to"
            f" {counted(len(found.presses), 'press')} with {counted(found.releases, 'release')}",
            f"{QUANTITIES['residual'].label}: {found.residual_before * 1e3:.3g} mN before the fit,"
            f" {found.residual * 1e3:.3g} mN after",
            *(
                f"compliant key: mode at {m.frequency:.4g}"
                f"{'' if m.frequency_std is None else f' +- {m.frequency_std:.2g}'} Hz, damping"
                f" {m.damping:.2g}"
                for m in found.modes
            ),
            *(
                ["no rigid key fits, with other delays, gains or a drift of the force"]
                * bool(found.modes)
            ),
            *warnings[:doubts],
            _quality_line(found.quality),
            *(f"  {reason}" for reason in found.quality.reasons),
            *(_suggestion_line(suggestion) for suggestion in found.suggested),
            *([NOTHING_SUGGESTED] * (found.quality.fits is False and not found.suggested)),
            *table([_HEADS, *map(_estimate_cells, found.estimates)], left=(0, 5), indent=2, gap=1),
            "  std: standard uncertainty from the noise, from gains, delays, priors and assumed"
            " ranges (inputs), and in total",
            *_also_lines(found),
            *_exact_lines(found),
            *(line for estimate in found.estimates for line in _needed_lines(estimate)),
        ]
        if not found.quality.fits:
            lines.append("no 95 % intervals: the uncertainties are those of a model that fits")
        for likely in self.profiles:
            lines.append(_profile_line(likely, found))
        if all(c.identifiable for c in found.combinations):
            of = "from these recordings" if found.quality.fits else "by a model that fits"
            lines.append(f"all parameters are identifiable {of}")
        else:
            lines.append(
                "not all parameters are identifiable from these recordings; standard uncertainty of"
                " the combinations of their relative changes:"
            )
            lines += [
                f"  {'undetermined' if c.std is None else f'{c.std:.2g}'},"
                f" {'identifiable' if c.identifiable else 'not identifiable'}: {c}"
                for c in found.combinations
            ]
        if every:
            lines += _table(found)
        return lines + warnings[doubts:]

    @property
    def values(self) -> dict[str, Any]:
        """Identifiable values by dotted key; empty unless the model is known to fit."""
        sure = [e for e in self.found.estimates if e.identifiable and self.found.quality.fits]
        return rig_values(self.nominal, {e.name: e.value for e in sure})

    @cached_property
    def rig(self) -> Rig:
        """The recordings' rig with `values` and what was fitted with them, with their ranges."""
        return Rig(parse_rig(self.text))

    @property
    def text(self) -> str:
        """Text of a new rig file with the numbers of `rig`."""
        nominal = rig_text(self.nominal)
        return edited_text(nominal, "fit", Path(), self._written, self._source, every=True)

    def write(self, path: Path) -> None:
        """Write the values of `rig` into a rig file and keep its others; a new file is `text`.

        Without `values` nothing is written.

        Raises:
            RigError: The file cannot be read or written.
        """
        if not self.values:
            return
        if path.exists():
            edit_rig(path, self._written, self._source, every=True).save()
            return
        try:
            write_durably(path, self.text)
        except OSError as error:
            raise RigError(f"rig file {path}: {error.strerror}; give another path") from error

    @property
    def _written(self) -> dict[str, Any]:
        """`values` and what was fitted with them, each with the range that the fit leaves.

        A uniform distribution over that range has the standard uncertainty of the value.
        """
        if not self.values:
            return {}
        bounds = {p.name: (p.low, p.high) for p in self.made.problem.free}
        found = [e for e in self.found.estimates if e.identifiable] + [*self.found.also_fitted]
        ends: list[dict[str, float]] = [{}, {}, {}]
        for e in found:
            if e.std is None:
                continue
            reach, (low, high) = 3**0.5 * e.std, bounds[e.name]
            each = e.value, max(low, e.value - reach), min(high, e.value + reach)
            for own, value in zip(ends, each, strict=True):
                own[e.name] = value
        values, *limits = (rig_numbers(self.nominal, own) for own in ends)
        written: dict[str, Any] = {}
        for key, (value, unit) in values.items():
            low, high = sorted(own[key][0] for own in limits)
            std = (high - low) / 12**0.5
            texts = [in_rig_units(x, std, unit) for x in (value, low, high)]
            stated, *assumed = [f"{t} {name}" if unit else float(t) for t, _, name in texts]
            # Uncertainties of [daq] have keys of their own, and a number without unit has no range.
            plain = not unit or key.startswith("daq.")
            written[key] = stated if plain else {"value": stated, "assumed": assumed}
        return written

    @property
    def _source(self) -> str:
        first, more = self.found.presses[0], len(self.found.presses) - 1
        return (
            f"identified from {'SIMULATED ' * self.simulated}{visible(first)}"
            f"{f' and {more} more' * (more > 0)} on {date.today().isoformat()}"
        )

    def profile(self, name: str) -> Profile:
        """Return the profile likelihood of one parameter."""
        return profile(self.made, self.found, name)

    def predict(self, *, level: str = "auto") -> Predicted:
        """Return the press that the fitted values predict, with their uncertainties.

        Raises:
            AnalysisError: A fitted value is undetermined, or the model has hardly a solution.
        """
        undetermined = [
            e.name for e in (*self.found.estimates, *self.found.also_fitted) if e.std is None
        ]
        return predicted(self.nominal, self.found.distribution, undetermined, level=level)

    def to_frame(self) -> "pd.DataFrame":
        """Return the parameters."""
        return self.params

    def plot(self) -> "Figure":
        """Return the first press's force, the residuals of all, correlation and combinations."""
        figure, found = drawing(12, 6.5), self.found
        several = len(found.estimates) > 1
        grid = figure.add_gridspec(2, 1 + several, width_ratios=(1.6, 1)[: 1 + several])
        top, below = (figure.add_subplot(grid[row, 0]) for row in (0, 1))
        _forces(top, below, self.made)
        if several:
            _correlation(figure, figure.add_subplot(grid[0, 1]), found)
            _combinations(figure.add_subplot(grid[1, 1]), found)
        else:
            (one,) = found.estimates
            top.set_title(f"{one.name}: {_stated(one).replace('+-', '±')}", fontsize=10)
        figure.suptitle(
            f"Rig {found.rig.name}: fit to {counted(len(found.presses), 'press')},"
            f" {palette.how_made(self.simulated)}; RMS force residual"
            f" {found.residual_before * 1e3:.3g} mN before, {found.residual * 1e3:.3g} mN after"
        )
        palette.stamp(figure, self.simulated)
        return shown(figure)


def _quality_line(good: Quality) -> str:
    parts = [f"{good.free_residual * 1e3:.3g} mN without a string"]
    if good.held_residual is not None:
        parts.append(f"{good.held_residual * 1e3:.3g} mN while it is held")
    if good.noise is not None:
        parts.append(f"{good.noise * 1e3:.3g} mN of noise at rest")
    return f"{good.verdict}{': ' if good.noise is not None else '; '}residual {', '.join(parts)}"


def _suggestion_line(suggestion: Suggestion) -> str:
    gain = f"weighted sum of squares {suggestion.reduction:.4g} less"
    if suggestion.name == CONTACT:
        return f'  suggested: set {CONTACT} = "surface" in the rig ({gain})'
    value = quantity_in_rig(suggestion.value, suggestion.unit)
    return f"  suggested: free {suggestion.name}, about {value} ({gain})"


def _table(found: Identified) -> list[str]:
    """Return the effects of fixed numbers and calibrations, a line each."""
    lines = [
        "change in % of each result by a change of a number that is not a result"
        " (* its standard uncertainty):"
    ]
    for first in range(0, len(found.estimates), TOGETHER):
        names = [e.name for e in found.estimates[first : first + TOGETHER]]
        rows = [("number", "change", *(name.rpartition(".")[2] for name in names))]
        for s in found.sensitivity:
            change = quantity_in_rig(s.change, s.unit) + "*" * s.stated
            rows.append((s.name, change, *(f"{100 * s.effects[name]:+.2f}" for name in names)))
        lines += table(rows, indent=2, gap=1)
    return lines


_HEADS = ("", "value", "std noise", "inputs", "total", "unit", "rig")


def _estimate_cells(estimate: Estimate) -> tuple[str, ...]:
    """Return name, value, its standard uncertainties, unit and the rig's own value."""
    stds = estimate.std_noise, estimate.std_inputs, estimate.std
    value, spreads, unit = in_rig_units(estimate.value, estimate.std, estimate.unit, stds)
    rig, *_ = in_rig_units(estimate.rig_value, estimate.std, estimate.unit)
    return estimate.name, value, *spreads, unit, rig


def _stated(found: Estimate) -> str:
    """Return a value with its total uncertainty."""
    value, (spread,), unit = in_rig_units(found.value, found.std, found.unit, [found.std])
    return f"{value} +- {spread} {unit}".strip()


def _also_lines(found: Identified) -> list[str]:
    """Return the values that were fitted without being requested."""
    reported = {e.name for e in found.estimates}
    # The recordings say more of a value than two thirds of its prior knowledge: the standard
    # uncertainty of its prior is then at least 1.15 times that with the recordings.
    shown = [
        a
        for a in found.also_fitted
        if a.name in reported
        or current_key(a.name) not in found.rig.assumed
        or (a.unaided and a.std is not None and a.unaided < 2 * a.std)
    ]
    stated = [
        f"{a.name} {_stated(a)} (rig: {quantity_in_rig(a.rig_value, a.unit)}"
        + ", without a range" * (current_key(a.name) not in found.rig.assumed)
        + ")"
        + ", reported because it differs from the rig's" * (a.name in reported)
        for a in shown
    ]
    if others := len(found.also_fitted) - len(shown):
        stated.append(
            f"{counted(others, 'number')} with an assumed range, of which the recordings say little"
        )
    return [f"also fitted, without being requested: {'; '.join(stated)}"] if stated else []


def _exact_lines(found: Identified) -> list[str]:
    """Return what is taken as exact, and has no sign in an AC-coupled force, which lacks its level.

    It scales all moments of the finger, as a gain of the force does.
    """
    known = {*found.rig.assumed, *(e.name for e in found.estimates)}
    if coupled_force(found.rig) is None or PRESS_ARM in known:
        return []
    arm = quantity_in_rig(found.rig.key.press_arm, "m")
    return [
        f"{PRESS_ARM}, {arm} without a range, counts as exact: stiffness, inertia and frictions are"
        " at least as wrong as it is, in %, and an AC-coupled force shows no sign of it"
    ]


def _profile_line(likely: Profile, found: Identified) -> str:
    (estimate,) = (e for e in found.estimates if e.name == likely.name)
    ends = [
        "a bound" if end is None else in_rig_units(end, estimate.std, estimate.unit)[0]
        for end in (likely.low, likely.high)
    ]
    unit = in_rig_units(estimate.value, estimate.std, estimate.unit)[2]
    text = f"95 % by profile likelihood: {ends[0]} to {ends[1]} {unit}"
    return f"  {likely.name}: {text}".rstrip()


def _needed_lines(estimate: Estimate) -> list[str]:
    """Return what would make a parameter identifiable; nothing if it is."""
    if estimate.identifiable:
        return []

    def spread(std: float) -> str:
        return f"+- {quantity_in_rig(std, estimate.unit, 2)}"

    prior = ""
    if estimate.std is not None and estimate.std < estimate.needed:
        unaided = "undetermined" if estimate.unaided is None else spread(estimate.unaided)
        prior = f", and without its own prior it is {unaided}"
    helps = [f"at best {spread(m.std)} if you {m.what}" for m in estimate.measurements]
    return [
        f"{estimate.name} is not identifiable from these recordings:"
        f" {spread(estimate.needed)} is needed{prior}",
        *(f"  {each}" for each in helps or ["no single measurement would change this"]),
    ]


def _forces(top, below, fitted: fitting.Fit) -> None:
    """Draw the first press's force and its models, and the residual of every press."""
    dynamics, noise = fitted.problem.dynamics, fitted.problem.whitenings
    before, _ = dynamics.residuals(values_of_rig(dynamics.rig, dynamics.free))
    after, _ = dynamics.residuals(fitted.values)
    press = dynamics.presses[0]
    time = press.time * 1e3
    force = np.full(len(time), np.nan)
    force[press.used] = press.force()
    top.plot(time, force, color=palette.MEASURED, lw=2.2, alpha=0.6, label="recorded")
    for residual, colour, name, dashes in (
        (before[0], palette.BEFORE, "model before", ":"),
        (after[0], palette.PREDICTED, "model fitted", "--"),
    ):
        model = np.full(len(time), np.nan)
        model[press.used] = force[press.used] - residual + noise[0].trend(residual)
        top.plot(time, model, color=colour, lw=1.4, ls=dashes, label=name)
    start, peak = time[press.used][0], time[np.nanargmax(force)]
    top.set_xlim(start, start + 1.7 * (peak - start))  # Beyond the largest force
    top.set(ylabel="finger force (N)", xlabel="time after the trigger (ms), first press")
    top.legend(loc="upper right")
    for i, (each, residual, white) in enumerate(zip(dynamics.presses, after, noise, strict=True)):
        left = np.full(len(each.time), np.nan)
        left[each.used] = residual - white.trend(residual)
        style = {
            "color": palette.SERIES[i % len(palette.SERIES)],
            "ls": palette.DASHES[i % len(palette.DASHES)],
        }
        below.plot(each.time * 1e3, left * 1e3, lw=0.6, alpha=0.7, **style)
    below.set(ylabel="force residual of every press (mN)", xlabel="time after the trigger (ms)")


def _correlation(figure, axes, found: Identified) -> None:
    names = [e.name.rpartition(".")[2] for e in found.estimates]
    image = axes.imshow(found.correlation, cmap="RdBu_r", vmin=-1, vmax=1, aspect="auto")
    axes.set_xticks(range(len(names)), names, rotation=30, ha="right")
    axes.set_yticks(range(len(names)), names)
    for (row, column), value in np.ndenumerate(found.correlation):
        colour = "white" if abs(value) > 0.6 else "black"
        axes.text(column, row, f"{value:.2f}", ha="center", va="center", color=colour)
    figure.colorbar(image, ax=axes, label="correlation")


def _combinations(axes, found: Identified) -> None:
    """Draw the uncertainty of each combination, the largest at the bottom."""
    from matplotlib.ticker import LogFormatter

    known = [(str(c), c.std, c.identifiable) for c in found.combinations if c.std is not None]
    for place, (_, std, identifiable) in enumerate(known):
        marker, colour = ("o", palette.MEASURED) if identifiable else ("x", palette.PREDICTED)
        axes.plot(100 * std, -place, marker, color=colour)
    axes.axvline(100 * IDENTIFIABLE, color=palette.OTHER, ls=":", label="identifiable below")
    axes.legend(fontsize=8)
    axes.set_yticks([-place for place in range(len(known))], [name for name, *_ in known])
    axes.tick_params(axis="y", labelsize=7)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(LogFormatter())  # where less than a decade is shown
    axes.set_xlabel("total standard uncertainty (% of the scale)")
    unseen = [str(c) for c in found.combinations if c.std is None]
    if unseen:
        axes.set_title("undetermined: " + "; ".join(unseen), fontsize=8)

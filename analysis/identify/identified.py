"""The result of a fit: values, uncertainties and identifiability."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.compliant import fit_presses
from sautereau.analysis.identify.elastic import doubtful_modes, mode_names
from sautereau.analysis.identify.fit import Fit, informative, rms
from sautereau.analysis.identify.fixed import (
    SUGGESTED,
    Sensitivity,
    Suggestion,
    fixed_numbers,
    sensitivities,
    suggestions,
)
from sautereau.analysis.identify.information import (
    IDENTIFIABLE,
    Combination,
    Distribution,
    Information,
    Measurement,
    Uncertainty,
)
from sautereau.analysis.identify.parameters import (
    CONTACT,
    FRICTION,
    Prior,
    split_name,
    value_of,
    with_parameters,
)
from sautereau.analysis.identify.problem import Problem, minimise
from sautereau.analysis.identify.quality import Quality, judged, quality
from sautereau.analysis.identify.residuals import InverseDynamics
from sautereau.analysis.loading.press import Press
from sautereau.analysis.model.choirs import ignored, level_name
from sautereau.analysis.phases import Phases
from sautereau.analysis.session.repeatability import NORMAL
from sautereau.rig.schema import Rig
from sautereau.trajectory.motion import Floats


@dataclass(frozen=True)
class Estimate(Uncertainty):
    """A fitted value; SI."""

    rig_value: float
    """Value of the rig; 0 for an offset."""
    low: float | None
    """Lower end of the 95 % interval; None if undetermined, or if the model does not fit."""
    high: float | None
    """Upper end of the 95 % interval; None as for `low`."""
    at_bound: bool
    """Whether the value is at a bound. The interval then describes the bound and not the data."""
    unaided: float | None
    """Total standard uncertainty without its own prior, compared with `needed`; None if
    undetermined."""
    measurements: tuple[Measurement, ...]
    """What would reduce its uncertainty most, the best first; empty if it is identifiable."""


@dataclass(frozen=True)
class FittedMode:
    """A fitted elastic mode of the key and the parts that move with it."""

    frequency: float
    """Hz."""
    frequency_std: float | None
    """Hz, standard uncertainty; None if undetermined."""
    damping: float
    """Damping ratio."""
    damping_std: float | None
    """Standard uncertainty of the damping ratio; None if undetermined."""


@dataclass(frozen=True)
class Identified:
    """The identified parameters of presses; the uncertainties are total ones."""

    rig: Rig
    """The bench with the fitted values."""
    estimates: tuple[Estimate, ...]
    correlation: Floats
    """Correlation coefficients of the estimates, shape (parameters, parameters)."""
    combinations: tuple[Combination, ...]
    """Combinations of parameters, those best determined by the data first; the priors are not
    used."""
    presses: tuple[str, ...]
    """Names of the recordings."""
    releases: int
    """Number of releases in the recordings."""
    level: str
    """Plectrum model."""
    residual: float
    """N, RMS force residual with the fitted values."""
    residual_before: float
    """N, RMS force residual with the values of the rig."""
    rise_residual: float | None
    """m, RMS residual of the rises at release; None if no press has a release."""
    force_offsets: tuple[float, ...]
    """N, fitted zero of the force in each press; 0 if it was not fitted."""
    also_fitted: tuple[Estimate, ...]
    """Values of the rig that were fitted without being requested."""
    distribution: Distribution
    """Of `estimates` and `also_fitted`; what is undetermined has the std None there."""
    modes: tuple[FittedMode, ...]
    """Elastic modes of the key; empty for a rigid key."""
    quality: Quality
    """Goodness of the fit."""
    sensitivity: tuple[Sensitivity, ...]
    """Effects of the fixed numbers on the results, the largest effect first."""
    suggested: tuple[Suggestion, ...]
    """Fixed numbers that should be freed, the best first; empty if the model fits."""
    warnings: tuple[str, ...]

    @property
    def contact_warning(self) -> str | None:
        """Warning of results for a string on the mid-line, which no instrument has; or None.

        The wrong place may leave no residual.
        """
        suggested = any(s.name == CONTACT for s in self.suggested)
        if self.rig.plectrum.contact != "mid-line" or suggested:
            return None
        effects = next((s.effects for s in self.sensitivity if s.name == CONTACT), {})
        changes = [f"{n} by {100 * e:+.0f} %" for n, e in effects.items() if abs(e) > IDENTIFIABLE]
        if not changes:
            return None
        return (
            f'{CONTACT} is "mid-line" in the rig, as in the paper\'s equations, but on an'
            f' instrument the string lies on the surface; "surface" would change'
            f" {', '.join(changes)}"
        )


def identify(
    presses: Sequence[Press],
    phases: Sequence[Phases],
    names: Sequence[str],
    priors: Mapping[str, Prior] | None = None,
    *,
    level: str = "auto",
    starts: int = 3,
    robust: bool = False,
) -> Identified:
    """Fit parameters of a rig to the forces and motions of recorded presses of it.

    Args:
        presses: Recordings of one instrument. A warning names those that are not usable.
        phases: Phases of these presses, in the same order.
        names: Free parameters, from `parameter_names.NAMES`.
        priors: Prior knowledge of parameters, by name.
        starts: Number of starting points: the rig's values, and points between the bounds.
        robust: Weight large residuals linearly instead of quadratically.

    Raises:
        AnalysisError: There is no usable press, no parameter, or the presses have different rigs.
        ModelError: The model has no solution for the rig's values.
    """
    return evaluate(fit_presses(presses, phases, names, priors, level, starts, robust))


def evaluate(fitted: Fit) -> Identified:
    """Return the result of a fit with its uncertainties."""
    found, values, good = fitted.problem, fitted.values, quality(fitted)
    unasked = [k for k, p in enumerate(found.free) if p.hidden and not p.name.startswith("offset.")]
    slopes = found.differences(values / found.scales)
    data = found.white(slopes)
    known = Information(
        [p.name for p in found.free],
        informative(fitted, data) / np.sqrt(good.repetition),
        found.prior_jacobian,
        fitted.moved,
    )
    fitted = _with_found_friction(fitted, known)
    found, dynamics = fitted.problem, fitted.problem.dynamics
    fixed = fixed_numbers(fitted)
    suggested = suggestions(fitted, fixed, slopes, good.scale)
    good = judged(good, fitted)
    # The model may be wrong although the residuals are small.
    doubts = [
        f"{s.name}: freeing it would reduce the weighted sum of squares by {s.reduction:.4g}, and"
        f" {SUGGESTED:.0f} are allowed: the other parameters imitate it"
        for s in suggested
        if s.name in (FRICTION, CONTACT)
    ]
    doubts += doubtful_modes(found.free, fitted.values, dynamics.presses)
    good = replace(good, reasons=(*good.reasons, *doubts))
    shown = [k for k, p in enumerate(found.free) if not p.hidden]
    estimates, also = (_estimates(fitted, which, good, known) for which in (shown, unasked))
    forces, rises = dynamics.residuals(values)
    trends = [w.trend(f) for f, w in zip(forces, found.whitenings, strict=True)]
    of_rig = [k for k, p in enumerate(found.free) if not p.name.startswith("offset.")]
    low, high = np.array([(found.free[k].low, found.free[k].high) for k in of_rig]).T
    scales = found.scales[of_rig]
    return Identified(
        rig=with_parameters(dynamics.rig, {e.name: e.value for e in estimates}),
        estimates=estimates,
        correlation=known.correlation[np.ix_(shown, shown)],
        combinations=known.combinations(shown),
        presses=tuple(press.name for press in dynamics.presses),
        releases=len(rises),
        level=level_name(dynamics.rig, dynamics.level),
        residual=rms([f - trend for f, trend in zip(forces, trends, strict=True)]),
        residual_before=fitted.residual_before,
        rise_residual=rms([rises * dynamics.rise_stds]) if len(rises) else None,
        force_offsets=tuple(float(trend.mean()) for trend in trends),
        also_fitted=also,
        distribution=Distribution(
            tuple(found.free[k].name for k in of_rig),
            np.clip(values[of_rig], low, high),  # of the rounding of scaled values
            known.covariance[np.ix_(of_rig, of_rig)] * np.outer(scales, scales),
            low,
            high,
        ),
        modes=_modes(found, values, known.stds),
        quality=good,
        sensitivity=sensitivities(fitted, fixed, data, fitted.excess * good.repetition, known),
        suggested=() if good.fits else suggested,
        warnings=_warnings(estimates, dynamics),
    )


def _with_found_friction(fitted: Fit, known: Information) -> Fit:
    """Return the fit; the plectrum's friction is no longer hidden if it differs from the rig's."""
    dynamics = fitted.problem.dynamics
    free, rig_value = list(dynamics.free), value_of(dynamics.rig, FRICTION)
    for k, parameter in enumerate(free):
        if parameter.name == FRICTION and parameter.hidden and np.isfinite(known.stds[k]):
            std = known.stds[k] * fitted.problem.scales[k]
            # A hidden friction is reported from 3 standard uncertainties off the rig's value.
            if abs(fitted.values[k] - rig_value) >= 3.0 * std:
                free[k] = replace(parameter, hidden=False)
    problem = replace(fitted.problem, dynamics=dynamics.with_free(free))
    return replace(fitted, problem=problem)


def _modes(found: Problem, values: Floats, stds: Floats) -> tuple[FittedMode, ...]:
    """Return the elastic modes among the hidden parameters, ordered by frequency."""
    names = [p.name for p in found.free]
    modes = []
    for number in range(sum(name.endswith(".frequency") for name in names)):
        own = []
        for at in (names.index(name) for name in mode_names(number)[:2]):
            std = float(stds[at] * found.scales[at])
            own += [float(values[at]), std if np.isfinite(std) else None]
        modes.append(FittedMode(*own))
    return tuple(sorted(modes, key=lambda mode: mode.frequency))


def _estimates(
    fitted: Fit, which: Sequence[int], good: Quality, known: Information
) -> tuple[Estimate, ...]:
    """Return the results of some parameters, by their numbers."""
    problem, found = fitted.problem, []
    for k in which:
        p, scale, value = problem.free[k], float(problem.scales[k]), float(fitted.values[k])
        std, noise = float(known.stds[k]) * scale, float(known.noise_stds[k]) * scale
        determined, unaided = bool(np.isfinite(std)), known.std(k)
        low = high = None
        if determined and good.fits:
            low, high = value - NORMAL * std, value + NORMAL * std
        found.append(
            Estimate(
                name=p.name,
                unit=p.unit,
                value=value,
                rig_value=value_of(problem.dynamics.rig, p.name),
                std=std if determined else None,
                std_noise=noise if determined else None,
                std_inputs=float(np.sqrt(max(0.0, std**2 - noise**2))) if determined else None,
                low=low,
                high=high,
                at_bound=p.at_bound(value),
                identifiable=unaided < IDENTIFIABLE,
                needed=IDENTIFIABLE * scale,
                unaided=unaided * scale if np.isfinite(unaided) else None,
                measurements=() if unaided < IDENTIFIABLE else known.measurements(k, scale),
            )
        )
    return tuple(found)


def _warnings(estimates: Sequence[Estimate], dynamics: InverseDynamics) -> tuple[str, ...]:
    found = [f"not fitted: {reason}" for reason in dynamics.unusable]
    found += ignored(dynamics.rig, dynamics.level)
    bounds = {p.name: p for p in dynamics.free}
    for estimate in estimates:
        if estimate.at_bound:
            p = bounds[estimate.name]
            how = "widen the range by a prior, or look for other errors in the rig"
            if split_name(p.name)[1] == FRICTION and p.low == 0 and estimate.value < p.high / 2:
                how = "there is no lower one, so these presses show no friction"
            found.append(
                f"{p.name}: the fit reached a bound at"
                f" {f'{estimate.value:.4g} {p.unit}'.strip()}, of"
                f" {f'{p.low:.4g} to {p.high:.4g} {p.unit}'.strip()}; {how}"
            )
    if thrown := sum(press.thrown for press in dynamics.presses):
        found.append(
            f"in {thrown} of {len(dynamics.presses)} presses the finger struck the key and threw"
            " its jack; what precedes the landing is excluded: let the finger rest on the key"
            " before it presses"
        )
    if unknown := sum(press.unknown for press in dynamics.presses):
        found.append(
            f"not fitted: {unknown} pluck{'s' * (unknown > 1)} whose string is not known; see"
            " `sautereau phases`"
        )
    if not any(len(press.releases) for press in dynamics.presses):
        found.append("no press has a pluck: plectrum, string and clearance are not identifiable")
    return tuple(found)


CRITICAL = 3.841  # 95 % quantile of the chi-squared distribution with one degree of freedom
STEPS = 8  # Largest number of values on either side of the estimate


@dataclass(frozen=True)
class Profile:
    """Profile of one parameter; arrays of shape (n,), in ascending order of the value."""

    name: str
    values: Floats
    """SI."""
    rises: Floats
    """Twice the negative log-likelihood, minus its minimum."""
    low: float | None
    """Lower end of the 95 % interval, SI; None if the interval reaches the bound."""
    high: float | None
    """Upper end of the 95 % interval, SI; None if the interval reaches the bound."""


def profile(fitted: Fit, found: Identified, name: str) -> Profile:
    """Return the profile likelihood of one parameter around a fit.

    The parameter is fixed at a series of values, and all others are fitted again at each of them.
    The 95 % interval ends where twice the log-likelihood is 3.84 below its maximum (Wilks 1938).
    This is valid for non-linear problems as well, for parameters at a bound and for poorly
    identifiable ones.

    Raises:
        AnalysisError: The parameter was not fitted.
    """
    names = [p.name for p in fitted.problem.free]
    estimate = next((e for e in found.estimates if e.name == name), None)
    if estimate is None:
        results = ", ".join(e.name for e in found.estimates)
        raise AnalysisError(
            f"{name}: it was not fitted, so it has no profile; fitted parameters: {results}"
        )
    at = names.index(name)
    parameter = fitted.problem.free[at]
    residuals = fitted.problem.all(fitted.values / fitted.problem.scales)
    least, excess = float(residuals @ residuals), fitted.excess
    step = (parameter.high - parameter.low) / STEPS
    if estimate.std is not None:
        # The last of these values is 4 standard uncertainties from the estimate.
        step = min(step, estimate.std * 4.0 / STEPS)
    values, rises, ends = [estimate.value], [0.0], []
    for sign in (-1.0, 1.0):
        start, end = fitted.values, None
        last = (estimate.value, 0.0)
        for number in range(1, STEPS + 1):
            value = estimate.value + sign * number * step
            value = min(max(value, parameter.low), parameter.high)
            if value == last[0]:
                break
            start = start.copy()
            start[at] = value
            cost, start = minimise(fitted.problem, start, fixed=at)
            rise = max(0.0, (2 * cost - least) / excess)
            values.append(value)
            rises.append(rise)
            if rise >= CRITICAL:
                roots = np.sqrt([last[1], rise])
                end = float(np.interp(np.sqrt(CRITICAL), roots, [last[0], value]))
                break
            last = (value, rise)
        ends.append(end)
    order = np.argsort(values)
    return Profile(name, np.array(values)[order], np.array(rises)[order], ends[0], ends[1])

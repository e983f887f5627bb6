"""The result of segmenting a press: its phases, and its plucks with their forces."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from sautereau.analysis.phases.contact import Contact
from sautereau.analysis.phases.release import Release
from sautereau.analysis.phases.signals import Signals
from sautereau.trajectory.motion import Floats

GOOD, RIGID = 4.0, 10.0
"""Variance of the residuals over the noise below which the fit of a rigid key is good, or fair."""
FAIR = 15e-3  # N, rms of the residuals below which the fit of a compliant key is fair
FINGERTIP = 0.015
"""Relative standard uncertainty of a force drop by friction of the fingertip, which has a moment
about the pin."""
FREE, RELEASED = "free", "string released"
"""Phases in which no string is held: before a contact, and after the last release."""


@dataclass(frozen=True)
class Growth:
    """A stretch over which the load grows with the rise, and then collapses."""

    contact: float
    """s after the trigger."""
    release: float
    """s after the trigger."""
    force: float
    """N at the finger, by which the load collapses."""
    significance: float
    """(chi2 without it - chi2) / (n (1 + d^2)), with the variance n of the residuals around it, and
    its deviation d from the rig in instants and force, in standard deviations."""
    contact_std: float = 0.0
    """s, standard uncertainty; not evaluated for a further growth."""
    release_std: float = 0.0
    """s, the same."""
    force_std: float = 0.0
    """N, the same, of the force."""
    noise: float = 0.0
    """Variance of the residuals around it, of sums over a third of it, over the assumed one."""
    odds: float = math.inf
    """Logarithm of the likelihood of the load with a further growth over that without it."""


@dataclass(frozen=True)
class HeldString:
    """One pluck; times in s after the trigger."""

    contact: float
    release: float
    contact_std: float
    """s, standard uncertainty."""
    release_std: float
    """s, standard uncertainty."""
    contact_force: float
    """N, of the finger at contact."""
    release_force: float
    """N, of the finger just before release."""
    force_drop: float
    """N at the finger, fall of the load at release: of finger force less the key's inertia."""
    force_slope: float
    """N/m, finger force on key deflection at the laser while the string is held."""
    doubtful: bool = False
    """Whether a warning is about this pluck or the complete press."""
    string: int | None = None
    """Number of its string in the rig: 1 for the first, then those of `more_choirs` in their order;
    None where the data do not show it."""
    string_probability: float | None = None
    """Probability of this string, or of the likeliest one; None where it was not evaluated."""
    force_drop_std: float | None = None
    """N, standard uncertainty by noise and the fit, without that of the sensor's gain; None if the
    instants were set by hand."""
    force_rise: float = math.nan
    """N, rise of the finger force from contact to release, by `growth`."""
    force_slope_std: float = 0.0
    """N/m, standard uncertainty by what `growth` does not explain of the force."""
    saturated: bool = False
    """Whether the force is clipped or overloaded at the release, so that its forces say nothing."""

    @property
    def pluck_duration(self) -> float:
        """Time from contact to release [s]."""
        return self.release - self.contact


@dataclass(frozen=True)
class Fit:
    """How well the load was explained."""

    model: Literal["rigid", "compliant", "by hand"]
    """Of the key: rigid, or one that bends, heaves and rings; or the instants were set by hand."""
    noise: float
    """Dimensionless, largest variance of the residuals over that of the noise."""
    compliance: float = 0.0
    """s^2, k in the relation s = F + k F'' - m v' of load, force and velocity."""
    residual: float = 0.0
    """N, rms of the load that is not explained: of the smoothed load on a compliant key, of the
    load on a rigid key without a pluck, otherwise 0."""
    inertia: float | None = None
    """Inertia of key and jacks over that of the rig; None where it was not evaluated."""
    lag: float | None = None
    """s, by which the force is late, compared with the velocity; None likewise."""
    lag_std: float | None = None
    """s, its standard uncertainty."""
    negligible: bool = False
    """Whether the load that a rigid key does not explain shifts contacts by less than the least
    uncertainty of a contact on a compliant key."""

    @property
    def verdict(self) -> Literal["good", "fair", "poor", "by hand"]:
        """Whether instants and uncertainties can be relied on."""
        if self.model == "by hand":
            return "by hand"
        if self.model == "rigid":
            fair = self.negligible or self.noise < RIGID
            return "good" if self.noise < GOOD else "fair" if fair else "poor"
        return "fair" if self.residual < FAIR else "poor"


@dataclass(frozen=True, repr=False)
class Phases:
    """The phases of a press; times in s after the trigger."""

    start: float
    """s, at which a jack that always had its free speed would have left rest."""
    bottom: float
    """s, at which the jack has reached its full rise."""
    plucks: tuple[HeldString, ...]
    free_speed: float
    """m/s, mean of the jack before contact, after the run-up."""
    held_speed: float | None
    """m/s, mean of the jack while the first string is held; None without a pluck."""
    released_speed: float | None
    """m/s, mean of the jack after the first release, over as long a time as the string was held."""
    warnings: tuple[str, ...]
    """What may be wrong."""
    bottomed: float | None = None
    """s, at which the key meets its front felt; None where it does not."""
    returned: float | None = None
    """s, at which the key is back at rest; None where it does not return."""
    peak_force: float | None = None
    """N, of `sautereau.analysis.phases.find.peak_force`; None where it was not evaluated."""
    unseen_force: float | None = None
    """N, what the free key needs by the rig, less the measured force: the force at rest, which an
    AC-coupled sensor does not show; None of another sensor."""
    fit: Fit | None = None
    """How well the load was explained; None where it was not evaluated."""
    missed: tuple[tuple[float, float], ...] = ()
    """s, start and end of stretches in which the load climbs and collapses without a pluck."""
    remarks: tuple[str, ...] = ()
    """For information: they make no result doubtful."""
    unlike_rig: tuple[str, ...] = ()
    """Those of the warnings that say what is not as the rig states it: scales, delays, inertia."""

    def of_string(self, string: int) -> HeldString | None:
        """Return the pluck of a string by its number in the rig; None without one."""
        return next((held for held in self.plucks if held.string == string), None)

    def __repr__(self) -> str:
        plucks = (f"{p.contact * 1e3:.3f} to {p.release * 1e3:.3f} ms" for p in self.plucks)
        return f"<Phases: string held {', '.join(plucks) or 'never'} after the trigger>"


def pluck_names(plucks: Sequence[HeldString], strings: Sequence[str] = ()) -> list[str]:
    """Return what plucks are called: their string, or their number where it is unknown.

    Args:
        strings: Names of the rig's strings; empty for `string 1` and so on.
    """
    return [
        (strings[p.string - 1] if strings else f"string {p.string}")
        if p.string
        else f"pluck {number} (unknown string)"
        for number, p in enumerate(plucks, 1)
    ]


def stretches(
    held: Sequence[tuple[float, float]], start: float, stop: float
) -> list[tuple[float, float, str]]:
    """Return the phases of a press in words: start and stop of each, and how many strings are held.

    Args:
        held: Contact and release of each string; all times in any one unit.
        start: Start of the first phase.
        stop: End of the last phase.
    """
    inside = {t for ends in held for t in ends if start < t < stop}
    edges, last = [start, *sorted(inside), stop], max((end for _, end in held), default=stop)
    found = []
    for begin, end in pairwise(edges):
        count = sum(contact <= begin < release for contact, release in held)
        name = f"{count} strings held" if count > 1 else "string held"
        found.append((begin, end, name if count else FREE if begin < last else RELEASED))
    return found


def line_through(x: Floats, y: Floats) -> tuple[float, float]:
    """Return slope and value at 0 of the least-squares line; arrays of shape (n,)."""
    middle, level = float(x.mean()), float(y.mean())
    away = x - middle
    slope = float(away @ y / (away @ away))
    return slope, level - slope * middle


def growth(time: Floats, deflection: Floats, force: Floats) -> tuple[float, float, float]:
    """Return slope [N/m], its standard uncertainty, and rise [N] of the force over the deflection.

    They are those of a parabola from end to end, which is fitted together with one ringing of
    finger and key: that changes the force at an instant by a tenth of the rise, on a key that bends
    at 800 Hz. What it leaves, such as the strokes of a finger that bounces on the key, is in the
    uncertainty.

    Args:
        time: s, equidistant, shape (n,).
        deflection: m, of the key at the laser, increasing, shape (n,).
        force: N, shape (n,).
    """
    size = max(1, len(force) // 250)
    blocks = slice(len(force) // size * size)
    t, along, load = (x[blocks].reshape(-1, size).mean(axis=1) for x in (time, deflection, force))
    half = (along[-1] - along[0]) / 2 or 1.0
    columns = ((along - along[0]) / half - 1)[:, None] ** np.arange(3)
    frequencies = np.geomspace(100.0, 1500.0, 60)  # Hz, at which finger and key may ring
    turns = frequencies * (t[-1] - t[0])
    # At least three periods, and three blocks of each.
    rings = frequencies[(turns > 3) & (turns < len(t) / 3)]
    step = np.exp(2j * np.pi * rings * (t[-1] - t[0]) / max(1, len(t) - 1))
    waves = np.cumprod(np.tile(step, (len(t), 1)), axis=0)
    if waves.size:
        basis, _ = np.linalg.qr(columns)
        left = load - basis @ (basis.T @ load)
        # The reduction of the sum of squares by a cosine and a sine, which are nearly orthogonal.
        beside = len(t) - np.sum(np.abs(basis.T @ waves) ** 2, axis=0)
        reduction = np.abs(left @ waves) ** 2 / beside
        best = waves[:, np.argmax(reduction)]
        columns = np.column_stack([columns, np.real(best), np.imag(best)])
    # The slopes without one part of the rows each (jackknife; B. Efron, The Annals of Statistics 7
    # (1979) 1), which needs no model of how the strokes are correlated.
    # Each part is as long as the strokes of a bouncing finger.
    size = max(1, len(load) // 16)
    rows = len(load) // size * size
    parts = columns[:rows].reshape(-1, size, columns.shape[1])
    of_parts = load[:rows].reshape(-1, size, 1)
    normal = columns.T @ columns - parts.swapaxes(1, 2) @ parts
    right = (columns.T @ load)[:, None] - parts.swapaxes(1, 2) @ of_parts
    without = (np.linalg.pinv(normal, hermitian=True) @ right)[:, 1, 0] / half
    std = math.sqrt(len(parts) - 1) * float(without.std())
    slope = float(np.linalg.lstsq(columns, load, rcond=None)[0][1] / half)
    return slope, std, slope * float(deflection[-1] - deflection[0])


def measured(signals: Signals, contact: Contact, release: Release) -> HeldString:
    """Return a pluck with its finger forces.

    Args:
        release: Its end.
    """
    time, force, rate = signals.time, signals.force, signals.rate
    first, last = np.searchsorted(time, (contact.time, release.time)).tolist()
    m = max(4, min(int(1e-3 * rate), (last - first) // 3))
    # The line before is extrapolated to the release, which is spread over three samples.
    side = slice(max(0, last - 3 - m), last - 3)
    if len(time[side]) > 2:
        before = line_through(time[side] - release.time, force[side])[1]
    else:
        before = float(force[min(side.start, len(force) - 1)])
    held = slice(first, last)
    slope, slope_std, rise = growth(time[held], signals.deflection[held], force[held])
    friction = FINGERTIP * release.fall
    return HeldString(
        contact=contact.time,
        release=release.time,
        contact_std=contact.std,
        release_std=release.std,
        contact_force=float(force[max(0, first - m) : max(1, first)].mean()),
        release_force=before,
        force_drop=release.fall,
        force_slope=slope,
        force_slope_std=slope_std,
        force_drop_std=math.hypot(release.fall_std, friction) if release.fall_std else None,
        force_rise=rise,
        saturated=bool(signals.no_force[side].any()),
    )

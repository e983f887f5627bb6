"""The plucks of a press, on a rigid key if that explains the load, otherwise on a compliant key."""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import uniform_filter1d

from sautereau.analysis.phases.compliant import compliant_plucks, lag_of
from sautereau.analysis.phases.contact import Contact, KeyAndString, find_contact
from sautereau.analysis.phases.event import refine_event, resolved
from sautereau.analysis.phases.expected import Expected
from sautereau.analysis.phases.found import FAIR, GOOD, RIGID, Fit, Growth
from sautereau.analysis.phases.release import NO_RELEASE, Release, releases_in
from sautereau.analysis.phases.rows import NO_ROWS, Rows, rows_of
from sautereau.analysis.phases.search import SLIGHT, Searched
from sautereau.analysis.phases.settings import PhaseSettings
from sautereau.analysis.phases.signals import Signals

SETTLED = 3  # Rows from a release to the earliest contact with the next string
NEGLIGIBLE = 0.2e-3  # s, standard uncertainty of a contact that is no worse than elsewhere
RINGING = 8.0  # Variance of the residuals over the noise at a release above which modes are fitted
LAG_STD = 0.2e-3
"""s, standard uncertainty of the lag in a search: vibration of compliant keys makes it 0.6 ms or
more in 4 % of presses without one."""
BENT = 300.0
"""Variance of the residuals over the noise above which plucks of a rigid key are rejected."""


@dataclass(frozen=True)
class Found:
    """The plucks of a press, with the quality of the fit."""

    plucks: list[tuple[Contact, Release]]
    """In order of time."""
    fit: Fit
    further: tuple[Growth, ...] = ()
    """Where the load climbs and collapses without a pluck that was found."""


def find_plucks(strings: Expected, signals: Signals, begin: int, end: int) -> Found:
    """Return the plucks on the way down, in order of time.

    The load of a rigid key is tried first. Where the key bends or rings, its residuals exceed the
    noise, and the load of a compliant key is fitted; also where a rigid key shows fewer plucks than
    the rig has strings, of which a compliant key may show more, or where it does not explain every
    contact, as that of a string which is held together with the next one; and where there is no
    pluck.

    Args:
        begin: Sample at which the jack leaves rest.
        end: Sample at which it reaches its top.
    """
    rows = rows_of(signals, begin, end)
    if not len(rows.time):
        return Found([], Fit("rigid", 1.0))
    # The rest before the motion.
    still = np.flatnonzero(signals.rise[:begin] < 3e-4 * signals.rise.max())
    length, margin = (
        int(t * signals.rate) for t in (signals.settings.rest, signals.settings.rest_margin)
    )
    last = max(0, int(still[-1]) - margin) if len(still) else 0
    first = max(0, last - length)
    before = _place(signals, min(begin, last + margin))
    rest = _at_rest(signals, first, last)
    found = _rigid_plucks(strings, signals, rows, rest, begin, before)
    rigid = _explained(found, signals.settings, strings)
    # A key or a jack on cloth that deflects rings at a release: both instants are then late.
    clear = rigid is not None and all(
        (contact.noise < GOOD or contact.std < NEGLIGIBLE)
        and not (resolved(signals, release.time) and _rings(release, contact.noise, True))
        for contact, release in rigid.plucks
    )
    if rigid is not None and clear and len(found) >= len(strings.contacts):
        return _refined(rigid, signals, strings, begin, end)
    left, rms, missed = unexplained(strings, rest, rows, before)
    # A jack that climbed half as far as a pluck needs.
    reached = strings.contacts + strings.climbs / 2 < signals.rise[end]
    # Noise may explain the load because it hides the strings.
    hidden = reached.any() and math.sqrt(float(rows.variance.mean())) > strings.forces.min()
    if not found and not hidden and left < (GOOD if reached.all() else RIGID):
        return Found([], Fit("rigid", left))
    least = len(found) + clear if rigid is not None else 1 if reached.any() else math.inf
    compliant, searched = _compliant(strings, signals, (begin, end), least)
    if compliant is not None:
        return compliant
    if rigid is not None:
        return _refined(rigid, signals, strings, begin, end)
    if found and _noise(found) < BENT:
        return Found(
            [_with_residual(signals.settings, c, r) for c, r in found], Fit("rigid", _noise(found))
        )
    growths = searched.significant(signals.settings.significance)
    # More could hide a string.
    if 0.0 < searched.residual < min(FAIR, 0.1 * float(strings.forces.min())):
        noise = (searched.residual / signals.settings.noise) ** 2
        return Found([], Fit("compliant", noise, *_of_key(searched)), growths)
    return Found([], Fit("rigid", left, 0.0, rms), growths or (missed,))


def _at_rest(signals: Signals, first: int, last: int) -> Rows:
    """Return the load of the key at rest, until the finger takes up its weight and dry friction."""
    rest = rows_of(signals, first, last, size := max(1, (last - first) // 40))
    if not len(rest.time):
        return rest
    force = rest.load + rest.inertia
    hum = 3 * math.hypot(signals.settings.hum_std, signals.force_noise / math.sqrt(size))
    taken = np.flatnonzero(np.abs(force - np.median(force[: len(force) // 2])) > hum)
    return rows_of(signals, first, first + int(taken[0]) * size, size) if len(taken) else rest


def _compliant(
    strings: Expected, signals: Signals, way: tuple[int, int], least: float
) -> tuple[Found | None, Searched]:
    """Return the plucks of a compliant key, if there are as many as least; and the search."""
    plucks, searched = compliant_plucks(strings, signals, way)
    least_significance = signals.settings.significance
    growths = searched.significant(least_significance)
    certain = [g for g in searched.significant(2 * least_significance) if g in searched.growths]
    if not plucks or len(certain) < least:
        return None, searched
    noise = max(contact.noise for contact, _ in plucks)
    fit = Fit("compliant", noise, *_of_key(searched))
    lag, std = lag_of(strings, signals, way, plucks, searched.compliance)
    # The search knows all of the way, but not how certain its lag is.
    if abs(lag) / std > abs(searched.lag) / LAG_STD:
        fit = replace(fit, lag=lag, lag_std=std)
    # Less may be what the shape of a string leaves.
    least = SLIGHT * max(growth.force for growth in searched.growths)
    further = (g for g in growths if g not in searched.growths and g.force > least)
    return Found(plucks, fit, tuple(further)), searched


def _of_key(searched: Searched) -> tuple[float, float, float, float, float]:
    """Return what a fit states of a compliant key."""
    return searched.compliance, searched.residual, searched.inertia, searched.lag, LAG_STD


def _rigid_plucks(
    strings: Expected,
    signals: Signals,
    rows: Rows,
    rest: Rows,
    begin: int,
    before: tuple[float, float],
) -> list[tuple[Contact, Release]]:
    """Return the plucks in the load on a rigid key."""
    falls = releases_in(signals, rows)
    found = _contacts(strings, signals, rows.step, begin, falls, rest, before)
    largest = max((release.fall for _, release in found), default=0.0)
    large = [release for _, release in found if release.fall > 0.1 * largest]
    if len(large) < len(found):  # between two plucks the key is free
        found = _contacts(strings, signals, rows.step, begin, large, rest, before)
    return [(contact, _with_force(contact, release)) for contact, release in found]


def _with_force(contact: Contact, release: Release) -> Release:
    """Return a release whose fall is the force of the fit, as ringing makes the fall differ.

    Where nothing rings, a fall that differs from the force by more than its own uncertainty shows
    that the fit is wrong by as much.
    """
    apart = release.fall - contact.inertia * release.slowed - contact.at_release
    # 1.4 is three standard deviations above 1.
    wrong = max(0.0, apart**2 - release.fall_std**2) if release.noise < 1.4 else 0.0
    fall_std = math.sqrt(contact.force_std**2 + wrong)
    return replace(release, fall=contact.at_release, fall_std=fall_std)


def _explained(
    found: list[tuple[Contact, Release]], settings: PhaseSettings, strings: Expected
) -> Found | None:
    """Return the plucks of a rigid key if it explains the load, else None."""
    if not found:
        return None
    # A string held together with the next one spoils the fit of its contact on any key; but where
    # a release rings, or a contact is far from explained, what exceeds the number of strings may be
    # ringing.
    rings = any(r.noise > GOOD or c.noise > BENT for c, r in found)
    surplus = len(found) > len(strings.contacts) and rings
    typical = max if surplus else min
    # With hardly any noise, residuals that shift no contact by much exceed it as well.
    negligible = typical(c.noise for c, _ in found) >= GOOD
    exact = [
        _with_residual(settings, c, r) if negligible or c.noise > GOOD else (c, r) for c, r in found
    ]
    if negligible and not all(c.std < NEGLIGIBLE for c, _ in exact):
        return None
    return Found(exact, Fit("rigid", 1.0, negligible=negligible, inertia=1 + found[0][0].inertia))


def _refined(rigid: Found, signals: Signals, strings: Expected, begin: int, end: int) -> Found:
    """Return plucks of a rigid key, their releases fitted with modes where necessary."""
    ends = float(signals.time[begin]), float(signals.time[end])
    plucks = [(c, _with_modes(signals, r, c.noise, ends)) for c, r in rigid.plucks]
    lag, std = lag_of(strings, signals, (begin, end), plucks)
    fit = replace(rigid.fit, noise=_noise(plucks), lag=lag, lag_std=std)
    return Found(plucks, fit, rigid.further)


def _rings(release: Release, noise: float, resolved: bool) -> bool:
    """Return whether a release's residuals exceed those at its contact, where nothing rings."""
    # 1.8 is six standard deviations above 1, and 1.4 three.
    least = min(RINGING, max(1.8, 1.4 * noise)) if resolved else RINGING
    return release.noise >= least


def _with_modes(
    signals: Signals, release: Release, noise: float, ends: tuple[float, float]
) -> Release:
    """Return a release, fitted with the modes that it excites if a step does not explain it.

    This is so where it rings, and where a slow low-pass makes a curve of the step. A step that is
    hardly above the noise may hide modes, which would make it late by up to half a millisecond: the
    instant is then the mean over both fits, and their spread is part of its uncertainty.
    """
    small = resolved(signals, release.time)
    evident = _rings(release, noise, small) or any(signals.low_passes)
    # Steps above 400 were right to 0.04 ms on all keys.
    if not evident and (release.gain > 400 or not small):
        return release
    near = 0.7e-3 if evident else signals.settings.near
    found = refine_event(signals, release.time, near, release.fall, *ends)
    # The residuals of both signals, unlike those of the load, contain the inertia of a rigid key.
    lower = min(found.noise, release.noise)
    if evident:
        return replace(release, time=found.time, std=found.std, noise=lower)
    apart = found.time - release.time
    if abs(apart) > 3 * near:  # more than a mode delays it
        return release
    std = math.hypot(max(found.std, release.std), apart / 2)
    return replace(release, time=release.time + apart / 2, std=std)


def _noise(found: list[tuple[Contact, Release]]) -> float:
    """Return the largest variance of residuals over that of the noise."""
    return max(max(contact.noise, release.noise) for contact, release in found)


def _with_residual(
    settings: PhaseSettings, contact: Contact, release: Release
) -> tuple[Contact, Release]:
    """Return a pluck whose uncertainties include what a rigid key does not explain."""
    wrong = contact.residual / release.fall * (release.time - contact.time)
    wrong *= settings.unexplained
    return (
        replace(contact, std=math.hypot(contact.std, wrong)),
        replace(release, std=math.hypot(release.std, wrong / 2)),
    )


def _contacts(
    strings: Expected,
    signals: Signals,
    step: float,
    begin: int,
    falls: list[Release],
    rest: Rows,
    before: tuple[float, float],
) -> list[tuple[Contact, Release]]:
    """Return the falls that have a contact before them, with that contact.

    Args:
        step: s, uncertainty of a fall before its refinement.
        begin: Sample at which the jack leaves rest.
        falls: In order of time.
        rest: Of the key at rest before the press.
        before: Time [s] and rise [m] of the jack before which contact is impossible.
    """
    found: list[tuple[Contact, Release]] = []
    start, free = begin, NO_ROWS
    before_release = 6  # samples over which the correction of the delay spreads most of it
    for release in falls:
        until = signals.sample(release.time) - before_release
        held = rows_of(signals, start, until, most=200)
        given = strings, rest, free, held, release, signals.instant_std, before
        contact = find_contact(*given)
        if contact is not None and contact.noise > GOOD:
            # A plectrum that strikes its string makes a peak; elsewhere one would only add noise.
            peaked = find_contact(*given, struck=True)
            contact = peaked if peaked is not None and peaked.noise < GOOD else contact
        if (
            contact is None
            or contact.gain < 20  # reduction of chi2 by a string
            or release.time - contact.time < 8 * step
            or not 0.4 * release.fall < contact.at_release < 2 * release.fall
        ):
            continue
        if not found:
            touching = signals.sample(contact.time - 4 * contact.std)
            free = rows_of(signals, begin, touching, most=200)
        found.append((contact, release))
        before = _place(signals, signals.sample(contact.time))
        start = until + before_release + int(SETTLED * step * signals.rate)
    return found


def _place(signals: Signals, sample: int) -> tuple[float, float]:
    """Return time [s] and rise [m] of the jack at a sample."""
    return float(signals.time[sample]), float(signals.rise[sample])


def unexplained(
    strings: Expected, rest: Rows, down: Rows, before: tuple[float, float]
) -> tuple[float, float, Growth]:
    """Fit a rigid key without a string to the complete way down.

    Args:
        rest: Of the key at rest before the press; may be empty.
        before: Time [s] and rise [m] of the jack before it.

    Returns:
        Variance of the residuals over that of the noise, their rms [N], and where they climb and
        fall most.
    """
    noise, left = KeyAndString(strings, rest, NO_ROWS, down, NO_RELEASE, before).without_string()
    smooth = uniform_filter1d(left, max(1, len(left) // 100), mode="nearest")
    falls = np.maximum.accumulate(smooth) - smooth
    end = int(np.argmax(falls))
    peak = int(np.argmax(smooth[: end + 1]))
    start = int(np.argmin(smooth[: peak + 1]))
    growth = Growth(float(down.time[start]), float(down.time[end]), float(falls[end]), noise)
    return noise, float(np.sqrt(np.mean(left**2))), growth

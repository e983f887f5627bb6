"""Segmentation of a press: free, string held, string released, bottom and return."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import AnalysisError, MissingSignalError
from sautereau.analysis.loading.press import Press
from sautereau.analysis.model.key import finger_force
from sautereau.analysis.phases import checks
from sautereau.analysis.phases.by_hand import plucks_by_hand, read_by_hand
from sautereau.analysis.phases.expected import Expected, expected
from sautereau.analysis.phases.found import Fit, HeldString, Phases, line_through, measured
from sautereau.analysis.phases.identity import with_strings
from sautereau.analysis.phases.plucks import SETTLED, Found, find_plucks
from sautereau.analysis.phases.rows import rows_of
from sautereau.analysis.phases.settings import SETTINGS, PhaseSettings
from sautereau.analysis.phases.signals import SPIKE, Signals, signals_of, way_down
from sautereau.analysis.remark import Remark, divided
from sautereau.daq.signals.calibration import median, robust_std
from sautereau.rig.ranges import deviations
from sautereau.rig.schema import Rig
from sautereau.trajectory.key import key_motion
from sautereau.trajectory.motion import Floats, Motion

Finder = Callable[[Expected, Signals, int, int], Found]
"""Finds the plucks of a rig's strings between two samples, as `find_plucks` does."""


def find_phases(press: Press, settings: PhaseSettings = SETTINGS) -> Phases:
    """Find every contact and release in a press; a press without a pluck has none.

    Instants that were set by hand, in a file beside the recording, are taken as they are.

    Returns:
        The phases, with warnings; a key without string or a short recording is no error.

    Raises:
        MissingSignalError: It lacks the force or the velocity.
        AnalysisError: Samples of force or velocity are not numbers, or the file of instants set
            by hand cannot be read, or the fit has no solution.
    """
    if press.missing:
        raise MissingSignalError(
            f"press {press.path}: it has no {press.missing}, and these phases need force and"
            " velocity; use `find_partial_phases`"
        )
    return phases_in(press, signals_of(press, settings), find_plucks)


def phases_in(press: Press, signals: Signals, find: Finder) -> Phases:
    """Return the phases of a press by its signals, with a function that finds the plucks.

    Raises:
        AnalysisError: As `find_phases`.
    """
    down, force = way_down(signals), press.samples.get("force", signals.force)
    if down is None:
        most = max(0.0, signals.rise.max(initial=0.0)) * 1e3
        warning = (
            f"the key did not move down: the jack rose by {most:.2g} mm at most; free the jack if"
            " the key was down before, otherwise check the aim and the sign of the vibrometer"
        )
        peak = peak_force(force, signals, ())
        return Phases(0.0, 0.0, (), 0.0, None, None, (warning,), peak_force=peak)
    begin, end = down
    time, speed = signals.time, signals.speed
    settings = signals.settings
    # The spline that smooths it must fit into a way down.
    if end - begin < max(16, settings.width * press.rate):
        warning = (
            f"the key moved for only {(end - begin) / press.rate * 1e3:.2g} ms of the recording,"
            " too short for finding phases; record for longer"
        )
        mean, peak = float(speed[begin : end + 1].mean()), peak_force(force, signals, ())
        return Phases(
            float(time[begin]), float(time[end]), (), mean, None, None, (warning,), peak_force=peak
        )
    by_hand, strings = read_by_hand(press.path), expected(press.rig, settings)
    if by_hand is None:
        try:
            found = find(strings, signals, begin, end)
        except np.linalg.LinAlgError as error:
            raise AnalysisError(
                f"recording {press.path}: the fit of its phases has no solution ({error}): samples"
                " or values of the rig are far from those of a press; check the calibrations, or"
                " set contact and release by hand with `sautereau phases FILE --at`"
            ) from error
    else:
        found = Found(
            plucks_by_hand(signals, by_hand, float(time[end]), press.path), Fit("by hand", 1.0)
        )
    # Of one signal alone, the force or the place of a pluck is assumed.
    known = by_hand is not None or signals.missing
    stops = [] if known else [r.time for _, r in found.plucks if _stopped(signals, r.time)]
    pairs = [(contact, release) for contact, release in found.plucks if release.time not in stops]
    known_plucks = with_strings(pairs, signals, strings)
    plucks = [
        replace(measured(signals, contact, release), string=string, string_probability=probability)
        for contact, release, string, probability in known_plucks
    ]
    contact = min((held.contact for held in plucks), default=float(time[end]))
    contact = max(contact, float(time[begin + 8]))
    settled = _at_full_speed(time, speed, time[begin], contact)
    slope, offset = line_through(time[settled], signals.rise[settled])
    held_speed = released_speed = None
    if plucks:
        held_speed = _mean(speed, time, plucks[0].contact, plucks[0].release)
        after = min(plucks[0].release + plucks[0].pluck_duration, time[end])
        released_speed = _mean(speed, time, plucks[0].release, after)
    steady = float(time[begin + np.argmax(speed[begin:] >= 0.95 * speed[settled].mean())])
    start, bottom = float(-offset / slope), float(time[end])
    contacts = [contact for contact, *_ in known_plucks]
    highest = peak_force(force, signals, plucks)
    unseen, of_level = _level_of_force(press, signals, settled, highest, bool(plucks))
    # Slower than this quantile is a jack that starts or stops, faster one that was released.
    cruise, top = float(np.quantile(speed[begin:end], 0.65)), float(signals.rise.max())
    unlike = [] if known else checks.about_rig(press, signals, cruise, found.fit, plucks, strings)
    held = [] if known else checks.held_at_top(signals, begin, plucks, strings)
    inverted = [] if signals.missing else checks.about_sign(signals, begin, end, highest)
    said = inverted or [
        *unlike,
        *checks.about_end(signals, begin, held, strings),
        *of_level,
        *checks.about_stops(signals, stops),
        *checks.about_instants(plucks, contacts, steady, signals.missing, settings),
        *checks.about_flags(signals, press.quality_flags, plucks, (start, bottom)),
        *checks.about_exchange(contacts, plucks, settings),
        *checks.about_strings(plucks, strings),
        *checks.about_fit(signals, found.fit, found.further, plucks, strings, len(held)),
        *([] if known else checks.about_likeness(signals, plucks, strings)),
    ]
    # At the height at which the jack left rest.
    back = np.flatnonzero(signals.rise[end:] < settings.left * top)
    doubts = [remark.plucks or range(len(plucks)) for remark in said if remark.doubt]
    warnings, remarks = divided(said)
    return Phases(
        start=start,
        bottom=bottom,
        plucks=tuple(
            replace(p, doubtful=any(i in d for d in doubts)) for i, p in enumerate(plucks)
        ),
        free_speed=float(speed[settled].mean()),
        held_speed=held_speed,
        released_speed=released_speed,
        warnings=warnings,
        bottomed=None if held else _bottomed(signals, begin, plucks),
        returned=float(time[end + back[0]]) if len(back) else None,
        peak_force=highest,
        unseen_force=unseen,
        fit=found.fit,
        missed=tuple((growth.contact, growth.release) for growth in found.further if not inverted),
        remarks=remarks,
        unlike_rig=divided(unlike)[0],
    )


def _level_of_force(
    press: Press, signals: Signals, free: NDArray[np.intp], peak: float, plucked: bool
) -> tuple[float | None, list[Remark]]:
    """Compare the force of the free key, at samples, with the one that it needs by the rig.

    AC coupling hides the force at rest, such as that of a finger that rests on the key. Without it
    the zero of the sensor is wrong where the ranges of the rig do not explain the difference.

    Returns:
        `Phases.unseen_force`, and what is said about the difference.
    """
    channel = press.rig.daq.channel("force")
    if channel is None or signals.missing or len(free) < 2:
        return None, []
    time, speed = signals.time[free], signals.speed[free]
    motion = Motion(signals.rise[free], speed, np.full(len(free), line_through(time, speed)[0]))

    def needed(rig: Rig) -> float:
        angle = key_motion(rig.key, motion)
        return float(finger_force(rig, angle, np.zeros(len(free))).mean())

    required, measured = needed(press.rig), float(signals.force[free].mean())
    if channel.high_pass:
        return required - measured, checks.about_rest(required - measured, channel, peak)
    # A key that accelerates bends and bounces.
    inertia = signals.inertial * line_through(time, signals.velocity[free])[0]
    # The level of a force may differ from that of the rig by a tenth of the peak: numbers without a
    # range are not exact either.
    limit = 0.1 * peak + abs(inertia)
    # Without a pluck, a string may be held at these samples.
    if abs(required - measured) <= limit or not plucked:
        return None, []
    names = (n for n in press.rig.assumed if n.startswith(("key.", "jack.", "more_choirs.")))
    ranges = [
        sorted(needed(error.applied(press.rig, end)) - required for end in (error.low, error.high))
        for error in deviations(press.rig, names)
    ]
    lowest, highest = (
        required + sum(sign * max(0.0, *(sign * end for end in ends)) for ends in ranges)
        for sign in (-1, 1)
    )
    return None, checks.about_level(measured, (lowest, highest), limit)


def _bottomed(signals: Signals, begin: int, plucks: list[HeldString]) -> float | None:
    """Return the time [s] from which on the load stays increased by the front felt."""
    rows = rows_of(signals, begin, int(np.argmax(signals.rise)) + 1)
    first = int(np.searchsorted(rows.time, plucks[-1].release)) + SETTLED if plucks else 0
    load = rows.load[first:]
    if len(load) < 4 * SETTLED:
        return None
    felt = median(load) + max(0.1, 6 * robust_std(load))  # N
    below = np.flatnonzero(load < felt)
    risen = int(below[-1]) + 1 if len(below) else 0
    return float(rows.time[first + risen]) if len(load) - risen >= SETTLED else None


def _stopped(signals: Signals, release: float) -> bool:
    """Return whether an obstacle stops the key at a time [s], at which the load collapses.

    After a release the key continues.
    """
    # Times before and after a release [s], and fractions of the jack's rise before it, which the
    # rise after it does not reach at an obstacle. A key that swings may be at rest for 3 ms, one
    # that meets a rail soon after is at rest after 8 ms; only obstacles do both.
    for side, share in (3e-3, 0.45), (8e-3, 0.23):
        after = min(side, float(signals.time[-1]) - release)
        times = release + np.array([-side, 0.0, after])
        before, at, last = np.interp(times, signals.time, signals.rise)
        if (last - at) * side >= share * (at - before) * after:
            return False
    return True


def _at_full_speed(time: Floats, speed: Floats, start: float, end: float) -> NDArray[np.intp]:
    """Return the samples at full speed in the second half between two instants [s]."""
    first, middle, last = np.searchsorted(time, (start, (start + end) / 2, end)).tolist()
    first = middle if last - middle >= 8 else first
    inside = speed[first:last]
    full = first + np.flatnonzero(inside >= 0.95 * np.median(inside))
    return full if len(full) >= 8 else np.arange(first, last)


def _mean(signal: Floats, time: Floats, start: float, end: float) -> float | None:
    """Return the mean from one instant to before another [s]; None without a sample."""
    inside = signal[slice(*np.searchsorted(time, (start, end)))]
    return float(inside.mean()) if len(inside) else None


def peak_force(force: Floats, signals: Signals, plucks: Sequence[HeldString]) -> float:
    """Return the largest finger force of a complete press [N], those of its releases included.

    Beside a release, the samples show what the correction of the sensor's delay makes of the fall:
    it exceeds the force by up to 13 % of the fall. There, the force is that of `HeldString`.

    Args:
        force: N, as recorded, shape (n,).
        plucks: All plucks of the press.
    """
    counted, spread = force > _spikes(force, signals), signals.settings.spread
    for held in plucks:
        at = signals.sample(held.release)
        counted[max(0, at - spread) : max(0, at + spread)] = False
    releases = [held.release_force for held in plucks]
    return max(0.0, *releases, float(force[counted].max(initial=0.0)))


def _spikes(force: Floats, signals: Signals) -> Floats:
    """Return the height [N] of the highest spike close to each sample (`PhaseSettings.spread`).

    It is -inf where there is none.
    """
    if not len(force):
        return force
    # What is narrower than three samples at half its force is a spike.
    wide = np.pad(force, 2, mode="edge")
    least = np.minimum(np.minimum(wide[:-2], wide[1:-1]), wide[2:])
    lasting = np.maximum(np.maximum(least[:-2], least[1:-1]), least[2:])
    high = force - lasting > np.maximum(SPIKE * signals.force_noise, force / 2)
    found, spread = np.full(len(force), -np.inf), signals.settings.spread
    for at in np.flatnonzero(high):
        beside = found[max(0, at - spread) : at + spread + 1]
        np.maximum(beside, force[at], out=beside)
    return found

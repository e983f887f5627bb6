"""Contact and release in the force alone, or in the velocity alone.

*Force alone.* The jack is assumed to move as planned, and what that shifts is added to the
uncertainties. *Velocity alone.* A release is a sudden acceleration of the key, near where the rig
expects it; the contact hardly changes the velocity, so it is that of the rig, with the release.
"""

import math
from dataclasses import replace

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases.contact import Contact
from sautereau.analysis.phases.expected import Expected
from sautereau.analysis.phases.find import phases_in
from sautereau.analysis.phases.found import Fit, Growth, Phases
from sautereau.analysis.phases.plucks import Found, find_plucks
from sautereau.analysis.phases.release import Release, releases_in
from sautereau.analysis.phases.rows import rows_of
from sautereau.analysis.phases.signals import Signals, signals_of

WITHOUT = {
    "velocity": "no velocity was recorded: speeds, rises, deflections, work, the slope of the force"
    " and its drop are unknown",
    "force": "no force was recorded: forces and work are unknown",
}
"""What is unknown without a signal, by the name of the missing signal."""
BY_WHAT = {
    "velocity": "; contact and release are those of the force alone, for a jack that moves as the"
    " rig's [press] says",
    "force": "; a release is a sudden acceleration of the key near where the rig expects it, and"
    " the contact is that of the rig",
}
"""Basis of the instants that were found, by the name of the missing signal."""
NOT_FOUND = {
    "velocity": "; a pluck may not be found if the finger presses with constant force, or the jack"
    " moves otherwise",
    "force": "; a string that does not change the key's speed is not seen, so there may have been a"
    " pluck",
}
"""Why a pluck may not have been found, by the name of the missing signal."""


def find_partial_phases(press: Press) -> Phases:
    """Return the phases of a press that lacks the force or the velocity.

    What depends on the missing signal rests on assumptions, and must not be shown: `features` and
    `press_summary` omit it.

    Raises:
        AnalysisError: Both signals were recorded; else as `find_phases`.
    """
    if press.missing is None:
        raise AnalysisError(f"press {press.path}: it has both signals; use find_phases")
    find = _in_force if press.missing == "velocity" else _in_velocity
    found = phases_in(press, signals_of(press), find)
    by_hand = found.fit is not None and found.fit.model == "by hand"
    why = "" if by_hand else BY_WHAT[press.missing]
    if not (found.plucks or by_hand):
        why += NOT_FOUND[press.missing]
    stds = [
        f"{name} {getattr(held, f'{name}_std') * 1e3:.2g} ms"
        for held in found.plucks
        for name in ("contact", "release")
    ]
    uncertain = f"; standard uncertainties: {', '.join(stds)}" if stds else ""
    said = f"{WITHOUT[press.missing]}{why}{uncertain}; record the {press.missing} as well"
    explained = found.plucks or by_hand or press.missing == "velocity"
    fit = found.fit if explained else None
    return replace(found, warnings=(said, *found.warnings), fit=fit)


def _in_force(strings: Expected, signals: Signals, begin: int, end: int) -> Found:
    """Return the plucks in the force alone; arguments as of `find_plucks`."""
    found = find_plucks(strings, signals, begin, end)
    # Motion that is not as planned causes smaller falls.
    least = 0.05 * float(np.ptp(signals.force[begin:end]))
    slight = [Growth(c.time, r.time, r.fall, c.gain) for c, r in found.plucks if not r.fall > least]
    # The speed of the jack is not exactly as planned: of a contact by 2 % of the pluck.
    wider = [
        (
            replace(c, std=math.hypot(c.std, 0.15e-3, 0.02 * (r.time - c.time))),
            replace(r, std=math.hypot(r.std, 0.02e-3)),
        )
        for c, r in found.plucks
        if r.fall > least
    ]
    return replace(found, plucks=wider, further=(*found.further, *slight))


def _in_velocity(strings: Expected, signals: Signals, begin: int, end: int) -> Found:
    """Return the plucks in the velocity alone; arguments as of `find_plucks`."""
    falls = releases_in(signals, rows_of(signals, begin, end))
    rise = np.maximum.accumulate(signals.rise[begin : end + 1])
    time, speed = signals.time[begin : end + 1], signals.speed[begin : end + 1]
    found: list[tuple[Contact, Release]] = []
    settings = signals.settings
    for at, climb in zip(strings.contacts.tolist(), strings.climbs.tolist(), strict=True):
        stds = np.array([settings.contact_std, settings.climb_std * climb])
        far = settings.deviations * float(np.hypot(*stds))
        earliest = found[-1][1].time if found else -math.inf
        near = [
            fall
            for fall in falls
            if fall.time > earliest and abs(np.interp(fall.time, time, rise) - at - climb) < far
        ]
        if not near:
            continue
        release = max(near, key=lambda fall: fall.fall)
        around = slice(*(signals.sample(release.time + side) for side in (-1e-3, 1e-3)))
        hidden = 1e-3 * bool(signals.no_velocity[around].any())  # a drop-out may hide it
        release = replace(release, std=math.hypot(1.5 * release.std, 0.02e-3, hidden))
        # The rig's contact, and the release less the rig's climb: weighted by their variances.
        places = np.array([at, float(np.interp(release.time, time, rise)) - climb])
        place = float(places @ stds**-2.0 / (stds**-2.0).sum())
        contact = float(np.interp(place, rise, time))
        std = float((stds**-2.0).sum()) ** -0.5 / max(float(np.interp(contact, time, speed)), 1e-3)
        if contact < release.time:
            found.append((Contact(contact, std, release.gain, release.fall, 1.0), release))
    return Found(found, Fit("rigid", max((r.noise for _, r in found), default=1.0)))

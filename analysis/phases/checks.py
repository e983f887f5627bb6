"""Warnings and remarks about the phases of a press."""

import math
from collections.abc import Sequence

import numpy as np

from sautereau.analysis.loading.press import Press
from sautereau.analysis.phases.contact import Contact
from sautereau.analysis.phases.expected import LEAST_CLIMB, LEAST_FORCE, Expected
from sautereau.analysis.phases.found import FAIR, RIGID, Fit, Growth, HeldString, pluck_names
from sautereau.analysis.phases.identity import SHARED
from sautereau.analysis.phases.rows import rows_of
from sautereau.analysis.phases.settings import SETTINGS, PhaseSettings
from sautereau.analysis.phases.signals import Signals
from sautereau.analysis.remark import Remark
from sautereau.daq.signals.quality_flags import HOW_TO_FIX, QualityFlag, quality_warnings
from sautereau.rig.acquisition import Channel

TWICE = 0.5
"""Logarithm of the force per rise of two strings held at once over that of one: together they are
held for longer than one. Two are likelier from half of it on."""
LIKELY = math.log(0.95 / 0.05)  # Logarithm of the odds above which another string is a warning


def about_fit(
    signals: Signals,
    fit: Fit,
    further: Sequence[Growth],
    plucks: Sequence[HeldString],
    strings: Expected,
    held: int,
) -> list[Remark]:
    """Return what is said about a poor fit, growths without a pluck, and the number of plucks.

    Args:
        fit: How well the load was explained.
        further: Growths without a pluck.
        held: Number of strings that are still held where the jack is highest.
    """
    count, found = len(strings.contacts) - held, []
    climbs = [
        f"from {growth.contact * 1e3:.5g} to {growth.release * 1e3:.5g} ms the load climbs by"
        f" {growth.force:.3g} N and collapses"
        for growth in further
    ]
    if held and not plucks:
        return []
    if fit.verdict == "poor" and not plucks:
        where = ": " + ", and ".join(climbs) if climbs else ""
        text = (
            f"no pluck was found, but {_unexplained(fit)}{where}; plot the phases, and check the"
            " strings and the clearance in the rig"
        )
        return [Remark(text)]
    for growth, climb in zip(further, climbs, strict=True):
        expects = unlike_the_rig(signals, growth.contact, growth.release, growth.force, strings)
        text = f"{climb}, unlike {expects}: no pluck"
        meanwhile = {
            name: _per_rise(signals, pluck, strings)[-1]
            for name, pluck in zip(pluck_names(plucks), plucks, strict=True)
            if _at_once(pluck, growth)
        }
        if not expects:
            who = " and ".join(meanwhile)
            held_there = f"while {who} is held: another string may be held at the same time"
            text = (
                f"{climb}, {held_there if meanwhile else 'and no pluck was found there'}; plot the"
                " phases, and check the number of strings in the rig"
            )
        # A force that one string explains makes another one unlikely.
        likely = growth.odds + max(meanwhile.values(), default=0.0) > LIKELY
        found.append(Remark(text, doubt=not expects and likely))
    if fit.verdict == "poor":
        coarse = signals.rate * signals.settings.row < 1  # the rows are single samples
        text = (
            f"{f'{signals.rate / 1e3:.3g} kHz is a low sampling rate, ' * coarse}the key rings and"
            f" bends, or the rig is of another instrument: {_unexplained(fit)}, so contact and"
            f" release may be wrong by more than their uncertainties;{' sample faster,' * coarse}"
            " press more slowly, or check them in a plot"
        )
        found.append(Remark(text))
    if 0 < len(plucks) < count:
        text = (
            f"plucks of {len(plucks)} of the rig's {count} strings were found: two may be"
            " released together, or the press is too short; check the rise of the jack"
        )
        found.append(Remark(text))
    elif len(plucks) > count and fit.model != "by hand":
        text = (
            f"{len(plucks)} plucks were found, but the rig has {count}"
            f" string{'s' * (count > 1)}: a jump of the jack's speed may look like a pluck; plot"
            " the phases, and check the strings and the key's inertia in the rig"
        )
        found.append(Remark(text))
    return found


def pulls(work: float, peak: float, rise: float) -> bool:
    """Return whether the finger seems to pull the key down, by its work over a rise.

    Its mean force is then more negative than any positive force (`peak`) is large.
    """
    return work < -peak * rise


def about_sign(signals: Signals, begin: int, end: int, peak: float) -> list[Remark]:
    """Return a warning if the finger seems to pull the key on the way from `begin` to `end`."""
    way = slice(begin, end + 1)
    work = float(np.trapezoid(signals.force[way], signals.rise[way]))
    if not pulls(work, peak, float(np.ptp(signals.rise[way]))):
        return []
    text = (
        f"the force on the way down is negative, {signals.force[way].min():.3g} N at most, and a"
        " finger cannot pull: the force transducer has the wrong sign; invert it at its amplifier,"
        " or import with `--invert force`"
    )
    return [Remark(text)]


def _at_once(one: HeldString | Growth, other: HeldString | Growth) -> bool:
    """Return whether two strings are held at once."""
    return one.contact < other.release and other.contact < one.release


def _unexplained(fit: Fit) -> str:
    """Return how much of the load a poor fit leaves, with the limit."""
    if fit.model == "compliant":
        rms, limit = fit.residual * 1e3, FAIR * 1e3
        return f"{rms:.2g} mN rms of the load are not explained (limit {limit:.2g} mN)"
    left, limit = math.sqrt(fit.noise), math.sqrt(RIGID)
    return f"the load that is not explained is {left:.2g} times its noise (limit {limit:.2g})"


def about_exchange(
    contacts: Sequence[Contact],
    plucks: Sequence[HeldString],
    settings: PhaseSettings = SETTINGS,
) -> list[Remark]:
    """Return a warning if contacts of strings held at once may belong to each other's release."""
    which = [i for i, c in enumerate(contacts) if c.exchange_std > settings.doubtful]
    if not which:
        return []
    most = max(contacts[i].exchange_std for i in which)
    names = " and of ".join(pluck_names(plucks)[i] for i in which)
    text = (
        f"contacts of {names}: the strings are held at"
        " once, and their contacts explain the load as well if they are exchanged, so half their"
        f" distance, {most * 1e3:.2g} ms, is in their uncertainties; press each string alone"
    )
    return [Remark(text, tuple(which))]


def unlike_the_rig(
    signals: Signals, contact: float, release: float, force: float, strings: Expected
) -> str:
    """Return the string of the rig that is nearest to a pluck, as text; empty if it is alike.

    Args:
        contact: s after the trigger.
        release: s after the trigger.
        force: N at the finger, by which the load falls.
    """
    ends = np.interp([contact, release], signals.time, signals.rise)
    place = strings.place_deviations(ends[0], ends[1] - ends[0])
    off = np.hypot(np.hypot(*place.T), strings.force_deviations(force))
    nearest = int(np.argmin(off))
    if not off[nearest] > strings.settings.deviations:
        return ""
    at, top = strings.contacts[nearest], (strings.contacts + strings.climbs)[nearest]
    expected = f"{strings.forces[nearest]:.2g} N from {at * 1e3:.2f} to {top * 1e3:.2f} mm"
    return f"the rig's string, {expected} of rise"


def about_likeness(
    signals: Signals, plucks: Sequence[HeldString], strings: Expected
) -> list[Remark]:
    """Return warnings about plucks whose place and force are far from every string of the rig."""
    found = []
    for i, held in enumerate(plucks):
        expects = unlike_the_rig(signals, held.contact, held.release, held.force_drop, strings)
        if expects:
            ends = np.interp([held.contact, held.release], signals.time, signals.rise) * 1e3
            text = (
                f"{_who(i, plucks)}its {held.force_drop:.2g} N from {ends[0]:.2f} to {ends[1]:.2f}"
                f" mm of rise are not like {expects}, so it may be no pluck; plot the phases, and"
                " check the clearance and the plectrum in the rig"
            )
            found.append(Remark(text, (i,)))
    return found


def about_stops(signals: Signals, stops: Sequence[float]) -> list[Remark]:
    """Return warnings about obstacles that stop the key at times [s]."""
    return [
        Remark(
            f"at {time * 1e3:.5g} ms, {np.interp(time, signals.time, signals.rise) * 1e3:.2f} mm of"
            " rise, an obstacle stops the key, and no string is released; check where the key"
            " meets its front rail (`key.dip`)"
        )
        for time in stops
    ]


def about_strings(plucks: Sequence[HeldString], strings: Expected) -> list[Remark]:
    """Return remarks on plucks whose string is not known, and on strings held at once."""
    names = pluck_names(plucks)
    meanwhile = [
        [
            f"{name} is {what}"
            for name, other in zip(names, plucks, strict=True)
            for what, instant in (("touched", other.contact), ("released", other.release))
            if held.contact < instant < held.release
        ]
        for held in plucks
    ]
    return [
        Remark(
            f"{names[i]}: its force slope and rise are those of the finger, and meanwhile"
            f" {' and '.join(others)}",
            (i,),
            doubt=False,
        )
        for i, others in enumerate(meanwhile)
        if others
    ] + [
        Remark(
            f"pluck {i + 1}, released at {held.release * 1e3:.5g} ms: its string is not known; the"
            f" likeliest one has a probability of {held.string_probability:.2g}: check clearance,"
            " overlap and modulus of the strings in the rig, or press each string alone",
            (i,),
            doubt=False,
        )
        for i, held in enumerate(plucks)
        if held.string is None and len(strings.contacts) > 1
    ]


def about_rig(
    press: Press,
    signals: Signals,
    cruise: float,
    fit: Fit,
    plucks: Sequence[HeldString],
    strings: Expected,
) -> list[Remark]:
    """Return what differs from the rig: scales, delays, arms, plectra, and where the key stops.

    Speed and rise make results doubtful if an arm was to follow the rig's `[press]`.

    Args:
        cruise: m/s, speed of the jack in the middle of the way down.
    """
    planned, driven, settings = press.rig.press, press.motion is not None, strings.settings
    rise = float(signals.rise.max())
    scale = "the scale of the velocity, `key.laser_arm` and `[press]`"
    rail = "where the finger meets the key and the key its front rail (`key.dip`), "
    of_rise = rise / planned.jack_rise
    wrong = not 0.5 < of_rise < 2  # a finger of any speed goes about as far: a wrong scale or unit
    said = [
        _differs(
            (1 / settings.motion, settings.motion), f"the jack's {what}", ratio, fix, doubt=is_so
        )
        for what, ratio, fix, is_so in (
            (f"rise, {rise * 1e3:.2g} mm,", of_rise, rail + scale, driven or wrong),
            (f"speed, {cruise:.2g} m/s,", cruise / planned.jack_speed, scale, driven),
        )
    ]
    if plucks and fit.inertia is not None:
        fix = (
            "the scales and the `delay` of force and velocity, `key.press_arm`, `key.laser_arm`,"
            " `key.inertia`, and whether the key bends"
        )
        # The finger adds its own inertia.
        limits = 1 / 1.5, settings.force
        said.append(_differs(limits, "the inertia of key and jacks", fit.inertia, fix))
    fix = "the scale of the force, the plectrum, and whether several strings are released at once"
    limits = 1 / settings.force, settings.force
    for i, held in enumerate(plucks):
        row, per_rise, times, _ = _per_rise(signals, held, strings)
        who, drop = f"{_who(i, plucks)}the force drop", held.force_drop
        of_drop = f"{who} per rise of the jack, {per_rise * 1e-3:.2g} N/mm,"
        shared = SHARED * any(_at_once(held, p) for p in plucks if p is not held)
        most = math.exp(TWICE / 2 + shared**2 * LIKELY / TWICE)
        said.append(
            _differs((0.0, most), of_drop, times, fix, (i,))
            or _differs(limits, f"{who}, {drop:.2g} N,", drop / strings.forces[row], fix, (i,))
        )
    certain = max(settings.late, settings.deviations * (fit.lag_std or 0.0))
    if plucks and fit.lag is not None and abs(fit.lag) > certain:
        late, early = ("force", "velocity") if fit.lag > 0 else ("velocity", "force")
        text = (
            f"the {late} is {abs(fit.lag) * 1e3:.2g} ms late, compared with the {early}, so contact"
            " and release may be wrong by as much; check `delay` and `low_pass` of both channels"
        )
        said.append(Remark(text))
    return [remark for remark in said if remark]


def _per_rise(
    signals: Signals, held: HeldString, strings: Expected
) -> tuple[int, float, float, float]:
    """Compare the force per rise of a pluck with that of its string, or of the nearest one.

    Overlap and friction change both alike; another string increases the force alone.

    Returns:
        Row of the string; force drop per rise [N/m], and its ratio to that of the rig; the
        logarithm of the odds of two strings held at once, if one is as likely.
    """
    drop = max(held.force_drop, LEAST_FORCE)
    nearest = int(np.argmin(np.abs(strings.force_deviations(drop))))
    row = strings.numbers.index(held.string) if held.string else nearest
    ends = np.interp([held.contact, held.release], signals.time, signals.rise)
    per_rise = drop / max(float(ends[1] - ends[0]), LEAST_CLIMB)
    ratio = per_rise * float(strings.climbs[row] / strings.forces[row])
    times = math.hypot(held.contact_std, held.release_std) / held.pluck_duration
    measured = min(1.0, math.hypot((held.force_drop_std or 0.0) / drop, times))
    own = strings.variations[row, 1:, 1:] * [[1, -1], [-1, 1]]
    odds = TWICE * (math.log(ratio) - TWICE / 2) / (float(own.sum()) + measured**2)
    return row, per_rise, ratio, odds


def _differs(
    limits: tuple[float, float],
    what: str,
    ratio: float,
    fix: str,
    plucks: tuple[int, ...] = (),
    *,
    doubt: bool = True,
) -> Remark | None:
    """Return a remark about a ratio of something measured to that of the rig, beyond its limits."""
    if limits[0] < ratio < limits[1]:
        return None
    return Remark(f"{what} is {ratio:.2g} times that of the rig; check {fix}", plucks, doubt)


def about_rest(unseen: float, channel: Channel, peak: float) -> list[Remark]:
    """Return a remark if AC coupling hides more of the force than the gain's uncertainty.

    Args:
        unseen: N, `Phases.unseen_force`.
        peak: N, largest force of the press.
    """
    if abs(unseen) <= channel.gain_std * peak:
        return []
    needs = f"{abs(unseen):.2g} N {'more' if unseen > 0 else 'less'}"
    text = (
        f"force: by the rig the free key needs {needs} than was measured, so that contact, release"
        " and peak force and work are uncertain by as much, force drop and slope are not: AC"
        " coupling hides the force of a finger that rests on the key; use a sensor without it, or"
        " check `key.gravity_moment` and the `high_pass` of the force"
    )
    return [Remark(text, doubt=False)]


def about_level(measured: float, needed: tuple[float, float], limit: float) -> list[Remark]:
    """Return a warning if the force of the free key is none that the rig's ranges allow.

    Args:
        measured: N.
        needed: N, least and largest by the rig and its ranges.
        limit: N, by which it may be beyond them.
    """
    low, high = needed
    if low - limit <= measured <= high + limit:
        return []
    by_rig = f"{low:.2g} N" if low == high else f"{low:.2g} to {high:.2g} N"
    text = (
        f"force: the free key needs {by_rig} by the rig and its ranges, and {measured:.2g} N were"
        " measured: the zero of the sensor is wrong, and with it contact, release and peak force"
        " and work, or else `key.gravity_moment` and `jack.mass`; record the force without the"
        " finger on the key"
    )
    return [Remark(text)]


def held_at_top(
    signals: Signals, begin: int, plucks: Sequence[HeldString], strings: Expected
) -> list[tuple[int, float]]:
    """Return the strings that are still held where the jack is highest, and why.

    These are strings without a pluck that the rig expects to be touched, but not yet released at
    this height, where the load has increased by at least half as much as it expects.

    Args:
        begin: Sample at which the jack leaves rest.

    Returns:
        Rows of the strings in `strings`, with the increase [N] of the load from just below the
        first contact.
    """
    settings, top = strings.settings, float(signals.rise.max())
    high = signals.rise[begin:] > (1 - settings.left) * top
    rows = rows_of(signals, begin, begin + len(high) - int(np.argmax(high[::-1])))
    free = (rows.rise > strings.contacts[0] / 2) & (rows.rise < strings.contacts[0])
    last = rows.rise > (1 - settings.left) * top
    if not (free.any() and last.any()):
        return []
    grown = float(rows.load[last].mean() - rows.load[free].mean())
    part = (top - strings.contacts) / strings.climbs
    enough = grown > np.maximum(settings.drift_std, strings.forces * part / 2)
    held = (part > 0) & (part < 1) & enough
    known = {pluck.string for pluck in plucks}
    return [(int(k), grown) for k in np.flatnonzero(held) if strings.numbers[k] not in known]


def about_end(
    signals: Signals, begin: int, held: Sequence[tuple[int, float]], strings: Expected
) -> list[Remark]:
    """Return warnings if recording or motion end on the way down, which starts at a sample.

    Args:
        held: Of `held_at_top`.
    """
    speed, top = signals.speed[begin:], int(np.argmax(signals.rise[begin:]))
    moving = top >= len(speed) - 2 and speed[top] > 0.5 * speed.max()
    if moving and not held:
        return [Remark("the recording ends while the key is still moving down; record for longer")]
    where, fix = ("recording", "record for longer") if moving else ("motion", "press deeper")
    ends = np.stack([strings.contacts, strings.contacts + strings.climbs], 1) * 1e3
    return [
        Remark(
            f"string {strings.numbers[k]} was touched, and is not released at the end of the"
            f" {where}: the jack rose by {signals.rise.max() * 1e3:.2f} mm, by the rig it touches"
            f" the string at {ends[k, 0]:.2f} mm and releases it at {ends[k, 1]:.2f} mm, and"
            f" the load increased by {grown:.2g} N; {fix}"
        )
        for k, grown in held
    ]


def about_instants(
    plucks: Sequence[HeldString],
    contacts: Sequence[Contact],
    steady: float,
    missing: str | None,
    settings: PhaseSettings = SETTINGS,
) -> list[Remark]:
    """Return warnings about contacts and releases that are hardly determined.

    Args:
        plucks: In order of time.
        contacts: Of the plucks.
        steady: s after the trigger, end of the run-up.
        missing: Signal that was not recorded.
    """
    found, limit = [], settings.doubtful
    before = -math.inf
    for i, (held, contact) in enumerate(zip(plucks, contacts, strict=True)):
        who = _who(i, plucks)
        earliest = held.contact - settings.deviations * held.contact_std
        exchanged = contact.exchange_std > limit
        hidden = earliest < before
        early = earliest < steady and not (hidden or exchanged or missing == "force")
        if early:
            text = (
                f"{who}contact may lie in the run-up, which ends at {steady * 1e3:.5g} ms, where it"
                " depends on the rig's inertia: its uncertainty is"
                f" {held.contact_std * 1e3:.2g} ms; press more slowly"
            )
            found.append(Remark(text, (i,)))
        stds = {"release": held.release_std}
        if not (early or exchanged):
            stds = {"contact": held.contact_std} | stds
        # An uncertainty that is not a number is not within the limit either.
        large = [f"{name} {std * 1e3:.2g} ms" for name, std in stds.items() if not std <= limit]
        if large and not missing:
            fix = "check the noise of the force and the sampling rate, and plot the phases"
            if hidden:
                fix = (
                    f"the string before, released at {before * 1e3:.5g} ms, is held at the same"
                    " time; increase the distance between the strings"
                )
            text = (
                f"{who}uncertainty of {' and of '.join(large)}, above {limit * 1e3:.2g} ms: {fix}"
            )
            found.append(Remark(text, (i,)))
        if held.release - before < limit:
            both = " and ".join(pluck_names(plucks)[i - 1 : i + 1])
            text = (
                f"{both}: their releases are {(held.release - before) * 1e3:.2g} ms"
                f" apart, below {limit * 1e3:.2g} ms, so they may be one pluck; plot the phases,"
                " and press each string alone"
            )
            found.append(Remark(text, (i - 1, i)))
        before = held.release
    return found


def about_flags(
    signals: Signals,
    marks: Sequence[QualityFlag],
    plucks: Sequence[HeldString],
    down: tuple[float, float],
) -> list[Remark]:
    """Return warnings about quality flags at contacts and releases, and saturation before these.

    Args:
        plucks: In order of time.
        down: s after the trigger, start and end of the way down.
    """
    found, named, side = [], set(), signals.settings.doubtful
    then = "nothing was measured there" if signals.missing else "only the other channel shows it"
    instants = [
        (i, what, instant)
        for i, held in enumerate(plucks)
        for what, instant in (("contact", held.contact), ("release", held.release))
    ]
    for mark in marks:
        near = [(i, what) for i, what, t in instants if mark.start - side < t < mark.stop + side]
        if not near:
            continue
        of = [f" of {name}" if len(plucks) > 1 else "" for name in pluck_names(plucks)]
        when = f"{mark.start * 1e3:.5g} to {mark.stop * 1e3:.5g} ms"
        text = (
            f"{mark.channel} {mark.kind} from {when}, at"
            f" the {' and the '.join(what + of[i] for i, what in near)}: {then};"
            f" {HOW_TO_FIX[mark.kind]}"
        )
        # A contact is fitted to all rows of the held string, a release to those around it.
        doubt = [i for i, what in near if mark.kind != "drop-out" or what == "release"]
        found.append(Remark(text, tuple(doubt), doubt=bool(doubt)))
        named.add((mark.channel, mark.kind))
    end = max(held.release for held in plucks) if plucks else down[1]
    saturated = [
        mark
        for mark in marks
        if mark.kind != "drop-out"
        and mark.start < end
        and mark.stop > down[0]
        and (mark.channel, mark.kind) not in named
    ]
    return found + [
        Remark(f"{'before the last release' if plucks else 'on the way down'}, {text}")
        for text in quality_warnings(saturated)
    ]


def _who(index: int, plucks: Sequence[HeldString]) -> str:
    """Return which pluck a text is about; nothing for the only one."""
    return f"{pluck_names(plucks)[index]}: " if len(plucks) > 1 else ""

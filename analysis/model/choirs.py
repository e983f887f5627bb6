"""The choirs of a key, each with its own jack, plectrum and string."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.levels import AUTO, dropped, level_of
from sautereau.analysis.model.plectrum.surface import string_map
from sautereau.analysis.model.pluck.pluck import Pluck, solve_plucks
from sautereau.analysis.model.string.string import release_speed
from sautereau.rig.instrument import Choir, Key, Plectrum, String
from sautereau.rig.schema import Rig
from sautereau.trajectory.key import angle_of_rise, rise_of_angle, rise_slope

SLENDER = "0.3 to 4 %"  # As docs/model.md says: shear, and the corners of steps
LIFT_MAX = 1.0
"""Largest lift of a string over the distance from its plucking point to the nearer end: the string
then rises by 45 degrees, and its tension is by far not constant."""


@dataclass(frozen=True)
class ReleasedString:
    """Displacement and velocity of the quasi-static string just before release.

    At a constant jack speed the velocity is infinite if the pluck ends at a fold.
    """

    x: float
    """m, outwards along the plectrum."""
    z: float
    """m, upwards."""
    velocity_x: float
    """m/s."""
    velocity_z: float
    """m/s."""


@dataclass(frozen=True)
class ChoirPluck:
    """The pluck of one choir in a press; times are in s after the jack leaves rest."""

    string_force: Floats
    """N, of the string on the jack, over the prediction's time; shape (n,)."""
    contact: float
    """s."""
    release: float
    """s."""
    plectrum_force: float
    """N, between plectrum and string."""
    release_lift: float
    """m, of the string."""
    release_angle: float
    """rad, of the plectrum under the string."""
    released_string: ReleasedString
    """Initial condition of the free string."""
    work: float
    """J, done by the key on this jack against string and plectrum."""
    v_osc: float
    """m/s, of the released string."""
    released_at_fold: bool
    """Whether the string was released at a fold of the equilibrium curve, before the tip."""

    @property
    def pluck_duration(self) -> float:
        """Time from contact to release [s]."""
        return self.release - self.contact


@dataclass(frozen=True)
class PlacedPluck:
    """A choir's pluck, with the rise [m] of the first jack at its contact and release."""

    choir: Choir
    pluck: Pluck
    contact: float
    release: float


def choirs(rig: Rig) -> tuple[Choir, ...]:
    """Return the choirs of a rig in their order."""
    first = Choir.model_construct(
        jack_arm=rig.key.jack_arm, jack=rig.jack, plectrum=rig.plectrum, string=rig.string
    )
    return (first, *rig.more_choirs)


def with_plectrum(rig: Rig, string: int, plectrum: Plectrum) -> Rig:
    """Return a rig with another plectrum under one of its strings, by its number from 1."""
    if string == 1:
        return rig.model_copy(update={"plectrum": plectrum})
    others = list(rig.more_choirs)
    others[string - 2] = others[string - 2].model_copy(update={"plectrum": plectrum})
    return rig.model_copy(update={"more_choirs": tuple(others)})


def string_names(rig: Rig) -> tuple[str, ...]:
    """Return the names of a rig's strings: `string 1`, or `string 1 (8' back)` where named."""
    names = [choir.string.name for choir in choirs(rig)]
    return tuple(f"string {k}" + f" ({name})" * bool(name) for k, name in enumerate(names, 1))


def key_of(rig: Rig, choir: Choir) -> Key:
    """Return the key with the lever arm of a choir's jack."""
    if choir.jack_arm == rig.key.jack_arm:
        return rig.key
    return rig.key.model_copy(update={"jack_arm": choir.jack_arm})


def choir_pluck(choir: Choir, level: str = AUTO) -> Pluck:
    """Return the pluck of a choir's plectrum and spring string; see `pluck_of`."""
    named = level_of(choir.plectrum, level)  # pyright: ignore[reportArgumentType]  # kept once
    return pluck_of(choir.plectrum, choir.string, named)  # pyright: ignore[reportArgumentType]


def pluck_of(plectrum: Plectrum, string: String, level: str) -> Pluck:
    """Return the pluck of a plectrum and a spring string; the last 128 are kept.

    Raises:
        ModelError: The level has no solution for them.
    """
    kept = _kept(plectrum, string, level)  # pyright: ignore[reportArgumentType]
    if not kept:
        solve_together([(plectrum, string, level)])
    (found,) = kept
    if isinstance(found, ModelError):
        kept.clear()
        raise found
    return found


@lru_cache(maxsize=128)
def _kept(plectrum: Plectrum, string: String, level: str) -> list[Pluck | ModelError]:
    """Return where the pluck is kept: a list, empty until it is solved."""
    return []


def solve_together(cases: Iterable[tuple[Plectrum, String, str]]) -> None:
    """Solve the plucks of some arguments of `pluck_of`, where they are kept.

    Those of plectra of one shape and friction take little more time than one.
    """
    wanted, maps = [], []
    for plectrum, string, level in dict.fromkeys(cases):
        kept = _kept(plectrum, string, level)  # pyright: ignore[reportArgumentType]
        if kept:
            continue
        try:
            maps.append(string_map(plectrum, string, level))
            wanted.append((kept, plectrum, string))
        except ModelError as error:
            kept.append(error)
    solved = solve_plucks(
        [(m, s.static_stiffness, p.overlap) for m, (_, p, s) in zip(maps, wanted, strict=True)]
    )
    for found, (kept, _, string) in zip(solved, wanted, strict=True):
        most = LIFT_MAX * string.nearer_end
        if isinstance(found, Pluck) and (lift := float(found.lift[-1])) > most:
            found = ModelError(
                f"plectrum.overlap: the string would be lifted by {lift * 1e3:.4g} mm. A spring of"
                f" constant stiffness is no string beyond {most * 1e3:.4g} mm,"
                f" {100 * LIFT_MAX:.0f} % of the way from the plucking point to its nearer end;"
                " lower overlap or plectrum.thickness, or raise string.tension"
            )
        kept.append(found)


def level_name(rig: Rig, level: str) -> str:
    """Return the levels that `level` means for the choirs of a rig: `elastica`, `fe`, or both."""
    named = [level_of(choir.plectrum, level) for choir in choirs(rig)]
    return " and ".join(dict.fromkeys(named))


def ignored(rig: Rig, level: str) -> list[str]:
    """Return a text for each part of a plectrum that has no effect, with what it changes."""
    found = []
    for number, choir in enumerate(choirs(rig)):
        at = f"more_choirs[{number - 1}]." if number else ""
        left_out = dropped(choir.plectrum, level)  # pyright: ignore[reportArgumentType]
        lost = ", ".join(f"{at}plectrum.{name}" for name in left_out)
        given, clamped = choir.plectrum.thickness, choir.plectrum.clamp_thickness
        # An outline's thickness at the clamp may be the one beside it.
        if abs(given - clamped) > 1e-3 * clamped and not lost:
            found.append(
                f"{at}plectrum.thickness of {given * 1e3:.4g} mm has no effect: plectrum.outline is"
                f" {clamped * 1e3:.4g} mm thick at the clamp; make them equal"
            )
        described = choir.plectrum.described
        best = level_of(choir.plectrum)  # pyright: ignore[reportArgumentType]
        if not described or level in (AUTO, best):
            continue
        if level == "elastica" or not lost:
            shape = " and ".join(name for name in described if name not in left_out)
            bar = f"takes {at}plectrum.{shape} as that of a slender bar, which changes the force by"
            bar = f"{bar} {SLENDER}" * bool(shape)
            ignores = f"ignores {lost}" * bool(lost)
            found.append(
                f"the plectrum model {level} {' and '.join(filter(None, (ignores, bar)))}; use the"
                " level auto"
            )
            continue
        # Its elements would take seconds, for a fraction of what is lost.
        force, true = (float(choir_pluck(choir, name).force[-1]) for name in (level, "elastica"))
        found.append(
            f"the plectrum model {level} ignores {lost}: its plectrum force at release is"
            f" {100 * (force / true - 1):+.1f} % off that of elastica; use the level auto"
        )
    return found


def hold(
    rig: Rig, level: str, solved: Mapping[int, Pluck] = MappingProxyType({})
) -> list[PlacedPluck]:
    """Solve every choir's pluck.

    Args:
        solved: Plucks that are known already, by the number of the string.

    Raises:
        ModelError: A choir has no pluck, or its release lies beyond the press; names the choir.
    """
    held, faults = [], []
    for number, choir in enumerate(choirs(rig)):
        at = f"more_choirs[{number - 1}]." if number else ""
        try:
            pluck = solved.get(number + 1) or choir_pluck(choir, level)
        except ModelError as error:
            faults.append(f"{at}{error}")
            continue
        lever, clearance = key_of(rig, choir), choir.jack.string_clearance
        contact, release = clearance, clearance + pluck.release_height
        if number:
            contact, release = (
                float(rise_of_angle(rig.key, angle_of_rise(lever, rise)))
                for rise in (contact, release)
            )
        if release >= rig.press.jack_rise:
            faults.append(
                f"press.jack_rise: {rig.press.jack_rise * 1e3:.4g} mm ends before the string is"
                f" released at {release * 1e3:.4g} mm; raise jack_rise or lower"
                f" {at}plectrum.overlap"
            )
        held.append(PlacedPluck(choir, pluck, contact, release))
    if faults:
        raise ModelError("\n".join(faults))
    return held


def plucked(
    rig: Rig, held: PlacedPluck, string_force: Floats, times: tuple[float, float], speed: float
) -> ChoirPluck:
    """Return a choir's pluck in time.

    Args:
        string_force: N, of the string on the jack, over the prediction's time; shape (n,).
        times: s, of contact and release.
        speed: m/s, of the first jack at release.
    """
    pluck = held.pluck
    lever = key_of(rig, held.choir)
    rise = held.choir.jack.string_clearance + pluck.release_height
    own, first = (rise_slope(key, angle_of_rise(lever, rise)) for key in (lever, rig.key))
    own_speed = speed * float(own / first)
    out, up = pluck.release_slopes
    lift = float(pluck.lift[-1])
    return ChoirPluck(
        string_force=string_force,
        contact=times[0],
        release=times[1],
        plectrum_force=float(pluck.string_force[-1]),
        release_lift=lift,
        release_angle=float(pluck.angle[-1]),
        released_string=ReleasedString(
            float(pluck.shift[-1]), lift, out * own_speed, up * own_speed
        ),
        work=pluck.work,
        v_osc=release_speed(held.choir.string, lift),
        released_at_fold=pluck.released_at_fold,
    )

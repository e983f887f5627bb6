"""Large rotation of a cantilever of any outline: the elastica with EI(s), integrated numerically.

Seen from the loaded point, the section at x has turned by rho, and the tangent of the mid-line has
the angle psi = rho + (slope of the mid-line at x) - (slope of the surface at the load) against the
surface there. With the load F normal to that surface and T F along it, the balance of moments is
d(rho)/d(sigma) = F (along + T across) / EI, where along and across are the integrals of cos psi and
sin psi over the arc length sigma of the mid-line towards the clamp. All of it is known at the load,
so one integration from there to the clamp solves every load, without iteration.

All lengths are in units of the plectrum's length L, and loads F s^2 in those of EI at the clamp.
"""

from functools import lru_cache
from itertools import pairwise

import numpy as np

from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.profile import Profile, profile_of
from sautereau.analysis.model.plectrum.table import TURN, Samples, Table
from sautereau.rig.instrument import Plectrum

DRAGS, LOADS, POSITIONS = 9, 20, 6  # Nodes of a table over T, over q, and over s in each part
STEPS = 96  # Least number from tip to clamp; the method's error falls as its 4th power


def laws(
    profile: Profile, places: Floats, loads: Floats, drags: Floats, at_surface: bool = False
) -> Floats:
    """Return x/s, z/(s q) and theta/q of `Table`, of shape (3, drags, loads, positions).

    Args:
        profile: Both edges.
        places: s, shape (positions,).
        loads: q = F s^2, shape (loads,).
        drags: T, the force along the surface towards the tip over F; shape (drags,).
        at_surface: Whether the load has a moment about the mid-line: it acts at the surface, off
            the mid-line, and the part of it that lies along the section has a lever.
    """
    order = np.argsort(-places)
    places = places[order]
    height, slope, _ = profile.contact_line(places)
    tilt, drag = np.arctan(slope)[:, None, None], drags[:, None]
    force = (loads / places[:, None] ** 2)[:, None, :]
    inner = profile.x[(profile.x > 0) & (profile.x < places[0])]
    marks = np.unique(np.concatenate([np.linspace(0.0, 1.0, STEPS + 1), inner, places]))
    marks = marks[marks <= places[0]][::-1]
    arm = (height - _middle(profile, places) + profile.clamp_middle)[:, None, None]
    lever = (arm + profile.clamp_thickness / 2) * at_surface
    moment = lever * (np.sin(tilt) + drag * np.cos(tilt))
    state = np.zeros((3, len(places), len(drags), len(loads)))
    thickness = profile.x, (profile.top - profile.bottom) / profile.clamp_thickness
    for high, low in pairwise(marks.tolist()):
        active = slice(np.searchsorted(-places, -high, "right"))
        rise = np.subtract(*_middle(profile, np.array([high, low]))) / (high - low)
        stretch, lean = np.hypot(1.0, rise), np.arctan(rise) - tilt[active]
        depths = np.interp(np.array([high, (high + low) / 2, low]), *thickness)
        flexibility = force[active] / depths[:, None, None, None] ** 3
        moved = state[:, active]
        state[:, active] = step_to_clamp(
            moved, flexibility, stretch * (high - low), lean, drag, moment[active]
        )
    turned, along, across = state
    angle = turned - tilt
    cosine, sine = np.cos(angle), np.sin(angle)
    x = along * cosine + across * sine + arm * np.sin(turned)
    z = across * cosine - along * sine + arm * np.cos(turned) - height[:, None, None]
    s, q = places[:, None, None], loads
    found = np.stack([x / s, z / (s * q), -turned / q])
    return np.moveaxis(found[:, np.argsort(order)], 1, -1)


def load_range(profile: Profile) -> float:
    """Return the load at the tip, without friction, under which its tangent turns by `TURN`."""
    tip, still = np.ones(1), np.zeros(1)
    # A uniform bar turns by half the load at first, and reaches a right angle at 3.44.
    load = -TURN / float(laws(profile, tip, np.array([1e-6]), still)[2, 0, 0, 0])
    for spread in (0.5, 0.03, 0.002):
        loads = load * np.linspace(1 - spread, 1 + spread, 33)
        turned = -loads * laws(profile, tip, loads, still)[2, 0, :, 0]
        load = float(np.interp(TURN, turned, loads))
    return load


@lru_cache(maxsize=32)
def tapered_table(profile: Profile, nearest: float) -> Table:
    """Return the elastica's table of a profile from s = `nearest` to the tip."""
    return samples(profile, nearest, load_range(profile)).table()


def samples(profile: Profile, nearest: float, q_max: float, at_surface: bool = False) -> Samples:
    """Return the table of a profile at its nodes, with more parts until it is accurate."""
    found = _samples(profile, nearest, q_max, at_surface, 1)
    # Doubled up to 8 parts until the error between the nodes is small.
    while found.error > 1e-6 and (parts := 2 * found.laws.shape[3]) <= 8:
        found = _samples(profile, nearest, q_max, at_surface, parts)
    return found


def _samples(
    profile: Profile, nearest: float, q_max: float, at_surface: bool, parts: int
) -> Samples:
    found = Samples(
        np.empty((3, DRAGS, LOADS, parts, POSITIONS)),
        np.empty((2, parts, POSITIONS)),
        32,  # Cells of the table over q
        q_max,
        nearest,
    )
    drags, loads, places = found.nodes
    solved = laws(profile, places.ravel(), loads, drags, at_surface)
    found.laws[:] = solved.reshape(found.laws.shape)
    height, slope, _ = profile.contact_line(places)
    found.line[:] = height, np.arctan(slope)
    return found.checked(laws(profile, *found.probes, at_surface))


def step_to_clamp(
    state: Floats,
    flexibility: Floats,
    step: Floats | float,
    lean: Floats,
    drag: Floats,
    moment: Floats | float = 0.0,
) -> Floats:
    """Return the state after one step of the classical Runge-Kutta method towards the clamp.

    Args:
        state: Rotation, and the integrals along and across the surface; shape (3, ...), and all
            that follows fits its second and later axes.
        flexibility: F / EI at the start, in the middle and at the end of the step; (3, ...).
        step: Arc length of the mid-line.
        lean: rad, slope of the mid-line less that of the surface at the load.
        drag: T.
        moment: Of the load about the mid-line, over F.
    """

    def rates(at: Floats, flexible: Floats) -> Floats:
        turned, along, across = at
        psi = turned + lean
        return np.stack([flexible * (along + drag * across + moment), np.cos(psi), np.sin(psi)])

    start, middle, end = flexibility
    first = rates(state, start)
    second = rates(state + step / 2 * first, middle)
    third = rates(state + step / 2 * second, middle)
    last = rates(state + step * third, end)
    return state + step / 6 * (first + 2 * (second + third) + last)


def _middle(profile: Profile, x: Floats) -> Floats:
    """Return the height of the mid-line; past the tip it is parallel to the top."""
    return np.add(*profile.edges(x)) / 2


BETWEEN = 4  # Steps of the integration between two sections


def straight(plectrum: Plectrum) -> Floats:
    """Return the outline [m] of an unloaded plectrum; see `bent`."""
    tip, none = np.array([plectrum.length]), np.zeros(1)
    return bent(plectrum, tip, none, none)[0]


def bent(plectrum: Plectrum, s: Floats, force: Floats, drag: Floats) -> Floats:
    """Return closed outlines [m] in the clamp's frame, shape (n, points, 2): x outwards, z up.

    The top comes first, from the clamp to the tip.

    Args:
        plectrum: Its shape and its stiffness.
        s: m, positions of the string on it, shape (n,).
        force: N, normal to the surface, shape (n,).
        drag: Force along the surface towards the tip over the normal one, shape (n,).
    """
    profile, length = profile_of(plectrum), plectrum.length
    place = (s / length)[:, None]
    kinks = profile.x[(profile.x > 0) & (profile.x < place.min(initial=1.0))]
    # At more kinks there are no further sections.
    kinks = np.tile(kinks if len(kinks) <= 12 else [], (len(s), 1))
    # 8 evenly spaced sections from the clamp to the string.
    drawn = np.sort(np.hstack([place * np.linspace(0.0, 1.0, 8), kinks]), axis=1)
    count = BETWEEN * (drawn.shape[1] - 1)
    x = np.ones((len(s), count + 2))
    share = np.arange(count + 1) / BETWEEN
    low = np.minimum(share.astype(int), drawn.shape[1] - 2)
    x[:, :-1] = drawn[:, low] + (drawn[:, low + 1] - drawn[:, low]) * (share - low)
    top, bottom = profile.edges(x)
    middle, depth = (top + bottom) / 2, top - bottom
    slope = np.arctan(profile.contact_line(place[:, 0])[1])
    stiffness = plectrum.modulus * plectrum.width * length / 12
    state = np.zeros((3, len(s)))
    states = [state]
    for number in range(count, 0, -1):
        rise, run = (a[:, number] - a[:, number - 1] for a in (middle, x))
        ends = depth[:, number], depth[:, number - 1]
        flexibility = force / (stiffness * np.stack([ends[0], sum(ends) / 2, ends[1]]) ** 3)
        lean = np.arctan2(rise, run) - slope
        state = step_to_clamp(state, flexibility, np.hypot(rise, run), lean, drag)
        states.append(state)
    turned, along, across = np.stack(states[::-1], -1)
    angle, section = turned[:, :1] - slope[:, None], turned[:, :1] - turned
    # From the string to each section, against the surface under the string; then in the clamp's.
    along, across = along[:, :1] - along, across[:, :1] - across
    path = np.cos(angle) * along + np.sin(angle) * across
    rise = np.cos(angle) * across - np.sin(angle) * along
    # Beyond the string nothing bends.
    end = section[:, -1:]
    over, up = x[:, -1:] - x[:, -2:-1], middle[:, -1:] - middle[:, -2:-1]
    path = np.hstack([path, path[:, -1:] + np.cos(end) * over + np.sin(end) * up])
    rise = np.hstack([rise, rise[:, -1:] + np.cos(end) * up - np.sin(end) * over])
    section = np.hstack([section, end])
    path, rise, section, depth = (
        np.append(a[:, : count + 1 : BETWEEN], a[:, -1:], axis=1)
        for a in (path, rise, section, depth)
    )
    offset = depth[..., None] / 2 * np.stack([np.sin(section), np.cos(section)], -1)
    line = np.stack([path, rise], -1)
    return length * np.concatenate([line + offset, (line - offset)[:, ::-1]], axis=1)

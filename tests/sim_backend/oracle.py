"""An independent solution of the stand-in's equations for a push, slow and simple, for tests.

It is written from the equations of docs/stand-in.md and docs/results.md. scipy's DOP853 solves each
mode with its inequalities as terminal events. What follows an event is found by trial: every
combination of sliding, sticking, standing and leaving is solved, and one that violates no
inequality is taken.
"""

from dataclasses import dataclass, field
from itertools import product

import numpy as np
from numpy.polynomial import Chebyshev
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

STANDARD = 9.80665  # m/s^2
RELATIVE = 1e-12  # of the elastica and of the motion
LONGEST = 0.5e-3  # s, so that no inequality is violated and met again within a step
SHORTEST = 1e-8  # s, of a flight
APART = 1e-15  # m, more than rounding: a jack closer to the key stands on it
CLOSE = 1e-12  # m: who is so close at a landing takes part in it
LARGEST = 2.0  # of q, at an angle of 0.8 rad or more
PLUCKING = {
    "contact": "held",
    "withdraw": "below",
    "release": "above",
    "pass": "below",
    "back": "above",
    "return": "below",
}  # the plectrum's state after an event; a passing one has a tongue
FINGER = -1  # in place of a choir's number
REST = 1e-12  # rad/s, more than rounding: a slower key is at rest after an event
SLOW = 1e-6  # m/s, of a jack after an impact relative to the key: landings accumulate, it stands


class StringCurve:
    """Vertical force of the string [N] over the jack's rise above contact [m], as an elastica.

    With q = s^2 F / EI as the parameter, psi'' = cos psi + mu sin psi gives the contact point; the
    string's horizontal equilibrium gives s, the vertical one h. The string slides towards the clamp
    with a coefficient -mu, sticks, and slides out with mu; the friction that acts at each instant
    also bends the plectrum.
    """

    def __init__(self, plectrum, string):
        self.rigidity = plectrum.youngs_modulus * plectrum.width * plectrum.thickness**3 / 12
        part = string.plucking_point / string.length
        self.stiffness = string.tension / (string.length * part * (1 - part))
        self.offset = (plectrum.thickness + string.diameter) / 2 * (plectrum.contact == "surface")
        self.mu, length = plectrum.friction, plectrum.length
        self.start = length - plectrum.overlap
        self.rubs = np.array([0.0]) if self.mu == 0 else self.mu * np.cos(np.pi * np.arange(9) / 8)
        self.elasticas = [
            solve_ivp(
                lambda _, u, t=t: [u[1], np.cos(u[0]) + t * np.sin(u[0]), *_direction(u[0])],
                (0, np.sqrt(LARGEST)),
                (0, 0, 0, 0),
                "DOP853",
                rtol=1e-13,
                atol=1e-15,
                max_step=0.05,
                dense_output=True,
            ).sol
            for t in self.rubs
        ]
        pieces, q, stuck = [], 0.0, self.start
        if self.mu > 0:
            tiny = 1e-6
            if self.coefficient(tiny, self.start) < -self.mu:
                turn = self.first(lambda q: -self._inward(q), tiny)
                pieces.append((q, turn, lambda q: self.slid(q, -self.mu)))
                q, stuck = turn, self.slid(turn, -self.mu)
            slip = self.first(lambda q: self.coefficient(q, stuck) - self.mu, max(q, tiny))
            pieces.append((q, slip, lambda _: stuck))
            q = slip
        tip = self.first(lambda q: self.slid(q, self.mu) - length, q)
        pieces.append((q, tip, lambda q: self.slid(q, self.mu)))
        self.folds, self.pieces = False, []
        for n, (low, high, place) in enumerate(pieces):
            if n == len(pieces) - 1:
                slope = self.fitted(place, low, high, 0).deriv()
                roots = [r.real for r in slope.roots() if abs(r.imag) < 1e-12]
                folds = [r for r in roots if low < r < high]
                self.folds, high = bool(folds), min(folds, default=high)
            rise, force = (_powers(self.fitted(place, low, high, i)) for i in (0, 1))
            self.release, self.release_force = self.at(high, place(high))
            self.pieces.append((self.release, rise, [k * c for k, c in enumerate(rise)][1:], force))
        self.last = 0.0

    def fitted(self, place, low, high, index):
        """Return rise (0) or force (1) over q."""
        return Chebyshev.interpolate(
            lambda qs: np.array([self.at(q, place(q))[index] for q in qs]), 31, (low, high)
        )

    def point(self, q, rub):
        """Return x / s and z / s of the contact and sine and cosine of its angle.

        The friction that bends the plectrum is the one that acts: of the elasticas at some
        coefficients, Lagrange's polynomial at this one.
        """
        xi, apart = np.sqrt(q), self.rubs[:, None] - self.rubs
        np.fill_diagonal(apart, 1.0)
        steps = np.where(np.eye(len(apart)), 1.0, (rub - self.rubs) / apart)
        psi, _, along, across = steps.prod(1) @ [sol(xi) for sol in self.elasticas]
        sin, cos = np.sin(psi), np.cos(psi)
        return (cos * along + sin * across) / xi, (cos * across - sin * along) / xi, sin, cos

    def coefficient(self, q, s):
        """Return the coefficient of friction with which the string rests at s."""
        rub = 0.0
        for _ in range(400):  # where the plectrum is bent far, each step leaves most of the error
            x, _, sin, cos = self.point(q, min(max(rub, -self.mu), self.mu))
            pull = (s * x + self.offset * sin - self.start) * self.stiffness
            last, rub = rub, (sin - pull * s**2 / (q * self.rigidity)) / cos
            if abs(rub - last) < 1e-14:
                break
        return rub

    def slid(self, q, mu):
        """Return where the string lies when it slides with a coefficient."""
        if q <= 0:
            return self.start
        x, _, sin, cos = self.point(q, mu)
        push = q * self.rigidity * (sin - mu * cos) / self.stiffness
        return brentq(
            lambda s: s * x + self.offset * sin - self.start - push / s**2,
            0.6 * self.start,
            3 * self.start,
            xtol=1e-16,
        )

    def _inward(self, q):
        """Return minus the slope over q of the place of a string that slides inward."""
        d = 1e-4 * q
        return (self.slid(q - d, -self.mu) - self.slid(q + d, -self.mu)) / (2 * d)

    def at(self, q, s):
        """Return rise and force at a load q with the string at s."""
        if q <= 0:
            return 0.0, 0.0
        mu = self.coefficient(q, s)
        _, z, sin, cos = self.point(q, min(max(mu, -self.mu), self.mu))
        force = q * self.rigidity / s**2 * (cos + mu * sin)
        return force / self.stiffness - s * z + self.offset * (1 - cos), force

    @staticmethod
    def first(value, after, step=LARGEST / 200):
        """Return the first q after which a value is positive."""
        low = after
        while value(low + step) <= 0:
            low += step
            assert low + step < LARGEST, "the string does not reach the tip"
        return low if value(low) > 0 else brentq(value, low, low + step, xtol=1e-15)

    def __call__(self, h):
        piece = next((p for p in self.pieces if h <= p[0]), self.pieces[-1])
        _, rise, slope, force = piece
        u = self.last
        for _ in range(60):
            step = (_horner(rise, u) - h) / _horner(slope, u)
            u = min(max(u - step, -1.02), 1.0)
            if abs(step) < 1e-13:
                break
        self.last = min(u, 0.9)
        return _horner(force, u)


def _direction(angle):
    return np.cos(angle), np.sin(angle)


def _powers(series):
    """Return the coefficients of a power series over [-1, 1], cut at rounding."""
    kept = series.trim(3e-14 * np.abs(series.coef).max())
    return np.polynomial.chebyshev.cheb2poly(kept.coef).tolist()


def _horner(powers, u):
    total = 0.0
    for c in reversed(powers):
        total = total * u + c
    return total


@dataclass
class Slider:
    """A jack: its parts, and in which state it is."""

    lever: float
    jack: object
    plectrum: object
    curve: StringCurve
    state: str = "below"
    on: bool = True
    damped: bool = True
    sign: int = 0  # of its friction


@dataclass
class Solution:
    """Events as (time [s], choir, force [N]), and the key's angle."""

    contacts: list = field(default_factory=list)
    releases: list = field(default_factory=list)
    returns: list = field(default_factory=list)
    landings: list = field(default_factory=list)  # (time [s], choir or FINGER)
    leavings: list = field(default_factory=list)
    bends: list = field(default_factory=list)  # times [s] between which the motion is smooth
    motion: list = field(default_factory=list)  # of times: angle, velocity, first rise, force


class Oracle:
    """A key at rest on its rail that a constant force presses."""

    def __init__(self, rig, scene):
        key = self.key = rig.key
        self.scene, self.push = scene, scene.push
        self.tau = key.pivot_coulomb_friction if scene.friction else 0.0
        self.viscous = key.pivot_viscous_friction if scene.friction else 0.0
        self.mu = rig.arm.fingertip_friction if scene.friction else 0.0
        first = (key.jack_arm, rig.jack, rig.plectrum, rig.string)
        more = [(c.jack_arm, c.jack, c.plectrum, c.string) for c in rig.more_choirs]
        self.jacks = [
            Slider(b, jack, plectrum, StringCurve(plectrum, string))
            for b, jack, plectrum, string in (first, *more)
        ]
        self.sign, self.stick, self.felt, self.touch = 0, True, False, False
        self.time, self.found = 0.0, Solution()

    # Kinematics and forces

    def rise(self, j, a):
        """Return r, dr/da and its derivative."""
        b, hb = j.lever, self.key.jack_surface_height
        sec, tan = 1 / np.cos(a), np.tan(a)
        return (
            b * tan + hb * (sec - 1),
            b * sec**2 + hb * sec * tan,
            2 * b * sec**2 * tan + hb * sec * (sec**2 + tan**2),
        )

    def friction(self, j):
        return j.jack.register_friction if self.scene.friction else 0.0

    def height(self, j, y):
        return y - j.jack.string_clearance

    def travel(self, j):
        if not self.scene.tongue:
            return 0.0
        lever = j.plectrum.length - j.plectrum.overlap
        return lever * j.plectrum.overlap / j.jack.tongue.pivot

    def tongue(self, j, drop):
        if not self.scene.tongue:
            return 0.0
        lever, tongue = j.plectrum.length - j.plectrum.overlap, j.jack.tongue
        return (tongue.bristle_moment + tongue.bristle_stiffness * drop / lever) / lever

    def load(self, j, y):
        """Return what presses the jack down, without its friction."""
        h, down = self.height(j, y), j.jack.mass * self.scene.gravity
        if j.state == "held":
            down += j.curve(h)
        if j.state == "passing":
            down -= self.tongue(j, -h)
        if self.scene.damper and j.damped:
            down -= j.jack.damper.stiffness * (j.jack.damper.lift - y)
        return down

    def cushion(self, a, w):
        arm = self.key.press_arm
        return self.key.felt_stiffness * (arm * a - self.key.dip) + self.key.felt_damping * arm * w

    def pressure(self, u):
        """Return a value that is positive if the felt pushes: beyond the dip it must not pull."""
        return min(self.key.press_arm * u[0] - self.key.dip, self.cushion(u[0], u[1]))

    def moment(self, a, w):
        """Return the moment on the key without dry friction and jacks."""
        arm = self.key.press_arm
        felt = self.cushion(a, w) * arm if self.felt else 0.0
        weight = self.key.gravity_moment * self.scene.gravity / STANDARD
        return weight - self.viscous * w - felt

    # A mode: `stick`, `sign`, and of each jack `on` and `sign`

    def accelerations(self, u):
        """Return those of key and jacks, the jacks' normal forces, and the finger's.

        That is the finger's normal force [N], and the fraction of it that acts on the surface.
        """
        a, w = u[0], u[1]
        geometry = [self.rise(j, a) for j in self.jacks]
        loads = [self.load(j, y) for j, y in self.standing(u)]
        inertia, moment = self.key.inertia, self.moment(a, w) - self.sign * self.tau
        for j, (_, r1, r2), load in zip(self.jacks, geometry, loads, strict=True):
            if j.on:
                held = load + self.friction(j) * self.sign
                inertia += j.jack.mass * r1**2
                moment -= r1 * (held + j.jack.mass * r2 * w**2)
        inertia = np.inf if self.stick else inertia
        rub = self.resting(u)[2] if self.stick else self.mu * self.sign
        force, arm = self.finger(u, moment, inertia, rub)
        alpha = (moment + force * arm) / inertia
        rates, normals = [], []
        for j, (_, r1, r2), load in zip(self.jacks, geometry, loads, strict=True):
            m, f = j.jack.mass, self.friction(j)
            follow = r1 * alpha + r2 * w**2
            if j.on:
                rates.append(follow)
                normals.append(m * follow + load + f * (1 if self.stick else self.sign))
            else:
                rates.append(0.0 if j.sign == 0 else -(load + f * j.sign) / m)
                normals.append(0.0)
        return alpha, rates, normals, force, rub

    def finger(self, u, moment, inertia, rub):
        """Return the finger's force on a key with this other moment and inertia, and its lever.

        The lever [m] is the moment per N: that of the force and of its share `rub` on the surface.
        """
        force = self.push.force if self.time < self.push.duration else 0.0
        return force, self.key.press_arm + rub * self.key.surface_height

    def standing(self, u):
        """Return each jack with its rise."""
        return zip(self.jacks, u[2 : 2 + 2 * len(self.jacks) : 2], strict=True)

    def resting(self, u):
        """Return by how much the moment on a key at rest is within its friction: [below, above].

        Then the friction of the fingertip: the least that keeps the key at rest, between none and
        that of the motion that would begin. Then the side of the moment without it.
        """
        other, low, high = self.moment(u[0], u[1]), -self.tau, self.tau
        for j, y in self.standing(u):
            if j.on:
                r1, load, f = self.rise(j, u[0])[1], self.load(j, y), self.friction(j)
                low += r1 * max(0.0, load - f)
                high += r1 * (load + f)

        def total(rub):
            force, arm = self.finger(u, other, np.inf, rub)
            return other + force * arm

        free = total(0.0)
        up, down = (free, free) if self.mu == 0 else (total(self.mu), total(-self.mu))
        below = np.inf if u[0] <= 0 else max(free, down) - low
        above, rub = high - min(free, up), 0.0
        if free > high >= up:
            rub = brentq(lambda rub: total(rub) - high, 0.0, self.mu, xtol=1e-16)
        if free < low <= down and u[0] > 0:
            rub = brentq(lambda rub: total(rub) - low, 0.0, -self.mu, xtol=1e-16)
        return below, above, rub, np.sign(2 * free - low - high)

    def right(self, _, u):
        alpha, rates, *_ = self.accelerations(u)
        return [u[1], alpha, *(x for n, r in enumerate(rates) for x in (u[3 + 2 * n], r))]

    def observed(self, t, u):
        """Return angle and velocity of the key, the first jack's rise, and the finger's force."""
        return u[0], u[1], u[2], self.accelerations(u)[3]

    def choose(self, u, touching):
        """Set the mode in which the motion continues from a state."""
        w = u[1]
        keys = [(False, int(np.sign(w)))] if w else [(True, 0), (False, 1), (False, -1)]
        options = []
        for k, _ in enumerate(self.jacks):
            v = u[3 + 2 * k]
            off = [(False, s) for s in ([int(np.sign(v))] if v else [0, 1, -1])]
            options.append([(True, 0), *off] if k in touching else off)
        tips = (True, False) if FINGER in touching else (False,)
        for (self.stick, self.sign), self.touch, *states in product(keys, tips, *options):
            for j, state in zip(self.jacks, states, strict=True):
                j.on, j.sign = state
            if self.holds(u, touching):
                return
        raise AssertionError(f"no mode at {self.time} s, {u}")

    def holds(self, u, touching, small=1e-12):
        """Return whether a trial mode violates no inequality."""
        alpha, rates, normals, *_ = self.accelerations(u)
        if self.stick:
            if min(self.resting(u)[:2]) < -small:
                return False
        elif u[1] == 0:
            if alpha * self.sign <= 0 or (u[0] <= 0 and self.sign < 0):
                return False
            # Friction that drives the key lets it leave its rest on either side.
            if self.mu and not self.leads(u):
                return False
        return all(
            normals[k] >= -small
            if j.on
            else self.flies(k, u, alpha, rates[k], touching=k in touching)
            for k, j in enumerate(self.jacks)
        )

    def leads(self, u):
        """Return whether a key at rest starts to the side of its moment without fingertip."""
        return self.resting(u)[3] == self.sign

    def flies(self, k, u, alpha, rate, *, touching):
        """Return whether a jack above the key violates no inequality."""
        j = self.jacks[k]
        _, r1, r2 = self.rise(j, u[0])
        if touching and rate < r1 * alpha + r2 * u[1] ** 2:
            return False
        if u[3 + 2 * k] != 0:
            return True
        if j.sign == 0:
            return abs(self.load(j, u[2 + 2 * k])) <= self.friction(j)
        return rate * j.sign > 0

    def impact(self, u, near):
        """Return the state after an impact without rebound, and who stands on the key."""
        r1 = {k: self.rise(self.jacks[k], u[0])[1] for k in near if k != FINGER}
        for hits in product((True, False), repeat=len(near)):
            joined = [k for k, hit in zip(near, hits, strict=True) if hit]
            x, _, relative = self.joint(u, r1, joined)
            if all(relative[k] <= SLOW if k in joined else relative[k] >= 0 for k in near):
                break
        else:
            raise AssertionError("no impact")
        # Slow ones join, with their momentum: so a series of ever shorter flights ends.
        touching = [k for k in near if k in joined or relative[k] < SLOW]
        x, impulse, _ = self.joint(u, r1, touching)
        u = u.copy()
        u[1] = x if abs(x) > REST else 0.0
        for k in touching:
            if k != FINGER:
                u[3 + 2 * k] = r1[k] * x
        return self.struck(u, *impulse), touching

    def joint(self, u, r1, joined):
        """Return the key's velocity after a joint impact, the finger's impulse, gap speeds.

        The impulse is that along the normal [N s] and its share on the surface. The speeds are a
        jack's own one relative to the key after it, and the finger's relative to the key that it
        has not touched.
        """
        inertia, momentum = self.key.inertia, self.key.inertia * u[1]
        for k, slope in r1.items():
            if k in joined:
                inertia += self.jacks[k].jack.mass * slope**2
                momentum += self.jacks[k].jack.mass * slope * u[3 + 2 * k]
        rail = 0.0 if u[0] <= 0 else -np.inf
        alone = max(momentum / inertia, rail)
        x, impulse = alone, (0.0, 0.0)
        if FINGER in joined:

            def after(rub):
                force, arm = self.blow(u, momentum, inertia, rub)
                return (momentum + force * arm) / inertia

            free, rub = after(0.0), 0.0
            if self.mu and free:  # the friction is that of the velocity after the impact
                rub = self.mu * np.sign(free)
                if after(rub) * free < 0:
                    rub = brentq(after, 0.0, rub, xtol=1e-16)
            x, impulse = after(rub), (self.blow(u, momentum, inertia, rub)[0], rub)
            if x < rail:
                x, impulse = 0.0, (self.blow(u, 0.0, np.inf, 0.0)[0], 0.0)
        relative = {k: u[3 + 2 * k] - slope * x for k, slope in r1.items()}
        return x, impulse, relative | {FINGER: self.opening(u, alone)}

    def gaps(self, u):
        """Return the heights [m] of the jacks, and of a finger, over the key."""
        return {n: y - self.rise(j, u[0])[0] for n, (j, y) in enumerate(self.standing(u))}

    def opening(self, u, speed):
        """Return the speed [m/s] of the gap between the finger and a key of a speed [rad/s]."""
        return np.inf

    def placed(self, u):
        """Return a state with the finger on the key, which it touches but for rounding."""
        return u

    def struck(self, u, impulse, rub):
        """Return a state after an impulse [N s] of the finger on the key."""
        return u

    # Events

    def guards(self):
        """Return (name, jack, function of the state), each positive in this mode."""
        out = []
        if self.stick:
            out += [("slip", None, lambda u: self.resting(u)[1])]
            out += [("slip", None, lambda u: min(self.resting(u)[0], 1.0))]
        else:
            s = self.sign
            out.append(("stop", None, lambda u: s * u[1]))
            if s < 0:
                out.append(("rail", None, lambda u: u[0]))
        if self.scene.felt:
            push = 1 if self.felt else -1
            out.append(("felt", None, lambda u: push * self.pressure(u)))
        for k, j in enumerate(self.jacks):
            out += [(name, k, guard) for name, guard in self.jack_guards(k, j)]
        return out

    def jack_guards(self, k, j):
        """Yield (name, function of the state) of one jack and its string."""
        i, f = 2 + 2 * k, self.friction(j)
        sign, side = j.sign, 1 if j.damped else -1  # of this mode

        def h(u):
            return self.height(j, u[i])

        if j.on:
            yield "leave", lambda u: self.accelerations(u)[2][k]
        else:
            yield "land", lambda u: u[i] - self.rise(j, u[0])[0] + APART
            if sign:
                yield "halt", lambda u: sign * u[i + 1]
            else:
                yield "start", lambda u: f - abs(self.load(j, u[i]))
        if j.state == "below":
            yield "contact", lambda u: -h(u)
        elif j.state == "held":
            yield "withdraw", h
            yield "release", lambda u: j.curve.release - h(u)
        elif j.state == "above":
            yield "pass", h
        else:
            yield "back", lambda u: -h(u)
            yield "return", lambda u: h(u) + self.travel(j)
        if self.scene.damper:
            yield "damper", lambda u: side * (j.jack.damper.lift - u[i])

    def near(self):
        """Return what stands on the key: choirs, and the finger."""
        return [FINGER] * self.touch + [n for n, j in enumerate(self.jacks) if j.on]

    def event(self, name, k, u):
        """Change the discrete state at an event, set the state on it, and return who is near."""
        near = standing = self.near()
        if name == "stop":
            u[1] = 0.0
        elif name == "rail":
            u[0] = 0.0
        elif name == "felt":
            self.felt = not self.felt
        elif name == "land":
            near = sorted({*near, k} | {n for n, gap in self.gaps(u).items() if gap < CLOSE})
            self.found.landings.append((self.time, k))
        elif name == "leave":
            self.found.leavings.append((self.time, k))
        elif name == "halt":
            u[3 + 2 * k] = 0.0
        elif name == "damper":
            self.jacks[k].damped = not self.jacks[k].damped
        elif name in PLUCKING:
            self.pluck(name, k)
        return self.on_key(u, near, standing), near

    def on_key(self, u, near, standing):
        """Return the state with what is near on the key, at its speed what stood there before."""
        for n in near:
            if n == FINGER:
                u = self.placed(u)
                continue
            u[2 + 2 * n] = self.rise(self.jacks[n], u[0])[0]
            if n in standing:
                u[3 + 2 * n] = self.rise(self.jacks[n], u[0])[1] * u[1]
        return u

    def pluck(self, name, k):
        """Change the state of a string and its plectrum."""
        j = self.jacks[k]
        j.state = "passing" if name == "pass" and self.scene.tongue else PLUCKING[name]
        if name == "contact":
            j.curve.last = -1.0
            self.found.contacts.append((self.time, k, 0.0))
        elif name == "release":
            self.found.releases.append((self.time, k, j.curve.release_force))
        elif name == "return" or (name == "pass" and not self.scene.tongue):
            self.found.returns.append((self.time, k, -self.tongue(j, self.travel(j))))

    def begin(self):
        """Return the first state."""
        return np.zeros(2 + 2 * len(self.jacks))

    def ends(self, end):
        """Return the times [s] at which the equations change by themselves."""
        return [t for t in (self.push.duration,) if t < end] + [end]

    def renew(self, u):
        """Return the state at one of these times."""
        return u

    def overlap(self, piece):
        """Return a time [s] of an overlap in a piece that its steps did not find."""

    def solve(self, end, times=()):
        """Return the solution from rest to a time [s], with its motion at other times [s]."""
        u, ends = self.renew(self.begin()), self.ends(end)
        self.choose(u, range(len(self.jacks)))
        first = SHORTEST
        for _ in range(5000):
            guards = self.guards()
            watches = []
            for *_, guard in guards:

                def watch(_, u, guard=guard):
                    return guard(u)

                watch.terminal, watch.direction = True, -1
                watches.append(watch)
            start, until = self.time, ends[0]
            while until:
                piece = solve_ivp(
                    self.right,
                    (start, until),
                    u,
                    "DOP853",
                    rtol=RELATIVE,
                    atol=1e-15,
                    max_step=LONGEST,
                    first_step=min(first, until - start),
                    events=watches,
                    dense_output=True,
                )
                until = self.overlap(piece)
            for t in times[slice(*np.searchsorted(times, (start, piece.t[-1])))]:
                self.found.motion.append(self.observed(t, piece.sol(t)))
            self.time, u = piece.t[-1], piece.y[:, -1].copy()
            self.found.bends.append(self.time)
            hit = [n for n, found in enumerate(piece.t_events) if len(found)]
            near = set(self.near())
            for n in hit:
                name, k, _ = guards[n]
                u, now = self.event(name, k, u)
                near |= set(now)
            near -= {guards[n][1] for n in hit if guards[n][0] == "leave"}
            first = SHORTEST if hit else LONGEST
            if not hit:
                if self.time == end:
                    return self.found
                self.time = ends.pop(0)
                u = self.renew(u)
            before = u[1]
            u, touching = self.impact(u, sorted(near))
            if self.scene.felt and abs(u[1] - before) > 1e-9:  # the felt's damper sees a jump
                self.felt = self.pressure(u) > 0
            self.choose(u, touching)
        raise AssertionError(f"5000 events by {self.time} s")


def solve(rig, scene, end, times=()):
    """Return the `Solution` of a scene with `push` and the elastica, from 0 to a time [s]."""
    return Oracle(scene.true_rig(rig), scene).solve(end, times)

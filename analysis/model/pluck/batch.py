"""Predictions of many presses at once, for sweeps: the elastica and the spring string."""

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.key import felt_force
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.pluck.many import Branch, Cases, Status, ramp
from sautereau.analysis.model.pluck.pluck import OVERLAP_MAX, STIFFNESS_RANGE
from sautereau.analysis.model.pluck.table import table
from sautereau.rig.schema import Rig
from sautereau.rig.section import GRAVITY

CHUNK = 192
"""Cases that are computed together, few enough for the processor's cache."""
NARROWINGS = 4
"""Times that a peak inside the pluck is looked for, each between two neighbours of the last."""
VARIABLES = (
    *(f"plectrum.{n}" for n in ("youngs_modulus", "width", "thickness", "length", "overlap")),
    *(f"string.{n}" for n in ("tension", "length", "plucking_point", "frequency")),
    *(f"jack.{n}" for n in ("mass", "register_friction", "string_clearance")),
    *(f"key.{n}" for n in ("press_arm", "jack_arm", "jack_surface_height", "inertia")),
    *(f"key.{n}" for n in ("gravity_moment", "pivot_coulomb_friction", "pivot_viscous_friction")),
    *(f"key.{n}" for n in ("dip", "felt_stiffness", "felt_damping")),
    *(f"press.{n}" for n in ("jack_speed", "jack_rise")),
)
"""Values of a rig that may differ from case to case, SI."""
DERIVED = ("plectrum.bending_stiffness", "string.static_stiffness")
"""Values that may be given in place of those they follow from, SI."""


@dataclass(frozen=True)
class Sweep:
    """Scalars of many predictions; arrays of the shape to which the values broadcast."""

    contact_duration: Floats
    """s."""
    release_force: Floats
    """N, between plectrum and string."""
    release_lift: Floats
    """m, of the string."""
    release_angle: Floats
    """rad, of the plectrum under the string."""
    finger_force_peak: Floats
    """N."""
    v_osc: Floats
    """m/s, of the released string."""
    status: NDArray[np.int8]
    """A `Status` each; where it is neither RELEASED nor GIVES_WAY the scalars are NaN."""

    def statuses(self) -> dict[Status, int]:
        """Return how many cases ended in which way."""
        values, counts = np.unique(self.status, return_counts=True)
        return {Status(v): int(n) for v, n in zip(values, counts, strict=True)}


def predict_many(rig: Rig, values: Mapping[str, ArrayLike]) -> Sweep:
    """Predict presses of a rig that differ in some of its values.

    Args:
        rig: The bench; its first choir must be its only one.
        values: SI, by their dotted names in the rig, of `VARIABLES` or `DERIVED`; broadcast
            together. ``plectrum.friction`` may be given too, as one number.

    Raises:
        ModelError: A name is none of these, the shapes do not fit, the friction is not one
            number within 0 to 0.5, or the rig has more choirs. What is wrong with one case
            is said by its status alone.
    """
    given = {name: np.asarray(value, float) for name, value in values.items()}
    friction = given.pop("plectrum.friction", np.asarray(rig.plectrum.friction))
    _check(rig, given, friction)
    try:
        shape = np.broadcast_shapes(*(v.shape for v in given.values()))
    except ValueError as error:
        shapes = ", ".join(f"{name} {v.shape}" for name, v in given.items())
        raise ModelError(f"values: shapes do not fit together: {shapes}; {error}") from None
    of_rig = {name: _of(rig, name) for name in VARIABLES}
    varying = {n: np.broadcast_to(v, shape).ravel() for n, v in given.items() if v.ndim}
    fixed = of_rig | {name: float(v) for name, v in given.items() if not v.ndim}
    count = int(np.prod(shape))
    results = [np.empty(count, np.int8 if f.name == "status" else float) for f in fields(Sweep)]
    lookup = table(float(friction))
    for start in range(0, count, CHUNK):
        part = slice(start, min(start + CHUNK, count))
        chunk = fixed | {name: v[part] for name, v in varying.items()}
        chunk = {n: np.broadcast_to(v, (part.stop - start,)) for n, v in chunk.items()}
        with np.errstate(all="ignore"):
            found = _chunk(lookup, chunk)
        for result, value in zip(results, found, strict=True):
            result[part] = value
    return Sweep(*(result.reshape(shape) for result in results))


def _of(rig: Rig, name: str) -> float:
    section, field = name.split(".")
    return getattr(getattr(rig, section), field)


def _check(rig: Rig, given: Mapping[str, Floats], friction: Floats) -> None:
    faults = []
    unknown = sorted(set(given) - {*VARIABLES, *DERIVED})
    if unknown:
        names = ", ".join((*VARIABLES, *DERIVED, "plectrum.friction"))
        faults.append(f"values: {', '.join(unknown)} cannot be varied; take some of {names}")
    if friction.size != 1 or not 0 <= friction.flat[0] <= 0.5:
        faults.append(
            "plectrum.friction: it must be one number within 0 to 0.5 for the whole batch; call"
            " once for each friction"
        )
    if rig.more_choirs:
        faults.append(
            f"more_choirs: the rig has {len(rig.more_choirs)}, and a batch is of one choir; use"
            " predict, or take them out"
        )
    if faults:
        raise ModelError("\n".join(faults))


def _chunk(lookup, v: Mapping[str, Floats]) -> tuple[np.ndarray, ...]:
    """Return the fields of `Sweep` for cases of shape (n,)."""
    modulus, width, thickness, length, overlap = (v[n] for n in VARIABLES[:5])
    tension, string_length, plucking_point, frequency = (v[n] for n in VARIABLES[5:9])
    speed, clearance = v["press.jack_speed"], v["jack.string_clearance"]
    b = plucking_point / string_length
    bending = v.get(DERIVED[0], modulus * width * thickness**3 / 12)
    stiffness = v.get(DERIVED[1], tension / (string_length * b * (1 - b)))
    ranges = {
        Status.KEY_OUT_OF_RANGE: _key_in_range(v),
        Status.PRESS_OUT_OF_RANGE: _positive(speed) & _positive(clearance),
        Status.STRING_OUT_OF_RANGE: (stiffness >= STIFFNESS_RANGE[0])
        & (stiffness <= STIFFNESS_RANGE[1])
        & _positive(frequency)
        & (b > 0)
        & (b < 1),
        Status.OVERLAP_OUT_OF_RANGE: (overlap > 0) & (overlap <= OVERLAP_MAX * length),
        Status.PLECTRUM_OUT_OF_RANGE: _positive(bending) & _positive(length),
    }
    sound = np.logical_and.reduce(list(ranges.values()))
    k = np.where(sound, bending / (stiffness * length**3), 1.0)
    cases = Cases(lookup, k, np.where(sound, overlap / length, 0.1))
    slide, stick, status = cases.solve()
    for name, within in ranges.items():
        status[~within] = name
    rise = clearance + length * slide.height[:, -1]
    ended = status <= Status.GIVES_WAY
    # Written so that a rise that is no number is too short.
    status[ended & ~(rise < v["press.jack_rise"])] = Status.PRESS_TOO_SHORT
    force = bending * slide.q[:, -1] / (length * slide.s[:, -1]) ** 2
    lift = length * slide.lift[:, -1]
    scalars = (
        (rise - clearance) / speed,
        force,
        lift,
        np.arctan2(slide.sine[:, -1], slide.cosine[:, -1]),
        _finger_force_peak(v, length, stiffness, cases, (slide, stick)),
        frequency * lift / (b * (1 - b)),
    )
    failed = status > Status.GIVES_WAY
    return (*(np.where(failed, np.nan, scalar) for scalar in scalars), status)


def _positive(value: Floats) -> np.ndarray:
    return (value > 0) & (value < np.inf)


def _key_in_range(v: Mapping[str, Floats]) -> np.ndarray:
    """Return where arms and inertias are above 0 and the rest finite."""
    names = ("key.press_arm", "key.jack_arm", "key.inertia", "jack.mass")
    positive = [_positive(v[name]) for name in names]
    rest = ("key.gravity_moment", "key.jack_surface_height", "key.pivot_coulomb_friction")
    rest = (*rest, "key.pivot_viscous_friction", "jack.register_friction")
    rest = (*rest, "key.dip", "key.felt_stiffness", "key.felt_damping")
    return np.logical_and.reduce([*positive, *(np.isfinite(v[name]) for name in rest)])


def _finger_force_peak(
    v: Mapping[str, Floats],
    length: Floats,
    stiffness: Floats,
    cases: Cases,
    branches: tuple[Branch, Branch | None],
) -> Floats:
    """Return the largest force [N] of the finger over the press."""
    clearance, end = v["jack.string_clearance"], v["press.jack_rise"]
    free = np.stack([np.zeros_like(end), clearance, end], axis=1)
    peak = _finger_force(v, free, np.zeros_like(free)).max(axis=1)
    for branch, again in zip(branches, (Cases.slide, Cases.stick), strict=True):
        if branch is None:
            continue
        rows = np.arange(len(end))
        for _ in range(NARROWINGS):
            rise = clearance[rows, None] + length[rows, None] * branch.height
            string = (stiffness * length)[rows, None] * branch.lift
            force = _finger_force({n: value[rows] for n, value in v.items()}, rise, string)
            peak[rows] = np.fmax(peak[rows], force.max(axis=1))
            top = np.argmax(force, axis=1)
            last = force.shape[1] - 1
            # A rise that falls off towards the end may have its peak between the last two.
            fading = 2 * (force[:, -1] - force[:, -2]) < force[:, -2] - force[:, -3]
            inner = np.flatnonzero((top > 0) & ((top < last) | fading))
            if len(inner) == 0:
                break
            top = top[inner]
            low, high = branch.q[inner, top - 1], branch.q[inner, np.minimum(top + 1, last)]
            rows = rows[inner]
            branch = again(Cases(cases.table, cases.k[rows], cases.o[rows]), ramp(low, high))
    return peak


def _finger_force(v: Mapping[str, Floats], rise: Floats, string: Floats) -> Floats:
    """Return the force [N] of the finger at rises [m] of a jack at constant speed.

    `sautereau.analysis.model.key.finger_force` with the trigonometry of
    `sautereau.trajectory.key` written in the tangent of half the angle; rise and string
    force of shape (cases, points).
    """
    c = {name.split(".")[1]: value[:, None] for name, value in v.items() if name[0] in "jkp"}
    b, hb = c["jack_arm"], c["jack_surface_height"]
    half = rise / (b + np.sqrt(b**2 + rise * (2 * hb + rise)))
    cosine, sine = (1 - half**2) / (1 + half**2), 2 * half / (1 + half**2)
    slope = (b + hb * sine) / cosine**2
    spin = c["jack_speed"] / slope
    curvature = (2 * b * sine + hb * (1 + sine**2)) / cosine**3
    moment = -c["inertia"] * curvature * spin**2 / slope - c["gravity_moment"]
    moment = moment + c["pivot_coulomb_friction"] + c["pivot_viscous_friction"] * spin
    load = c["mass"] * GRAVITY + string + c["register_friction"]
    arm = c["press_arm"]
    travel, speed = arm * 2 * np.arctan(half), arm * spin
    felt = felt_force(travel, speed, c["dip"], c["felt_stiffness"], c["felt_damping"])
    return (moment + load * slope) / arm + felt

"""Predictions of many presses at once, with the spring string, at the level `auto`."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from operator import attrgetter
from types import SimpleNamespace
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.choirs import LIFT_MAX
from sautereau.analysis.model.key import required_force
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.model.plectrum.elastica import REACHES, Elastica, uniform_table
from sautereau.analysis.model.plectrum.levels import AUTO, plectrum_map
from sautereau.analysis.model.pluck.equilibria import Equilibria
from sautereau.analysis.model.pluck.loaded import Rows, TabledPlectra
from sautereau.analysis.model.pluck.paths import Paths, Status, ramp, solve_paths
from sautereau.analysis.model.pluck.pluck import OVERLAP_MAX, STIFFNESS_RANGE
from sautereau.rig.instrument import Key
from sautereau.rig.schema import Rig
from sautereau.rig.units import GRAVITY
from sautereau.trajectory.key import key_motion, rise_slope
from sautereau.trajectory.motion import Motion

POINTS = 33  # Points of a stretch that sticks or slides
CHUNK = 768  # Cases that are computed together, few enough to fit into the processor's cache
_SHAPE = ("plectrum.thickness", "plectrum.length", "plectrum.overlap")  # Of a table, unless uniform
VARIABLES = (
    "plectrum.youngs_modulus",
    "plectrum.width",
    *_SHAPE,
    *(f"string.{n}" for n in ("tension", "length", "plucking_point", "frequency", "diameter")),
    *(f"jack.{n}" for n in ("mass", "register_friction", "string_clearance")),
    *(f"key.{n}" for n in ("press_arm", "surface_height", "jack_arm", "jack_surface_height")),
    "key.inertia",
    *(f"key.{n}" for n in ("gravity_moment", "pivot_coulomb_friction", "pivot_viscous_friction")),
    *(f"key.{n}" for n in ("dip", "felt_stiffness", "felt_damping")),
    *(f"press.{n}" for n in ("jack_speed", "jack_rise")),
    "arm.fingertip_friction",
)  # Values of a rig that may vary between cases, SI
DERIVED = ("plectrum.bending_stiffness", "string.static_stiffness")  # Instead of their factors


@dataclass(frozen=True)
class PredictionBatch:
    """Scalars of many predictions; arrays of the shape to which the values broadcast."""

    pluck_duration: Floats
    """s."""
    plectrum_force: Floats
    """N, between plectrum and string."""
    release_lift: Floats
    """m, of the string."""
    release_angle: Floats
    """rad, of the plectrum under the string."""
    peak_force: Floats
    """N."""
    v_osc: Floats
    """m/s, of the released string."""
    status: NDArray[np.int8]
    """A `Status` each; the scalars are NaN unless it is RELEASED or RELEASED_AT_FOLD."""


def predict_many(rig: Rig, values: Mapping[str, ArrayLike]) -> PredictionBatch:
    """Predict presses of a rig that differ in some of its values.

    Args:
        rig: The bench, with one choir.
        values: SI, by their dotted names in the rig, of `VARIABLES` or `DERIVED`; broadcast
            together. ``plectrum.friction`` may be given too, as one number.

    Raises:
        ModelError: A name is none of these, the shapes do not fit, the friction is not one
            number within 0 to 0.5, or the rig has more choirs. A single case out of
            range is reported by its status only.
    """
    given = {name: np.asarray(value, float) for name, value in values.items()}
    friction = given.pop("plectrum.friction", np.asarray(rig.plectrum.friction))
    _check(rig, given, friction)
    try:
        shape = np.broadcast_shapes(*(v.shape for v in given.values()))
    except ValueError as error:
        shapes = ", ".join(f"{name} {v.shape}" for name, v in given.items())
        raise ModelError(f"values: shapes do not fit together: {shapes}; {error}") from None
    of_rig = {name: attrgetter(name)(rig) for name in VARIABLES}
    varying = {n: np.broadcast_to(v, shape).ravel() for n, v in given.items() if v.ndim}
    fixed = of_rig | {name: float(v) for name, v in given.items() if not v.ndim}
    count = int(np.prod(shape))
    results = [
        np.empty(count, np.int8 if f.name == "status" else float) for f in fields(PredictionBatch)
    ]
    # glibc returns large blocks to the kernel at once, and new ones cost page faults: half of the
    # time. Freeing a larger block raises what it calls large.
    np.empty(2**19)
    shapes = np.stack([np.broadcast_to((fixed | varying)[name], count) for name in _SHAPE])
    for rows in _groups(rig, shapes):
        shape_of = _map(rig, float(friction), shapes[:, rows[0]]) if len(rows) else None
        for start in range(0, len(rows), CHUNK):
            part = rows[start : start + CHUNK]
            chunk = fixed | {name: v[part] for name, v in varying.items()}
            chunk = {n: np.broadcast_to(v, len(part)) for n, v in chunk.items()}
            with np.errstate(all="ignore"):
                found = _chunk(rig, float(friction), chunk, shape_of)
            for result, value in zip(results, found, strict=True):
                result[part] = value
    return PredictionBatch(*(result.reshape(shape) for result in results))


def _check(rig: Rig, given: Mapping[str, Floats], friction: Floats) -> None:
    faults = []
    unknown = sorted(set(given) - {*VARIABLES, *DERIVED})
    if unknown:
        names = ", ".join((*VARIABLES, *DERIVED, "plectrum.friction"))
        faults.append(f"values: {', '.join(unknown)} cannot be varied; use some of {names}")
    if friction.size != 1 or not 0 <= friction.flat[0] <= 0.5:
        faults.append(
            "plectrum.friction: it must be one number within 0 to 0.5 for all cases; call once"
            " for each friction"
        )
    if rig.plectrum.described and (derived := sorted(set(given) & {*DERIVED})):
        faults.append(
            f"values: {', '.join(derived)} cannot be given for a plectrum with"
            f" {' and '.join(rig.plectrum.described)}; give plectrum.youngs_modulus or the tension"
        )
    if rig.plectrum.outline is not None and (fixed := sorted(set(given) & {*_SHAPE[:2]})):
        faults.append(
            f"values: {', '.join(fixed)} cannot be varied: plectrum.outline has the length and the"
            " thickness; change the outline"
        )
    if rig.more_choirs:
        faults.append(
            f"more_choirs: the rig has {len(rig.more_choirs)}, but a batch has one string; use"
            " predict, or remove them"
        )
    if faults:
        raise ModelError("\n".join(faults))


def _groups(rig: Rig, shapes: Floats) -> list[Rows]:
    """Return the rows of the cases whose plectra have one table.

    Args:
        shapes: The values of `_SHAPE`, shape (3, cases).
    """
    if not rig.plectrum.described:
        return [np.arange(shapes.shape[1])]
    thickness, length, overlap = shapes
    with np.errstate(all="ignore"):
        reach = np.searchsorted([most for most, _ in REACHES], overlap / length)
    _, group = np.unique(np.stack([thickness, length, reach]), axis=1, return_inverse=True)
    return [np.flatnonzero(group == number) for number in range(group.max(initial=-1) + 1)]


def _map(rig: Rig, friction: float, shape: Floats) -> Elastica | None:
    """Return the map of a plectrum of some values of `_SHAPE`; None if it has none."""
    if not rig.plectrum.described:
        return Elastica(rig.plectrum.model_copy(update={"friction": friction}))
    values = dict(zip((name.split(".")[1] for name in _SHAPE), shape.tolist(), strict=True))
    try:
        plectrum = rig.plectrum.model_copy(update=values | {"friction": friction})
        found = plectrum_map(plectrum, AUTO)
    except ModelError:
        return None
    return found if isinstance(found, Elastica) else None


def _chunk(
    rig: Rig, friction: float, v: Mapping[str, Floats], shape_of: Elastica | None
) -> tuple[np.ndarray, ...]:
    """Return the fields of `PredictionBatch` for cases of shape (n,) and of one table."""
    modulus, width, thickness, length, overlap = (v[n] for n in VARIABLES[:5])
    tension, string_length, plucking_point, frequency, diameter = (v[n] for n in VARIABLES[5:10])
    speed, clearance = v["press.jack_speed"], v["jack.string_clearance"]
    b = plucking_point / string_length
    if rig.plectrum.outline is not None and shape_of:
        thickness = np.full_like(thickness, shape_of.clamp_thickness)
    bending = v.get(DERIVED[0], rig.plectrum.ageing * modulus * width * thickness**3 / 12)
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
        Status.PLECTRUM_OUT_OF_RANGE: _positive(bending)
        & _positive(length)
        & _positive(thickness)
        & _positive(diameter),
    }
    if shape_of is None:
        ranges[Status.NOT_CONVERGED] = np.zeros(len(length), bool)
    sound = np.logical_and.reduce(list(ranges.values()))
    surface = rig.plectrum.contact == "surface"
    half, radius = (thickness / 2, diameter / 2) if surface else np.zeros((2, len(length)))
    values = length, bending, overlap, half, radius, stiffness
    values = np.where(sound, values, [[1.0], [1.0], [0.1], [0.0], [0.0], [1.0]])
    table = shape_of.table if shape_of else uniform_table()
    plectra = TabledPlectra(table, friction, *values[:5])
    overlap, stiffness = values[[2, 5]]
    equilibria = Equilibria(plectra, stiffness, overlap)
    paths = solve_paths(equilibria, POINTS)
    slide, status = paths.curves[-1], paths.status
    for name, within in ranges.items():
        status[~within] = name
    height, lift = slide.height[:, -1], slide.lift[:, -1]
    ended = status <= Status.RELEASED_AT_FOLD
    # Written so that NaN counts as too short.
    status[ended & ~(clearance + height < v["press.jack_rise"])] = Status.PRESS_TOO_SHORT
    nearer = np.minimum(plucking_point, string_length - plucking_point)
    status[ended & ~(lift <= LIFT_MAX * nearer)] = Status.STRING_OUT_OF_RANGE
    scalars = (
        height / speed,
        slide.string_force[:, -1],
        lift,
        slide.angle[:, -1],
        _peak_force(v, equilibria, paths),
        frequency * lift / (b * (1 - b)),
    )
    failed = status > Status.RELEASED_AT_FOLD
    return (*(np.where(failed, np.nan, scalar) for scalar in scalars), status)


def _positive(value: Floats) -> np.ndarray:
    return (value > 0) & (value < np.inf)


def _key_in_range(v: Mapping[str, Floats]) -> np.ndarray:
    """Return which cases have positive arms and inertias and finite other values."""
    names = ("key.press_arm", "key.jack_arm", "key.inertia", "jack.mass")
    positive = [_positive(v[name]) for name in names]
    rest = [name for name in VARIABLES if name.startswith(("key.", "jack.", "arm."))]
    return np.logical_and.reduce([*positive, *(np.isfinite(v[name]) for name in rest)])


def _peak_force(v: Mapping[str, Floats], equilibria: Equilibria, paths: Paths) -> Floats:
    """Return the largest force [N] of the finger over the press, shape (cases,)."""
    clearance, end = v["jack.string_clearance"], v["press.jack_rise"]
    free = np.stack([np.zeros_like(end), clearance, end], axis=1)
    peak = _finger_force(v, free, np.zeros_like(free)).max(axis=1)
    for kind, curve in zip(paths.kinds, paths.curves, strict=True):
        rows, some = np.arange(len(end)), equilibria
        for _ in range(4):  # Each between the last neighbours
            string = some.stiffness * curve.lift
            rise = clearance[rows, None] + curve.height
            force = _finger_force({n: value[rows] for n, value in v.items()}, rise, string)
            peak[rows] = np.fmax(peak[rows], force.max(axis=1))
            top = np.argmax(force, axis=1)
            last = force.shape[1] - 1
            # If the increase fades towards the end, the peak may lie between the last two.
            fading = 2 * (force[:, -1] - force[:, -2]) < force[:, -2] - force[:, -3]
            inner = np.flatnonzero((top > 0) & ((top < last) | fading))
            if len(inner) == 0:
                break
            top = top[inner]
            low, high = curve.load[inner, top - 1], curve.load[inner, np.minimum(top + 1, last)]
            rows, some = rows[inner], some.subset(inner)
            curve = kind.at(some, ramp(low, high, POINTS))
    return peak


def _finger_force(v: Mapping[str, Floats], rise: Floats, string: Floats) -> Floats:
    """Return the force [N] of the finger at rises [m] of a jack at constant speed.

    Rise and string force of shape (cases, points).
    """
    c = {name.split(".")[1]: value[:, None] for name, value in v.items() if name[0] in "ajkp"}
    key = cast(Key, SimpleNamespace(**c))
    angle, spin, acceleration = key_motion(key, Motion(rise, c["jack_speed"], np.zeros(1)))
    load = c["mass"] * GRAVITY + string + c["register_friction"]
    return required_force(c, angle, spin, acceleration, load * rise_slope(key, angle))

"""Values of a scene that may vary between presses, their limits, and the strings' force laws."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.choirs import choirs
from sautereau.analysis.model.pluck.pluck import OVERLAP_MAX, STIFFNESS_RANGE
from sautereau.rig.instrument import Choir, Damper, Jack, Key, Plectrum, String, Tongue
from sautereau.rig.schema import Rig
from sautereau.rig.section import GRAVITY, Section
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.parts import Push
from sautereau.sim_backend.physics.exact.laws import (
    Laws,
    choir_law,
    elastica_laws,
    joined,
    mute_law,
)
from sautereau.sim_backend.physics.exact.parameters import Numbers, choir_prefixes
from sautereau.sim_backend.scene import Scene
from sautereau.trajectory.motion import Floats

CHUNK = 192
"""Plucks that are solved together; limited by the processor's cache."""
_LEVER = ("press_arm", "jack_arm", "jack_surface_height", "inertia", "gravity_moment")
_PLECTRUM = ("youngs_modulus", "width", "thickness", "length", "overlap", "friction")
_STRING = ("tension", "length", "plucking_point", "diameter")
_LIMITS = {"gt": np.greater, "ge": np.greater_equal, "lt": np.less, "le": np.less_equal}
_DERIVED = ("plectrum.bending_stiffness", "string.static_stiffness")


def variables(rig: Rig, scene: Scene) -> dict[str, tuple[type[Section], str] | None]:
    """Return the keys that may vary in a scene, each with its model and field.

    Derived quantities of the elastica, `plectrum.bending_stiffness` and `string.static_stiffness`,
    have None: they may be given instead of the values from which they follow.
    """
    found: dict[str, tuple[type[Section], str] | None] = {}

    def add(prefix: str, model: type[Section], *names: str) -> None:
        found.update({f"{prefix}.{name}": (model, name) for name in names})

    add("key", Key, *_LEVER)
    if scene.friction:
        add("key", Key, "pivot_coulomb_friction", "pivot_viscous_friction")
    if scene.felt:
        add("key", Key, "dip", "felt_stiffness", "felt_damping")
    if scene.push:
        add("push", Push, "force", "duration")
    for at in choir_prefixes(rig):
        if at:
            add(at[:-1], Choir, "jack_arm")
        add(f"{at}jack", Jack, "mass", *(("register_friction",) if scene.friction else ()))
        if scene.damper:
            add(f"{at}jack.damper", Damper, "lift", "stiffness")
        if scene.tongue:
            add(f"{at}jack.tongue", Tongue, "pivot", "bristle_moment", "bristle_stiffness")
        if scene.plectrum != "none":
            add(f"{at}jack", Jack, "string_clearance")
            add(f"{at}plectrum", Plectrum, *_PLECTRUM)
            add(f"{at}string", String, *_STRING)
        if scene.plectrum == "elastica":
            found.update({f"{at}{name}": None for name in _DERIVED})
    return found


def within_limits(numbers: Numbers, presses: int) -> NDArray[np.bool_]:
    """Return the presses with all values within their limits; bool, shape (presses,)."""
    good = np.ones(presses, bool)
    known = variables(numbers.rig, numbers.scene)
    for name, value in numbers.given.items():
        good &= np.isfinite(value)
        place = known[name]
        if not place:
            good &= value > 0
            continue
        model, field = place
        for limit in model.model_fields[field].metadata:
            for bound, holds in _LIMITS.items():
                if hasattr(limit, bound):
                    good &= holds(value, getattr(limit, bound))
    for at in choir_prefixes(numbers.rig):
        good &= numbers(f"{at}string.plucking_point") < numbers(f"{at}string.length")
        good &= numbers(f"{at}plectrum.overlap") < numbers(f"{at}plectrum.length")
    back = numbers("jack.mass") * GRAVITY * numbers("key.jack_arm")
    return good & (numbers("key.gravity_moment") < back)


def varied_laws(
    numbers: Numbers, played: NDArray[np.bool_]
) -> tuple[Floats, NDArray[Any], NDArray[np.bool_]]:
    """Return the force laws of all strings, and the presses that have a pluck.

    Args:
        numbers: Values of the keys.
        played: Presses with values within their limits; shape (presses,).

    Returns:
        Cells of the laws; the laws as `JACK`s, shape (presses, choirs); whether each press has a
        pluck, shape (presses,).

    Raises:
        SceneError: A plectrum and string that do not vary have no pluck.
    """
    plucks = np.ones(len(played), bool)
    prefixes = choir_prefixes(numbers.rig)
    rows = np.zeros((len(played), len(prefixes)), np.int64)
    if numbers.scene.plectrum == "none":
        law = mute_law()
        return law.cells, law.jacks[rows], plucks
    found: list[Laws] = []
    count = 0
    for k, (at, choir) in enumerate(zip(prefixes, choirs(numbers.rig), strict=True)):
        names = [f"{at}plectrum.{n}" for n in _PLECTRUM] + [f"{at}string.{n}" for n in _STRING]
        names += [f"{at}{name}" for name in _DERIVED]
        if not numbers.varies(names):
            try:
                laws = [choir_law(choir, numbers.scene.plectrum)]
            except ModelError as error:
                raise SceneError(f"rig {numbers.rig.name}: {at}{error}") from error
            which, good = np.zeros(len(played), np.int64), np.ones(1, bool)
        elif numbers.scene.plectrum == "elastica":
            laws, which, good = _elastica(numbers, at, choir, played)
        else:
            laws, which, good = _one_by_one(numbers, at, choir, played)
        rows[:, k] = count + which
        plucks &= good[which]
        found += laws
        count += len(good)
    laws = joined(found)
    return laws.cells, laws.jacks[rows], plucks


def _elastica(
    numbers: Numbers, at: str, choir: Choir, played: NDArray[np.bool_]
) -> tuple[list[Laws], NDArray[np.int64], NDArray[np.bool_]]:
    names = ("friction", "overlap", "length", "thickness", "width", "youngs_modulus")
    friction, overlap, length, thick, wide, modulus = (numbers(f"{at}plectrum.{n}") for n in names)
    tension, span, place, diameter = (numbers(f"{at}string.{name}") for name in _STRING)
    bending, stiffness = (numbers.given.get(f"{at}{name}") for name in _DERIVED)
    with np.errstate(all="ignore"):  # of presses that are not simulated
        if bending is None:
            bending = modulus * wide * thick**3 / 12
        if stiffness is None:
            stiffness = tension / (place * (1 - place / span))
    surface = choir.plectrum.contact == "surface"
    offset = (thick + diameter) / 2 if surface else 0.0
    columns = (friction, stiffness, overlap, bending, length, offset)
    different, which = _different(columns, played)
    friction, stiffness, overlap, bending, length, offset = different
    low, high = STIFFNESS_RANGE
    good = (stiffness >= low) & (stiffness <= high) & (overlap <= OVERLAP_MAX * length)
    stiffness, overlap = np.where(good, (stiffness, overlap), ([[1.0], [0.1]] * length))
    ends = np.flatnonzero(np.diff(friction)) + 1
    laws = []
    for start, end in zip([0, *ends], [*ends, len(friction)], strict=True):
        for first in range(start, end, CHUNK):
            part = slice(first, min(first + CHUNK, end))
            columns = (a[part] for a in (stiffness, overlap, bending, length, offset))
            solved, sure = elastica_laws(*columns, float(friction[start]))
            good[part] &= sure
            laws.append(solved)
    return laws, which, good


def _one_by_one(
    numbers: Numbers, at: str, choir: Choir, played: NDArray[np.bool_]
) -> tuple[list[Laws], NDArray[np.int64], NDArray[np.bool_]]:
    keys = [("plectrum", name) for name in _PLECTRUM] + [("string", name) for name in _STRING]
    different, which = _different([numbers(f"{at}{part}.{name}") for part, name in keys], played)
    good = np.ones(different.shape[1], bool)
    laws = []
    for row, values in enumerate(different.T.tolist()):
        parts: dict[str, dict[str, float]] = {"plectrum": {}, "string": {}}
        for (part, name), value in zip(keys, values, strict=True):
            parts[part][name] = value
        changed = {p: getattr(choir, p).model_copy(update=new) for p, new in parts.items()}
        try:
            laws.append(choir_law(choir.model_copy(update=changed), numbers.scene.plectrum))
        except ModelError:
            good[row] = False
            laws.append(mute_law())
    return laws, which, good


def _different(
    values: Sequence[Floats], played: NDArray[np.bool_]
) -> tuple[Floats, NDArray[np.int64]]:
    """Return the distinct columns among the valid presses, and the column of each press.

    Columns are in order of their first row. An invalid press has the first one.
    """
    table = np.stack([np.broadcast_to(value, played.shape) for value in values])
    different, inverse = np.unique(table[:, played], axis=1, return_inverse=True)
    which = np.zeros(len(played), np.int64)
    which[played] = inverse
    return different, which

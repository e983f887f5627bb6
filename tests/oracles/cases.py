"""Cases of the independent solution of the pluck, and their table `plucks.csv`.

`outlines.csv` holds the outlines as points, straight between them. Curved outlines are solved
exactly, not through these points: with them force and height differ by up to 0.06 and 0.1 %.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from math import sqrt, tan
from pathlib import Path

import numpy as np

from tests.oracles.outline import Curve, Outline, polygon, stepped
from tests.oracles.pluck import Release, pluck, string_stiffness

HERE = Path(__file__).parent
LENGTH, HALF = 4.5e-3, 0.24e-3
JACK_SPEED = 0.072  # In m/s


@dataclass(frozen=True)
class Case:
    """One pluck; SI units. The string and the plectrum's size are those of Table 1."""

    name: str
    outline: Outline
    shape: str
    """`uniform`, `stepped`, or the name of an outline in `outlines.csv`."""
    thicknesses: tuple[float, ...] = ()
    steps: tuple[float, ...] = ()
    modulus: float = 2.9e9
    width: float = 0.75e-3
    overlap: float = 0.263e-3
    friction: float = 0.0
    contact: str = "surface"
    tension: float = 66.95
    string_length: float = 0.46
    plucking_point: float = 0.108
    wire_diameter: float = 0.31e-3
    surface_moment: bool = False
    nodes: int = field(default=32, repr=False)

    def solve(self, tolerance: float = 1e-12, nodes: int | None = None) -> Release:
        """Return the release; see `pluck`."""
        return pluck(
            self.outline,
            modulus=self.modulus,
            width=self.width,
            overlap=self.overlap,
            stiffness=string_stiffness(self.tension, self.string_length, self.plucking_point),
            radius=self.wire_diameter / 2,
            friction=self.friction,
            contact=self.contact,
            tolerance=tolerance,
            nodes=nodes or self.nodes,
            surface_moment=self.surface_moment,
        )


def bars(seed: int = 7) -> Iterator[Case]:
    """Yield 12 uniform and 6 stepped bars with random numbers."""
    random = np.random.default_rng(seed)
    for i in range(18):
        contact = ("surface", "mid-line")[i % 2]
        friction = 0.0 if i % 3 == 0 else round(random.uniform(0.02, 0.3), 3)
        overlap = round(random.uniform(0.1, 0.4), 3) * 1e-3
        modulus = round(random.uniform(1, 6), 2) * 1e9
        if i < 12:
            t = (round(random.uniform(0.25, 0.6), 3) * 1e-3,)
            steps: tuple[float, ...] = ()
        else:
            count = 1 + i % 3
            t = tuple(round(x, 3) * 1e-3 for x in random.uniform(0.25, 0.6, count + 1))
            # the string slides on the last piece alone
            steps = tuple(sorted(round(x, 2) * 1e-3 for x in random.uniform(0.6, 3.4, count)))
        shape = "uniform" if i < 12 else "stepped"
        yield Case(
            f"{shape} {i + 1 if i < 12 else i - 11}",
            stepped(LENGTH, steps, t),
            shape,
            t,
            steps,
            modulus=modulus,
            overlap=overlap,
            friction=friction,
            contact=contact,
        )


def falling(start: float, fall: Curve, slope: Curve) -> Outline:
    """Return a bar whose top falls beyond `start` (m) by a curve of the distance from there."""
    return Outline(
        LENGTH,
        lambda x: HALF - fall(max(x - start, 0.0)),
        lambda _: -HALF,
        lambda x: -slope(max(x - start, 0.0)),
        lambda _: 0.0,
        (start,) if start > 0 else (),
    )


def rounded(radius: float, over: float) -> Outline:
    """Return a bar with an arc of a radius (m) over the last piece (m) of its top."""
    return falling(
        LENGTH - over,
        lambda d: radius - sqrt(radius**2 - d**2),
        lambda d: d / sqrt(radius**2 - d**2),
    )


def arched() -> Outline:
    """Return the bar whose top falls by a parabola, to a slope of 0.1 rad at the tip."""
    curvature = tan(0.1) / 2e-3
    return falling(2.5e-3, lambda d: curvature * d**2 / 2, lambda d: curvature * d)


def wedge() -> Outline:
    """Return the outline of the rig file `wedge.toml.txt`."""
    return polygon([0, 2e-3, LENGTH], [HALF] * 3, [-HALF, -HALF, -0.04e-3])


def noisy(rms: float = 2e-6, points: int = 100, seed: int = 3) -> Outline:
    """Return a uniform bar measured with noise (m) at points of both edges."""
    noise = np.random.default_rng(seed).normal(0.0, rms, (2, points)).round(8)
    x = np.linspace(0, LENGTH, points)
    return polygon(x.tolist(), (HALF + noise[0]).tolist(), (-HALF + noise[1]).tolist())


def outlines() -> dict[str, Outline]:
    """Return the outlines by name."""
    bevel = [0, 2.5e-3, 2.8e-3, LENGTH]
    thin = Outline(
        LENGTH,
        lambda _: HALF,
        lambda x: -HALF + 0.33e-3 * (x / LENGTH) ** 2,
        lambda _: 0.0,
        lambda x: 0.66e-3 * x / LENGTH**2,
    )
    return {
        "wedge": wedge(),
        "slope 0.05 from the clamp": falling(0.0, lambda d: tan(0.05) * d, lambda _: tan(0.05)),
        "slope 0.1 from 2.5 mm": polygon(
            [0, 2.5e-3, LENGTH], [HALF, HALF, HALF - tan(0.1) * 2e-3], [-HALF] * 3
        ),
        "both edges slope 0.1": polygon(
            [0, LENGTH], [HALF, HALF - tan(0.1) * LENGTH], [-HALF, -HALF - tan(0.1) * LENGTH]
        ),
        "arched": arched(),
        "rounded 2 mm": rounded(2e-3, 0.6e-3),
        "rounded 0.8 mm": rounded(0.8e-3, 0.3e-3),
        "rounded 0.4 mm": rounded(0.4e-3, 0.36e-3),
        "step in the top": polygon(bevel, [HALF, HALF, 0.14e-3, 0.14e-3], [-HALF] * 4),
        "step in the bottom": polygon(bevel, [HALF] * 4, [-HALF, -HALF, -0.14e-3, -0.14e-3]),
        "thin tip": thin,
        "carved": polygon(
            [0, 2.2e-3, 2.3e-3, 4e-3], [0.25e-3] * 4, [-0.25e-3, -0.25e-3, -0.07e-3, -0.07e-3]
        ),
        "noise": noisy(),
    }


def cases() -> Iterator[Case]:
    """Yield the cases of `plucks.csv`."""
    yield from bars()
    carved = {
        "width": 0.8e-3,
        "overlap": 0.35e-3,
        "tension": 50.0,
        "string_length": 0.4,
        "plucking_point": 0.09,
        "wire_diameter": 0.25e-3,
    }
    for name, outline in outlines().items():
        special = carved if name == "carved" else {}
        case = Case(name, outline, name, **special)
        if name == "rounded 0.4 mm":
            case = replace(case, nodes=64)  # the fold is found on the polynomials
        if name == "noise":
            averaged = replace(outline, patch=HALF)
            yield replace(case, name="noise + patch", outline=averaged, nodes=12)
            continue
        yield case
        flat = outline.top_slope(outline.length) == 0
        if name == "carved":
            yield replace(case, name="carved + friction 0.1", friction=0.1)
        if not flat:
            yield replace(case, name=f"{name} + load at the surface", surface_moment=True)
        if name.startswith(("rounded", "arched")):
            yield replace(case, name=f"{name} + patch", outline=replace(outline, patch=HALF))


def columns() -> dict[str, Callable[[Case, Release], object]]:
    """Return the columns of `plucks.csv`: inputs, then results."""
    inputs = (
        "modulus",
        "width",
        "overlap",
        "friction",
        "contact",
        "tension",
        "string_length",
        "plucking_point",
        "wire_diameter",
    )
    results = ("height", "force", "lift", "shift", "angle", "position", "work", "at")
    return {
        "case": lambda c, _: c.name,
        "shape": lambda c, _: c.shape,
        "length": lambda c, _: c.outline.length,
        "thicknesses": lambda c, _: " ".join(f"{t:.6g}" for t in c.thicknesses),
        "steps": lambda c, _: " ".join(f"{x:.6g}" for x in c.steps),
        **{name: lambda c, _, n=name: _number(getattr(c, n), 10) for name in inputs},
        "patch": lambda c, _: c.outline.patch,
        "surface_moment": lambda c, _: int(c.surface_moment),
        **{name: lambda _, r, n=name: _number(getattr(r, n), 12) for name in results},
        "duration": lambda _, r: _number(r.height / JACK_SPEED, 12),
    }


def _number(value: object, digits: int) -> object:
    return f"{value:.{digits}g}" if isinstance(value, float) else value


def write() -> None:
    """Write `plucks.csv` and `outlines.csv`."""
    table = columns()
    with (HERE / "plucks.csv").open("w", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(table)
        for case in cases():
            release = case.solve()
            rows.writerow([column(case, release) for column in table.values()])
            file.flush()
    with (HERE / "outlines.csv").open("w", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["shape", "x", "top", "bottom"])
        for name, outline in outlines().items():
            for x in points(name, outline):
                rows.writerow([name, *(f"{v:.9g}" for v in (x, outline.top(x), outline.bottom(x)))])


def points(name: str, outline: Outline) -> list[float]:
    """Return where an outline is given as points, in m: 200 pieces where it is curved."""
    ends = [0.0, *outline.breaks, outline.length]
    if not name.startswith(("arched", "rounded", "thin")):
        return ends
    return [*ends[:-2], *(float(x) for x in np.linspace(*ends[-2:], 201))]

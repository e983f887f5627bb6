"""The finite-element plectrum beside CalculiX: C3D20R bricks, large displacements.

CalculiX is an optional peer (Debian: calculix-ccx); without it one row says so. Its bricks
have the plectrum's width, free but for the clamp, where plane stress is our assumption; its
pressure turns with the faces that it acts on, as the string's does.
"""

import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.figures import Figure, check, timed
from sautereau.analysis.model.plectrum.elastica import REACHES
from sautereau.analysis.model.plectrum.fe.build import build
from sautereau.analysis.model.plectrum.fe.level import FE
from sautereau.analysis.model.plectrum.profile import profile_of
from sautereau.rig.instrument import Plectrum
from sautereau.rig.load import load_rig

FORCES = (0.5, 1.0)  # N
COLUMNS, ACROSS, LAYERS = 60, 2, 4
LOADED = (55, 59)  # Columns from the first to before the last that carry the load
LIMIT = 2.0  # %, of displacement, shortening and rotation
BUILD_LIMIT, LOAD_LIMIT = 30.0, 20.0  # s and ms
_CORNERS = ((0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2))
_EDGES = (
    (0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7),
)  # fmt: skip


def run() -> list[Figure]:
    """Return differences from CalculiX, and both solvers' times."""
    ccx = shutil.which("ccx")
    if ccx is None:
        return [Figure("CalculiX is not installed: comparison skipped", 0.0, "", "limit", 1.0)]
    plectrum = load_rig().plectrum
    s = plectrum.length * (LOADED[0] + LOADED[1]) / 2 / COLUMNS
    spent, peer = timed(solve, ccx, plectrum)
    shape = (profile_of(plectrum), plectrum.poisson_ratio, REACHES[0][1])
    built, _ = timed(build, *shape)
    level = FE(plectrum)
    loaded = 1e3 * timed(FE, plectrum)[0]
    bend = level.bend(s, FORCES)
    ours = np.array([bend.x - s, bend.z, bend.theta]).T
    figures = []
    for force, mine, other in zip(FORCES, ours, peer, strict=True):
        for what, a, b in zip(("shortening", "deflection", "rotation"), mine, other, strict=True):
            off = 100 * abs(a / b - 1)
            figures.append(Figure(f"{what} at {force} N, off CalculiX's", off, "%", "limit", LIMIT))
    return [
        *figures,
        Figure("the complete map built", built, "s", "limit", BUILD_LIMIT),
        Figure("the complete map built", built, "s", "CalculiX for two loads", spent),
        Figure("the map taken from the cache", loaded, "ms", "limit", LOAD_LIMIT),
    ]


def solve(
    ccx: str, plectrum: Plectrum, forces: Sequence[float] = FORCES
) -> list[tuple[float, float, float]]:
    """Return the loaded section's mean displacement [m] and rotation [rad] at each force [N]."""
    deck, section = _deck(plectrum, forces)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "plectrum.inp").write_text(deck, encoding="utf-8")
        done = subprocess.run(
            [ccx, "-i", "plectrum"], cwd=folder, capture_output=True, text=True, check=False
        )
        check(done.returncode == 0, f"CalculiX: {done.stdout[-2000:]}")
        printed = (Path(folder) / "plectrum.dat").read_text(encoding="utf-8")
    blocks = re.split(r"displacements.*\n", printed)[1:]
    check(len(blocks) == len(forces), f"CalculiX printed {len(blocks)} steps, not {len(forces)}")
    found = []
    for block in blocks:
        rows = np.array([line.split() for line in block.split("\n") if line.strip()], float)
        moved = {int(row[0]): row[[1, 3]] * 1e-3 for row in rows}
        up = np.array([z for _, z in section]) * 1e-3
        u = np.array([moved[node] for node, _ in section])
        weights = np.tile([1, 4, 2, 4, 2, 4, 2, 4, 1], 1) / 24  # Simpson, up four layers
        mean, gradient = weights @ u, (weights * up) @ u / (weights @ up**2)
        found.append((mean[0], mean[1], float(np.arctan2(-gradient[0], 1 + gradient[1]))))
    return found


def _deck(plectrum: Plectrum, forces: Sequence[float]) -> tuple[str, list[tuple[int, float]]]:
    """Return CalculiX's input, in mm, N and MPa, and the section's nodes with their z [mm]."""
    profile, length = profile_of(plectrum), plectrum.length * 1e3
    size = np.array([length, plectrum.width * 1e3])
    counts = np.array([COLUMNS, ACROSS, LAYERS])
    places: dict[tuple[int, ...], int] = {}

    def node(*place: int) -> int:
        return places.setdefault(place, len(places) + 1)

    elements, loaded = [], []
    for i, j, k in np.ndindex(COLUMNS, ACROSS, LAYERS):
        corners = 2 * np.array([i, j, k]) + np.array(_CORNERS)
        middles = [(corners[a] + corners[b]) // 2 for a, b in _EDGES]
        elements.append([node(*map(int, place)) for place in (*corners, *middles)])
        if k == LAYERS - 1 and LOADED[0] <= i < LOADED[1]:
            loaded.append(len(elements))
    lines = ["*NODE, NSET=ALL"]
    for place, number in places.items():
        along, across, up = np.array(place) / (2 * counts)
        top, bottom = (length * float(edge[0]) for edge in profile.edges(np.array([along])))
        x, y, z = along * size[0], (across - 0.5) * size[1], bottom + up * (top - bottom)
        lines.append(f"{number}, {x:.9g}, {y:.9g}, {z:.9g}")
    lines.append("*ELEMENT, TYPE=C3D20R, ELSET=BODY")
    for number, nodes in enumerate(elements, 1):
        lines += [f"{number}, {', '.join(map(str, nodes[:10]))},", ", ".join(map(str, nodes[10:]))]
    clamp = [(place, number) for place, number in places.items() if place[0] == 0]
    middle = (LOADED[0] + LOADED[1], ACROSS)
    top, bottom = profile.edges(np.array([(LOADED[0] + LOADED[1]) / 2 / COLUMNS]))
    depth = length * float(top[0] - bottom[0])
    section = [
        (places[*middle, k], (k / (2 * LAYERS) - 0.5) * depth) for k in range(2 * LAYERS + 1)
    ]
    lines += ["*NSET, NSET=SECTION", *(f"{number}," for number, _ in section), "*BOUNDARY"]
    for place, number in clamp:  # free to narrow, as in plane stress
        lines += [f"{number}, 1", f"{number}, 3"] + [f"{number}, 2"] * (place[1] == ACROSS)
    lines += ["*MATERIAL, NAME=ACETAL", "*ELASTIC"]
    lines.append(f"{plectrum.youngs_modulus * 1e-6}, {plectrum.poisson_ratio}")
    lines.append("*SOLID SECTION, ELSET=BODY, MATERIAL=ACETAL")
    area = (LOADED[1] - LOADED[0]) / COLUMNS * size[0] * size[1]
    for force in forces:
        lines += ["*STEP, NLGEOM, INC=200", "*STATIC", "0.1, 1.", "*DLOAD"]
        lines += [f"{number}, P2, {force / area:.9g}" for number in loaded]
        lines += ["*NODE PRINT, NSET=SECTION, FREQUENCY=1000", "U", "*END STEP"]
    return "\n".join(lines) + "\n", section

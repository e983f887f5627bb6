"""Micrographs of plectra, drawn from exact outlines by an independent program.

Nothing of the package is used: an outline is filled with matplotlib's Agg, whose pixels have the
exact covered area, then turned, blurred, unevenly lit and given noise.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Shape:
    """A plectrum in the bending plane, in mm: x from the clamp to the tip, z upwards."""

    x: np.ndarray
    top: np.ndarray
    bottom: np.ndarray

    @property
    def length(self) -> float:
        return float(self.x[-1])

    @property
    def thickness(self) -> float:
        return float(self.top[0] - self.bottom[0])


def carved(rng: np.random.Generator) -> Shape:
    """Return a plectrum whose underside is carved at random; the top is nearly flat."""
    length, thickness = rng.uniform(3.8, 5.2), rng.uniform(0.42, 0.55)
    x = np.linspace(0.0, length, 121)
    start, depth = rng.uniform(0.15, 0.55) * length, rng.uniform(0.15, 0.5) * thickness
    power, bow = rng.uniform(1.0, 2.0), rng.uniform(-0.015, 0.015)
    along = np.clip((x - start) / (length - start), 0, 1)
    top = thickness / 2 + bow * (x / length) ** 2
    return Shape(x, top, -thickness / 2 + bow * (x / length) ** 2 + depth * along**power)


@dataclass(frozen=True)
class Camera:
    """How a picture is taken."""

    pixel: float = 4e-3
    """mm."""
    tilt: float = 0.0
    """rad, counterclockwise in the picture."""
    blur: float = 1.2
    """Pixels, standard deviation."""
    noise: float = 0.03
    """Standard deviation as a fraction of full scale."""
    light: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Relative change of the light across the picture: along x, along y, towards the corners."""
    dark: tuple[float, float] = (0.12, 0.8)
    """Brightness of plectrum and background."""
    left: bool = False
    """Whether the tip points to the left."""
    upside_down: bool = False
    jack: bool = True
    """Whether the jack's face is in the picture; otherwise the plectrum continues to its edge."""
    margin: float = 0.6
    """mm, of background beyond the tip."""
    seed: int = 0


@dataclass(frozen=True)
class Micrograph:
    """A picture, and where everything is in it."""

    image: np.ndarray
    """Grey levels, shape (rows, columns), uint8."""
    clamp: tuple[float, float]
    """Column and row of the centre of the clamp in pixels; (0, 0) is a pixel's centre."""
    pixel: float
    tilt: float
    shape: Shape | None = field(default=None)

    def save(self, path: Path) -> Path:
        from PIL import Image

        Image.fromarray(self.image).save(path)
        return path


def draw(shape: Shape, camera: Camera) -> Micrograph:
    """Return the picture of a plectrum."""
    behind = 0.8
    rings = [np.column_stack([np.r_[shape.x, shape.x[::-1]], np.r_[shape.top, shape.bottom[::-1]]])]
    if camera.jack:
        rings.append(np.array([(-3, -0.9), (0, -0.9), (0, 0.7), (-3, 0.7)]))
    else:
        half = shape.thickness / 2
        rings.append(np.array([(-3, -half), (1e-9, -half), (1e-9, half), (-3, half)]))
    if camera.upside_down:
        rings = [ring * [1, -1] for ring in rings]
    tilt = -camera.tilt if camera.left else camera.tilt
    turn = np.array([[np.cos(tilt), np.sin(tilt)], [-np.sin(tilt), np.cos(tilt)]])
    rings = [ring @ turn for ring in rings]
    size = np.array([behind + shape.length + camera.margin, 2.6])
    origin = np.array([behind, 1.3 - np.sin(tilt) * shape.length / 2])
    if camera.left:
        rings, origin = [r * [-1, 1] for r in rings], np.array([size[0] - behind, origin[1]])
    columns, rows = (round(float(s / camera.pixel)) for s in size)
    placed = [(origin + ring) / camera.pixel for ring in rings]
    cover = filled(placed, columns, rows)
    clamp = (origin[0] / camera.pixel - 0.5, rows - origin[1] / camera.pixel - 0.5)
    image = exposed(cover, camera)
    return Micrograph(image, clamp, camera.pixel, camera.tilt, shape)


def filled(rings: list[np.ndarray], columns: int, rows: int) -> np.ndarray:
    """Return the covered area of each pixel; rings in pixels, x to the right and y upwards."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    figure = Figure(figsize=(columns / 100, rows / 100), dpi=100)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0, columns), ylim=(0, rows))
    axes.axis("off")
    cover = np.zeros((rows, columns))
    for ring in rings:
        patch = PathPatch(Outline(ring, closed=False), fc="black", lw=0, snap=False)
        axes.add_patch(patch)
        canvas.draw()
        one = 1 - np.asarray(canvas.buffer_rgba())[:, :, 0] / 255.0
        cover = np.minimum(cover + one, 1.0)
        patch.remove()
    return cover


def exposed(cover: np.ndarray, camera: Camera) -> np.ndarray:
    """Return grey levels of covered areas."""
    from scipy.ndimage import gaussian_filter

    rng = np.random.default_rng(camera.seed)
    rows, columns = cover.shape
    y, x = np.mgrid[-1 : 1 : rows * 1j, -1 : 1 : columns * 1j]
    along, across, corners = camera.light
    light = 1 + along * x / 2 + across * y / 2 - corners * (x**2 + y**2) / 2
    plectrum, background = camera.dark
    bright = (background + (plectrum - background) * gaussian_filter(cover, camera.blur)) * light
    bright = bright + rng.normal(0, camera.noise, cover.shape)
    return np.round(255 * np.clip(bright, 0, 1)).astype(np.uint8)

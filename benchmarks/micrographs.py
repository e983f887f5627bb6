"""Micrographs of plectra, drawn from exact outlines by an independent program.

Nothing of the package is used. The brightness of a scene is made from exact areas: an outline is
cut at the lines between pixels, and each piece covers a trapezium of its pixel. The lens blurs
the scene, pixels take its mean, and the sensor adds noise. Brightness and grey level are
proportional (gamma 1): with another gamma the level half-way between plectrum and background no
longer lies at the edge, but is shifted by a part of the blur.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.ndimage import gaussian_filter, zoom
from scipy.signal import oaconvolve


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
    defocus: float = 0.0
    """Pixels, radius of the disc that a point becomes, in addition to `blur`."""
    noise: float = 0.03
    """Standard deviation as a fraction of full scale, at every brightness."""
    well: float = 0.0
    """Electrons at full scale, whose number varies as in Poisson's distribution; 0: they do not."""
    light: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Relative change of the light across the picture: along x, along y, towards the corners."""
    dark: tuple[float, float] = (0.12, 0.8)
    """Brightness of plectrum and background."""
    exposure: float = 1.0
    """Above 1, what is brightest exceeds full scale and is cut off."""
    shadow: float = 0.0
    """Part of the background's light that is missing in the shadow of plectrum and jack."""
    shadow_at: tuple[float, float, float] = (0.2, 0.25, 0.1)
    """mm, of the shadow: to the right, downwards, and standard deviation of its soft edge."""
    texture: float = 0.0
    """Standard deviation of the plectrum's brightness as a fraction of full scale, in streaks."""
    dust: int = 0
    """Specks on the background, clear of the plectrum."""
    rgb: bool = False
    """Whether the picture has three colours, tinted, with noise of their own."""
    gamma: float = 1.0
    """Grey level is brightness to the power 1 / gamma."""
    jpeg: int = 0
    """Quality of a compressed file; 0: a file without loss."""
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
    """Grey levels, shape (rows, columns) or (rows, columns, 3), uint8."""
    clamp: tuple[float, float]
    """Column and row of the centre of the clamp in pixels; (0, 0) is a pixel's centre."""
    pixel: float
    tilt: float
    shape: Shape | None = field(default=None)
    jpeg: int = 0

    def save(self, path: Path) -> Path:
        """Write the picture, as a .jpg if the camera compresses, and return the file's path."""
        path = path.with_suffix(".jpg") if self.jpeg else path
        Image.fromarray(self.image).save(path, quality=self.jpeg)  # A .png has no quality
        return path


BEHIND, BESIDE = 0.7, 1.0
"""mm, in the picture behind the clamp, and above and below the plectrum."""
FINER = 2
"""Parts of a pixel, along rows and columns, in which the scene is drawn and blurred."""
SOFT = 0.02
"""mm, mesh of what varies slowly: shadow and texture."""
TINT = (1.0, 0.93, 0.82)


def area(outline: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Return what part of each pixel a polygon covers, shape `size` (rows, columns), exactly.

    `outline` has corners (column, row), shape (n, 2); pixel (r, c) reaches from c to c + 1 and from
    r to r + 1. An edge piece inside one pixel covers, to its right, a trapezium of that pixel, and
    its height of all further pixels of the row: Green's theorem, summed along the row.
    """
    mids, rises = [], []
    for start, step in zip(outline, np.roll(outline, -1, axis=0) - outline, strict=True):
        cuts = [
            (np.arange(math.ceil(min(a, a + d)), math.floor(max(a, a + d)) + 1) - a) / d
            for a, d in zip(start, step, strict=True)
            if d
        ]
        at = np.sort(np.clip(np.concatenate([[0.0, 1.0], *cuts]), 0, 1))
        mids.append(start + step * ((at[1:] + at[:-1]) / 2)[:, None])
        rises.append(step[1] * np.diff(at))
    (column, row), rise = np.concatenate(mids).T, np.concatenate(rises)
    rows, columns = size
    inside = (row >= 0) & (row < rows) & (column < columns)
    column, row, rise = np.maximum(column[inside], 0), row[inside].astype(int), rise[inside]
    own = column.astype(int)
    sums = np.zeros((rows, columns + 1))
    np.add.at(sums, (row, own), rise * (1 - (column - own)))
    np.add.at(sums, (row, own + 1), rise * (column - own))
    return np.abs(np.cumsum(sums, axis=1)[:, :columns])


def _silhouette(shape: Shape, jack: bool) -> np.ndarray:
    """Return the corners (x, z) in mm of plectrum and jack, which reach beyond the picture."""
    far = 4 * shape.length
    upper, lower = np.column_stack([shape.x, shape.top]), np.column_stack([shape.x, shape.bottom])
    (_, high), (_, low) = upper[0], lower[0]
    behind = (
        [(0, -far), (-far, -far), (-far, far), (0, far)] if jack else [(-far, low), (-far, high)]
    )
    return np.concatenate([upper, lower[::-1], np.array(behind)])


def _specks(rng: np.random.Generator, shape: Shape, camera: Camera) -> list[np.ndarray]:
    """Return the corners (x, z) in mm of grains and short fibres beside the plectrum."""
    around, specks = np.linspace(0, 2 * math.pi, 40, endpoint=False), []
    circle = np.column_stack([np.cos(around), np.sin(around)])
    while len(specks) < camera.dust:
        radii = rng.uniform(0.008, 0.04) * np.array([rng.choice([1.0, 1.5, 4.0]), 1.0])
        room, turn = 0.06 + radii.max(), rng.uniform(0, math.pi)
        x = rng.uniform(-BEHIND, shape.length + camera.margin)
        z = rng.uniform(-1, 1) * (shape.thickness / 2 + BESIDE)
        beyond = x > shape.length + room
        beside = z > shape.top.max() + room or z < shape.bottom.min() - room
        if beyond or (beside and (x > room or not camera.jack)):
            c, s = math.cos(turn), math.sin(turn)
            specks.append(np.array([x, z]) + circle * radii @ np.array([[c, s], [-s, c]]))
    return specks


def _spread(values: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Return a coarse array on a finer mesh."""
    ratio = np.divide(size, values.shape)
    return np.asarray(zoom(values, ratio, order=1, mode="nearest", grid_mode=True))


def draw(shape: Shape, camera: Camera = Camera()) -> Micrograph:
    """Return the picture that a camera takes of a plectrum."""
    rng = np.random.default_rng(camera.seed)
    c, s = math.cos(camera.tilt), math.sin(camera.tilt)
    sides = np.array([-1.0 if camera.left else 1.0, -1.0 if camera.upside_down else 1.0])
    turned = np.array([[c, -s], [s, c]]) @ np.diag(sides)

    def seen(points: np.ndarray) -> np.ndarray:
        """Return (column, row) in mm from the clamp."""
        return points @ turned.T * (1, -1)

    outline = seen(_silhouette(shape, camera.jack))
    body = outline[: 2 * len(shape.x)]
    before, after = (camera.margin, BEHIND) if camera.left else (BEHIND, camera.margin)
    low = body.min(axis=0) - np.array([before, BESIDE])
    high = body.max(axis=0) + np.array([after, BESIDE])
    columns, rows = np.ceil((high - low) / camera.pixel).astype(int)
    # The scene continues around the picture as far as the lens spreads a point.
    pad = math.ceil(5 * camera.blur + camera.defocus) + 1
    size = (FINER * (rows + 2 * pad), FINER * (columns + 2 * pad))
    fine = camera.pixel / FINER
    # The mesh of pixels lies anywhere with respect to the plectrum.
    origin = low - pad * camera.pixel + rng.uniform(-0.5, 0.5, 2) * camera.pixel

    plectrum, background = camera.dark
    covered = area((outline - origin) / fine, size)
    coarse = tuple(math.ceil(n * fine / SOFT) for n in size)
    mesh = np.multiply(size, fine) / coarse
    scene = np.full(size, background)
    if camera.shadow:
        right, down, soft = camera.shadow_at
        shade = area((outline + np.array([right, down]) - origin) / mesh[::-1], coarse)
        shade = gaussian_filter(shade, soft / mesh, mode="nearest")
        scene *= 1 - camera.shadow * _spread(shade, size)
    for speck in _specks(rng, shape, camera):
        hidden = area((seen(speck) - origin) / fine, size)
        scene += rng.uniform(0.4, 1.0) * (plectrum - scene) * hidden
    material = np.full(size, plectrum)
    if camera.texture:
        streaks = gaussian_filter(rng.normal(size=coarse), (1.0, 4.0))
        streaks *= camera.texture / streaks.std()
        material = np.clip(plectrum + _spread(streaks, size), 0, None)
    scene += (material - scene) * covered

    scene = gaussian_filter(scene, FINER * camera.blur, mode="nearest", truncate=5)
    if camera.defocus:
        radius = FINER * camera.defocus
        half = math.ceil(radius)
        around = np.linspace(0, 2 * math.pi, 400, endpoint=False)
        disc = radius * np.column_stack([np.cos(around), np.sin(around)]) + half + 0.5
        point = area(disc, (2 * half + 1, 2 * half + 1))
        scene = oaconvolve(scene, point / point.sum(), mode="same")
    picture = scene.reshape(rows + 2 * pad, FINER, columns + 2 * pad, FINER).mean(axis=(1, 3))
    picture = picture[pad:-pad, pad:-pad]

    v, u = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    along, across, corners = camera.light
    light = 1 + along / 2 * u + across / 2 * v + corners * (u**2 + v**2) / 2
    picture = picture * light
    # The exposure is set so that nothing exceeds full scale, unless requested.
    picture = picture * camera.exposure * min(1.0, 0.97 / picture.max())
    if camera.rgb:
        picture = picture[:, :, None] * TINT
    if camera.well:
        picture = rng.poisson(np.clip(picture, 0, None) * camera.well) / camera.well
    picture = picture + rng.normal(0, camera.noise, picture.shape)
    grey = np.clip(picture, 0, 1) ** (1 / camera.gamma)
    column, row = (-origin / camera.pixel - pad - 0.5).tolist()
    return Micrograph(
        np.round(255 * grey).astype(np.uint8),
        (column, row),
        camera.pixel,
        camera.tilt,
        shape,
        camera.jpeg,
    )

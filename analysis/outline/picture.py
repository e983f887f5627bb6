"""The contour of the one object in a photograph, at sub-pixel accuracy.

Brightness is put on a scale of 0 on the background and 1 on the object, with a polynomial of the
position for each, and near the edge with what the background shows there, so that neither uneven
light nor a shadow moves it: the contour is its level 1/2, where a blurred straight edge lies.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.daq.signals.calibration import MAD_TO_STD
from sautereau.rig.disk import open_regular, why_unreadable
from sautereau.rig.errors import require

MOST_PIXELS = 60e6
SMOOTHING = 1.0  # Pixels, of the Gaussian that averages noise before the contour is taken
LEAST_CONTRAST = 6.0  # Contrast over the standard deviation of a pixel's noise
LEAST_RANGE = 0.04  # Contrast as a fraction of full scale: about 10 grey levels of 256
DUST, OTHER = 0.002, 0.05  # Areas over the largest object's: of the largest dust, of other objects
LEAST_AREA = 0.003  # Of the picture, that a plectrum covers
BLUR = 6.0  # Pixels; a larger standard deviation of the edge is out of focus
_POWERS = ((0, 0), (0, 1), (1, 0), (0, 2), (1, 1), (2, 0))
"""Powers of row and column in the polynomial of the light. The object, which is flat, has the first
four."""
GREY, PART = 0.75, 0.02  # Level, and part of object or contour, that are doubted
BESIDE = 8.0  # Pixels, standard deviation of the window in which a shadow is measured
BORDER = 2.0  # Pixels from the picture's edge within which an object continues beyond it


@dataclass(frozen=True)
class Silhouette:
    """The object's contour and how well it is seen; positions as (column, row) in pixels."""

    image: Floats
    """Grey levels 0 to 1, shape (rows, columns)."""
    contour: Floats
    """Closed, counterclockwise as displayed, shape (n, 2)."""
    blur: float
    """Pixels, standard deviation of the smoothed edge."""
    level_std: float
    """Pixels, uncertainty of an edge's position from the level at which it is taken."""
    contrast: float
    """Contrast over the noise of a pixel."""
    warnings: tuple[str, ...]


def read_photo(path: Path) -> Floats:
    """Return the grey levels of a picture file, 0 to 1, shape (rows, columns).

    Raises:
        AnalysisError: It cannot be read, or is no picture.
        MissingExtraError: scikit-image is not installed.
    """
    require("photo", "photograph", "skimage")
    from PIL import Image
    from skimage.color import rgb2gray
    from skimage.util import img_as_float

    try:
        with open_regular(path) as file, Image.open(file) as picture:
            if np.prod(picture.size) > MOST_PIXELS:
                raise AnalysisError(
                    f"photograph {path}: {picture.size[0]} x {picture.size[1]} pixels are more than"
                    f" {MOST_PIXELS / 1e6:.0f} million; cut out the plectrum"
                )
            if picture.mode not in ("L", "I;16", "RGB"):
                picture = picture.convert("RGB")
            levels = np.asarray(picture)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        why = why_unreadable(error) if isinstance(error, OSError) else str(error)
        raise AnalysisError(
            f"photograph {path}: cannot be read: {why}; give a PNG, TIFF or JPEG"
        ) from error
    return img_as_float(rgb2gray(levels) if levels.ndim == 3 else levels)


def silhouette(image: Floats) -> Silhouette:
    """Return the contour of the one object in a picture.

    Raises:
        AnalysisError: There is none, several, or none that can be measured; says why.
    """
    from scipy.ndimage import distance_transform_edt, gaussian_filter
    from skimage.measure import find_contours, label, regionprops

    inside, outside = _light(image)
    span = inside - outside
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.nan_to_num((image - outside) / span, posinf=0.0, neginf=0.0)
    _check_contrast(span, share)
    smooth = gaussian_filter(np.clip(share, -1, 2), SMOOTHING)
    beside = _beside(smooth)
    smooth = gaussian_filter(np.clip((share - beside) / (1 - beside), -1, 2), SMOOTHING)
    numbers = np.asarray(label(smooth > 0.5))
    regions = sorted(regionprops(numbers), key=lambda region: -region.area)
    if not regions or regions[0].area < LEAST_AREA * image.size:
        raise AnalysisError(
            "no plectrum: no object covers more than"
            f" {100 * LEAST_AREA:g} % of the picture; move the camera closer, or light the"
            " background evenly"
        )
    largest = regions[0]
    others = [region for region in regions[1:] if region.area > OTHER * largest.area]
    if others:
        rows, columns = others[0].centroid
        raise AnalysisError(
            f"{len(others) + 1} objects: another one lies at column {columns:.0f}, row"
            f" {rows:.0f}; photograph one plectrum alone, or cut it out"
        )
    warnings = []
    specks = sum(r.area > DUST * largest.area for r in regions[1:])
    if specks:
        warnings.append(f"{specks} specks beside the plectrum are ignored; clean the background")
    if largest.area_filled > (1 + OTHER) * largest.area:
        warnings.append(
            "the plectrum has bright patches inside, as from reflections; light it from behind"
        )
    own = np.where(numbers == largest.label, smooth, np.minimum(smooth, 0.5 - 1e-9))
    rings = find_contours(np.pad(own, 1, constant_values=0.0), 0.5)
    ring = max(rings, key=len)[:-1] - 1
    contour = ring[:, ::-1]
    x, y = contour.T
    if x @ np.roll(y, -1) > np.roll(x, -1) @ y:  # clockwise as displayed
        contour = contour[::-1]
    blur, level_std = _edge(smooth, contour)
    noise = _noise(share)
    if blur > BLUR:
        raise AnalysisError(
            f"out of focus: the edges are blurred by {blur:.1f} pixels, more than {BLUR:g}; focus"
            " on the plectrum's side"
        )
    depth = np.asarray(distance_transform_edt(numbers == largest.label), float)
    grey = float(np.mean(smooth[depth > 3 * blur] < GREY)) if depth.max() > 3 * blur else 0.0
    if grey > PART:
        warnings.append(
            f"{100 * grey:.0f} % of the object is nearly as bright as the background, as a shadow"
            " or a reflection; light the plectrum from behind"
        )
    column, row = np.clip(np.round(contour).astype(int), 0, np.array(image.shape)[::-1] - 1).T
    full = gaussian_filter((image >= 1).astype(float), 3 * blur)[row, column] > 0.25
    if full.mean() > PART:
        warnings.append(
            f"overexposed: at {100 * full.mean():.0f} % of the contour the picture has full"
            " brightness, which moves the edge; expose less"
        )
    return Silhouette(image, contour, blur, level_std, 1 / noise, tuple(warnings))


def at_border(contour: Floats, shape: tuple[int, ...]) -> dict[str, NDArray[np.bool_]]:
    """Return which points of a contour are at each edge of the picture."""
    rows, columns = shape
    x, y = contour.T
    return {
        "left": x < BORDER,
        "right": x > columns - 1 - BORDER,
        "top": y < BORDER,
        "bottom": y > rows - 1 - BORDER,
    }


def _light(image: Floats) -> tuple[Floats, Floats]:
    """Return the brightness that object and background have or would have at every pixel."""
    from scipy.ndimage import binary_erosion
    from skimage.filters import threshold_otsu
    from skimage.transform import downscale_local_mean

    factor = max(1, -(-max(image.shape) // 500))  # Reduced to at most 500 pixels on each side
    small = downscale_local_mean(image, (factor, factor))
    if np.ptp(small) == 0:
        raise AnalysisError("no plectrum: the picture has one brightness everywhere")
    # The last row and column are averaged with padding.
    small = small[: image.shape[0] // factor, : image.shape[1] // factor]
    y, x = (2 * (factor * np.arange(n) + (factor - 1) / 2) / m - 1
            for n, m in zip(small.shape, image.shape, strict=True))  # fmt: skip
    terms = np.stack([y[:, None] ** i * x**j for i, j in _POWERS])
    object_ = np.asarray(small > threshold_otsu(small), bool)
    edge = np.concatenate([object_[0], object_[-1], object_[:, 0], object_[:, -1]])
    if edge.mean() > 0.5:
        object_ = ~object_
    fits: list[Floats] = []
    for _ in range(6):
        fits = []
        for own, count in ((object_, 4), (~object_, 6)):
            core = binary_erosion(own, iterations=2, border_value=1)
            core = core if core.sum() > 50 else own
            if core.sum() < 12:
                raise AnalysisError(
                    "no plectrum: nothing stands out from the background; raise the contrast"
                )
            fits.append(_fitted(terms[:count], small, np.asarray(core, bool)))
        inside, outside = (np.tensordot(fit, terms[: len(fit)], 1) for fit in fits)
        new = np.abs(small - inside) < np.abs(small - outside)
        if np.array_equal(new, object_):
            break
        object_ = new
    y, x = (2 * np.arange(n) / n - 1 for n in image.shape)
    inside, outside = (
        sum(c * (y[:, None] ** i * x**j) for c, (i, j) in zip(fit, _POWERS, strict=False))
        for fit in fits
    )
    return np.asarray(inside, float), np.asarray(outside, float)


def _beside(smooth: Floats) -> Floats:
    """Return the level that the background has at the contour, at every pixel near it.

    A shadow is no polynomial of the position. Beyond what the blur mixes, a line over the distance
    from the contour is fitted in a Gaussian window around the pixel.
    """
    from scipy.ndimage import distance_transform_edt, gaussian_filter

    down, right = np.gradient(smooth)
    slopes = np.hypot(down, right)[np.abs(smooth - 0.5) < 0.1]
    steep = float(np.median(slopes)) if len(slopes) else 1.0
    mixed = 3 * min(1 / (np.sqrt(2 * np.pi) * steep), BLUR)
    away = np.asarray(distance_transform_edt(smooth < 0.5), float) - 0.5
    own = (away > mixed) & (away < mixed + 3 * BESIDE)
    weight, x, z, xx, xz = (
        np.asarray(gaussian_filter(own * term, BESIDE), float)
        for term in (np.ones_like(away), away, smooth, away**2, away * smooth)
    )
    seen = weight > 1e-3
    x, z, xx, xz = (np.where(seen, m, 0) / np.where(seen, weight, 1) for m in (x, z, xx, xz))
    # 1 square pixel keeps the line level where the window shows a narrow strip of background. A
    # level of 1/2 or more would be no background.
    return np.clip(z - x * (xz - x * z) / (xx - x**2 + 1), -0.45, 0.45)


def _fitted(terms: Floats, image: Floats, within: NDArray[np.bool_]) -> Floats:
    """Return the least-squares coefficients, without the pixels that are far off."""
    design, values = terms[:, within].T, image[within]
    keep = np.ones(len(values), bool)
    fit: Floats = np.zeros(len(terms))
    for _ in range(3):
        fit = np.asarray(np.linalg.lstsq(design[keep], values[keep], rcond=None)[0], float)
        residual = np.abs(values - design @ fit)
        keep = residual <= 3 * MAD_TO_STD * np.median(residual) + 1e-12
    return fit


def _noise(share: Floats) -> float:
    """Return the standard deviation of a pixel's noise, from differences of neighbours."""
    differences = share[:, 2:] - 2 * share[:, 1:-1] + share[:, :-2]
    spread = MAD_TO_STD * float(np.median(np.abs(differences))) / np.sqrt(6)
    return max(spread, 1e-3)  # the rounding of 8 bits


def _check_contrast(span: Floats, share: Floats) -> None:
    contrast, noise = float(np.median(np.abs(span))), _noise(share)
    if contrast < LEAST_RANGE or 1 / noise < LEAST_CONTRAST or np.ptp(np.sign(span)) > 0:
        raise AnalysisError(
            f"low contrast: object and background differ by {100 * contrast:.1f} % of full scale"
            f" and by {1 / noise:.1f} times a pixel's noise; at least {100 * LEAST_RANGE:g} % and"
            f" {LEAST_CONTRAST:g} times are needed: light the plectrum from behind"
        )


def _edge(smooth: Floats, contour: Floats) -> tuple[float, float]:
    """Return the edge's blur, and the uncertainty of its level's position, in pixels.

    The level is uncertain by what the polynomials of the light leave, and by the distance between
    the level and the steepest point of the mean edge, which a camera's curve moves.
    """
    from scipy.ndimage import map_coordinates
    from skimage.measure import block_reduce

    tangent = np.roll(contour, -3, 0) - np.roll(contour, 3, 0)
    length = np.hypot(*tangent.T)
    normal = np.column_stack([tangent[:, 1], -tangent[:, 0]]) / np.maximum(length, 1e-9)[:, None]
    rows, columns = smooth.shape
    reach = 6.0
    x, y = contour.T
    far = (x > reach) & (y > reach) & (x < columns - 1 - reach) & (y < rows - 1 - reach)
    if not far.any():
        return 0.0, 0.0
    offsets = np.arange(-reach, reach + 0.01, 0.25)
    places = contour[far][:, None] + offsets[:, None] * normal[far][:, None]
    profile = np.median(map_coordinates(smooth, [places[..., 1], places[..., 0]], order=1), axis=0)
    slopes = np.abs(np.gradient(profile, offsets))
    steepest = int(np.argmax(slopes))
    blur = 1 / (np.sqrt(2 * np.pi) * float(slopes[steepest]))
    # Centre of the slope's upper half: less noisy than its largest value.
    upper = np.where(slopes > slopes[steepest] / 2, slopes - slopes[steepest] / 2, 0)
    shift = float(offsets @ upper / upper.sum())
    left = []
    for value in (0.0, 1.0):
        near = np.abs(smooth - value) < 0.25
        blocks = block_reduce(near, 32, np.mean)
        means = block_reduce(smooth, 32, np.mean)[blocks == 1]
        left.append(float(np.median(np.abs(means - value))) if len(means) else 0.0)
    level = np.hypot(*left) / 2 / float(slopes[steepest])
    return blur, float(np.hypot(shift, level))

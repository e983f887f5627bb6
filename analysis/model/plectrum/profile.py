"""The plectrum's two edges and the contact line of the string."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.rig.instrument import Plectrum


@dataclass(frozen=True, eq=False)
class Profile:
    """Both edges in units of the plectrum's length, straight between places of shape (n,).

    Profiles of the same edges are equal, so that caches can be asked by profile.
    """

    x: Floats
    """From 0 at the clamp to 1 at the tip."""
    top: Floats
    """Height of the edge on the string's side."""
    bottom: Floats
    """Height of the other edge."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Profile) and self._edges == other._edges

    def __hash__(self) -> int:
        return hash(self._edges)

    @property
    def _edges(self) -> bytes:
        return np.stack([self.x, self.top, self.bottom]).tobytes()

    @property
    def clamp_thickness(self) -> float:
        """Thickness at the clamp, in lengths."""
        return float(self.top[0] - self.bottom[0])

    @property
    def clamp_middle(self) -> float:
        """Height of the mid-line at the clamp, in lengths."""
        return float(self.top[0] + self.bottom[0]) / 2

    @property
    def patch(self) -> float:
        """Half the length of the load's patch, in lengths: thickness / 4, at least 0.01."""
        return max(self.clamp_thickness / 4, 0.01)

    def edges(self, x: Floats) -> tuple[Floats, Floats]:
        """Return top and bottom at x; past the tip both continue parallel to the top."""
        beyond = np.maximum(x - 1, 0) * self._slopes()[-1]
        return np.interp(x, self.x, self.top) + beyond, np.interp(x, self.x, self.bottom) + beyond

    def contact_line(self, s: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return height, slope and curvature of the unloaded top, averaged over a patch at s.

        Because of the average a kink in the outline turns the normal over the length of the
        patch and not at once. The height is counted from the clamp.
        """
        s = np.asarray(s, float)
        slopes = self._slopes()
        u = (s[..., None] - self.x[1:-1]) / self.patch
        v = np.clip(u, -1, 1)
        passed = 15 / 16 * (v - 2 * v**3 / 3 + v**5 / 5) + 0.5
        area = 15 / 16 * (v**2 / 2 - v**4 / 6 + v**6 / 30) + v / 2 + 5 / 32 + np.maximum(u - 1, 0)
        turn = np.diff(slopes)
        return (
            slopes[0] * s + self.patch * area @ turn,
            slopes[0] + passed @ turn,
            bump(u) @ turn / self.patch,
        )

    def _slopes(self) -> Floats:
        return np.diff(self.top) / np.diff(self.x)


def bump(u: Floats) -> Floats:
    """Return the patch's pressure, of unit area on -1 < u < 1 and smooth at its ends."""
    return 15 / 16 * np.maximum(1 - u**2, 0) ** 2


def profile_of(plectrum: Plectrum) -> Profile:
    """Return a plectrum's outline, or that of its thicknesses, in units of its length.

    A thinner tip is cut from below; the step is a bevel that is as long as it is high.

    Raises:
        ModelError: The outline is not as long as the plectrum.
    """
    outline = plectrum.outline
    if outline is None:
        half, places, depth = plectrum.thickness / plectrum.length / 2, [0.0, 1.0], [0.0, 0.0]
        if "tip_thickness" in plectrum.described:
            step = (plectrum.thickness - (plectrum.tip_thickness or 0.0)) / plectrum.length
            joint = 1 - (plectrum.tip_length or plectrum.length / 2) / plectrum.length
            bevel = min(abs(step), 2 * joint, 2 * (1 - joint)) / 2
            places, depth = [0.0, joint - bevel, joint + bevel, 1.0], [0.0, 0.0, step, step]
        return Profile(np.array(places), np.full(len(places), half), np.array(depth) - half)
    end = outline.x[-1]
    if abs(end - plectrum.length) > 1e-3 * plectrum.length:  # Tolerance on the length of an outline
        raise ModelError(
            f"plectrum.outline: it ends at x = {end * 1e3:.6g} mm and plectrum.length is"
            f" {plectrum.length * 1e3:.6g} mm; make them equal, or omit the length"
        )
    x, top, bottom = (np.array(edge) / end for edge in (outline.x, outline.top, outline.bottom))
    return Profile(x, top, bottom)

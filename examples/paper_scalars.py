"""What the paper's three scalars determine about the plectrum, and what they do not.

python -m examples.paper_scalars

Contact at 27 ms, release at 47 ms and Vosc = 0.46 m/s are taken with the rounding in which they
are printed, the jack's speed and the string's stiffness to 2 %, and the friction on the string
from 0 to 0.2. Every draw gives the bending stiffness and the overlap that explain it.
"""

from dataclasses import dataclass

import numpy as np

from examples.release_fit import fit_release
from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.string.string import first_mode_release_speed, release_speed
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig

CONTACT, RELEASE, V_OSC = 27e-3, 47e-3, 0.46
"""s, s and m/s, as printed."""
ROUNDING = (0.5e-3, 0.5e-3, 0.005)
"""s, s and m/s, half of the last printed digit."""
SPREAD = 0.02
"""Relative standard deviation of values given without one: jack speed, string stiffness."""
FRICTION_MAX = 0.2
"""Coefficient of friction of plectrum and string; the paper neither models nor measures it."""
DRAWS = 400


@dataclass(frozen=True)
class Explanations:
    """Parameters that explain the draws of the scalars; arrays of shape (n,)."""

    stiffness: np.ndarray
    """N m^2, EI of the plectrum."""
    overlap: np.ndarray
    """m."""
    clearance: np.ndarray
    """m, rise of the jack at contact."""
    friction: np.ndarray
    """Coefficient of friction, as drawn."""
    unexplained: int
    """Number of draws that no plectrum explains."""


def explain(rig: Rig, *, first_mode: bool, draws: int) -> Explanations:
    """Draw scalars and nuisances, and find what explains each.

    Args:
        rig: The paper's.
        first_mode: Whether Vosc is the speed of the first mode alone.
        draws: Of the scalars.
    """
    random = np.random.default_rng(0)
    share = first_mode_release_speed(rig.string, 1.0) / release_speed(rig.string, 1.0)
    found, unexplained = [], 0
    for _ in range(draws):
        contact, release, v_osc = (
            random.uniform(value - half, value + half)
            for value, half in zip((CONTACT, RELEASE, V_OSC), ROUNDING, strict=True)
        )
        speed = rig.press.jack_speed * random.normal(1, SPREAD)
        friction = random.uniform(0, FRICTION_MAX)
        tension = rig.string.tension * random.normal(1, SPREAD)
        values = {"press.jack_speed": speed, "string.tension": tension}
        case = rig.replaced(values | {"plectrum.friction": friction})
        try:
            fit = fit_release(case, release - contact, v_osc / share if first_mode else v_osc)
        except ModelError:
            unexplained += 1
            continue
        found.append((fit.bending_stiffness, fit.overlap, contact * speed, friction))
    columns = np.array(found).reshape(-1, 4).T
    return Explanations(*columns, unexplained=unexplained)


def overlap_at(rig: Rig, share: float) -> float:
    """Return the overlap [m] that explains the duration if EI is a fraction of the rig's.

    Raises:
        ModelError: None does.
    """
    modulus = rig.plectrum.youngs_modulus * share
    case = rig.replaced({"plectrum.youngs_modulus": modulus})
    return fit_release(case, RELEASE - CONTACT).overlap


def lines(rig: Rig, draws: int = DRAWS) -> list[str]:
    """Return the result as text."""
    text = []
    for first_mode, reading in ((False, "all modes"), (True, "the first mode alone")):
        found = explain(rig, first_mode=first_mode, draws=draws)
        text.append(f"Vosc as the speed of {reading} ({found.unexplained} of {draws} unexplained):")
        for name, values, scale, unit in (
            ("EI over Table 1's", found.stiffness / rig.plectrum.bending_stiffness, 1, ""),
            ("overlap", found.overlap, 1e3, " mm"),
            ("string's clearance", found.clearance, 1e3, " mm"),
        ):
            low, middle, high = np.percentile(values, (2.5, 50, 97.5)) * scale
            text.append(f"  {name}: {middle:.3g}{unit}, 95 % from {low:.3g} to {high:.3g}{unit}")
        for name, values in (("EI", found.stiffness), ("overlap", found.overlap)):
            together = float(np.corrcoef(values, found.friction)[0, 1])
            text.append(f"  correlation of {name} with the friction: {together:+.2f}")
        both = float(np.corrcoef(found.stiffness, found.overlap)[0, 1])
        text.append(f"  correlation of EI with the overlap: {both:+.2f}")
    text.append("from the duration alone, one overlap for every EI:")
    for share in (0.25, 0.5, 1.0, 2.0, 4.0):
        text.append(f"  EI {share:.3g} of Table 1's: {overlap_at(rig, share) * 1e3:.4g} mm")
    return text


if __name__ == "__main__":
    print("\n".join(lines(load_rig())))

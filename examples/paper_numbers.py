"""What the numbers that the paper prints say about its plectrum and about its slope error.

Contact at 27 ms, release at 47 ms, Vosc = 0.46 m/s and Vs = 0.03 m/s are compared with plectra that
could have given them; the first three are drawn with the rounding in which they are printed; and
the values that nobody printed are drawn from the ranges of the rig, for the error of the slope.
"""

from dataclasses import dataclass

import numpy as np

from examples.release_fit import Release, fit_release
from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.predict import predict
from sautereau.analysis.model.string.string import first_mode_release_speed, release_speed
from sautereau.analysis.session.budget import INPUTS
from sautereau.analysis.session.compare import predicted_features
from sautereau.rig.ranges import FROM_THE_FRONT, Deviation, deviations
from sautereau.rig.schema import Rig

CONTACT, RELEASE, SPEED, RISE = 27e-3, 47e-3, 0.072, 10e-3
"""s, s, m/s and m, as printed."""
V_OSC, V_S = 0.46, 0.03
"""m/s, as printed: of the released string, and of the string that the plectrum moves."""
SLOPE_ERROR = 0.6
"""Printed without a sign, and without saying whether of the model's slope or of the measured."""
MEANT = (SLOPE_ERROR, 1 / (1 + SLOPE_ERROR) - 1, -SLOPE_ERROR)
"""What the error of the model's slope, (model - measured) / measured, may then be."""
ROUNDING = (0.5e-3, 0.5e-3, 0.005)
"""s, s and m/s, half of the last printed digit."""
SPREAD = 0.02
"""Relative standard deviation of values given without one: jack speed, string stiffness."""
FRICTION_MAX = 0.2
"""Coefficient of friction of plectrum and string; the paper neither models nor measures it."""
DRAWS = 400


def first_mode(rig: Rig) -> float:
    """Return Vosc of the first mode alone over that of all modes, dimensionless."""
    return first_mode_release_speed(rig.string, 1.0) / release_speed(rig.string, 1.0)


def candidates(rig: Rig) -> dict[str, Release]:
    """Return the plectra that could be meant, all with the printed duration, by their names."""
    held, bar = RELEASE - CONTACT, rig.plectrum
    turned = {"plectrum.width": bar.thickness, "plectrum.thickness": bar.width}
    return {
        "Table 1": fit_release(rig, held),
        "Vosc by the printed formula, the first mode": fit_release(
            rig, held, V_OSC / first_mode(rig)
        ),
        "Vosc of all modes": fit_release(rig, held, V_OSC),
        "Table 1 with W and h exchanged": fit_release(rig.replaced(turned), held),
    }


def string_speed(release: Release) -> float:
    """Return the speed of the held string just before its release [m/s], at the rig's jack speed.

    Of the path in the plane, as the paper's figure 4 shows it.
    """
    pluck = release.pluck
    path = [np.gradient(z, pluck.height, edge_order=2)[-1] for z in (pluck.lift, pluck.shift)]
    return float(np.hypot(*path)) * release.rig.press.jack_speed


@dataclass(frozen=True)
class Errors:
    """Errors of the model of a rig, (model - measured) / measured, if a draw is the instrument."""

    slope: np.ndarray
    """Of the finger force over the key's deflection while the string is held, shape (n,)."""
    rise: np.ndarray
    """Of the finger force's growth while the string is held, shape (n,)."""
    duration: np.ndarray
    """From contact to release, shape (n,)."""

    @property
    def as_said(self) -> np.ndarray:
        """Where the model has too little force and too long a contact, as the paper says."""
        return (self.rise < 0) & (self.duration > 0)


def measured(rig: Rig) -> np.ndarray:
    """Return slope [N/m] and rise [N] of the finger force, and duration [s], shape (3,)."""
    found = predict(rig)
    return np.array([*predicted_features(found), found.release - found.contact])


def model_errors(rig: Rig, instrument: Rig) -> np.ndarray:
    """Return the errors of a rig's model, as of `Errors`, on an instrument, shape (3,)."""
    return measured(rig) / measured(instrument) - 1


def draw_errors(rig: Rig, *, levers: bool, surface: bool, draws: int) -> Errors:
    """Return the model's errors for instruments drawn from the ranges of a rig.

    Args:
        rig: The model.
        levers: Whether the place of the balance pin and the jack's arm are drawn, too; who has the
            instrument knows them.
        surface: Whether the string lies on the instrument's plectrum with friction, as drawn from 0
            to `FRICTION_MAX`, in place of on its mid-line as in the paper's equations.
        draws: Number of instruments.
    """
    known = () if levers else (*FROM_THE_FRONT, "key.jack_arm")
    ranges = deviations(rig, [name for name in INPUTS if name not in known])
    random = np.random.default_rng(0)
    nominal, found = measured(rig), []
    for _ in range(draws):
        case = _drawn(rig, ranges, random)
        if surface:
            friction = random.uniform(0, FRICTION_MAX)
            case = case.replaced({"plectrum.contact": "surface", "plectrum.friction": friction})
        found.append(nominal / measured(case) - 1)
    return Errors(*np.array(found).T)


def _drawn(rig: Rig, ranges: list[Deviation], random: np.random.Generator) -> Rig:
    for each in ranges:
        rig = each.applied(rig, random.uniform(each.low, each.high))
    return rig


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


def explain(rig: Rig, *, all_modes: bool, draws: int = DRAWS) -> Explanations:
    """Draw scalars and nuisances, and find what explains each.

    Args:
        rig: The paper's.
        all_modes: Whether Vosc is the speed of all modes, not that of the first, as printed.
        draws: Of the scalars.
    """
    random = np.random.default_rng(0)
    share = 1.0 if all_modes else first_mode(rig)
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
            fit = fit_release(case, release - contact, v_osc / share)
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

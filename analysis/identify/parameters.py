"""Parameters that can be fitted: values of the rig by dotted key, with bounds and priors.

Hidden parameters are fitted in every fit because they bias the others, and are not reported: errors
of the calibrations, numbers of the rig that are seldom known well enough, and all numbers that the
rig knows to within a range only.
"""

import difflib
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.model.choirs import choirs
from sautereau.rig import ranges
from sautereau.rig.acquisition import Channel
from sautereau.rig.document import current_key
from sautereau.rig.faults import fault_list, unit_of
from sautereau.rig.ranges import deviations, shared_keys
from sautereau.rig.schema import Rig
from sautereau.rig.units import format_quantity, parse_quantity
from sautereau.trajectory.motion import Floats

# Values of the rig.
STIFFNESS = "plectrum.bending_stiffness"
MODULUS = "plectrum.youngs_modulus"
OVERLAP = "plectrum.overlap"
FRICTION = "plectrum.friction"
FINGERTIP = "arm.fingertip_friction"
WIDTH = "plectrum.width"
CLEARANCE = "jack.string_clearance"
INERTIA = "key.inertia"
DRY_FRICTIONS = "key.pivot_coulomb_friction", "jack.register_friction"
CONTACT = "plectrum.contact"
# Errors of the measurement.
TIME = "offset.time"  # Delay of the force after the motion (s)
FORCE = "offset.force"  # Zero of the force (N)
FORCE_GAIN = "offset.force_gain"  # True force divided by measured force; hidden
VELOCITY_GAIN = "offset.velocity_gain"  # True velocity divided by measured velocity; hidden
CALIBRATIONS = TIME, FORCE_GAIN, VELOCITY_GAIN
SLIDING = "offset.sliding"
"""Relative error of the force's moment on the key, per newton (1/N): the finger of a compliant arm
slides along the key while the force bends the arm; hidden."""
LATE_SLIDING = "offset.late_sliding"  # Of the lagged force, as a servo-driven arm deflects later
# Errors of the model.
CLOTH = "offset.foot"  # Compliance of the cloth under the jack (m/N); hidden
MODE = "offset.mode"  # Start of the names of the elastic modes' parameters; hidden
RELEASE = "offset.release"  # Relative error of the height of a static release; hidden
VIBRATION = "offset.vibration"  # Of the held strings over that of undamped strings; hidden
DAMPER = "offset.damper"  # True stiffness of the dampers divided by the rig's; hidden
DAMPER_LIFT = "offset.damper_lift"  # Lift of the first damper (m); hidden
OF_STRING = ("offset.string{}.stiffness", "offset.string{}.overlap", "offset.string{}.clearance")
"""For a further string, numbered from 2: true stiffness and true overlap of its plectrum, each
divided by the rig's, and the error of its clearance (m); hidden."""
TIME_RANGE = 1e-3  # Largest delay between force and motion (s)
_FURTHER = re.compile(r"(?:string(\d+)|more_choirs\.(\d+))\.((?:plectrum|jack)\..+)")
ENDS = {
    FRICTION: (0.0, 0.5),
    FINGERTIP: (-0.6, 0.6),
    TIME: (-TIME_RANGE, TIME_RANGE),
    FORCE_GAIN: (0.5, 2.0),
    VELOCITY_GAIN: (0.5, 2.0),
    VIBRATION: (0.0, 1.5),
}  # Bounds of the parameters that have a natural range, SI
MEASURED = (
    *("key.press_arm", "key.laser_arm", "key.jack_arm", "key.jack_surface_height"),
    *("plectrum.length", WIDTH, "plectrum.thickness"),
    *("string.tension", "string.length", "string.plucking_point", "string.diameter"),
)  # Numbers of the rig that are measured with a ruler or a gauge: freeing one is never suggested
NAMES = (
    MODULUS,
    STIFFNESS,
    OVERLAP,
    FRICTION,
    INERTIA,
    "key.pivot_coulomb_friction",
    "key.pivot_viscous_friction",
    "key.gravity_moment",
    "jack.mass",
    "jack.register_friction",
    CLEARANCE,
    FINGERTIP,
    *MEASURED,
    TIME,
    FORCE,
)
"""Names of all parameters that can be requested. Those of plectrum and jack are of string 1; those
of the next string start with `string2.`, and so on. `offset.force` has one value for each press; it
is always fitted if the force is AC-coupled."""


def canonical(name: str) -> str:
    """Return the one spelling of a name: `string2.jack.mass` for `more_choirs.0.jack.mass`.

    Names without a number are those of string 1.
    """
    found = _FURTHER.fullmatch(name)
    if found is None:
        return name
    number = int(found[1]) if found[1] else int(found[2]) + 2
    return found[3] if number == 1 else f"string{number}.{found[3]}"


def split_name(name: str) -> tuple[int, str]:
    """Return the number of a parameter's string, and its name for the first string."""
    found = _FURTHER.fullmatch(name)
    return (int(found[1]), found[3]) if found and found[1] else (1, name)


def is_name(name: str) -> bool:
    """Return whether a parameter can be requested by this name, in a rig of enough strings."""
    return name in NAMES or (split_name(name)[0] > 1 and split_name(name)[1] in NAMES)


FACTOR = 10.0  # Ratio of a bound to the rig's value if the rig file assumes no range
OF_STIFFNESS = (MODULUS, "plectrum.width", "plectrum.thickness")
"""Values of which the bending stiffness consists."""
_SPREAD = re.compile(r"(.+?)\s*(?:\+-|\+/-|±)\s*(.+)")
_RANGE = re.compile(r"(.+?)\s+to\s+(.+)")


@dataclass(frozen=True)
class Prior:
    """Prior knowledge of a parameter; SI."""

    low: float | None = None
    """Lower bound; None: default."""
    high: float | None = None
    """Upper bound; None: default."""
    mean: float | None = None
    """Expected value; None: unknown."""
    std: float | None = None
    """Standard uncertainty of `mean`; None: unknown."""


@dataclass(frozen=True)
class Parameter:
    """A fitted parameter; SI."""

    name: str
    """Dotted key."""
    unit: str
    """SI, empty for a ratio."""
    start: float
    """Value at which the fit starts: the rig's, or that of the prior."""
    low: float
    """Lower bound."""
    high: float
    """Upper bound."""
    mean: float | None = None
    """Expected value from the prior; None: no prior."""
    std: float | None = None
    """Standard uncertainty of `mean`; None: no prior."""
    hidden: bool = False
    """Whether it is fitted only because it would bias the others, and is not reported."""

    def scale(self, value: float) -> float:
        """Return the scale by which changes of the parameter near a value are divided."""
        width = self.high - self.low
        return width if split_name(self.name)[1] == FRICTION else max(abs(value), width / FACTOR)

    def at_bound(self, value: float) -> bool:
        """Return whether a fitted value is at a bound, up to rounding."""
        return min(value - self.low, self.high - value) <= 1e-9 * (self.high - self.low)

    @property
    def difference(self) -> float:
        """Step of numerical derivatives, divided by the scale."""
        rubs = split_name(self.name)[1] == FRICTION
        # The effect of a friction is quadratic near 0.
        return 0.02 if rubs else 1e-3  # Of the scale


def check_names(names: Sequence[str], priors: Collection[str] = ()) -> None:
    """Check the names of free parameters, and of those with a prior.

    Raises:
        AnalysisError: Reports all faults of `parameters` that no rig could fix.
    """
    if faults := _name_faults(list(map(canonical, names)), priors):
        raise AnalysisError(fault_list("identify", faults))


def _name_faults(names: Sequence[str], priors: Collection[str]) -> list[str]:
    faults = [
        f"{name}: no parameter has this name{_near(name, NAMES)}"
        for name in dict.fromkeys(names)
        if not is_name(name)
    ]
    faults += [f"{name}: given twice; name it once" for name in set(names) if names.count(name) > 1]
    for stiffness in (name for name in names if split_name(name)[1] == STIFFNESS):
        modulus = stiffness.replace(STIFFNESS, MODULUS)
        if modulus in names:
            faults.append(f"{modulus}, {stiffness}: one determines the other; fit one of them")
    faults += [
        f"prior of {name}: it is not fitted{_near(name, names)}; free it or omit the prior"
        for name in priors
        if name not in names or name == FORCE
    ]
    if not faults and not set(names) - {FORCE}:
        faults.append(f"no parameter is free; name at least one of {', '.join(NAMES[:-1])}")
    return faults


def parameters(
    rig: Rig, names: Sequence[str], priors: Mapping[str, Prior] | None = None
) -> tuple[Parameter, ...]:
    """Return the free parameters with their start values and bounds.

    The bounds come from the prior if it has a range. Otherwise they are the range that the rig file
    assumes, or without one a tenth and ten times the rig's value.

    Args:
        names: As of `is_name`; `offset.force` is handled by the fit itself.

    Raises:
        AnalysisError: A name is unknown or given twice, no name is given, a prior contradicts
            itself, or a prior is for a parameter that is not fitted. Reports all faults.
    """
    priors = priors or {}
    faults, strings = _name_faults(names, priors), 1 + len(rig.more_choirs)
    beyond = [name for name in names if split_name(name)[0] > strings]
    faults += [f"{name}: the rig has {strings} string{'s' * (strings > 1)}" for name in beyond]
    found = [
        _parameter(rig, name, priors.get(name, Prior()), faults)
        for name in names
        if is_name(name) and name not in (FORCE, *beyond)
    ]
    if faults:
        raise AnalysisError(fault_list("identify", faults))
    return tuple(found)


def read_prior(text: str) -> tuple[str, Prior]:
    """Read ``key=LOW to HIGH`` or ``key=MEAN +- STD`` with units.

    Raises:
        AnalysisError: The text has another form, or the unit does not fit the key.
    """
    name, _, value = (part.strip() for part in text.partition("="))
    name = canonical(name)
    spread, ends = _SPREAD.fullmatch(value), _RANGE.fullmatch(value)
    found = spread or ends
    if not is_name(name) or found is None:
        raise AnalysisError(
            f"prior {text!r}: expected a key with a range or a standard uncertainty, such as"
            f" 'plectrum.overlap=0.1 mm to 0.5 mm' or 'key.inertia=7e-4 kg m^2 +- 1e-4 kg m^2'"
            f"{'' if is_name(name) else _near(name, NAMES)}"
        )
    unit = unit_of_parameter(name)
    try:
        first, second = (parse_quantity(part, unit) for part in found.groups())
    except ValueError as error:
        raise AnalysisError(f"prior {text!r}: {error}; give a quantity in {unit or '1'}") from error
    if spread:
        return name, Prior(mean=first, std=second)
    return name, Prior(low=first, high=second)


def value_of(rig: Rig, name: str) -> float:
    """Return the value [SI] of a parameter in the rig; 0 for an offset."""
    _, own = split_name(name)
    return 0.0 if own.startswith("offset.") else ranges.value_of(rig, current_key(name))


def values_of_rig(rig: Rig, free: Sequence[Parameter]) -> Floats:
    """Return the values [SI] of parameters in the rig; the prior's mean of the hidden ones."""
    return np.array([p.mean if p.hidden else value_of(rig, p.name) for p in free], float)


def unit_of_parameter(name: str) -> str:
    """Return a parameter's SI unit; empty for a ratio."""
    known, own = {STIFFNESS: "N*m**2", TIME: "s", FORCE: "N"}, split_name(name)[1]
    return known.get(own) or unit_of(Rig, own.split(".")) or ""


def rig_values(rig: Rig, values: Mapping[str, float]) -> dict[str, str | float]:
    """Return TOML values by the rig file's dotted key for parameters [SI]; see `rig_numbers`."""
    found = rig_numbers(rig, values).items()
    return {key: format_quantity(own, unit) if unit else own for key, (own, unit) in found}


def rig_numbers(rig: Rig, values: Mapping[str, float]) -> dict[str, tuple[float, str]]:
    """Return numbers and their SI units by the rig file's dotted key for parameters [SI].

    The bending stiffness becomes Young's modulus. The delay of the force after the motion is
    subtracted from the vibrometer's delay, which is the less certain of the two.
    """
    found: dict[str, tuple[float, str]] = {}
    for name, value in values.items():
        name, value = of_rig(rig, name, value)
        if name == TIME:
            at, channel = next(
                (i, c) for i, c in enumerate(rig.daq.channels) if c.quantity == "velocity"
            )
            found[f"daq.channels.{at}.delay"] = channel.delay - value, "s"
        elif name != FORCE:
            unit = unit_of_parameter(name)
            found |= {key: (own, unit) for key, own in _with_shared(rig, name, value)}
    return found


def of_rig(rig: Rig, name: str, value: float) -> tuple[str, float]:
    """Return name and value of a parameter, of Young's modulus for that of a bending stiffness."""
    modulus = name.replace(STIFFNESS, MODULUS)
    ratio = value_of(rig, modulus) / value_of(rig, name) if modulus != name else 1.0
    return modulus, value * ratio


def with_parameters(rig: Rig, values: Mapping[str, float]) -> Rig:
    """Return the rig with these values [SI]; they must be within the bounds of the rig's keys."""
    own = {n: v for n, v in values.items() if not n.startswith("offset.")}
    stiffnesses = {n: own.pop(n) for n in list(own) if split_name(n)[1] == STIFFNESS}
    changed = rig.replaced({k: v for name in own for k, v in _with_shared(rig, name, own[name])})
    moduli = dict(of_rig(changed, name, value) for name, value in stiffnesses.items())
    return changed.replaced({current_key(name): value for name, value in moduli.items()})


def _with_shared(rig: Rig, name: str, value: float) -> list[tuple[str, float]]:
    """Return the rig's keys that change with a parameter, and their values [SI]."""
    own = current_key(name)
    others = [key for key in ranges.shared_keys(rig, own) if key != own]
    change = value - value_of(rig, name) if others else 0.0
    return [(own, value), *((key, ranges.value_of(rig, key) + change) for key in others)]


def _parameter(rig: Rig, name: str, prior: Prior, faults: list[str]) -> Parameter:
    """Return a parameter with its bounds; add contradictions to `faults`."""
    value, unit = value_of(rig, name), unit_of_parameter(name)
    low, high = bounds_of(rig, name)
    for end in (prior.low, prior.high, prior.mean):
        if split_name(name)[1] == FRICTION and end is not None and not low <= end <= high:
            faults.append(
                f"prior of {name}: {end:.4g} is not within {low:g} to {high:g}; change it"
            )
    low = low if prior.low is None else prior.low
    high = high if prior.high is None else prior.high
    if prior.mean is not None and prior.std is not None:
        if prior.std <= 0:
            faults.append(
                f"prior of {name}: its standard uncertainty {prior.std:.4g} {unit} is not above 0"
            )
        low = min(low, prior.mean) if prior.low is None else low
        high = max(high, prior.mean) if prior.high is None else high
        value = min(max(prior.mean, low), high)
    if not low < high:
        faults.append(
            f"{name}: {low:.4g} to {high:.4g} {unit} is an empty range; give the lower bound first,"
            " or a prior with a range if the value of the rig is 0"
        )
    if not low <= value <= high:
        # The user has excluded the rig's value: start in the middle of the range.
        value = (low + high) / 2
    return Parameter(name, unit, value, low, high, prior.mean, prior.std)


def bounds_of(rig: Rig, name: str) -> tuple[float, float]:
    """Return the bounds [SI] of a parameter without a prior; both are 0 if nothing is known."""
    string, own = split_name(name)
    if known := ENDS.get(own) or rig.assumed.get(current_key(name)):
        return known
    value, plectrum = value_of(rig, name), choirs(rig)[string - 1].plectrum
    keys = {key: current_key(name.replace(STIFFNESS, key)) for key in OF_STIFFNESS}
    factors = {key: rig.assumed[at] for key, at in keys.items() if at in rig.assumed}
    if own == STIFFNESS and MODULUS in factors:
        ends = ({key.split(".")[1]: ends[k] for key, ends in factors.items()} for k in (0, 1))
        low, high = (plectrum.model_copy(update=values).bending_stiffness for values in ends)
        return low, high
    low, high = sorted((value / FACTOR, value * FACTOR))
    if own == OVERLAP:
        high = min(high, 0.9 * plectrum.length)
    return low, high


def _near(name: str, known: Sequence[str]) -> str:
    fields = {key.rpartition(".")[2]: key for key in known}
    close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    alike = difflib.get_close_matches(name.rpartition(".")[2], list(fields), n=1)
    if close := close or [fields[field] for field in alike]:
        return f"; did you mean {close[0]!r}?"
    return f"; there are {', '.join(known)}" if known else ""


CLEARANCE_STD = 0.1e-3
"""Standard uncertainty of the string clearance in the rig (m). A recording shows the clearance to
some micrometres. It is therefore always fitted, so that the rise at contact does not act as a
calibration of the vibrometer."""
SLIDING_STD = 2e-3
"""Standard uncertainty of the sliding (1/N): along a key of 150 mm a force of 1 N moves the finger
by 0.3 mm. Servos yield by more: docs/trials.md says what a wider prior changes."""
STRING_STD = 0.3  # Relative, of stiffness and overlap of the plectra of further strings
BOUND_STDS = 10  # Standard uncertainties from a hidden parameter's value to its bounds


def hidden_parameters(rig: Rig, names: Sequence[str]) -> list[Parameter]:
    """Return the hidden parameters of a rig.

    Args:
        names: Names of the free parameters; they are omitted.
    """
    found = [
        _hidden(CLEARANCE, rig.jack.string_clearance, CLEARANCE_STD, "m"),
        hidden(TIME, 0.0, delay_std(rig), ENDS[TIME], "s"),
    ]
    for name, quantity in ((FORCE_GAIN, "force"), (VELOCITY_GAIN, "velocity")):
        std = max(_channel(rig, quantity).gain_std, 1e-6)  # not 0, an infinite weight
        found.append(hidden(name, 1.0, std, ENDS[name]))
    found += [
        _hidden(SLIDING, 0.0, SLIDING_STD, "1/N"),
        _hidden(LATE_SLIDING, 0.0, SLIDING_STD, "1/N"),
        # Relative. The height of release is that of a static string: also the vibration along the
        # plectrum changes it.
        _hidden(RELEASE, 0.0, 5e-3),
        # Of a uniform distribution from 0 to 1.
        hidden(VIBRATION, 0.5, 1 / 12**0.5, ENDS[VIBRATION]),
    ]
    for string in range(2, len(rig.more_choirs) + 2):
        stiffness, overlap, clearance = (name.format(string) for name in OF_STRING)
        free = {own for number, own in map(split_name, names) if number == string}
        found += [_hidden(stiffness, 1.0, STRING_STD)] * free.isdisjoint({MODULUS, STIFFNESS})
        found += [_hidden(overlap, 1.0, STRING_STD)] * (OVERLAP not in free)
        found += [_hidden(clearance, 0.0, CLEARANCE_STD, "m")] * (CLEARANCE not in free)
    damper = rig.jack.damper
    if damper is not None and damper.stiffness > 0:
        std = assumed_std(rig, "jack.damper.stiffness") / damper.stiffness or 0.2  # Relative
        lift_std = assumed_std(rig, "jack.damper.lift") or 0.1e-3  # m
        # There may be no damper: a least stiffness would bias what else the return shows.
        found += [_hidden(DAMPER, 1.0, std, least=0.0)]
        found += [_hidden(DAMPER_LIFT, damper.lift, lift_std, "m")]
    plectrum_is_free = not {MODULUS, STIFFNESS, OVERLAP}.isdisjoint(
        own for _, own in map(split_name, names)
    )
    if plectrum_is_free and rig.plectrum.contact == "surface":
        # Friction is fitted with stiffness and overlap because its effect resembles theirs: an
        # error of 0.03 disappears in the noise and makes the overlap 8 % too large. A string on the
        # mid-line, which no instrument has, also resembles friction. Friction is therefore not
        # fitted there: the place of the string comes first.
        found.append(hidden(FRICTION, rig.plectrum.friction, 0.1, ENDS[FRICTION]))
    if not set(DRY_FRICTIONS).isdisjoint(names):
        # Only their sum is identifiable: at the bound of the free one a gain would take up the rest
        stated = {n: value_of(rig, n) for n in DRY_FRICTIONS if n not in rig.assumed}
        found += [_hidden(n, v, v, unit_of_parameter(n), least=0.0) for n, v in stated.items() if v]
    found = [parameter for parameter in found if parameter.name not in names]
    for error in deviations(rig, unfitted(rig, [*names, *(p.name for p in found)])):
        name, value = error.name, value_of(rig, error.name)
        ends = value + error.low, value + error.high
        found.append(hidden(name, value, error.std, ends, unit_of_parameter(name)))
    return found


def unfitted(rig: Rig, names: Sequence[str]) -> list[str]:
    """Return the numbers of the model that are not among those of these names.

    Of modulus and bending stiffness it is the one with a range, if neither is named.
    """
    of_plectrum = {MODULUS, STIFFNESS}
    if of_plectrum.isdisjoint(names):
        of_plectrum = {STIFFNESS if MODULUS in rig.assumed else MODULUS}
    of_plectrum |= {WIDTH} if STIFFNESS in names else set()  # it has no other effect
    fitted = {key for name in names for key in shared_keys(rig, current_key(name))}
    return [name for name in NAMES if name not in {*names, FORCE, TIME, *of_plectrum, *fitted}]


def delay_std(rig: Rig) -> float:
    """Return the standard uncertainty [s] of the delay between force and motion, above 0."""
    force, velocity = (_channel(rig, quantity) for quantity in ("force", "velocity"))
    return max(float(np.hypot(force.delay_std, velocity.delay_std)), 1e-9)


def assumed_std(rig: Rig, name: str) -> float:
    """Return the standard uncertainty of a value with an assumed range; 0 without a range."""
    return sum(deviation.std for deviation in deviations(rig, [name]))


def _hidden(name: str, value: float, std: float, unit: str = "", least: float = 0.1) -> Parameter:
    """Return a hidden parameter with its value as the mean of its prior.

    Args:
        least: Lower bound, divided by the value.
    """
    low, high = value - BOUND_STDS * std, value + BOUND_STDS * std
    low = max(low, least * value) if value else low
    return hidden(name, value, std, (low, high), unit)


def hidden(
    name: str, mean: float, std: float, ends: tuple[float, float], unit: str = ""
) -> Parameter:
    """Return a hidden parameter that starts at the mean of its prior; SI."""
    return Parameter(name, unit, mean, *ends, mean, std, hidden=True)


def _channel(rig: Rig, quantity: str) -> Channel:
    """Return the first channel of a quantity that every press has."""
    return next(c for c in rig.daq.channels if c.quantity == quantity)

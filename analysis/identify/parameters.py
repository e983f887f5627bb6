"""Parameters that can be fitted: values of the rig by dotted key, with bounds and priors."""

import difflib
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.parameter_names import (
    ENDS,
    FORCE,
    FRICTION,
    MODULUS,
    NAMES,
    OVERLAP,
    STIFFNESS,
    TIME,
    canonical,
    is_name,
    rig_key,
    split_name,
)
from sautereau.analysis.model.choirs import choirs
from sautereau.rig import ranges
from sautereau.rig.faults import fault_list, unit_of
from sautereau.rig.schema import Rig
from sautereau.rig.units import format_quantity, parse_quantity
from sautereau.trajectory.motion import Floats

FACTOR = 10.0  # Ratio of a bound to the rig's value if the rig file assumes no range
OF_STIFFNESS = (MODULUS, "plectrum.width", "plectrum.thickness")
"""Values of which the bending stiffness consists."""
DIFFERENCE = 1e-3  # Step of numerical derivatives, divided by the parameter's scale
FRICTION_DIFFERENCE = 0.02  # The same for friction, whose effect is quadratic near 0
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

    @property
    def difference(self) -> float:
        """Step of numerical derivatives, divided by the scale."""
        rubs = split_name(self.name)[1] == FRICTION
        return FRICTION_DIFFERENCE if rubs else DIFFERENCE


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
    return 0.0 if own.startswith("offset.") else ranges.value_of(rig, rig_key(name))


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
    return changed.replaced({rig_key(name): value for name, value in moduli.items()})


def _with_shared(rig: Rig, name: str, value: float) -> list[tuple[str, float]]:
    """Return the rig's keys that change with a parameter, and their values [SI]."""
    own = rig_key(name)
    others = [key for key in ranges.shared_keys(rig, own) if key != own]
    change = value - value_of(rig, name) if others else 0.0
    return [(own, value), *((key, ranges.value_of(rig, key) + change) for key in others)]


def _parameter(rig: Rig, name: str, prior: Prior, faults: list[str]) -> Parameter:
    """Return a parameter with its bounds; add contradictions to `faults`."""
    value, unit = value_of(rig, name), unit_of_parameter(name)
    low, high = bounds_of(rig, name)
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
    if known := ENDS.get(own) or rig.assumed.get(rig_key(name)):
        return known
    value, plectrum = value_of(rig, name), choirs(rig)[string - 1].plectrum
    keys = {key: rig_key(name.replace(STIFFNESS, key)) for key in OF_STIFFNESS}
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

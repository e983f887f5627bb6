"""One analysis of a session: its presses by condition, with repeatability, drift and comparison.

Only presses of one rig (its plectrum included), one scene or the hardware, and one day are pooled.
Command line, report and notebooks show what `analyse` returns, and compute none of it themselves.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np

from sautereau.analysis.alike import INSTRUMENT
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.model.choirs import string_names
from sautereau.analysis.model.plectrum.levels import LEVELS
from sautereau.analysis.model.predict import JackSpeed, Prediction, predict
from sautereau.analysis.phases import Phases
from sautereau.analysis.press.features import by_string, gain_stds, quantity_of, title_of
from sautereau.analysis.session.analysed import AnalysedPress
from sautereau.analysis.session.budget import bending_of
from sautereau.analysis.session.compare import (
    Comparison,
    compare,
    compared_string,
    predicted_means,
    with_budget,
)
from sautereau.analysis.session.pooled import PooledFeature, pooled_features
from sautereau.analysis.session.repeatability import LEAST, NORMAL, Repeatability, repeatability
from sautereau.rig.document import flat, values_of
from sautereau.rig.errors import SautereauError
from sautereau.rig.faults import unit_of
from sautereau.rig.ranges import value_of
from sautereau.rig.schema import Rig
from sautereau.rig.units import parse_quantity, readable_quantity
from sautereau.trajectory.timing import press_law

HOLD_SPEED = (
    "learn a correction with `sautereau learn` and press with --learned, press with --feed-forward,"
    " lower press.jack_speed, or stiffen the position loops of the controller"
)
"""How to keep the jack's speed while a string is held."""
UNCLEAR = (
    "the sign of the force slope is not known: the finger bounces on the key while the string is"
    " held, or another string is released meanwhile; press more slowly, or with softer loops"
)
SATURATED = "the force is saturated while the string is held; lower the gain, or take a wider range"
"""With `UNCLEAR` why a press is not compared."""
PressT = TypeVar("PressT", bound=AnalysedPress)


@dataclass(frozen=True)
class Condition(Generic[PressT]):
    """Presses that may be pooled, with their comparison and repeatability."""

    values: Mapping[str, Any]
    """Their common values by dotted key: those of the rig and of the `scene`, and the `day`."""
    changed: Mapping[str, Any]
    """Those of `values` that differ from the first condition's."""
    rig: Rig
    """Rig of the recordings."""
    presses: tuple[PressT, ...]
    """In the order in which they were made, with the warm-up presses."""
    prediction: Prediction | None
    """Of the first press for the speed of its jack, at the planned speed if no press has a pluck;
    None if the model has none."""
    comparison: Comparison | None
    features: tuple[PooledFeature, ...]
    """Without warm-up presses, as all that follows."""
    repeatability: Repeatability | None
    warnings: tuple[str, ...]
    """Why a comparison or the repeatability is missing, and what is pooled."""

    @property
    def counted(self) -> tuple[PressT, ...]:
        """The presses without those for warm-up."""
        return tuple(press for press in self.presses if not press.session.warm_up)

    @property
    def simulated(self) -> bool:
        """Whether the stand-in made the presses."""
        return any(press.press.simulated for press in self.presses)

    def of_speed(self, name: str) -> list[float]:
        """Return a column of `OF_SPEED`, of all presses that have it."""
        found = (press.features[name] for press in self.counted)
        return [value for value in found if isinstance(value, float)]

    @property
    def speed_reached(self) -> bool | None:
        """Whether the jack had the planned speed while a string was held; None if unknown."""
        errors = self.of_speed("held_speed_error")
        return max(errors) <= self.rig.press.speed_tolerance if errors else None

    @property
    def speed_verdict(self) -> str:
        """The same as text, with the speeds."""
        errors, tolerance = self.of_speed("held_speed_error"), self.rig.press.speed_tolerance
        missed = sum(error > tolerance for error in errors)
        least, most = min(self.of_speed("held_speed_min")), max(self.of_speed("held_speed_max"))
        verdict = f"not reached in {missed} of {len(errors)} presses" if missed else "reached"
        return (
            f"jack speed while a string is held: {least:.4f} to {most:.4f} m/s, RMS error at most"
            f" {100 * max(errors):.3g} %, press.speed_tolerance {100 * tolerance:.3g} %: {verdict}"
        )


def label_of(condition: Condition, keys: Iterable[str], *, values_only: bool = False) -> str:
    """Return values of a condition as text: `press.jack_speed = 0.06 m/s`, or without the key."""
    values = {key: shown_of(condition, key) for key in keys}
    return ", ".join(f"{v}" if values_only else f"{key} = {v}" for key, v in values.items())


def shown_of(condition: Condition, key: str) -> Any:
    """Return a value of a condition as text; of a list that another one lacks whether it is given.

    What is empty or missing is `none`.
    """
    values = condition.values
    if values.get(key) in (None, "", []):
        return "given" if any(one.startswith(f"{key}.") for one in values) else "none"
    return _shown(key, values[key])


def _shown(key: str, value: Any) -> Any:
    """Return a quantity of the rig with a readable unit, another value as it is."""
    unit = unit_of(Rig, key.split(".")) if isinstance(value, str) else None
    return readable_quantity(parse_quantity(str(value), unit), unit) if unit else value


@dataclass(frozen=True)
class SessionAnalysis(Generic[PressT]):
    """Presses by condition."""

    presses: tuple[PressT, ...]
    """In the order in which they were made."""
    conditions: tuple[Condition[PressT], ...]
    """In the order of their first presses."""
    level: str
    """Plectrum model."""

    @property
    def simulated(self) -> bool:
        """Whether the stand-in made any of the presses."""
        return any(condition.simulated for condition in self.conditions)

    def label(self, condition: Condition[PressT]) -> str:
        """Return the values of a condition that vary between the conditions; empty for one."""
        keys = dict.fromkeys(key for each in self.conditions for key in each.changed)
        return label_of(condition, keys)


def analyse(
    presses: Sequence[PressT], level: str = "auto", rig: Rig | None = None
) -> SessionAnalysis[PressT]:
    """Analyse the presses of one or more sessions.

    Args:
        presses: In the order in which they were made; `AnalysedPress.light` ones suffice.
        rig: The bench to predict with; None for that of each recording.

    Raises:
        AnalysisError: There is no press.
        ModelError: There is no such level.
    """
    LEVELS.get(level)  # an unknown one is refused, also where no press needs it
    if not presses:
        raise AnalysisError("there is no press to analyse; give at least one recording")
    together: dict[str, tuple[dict[str, Any], list[PressT]]] = {}
    for press, values in zip(presses, what_is_alike(presses), strict=True):
        together.setdefault(repr(values), (values, []))[1].append(press)
    base = next(iter(together.values()))[0]
    conditions = tuple(
        _condition(own, values, base, level, rig) for values, own in together.values()
    )
    return SessionAnalysis(tuple(presses), conditions, level)


def what_is_alike(presses: Sequence[AnalysedPress]) -> list[dict[str, Any]]:
    """Return of each press what others must have in common with it to be pooled.

    By dotted key: the rig's values, `scene`, and `day`, which is the first one of its session.
    """
    days: dict[str, str] = {}
    found = []
    for press in presses:
        info = press.session
        day = info.started[:10]
        scene: Any = "the stand-in" if press.press.simulated else "the hardware"
        if info.scene:
            try:
                scene = json.loads(info.scene)
            except ValueError:
                scene = info.scene
        day = days.setdefault(info.session, day) if info.session else day
        found.append(values_of(press.press.rig) | flat({"scene": scene, "day": day}))
    return found


def _condition(
    presses: list[PressT],
    values: Mapping[str, Any],
    base: Mapping[str, Any],
    level: str,
    rig: Rig | None,
) -> Condition[PressT]:
    own = presses[0].press.rig
    counted = [press for press in presses if not press.session.warm_up]
    # Without a pluck where others have one, the key was down, or the plectrum is broken.
    valid = [press for press in counted if press.phases.plucks] or counted
    # A held string of which the jack's speed is unknown cannot be predicted.
    stopped = [press for press in valid if press.phases.plucks and not press.speed]
    known = [press for press in valid if press.speed or not press.phases.plucks]
    rows = [press.features for press in known]
    prediction = comparison = spread = None
    predicted: dict[str, float] = {}
    warnings = _omitted(
        stopped,
        "the jack stops or turns back while its string is held, or is recorded in too few samples;"
        " press without a stop",
    )
    unknown = sum(held.string is None for press in known for held in press.phases.plucks)
    if unknown and unknown < sum(len(press.phases.plucks) for press in known):
        warnings.append(
            f"not compared: {unknown} pluck{'s' * (unknown > 1)} whose string is not known: see"
            " `sautereau phases`"
        )
    silent = [press for press in counted if press not in valid]
    warnings += _omitted(silent, "no pluck was found; see `sautereau phases`")
    warnings += doubtful_presses([bool(press.warnings) for press in known])
    sessions = len({press.session.session for press in presses})
    if sessions > 1:
        warnings.append(f"presses of {sessions} sessions of one day are pooled")
    try:
        each = [
            [_predicted(rig or own, own, level, speed) for speed in press.speeds or (None,)]
            for press in known
        ]
        plucked = [p[0] for press, p in zip(known, each, strict=True) if press.speeds]
        prediction = plucked[0] if plucked else predict(rig or own, level)
        warnings += prediction.warnings
        both, omitted = _to_compare(known, each)
        warnings += omitted
        compared, predictions, speeds = zip(*both, strict=True)
        prediction = predictions[0]
        # Another rig may be the one that these presses are like.
        said = [each.unlike_rig for each in compared if each.unlike_rig]
        unlike = said[0] if 2 * len(said) > len(compared) else ()
        unlike = _another_instrument(own, rig) if rig else unlike
        comparison = with_budget(
            replace(compare(compared, predictions, gain_stds(own)), unlike_rig=unlike),
            rig or own,
            lambda bench: _predicted(bench, own, level, speeds[0]),
            bending_of(own, compared),
        )
        warnings += comparison.budget.omitted if comparison.budget else ()
        predicted = predicted_means(rows, rig or own, each)
    except SautereauError as error:
        warnings.append(f"no comparison with the model: {error}")
    planned = all(press.session.by_arm for press in valid) and own.press.gesture is None
    if len(valid) >= LEAST and planned:
        try:
            spread = repeatability([press.press for press in valid], press_law(own.press))
        except SautereauError as error:
            warnings.append(f"no repeatability: {error}")
    features = pooled_features(rows, predicted, gain_stds(own))
    own_rows = list(zip(known, map(by_string, rows), strict=True))
    for one in features:
        have = [press for press, row in own_rows if isinstance(row.get(one.name), float)]
        for text, size in _changes(one, string_names(own), have):
            if comparison and size > NORMAL * one.shared_std:
                comparison = replace(comparison, unlike_rig=(*comparison.unlike_rig, text))
            else:
                warnings.append(text)
    found = Condition(
        values,
        differing(base, values),
        own,
        tuple(presses),
        prediction,
        comparison,
        features,
        spread,
        tuple(warnings),
    )
    if found.speed_reached is False:
        found = replace(found, warnings=(*warnings, f"{found.speed_verdict}; {HOLD_SPEED}"))
    return found


def _changes(
    feature: PooledFeature, strings: Sequence[str], presses: Sequence[AnalysedPress]
) -> Iterator[tuple[str, float]]:
    """Yield how a feature changes within the presses that have it, and by how much in its unit."""
    scale, unit = quantity_of(feature.name).displayed
    label = title_of(feature.name, strings).replace(f" ({unit})", "")
    names = [press.press.path.name for press in presses]
    if step := feature.step:
        last, next_one = names[step.before - 1 :][:2]
        text = (
            f"the {label} changes from {step.first * scale:.4g} to {step.second * scale:.4g} {unit}"
            f" between {last} and {next_one}: analyse the presses before and after apart"
        )
        yield text, abs(step.second - step.first)
    elif feature.drifts and (drift := feature.drift):
        steps, mean = len(names) - 1, abs(feature.measured.value)
        total, low, high = (steps * each for each in (drift.value, drift.low, drift.high))
        text = (
            f"the {label} drifts by {total * scale:+.3g} {unit} from the first to the last of"
            f" {len(names)} presses ({100 * total / mean:+.2g} %, 95 %: {100 * low / mean:+.2g} to"
            f" {100 * high / mean:+.2g} %): find what changes, or compare fewer at once"
        )
        yield text, abs(total)
    elif feature.scatters and feature.std:
        ends = [values_at(feature.values) for values_at in (np.argmin, np.argmax)]
        least, most = (f"{feature.values[k] * scale:.4g} {unit} in {names[k]}" for k in ends)
        text = (
            f"the {label} varies from {least} to {most}, more than the uncertainty of a press"
            f" ({feature.shared_std * scale:.2g} {unit}): the presses are not of one set-up;"
            " analyse those that are alike apart"
        )
        yield text, float(np.ptp(feature.values))


def _predicted(rig: Rig, own: Rig, level: str, speed: JackSpeed | None) -> Prediction:
    """Return the prediction of a press for the jack speed of a recording.

    The recording's jack motion follows from its key's deflection by the lever lengths of its own
    rig, and by those of another rig for that.

    Args:
        own: Rig of the recording.
    """
    lever = (rig.key.jack_arm / rig.key.laser_arm) / (own.key.jack_arm / own.key.laser_arm)
    return predict(rig, level, speed=speed and speed.scaled(lever))


def _another_instrument(own: Rig, rig: Rig) -> tuple[str, ...]:
    """Return in what a rig is another instrument than that of the recordings.

    Values that may be equal by the ranges that both rigs state do not count.
    """
    recorded, tables, first = values_of(own), [], ""
    for key, value in differing(recorded, values_of(rig)).items():
        if key.partition(".")[0] not in INSTRUMENT or _may_be_equal(own, rig, key):
            continue
        tables.append(key.partition(".")[0])
        first = first or f"{key} = {_shown(key, value)}, recorded {_shown(key, recorded.get(key))}"
    if not tables:
        return ()
    count = f"{len(tables)} value{'s' * (len(tables) > 1)}"
    return (
        f"the rig {rig.name} is not that of the recordings, {own.name}: it has {count} of"
        f" {', '.join(dict.fromkeys(tables))} beyond the ranges, such as {first}",
    )


def _may_be_equal(own: Rig, rig: Rig, key: str) -> bool:
    """Return whether the ranges of a value in two rigs overlap.

    A range that does not contain the rig's value is that of another rig; the value counts alone.
    """
    if key not in {**own.assumed, **rig.assumed}:
        return False
    ends = []
    for one in (own, rig):
        try:
            value = value_of(one, key)
        except (AttributeError, IndexError, TypeError):  # a choir or an optional value
            return False
        low, high = one.assumed.get(key, (value, value))
        ends.append((low, high) if low <= value <= high else (value, value))
    return max(low for low, _ in ends) <= min(high for _, high in ends)


def doubtful_presses(warned: Sequence[bool]) -> list[str]:
    """Return what a result of several presses says about their own warnings.

    Args:
        warned: Whether each press has any.
    """
    if not any(warned):
        return []
    n, some = len(warned), sum(warned)
    return [f"results are doubtful in {some} of {n} presses: see `sautereau phases`"]


def _to_compare(
    presses: Sequence[AnalysedPress], predictions: Sequence[Sequence[Prediction]]
) -> tuple[list[tuple[Phases, Prediction, JackSpeed | None]], list[str]]:
    """Return what is compared: phases, prediction for the speed of the jack, and that speed.

    Returns:
        Them, of each press with a slope of known sign; and a warning about the others.
    """
    string = compared_string([press.phases for press in presses])
    clear: list[tuple[AnalysedPress, Sequence[Prediction]]] = []
    omitted: dict[str, list[AnalysedPress]] = {}
    for press, own in zip(presses, predictions, strict=True):
        held = press.phases.of_string(string)
        if held and (held.saturated or abs(held.force_slope) <= NORMAL * held.force_slope_std):
            reason = SATURATED if held.saturated else UNCLEAR
            omitted.setdefault(reason, []).append(press)
        else:
            clear.append((press, own))
    if not clear:
        raise AnalysisError("; ".join(omitted))
    both: list[tuple[Phases, Prediction, JackSpeed | None]] = [
        (press.phases, predicted, speed)
        for press, own in clear
        for pluck, predicted, speed in zip(press.phases.plucks, own, press.speeds, strict=False)
        if pluck.string == string
    ]
    both = both or [(press.phases, own[0], None) for press, own in clear]
    return both, [text for reason, some in omitted.items() for text in _omitted(some, reason)]


def _omitted(presses: Sequence[AnalysedPress], reason: str) -> list[str]:
    """Return a warning about presses that are not compared, if there are any."""
    names = ", ".join(press.press.path.name for press in presses)
    return [f"not compared: {names}: {reason}"] if presses else []


def differing(base: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values that differ from others, by their keys; None for a missing one.

    A list that one of the two lacks is one difference, without its entries.
    """
    keys = dict.fromkeys([*base, *values])
    found = {key: values.get(key) for key in keys if values.get(key) != base.get(key)}
    lists = tuple(f"{key}." for key in found if [] in (base.get(key), values.get(key)))
    return {key: value for key, value in found.items() if not key.startswith(lists)}

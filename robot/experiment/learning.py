"""Iterative learning control: each press is planned with a correction from those before it."""

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import AwareDatetime, BaseModel, Field, FiniteFloat

from sautereau.analysis.loading.press import load_press
from sautereau.analysis.phases import find_phases
from sautereau.rig.disk import explained, read_limited, write_durably
from sautereau.rig.document import comparable, current_document, rig_document
from sautereau.rig.faults import validating
from sautereau.rig.schema import Controller, Rig
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.feedforward import torque_table
from sautereau.robot.experiment.plan import MOST_LISTED, RigDocument, differences
from sautereau.robot.experiment.session import Item
from sautereau.trajectory.errors import TrajectoryError
from sautereau.trajectory.expected import Expectation
from sautereau.trajectory.learning import CUTOFF, KNOT, Correction, Learner
from sautereau.trajectory.press import Trajectory, plan_press, sent_motion
from sautereau.trajectory.timing import press_law

LARGEST_DOUBT = 1 / (12 * CUTOFF)
"""s, standard uncertainty of a motion's start: twice this is a phase of 60 degrees at the cut-off
frequency, beyond which a correction increases the error."""
HALVINGS = 4  # Times that the change of a correction is halved where the press cannot be planned
MOST_KNOTS = 10_000  # Limit of a correction's points; learning makes about one for each millisecond
_PRESS = ("press", "arm", "controller")  # Another one needs another correction
_INDEPENDENT = {
    "press": {"approach_speed", "hover", "speed_tolerance"},
    "arm": {
        *("acceleration_limit", "approach_speed", "fixture_mass", "home_angles", "jerk_limit"),
        *("lower_limits", "mount_x", "mount_z", "position_tolerance", "servo_damping"),
        *("servo_stiffness", "speed_limit", "tilt_limit", "upper_limits", "fingertip_friction"),
    },
    "controller": {*Controller.model_fields} - {"kind", "sample_period", "full_torque"},
}
"""What alters neither the path of the joints nor their response to it: where and how fast the arm
may move, what `plan` predicts, and the load."""
LEARN = "give the file of `sautereau learn`"  # Where another file is given
_LOAD = ("key", "jack", "plectrum", "string", "more_choirs")  # On the finger


class _Learned(BaseModel, extra="allow"):
    """Validates the text of a correction before it is used."""

    time: list[FiniteFloat] = Field(max_length=MOST_KNOTS)
    rise: list[FiniteFloat] = Field(max_length=MOST_KNOTS)
    learned_for: RigDocument
    learned_on: AwareDatetime | None = None
    load: RigDocument | None = None
    held_speed_error: FiniteFloat | None = None
    peak_force: FiniteFloat | None = None


@dataclass(frozen=True)
class LearnedCorrection:
    """A correction, and the load on the finger under which it was learned.

    The fields about the press are those of the one with the smallest speed error, as
    `sautereau.analysis.session.analysed` names them.
    """

    correction: Correction
    held_speed_error: float | None = None
    """RMS relative error of the jack speed while a string was held; None if unknown."""
    peak_force: float | None = None
    """N, largest force of the finger on the key; None if unknown."""
    learned_on: str = ""
    """Date, ISO 8601; empty in files of version 0.1."""
    doubts: tuple[str, ...] = ()
    """Why it may not fit the present load."""

    def stale(self, errors: Sequence[float], forces: Sequence[float], tolerance: float) -> str:
        """Return how presses contradict a correction that reached its speed; empty if they do not.

        They do where most of them miss the tolerance that learning had reached.

        Args:
            errors: RMS relative errors of the jack speed while a string is held, of each press.
            forces: N, largest forces of the finger on the key, of each press.
            tolerance: `press.speed_tolerance`.
        """
        reached, missed = self.held_speed_error, sum(error > tolerance for error in errors)
        if reached is None or reached > tolerance or 2 * missed <= len(errors):
            return ""
        then, now = f"{100 * reached:.3g} %", f"up to {100 * max(errors):.3g} %"
        if self.peak_force is not None and forces:
            then += f" at a peak force of {self.peak_force:.3g} N"
            now += f" at {np.mean(forces):.3g} N"
        return (
            f"it is stale: on {self.learned_on} the RMS speed error while a string is held was"
            f" {then}, and is {now} now, above press.speed_tolerance {100 * tolerance:.3g} % in"
            f" {missed} of {len(errors)} presses; learn again"
        )


class IterativeLearning:
    """Presses of one plan, each corrected from the recordings of those before it.

    `presses_on` yields the presses; pass the recording of each to `update` before taking the next.
    """

    def __init__(
        self,
        rig: Rig,
        expected: Expectation | None,
        presses: int,
        *,
        measured: Expectation | None = None,
        notes: str = "",
    ):
        """Plan the first press.

        Args:
            expected: Expected force on the finger; None for a key without jacks.
            presses: Largest number of presses.
            measured: Force for the feed-forward, as `measured_force` returns it; None for none.

        Raises:
            TrajectoryError: The press cannot be made even without a correction.
            RobotError: Fewer than 1 press is requested, or no correction could be read again.
        """
        if presses < 1:
            raise RobotError(f"learning: {presses} presses were requested; request 1 or more")
        law, step = press_law(rig.press), KNOT * rig.controller.sample_period
        if (knots := (law.return_start - law.start) / step) > MOST_KNOTS:
            raise RobotError(
                f"learning: {law.return_start - law.start:.3g} s from the run-up to the return need"
                f" {knots:.0f} points of its correction, {MOST_KNOTS} at most; press faster, or"
                " shorten press.bottom_hold"
            )
        self._rig, self._expected, self._presses, self._notes = rig, expected, presses, notes
        self._measured = measured
        self._used: Correction | None = None
        self._trajectory: Trajectory | None = plan_press(rig, expected)
        self.warnings = self._trajectory.warnings
        """Warnings about the plan."""
        self._learner = Learner(law, rig.controller.sample_period)
        self._rounding: list[float] = []
        self._stopped = ""

    @property
    def errors(self) -> list[float]:
        """RMS relative error of the jack speed while a string is held, of every press so far; over
        the cruise without a pluck."""
        return self._learner.errors

    @property
    def stopped(self) -> str:
        """Why learning has ended before the last press; empty if it has not."""
        return self._stopped or self._learner.stopped

    @property
    def rounding(self) -> float:
        """RMS relative error of the speed by rounding the best press's plan to encoder counts."""
        return self._rounding[int(np.argmin(self.errors))]

    @property
    def scatter(self) -> float | None:
        """RMS relative difference of the speed from press to press; None after one press."""
        return self._learner.scatter

    @property
    def fast(self) -> float:
        """RMS relative error of the best press's speed above the frequencies of corrections."""
        return self._learner.fast

    @property
    def floor(self) -> float:
        """RMS relative error of the speed that no correction removes: rounding, scatter, and what
        is faster than a correction."""
        return math.hypot(self.rounding, self.scatter or 0.0, self.fast)

    @property
    def best(self) -> Correction | None:
        """The correction with the smallest error; None for the plan itself."""
        return self._learner.best

    def presses_on(self, rig: Rig) -> Iterator[Item]:
        """Yield the presses that are left, on the bench with the addresses of its devices."""
        for number in range(len(self.errors) + 1, self._presses + 1):
            if self._trajectory is None:
                return
            torques = None
            if self._measured is not None:
                torques = torque_table(self._rig, self._trajectory, self._measured)
            yield Item(rig, self._trajectory, number, notes=self._notes, torques=torques)

    def update(self, item: Item, path: Path) -> None:
        """Compute the next correction from the recording of a press, and plan with it.

        Raises:
            SautereauError: The recording has no speed over the complete press, or the start of
                its motion is not known well enough.
        """
        press = load_press(path)
        start = press.motion
        if start is None or start.std > LARGEST_DOUBT:
            std = "unknown" if start is None else f"known to +-{start.std * 1e3:.3g} ms only"
            raise RobotError(
                f"learning from {path}: the start of the motion is {std}, and learning up to"
                f" {CUTOFF:g} Hz needs +-{LARGEST_DOUBT * 1e3:.2g} ms; free the computer that"
                " streams the motion, check the vibrometer, or use a controller with a trigger"
                " output"
            )
        time = press.time - start.time
        speed, force = press.samples["jack_speed"], press.samples["force"]
        segments = item.trajectory.segments
        ticks = np.clip(time / self._rig.controller.sample_period, 0, segments.total_samples)
        sent = sent_motion(self._rig, segments, ticks).velocity
        held = [(held.contact, held.release) for held in find_phases(press).plucks]
        strings = np.array(held).reshape(-1, 2) - start.time
        correction = self._learner.learn(self._used, time, sent, speed, strings, force)
        self._rounding.append(item.trajectory.cruise.rms_error)
        self._trajectory = None
        if correction is not None:
            self.plan(correction)

    def plan(self, correction: Correction) -> None:
        """Plan the next press; halve the change of a correction that cannot be planned."""
        self._trajectory, reason = None, ""
        last = np.zeros_like(correction.rise)
        if self._used is not None:
            last = np.interp(correction.time, self._used.time, self._used.rise)
        for _ in range(HALVINGS + 1):
            try:
                trajectory = plan_press(self._rig, self._expected, correction)
            except TrajectoryError as error:
                reason = str(error)
                correction = Correction(correction.time, (correction.rise + last) / 2)
                continue
            rounding, least = trajectory.cruise.rms_error, min(self.errors, default=math.inf)
            if rounding < least:
                self._trajectory, self._used = trajectory, correction
            else:
                self._stopped = (
                    f"rounding to encoder counts gives the next correction an error of"
                    f" {100 * rounding:.3g} %, and the error is {100 * least:.3g} % already"
                )
            return
        self._stopped = f"the correction cannot be pressed, not even halved {HALVINGS} times: "
        self._stopped += reason


def write_learned(
    path: Path, rig: Rig, learned: LearnedCorrection, errors: list[float], feed_forward: str = ""
) -> None:
    """Write a correction into a new file, with its date, and the rig it was learned for.

    Args:
        errors: RMS relative error of the jack speed over the cruise, of every press.
        feed_forward: SHA-256 of the recording of the feed-forward; empty for none.

    Raises:
        RobotError: The file exists, or cannot be written.
    """
    correction = learned.correction
    document = {
        "time": correction.time.tolist(),
        "rise": correction.rise.tolist(),
        "rms_speed_error": errors,
        "held_speed_error": learned.held_speed_error,
        "peak_force": learned.peak_force,
        "learned_on": learned.learned_on or datetime.now(UTC).isoformat(timespec="seconds"),
        "learned_for": _learned_for(rig, feed_forward),
        "load": _part(rig, _LOAD),
    }
    text = json.dumps(document, indent=1, allow_nan=False) + "\n"
    origin = f"learned correction {path}: cannot be written"
    with explained(RobotError, origin, "give another folder"):
        write_durably(path, text)


def read_learned(path: Path, rig: Rig, feed_forward: str = "") -> LearnedCorrection:
    """Read a correction that was learned for a rig's press.

    Args:
        feed_forward: SHA-256 of the recording of the feed-forward; empty for none.

    Raises:
        RobotError: The file cannot be read, or it was learned for another press, arm or
            controller.
        TrajectoryError: It holds no valid correction.
    """
    origin = f"learned correction {path}: cannot be read"
    with validating(_Learned, RobotError, origin, fix=LEARN), explained(RobotError, origin, LEARN):
        found = _Learned.model_validate_json(read_limited(path))
    then, now = current_document(found.learned_for.model_dump()), _learned_for(rig, feed_forward)
    if faults := [*differences(_motion(then, now), _motion(now, now))]:
        raise RobotError(
            f"learned correction {path}: it was learned for another press:\n  "
            + "\n  ".join(faults)
            + "\nlearn again, or press as it was learned"
        )
    learned_on = found.learned_on.date().isoformat() if found.learned_on else ""
    doubt = ""
    if found.load is None:
        doubt = (
            "its date and load are not known, because version 0.1 wrote it; learn again if the"
            " jack's load may have changed"
        )
    else:
        before = _load(current_document(found.load.model_dump()), then)
        changes = [*differences(before, _load(rig_document(rig), now))]
        listed = changes[:MOST_LISTED]
        if more := len(changes) - len(listed):
            listed.append(f"and {more} more")
        if changes:
            load = f"under another load ({'; '.join(listed)})"
            doubt = f"it was learned on {learned_on} {load}; learn again"
    return LearnedCorrection(
        Correction(np.array(found.time), np.array(found.rise)),
        found.held_speed_error,
        found.peak_force,
        learned_on,
        (f"learned correction {path}: {doubt}",) if doubt else (),
    )


def _motion(document: dict[str, Any], sections: Iterable[str]) -> dict[str, Any]:
    """Return what a correction depends on, of a document with press, arm and controller."""
    found = {}
    for section in sections:
        value, others = document.get(section), _INDEPENDENT.get(section, ())
        if isinstance(value, dict):
            value = {key: part for key, part in value.items() if key not in others}
        found[section] = value
    return found


def _load(document: dict[str, Any], press: dict[str, Any]) -> dict[str, Any]:
    """Return what loads the finger: key and choirs, and the friction on its tip."""
    friction = (press.get("arm") or {}).get("fingertip_friction")
    return {name: document.get(name) for name in _LOAD} | {"arm.fingertip_friction": friction}


def _learned_for(rig: Rig, feed_forward: str) -> dict[str, Any]:
    """Return the press of a correction, as TOML would hold it."""
    return _part(rig, _PRESS) | {"feed_forward": feed_forward}


def _part(rig: Rig, sections: tuple[str, ...]) -> dict[str, Any]:
    document = comparable(rig_document(rig))
    return {section: document[section] for section in sections}

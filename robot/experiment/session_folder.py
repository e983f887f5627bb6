"""A session's folder, which it has alone: the presses that are made, and the plan, in a manifest.

The manifest is written before the first press.
"""

import json
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pydantic import BaseModel, Field, FiniteFloat, JsonValue

from sautereau.daq.file.container.durable import PART
from sautereau.daq.file.reading import read_recording, read_session
from sautereau.daq.file.recorded import date_now
from sautereau.daq.source.connection import hold_card
from sautereau.rig.disk import (
    TEXT_LIMIT,
    explained,
    make_folder,
    read_limited,
    write_durably,
)
from sautereau.rig.document import comparable, current_document, current_key
from sautereau.rig.faults import validating
from sautereau.rig.lock import Taken, locked
from sautereau.rig.schema import Rig
from sautereau.robot.drivers.serial_port import hold_port
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.plan import MOST_PRESSES, Plan, RigDocument, check_same
from sautereau.robot.experiment.session import WRITABLE

MANIFEST = "session.json"  # Name of the file in the session's folder
VERSION = 1  # Version of the file
LONGEST_NAME = 200  # Characters of the session's identity, and of a date
LOCK = ".session.lock"  # File of the lock, while a session runs


@dataclass(frozen=True)
class Manifest:
    """One session: its identity, its plan, and how the instrument is set up."""

    session: str
    """Identity, which every recording of the session contains."""
    started: str
    """ISO 8601 with the time zone."""
    seed: int | None
    """Seed of the stand-in's random numbers; None on the hardware."""
    plan: Mapping[str, Any]
    """The plan, as JSON holds it."""
    set_up: Mapping[str, Any]
    """What the operator was last asked to set on the instrument, by the rig's dotted key."""
    invalid: Sequence[str] = field(default_factory=list)
    """Names of recordings whose presses are made again, because the instrument was at fault."""


_Values = dict[str, str | int | FiniteFloat | list[str | FiniteFloat]]  # A gesture is a list


class _Press(BaseModel, extra="allow"):
    values: _Values


class _Plan(BaseModel, extra="allow"):
    rig: RigDocument = RigDocument()
    scene: str | dict[str, JsonValue] = ""
    presses: list[_Press] = Field(default=[], max_length=MOST_PRESSES)


class _Manifest(BaseModel, extra="allow"):
    """Validates the text of a manifest before it is used."""

    version: int
    session: str = Field(max_length=LONGEST_NAME)
    started: str = Field(max_length=LONGEST_NAME)
    seed: int | None = Field(ge=0, lt=2**64)
    plan: _Plan
    set_up: _Values
    invalid: list[str] = Field(default=[], max_length=MOST_PRESSES)


class SessionFolder:
    """The folder of one session, new or started.

    The presses that are made are found from the recordings: one with its final name is complete.
    """

    def __init__(
        self,
        path: Path,
        plan: Plan | Callable[["Manifest | None"], Plan],
        seed: int | None,
        fresh_seed: int | None,
        current_scene: Callable[[dict[str, Any]], dict[str, Any]] = dict,
    ):
        """Read the folder; nothing is written.

        Args:
            plan: The plan, or a function that returns it from the session that was started before.
            seed: Of the stand-in's random numbers, as requested; None for that of the session.
            fresh_seed: Of a new session without a requested seed; None on the hardware.
            current_scene: Adds to the document of a scene what its version did not have.

        Raises:
            RobotError: It contains another session.
            daq.errors.RecordingError: A recording in it cannot be read.
        """
        self.path = path
        stored = started = read_manifest(path)
        self.plan = plan = plan(started) if callable(plan) else plan
        asked = plan.document()
        self.resumed = started is not None
        """Whether the session was started before."""
        if started is not None:
            requested = started.seed if seed is None else seed
            before = {**started.plan, "seed": started.seed, "warm_up": plan.warm_up}
            if plan.rows is None:  # each is compared when the plan requests it
                asked["presses"] = before.get("presses", [])
            elif extends(before.get("presses", []), asked["presses"]):
                before["presses"] = asked["presses"]
                started = replace(started, plan={**started.plan, "presses": asked["presses"]})
            if isinstance(before.get("scene"), dict):
                before["scene"] = current_scene(before["scene"])
            check_same(path, before, {**asked, "seed": requested})
        self._manifest = started or Manifest(
            session=uuid.uuid4().hex,
            started=date_now(),
            seed=fresh_seed if seed is None else seed,
            plan=asked,
            set_up={},
        )
        self._written = self._manifest == stored
        _text_of(path, self._manifest)
        self.session = self._manifest.session
        """Identity, which every recording of the session contains."""
        self.seed = self._manifest.seed
        """Seed of the session's random numbers; None on the hardware."""
        self.done: dict[int, Path] = {}
        """Recordings by the number of the press in the plan."""
        self.warm_ups: list[Path] = []
        """Recordings of warm-up presses."""
        self.others = 0
        """Recordings in the folder that do not belong to this session."""
        self.incomplete: list[Path] = []
        """Recordings of this session that were recovered, or whose press was aborted or invalid;
        their presses are made again."""
        self._find()

    @property
    def set_up(self) -> Mapping[str, Any]:
        """What the operator was last asked to set on the instrument."""
        return self._manifest.set_up

    @property
    def left_behind(self) -> list[Path]:
        """Incomplete recordings; they are kept."""
        return sorted(self.path.glob(f"*.mcap{PART}"))

    def start(self) -> None:
        """Write the manifest of a new session, or of one that is extended."""
        if not self._written:
            make_folder(self.path)
            write_manifest(self.path, self._manifest)
            self.resumed = self._written = True

    def row(self, number: int) -> Mapping[str, Any] | None:
        """Return the noted row of a plan, counted from 0; None for one that was not requested."""
        rows = self._manifest.plan["presses"]
        return rows[number] if number < len(rows) else None

    def note_row(self, number: int, row: Mapping[str, Any]) -> None:
        """Note a row of the plan before its presses are made, or compare it with the noted one.

        Raises:
            RobotError: The plan has requested another row at this place before.
        """
        noted, row = self.row(number), json.loads(json.dumps(row))
        if noted is not None:
            check_same(self.path, {f"presses.{number + 1}": noted}, {f"presses.{number + 1}": row})
            return
        plan = {**self._manifest.plan, "presses": [*self._manifest.plan["presses"], row]}
        manifest = replace(self._manifest, plan=plan)
        _text_of(self.path, manifest)
        self._manifest = manifest
        if self.resumed:
            write_manifest(self.path, self._manifest)

    def note_set_up(self, set_up: Mapping[str, Any]) -> None:
        """Note what the operator was asked to set on the instrument."""
        self.start()
        self._manifest = replace(self._manifest, set_up=dict(set_up))
        write_manifest(self.path, self._manifest)

    def note_invalid(self, recording: Path) -> None:
        """Note a recording whose press is to be made again."""
        self.incomplete.append(recording)
        invalid = [*self._manifest.invalid, recording.name]
        self._manifest = replace(self._manifest, invalid=invalid)
        write_manifest(self.path, self._manifest)

    def _find(self) -> None:
        """Find the presses that are made."""
        paths = sorted(self.path.glob("*.mcap")) if self.path.is_dir() else []
        read = {path: read_session(path) for path in paths}
        own = {path: found for path, found in read.items() if found.session == self.session}
        self.warm_ups = [path for path, found in own.items() if found.warm_up]
        presses = {path: found.item for path, found in own.items() if not found.warm_up}
        self.others = len(paths) - len(own)
        counted = {found.item for found in own.values() if found.warm_up and found.item}
        for path, number in presses.items():
            if number is None:
                self.others += 1
                continue
            number -= sum(before < number for before in counted)  # version 0.1 counted warm-ups
            if path.name in self._manifest.invalid or not read_recording(path).complete:
                self.incomplete.append(path)
            elif number in self.done:
                raise RobotError(
                    f"session folder {self.path}: {path.name} and {self.done[number].name} are"
                    f" both press {number} of the session; move one of them away"
                )
            else:
                self.done[number] = path


def extends(started: Sequence[Mapping[str, Any]], asked: Sequence[Mapping[str, Any]]) -> bool:
    """Return whether requested rows are those of a session, with more presses at their end.

    Then all presses that are made keep their numbers.
    """
    if not started or len(asked) < len(started):
        return False
    *same, last = started
    *first, final = asked[: len(started)]
    return (
        same == first
        and last == {**final, "repeats": last.get("repeats")}
        and isinstance(last["repeats"], int)  # of a damaged manifest it may be anything
        and last["repeats"] <= final["repeats"]
    )


def read_manifest(folder: Path) -> Manifest | None:
    """Read a folder's manifest; None where it has none.

    Raises:
        RobotError: It cannot be read, or another version has written it.
    """
    path, fix = folder / MANIFEST, "restore it from a copy, or give another folder"
    origin = f"session {path}: cannot be read"
    with validating(_Manifest, RobotError, origin, fix=fix), explained(RobotError, origin, fix):
        try:
            text = read_limited(path)
        except FileNotFoundError:
            return None
        if (version := _Manifest.model_validate_json(text).version) != VERSION:
            raise RobotError(
                f"session {path}: it is of version {version}, not {VERSION}; continue with the"
                " version of sautereau that started it, or give another folder"
            )
        found = json.loads(text)
        found["plan"]["rig"] = comparable(current_document(found["plan"].get("rig", {})))
        for row in found["plan"].get("presses", ()):
            row["values"] = {current_key(key): value for key, value in row["values"].items()}
        found["set_up"] = {current_key(key): value for key, value in found["set_up"].items()}
        return Manifest(**{n: found[n] for n in Manifest.__dataclass_fields__ if n in found})


def _text_of(folder: Path, manifest: Manifest) -> str:
    """Return the text of a manifest that `read_manifest` will read.

    Raises:
        RobotError: It is beyond the limits of the reader.
    """
    origin = f"session {folder / MANIFEST}: the plan cannot be written"
    fix = "change the plan, or divide it into sessions"
    try:
        text = json.dumps({"version": VERSION} | vars(manifest), indent=1, allow_nan=False)
    except ValueError as error:
        raise RobotError(f"{origin}: {error}; change the plan") from error
    with validating(_Manifest, RobotError, origin, fix=fix):
        _Manifest.model_validate_json(text)
    if len(text) >= TEXT_LIMIT:
        raise RobotError(
            f"{origin}: {len(text) / 1e6:.3g} MB, {TEXT_LIMIT / 1e6:g} MB at most; shorten the"
            " notes, or divide it into sessions"
        )
    return text + "\n"


def write_manifest(folder: Path, manifest: Manifest) -> None:
    """Write a folder's manifest, so that it is always complete: the old one or the new one.

    Raises:
        RobotError: It cannot be written, or not be read again.
    """
    path, text = folder / MANIFEST, _text_of(folder, manifest)
    fix = "give a folder that can be written, with room on its disk"
    with explained(RobotError, f"session {path}: cannot be written", fix):
        write_durably(path, text, replace=True)


@contextmanager
def only_session(folder: Path, rig: Rig | None = None) -> Iterator[None]:
    """Hold a folder, card and controller for one session, also between presses and in pauses.

    The folder is created, and removed again if nothing is written. An error that is raised in the
    block remains the one that is raised.

    Args:
        rig: Names card and controller; None for a stand-in, which nobody else uses.

    Raises:
        RobotError: Another session runs in the folder, it cannot be written, or another process
            uses the controller.
        DaqError: Another process uses the card.
    """
    with ExitStack() as stack:
        if not folder.exists():
            stack.callback(_remove_empty, folder)
        try:
            with explained(RobotError, f"session folder {folder}", WRITABLE):
                make_folder(folder)
                stack.enter_context(locked(folder / LOCK))
        except Taken as error:
            raise RobotError(
                f"session folder {folder}: {error} runs a session in it; wait until it has ended,"
                " or give another --out"
            ) from error
        if rig is not None:
            purpose = f"a session in {folder.absolute()}"
            stack.enter_context(hold_card(rig.daq, purpose, shared=True))
            stack.enter_context(hold_port(rig.controller.port, purpose, shared=True))
        try:
            yield
        except BaseException as error:
            if not folder.is_dir():
                error.add_note(
                    f"The folder {folder} was removed or renamed during the session. If it was"
                    " removed, all recordings in it are lost"
                )
            raise


def _remove_empty(folder: Path) -> None:
    with suppress(OSError):  # it is not empty, or gone
        folder.rmdir()

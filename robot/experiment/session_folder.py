"""A session's folder: its plan, and the presses that are made."""

import uuid
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from sautereau.daq.file.container.durable import PART
from sautereau.daq.file.reading import read_session
from sautereau.robot.errors import RobotError
from sautereau.robot.experiment.manifest import Manifest, check_same, read_manifest, write_manifest
from sautereau.robot.experiment.plan import Plan


class SessionFolder:
    """The folder of one session, new or started.

    The presses that are made are found from the recordings: one with its final name is complete.
    """

    def __init__(self, path: Path, plan: Plan, seed: int | None, fresh_seed: int | None):
        """Read the folder; nothing is written.

        Args:
            path: Of the folder, which need not exist.
            plan: Of the session.
            seed: Of the stand-in's random numbers, as requested; None for that of the session.
            fresh_seed: Of a new session without a requested seed; None on the hardware.

        Raises:
            RobotError: It contains another session.
            daq.errors.RecordingError: A recording in it cannot be read.
        """
        self.path = path
        self.plan = plan
        started = read_manifest(path)
        asked = plan.document()
        self.resumed = started is not None
        """Whether the session was started before."""
        if started is not None:
            requested = started.seed if seed is None else seed
            check_same(path, {**started.plan, "seed": started.seed}, {**asked, "seed": requested})
        self._manifest = started or Manifest(
            session=uuid.uuid4().hex,
            started=datetime.now(UTC).isoformat(timespec="milliseconds"),
            seed=fresh_seed if seed is None else seed,
            plan=asked,
            set_up={},
        )
        self.done: dict[int, Path] = {}
        """Recordings by the number of the press in the plan."""
        self.others = 0
        """Recordings in the folder that do not belong to this session."""
        self._find()

    @property
    def session(self) -> str:
        """Identity, which every recording of the session contains."""
        return self._manifest.session

    @property
    def seed(self) -> int | None:
        """Of the session's random numbers; None on the hardware."""
        return self._manifest.seed

    @property
    def set_up(self) -> Mapping[str, Any]:
        """What the operator was last asked to set on the instrument."""
        return self._manifest.set_up

    @property
    def left_behind(self) -> list[Path]:
        """Incomplete recordings; they are kept."""
        return sorted(self.path.glob(f"*.mcap{PART}"))

    def start(self) -> None:
        """Write the manifest of a new session."""
        if not self.resumed:
            self.path.mkdir(parents=True, exist_ok=True)
            write_manifest(self.path, self._manifest)
            self.resumed = True

    def note_set_up(self, set_up: Mapping[str, Any]) -> None:
        """Note what the operator was asked to set on the instrument."""
        self.start()
        self._manifest = replace(self._manifest, set_up=dict(set_up))
        write_manifest(self.path, self._manifest)

    def _find(self) -> None:
        """Find the presses that are made, from the head of every recording."""
        for path in sorted(self.path.glob("*.mcap")) if self.path.is_dir() else []:
            found = read_session(path)
            if found.session != self.session or found.item is None:
                self.others += 1
            elif found.item in self.done:
                raise RobotError(
                    f"session folder {self.path}: {path.name} and {self.done[found.item].name} are"
                    f" both press {found.item} of the session; move one of them away"
                )
            else:
                self.done[found.item] = path

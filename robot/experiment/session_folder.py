"""A session's folder: what is planned, what is made, what is left."""

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
    """The folder of one session, begun or to be begun.

    What is done is found from the recordings themselves: one that has its name is whole.
    """

    def __init__(self, path: Path, plan: Plan, seed: int | None, fresh_seed: int | None):
        """Look into the folder; nothing is written.

        Args:
            path: Of the folder, which need not be there.
            plan: What the session makes.
            seed: Of the stand-in's random numbers, as asked for; None for that of the session.
            fresh_seed: That of a session that is begun without one; None on the hardware.

        Raises:
            RobotError: Another session is in it.
            daq.errors.RecordingError: A recording in it cannot be read.
        """
        self.path = path
        self.plan = plan
        begun = read_manifest(path)
        asked = plan.document()
        self.resumed = begun is not None
        """Whether the session was begun before."""
        if begun is not None:
            wanted = begun.seed if seed is None else seed
            check_same(path, {**begun.plan, "seed": begun.seed}, {**asked, "seed": wanted})
        self._manifest = begun or Manifest(
            session=uuid.uuid4().hex,
            started=datetime.now(UTC).isoformat(timespec="milliseconds"),
            seed=fresh_seed if seed is None else seed,
            plan=asked,
            set_up={},
        )
        self.done: dict[int, Path] = {}
        """Recordings by the number of the press in the plan."""
        self.others = 0
        """Recordings in the folder that are none of this session."""
        self._find()

    @property
    def session(self) -> str:
        """Identity, which every recording of the session carries."""
        return self._manifest.session

    @property
    def seed(self) -> int | None:
        """Of the session's random numbers; None on the hardware."""
        return self._manifest.seed

    @property
    def set_up(self) -> Mapping[str, Any]:
        """What the operator was last told to set on the instrument."""
        return self._manifest.set_up

    @property
    def left_behind(self) -> list[Path]:
        """Recordings that were cut short; they stay."""
        return sorted(self.path.glob(f"*.mcap{PART}"))

    def begin(self) -> None:
        """Write the manifest of a session that is not begun yet."""
        if not self.resumed:
            self.path.mkdir(parents=True, exist_ok=True)
            write_manifest(self.path, self._manifest)
            self.resumed = True

    def tell(self, set_up: Mapping[str, Any]) -> None:
        """Note what the operator was told to set on the instrument."""
        self.begin()
        self._manifest = replace(self._manifest, set_up=dict(set_up))
        write_manifest(self.path, self._manifest)

    def _find(self) -> None:
        """Find what is made already, from the head of every recording."""
        for path in sorted(self.path.glob("*.mcap")) if self.path.is_dir() else []:
            told = read_session(path)
            if told.session != self.session or told.item is None:
                self.others += 1
            elif told.item in self.done:
                raise RobotError(
                    f"session folder {self.path}: {path.name} and {self.done[told.item].name} are"
                    f" both press {told.item} of the session; move one of them away"
                )
            else:
                self.done[told.item] = path

"""The devices of a bench: the hardware, or the stand-in."""

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from sautereau.analysis.results.rig import Rig
from sautereau.analysis.text import wrapped
from sautereau.rig import schema
from sautereau.rig.disk import write_durably
from sautereau.robot.experiment.monitor import Control
from sautereau.robot.experiment.run import Bench
from sautereau.robot.experiment.session_folder import Manifest

if TYPE_CHECKING:
    from sautereau.sim_backend.scene import Scene


@dataclass(frozen=True)
class Connected(Bench):
    """The devices of a bench, real or simulated, while they are in use."""

    reached: str = ""
    """Engine and step of the stand-in, and the accuracy they reach if its scene requests one."""
    truth: Callable[[], Any] | None = None
    """Return the true events of the last press, if the scene records them."""

    @property
    def where(self) -> str:
        return _where(bool(self.scene))

    def keep_truth(self, recording: Path) -> None:
        """Write the true events beside a recording, if the scene records them."""
        if self.truth:
            text = json.dumps(asdict(self.truth()), indent=2, default=str, allow_nan=False)
            write_durably(recording.with_suffix(".truth.json"), text + "\n")


def at_terminal(text: str) -> str | None:
    """Ask the operator in a terminal or notebook; None if there is neither."""
    if "ipykernel" not in sys.modules and not (sys.stdin.isatty() and sys.stderr.isatty()):
        return None
    sys.stderr.write(wrapped(f"{text} Continue with Enter, stop with Ctrl-C.") + " ")
    sys.stderr.flush()
    if "ipykernel" in sys.modules:
        return input()
    line = sys.stdin.readline()
    return line.strip() if line else None


class Devices:
    """The devices that a session uses.

    Args:
        rig: The nominal rig.
        scene: The stand-in's scene; None for the hardware.
        seed: Seed of the stand-in's random numbers; None for a new one in each session.
        ask: Asks the operator; returns None if there is none.
    """

    def __init__(
        self,
        rig: Rig,
        scene: "Scene | None" = None,
        seed: int | None = None,
        ask: Callable[[str], str | None] = at_terminal,
    ):
        self.rig, self.scene, self.seed, self.ask = rig, scene, seed, ask
        self.control = Control()

    @property
    def real(self) -> schema.Rig | None:
        """The rig of the hardware; None for the stand-in."""
        return self.rig.values if self.scene is None else None

    def continuing(self, started: Manifest | None) -> Self:
        """Return the devices of a session that was started, with its engine in place of `auto`.

        Args:
            started: The session; None for a new one.
        """
        before = started and started.plan.get("scene")
        if self.scene is None or self.scene.engine != "auto" or not isinstance(before, dict):
            return self
        from sautereau.sim_backend.scene import current_scene

        found = copy(self)
        engine = current_scene(before)["engine"]
        found.scene = self.scene.model_copy(update={"engine": engine})
        return found

    @property
    def scene_text(self) -> str:
        """The stand-in's scene on this rig as JSON; empty for the hardware."""
        return self.scene.on_rig(self.rig.values).model_dump_json() if self.scene else ""

    @property
    def where(self) -> str:
        """Name of the bench in messages."""
        return f"rig {self.rig.name} on {_where(self.scene is not None)}"

    @contextmanager
    def connected(
        self, rig: schema.Rig | None = None, seed: int | None = None
    ) -> Iterator[Connected]:
        """Yield the devices of the bench.

        Args:
            rig: Rig with the instrument as it is set up; None for the nominal one.
            seed: Seed of the stand-in; None for that of the bench or, without one, a new seed.
        """
        rig = rig or self.rig.values
        if self.scene is None:
            yield Connected(rig)
            return
        from sautereau.sim_backend.bench import StandIn

        seed = self.seed if seed is None else seed
        seed = fresh_seed() if seed is None else seed
        scene = self.scene.on_rig(rig)
        with StandIn(rig, scene, seed) as served:
            yield Connected(
                served.rig,
                scene.model_dump_json(),
                seed,
                served.bench.reached,
                (lambda: served.truth()[-1]) if scene.record_truth else None,
            )


def _where(simulated: bool) -> str:
    return "the stand-in: SIMULATED" if simulated else "the hardware"


def fresh_seed() -> int:
    """Return a random seed."""
    import secrets

    return secrets.randbits(32)

"""Sessions made of one press of the stand-in, with other noise and metadata."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.simulated import acquired
from sautereau.daq.file.recorded import Block, Recorded
from sautereau.daq.file.recording import Recording
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig
from sautereau.sim_backend.physics.observation import observe
from sautereau.sim_backend.scene import load_scene


@dataclass(frozen=True)
class SessionWriter:
    """Writes recordings that differ in their noise and in their metadata."""

    one: Recorded

    def __call__(
        self,
        folder: Path,
        n: int,
        *,
        first: int = 1,
        rig: Rig | None = None,
        events: tuple[tuple[str, str], ...] = (),
        noise: float = 1e-3,
        scale: float = 1.0,
        **metadata: object,
    ) -> list[Path]:
        """Write n presses into a folder; `noise` is in V, `scale` multiplies all volts."""
        folder.mkdir(parents=True, exist_ok=True)
        paths = []
        rig = rig or self.one.rig
        volts = np.stack([self.one.volts[channel.name] for channel in self.one.rig.daq.channels])
        for number in range(first, first + n):
            random = np.random.default_rng(number)
            session = replace(self.one.session, press=number, item=number, **metadata)
            path = folder / f"press-{number:04d}.mcap"
            with Recording(path, rig, session=session, rate=self.one.rate) as recording:
                noisy = scale * volts + noise * random.standard_normal(volts.shape)
                recording.write_block(Block(self.one.first_sample, noisy))
                recording.event("trigger", "edge on PFI0", 0.0)
                for kind, text in events:
                    recording.event(kind, text, 0.0)
            paths.append(path)
        return paths


def session_writer() -> SessionWriter:
    """Return a writer of presses of the scene `ideal`, simulated without the devices."""
    rig, scene = load_rig(), load_scene("ideal")
    return SessionWriter(acquired(rig, scene, observe(rig, scene))[0])

"""Record without the robot, for as long as wanted."""

import math
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

from sautereau.daq.errors import DaqError
from sautereau.daq.file.recorded import Block
from sautereau.daq.file.recording import Recording
from sautereau.daq.file.session_info import SessionInfo
from sautereau.daq.source.acquisition import Acquisition
from sautereau.rig.schema import Rig

NO_PRESS = 0
"""Number of the press in a recording of none."""


def record(
    rig: Rig,
    path: Path,
    duration_s: float | None = None,
    *,
    triggered: bool = False,
    scene: str = "",
    seed: int | None = None,
    notes: str = "",
    wanted: Callable[[], bool] = lambda: True,
    on_block: Callable[[int], None] = lambda n: None,
) -> int:
    """Record all channels of a rig into one file.

    Args:
        rig: The bench.
        path: Of the recording; it must not exist.
        duration_s: s; None for as long as it is wanted.
        triggered: Whether the trigger's edge begins it; else it begins at once.
        scene: Text of the stand-in's scene; empty on the hardware.
        seed: Of the stand-in's random numbers.
        notes: The operator's.
        wanted: Asked after every block whether to go on.
        on_block: Called with the samples of each channel that there are.

    Returns:
        Samples of each channel.

    Raises:
        DaqError: Of the acquisition or the recording; what came before is kept beside ``path``.
    """
    if duration_s is not None and not 0 < duration_s < math.inf:
        raise DaqError(
            f"recording of {duration_s:g} s: the duration must be a number above 0 s; give one, or"
            " none to go on until it is stopped"
        )
    with Acquisition(rig.daq, None, triggered=triggered) as acquisition:
        limit = math.inf
        if duration_s is not None:
            # The product's last digits are noise of binary fractions, not another sample.
            limit = max(1, math.ceil(round(duration_s * acquisition.rate, 6)))
        session = SessionInfo(
            press=NO_PRESS,
            started=datetime.now(UTC).isoformat(timespec="milliseconds"),
            simulated=acquisition.simulated,
            controller="",
            daq=acquisition.device_description,
            scene=scene,
            seed=seed,
            notes=notes,
        )
        with Recording(path, rig, session=session, rate=acquisition.rate) as recording:
            acquisition.start()
            for block in acquisition.blocks():
                there = block.first_sample + block.volts.shape[1]
                if there > limit:
                    there = int(limit)
                    block = Block(block.first_sample, block.volts[:, : there - block.first_sample])
                recording.write_block(block)
                on_block(there)
                if there == limit:
                    break
                if not wanted():
                    recording.event("stopped", "by the operator", there / acquisition.rate)
                    break
            acquisition.stop()
        return recording.n_samples

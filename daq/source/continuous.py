"""Record without the robot, for a given duration or until stopped."""

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from sautereau.daq.errors import DaqError
from sautereau.daq.file.recorded import SessionInfo, date_now
from sautereau.daq.file.recording import Recording
from sautereau.daq.source.source import open_source
from sautereau.rig.schema import Rig


def record(
    rig: Rig,
    path: Path,
    duration_s: float | None = None,
    *,
    triggered: bool = False,
    scene: str = "",
    seed: int | None = None,
    notes: str = "",
    keep_going: Callable[[], bool] = lambda: True,
    on_block: Callable[[int], None] = lambda n: None,
) -> int:
    """Record all channels of a rig into one file.

    Args:
        path: Recording to write; it must not exist.
        duration_s: Duration, s; None to record until ``keep_going`` returns False.
        triggered: Whether the trigger's edge starts it; else it starts immediately.
        scene: Text of the stand-in's scene; empty on the hardware.
        seed: Seed of the stand-in's random numbers.
        keep_going: Called after every block; False stops the recording.
        on_block: Called after every block with the number of samples of each channel so far.

    Returns:
        Number of samples of each channel.

    Raises:
        DaqError: The acquisition or the recording failed; the samples before are kept in
            ``path.part``.
    """
    if duration_s is not None and not 0 < duration_s < math.inf:
        raise DaqError(
            f"recording of {duration_s:g} s: the duration must be a number above 0 s; give one, or"
            " none to continue until it is stopped"
        )
    complete = False
    try:
        with open_source(rig.daq, None, triggered=triggered) as acquisition:
            limit = sys.maxsize  # samples of each channel
            if duration_s is not None:
                # Rounded first: the last digits of the product are rounding errors.
                limit = max(1, math.ceil(round(duration_s * acquisition.rate, 6)))
            session = SessionInfo(
                press=0,  # A recording without one
                started=date_now(),
                simulated=acquisition.simulated,
                controller="",
                daq=acquisition.device_description,
                scene=scene,
                seed=seed,
                notes=notes,
            )
            rig = acquisition.of_device(rig)
            with Recording(
                path, rig, session=session, rate=acquisition.rate, scaling=acquisition.scaling
            ) as recording:
                recording.before_trigger()
                acquisition.start()
                for block in acquisition.blocks():
                    samples = block.samples[:, : limit - block.first_sample]
                    recording.write_block(replace(block, samples=samples))
                    count = block.first_sample + samples.shape[1]
                    on_block(count)
                    if count == limit:
                        break
                    if not keep_going():
                        recording.event("stopped", "by the operator", count / acquisition.rate)
                        break
                acquisition.stop()
            complete = True
    except DaqError as error:
        if complete:
            error.add_note(f"the recording {path} is complete")
        raise
    return recording.n_samples

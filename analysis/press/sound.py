"""The force of plucked strings on the bridge, as sound in a WAV file.

The sound is the model strings' force on the bridge perpendicular to the soundboard, the component
that drives it. The soundboard itself is not modelled: the file shows how the string is plucked,
not how the instrument sounds.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.press.strings import QUALITY, stilled, vibrating_strings
from sautereau.rig.disk import make_folder, new_file
from sautereau.rig.schema import Rig

SAMPLE_RATE = 48_000  # Hz, of the file
LEVEL = -1.0  # dB, of the largest sample relative to the full scale of the file
MOST = 60.0  # s, longest sound


@dataclass(frozen=True)
class Sound:
    """The force on the bridge during and after a press."""

    force: Floats
    """N, perpendicular to the soundboard, at `SAMPLE_RATE`; shape (n,)."""
    releases: tuple[float, ...]
    """s after the start of the sound, of each choir."""
    decay_times: tuple[float, ...]
    """s, in which the lowest mode of each choir decays by 60 dB."""
    modes: tuple[int, ...]
    """Number of modes of each choir."""

    @property
    def duration(self) -> float:
        """Length [s]."""
        return len(self.force) / SAMPLE_RATE

    @property
    def full_scale(self) -> float:
        """Force [N] at the full scale of the file."""
        return float(np.abs(self.force).max()) / 10 ** (LEVEL / 20)


def sound_of(
    rig: Rig,
    level: str = "auto",
    *,
    duration: float = 4.0,
    held: float | None = None,
    quality: float = QUALITY,
) -> Sound:
    """Return the force of all choirs on the bridge in a press of the model.

    Args:
        rig: The bench; its jack has a constant speed.
        duration: s, of the sound, which starts 20 ms before the first contact.
        held: s, from the last release until the dampers touch the strings; None for never.
        quality: Dimensionless quality factor, see `sautereau.analysis.press.strings`.

    Raises:
        AnalysisError: The duration is out of range, or too short for the pluck.
        ModelError: A choir has no pluck or no damper, or a number is out of range.
    """
    if not 0 < duration <= MOST:
        raise AnalysisError(
            f"duration: {duration:.4g} s must be between 0 and {MOST:g} s; change it"
        )
    strings = vibrating_strings(rig, level, quality=quality, highest=20e3)  # Hz, audible
    begin = min(string.contact for string in strings) - 20e-3  # 20 ms of silence
    strings = tuple(
        replace(string, contact=string.contact - begin, release=string.release - begin)
        for string in strings
    )
    last = max(string.release for string in strings)
    if not duration > last:
        raise AnalysisError(
            f"duration: the sound of {duration * 1e3:.4g} ms ends before the last release at"
            f" {last * 1e3:.4g} ms; lengthen it"
        )
    if held is not None:
        strings = tuple(stilled(string, last + held) for string in strings)
    time = np.arange(round(duration * SAMPLE_RATE)) / SAMPLE_RATE
    return Sound(
        force=sum((string.bridge_force(time)[:, 1] for string in strings), np.zeros_like(time)),
        releases=tuple(string.release for string in strings),
        decay_times=tuple(3 * math.log(10) / float(s.string.decay[0]) for s in strings),
        modes=tuple(len(string.string.order) for string in strings),
    )


def write_sound(path: str | Path, sound: Sound) -> None:
    """Write a sound as a WAV file of 16 bits, its largest sample 1 dB below full scale.

    Raises:
        AnalysisError: The file extension is not .wav.
        OSError: The file exists already, or cannot be written.
    """
    from scipy.io import wavfile

    path = Path(path)
    if path.suffix.lower() != ".wav":
        raise AnalysisError(f"{path}: sounds are written as WAV only; use the file extension .wav")
    make_folder(path.parent)
    samples = np.round(sound.force / sound.full_scale * np.iinfo(np.int16).max)
    with new_file(path) as file:
        wavfile.write(file, SAMPLE_RATE, samples.astype(np.int16))

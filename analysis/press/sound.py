"""What a bridge would hear of a pluck, as a WAV file.

The sound is the force of the model's strings on the bridge across the soundboard, the part
that drives it. The soundboard itself is not in the model: this is how the string is plucked,
not how the instrument sounds.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.model.plectrum.base import Floats
from sautereau.analysis.press.sounding import QUALITY, Sounding, soundings, stilled
from sautereau.rig.schema import Rig

SAMPLE_RATE = 48_000
"""Hz, of the file."""
HIGHEST = 20e3
"""Hz, up to which modes are heard."""
LEVEL = -1.0
"""dB, of the largest sample below the file's full scale."""
LEAD = 20e-3
"""s, of silence before the first contact."""
MOST = 60.0
"""s, of a sound at most."""


@dataclass(frozen=True)
class Sound:
    """A press heard at the bridge."""

    force: Floats
    """N, across the soundboard, at `SAMPLE_RATE`; shape (n,)."""
    releases: tuple[float, ...]
    """s from the sound's begin, of each choir."""
    decay_times: tuple[float, ...]
    """s, in which each choir's lowest mode falls by 60 dB."""
    modes: tuple[int, ...]
    """Heard of each choir."""

    @property
    def duration(self) -> float:
        """Length [s]."""
        return len(self.force) / SAMPLE_RATE

    @property
    def full_scale(self) -> float:
        """Force [N] that a file's full scale stands for."""
        return float(np.abs(self.force).max()) / 10 ** (LEVEL / 20)


def sound_of(
    rig: Rig,
    level: str = "elastica",
    *,
    duration: float = 4.0,
    held: float | None = None,
    quality: float = QUALITY,
) -> Sound:
    """Return what the bridge hears of a press by the model, all choirs together.

    Args:
        rig: The bench, with the jack at its constant speed.
        level: Of the plectra.
        duration: s, of the sound, which begins 20 ms before the first contact.
        held: s, from the last release until the dampers fall on the strings; None for never.
        quality: 1, quality factor of the strings, see `sautereau.analysis.press.sounding`.

    Raises:
        AnalysisError: The duration is out of range, or too short for the pluck.
        ModelError: A choir has no pluck or no damper, or a number is out of range.
    """
    if not 0 < duration <= MOST:
        raise AnalysisError(
            f"duration: {duration:.4g} s must lie between 0 and {MOST:g} s; change it"
        )
    strings = soundings(rig, level, quality=quality, highest=HIGHEST)
    begin = min(string.contact for string in strings) - LEAD
    strings = tuple(_shifted(string, -begin) for string in strings)
    last = max(string.release for string in strings)
    if not duration > last:
        raise AnalysisError(
            f"duration: the sound of {duration * 1e3:.4g} ms ends before the last string is let go"
            f" at {last * 1e3:.4g} ms; lengthen it"
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
        AnalysisError: The name does not end in .wav.
    """
    from scipy.io import wavfile

    path = Path(path)
    if path.suffix.lower() != ".wav":
        raise AnalysisError(f"{path}: a sound is written as WAV; let its name end in .wav")
    path.parent.mkdir(parents=True, exist_ok=True)
    samples = np.round(sound.force / sound.full_scale * np.iinfo(np.int16).max)
    wavfile.write(path, SAMPLE_RATE, samples.astype(np.int16))


def _shifted(sounding: Sounding, by: float) -> Sounding:
    return replace(sounding, contact=sounding.contact + by, release=sounding.release + by)

"""Sound files that scipy does not read (FLAC, Wave64, AIFF, CAF), by soundfile."""

import soundfile

from sautereau.daq.convert.readers import Found, refuse, refuse_cut


def read(path: str, most: int) -> Found:
    """Return the channels, called 1, 2 and so on, in fractions of full scale."""
    with soundfile.SoundFile(path) as file:
        refuse(file.frames * file.channels, most)
        samples = file.read(dtype="float64", always_2d=True)
        refuse_cut("each channel", len(samples), file.frames)
        arrays = {str(n): column for n, column in enumerate(samples.T, 1)}
        return arrays, {name: {"rate": float(file.samplerate)} for name in arrays}, None

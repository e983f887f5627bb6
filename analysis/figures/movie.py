"""A press in slow motion as a file: a GIF by pillow, or an MP4 by ffmpeg."""

import shutil
import subprocess
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import IO, BinaryIO, cast

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.figures.animation import animation_figure
from sautereau.analysis.press.replay import Replay
from sautereau.analysis.text import counted
from sautereau.rig.disk import make_folder, new_file
from sautereau.rig.progress import tracked
from sautereau.trajectory.motion import Floats

FRAME_RATE = 25  # Hz, frames per second
MOST_FRAMES = 1500
COLOURS = 128  # Number of colours of a GIF's palette
SAMPLED = 40  # Every SAMPLED-th frame is used to choose the palette


def frame_times(start: float, stop: float, slow: float) -> Floats:
    """Return the instants [s] of an animation's frames, shape (n,).

    Args:
        start: s.
        stop: s.
        slow: Duration of the animation over that of the press, dimensionless.

    Raises:
        AnalysisError: There would be fewer than two frames or far too many.
    """
    if not slow > 0:
        raise AnalysisError(f"slow: {slow:.4g} must be above 0; increase it")
    count = int((stop - start) * slow * FRAME_RATE + 1e-6) + 1
    if not 2 <= count <= MOST_FRAMES:
        raise AnalysisError(
            f"an animation of {(stop - start) * 1e3:.4g} ms, {slow:g} times slower, has"
            f" {counted(count, 'frame')}; it must have 2 to {MOST_FRAMES}: change --slow, --since"
            " or --until"
        )
    return start + np.arange(count) / (slow * FRAME_RATE)


def animate(path: str | Path, scene: Replay) -> None:
    """Write a press as an animation.

    Args:
        path: File, .gif or .mp4; the latter needs ffmpeg.

    Raises:
        AnalysisError: The file extension is another, or ffmpeg is not installed.
        OSError: The file exists already, or cannot be written.
    """
    path = Path(path)
    write = _writer(path)
    make_folder(path.parent)
    with new_file(path) as file:
        write(file, scene)


def pictures(scene: Replay, frames: Iterable[int]) -> Iterator[Image.Image]:
    """Yield some frames; only moving artists are drawn again."""
    slow = float(1 / (FRAME_RATE * (scene.time[1] - scene.time[0])))
    figure, parts = animation_figure(scene, slow)
    canvas = FigureCanvasAgg(figure)
    for artist in (*(artist for part in parts for artist in part.artists), *figure.texts):
        artist.set_animated(True)
    canvas.draw()
    still = canvas.copy_from_bbox(figure.bbox)
    for frame in frames:
        canvas.restore_region(still)
        for part in parts:
            part.show(frame)
            for artist in sorted(part.artists, key=lambda each: each.get_zorder()):
                part.axes.draw_artist(artist)
        for text in figure.texts:  # above what moves
            figure.draw_artist(text)
        yield Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())


def _all_pictures(scene: Replay) -> Iterator[Image.Image]:
    return pictures(scene, tracked(range(len(scene.time))))


def _writer(path: Path) -> Callable[[BinaryIO, Replay], None]:
    """Return the function that writes files of this extension."""
    extension = path.suffix.lower()
    if extension == ".gif":
        return _write_gif
    if extension != ".mp4":
        raise AnalysisError(f"{path}: an animation is a .gif or .mp4 file; change its name")
    if shutil.which("ffmpeg") is None:
        raise AnalysisError(
            f"{path}: an .mp4 is written by ffmpeg, which is not installed; install it"
            " (apt install ffmpeg, brew install ffmpeg), or write a .gif"
        )
    return _write_mp4


def _write_gif(file: BinaryIO, scene: Replay) -> None:
    # One palette for all frames, so that unchanged pixels are stored once.
    sample = [np.asarray(p) for p in pictures(scene, range(0, len(scene.time), SAMPLED))]
    every = Image.fromarray(np.concatenate(sample))
    palette = every.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    reduced = (
        frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in _all_pictures(scene)
    )
    next(reduced).save(
        file, "GIF", save_all=True, append_images=reduced, duration=1000 / FRAME_RATE, loop=0
    )


def _write_mp4(file: BinaryIO, scene: Replay) -> None:
    frames = _all_pictures(scene)
    first = next(frames)
    source = f"-f rawvideo -pix_fmt rgb24 -s {first.width}x{first.height} -r {FRAME_RATE} -i -"
    words = ["ffmpeg", "-loglevel", "error", "-y", *source.split(), "-pix_fmt", "yuv420p"]
    # It opens the file again by its name, since it goes back to its beginning at the end.
    command = [*words, "-f", "mp4", file.name]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as ffmpeg:
        pipe, errors = cast(IO[bytes], ffmpeg.stdin), cast(IO[bytes], ffmpeg.stderr)
        with suppress(BrokenPipeError):  # ffmpeg has stopped; its message follows
            for frame in chain([first], frames):
                pipe.write(frame.tobytes())
            pipe.close()
        said = errors.read().decode(errors="replace").strip()
    if ffmpeg.returncode:
        raise AnalysisError(f"ffmpeg failed: {said}; fix that, or write a .gif")

"""A press in slow motion as a file: a GIF by pillow, or an MP4 by ffmpeg."""

import math
import shutil
import subprocess
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import IO, BinaryIO, cast

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.figures.artists import Artists, draw_head
from sautereau.analysis.figures.palette import (
    ARM,
    PHASES,
    PRESSED,
    SERIES,
    SEVERAL,
    how_made,
    literal,
    stamp,
)
from sautereau.analysis.figures.parts import arm_parts, bench_parts, fixed_parts, string_parts
from sautereau.analysis.model.choirs import string_names
from sautereau.analysis.phases.found import FREE, RELEASED, stretches
from sautereau.analysis.press.replay import ChoirMotion, Replay
from sautereau.analysis.text import counted
from sautereau.rig.disk import make_folder, new_file
from sautereau.rig.progress import tracked
from sautereau.trajectory.motion import Floats


@dataclass(frozen=True)
class Panel:
    """One of the axes of an animation."""

    axes: Axes
    artists: Sequence[Artist]
    """All moving artists."""
    show: Callable[[int], None]
    """Move them to a frame."""


def animation_figure(scene: Replay, slow: float) -> tuple[Figure, list[Panel]]:
    """Return the figure and its moving parts, at the first frame.

    Args:
        slow: Duration of the animation over that of the press, dimensionless.
    """
    figure = Figure(figsize=(9.6, 6.4), dpi=100, layout="constrained")  # 960 by 640 pixels
    grid = figure.add_gridspec(3, 2, height_ratios=(1.9, 1.0, 1.3), width_ratios=(1.15, 1))
    parts: list[Panel] = [
        _bench(figure.add_subplot(grid[0, 0]), scene),
        _strings(figure.add_subplot(grid[1, 0]), scene),
    ]
    heads = grid[:2, 1].subgridspec(len(scene.choirs), 1)
    strings = string_names(scene.press.rig)
    for number, motion in enumerate(scene.choirs):
        name = f"{strings[number]}: " if len(scene.choirs) > 1 else ""
        axes = figure.add_subplot(heads[number, 0])
        parts.append(_head(axes, motion, name))
        if number + 1 < len(scene.choirs):
            axes.set_xlabel("")
    parts.append(_trace(figure.add_subplot(grid[2, 0]), scene, "force", 1.0, "finger force (N)"))
    parts.append(
        _trace(figure.add_subplot(grid[2, 1]), scene, "jack_speed", 1e3, "jack speed (mm/s)")
    )
    press = scene.press
    kind = how_made(press.simulated)
    string = "no pluck found: plectrum and string are drawn undeformed and at rest"
    if any(motion.plucks for motion in scene.choirs):
        string = "plectrum and string by the model, fitted to contact and release"
    arm = "" if scene.joints is not None else "; no arm was recorded"
    figure.suptitle(
        f"Rig {press.rig.name}, {press.path.name}: {kind}; {slow:.4g} times slower{arm}\n"
        f"key, jack and arm as recorded; {string}",
        fontsize=10,
    )
    stamp(figure, press.simulated, 80)
    literal(figure)

    for part in parts:
        part.show(0)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # so that nothing shifts between frames
    return figure, parts


def _bench(axes, scene: Replay) -> Panel:
    rig = scene.press.rig
    Artists(axes, fixed_parts(rig))
    arm = [] if scene.joints is None else arm_parts(rig, scene.joints)
    pose = Artists(axes, bench_parts(rig, scene.angle) + arm)
    # The arm, if recorded, is on the left.
    side = {"x": 0.02, "ha": "left"} if scene.joints is None else {"x": 0.98, "ha": "right"}
    corner = {**side, "s": "", "va": "top", "transform": axes.transAxes}
    clock, phase = axes.text(y=0.96, fontsize=12, **corner), axes.text(y=0.83, **corner)
    behind = max(motion.choir.jack_arm for motion in scene.choirs)
    left = -rig.key.front_arm - 15e-3
    top = rig.key.jack_surface_height + 0.12
    if scene.joints is not None:
        reach = rig.arm.upper_length * np.sin(scene.joints[:, 0]).max()
        left = min(left, rig.arm.base_x - 15e-3)
        top = max(top, rig.arm.base_z + max(reach, 0) + 15e-3)
    axes.set(xlim=(left * 1e3, (behind + 45e-3) * 1e3), ylim=(-35, top * 1e3), aspect="equal")
    axes.set(xlabel="x from the balance pin (mm)", ylabel="z (mm)")

    digits = max(1, math.ceil(-math.log10(1e3 * (scene.time[1] - scene.time[0]))))

    def show(frame: int) -> None:
        pose.put(frame)
        clock.set_text(f"{scene.time[frame] * 1e3:.{digits}f} ms")
        phase.set_text(scene.phase(float(scene.time[frame])))

    return Panel(axes, [*pose.artists, clock, phase], show)


def _head(axes, motion: ChoirMotion, name: str) -> Panel:
    head = draw_head(axes, motion)
    title = axes.set_title("", fontsize=10)

    def show(frame: int) -> None:
        title.set_text(f"{name}plectrum {motion.height[frame] * 1e3:+.2f} mm from contact")
        head.put(frame)

    return Panel(axes, [*head.artists, title], show)


def _strings(axes, scene: Replay) -> Panel:
    """Draw every string from nut to bridge: its position, and its range during the frame."""
    most = max(float(np.abs(motion.deflection).max()) for motion in scene.choirs) * 1e3
    length = max(float(motion.places[-1]) for motion in scene.choirs) * 1e3
    high = 1.2 * max(most, 0.1)
    axes.set(xlim=(0, length), ylim=(-high, high), ylabel="string's z\n(mm)")
    axes.set_xlabel("along the string, from nut to bridge (mm)")
    shown = []
    for motion, colour in zip(scene.choirs, SERIES, strict=False):
        styles = {"band": {"fc": colour, "ec": "none", "alpha": 0.25}, "string": {"color": colour}}
        shown.append(Artists(axes, string_parts(motion), styles))
        axes.axvline(motion.choir.string.plucking_point * 1e3, color=colour, lw=0.7, ls=":")

    def show(frame: int) -> None:
        for string in shown:
            string.put(frame)

    return Panel(axes, [artist for string in shown for artist in string.artists], show)


def _trace(axes, scene: Replay, column: str, scale: float, label: str) -> Panel:
    """Draw a measured column over the frames' time, with the present instant marked."""
    press, signal = scene.press, scene.press.samples[column]
    rows = press.between(scene.time[0], scene.time[-1])
    time, values = press.time[rows] * 1e3, signal[rows] * scale
    axes.plot(time, values, color=ARM, lw=0.8)
    low, high = min(values.min(), 0.0), max(values.max(), 0.0)
    margin = 0.08 * (high - low)
    axes.set_ylim(low - margin, high + margin)
    # The force of an impact on the key may be many times that of the pluck.
    plucks = [(time >= h.contact * 1e3) & (time <= h.release * 1e3) for h in scene.phases.plucks]
    held_force = [values[held].max() for held in plucks if held.any()]
    most = 1.6 * max(held_force, default=np.inf)
    if column == "force" and 0 < most < values.max():
        axes.set_ylim(-0.1 * most, most)
        at = int(np.argmax(values))
        style = {"textcoords": "offset points", "va": "top", "fontsize": 8}
        axes.annotate(f"peak {values[at]:.2g} N", (time[at], most), (5, -2), **style)
    ends = [(held.contact * 1e3, held.release * 1e3) for held in scene.phases.plucks]
    for start, stop, name in stretches(ends, -np.inf, np.inf):
        if name not in (FREE, RELEASED):
            axes.axvspan(start, stop, color=PHASES.get(name, SEVERAL)[0], zorder=0)
    axes.set(xlim=(scene.time[0] * 1e3, scene.time[-1] * 1e3), xlabel="time after the trigger (ms)")
    axes.set_ylabel(label)
    now = axes.axvline(scene.time[0] * 1e3, color=PRESSED, lw=1.2)

    def show(frame: int) -> None:
        now.set_xdata([scene.time[frame] * 1e3] * 2)

    return Panel(axes, [now], show)


FRAME_RATE = 25  # Hz, frames per second
MOST_FRAMES = 1500


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
    sample = [np.asarray(p) for p in pictures(scene, range(0, len(scene.time), 40))]
    every = Image.fromarray(np.concatenate(sample))
    palette = every.quantize(128, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
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

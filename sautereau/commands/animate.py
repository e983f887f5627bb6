"""A press as a film in slow motion, and as a sound."""

from typing import Annotated

from sautereau.analysis.results.result import part_of
from sautereau.commands import common
from sautereau.commands.output import FileOutput


def animate(
    recording: common.Recording,
    /,
    *,
    out: Annotated[common.OutFile, common.written_as(".gif", ".mp4")] = common.Dated(
        "animate-DATE.gif"
    ),
    slow: Annotated[float, common.ABOVE_0] = 20.0,
    since: common.Time | None = None,
    until: common.Time | None = None,
    output: FileOutput = FileOutput(),
) -> int:
    """Show a recorded press in slow motion: arm, key, jack, plectrum and string.

    Parameters
    ----------
    recording
        Recording of one press.
    out
        File to write: .gif, or .mp4 if ffmpeg is installed.
    slow
        Slow-motion factor.
    since
        Start, after the trigger: "70 ms". Default: just before the jack rises.
    until
        End, after the trigger: "80 ms". Default: end of the recording.
    """
    from sautereau.analysis.figures import movie
    from sautereau.analysis.loading.press import press_of
    from sautereau.analysis.phases import find_phases
    from sautereau.analysis.press.replay import replay, shown_stretch
    from sautereau.daq.file.reading import read_recording

    recorded = read_recording(recording)
    press = press_of(recorded)
    phases = find_phases(press)
    start, stop = shown_stretch(press, phases, since, until)
    scene = replay(press, phases, movie.frame_times(start, stop, slow), recorded.arm)
    with output.progress("drawing frames"):
        movie.animate(out, scene)
    plucked = sum(motion.plucks for motion in scene.choirs)
    result = {
        "path": str(out),
        "simulated": press.simulated,
        "frames": len(scene.time),
        "frame_rate": movie.FRAME_RATE,
        "start": start,
        "stop": stop,
        "plucks": plucked,
        "strings": [k for k, motion in enumerate(scene.choirs, 1) if motion.plucks],
        "arm": scene.joints is not None,
        "warnings": [*press.warnings, *phases.warnings],
    }
    lines = [
        f"{'SIMULATED' if press.simulated else 'measured'}: {out}",
        f"{start * 1e3:.4g} to {stop * 1e3:.4g} ms after the trigger, {len(scene.time)} frames,"
        f" {slow:g} times slower",
        f"strings plucked: {plucked} of {len(scene.choirs)}; plectra and strings are computed by"
        " the model from the measured contact and release",
        *result["warnings"],
    ]
    return output.answer(result, lines)


def listen(
    rig: common.RigName = "paper",
    *,
    out: Annotated[common.OutFile, common.written_as(".wav")] = common.Dated("listen-DATE.wav"),
    level: common.RareLevel = "auto",
    duration: Annotated[common.Time, common.ABOVE_0] = common.Quantity(4),
    held: common.Duration | None = None,
    quality: Annotated[float, common.ABOVE_0, common.RARE] = 1500.0,
    output: FileOutput = FileOutput(),
) -> int:
    """Compute the string's force on the bridge in a press, and write it as a WAV file.

    Parameters
    ----------
    out
        WAV file.
    duration
        Duration of the sound, which starts 20 ms before the first contact: "4 s".
    held
        Time from the last release until the dampers touch the strings: "1.5 s". Default: no
        dampers.
    quality
        Quality factor of the strings, for all losses except those to the air.
    """
    from sautereau.analysis.model.choirs import string_names
    from sautereau.analysis.press.sound import LEVEL, SAMPLE_RATE, sound_of, write_sound

    bench = common.load_rig(rig)
    with output.progress("computing the sound"):
        sound = sound_of(bench, level, duration=duration, held=held, quality=quality)
    write_sound(out, sound)
    result = {
        "path": str(out),
        "sample_rate": SAMPLE_RATE,
        "level": LEVEL,
        **part_of(sound, "duration", "full_scale", "releases", "decay_times", "modes"),
    }
    heard = zip(string_names(bench), sound.releases, sound.modes, sound.decay_times, strict=True)
    lines = [
        f"computed by the model, not recorded: {out}",
        f"{sound.duration:.4g} s at {SAMPLE_RATE / 1e3:g} kHz; full scale is"
        f" {sound.full_scale:.4g} N on the bridge, the loudest sample is at {LEVEL:g} dB",
        *(
            f"{string}: release at {release * 1e3:.4g} ms into the file, {modes} modes; the lowest"
            f" decays by 60 dB in {decay:.3g} s"
            for string, release, modes, decay in heard
        ),
    ]
    return output.answer(result, lines)

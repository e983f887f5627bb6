"""The spring string against the modal string: errors of the spring by jack speed."""

import numpy as np

from benchmarks.figures import Figure, check, median_time
from sautereau.analysis.model.choirs import _kept
from sautereau.analysis.model.modal_pluck import ModalPluck, modal_pluck
from sautereau.analysis.model.predict import rig_pluck
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig

SPEEDS = (0.02, 0.05, 0.072, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 1.0)  # m/s, of the jack
EXPECTED = {0.072: 0.24, 0.15: 0.9, 0.3: 2.6, 1.0: 8.0}
"""%, errors of the duration, from another program."""
FACTOR = 1.5  # Factor within which these must agree
RUNS = 5
RELEASE_LIMIT, FREQUENCY_LIMIT = 0.01, 0.1
"""%, of release against a step eight times shorter, and of the free string's frequency."""


def run() -> list[Figure]:
    """Return the spring's errors with their times, and the modal string's own."""
    rig = load_rig()
    rows = [row for speed in SPEEDS for row in _errors(rig, speed)]
    return [*rows, _step(rig), _frequency(rig)]


def _errors(rig: Rig, speed: float) -> list[Figure]:
    """Return duration and force at release of the modal string against the spring's."""
    rig = rig.replaced({"press.jack_speed": speed})
    static, modal = rig_pluck(rig), modal_pluck(rig)
    static_time, modal_time = (
        median_time(lambda pluck=pluck: (_kept.cache_clear(), pluck(rig)), RUNS)
        for pluck in (rig_pluck, modal_pluck)
    )
    duration = static.release_height / speed
    error = (duration / modal.release - 1) * 100
    for known, percent in EXPECTED.items():
        expected = speed != known or percent / FACTOR < -error < percent * FACTOR
        check(expected, f"{speed} m/s: {error:.3g} %, about -{percent:g} % were expected")
    force = float(static.force[-1])
    by = (force / modal.plectrum_force - 1) * 100
    held = f"{speed:.3g} m/s: pluck duration with modes, spring {error:+.2f} % off"
    left = f"{speed:.3g} m/s: plectrum force at release, spring {by:+.2f} % off"
    return [
        Figure(held, modal.release * 1e3, "ms", "spring", duration * 1e3),
        Figure(left, modal.plectrum_force, "N", "spring", force),
        Figure(f"{speed:.3g} m/s: time", modal_time * 1e3, "ms", "spring", static_time * 1e3),
    ]


def _step(rig: Rig) -> Figure:
    found = modal_pluck(rig)
    short = modal_pluck(rig, step=float(found.time[1]) / 8)
    error = abs(found.release / short.release - 1) * 100
    return Figure("release against an eighth of the step", error, "%", "limit", RELEASE_LIMIT)


def _frequency(rig: Rig) -> Figure:
    found: ModalPluck = modal_pluck(rig)
    rate, count = 44_100.0, 2**16
    sound = found.free.bridge_force(np.arange(count) / rate)[:, 1] * np.hanning(count)
    spectrum = np.log(np.abs(np.fft.rfft(sound)))
    worst = 0.0
    for n in range(1, 31):
        near = round(n * rig.string.frequency * count / rate)
        peak = near - 20 + int(np.argmax(spectrum[near - 20 : near + 21]))
        a, b, c = spectrum[peak - 1 : peak + 2]
        frequency = (peak + (a - c) / (2 * (a - 2 * b + c))) * rate / count
        worst = max(worst, abs(frequency / (n * rig.string.frequency) - 1) * 100)
    return Figure("frequencies of 30 modes at the bridge", worst, "%", "limit", FREQUENCY_LIMIT)

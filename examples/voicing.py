"""Voicing: how cutting a plectrum changes the touch.

A maker voices an instrument by shaving its plectra: thinner all over, thinner towards the tip,
or cut and set with a longer free part. Each cut changes the force on the finger, its work until
release, the height of release and the loudness. Players use three words for it, which are derived
here from the largest force: `medium` is within 20 % of the unchanged rig at the same level, `soft`
below, `hard` above. The overlap is the same throughout, so a longer plectrum needs a jack further
from the string. `two-beam` neglects shortening and releases late: compare its rows with each other.

python -m examples.voicing [picture.png]
"""

import sys
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from sautereau.analysis.figures.palette import DASHES, GRID, MARKERS, SERIES
from sautereau.analysis.model.pluck.pluck import Pluck
from sautereau.analysis.model.predict import rig_pluck
from sautereau.analysis.model.string.string import release_speed
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig

MEDIUM = 0.2
"""Largest relative difference of the force from the reference for `medium`."""
_WORDS = enumerate(("medium", "hard", "soft"))
STYLES = {word: (SERIES[i], DASHES[i], MARKERS[i]) for i, word in _WORDS}
"""Colour, dashes and marker of each word."""
THICKNESS = (0.40e-3, 0.44e-3, 0.48e-3, 0.52e-3, 0.56e-3)
"""m, of a uniform section."""
TIP_THICKNESS = (0.28e-3, 0.34e-3, 0.40e-3, 0.44e-3, 0.48e-3)
"""m, of the outer half."""
LENGTH = (3.7e-3, 4.1e-3, 4.5e-3, 4.9e-3, 5.3e-3)
"""m, of the free part."""
CUTS = (
    ("thickness", THICKNESS, "elastica"),
    ("tip_thickness", TIP_THICKNESS, "two-beam"),
    ("length", LENGTH, "elastica"),
)


@dataclass(frozen=True)
class Voice:
    """One cut of the plectrum, and its touch."""

    field: str
    """Of the plectrum, that was cut."""
    value: float
    """m, of that field."""
    level: str
    """At which it was solved."""
    finger_force: float
    """N, largest finger force due to the string alone."""
    work: float
    """J, of the jack until the string is released."""
    release_height: float
    """m, of the jack above first contact."""
    v_osc: float
    """m/s, of the released string."""
    word: str
    """`soft`, `medium` or `hard`."""
    pluck: Pluck

    def __str__(self) -> str:
        return (
            f"{self.field:<14} {self.value * 1e3:5.2f} {self.finger_force:9.3f}"
            f" {self.work * 1e6:9.1f} {self.release_height * 1e3:9.3f} {self.v_osc:9.2f}"
            f"  {self.word}"
        )


HEADER = "cut               mm    finger      work   release      Vosc\n" + (
    "                             N        uJ        mm       m/s"
)


def voice(rig: Rig, field: str, values: tuple[float, ...], level: str) -> list[Voice]:
    """Return the touch for every value [m] of a field of the plectrum, in their order."""
    reference = _finger_force(rig, rig_pluck(rig, level))
    voices = []
    for value in values:
        cut = rig.replaced({f"plectrum.{field}": value})
        pluck = rig_pluck(cut, level)
        force = _finger_force(cut, pluck)
        v_osc = release_speed(rig.string, float(pluck.lift[-1]))
        word = _word(force / reference)
        height = pluck.release_height
        voices.append(Voice(field, value, level, force, pluck.work, height, v_osc, word, pluck))
    return voices


def study(rig: Rig) -> list[list[Voice]]:
    """Return the touch for every cut of `CUTS`."""
    return [voice(rig, *cut) for cut in CUTS]


def plot(path: str | Path, studied: list[list[Voice]]) -> None:
    """Draw the force on the jack over its height for every cut into a file."""
    figure = Figure(figsize=(13, 4.8), layout="constrained")
    for axes, voices in zip(
        figure.subplots(1, len(studied), sharex=True, sharey=True), studied, strict=True
    ):
        for v in voices:
            height, force = v.pluck.height * 1e3, v.pluck.vertical_force
            colour, dashes, marker = STYLES[v.word]
            axes.plot(height, force, color=colour, ls=dashes)
            axes.plot(height[-1], force[-1], marker, color=colour)
            axes.annotate(
                f"{v.value * 1e3:.2f}",
                (height[-1], force[-1]),
                (7, -3),
                textcoords="offset points",
                fontsize=9,
            )
        axes.set_title(f"{voices[0].field.replace('_', ' ')} (mm), as {voices[0].level}")
        axes.set_xlabel("jack's height above first contact (mm)")
        axes.grid(color=GRID)
    highest = max(v.release_height for voices in studied for v in voices)
    figure.axes[0].set_xlim(0, highest * 1.15e3)
    figure.axes[0].set_ylim(bottom=0)
    figure.axes[0].set_ylabel("string's force on the jack (N)")
    for word, (colour, dashes, marker) in STYLES.items():
        figure.axes[0].plot([], [], color=colour, ls=dashes, marker=marker, label=word)
    figure.axes[0].legend(loc="upper left", frameon=False)
    figure.savefig(path, dpi=120)


def _finger_force(rig: Rig, pluck: Pluck) -> float:
    """Return the largest force [N] at the pressing point that balances the string on the jack."""
    return float(pluck.vertical_force.max()) * rig.key.jack_arm / rig.key.press_arm


def _word(ratio: float) -> str:
    if ratio < 1 - MEDIUM:
        return "soft"
    return "hard" if ratio > 1 + MEDIUM else "medium"


def main() -> None:
    studied = study(load_rig())
    print(HEADER)
    for voices in studied:
        print("\n".join([f"as {voices[0].level}", *map(str, voices)]))
    if len(sys.argv) > 1:
        plot(sys.argv[1], studied)


if __name__ == "__main__":
    main()

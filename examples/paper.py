"""The paper's figures 4, 6, 7 and 8 by this software, and its printed numbers beside the results.

python -m examples.paper FOLDER

writes the figures into a folder and rewrites docs/paper.md, whose text is in paper.md.in.
"""

import sys
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import sautereau as st
from examples.release_fit import Release, fit_release
from examples.session import study as session
from sautereau.analysis.figures.comparison import comparison_figure
from sautereau.analysis.figures.palette import OTHER, PREDICTED
from sautereau.analysis.figures.pluck import pluck_figure
from sautereau.analysis.model.plectrum.levels import LEVELS
from sautereau.analysis.model.predict import Prediction, predict
from sautereau.analysis.model.string.string import first_mode_release_speed, release_speed
from sautereau.analysis.session.compare import predicted_features
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig
from sautereau.trajectory.press import plan_press

CONTACT, RELEASE, SPEED, RISE, V_OSC, SLOPE_ERROR = 27e-3, 47e-3, 0.072, 10e-3, 0.46, 0.6
"""s, s, m/s, m, m/s and 1, as the paper prints them."""
PAGE = Path(__file__).parents[1] / "docs" / "paper.md"

TEXT = Path(__file__).with_suffix(".md.in").read_text(encoding="utf-8")


@dataclass(frozen=True)
class Reading:
    """A plectrum that has the printed duration and Vosc."""

    name: str
    release: Release
    slope_error: float
    """Dimensionless, of a prediction with the rig's own plectrum."""


def readings(rig: Rig) -> list[Reading]:
    """Return the plectra that explain the printed duration and Vosc, one for each reading."""
    nominal, _ = predicted_features(predict(rig))
    found = []
    for name, v_osc in (("all modes", V_OSC), ("first mode alone", V_OSC / _first_mode(rig))):
        release = fit_release(rig, RELEASE - CONTACT, v_osc)
        slope, _ = predicted_features(predict(release.rig))
        found.append(Reading(name, release, nominal / slope - 1))
    return found


def page(rig: Rig, pressed: st.Session, day: str) -> str:
    """Return the page about the printed numbers."""
    trajectory, model, found = plan_press(rig), predict(rig), readings(rig)
    phases = pressed[0].phases
    (held,) = phases.plucks
    speed = pressed[0].data["jack_speed"]
    cruise = speed[phases.start + 10e-3 : held.release + 50e-3]
    ei = rig.plectrum.bending_stiffness
    rows = [
        f"| {r.name} | {r.release.bending_stiffness / ei:.3g} | {r.release.overlap * 1e3:.3g}"
        f" | {r.release.pluck.force[-1]:.3g} | {r.slope_error:+.0%} |"
        for r in found
    ]
    return TEXT.format(
        day=day,
        presses=len(pressed),
        planned_speed=float(np.max(trajectory.rise.velocity)),
        speed=float(cruise.mean()),
        held_speed=float(speed[held.contact : held.release].mean()),
        rise=trajectory.rise.position.max() * 1e3,
        measured_rise=pressed[0].data["jack_rise"].max() * 1e3,
        contact=model.contact * 1e3,
        release=model.release * 1e3,
        measured_contact=(held.contact - phases.start) * 1e3,
        measured_release=(held.release - phases.start) * 1e3,
        v_osc=model.v_osc,
        first_v_osc=model.v_osc * _first_mode(rig),
        slope_error=pressed.compare().document["slope_error"]["value"],
        rows="\n".join(rows),
        finding=_finding(found),
    )


def _finding(found: list[Reading]) -> str:
    near = min(found, key=lambda reading: abs(reading.slope_error - SLOPE_ERROR))
    if abs(near.slope_error - SLOPE_ERROR) > 0.1:
        return "Neither explains the printed slope error of 60 %."
    return (
        f"If Vosc is the speed of {near.name.replace('first', 'the first')}, one softer plectrum"
        " explains pluck duration and Vosc, and\ngives a slope error of"
        f" {near.slope_error:+.0%}, close to the 60 % that the paper prints. The paper states\n"
        "neither this interpretation nor the sign of its error, so this is consistent, but not"
        " proven."
    )


def planned(rig: Rig, model: Prediction) -> Figure:
    """Return the planned press, as the paper's figure 6: the jack and the predicted force."""
    trajectory = plan_press(rig)
    figure = Figure(figsize=(9, 6), layout="constrained")
    jack, force = figure.subplots(2, 1, sharex=True)
    begin = trajectory.time[np.argmax(trajectory.rise.velocity > 1e-3 * SPEED)]
    after = (trajectory.time - begin) * 1e3
    jack.plot(after, trajectory.rise.position * 1e3, color=PREDICTED)
    jack.set_ylabel("jack rise (mm)")
    jack.axhline(RISE * 1e3, color=OTHER, ls=":")
    jack.annotate(
        f"the paper's rise: {RISE * 1e3:g} mm", (60, RISE * 1e3), (0, -4),
        textcoords="offset points", va="top",
    )  # fmt: skip
    force.plot(model.time * 1e3, model.finger_force, color=PREDICTED)
    force.set(ylabel="finger force (N)", xlabel="time after the jack leaves rest (ms)")
    _mark(jack, 0.0)
    _mark(force, 0.0)
    force.set_xlim(0, after[np.argmax(trajectory.rise.position)] * 1.1)
    figure.suptitle(f"Planned press, jack at {SPEED} m/s; marked: the paper's contact and release")
    return figure


def _mark(axes, start: float) -> None:
    """Mark the printed contact and release, in ms after a start [ms]."""
    for instant, name in ((CONTACT, "contact 27"), (RELEASE, "release 47")):
        place = start + instant * 1e3
        axes.axvline(place, color=OTHER, ls=":", lw=1)
        axes.annotate(
            f"{name} ms", (place, 1), (2, -14), xycoords=("data", "axes fraction"),
            textcoords="offset points", rotation=90, va="top", fontsize=8,
        )  # fmt: skip


def _mark_slope(axes, model: Prediction) -> None:
    """Mark the slope of the force that the model would exceed by the printed error."""
    slope, _ = predicted_features(model)
    end = axes.get_xlim()[1] * 1e-3
    force = float(model.finger_force[0]) + np.array([0, slope / (1 + SLOPE_ERROR) * end])
    label = f"slope with the printed error of {SLOPE_ERROR:.0%}"
    axes.plot([0, end * 1e3], force, color=OTHER, ls=":", label=label)
    axes.legend(loc="upper left")


def _first_mode(rig: Rig) -> float:
    """Return Vosc of the first mode alone over that of all modes, dimensionless."""
    return first_mode_release_speed(rig.string, 1.0) / release_speed(rig.string, 1.0)


def figures(rig: Rig, pressed: st.Session) -> dict[str, Figure]:
    """Return the figures by the names of their files."""
    model = predict(rig)
    over_time = comparison_figure(
        [press.press for press in pressed], [press.phases for press in pressed], model
    )
    for axes in over_time.axes[:2]:
        _mark(axes, pressed[0].phases.start * 1e3)
    _mark_slope(over_time.axes[2], model)
    plucks = pluck_figure(rig, LEVELS.names())
    plucks.suptitle(
        f"{plucks.get_suptitle()}\nVosc: printed {V_OSC} m/s; elastica {model.v_osc:.3g} m/s,"
        f" first mode alone {model.v_osc * _first_mode(rig):.3g} m/s"
    )
    return {
        "figure-4.png": plucks,
        "figure-6.png": planned(rig, model),
        "figures-7-and-8.png": over_time,
    }


def main() -> None:
    rig, pressed, folder = load_rig(), session(), Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, figure in figures(rig, pressed).items():
        figure.savefig(folder / name, dpi=120)
        print(folder / name)
    PAGE.write_text(page(rig, pressed, datetime.now(UTC).date().isoformat()), encoding="utf-8")


if __name__ == "__main__":
    main()

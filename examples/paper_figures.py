"""The paper's figures 2, 4, 6, 7 and 8 by this software, with the printed numbers marked."""

import numpy as np
from matplotlib.figure import Figure

import sautereau as st
from examples.paper_numbers import (
    CONTACT,
    MEANT,
    RELEASE,
    RISE,
    SPEED,
    V_OSC,
    first_mode,
)
from sautereau.analysis.figures.artists import draw_pose
from sautereau.analysis.figures.comparison import comparison_figure
from sautereau.analysis.figures.palette import ARM, OTHER, PREDICTED, PRESSED
from sautereau.analysis.figures.pluck import pluck_figure
from sautereau.analysis.model.plectrum.fe.mesh import plectrum_grid
from sautereau.analysis.model.plectrum.levels import AUTO, LEVELS
from sautereau.analysis.model.plectrum.profile import profile_of
from sautereau.analysis.model.predict import Prediction, predict
from sautereau.analysis.session.compare import predicted_features
from sautereau.rig.instrument import Outline
from sautereau.rig.schema import Rig
from sautereau.trajectory.press import plan_press

STEP = 0.8
"""Thickness of the second section over that of the first; the paper's source has no number."""
CARVED = 0.12e-3
"""m, taken off the tip from below in the carved example; the paper's outline has no numbers."""


def carved(rig: Rig) -> Rig:
    """Return the rig with its plectrum cut from below, straight from the middle to the tip."""
    length, thickness = rig.plectrum.length, rig.plectrum.thickness
    x = (0.0, length / 2, length)
    top, bottom = (thickness / 2,) * 3, (-thickness / 2,) * 2 + (CARVED - thickness / 2,)
    outline = Outline.model_construct(x=x, top=top, bottom=bottom)
    return rig.model_copy(update={"plectrum": rig.plectrum.outlined(outline)})


def meshes(rig: Rig) -> Figure:
    """Return the outline and the elements of the bar and of a carved plectrum, as figure 2."""
    figure = Figure(figsize=(9, 3.6), layout="constrained")
    names = ("Table 1", f"an example, {CARVED * 1e3:g} mm off the tip from below")
    for axes, case, name in zip(
        figure.subplots(2, 1, sharex=True), (rig, carved(rig)), names, strict=True
    ):
        grid = plectrum_grid(profile_of(case.plectrum))
        # Of elements with nine nodes the corners.
        corners = grid.nodes.reshape(-1, grid.height, 2)[::2, ::2] * case.plectrum.length * 1e3
        for x, z in (corners.T, corners.transpose(2, 0, 1)):
            axes.plot(x, z, color=PREDICTED, lw=0.5)
        axes.set(aspect="equal", ylabel="z (mm)", title=name)
    axes.set_xlabel("x from the clamp (mm)")
    figure.suptitle("Outline and finite elements of the plectrum; the load acts at the tip")
    return figure


def plucks(rig: Rig) -> Figure:
    """Return the pluck by every plectrum model, as figure 4."""
    figure = pluck_figure(rig, [name for name in LEVELS.names() if name != AUTO])
    model = predict(rig)
    figure.suptitle(
        f"{figure.get_suptitle()}\nVosc: printed {V_OSC} m/s; elastica {model.v_osc:.3g} m/s,"
        f" first mode alone {model.v_osc * first_mode(rig):.3g} m/s"
    )
    return figure


def sections(rig: Rig) -> Figure:
    """Return the pluck with a second, thinner section, as the curves of [9] in figure 4."""
    thinner = rig.replaced({"plectrum.tip_thickness": STEP * rig.plectrum.thickness})
    figure = pluck_figure(thinner, ["two-beam", "fe"])
    figure.suptitle(
        f"{figure.get_suptitle()}\nThe half at the tip is {STEP:g} times as thick (an example:"
        " no number is printed)"
    )
    return figure


def planned(rig: Rig, model: Prediction) -> Figure:
    """Return the planned press, as figure 6: the fingertip's path, the jack and the force."""
    trajectory = plan_press(rig)
    figure = Figure(figsize=(12, 6), layout="constrained")
    places = figure.subplot_mosaic([["path", "jack"], ["path", "force"]])
    path, jack, force = (places[name] for name in ("path", "jack", "force"))
    last = int(np.argmax(trajectory.rise.position))
    for sample, ghost in ((last, True), (0, False)):
        pose = float(trajectory.angle.position[sample]), trajectory.joints.position[sample]
        draw_pose(path, rig, *pose, PRESSED if ghost else ARM, ghost=ghost)
    path.relim()
    path.margins(0.03, 0.08)
    path.autoscale_view()
    path.set(
        aspect="equal", xlabel="x from the balance pin (mm)", ylabel="z (mm)",
        title="arm at rest, and dashed at full rise",
    )  # fmt: skip
    # The printed 27 ms are those of a jack at its speed from the start on.
    clearance = rig.jack.string_clearance
    touch = np.interp(clearance, trajectory.rise.position[: last + 1], trajectory.time[: last + 1])
    clock = CONTACT - float(touch)
    jack.plot(
        (trajectory.time + clock)[: last + 1] * 1e3,
        trajectory.rise.position[: last + 1] * 1e3,
        color=PREDICTED,
    )
    jack.axline((0, 0), slope=SPEED, color=OTHER, ls="--", lw=0.8, label=f"{SPEED} m/s")
    jack.axhline(RISE * 1e3, color=OTHER, ls=":")
    jack.axhline(clearance * 1e3, color=OTHER, ls=":", lw=0.8)
    jack.set(ylabel="jack rise (mm)", ylim=(0, 1.1 * RISE * 1e3))
    jack.legend(loc="lower right")
    force.plot((model.time + CONTACT - model.contact) * 1e3, model.finger_force, color=PREDICTED)
    force.set(ylabel="finger force (N)", xlabel="time at which contact is at 27 ms (ms)")
    for axes in (jack, force):
        _mark(axes, 0.0)
        axes.set_xlim(-15, float(trajectory.time[last] + clock) * 1e3 + 10)
    figure.suptitle("Planned press; marked: the paper's rise, contact and release")
    return figure


def _mark(axes, start: float) -> None:
    """Mark the printed contact and release, in ms after a start [ms]."""
    for instant, name in ((CONTACT, "contact 27"), (RELEASE, "release 47")):
        place = start + instant * 1e3
        axes.axvline(place, color=OTHER, ls=":", lw=1)
        axes.annotate(
            f"{name} ms", (place, 1), (2, -6), xycoords=("data", "axes fraction"),
            textcoords="offset points", rotation=90, va="top", fontsize=8,
        )  # fmt: skip


def _mark_slope(axes, model: Prediction) -> None:
    """Mark the slopes of the force of which the model's would be off by the printed error."""
    slope, _ = predicted_features(model)
    low, high = axes.get_ylim()
    end = axes.get_xlim()[1] * 1e-3
    for error, style in zip(MEANT, (":", "--", "-."), strict=True):
        force = float(model.finger_force[0]) + np.array([0, slope / (1 + error) * end])
        label = f"slope, if the model's error is {100 * error:+.3g} %"
        axes.plot([0, end * 1e3], force, color=OTHER, ls=style, label=label)
    axes.set_ylim(low, high)
    axes.legend(loc="lower right")


def over_time(rig: Rig, pressed: st.Session) -> Figure:
    """Return presses with their phases, and the force over the deflection, as figures 7 and 8."""
    model = predict(rig)
    figure = comparison_figure(
        [press.press for press in pressed], [press.phases for press in pressed], model
    )
    for axes in figure.axes[:2]:
        _mark(axes, pressed[0].phases.plucks[0].contact * 1e3 - CONTACT * 1e3)
    _mark_slope(figure.axes[2], model)
    return figure


def figures(rig: Rig, pressed: st.Session) -> dict[str, Figure]:
    """Return the figures by the names of their files."""
    return {
        "figure-2.png": meshes(rig),
        "figure-4.png": plucks(rig),
        "figure-4-two-sections.png": sections(rig),
        "figure-6.png": planned(rig, predict(rig)),
        "figures-7-and-8.png": over_time(rig, pressed),
    }

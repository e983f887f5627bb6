"""Plots of presses and prediction; simulated presses are marked in the plot."""

from collections.abc import Sequence

from matplotlib.figure import Figure

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.figures.made import how_made, stamp
from sautereau.analysis.figures.palette import MEASURED, PREDICTED
from sautereau.analysis.figures.pressed import scale_to_pluck, shade_phases
from sautereau.analysis.loading.press import Press, load_press
from sautereau.analysis.model.predict import Prediction
from sautereau.analysis.phases import Phases
from sautereau.analysis.session.conditions import SessionAnalysis
from sautereau.analysis.summary.text import counted

BESIDE = 5e-3
"""s, before contact and after release, that force on deflection is drawn of."""
PICTURED = 8
"""Number of presses of a condition that its plot shows, the first ones."""


def comparison_figure(
    presses: Sequence[Press], phases: Sequence[Phases], prediction: Prediction
) -> Figure:
    """Return a figure of deflection and force with the phases, and of force on deflection.

    The first press is drawn over time with the three phases marked, as in the paper's
    figure 7; all presses and the prediction are drawn aligned at contact, as in figure 8.

    Raises:
        AnalysisError: There is no press to draw.
    """
    if not presses:
        raise AnalysisError("there is no press to draw; give at least one recording")
    figure = Figure(figsize=(12, 6.5), layout="constrained")
    grid = figure.add_gridspec(2, 2, width_ratios=(1.25, 1))
    top = figure.add_subplot(grid[0, 0])
    below = figure.add_subplot(grid[1, 0], sharex=top)
    right = figure.add_subplot(grid[:, 1])
    _over_time(top, below, presses[0], phases[0], prediction)
    _force_on_deflection(right, presses, phases, prediction)
    simulated = any(press.simulated for press in presses)
    number = counted(len(presses), "press")
    figure.suptitle(f"Rig {presses[0].rig.name}: {number}, {how_made(simulated)}")
    stamp(figure, simulated)
    return figure


def session_figure(found: SessionAnalysis, number: int = 1) -> Figure:
    """Return `comparison_figure` of the first presses of one condition of a session.

    Args:
        number: Number of the condition, from 1.

    Raises:
        AnalysisError: There is no such condition, or nothing to compare in it.
    """
    if not 1 <= number <= len(found.conditions):
        raise AnalysisError(f"condition {number}: the session has 1 to {len(found.conditions)}")
    condition = found.conditions[number - 1]
    if condition.prediction is None or not condition.counted:
        why = "; ".join(condition.warnings) or "only warm-up presses"
        raise AnalysisError(f"condition {number}: nothing to draw: {why}")
    first = condition.counted[:PICTURED]
    presses = [load_press(press.press.path) for press in first]
    figure = comparison_figure(presses, [press.phases for press in first], condition.prediction)
    if (n := len(found.conditions)) > 1:
        condition_of = f"condition {number} of {n}, {found.label(condition)}"
        figure.suptitle(f"{figure.get_suptitle()}\n{condition_of}")
    return figure


def _over_time(top, below, press: Press, phases: Phases, prediction: Prediction) -> None:
    time = press.time * 1e3
    model = (prediction.time + phases.start) * 1e3
    if phases.plucks:
        model = (prediction.time - prediction.contact + phases.plucks[0].contact) * 1e3
    label = f"{press.path.name}, {_label(press)}"
    top.plot(time, press.samples["deflection"] * 1e3, color=MEASURED, label=label)
    top.plot(model, prediction.deflection * 1e3, color=PREDICTED, ls="--", label="predicted")
    top.set_ylabel("deflection at the laser (mm)")
    top.legend(loc="lower right")
    below.plot(time, press.samples["force"], color=MEASURED, lw=0.8)
    below.plot(model, prediction.finger_force, color=PREDICTED, ls="--")
    below.set(ylabel="finger force (N)", xlabel="time after the trigger (ms)")
    end = phases.bottom * 1e3
    below.set_xlim(0, end)
    scale_to_pluck(below, press, phases, prediction.peak_force)
    held = phases.plucks[:1]
    edges = [0.0, *(1e3 * t for pluck in held for t in (pluck.contact, pluck.release)), end]
    shade_phases(below, edges)
    shade_phases(top, edges, named=True)


def _force_on_deflection(axes, presses, phases, prediction: Prediction) -> None:
    for press, found in zip(presses, phases, strict=True):
        if not found.plucks:
            continue
        held = found.plucks[0]
        end = min(held.release + BESIDE, found.bottom)
        deflection, force = press.from_contact(held.contact, held.contact - BESIDE, end)
        label = None if axes.lines else f"{_label(press)}, {counted(len(presses), 'press')}"
        axes.plot(deflection * 1e3, force, color=MEASURED, lw=0.7, alpha=0.7, label=label)
    deflection, force = prediction.from_contact(BESIDE)
    label = f"predicted ({prediction.level})"
    axes.plot(deflection * 1e3, force, color=PREDICTED, ls="--", lw=2, label=label)
    axes.set(xlabel="deflection at the laser from contact (mm)", ylabel="finger force (N)")
    axes.legend(loc="upper left")


def _label(press: Press) -> str:
    return "simulated" if press.simulated else "measured"

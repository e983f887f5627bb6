"""Plan a press, place the robot, predict a press by the model."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from sautereau.commands import common
from sautereau.commands.output import FileOutput, json_text, save_plot

if TYPE_CHECKING:
    from sautereau.analysis.results.plan import Plan


def plan(
    rig: common.RigName = "paper",
    *,
    learned: common.Learned = None,
    out: common.OutFile | None = None,
    plot: common.Picture = None,
    bench: common.Drawing = None,
    identify: Annotated[str, "NAMES"] | None = None,
    presses: common.Count = 3,
    speed: list[str] | None = None,
    prior: list[str] | None = None,
    force_noise: Annotated[str, common.RARE] = "5 mN",
    velocity_noise: Annotated[str, common.RARE] = "0.05 mm/s",
    output: FileOutput = FileOutput(),
) -> int:
    """Plan one press and check it, or say what presses would show of the rig.

    Prints the five checks with the smallest margins. Use --verbose to see all of them.

    Parameters
    ----------
    learned
        Correction of the trajectory, written by `sautereau learn`.
    out
        File for the controller's segments, as JSON; written only if every check passes.
    identify
        Parameters that identify is to fit, separated by commas: print the uncertainties that such
        presses would reach, and rank other speeds, more presses, presses without the string, and
        measurements. The plot shows them.
    presses
        Number of presses, with --identify.
    speed
        Other speed of the jack to compare, with --identify: "0.03 m/s". Repeat it for several.
        Default: half and twice the planned one.
    prior
        Prior knowledge of a parameter, with --identify; as for identify.
    force_noise
        Standard deviation of a sample of the force, white noise, with --identify.
    velocity_noise
        The same of the velocity.
    """
    from sautereau.rig.disk import write_durably
    from sautereau.trajectory.segments import segments_document

    if identify:
        given = {"--out": out, "--bench": bench, "--learned": learned}
        if useless := [name for name, value in given.items() if value]:
            return output.fail(
                f"{', '.join(useless)}: not with --identify, which plans no press", 2
            )
        with output.progress("predicting"):
            expected = _made(rig, None).expected(
                identify,
                prior or (),
                presses=presses,
                speeds=speed or (),
                force_noise=force_noise,
                velocity_noise=velocity_noise,
            )
        return output.show(expected, plot)
    if useless := [name for name, value in {"--speed": speed, "--prior": prior}.items() if value]:
        return output.fail(f"{', '.join(useless)}: only with --identify", 2)
    made = _made(rig, learned)
    nominal, draft = made.rig, made.trajectory
    lines = made.lines(all_checks=output.verbose)
    if out and made.feasible:
        period = nominal.controller.sample_period
        document = segments_document(draft.segments, period, draft.home, draft.hover)
        write_durably(out, json_text(document) + "\n")
        lines.append(f"segments: {out}")
    if plot:
        save_plot(plot, made.plot(), dpi=110)
        lines.append(f"picture: {plot}")
    if bench:
        from sautereau.analysis.figures.bench import bench_figure

        save_plot(bench, bench_figure(nominal, draft))
        lines.append(f"bench: {bench}")
    output.answer(made.document, lines)
    if not made.feasible:
        faults = (f"{c}; {c.how_to_fix}" for c in draft.checks if not c.holds)
        return output.fail("\n  ".join(["the press is not feasible:", *faults]))
    return 0


def _made(rig: str, learned: Path | None) -> "Plan":
    """Return the plan of a press, with a learned correction and what speaks against it."""
    from sautereau.analysis.results.plan import plan as planned
    from sautereau.analysis.results.rig import Rig

    nominal, correction, doubts = Rig(rig).values, None, ()
    if learned:
        from sautereau.robot.experiment.learning import read_learned

        found = read_learned(learned, nominal)
        correction, doubts = found.correction, found.doubts
    made = planned(nominal, correction)
    return replace(made, warnings=(*made.warnings, *doubts))


def mount(
    rig: common.RigName = "paper",
    *,
    plot: common.Picture = None,
    touches: Annotated[Path | None, common.read_as("a CSV file of touches", ".csv")] = None,
    trust_homing: Annotated[bool, common.RARE] = False,
    output: FileOutput = FileOutput(),
) -> int:
    """Find where to clamp the robot, or measure with touches where it is clamped.

    Parameters
    ----------
    touches
        CSV file of points on the key at rest that were touched with the jogged fingertip.
        Columns: point [mm] (from the balance pin, negative in front), joint1 [counts] and
        joint2 [counts], or [deg].
    trust_homing
        Assume that the joint zeros are exact, and estimate only the position of the base.
    """
    import numpy as np

    from sautereau.analysis.results.mount import Clamping
    from sautereau.rig.csv_files import read_touched_points
    from sautereau.trajectory.mount.find import find_mount
    from sautereau.trajectory.mount.locate import locate_base

    if trust_homing and touches is None:
        return output.fail("--trust-homing: it concerns --touches FILE, which is missing", 2)
    bench = common.load_rig(rig)
    located = None
    if touches:
        read = read_touched_points(touches, bench.arm)
        offsets = 0 if trust_homing else None
        located = locate_base(bench, np.array(read.joints), np.array(read.points), offsets=offsets)
    with output.progress("finding places"):
        found = Clamping(bench, find_mount(bench), located)
    if plot:
        with output.progress("drawing the map"):
            save_plot(plot, found.plot())
    return output.answer(found.document, found.lines(), plot)


def predict(
    rig: common.RigName = "paper",
    *,
    fit: Annotated[Path | None, common.read_as("the JSON of identify", ".json")] = None,
    level: common.Level = "auto",
    force_map: Annotated[
        common.OutFile | None, Parameter("--map"), common.written_as(".csv", ".h5")
    ] = None,
    plot: common.Picture = None,
    output: FileOutput = FileOutput(),
) -> int:
    """Predict a press by the model alone; the plot shows all plectrum models.

    With an outline that `sautereau outline` has written, the quantities have the 95 % intervals
    that the photograph and the assumed ranges of the plectrum's material leave.

    Parameters
    ----------
    fit
        JSON of identify: predict with its values, and with the intervals that their uncertainties
        cause. The plot shows the distributions.
    force_map
        File for the finger force over travel and speed, while the key goes down and while it comes
        back, as a haptic key needs it (.csv, .h5). The plot shows it.
    """
    from sautereau.analysis.results.force_map import force_map as mapped
    from sautereau.analysis.results.prediction import predicted, read_distribution
    from sautereau.analysis.results.rig import Rig

    if fit and force_map:
        return output.fail("--fit and --map exclude each other; give one of them", 2)
    if force_map:
        with output.progress("predicting"):
            found = mapped(Rig(rig).values, level)
        found.write(force_map)
        return output.show(found, plot, lines=[*found.lines(), f"map: {force_map}"])
    if fit:
        with output.progress("predicting"):
            own = predicted(Rig(rig).values, *read_distribution(fit), level=level)
        return output.show(own, plot)
    with output.progress("predicting"):
        found = Rig(rig).predict(level=level)
    document, lines = found.document, found.lines()
    with output.progress("predicting the ensemble of outlines"):
        if own := found.intervals(level=level):
            document, lines = {**document, "intervals": own.document}, [*lines, *own.lines()]
    if plot:
        with output.progress("predicting by all plectrum models"):
            save_plot(plot, found.plot())
    return output.answer(document, lines, plot)

"""Find the phases of recordings, compare them with the model, and fit the model to recordings."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from sautereau.analysis.summary.text import SOME_SIMULATED
from sautereau.commands import common

if TYPE_CHECKING:
    from sautereau.analysis.identify.identified import Identified
    from sautereau.rig.schema import Rig


def phases(
    files: list[Path],
    /,
    *,
    at: list[str] | None = None,
    plot: common.Picture = None,
    json: common.Json = False,
) -> int:
    """Find contact and release of every string in recorded presses, with uncertainties.

    Parameters
    ----------
    files
        Recordings.
    at
        Contact and release of a pluck set by hand, "52.1 ms +- 0.3 ms to 72.05 ms +- 0.05 ms";
        repeat it for several; "none" for a press without a pluck. They are stored beside the one
        recording, in FILE.phases.toml, and used by all commands until that file is deleted.
    """
    from sautereau.analysis.errors import AnalysisError
    from sautereau.analysis.phases.by_hand import write_by_hand
    from sautereau.analysis.summary.press import HEADER, press_line, press_summary

    if at:
        if len(files) != 1:
            raise AnalysisError(
                f"--at: it sets the phases of one recording, and {len(files)} were given; give one"
            )
        write_by_hand(files[0], [] if at == ["none"] else at)
    pressed, found = common.load(files)
    both = list(zip(pressed, found, strict=True))
    warnings = [f"{p.path}: {warning}" for p, f in both for warning in (*p.warnings, *f.warnings)]
    lines = [HEADER, *(press_line(p, f) for p, f in both), *warnings]
    result: dict[str, object] = {"files": [press_summary(p, f) for p, f in both]}
    if plot:
        from sautereau.analysis.figures.phases import phases_figure

        phases_figure(pressed, found).savefig(plot, dpi=120)
    return common.answer(json, result, lines, plot)


def compare(
    files: list[Path],
    /,
    *,
    rig: str | None = None,
    level: common.Level = "elastica",
    plot: common.Picture = None,
    json: common.Json = False,
) -> int:
    """Compare recorded presses with the model.

    Parameters
    ----------
    files
        Recordings of one rig.
    rig
        Path of the rig file to predict with, for example one written by identify. Default: the
        rig saved in the first recording.
    """
    from sautereau.analysis.model.predict import predict as predict_press
    from sautereau.analysis.press.features import features
    from sautereau.analysis.session.compare import compare as compare_presses
    from sautereau.analysis.session.compare import compare_features, predict_each
    from sautereau.analysis.summary.session import comparison_lines, comparison_summary

    pressed, found = common.load(files)
    bench = common.load_rig(rig) if rig else pressed[0].rig
    prediction = predict_press(bench, level)
    each = predict_each(pressed, found, bench, level)
    comparison = compare_presses(found, each)
    every = compare_features(list(map(features, pressed, found)), bench, each)
    simulated = any(p.simulated for p in pressed)
    lines = [*([SOME_SIMULATED] * simulated), *comparison_lines(comparison, level, every)]
    result = comparison_summary(comparison, every) | {"simulated": simulated}
    if plot:
        from sautereau.analysis.figures.comparison import comparison_figure

        comparison_figure(pressed, found, prediction).savefig(plot, dpi=120)
    return common.answer(json, result, lines, plot)


def identify(
    files: list[Path],
    /,
    *,
    free: Annotated[str, "NAMES"],
    prior: list[str] | None = None,
    level: common.Level = "elastica",
    starts: int = 3,
    robust: bool = False,
    profile: bool = False,
    verbose: Annotated[bool, Parameter(name=["-v", "--verbose"])] = False,
    out: common.OutFile | None = None,
    plot: common.Picture = None,
    json: common.Json = False,
) -> int:
    """Fit unknown values of the rig to recorded presses, and report which are identifiable.

    Parameters
    ----------
    files
        Recordings of one instrument.
    free
        Parameters to fit, separated by commas: plectrum.overlap,key.inertia.
    prior
        Prior knowledge of a parameter, "key.inertia=7e-4 kg m^2 +- 1e-4 kg m^2", or its bounds,
        "plectrum.overlap=0.1 mm to 0.5 mm"; repeat it for several. Default bounds: the ranges
        assumed in the rig.
    starts
        Number of starting points: the rig's values, and others between the bounds.
    robust
        Weight large residuals linearly instead of quadratically.
    profile
        Compute 95 % intervals by profile likelihood, too; this takes longer.
    verbose
        List what each fixed number of the rig does to the results.
    out
        Rig file for the identifiable values of a model that fits. Other values of an existing
        file stay; a new file is written from the recordings' rig.
    """
    from sautereau.analysis.identify.fit import fit, inverse_dynamics
    from sautereau.analysis.identify.identified import evaluate
    from sautereau.analysis.identify.parameters import FORCE, read_prior
    from sautereau.analysis.identify.profile import profile as profile_of
    from sautereau.analysis.summary.fit import fit_lines, fit_summary

    names = [name.strip() for name in free.split(",") if name.strip()]
    priors = dict(read_prior(text) for text in prior or [])
    pressed, phases = common.load(files)
    dynamics = inverse_dynamics(pressed, phases, names, priors, level)
    made = fit(dynamics, starts, robust, levelled=FORCE in names)
    found = evaluate(made)
    profiles = [profile_of(made, found, e.name) for e in found.estimates] if profile else []
    simulated = any(p.simulated for p in pressed)
    result = fit_summary(found, profiles) | {"simulated": simulated}
    lines = [*([SOME_SIMULATED] * simulated), *fit_lines(found, profiles, every=verbose)]
    if plot:
        from sautereau.analysis.figures.fit import fit_figure

        fit_figure(made, found, simulated).savefig(plot, dpi=120)
        result["picture"] = str(plot)
        lines.append(f"picture: {plot}")
    if out:
        result["rig"] = str(out)
        result["written"] = _write_rig(out, pressed[0].rig, found, simulated)
        lines.append(f"rig:     {out}, with {', '.join(result['written']) or 'nothing new'}")
    return common.answer(json, result, lines)


def _write_rig(out: Path, nominal: "Rig", found: "Identified", simulated: bool) -> dict[str, Any]:
    """Write the identifiable values into a rig file, and return them by their keys."""
    from datetime import date

    from sautereau.analysis.identify.parameters import rig_values
    from sautereau.rig.disk import write_durably
    from sautereau.rig.edit import edit_rig, edited_text
    from sautereau.rig.text import rig_text

    sure = [e for e in found.estimates if e.identifiable and found.quality.fits]
    values = rig_values(nominal, {e.name: e.value for e in sure})
    first, count = found.presses[0], len(found.presses)
    source = (
        f"identified from {'SIMULATED ' * simulated}{first}"
        f"{f' and {count - 1} more' * (count > 1)} on {date.today().isoformat()}"
    )
    if not out.exists():
        out.parent.mkdir(parents=True, exist_ok=True)
        text = edited_text(rig_text(nominal), str(out), out.parent, values, source)
        write_durably(out, text, new=True)
    elif values:
        edit_rig(out, values, source).save()
    return values

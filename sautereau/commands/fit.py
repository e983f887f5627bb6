"""Find phases and oscillations of recordings, compare them with the model, and fit it to them."""

from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from sautereau.analysis.text import SOME_SIMULATED, grouped, listed, remark_lines
from sautereau.commands import common
from sautereau.commands.output import FileOutput, has, make_folders, save_plot

if TYPE_CHECKING:
    from sautereau.analysis.transient.attribute import Source
    from sautereau.analysis.transient.evidence import Examined


def phases(
    files: common.Files,
    /,
    *,
    at: list[str] | None = None,
    plot: common.Picture = None,
    output: FileOutput = FileOutput(),
) -> int:
    """Find contact and release of every string in recorded presses, with uncertainties.

    Use --verbose to list remarks, which make no result doubtful.

    Parameters
    ----------
    at
        Set contact and release of a pluck of one recording by hand,
        "52.1 ms +- 0.3 ms to 72.05 ms +- 0.05 ms", or "none" for no pluck. Repeat it for several
        plucks. All commands use the values until you delete FILE.phases.toml beside the recording.
    """
    from sautereau.analysis.results.press import HEADER
    from sautereau.entrance.found import each
    from sautereau.entrance.session import Session, open

    if at:
        from sautereau.analysis.errors import AnalysisError
        from sautereau.analysis.phases.by_hand import write_by_hand

        if len(files) != 1 or not files[0].is_file():
            raise AnalysisError(
                f"--at sets the phases of one recording, but {' '.join(map(str, files))} is not one"
                " file; give one recording"
            )
        with common.options():
            write_by_hand(files[0], [] if at == ["none"] else at)
    with output.progress("reading recordings"):
        read, faults = each(open(files), lambda p: (p, p.partial))
    session, texts = Session(p for p, _ in read), [str(error) for _, error in faults]
    warnings = [(p.path, warning) for p, partial in read for warning in partial.warnings]
    remarks = ((p.path, remark) for p, partial in read for remark in partial.remarks)
    folders = {p.path.parent for p in session}
    lines = [HEADER]
    for folder, own in groupby(session, lambda p: p.path.parent):
        lines += [*[f"{folder}:"] * (len(folders) > 1), *(p.line for p in own)]
    lines += [f"warning: {text}" for text in grouped(warnings, "press")]
    lines += remark_lines(remarks, output.verbose, "--verbose")
    result = {"files": [p.document for p in session], "faults": texts}
    return output.answer(result, lines, plot, texts, draw=session.plot)


def compare(
    files: common.Files,
    /,
    *,
    against: Annotated[list[Path] | None, Parameter(consume_multiple=True)] = None,
    rig: str | None = None,
    level: common.Level = "auto",
    plot: common.Picture = None,
    output: FileOutput = FileOutput(),
) -> int:
    """Compare recorded presses with the model, or with another set of presses.

    Presses of different rigs, scenes or days are not pooled but compared separately. The plot
    has a row for each condition: its first presses in both sets, and the model of the first set.
    Use --verbose to list remarks, which make no result doubtful.

    Parameters
    ----------
    against
        Another set of recordings: its features are subtracted from those of the first, with
        95 % intervals.
    rig
        Path of the rig file to predict with, for example one written by identify. Default: the
        rig saved in each recording.
    """
    from sautereau.analysis.errors import AnalysisError
    from sautereau.entrance.found import every
    from sautereau.entrance.session import open

    bench = common.load_rig(rig) if rig else None
    with output.progress("reading recordings"):
        given = every([files, against] if against else [files], open)
        (session, texts), *others = every(given, lambda one: one.readable(processes=None))
        other = others[0][0] if others else None
    faults = [*texts, *(text for _, more in others for text in more)]
    with output.progress("predicting"):
        found = session.compare(other, rig=bench, level=level)
    conditions = found.found.conditions
    if not (other or any(condition.comparison for condition in conditions)):
        raise AnalysisError("\n".join(w for condition in conditions for w in condition.warnings))
    lines = [*([SOME_SIMULATED] * found.found.simulated), *found.lines(remarks=output.verbose)]
    return output.show(found, plot, faults, lines=lines)


def identify(
    files: common.Files,
    /,
    *,
    free: Annotated[str, "NAMES"],
    prior: list[str] | None = None,
    level: common.Level = "auto",
    starts: Annotated[common.Count, common.RARE] = 3,
    robust: Annotated[bool, common.RARE] = False,
    profile: bool = False,
    out: Path | None = None,
    plot: common.Picture = None,
    output: FileOutput = FileOutput(),
) -> int:
    """Fit unknown values of the rig to recorded presses, and report which are identifiable.

    All recordings must be of one instrument. Use --verbose to list how the results depend on the
    fixed numbers of the rig.

    Parameters
    ----------
    free
        Parameters to fit, separated by commas: plectrum.overlap,key.inertia. Those of further
        strings are called string2.plectrum.overlap and so on.
    prior
        Prior knowledge of a parameter, "key.inertia=7e-4 kg m^2 +- 1e-4 kg m^2", or its bounds,
        "plectrum.overlap=0.1 mm to 0.5 mm". Repeat it for several. Default bounds: the ranges
        assumed in the rig.
    starts
        Number of starting points: the rig's values, and others between the bounds.
    robust
        Weight large residuals linearly instead of quadratically.
    profile
        Also compute 95 % intervals by profile likelihood. This takes longer.
    out
        Write the identifiable values to this rig file, if there are any and the model fits. A new
        file gets all other values from the recordings; with --force an existing file keeps its
        other values.
    """
    from sautereau.analysis.identify.parameters import check_names, read_prior
    from sautereau.rig.progress import tracked

    names = listed(free)
    with common.options():
        check_names(names, dict(map(read_prior, prior or ())))
    # Only the end shows whether a file of an earlier identification is the one of this command.
    earlier = out is not None and not output.force and has(out, "identified from ", within=True)
    output.refuse(None if earlier else out)
    make_folders(out)
    session, faults = common.opened(files, output, samples=True)
    with output.progress("fitting"):
        fit = session.identify(names, prior or (), level=level, starts=starts, robust=robust)
    if profile:
        with output.progress("profile likelihood"):
            found = [fit.profile(e.name) for e in tracked(fit.found.estimates)]
        fit = replace(fit, profiles=tuple(found))
    result, lines = fit.document | {"faults": faults}, fit.lines(every=output.verbose)
    if plot:
        save_plot(plot, fit.plot())
    if out:
        if not (earlier and has(out, fit.text)):
            output.refuse(out)
            fit.write(out)
        result |= {"rig": str(out) if fit.values else None, "written": fit.values}
        written = f"{out}, with {', '.join(fit.values)}" if fit.values else "nothing was written"
        lines.append(f"rig:     {written}")
    return output.answer(result, lines, plot, faults)


def transient(
    files: common.Files,
    /,
    *,
    known: list[str] | None = None,
    plot: common.Picture = None,
    output: FileOutput = FileOutput(),
) -> int:
    """Find oscillations in presses of one rig, and the source of each.

    Parameters
    ----------
    known
        Source and frequency of a mode that another measurement gave: "key=350 Hz", "finger=..." or
        "transducer=...". Repeat it for several.
    """
    from sautereau.analysis.alike import check_alike
    from sautereau.analysis.results.transient import Transient
    from sautereau.analysis.transient.attribute import attribute
    from sautereau.analysis.transient.evidence import combine, examine
    from sautereau.entrance.found import each

    measured = _known(known or [])
    session, faults = common.opened(files, output, samples=True)
    rig = check_alike({str(one.path): one.press.rig for one in session})
    examined: list[Examined] = []
    with output.progress("finding modes"):
        _, others = each(
            session, lambda p: examined.append(examine(p.press, p.phases, len(examined)))
        )
    faults += [str(error) for _, error in others]
    found = Transient(tuple(examined), tuple(attribute(combine(examined), rig, measured)))
    return output.show(found, plot, faults)


def _known(texts: list[str]) -> "dict[Source, list[float]]":
    """Return measured modes by their source; all faults are reported together."""
    from sautereau.analysis.transient.attribute import Source
    from sautereau.rig.errors import UsageError
    from sautereau.rig.units import parse_quantity

    found: dict[Source, list[float]] = {}
    faults = []
    sources = {"key": Source.KEY, "finger": Source.FINGER, "transducer": Source.TRANSDUCER}
    for text in texts:
        name, equals, value = text.partition("=")
        try:
            if not equals:
                raise ValueError('write it like "key=350 Hz"')
            frequency = parse_quantity(value.strip(), "Hz")
        except ValueError as error:
            faults.append(f"--known {text}: {error}")
            continue
        if name.strip() not in sources:
            faults.append(f"--known {text}: the source is one of {', '.join(sources)}")
        elif not frequency > 0:
            faults.append(f"--known {text}: a frequency is above 0 Hz")
        else:
            found.setdefault(sources[name.strip()], []).append(frequency)
    if faults:
        raise UsageError("\n".join(faults))
    return found

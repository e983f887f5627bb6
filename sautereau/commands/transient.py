"""The transient phase: damped modes and their sources."""

from pathlib import Path
from typing import TYPE_CHECKING

from sautereau.commands import common

if TYPE_CHECKING:
    from sautereau.analysis.transient import Source


def transient(
    files: list[Path],
    /,
    *,
    known: list[str] | None = None,
    plot: common.Picture = None,
    json: common.Json = False,
) -> int:
    """Find damped modes in presses, and attribute each to string, key, finger or transducer.

    Parameters
    ----------
    files
        Recordings of one rig.
    known
        Frequency of a mode that was measured otherwise, "key=350 Hz", "finger=..." or
        "transducer=..."; repeat it for several.
    """
    from sautereau.analysis.alike import check_alike
    from sautereau.analysis.summary.transient import transient_lines, transient_summary
    from sautereau.analysis.transient import attribute, combine, examine

    measured = _known(known or [])
    session = common.opened(files, samples=True)
    rig = check_alike({str(each.press.path): each.press.rig for each in session})
    examined = [examine(p.press, p.phases, n) for n, p in enumerate(session)]
    found = attribute(combine(examined), rig, measured)
    if plot:
        from sautereau.analysis.figures.transient import transient_figure

        transient_figure(examined, found).savefig(plot, dpi=120)
    lines = transient_lines(examined, found)
    return common.answer(json, transient_summary(examined, found), lines, plot)


def _known(texts: list[str]) -> "dict[Source, list[float]]":
    """Return measured modes by their source; all faults are reported together."""
    from sautereau.analysis.errors import AnalysisError
    from sautereau.analysis.transient import Source
    from sautereau.rig.units import parse_quantity

    found: dict[Source, list[float]] = {}
    faults = []
    sources = {"key": Source.KEY, "finger": Source.FINGER, "transducer": Source.TRANSDUCER}
    for text in texts:
        name, _, value = text.partition("=")
        try:
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
        raise AnalysisError("\n".join(faults))
    return found

"""The transient phase: damped modes and their sources."""

from typing import TYPE_CHECKING

from sautereau.commands import common
from sautereau.commands.output import FileOutput, save_plot

if TYPE_CHECKING:
    from sautereau.analysis.transient import Source
    from sautereau.analysis.transient.evidence import Examined


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
    from sautereau.analysis.transient import attribute, combine, examine
    from sautereau.entrance.each import each

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
    if plot:
        save_plot(plot, found.plot())
    return output.answer(found.document | {"faults": faults}, found.lines(), plot, faults)


def _known(texts: list[str]) -> "dict[Source, list[float]]":
    """Return measured modes by their source; all faults are reported together."""
    from sautereau.analysis.transient import Source
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

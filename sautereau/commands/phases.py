"""Contact and release in recorded presses."""

from pathlib import Path

from sautereau.commands.common import Json, Picture, answer, load


def phases(files: list[Path], /, *, plot: Picture = None, json: Json = False) -> int:
    """Find contact and release of every string in recorded presses, with uncertainties.

    Parameters
    ----------
    files
        Recordings.
    """
    from sautereau.analysis.summary.press import HEADER, press_line, press_summary

    both = load(files)
    warnings = [f"{p.path}: {warning}" for p, f in both for warning in (*p.warnings, *f.warnings)]
    lines = [HEADER, *(press_line(p, f) for p, f in both), *warnings]
    result: dict[str, object] = {"files": [press_summary(p, f) for p, f in both]}
    if plot:
        from sautereau.analysis.figures.phases import plot_phases

        plot_phases(plot, [p for p, _ in both], [f for _, f in both])
        lines.append(f"picture: {plot}")
        result["picture"] = str(plot)
    answer(json, result, lines)
    return 0

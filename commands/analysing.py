"""From recordings to conclusions."""

from pathlib import Path

from commands.common import Json, Level, Picture, answer, draw, load


def phases(files: list[Path], /, *, json: Json = False) -> int:
    """Find when the string was met and let go in recorded presses.

    Parameters
    ----------
    files
        Recordings.
    """
    from analysis.summary.press import HEADER, press_line, press_summary

    both = load(files)
    warnings = [f"{p.path}: {warning}" for p, f in both for warning in (*p.warnings, *f.warnings)]
    lines = [HEADER, *(press_line(p, f) for p, f in both), *warnings]
    answer(json, {"files": [press_summary(p, f) for p, f in both]}, lines)
    return 0


def compare(
    files: list[Path], /, *, level: Level = "elastica", plot: Picture = None, json: Json = False
) -> int:
    """Compare recorded presses with the model of the rig that they carry.

    Parameters
    ----------
    files
        Recordings of one rig.
    """
    from analysis.compare import compare as compare_presses
    from analysis.model.predict import predict as predict_press
    from analysis.summary.press import comparison_lines, comparison_summary

    both = load(files)
    pressed, found = [p for p, _ in both], [f for _, f in both]
    prediction = predict_press(pressed[0].rig, level)
    comparison = compare_presses(found, prediction)
    simulated = any(p.simulated for p in pressed)
    lines = [*comparison_lines(comparison, level)]
    if simulated:
        lines.insert(0, "SIMULATED: at least one of these presses was made on the stand-in")
    result = comparison_summary(comparison) | {"simulated": simulated}
    if plot:
        draw(plot, pressed, found, prediction)
        lines.append(f"picture: {plot}")
        result["picture"] = str(plot)
    answer(json, result, lines)
    return 0

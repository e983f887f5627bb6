"""From a photograph of a plectrum to its outline."""

from pathlib import Path
from typing import Annotated, Literal

from sautereau.commands import common
from sautereau.commands.output import FileOutput, save_plot

Known = Annotated[str | None, "QUANTITY"]


def outline(
    photo: Annotated[Path, "PHOTO"],
    /,
    *,
    out: Annotated[common.OutFile | None, common.written_as(".csv")] = None,
    plot: common.Picture = None,
    pixels_per_mm: Known = None,
    ruler: str | None = None,
    length: Known = None,
    thickness: Known = None,
    clamp: Annotated[str | None, "COLUMN,ROW"] = None,
    tilt: Known = None,
    upper: Literal["up", "down"] | None = None,
    output: FileOutput = FileOutput(),
) -> int:
    """Find the outline of a plectrum in a photograph of its side, with its uncertainty.

    Name the file in a rig: `outline = { file = "FILE" }`, without `length` and `thickness`, which
    follow from it. Look at the plot: the mesh must cover the plectrum from the clamp to the tip.

    Parameters
    ----------
    photo
        Picture of one plectrum, lit from behind, its tip to the left or right.
    out
        File for the outline, and for 30 more that the photograph allows.
    pixels_per_mm
        Scale, with its standard uncertainty: "250 +/- 0.5".
    ruler
        Scale by two points in pixels and their distance: "100,900 1350,900 5 mm".
    length
        Length from the clamp to the tip, "4.5 mm +/- 0.01 mm": for the scale, or for the clamp.
    thickness
        Thickness at the clamp, for the scale.
    clamp
        Centre of the clamp in pixels, "212,640". Default: at the jack's face, if it is seen.
    tilt
        Direction of the plectrum, counterclockwise, "2 deg". Default: from the jack's face or the
        uncut side.
    upper
        Where the string's side of the plectrum points. Default: the uncut side.
    """
    from sautereau.analysis.results.outlined import outline as outlined

    with output.progress("finding the outline"):
        found = outlined(
            photo,
            pixels_per_mm=pixels_per_mm,
            ruler=ruler,
            length=length,
            thickness=thickness,
            clamp=clamp,
            tilt=tilt,
            upper=upper,
        )
    lines = found.lines()
    if out:
        found.write(out)
        lines.append(f"outline: {out}")
    if plot:
        save_plot(plot, found.plot())
    return output.answer(found.document, lines, plot)

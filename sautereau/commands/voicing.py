"""From a photograph of a plectrum to its outline, and to a proposal how to carve it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from sautereau.commands import common
from sautereau.commands.output import FileOutput

if TYPE_CHECKING:
    from sautereau.analysis.results.outlined import Outlined
    from sautereau.analysis.results.voiced import Voiced

Known = Annotated[str | None, "QUANTITY"]


def outline(
    photo: Annotated[Path, "PHOTO", common.read_as("a photograph", *common.PICTURES)],
    /,
    *,
    out: Annotated[common.OutFile | None, common.written_as(".csv")] = None,
    plot: common.Picture = None,
    pixels_per_mm: Known = None,
    ruler: str | None = None,
    length: Known = None,
    thickness: Known = None,
    clamp: Annotated[str | None, "COLUMN,ROW"] = None,
    tilt: Annotated[Known, common.RARE] = None,
    upper: Annotated[Literal["up", "down"] | None, common.RARE] = None,
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
    return _answer(found, out, plot, output)


def voice(
    rig: common.RigName = "paper",
    *,
    target: list[str] | None = None,
    like: Annotated[str | None, "RIG"] = None,
    curve: Annotated[Path | None, common.read_as("a CSV file of a force", ".csv")] = None,
    string: common.Count = 1,
    least: Annotated[str, common.RARE] = "0.12 mm",
    most: Annotated[str, common.RARE] = "0.25 mm",
    stroke: Annotated[str, common.RARE] = "1 mm",
    out: Annotated[common.OutFile | None, common.written_as(".csv")] = None,
    plot: common.Picture = None,
    output: FileOutput = FileOutput(),
) -> int:
    """Propose where and how much to take from a plectrum's underside.

    Material is only taken away, as smoothly as a knife's strokes. Of all cuts that reach what is
    requested, the gentlest is proposed, and the press after it is predicted again. The plot shows
    plectrum, finger force, string and bridge force before and after.

    Parameters
    ----------
    target
        Quantity with its value: "force_drop 0.45 N". Repeat it for several. Quantities:
        release_force, force_drop, force_slope, work, pluck_duration, plectrum_force,
        release_angle, release_lift, v_osc.
    like
        Rig of another key, whose force drop and work on the same string are requested.
    curve
        CSV file of a requested finger force: deflection [mm] since contact, force [N].
    string
        Number of the string whose plectrum is carved.
    least
        Least thickness that remains.
    most
        Largest depth of the cut.
    stroke
        Length over which a stroke of the knife changes its depth.
    out
        File for the carved outline.
    """
    from sautereau.analysis.outline.carve import Knife
    from sautereau.analysis.results.voiced import voice as voiced
    from sautereau.rig.errors import UsageError
    from sautereau.rig.units import parse_quantity

    sizes = {"least": least, "most": most, "stroke": stroke}
    try:
        knife = Knife(**{name: parse_quantity(text, "m") for name, text in sizes.items()})
        if min(knife.least, knife.most, knife.stroke) <= 0:
            raise ValueError("all three must be above 0 mm")
    except ValueError as error:
        raise UsageError(f"--least, --most, --stroke: {error}") from error
    other = common.load_rig(like) if like else None
    with output.progress("carving"):
        found = voiced(
            common.load_rig(rig),
            target or (),
            string=string,
            like=other,
            curve=curve,
            knife=knife,
        )
    return _answer(found, out, plot, output)


def _answer(
    found: "Outlined | Voiced", out: Path | None, plot: Path | None, output: FileOutput
) -> int:
    """Write the outline and the plot that are requested, and print the result."""
    if out:
        found.write(out)
    return output.show(found, plot, lines=[*found.lines(), *([f"outline: {out}"] if out else [])])

"""The report of a session: one HTML page."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from shlex import quote

from pydantic_core import from_json

from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.report.build import About, Again, build_report
from sautereau.analysis.report.contents import Contents, PressRecord, gather
from sautereau.analysis.report.tables import PATTERN, read_fit
from sautereau.rig.schema import Rig
from sautereau.robot.experiment.plan import LEARNING, Plan
from sautereau.robot.experiment.session import WARM_UPS
from sautereau.robot.experiment.session_folder import MANIFEST, Manifest, read_manifest
from sautereau.sim_backend.scene import current_scene, load_scene, packaged_scenes


@dataclass(frozen=True)
class Report:
    """A page that was written."""

    path: Path
    presses: int
    """On the page."""
    simulated: bool
    """Whether the stand-in made any of them."""
    left_out: dict[Path, str]
    """Recordings that could not be read, and why."""


def page_of(
    recordings: Sequence[Path],
    folder: Path | None,
    warnings: Sequence[str],
    level: str,
    *,
    newest: bool = False,
) -> tuple[str, Contents]:
    """Return the report of recordings as a page, and what it contains.

    Args:
        newest: Whether they are the newest of a running session, which therefore lacks nothing.
    """
    contents = gather(recordings, level)
    presses, warnings = contents.presses, list(warnings)
    name = folder.resolve().name if folder else f"of {len(recordings)} recordings"
    manifest = read_manifest(folder) if folder else None
    fits = []
    for path in sorted(folder.glob(PATTERN)) if folder else ():
        try:
            fits.append(read_fit(path))
        except AnalysisError as error:
            warnings.append(str(error))
    warnings += [f"{fit.name}: {warning}" for fit in fits for warning in fit.warnings]
    again = None
    if manifest is not None:
        try:
            warnings += [] if newest else _left(manifest, presses)
            again = _again(manifest, presses)
        except (KeyError, TypeError, ValueError) as error:
            warnings.append(
                f"{MANIFEST}: its plan cannot be read ({type(error).__name__}: {error}); this page"
                " therefore does not show how to repeat the session"
            )
    commands = (
        f"report {quote(name)}",
        *(f"{c} {quote(name)}/*.mcap" for c in ("phases", "compare")),
    )
    about = About(
        name=name,
        version=version("sautereau"),
        commands=tuple(f"sautereau {command}" for command in commands if folder),
        warnings=tuple(warnings),
        again=again,
        scene=presses[0].session.scene,
        fits=tuple(fits),
        warm_ups=len(list(folder.glob(WARM_UPS))) if folder else 0,
    )
    return build_report(contents, about), contents


def _left(manifest: Manifest, presses: tuple[PressRecord, ...]) -> list[str]:
    """Return a warning if planned presses are missing."""
    planned = sum(int(row["repeats"]) for row in manifest.plan["presses"])
    counted = sum(not record.session.warm_up for record in presses)
    if counted >= planned:
        return []
    return [
        f"{counted} of {planned} planned presses are on this page; run the same"
        " `sautereau press` again to continue the session"
    ]


def _again(manifest: Manifest, presses: tuple[PressRecord, ...]) -> Again:
    """Return the command that repeats the session, with the rig file of this page."""
    rows, files = manifest.plan["presses"], dict(manifest.plan.get("files", {}))
    if learning := files.get("learned") == LEARNING:
        del files["learned"]
    words = [f"sautereau {'learn' if learning else 'press'} rig.toml"]
    several = "--design design.toml" if "levels" in rows[0] else "--table table.csv"
    words.append(f"-n {rows[0]['repeats']}" if len(rows) == 1 else several)
    if not learning and manifest.plan["warm_up"] != Plan.warm_up:
        words.append(f"--warm-up {manifest.plan['warm_up']}")
    if manifest.plan["rest"]:
        words.append(f"--rest '{manifest.plan['rest']} s'")
    needs = ["the rig below as rig.toml"]
    if len(rows) > 1:
        needs.append(f"the conditions above as {several.split()[1]}")
    for kind, digest in files.items():
        needs.append(f"the file of {kind} with SHA-256 {digest}")
        words.append(f"--{kind.replace('_', '-')} FILE")
    scene = presses[0].session.scene
    if scene:
        name = _packaged(scene, presses[0].press.rig)
        words.append(f"--scene {name or 'scene.toml'} --seed {manifest.seed}")
        if not name:
            needs.append("the scene below as scene.toml, each number with its SI unit")
    return Again(
        f"To repeat this session, with {', '.join(needs)}:", " ".join([*words, "--out AGAIN"])
    )


def _packaged(scene: str, rig: Rig) -> str:
    """Return the name of the packaged scene that has this text on a rig; empty for none."""
    document = current_scene(from_json(scene))
    for name in packaged_scenes():
        packaged = load_scene(name)
        chosen = {key: document[key] for key in ("plectrum", "engine")}
        if packaged.model_dump(mode="json") | chosen != document:
            continue
        meant = packaged.on_rig(rig)  # a recording has what `auto` means on its rig
        if all(document[key] in (getattr(packaged, key), getattr(meant, key)) for key in chosen):
            return name
    return ""

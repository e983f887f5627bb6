"""A session as one HTML page."""

from importlib.util import find_spec
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

from sautereau.analysis.summary.text import SOME_SIMULATED
from sautereau.commands import common

if TYPE_CHECKING:
    from sautereau.analysis.report.build import About, Again
    from sautereau.analysis.report.contents import PressRecord
    from sautereau.robot.experiment.session_folder import Manifest

PAGE = "report.html"
"""Name of the page in the session's folder."""
PACKAGES = ("jinja2", "plotly")
"""Packages that only a report needs; an updated checkout may lack them."""


def report(
    session: Path,
    /,
    *,
    out: common.OutFile | None = None,
    level: common.Level = "elastica",
    json: common.Json = False,
) -> int:
    """Write one HTML page about a session; it opens offline, in any browser.

    Parameters
    ----------
    session
        Folder of recordings, written by `sautereau press --out`. Files fit*.json in it are
        fits, written by `sautereau identify --json`.
    out
        File of the page; an existing one is replaced. Default: report.html in the folder.
    """
    from sautereau.analysis.errors import AnalysisError

    missing = [name for name in PACKAGES if find_spec(name) is None]
    if missing:
        raise AnalysisError(
            f"report: not installed: {', '.join(missing)}; install with"
            f" `python -m pip install {' '.join(missing)}`"
        )
    from sautereau.analysis.report.build import build_report
    from sautereau.analysis.report.contents import gather
    from sautereau.entrance.session import recordings_in
    from sautereau.rig.disk import make_folder, write_durably
    from sautereau.robot.experiment.session_folder import read_manifest

    manifest = read_manifest(session)
    recordings, warnings = recordings_in(session)
    if not recordings:
        raise AnalysisError(
            f"report: {session} holds no recording of a press; give a folder written by"
            " `sautereau press --out`"
        )
    with common.bar(len(recordings)) as step:
        contents = gather(recordings, level, step)
    page = build_report(contents, _about(session, manifest, contents.presses, warnings))
    out = out or session / PAGE
    make_folder(out.parent)
    write_durably(out, page)
    simulated = any(record.press.simulated for record in contents.presses)
    lines = [f"report:     {out}"]
    if simulated:
        lines.insert(0, SOME_SIMULATED)
    lines += [f"omitted:    {path}: {why}" for path, why in contents.unread.items()]
    result = {
        "path": str(out),
        "presses": len(contents.presses),
        "simulated": simulated,
        "left_out": {str(path): why for path, why in contents.unread.items()},
    }
    return common.answer(json, result, lines)


def _about(
    session: Path,
    manifest: "Manifest | None",
    presses: "tuple[PressRecord, ...]",
    warnings: list[str],
) -> "About":
    """Return facts on the session from its manifest and from the command line."""
    from importlib.metadata import version

    from sautereau.analysis.errors import AnalysisError
    from sautereau.analysis.report.build import About
    from sautereau.analysis.report.fits import PATTERN, read_fit
    from sautereau.robot.experiment.session_folder import MANIFEST

    name = session.resolve().name
    fits = []
    for path in sorted(session.glob(PATTERN)):
        try:
            fits.append(read_fit(path))
        except AnalysisError as error:
            warnings.append(str(error))
    warnings += [f"{fit.name}: {warning}" for fit in fits for warning in fit.warnings]
    again = None
    if manifest is not None:
        try:
            left, again = _left(manifest, presses), _again(manifest, presses)
            warnings += left
        except (KeyError, TypeError, ValueError) as error:
            warnings.append(
                f"{MANIFEST}: its plan cannot be read ({type(error).__name__}: {error}); this page"
                " therefore does not show how to repeat the session"
            )
    return About(
        name=name,
        version=version("sautereau"),
        commands=(
            f"sautereau report {quote(name)}",
            f"sautereau phases {quote(name)}/*.mcap",
            f"sautereau compare {quote(name)}/*.mcap",
        ),
        warnings=tuple(warnings),
        again=again,
        scene=presses[0].session.scene,
        fits=tuple(fits),
    )


def _left(manifest: "Manifest", presses: "tuple[PressRecord, ...]") -> list[str]:
    """Return a warning if planned presses are missing."""
    planned = sum(int(row["repeats"]) for row in manifest.plan["presses"])
    counted = sum(not record.session.warm_up for record in presses)
    if counted >= planned:
        return []
    return [
        f"{counted} of {planned} planned presses are on this page; run the same"
        " `sautereau press` again to continue the session"
    ]


def _again(manifest: "Manifest", presses: "tuple[PressRecord, ...]") -> "Again":
    """Return the command that repeats the session, with the rig file of this page."""
    from sautereau.analysis.report.build import Again

    rows = manifest.plan["presses"]
    words = ["sautereau press rig.toml"]
    words.append(f"-n {rows[0]['repeats']}" if len(rows) == 1 else "--table table.csv")
    if manifest.plan["warm_up"]:
        words.append(f"--warm-up {manifest.plan['warm_up']}")
    if manifest.plan["rest"]:
        words.append(f"--rest '{manifest.plan['rest']} s'")
    needs = ["the rig below as rig.toml"]
    if len(rows) > 1:
        needs.append("the conditions above as table.csv")
    for kind, digest in manifest.plan.get("files", {}).items():
        needs.append(f"the file of {kind} with SHA-256 {digest}")
        words.append(f"--{kind.replace('_', '-')} FILE")
    scene = presses[0].session.scene
    if scene:
        name = _packaged(scene)
        words.append(f"--scene {name or 'scene.toml'} --seed {manifest.seed}")
        if not name:
            needs.append("the scene below as scene.toml, each number with its SI unit")
    return Again(
        f"To repeat this session, with {', '.join(needs)}:", " ".join([*words, "--out AGAIN"])
    )


def _packaged(scene: str) -> str:
    """Return the name of the packaged scene with this text; empty for none."""
    from pydantic_core import from_json

    from sautereau.sim_backend.scene import current_scene, load_scene, packaged_scenes

    document = current_scene(from_json(scene))
    dumped = {name: load_scene(name).model_dump(mode="json") for name in packaged_scenes()}
    return next((name for name, packaged in dumped.items() if packaged == document), "")

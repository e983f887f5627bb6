"""The front door: the command line, nothing else.

Rooms are imported inside the commands that need them, so that `sautereau --help` is quick.
"""

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

if TYPE_CHECKING:
    from analysis.phases import Phases
    from analysis.press import Press

app = App(
    name="sautereau",
    help="Press a harpsichord key with a robot finger, record it, compare it with a model.",
    result_action="return_value",
)

Flag = Parameter(negative=())
Json = Annotated[bool, Flag]
Count = Annotated[int, Parameter(name=["-n", "--number"])]


@Parameter(name="*")
@dataclass(frozen=True)
class Simulation:
    """The stand-in instead of the hardware."""

    sim: Annotated[bool, Flag] = False
    """Run on the stand-in instead of the hardware."""
    scene: str | None = None
    """Scene of the stand-in, by path or packaged name; implies --sim. Default: paper."""
    seed: int | None = None
    """Of every random number. Default: a fresh one, which is recorded."""


@app.command
def plan(rig: str = "paper", *, out: Path | None = None, json: Json = False) -> int:
    """Plan one press and check it.

    Parameters
    ----------
    rig
        Path of a rig file, or name of a packaged one.
    out
        File for the controller's segments, as JSON.
    json
        Print one JSON object and nothing else.
    """
    from trajectory.press import draft_press, segments_document

    bench = _rig(rig)
    draft = draft_press(bench)
    failed = [check for check in draft.checks if not check.holds]
    result = {
        "cruise_speed": draft.cruise_speed,
        "cruise_error_max": draft.cruise_error,
        "tilt_max": float(abs(draft.tilt).max()),
        "slide_max": float(abs(draft.slide).max()),
        "duration": float(draft.time[-1]),
        "segments": len(draft.segments),
        "feasible": not failed,
        "checks": [asdict(c) | {"margin": c.margin, "holds": c.holds} for c in draft.checks],
    }
    lines = [
        f"Press of rig {bench.name}: {draft.time[-1] * 1e3:.4g} ms in {len(draft.segments)} segments",
        f"jack's cruise: {draft.cruise_speed:.6g} m/s from {draft.cruise[0] * 1e3:.4g} to"
        f" {draft.cruise[1] * 1e3:.4g} ms, wrong by at most {draft.cruise_error:.2%}",
        f"finger: tilts by at most {math.degrees(result['tilt_max']):.3g} deg,"
        f" slides by at most {result['slide_max'] * 1e3:.3g} mm",
        *(f"  {check}" for check in draft.checks),
    ]
    if out and not failed:
        _write(out, json_text(segments_document(bench, draft)))
        lines.append(f"segments: {out}")
    _answer(json, result, lines)
    if failed:
        return _fail("the press cannot be made:", *(f"  {c}; {c.remedy}" for c in failed))
    return 0


@app.command
def press(
    rig: str = "paper",
    *,
    n: Count = 1,
    out: Path,
    notes: str = "",
    simulation: Simulation = Simulation(),
    json: Json = False,
) -> int:
    """Press the key n times, record each press, and compare them with the model.

    Parameters
    ----------
    rig
        Path of a rig file, or name of a packaged one.
    n
        Presses.
    out
        Folder for the recordings; nothing in it is overwritten.
    notes
        Operator's notes, kept in every recording.
    json
        Print one JSON object and nothing else.
    """
    from analysis.compare import compare as compare_presses
    from analysis.model.predict import predict as predict_press
    from analysis.phases import find_phases
    from analysis.press import load_press
    from robot.galil import GalilController
    from robot.session import run_session
    from trajectory.press import plan_press

    bench = _rig(rig)
    plan_press(bench)
    pressed: list[Press] = []
    found: list[Phases] = []
    with _stopping_on_signals(), _bench(bench, simulation) as (bench, scene, seed):

        def done(path: Path) -> None:
            pressed.append(load_press(path))
            found.append(find_phases(pressed[-1]))
            if not json:
                _say(*([_HEADER] if len(found) == 1 else []), _row(pressed[-1], found[-1]))
            bar.advance()

        if not json:
            _say(f"Rig {bench.name}: {n} press{'es' * (n != 1)}" + " on the stand-in" * bool(scene))
        with _progress("pressing", n) as bar:
            recordings = run_session(
                bench,
                plan_press(bench),
                GalilController(bench),
                out,
                n,
                scene=scene,
                seed=seed,
                notes=notes,
                on_press=done,
            )
    result: dict[str, Any] = {
        "recordings": [str(path) for path in recordings],
        "presses": [_press_result(p, f) for p, f in zip(pressed, found, strict=True)],
        "simulated": any(p.simulated for p in pressed),
        "seed": seed,
    }
    lines = []
    if any(f.plucks for f in found):
        prediction = predict_press(bench)
        comparison = compare_presses(found, prediction)
        picture = _picture(out / "comparison.png", pressed, found, prediction)
        result |= _comparison_result(comparison) | {"picture": str(picture)}
        lines = [*_comparison_lines(comparison, prediction.level), f"picture: {picture}"]
    else:
        lines = ["no pluck in any press: nothing to compare with the model"]
    _answer(json, result, [*lines, f"recordings: {recordings[0]} to {recordings[-1].name}"])
    return 0


@app.command
def phases(files: list[Path], *, json: Json = False) -> int:
    """Find when the string was met and let go in recorded presses.

    Parameters
    ----------
    files
        Recordings.
    json
        Print one JSON object and nothing else.
    """
    _, found = (pressed := _load(files)), [f for _, f in pressed]
    del found
    result = {"files": [_press_result(p, f) for p, f in pressed]}
    rows = [_HEADER, *(_row(p, f) for p, f in pressed)]
    warnings = [f"{p.path}: {w}" for p, f in pressed for w in f.warnings]
    _answer(json, result, [*rows, *warnings])
    return 0

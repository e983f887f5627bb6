"""The front door: the command line, nothing else.

Rooms are imported inside the commands that need them, so that `sautereau --help` is quick.
"""

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, CycloptsError, Parameter

if TYPE_CHECKING:
    from analysis.model.predict import Prediction
    from analysis.phases import Phases
    from analysis.press import Press
    from rig.schema import Rig
    from trajectory.expected import Expectation

app = App(
    name="sautereau",
    help="Press a harpsichord key with a robot finger, record it, compare it with a model.",
    result_action="return_value",
    suppress_keyboard_interrupt=False,
)

Flag = Parameter(negative=())
Json = Annotated[
    bool, Parameter(negative=(), help="Print one JSON object in SI units and nothing else.")
]
RigName = Annotated[str, Parameter(help="Path of a rig file, or name of a packaged one.")]
Level = Annotated[str, Parameter(help="Of the plectrum: rods, beam, two-beam, elastica or fe.")]
Picture = Annotated[Path | None, Parameter(help="File for a picture; its suffix tells how.")]
Seed = Annotated[int | None, Parameter(validator=lambda _, value: _seed_fits(value))]


@Parameter(name="*")
@dataclass(frozen=True)
class Simulation:
    """The stand-in instead of the hardware."""

    sim: Annotated[bool, Flag] = False
    """Run on the stand-in instead of the hardware."""
    scene: str | None = None
    """Scene of the stand-in, by path or packaged name; implies --sim. Default: paper."""
    seed: Seed = None
    """Of every random number. Default: a fresh one, which is recorded."""


@app.command
def plan(
    rig: RigName = "paper", *, out: Path | None = None, plot: Picture = None, json: Json = False
) -> int:
    """Plan one press and check it.

    Parameters
    ----------
    out
        File for the controller's segments, as JSON; written only if every check holds.
    """
    from analysis.summary.plan import plan_lines, plan_summary
    from trajectory.press import draft_press
    from trajectory.segments import segments_document

    bench = _load_rig(rig)
    expected, doubts = _expected(bench)
    draft = draft_press(bench, expected)
    failed = [check for check in draft.checks if not check.holds]
    warnings = [*doubts, *draft.warnings]
    result, lines = plan_summary(draft, warnings), plan_lines(bench, draft, warnings)
    if out and not failed:
        period = bench.controller.sample_period
        document = segments_document(draft.segments, period, draft.home, draft.hover)
        _write(out, _json(document))
        lines.append(f"segments: {out}")
    if plot:
        from analysis.figures.plan import plot_plan

        plot_plan(plot, bench, draft, expected)
        lines.append(f"picture: {plot}")
    _answer(json, result, lines)
    if failed:
        return _fail(
            "\n  ".join(["the press cannot be made:", *(f"{c}; {c.remedy}" for c in failed)])
        )
    return 0


@app.command
def mount(
    rig: RigName = "paper",
    *,
    plot: Picture = None,
    touches: Path | None = None,
    trust_homing: Annotated[bool, Flag] = False,
    json: Json = False,
) -> int:
    """Find where to clamp the robot, and from touches where it is clamped.

    Parameters
    ----------
    touches
        CSV file of points that the jogged fingertip touched on the key at rest, with the
        columns point [mm] (from the balance pin, negative in front), joint1 [counts] and
        joint2 [counts], or [deg].
    trust_homing
        Take the zeros of the joints as exact, and estimate the base alone.
    """
    import numpy as np

    from analysis.summary.mount import located_lines, located_summary, mount_lines, mount_summary
    from rig.touches import read_touches
    from trajectory.locate import locate_base
    from trajectory.mount import find_mount, mount_map

    bench = _load_rig(rig)
    result: dict[str, Any] = {}
    lines = []
    if touches:
        read = read_touches(touches, bench.arm)
        offsets = 0 if trust_homing else None
        located = locate_base(bench, np.array(read.joints), np.array(read.points), offsets=offsets)
        result["located"] = located_summary(located)
        lines += located_lines(located)
    found = find_mount(bench)
    result |= mount_summary(found)
    lines += mount_lines(bench, found)
    if plot:
        from analysis.figures.mount import plot_mount

        plot_mount(plot, bench, mount_map(bench), found)
        result["picture"] = str(plot)
        lines.append(f"picture: {plot}")
    _answer(json, result, lines)
    return 0


@app.command
def press(
    rig: RigName = "paper",
    *,
    n: Annotated[int, Parameter(name=["-n", "--number"])] = 1,
    out: Path,
    notes: str = "",
    simulation: Simulation = Simulation(),
    json: Json = False,
) -> int:
    """Press the key n times, record each press, and compare them with the model.

    Parameters
    ----------
    n
        Presses.
    out
        Folder for the recordings; nothing in it is overwritten.
    notes
        Operator's notes, kept in every recording.
    """
    from analysis.compare import compare as compare_presses
    from analysis.model.predict import predict as predict_press
    from analysis.phases import find_phases
    from analysis.press import load_press
    from analysis.summary.press import (
        HEADER,
        comparison_lines,
        comparison_summary,
        press_line,
        press_summary,
    )
    from robot.galil import GalilController
    from robot.session import run_session
    from trajectory.press import plan_press

    nominal = _load_rig(rig)
    expected, doubts = _expected(nominal)
    trajectory = plan_press(nominal, expected)
    for warning in (*doubts, *trajectory.warnings):
        sys.stderr.write(f"warning: {warning}\n")
    pressed: list[Press] = []
    found: list[Phases] = []
    with _signals_stop(), _hardware(nominal, simulation) as (bench, scene, seed), _bar(n) as step:

        def done(path: Path) -> None:
            if not found:
                where = "the stand-in: SIMULATED" if scene else "the hardware"
                _say(not json, f"rig {bench.name} on {where}\n{HEADER}")
            pressed.append(load_press(path))
            found.append(find_phases(pressed[-1]))
            _say(not json, press_line(pressed[-1], found[-1]))
            step()

        recordings = run_session(
            bench,
            trajectory,
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
        "presses": [press_summary(p, f) for p, f in zip(pressed, found, strict=True)],
        "simulated": any(p.simulated for p in pressed),
        "seed": seed,
    }
    lines = [warning for f in found for warning in f.warnings]
    if any(f.plucks for f in found):
        prediction = predict_press(bench)
        comparison = compare_presses(found, prediction)
        names = dict.fromkeys((recordings[0].stem, recordings[-1].stem))
        picture = out / f"{'-to-'.join(names)}.png"
        _draw(picture, pressed, found, prediction)
        result |= comparison_summary(comparison) | {"picture": str(picture)}
        lines += [*comparison_lines(comparison, prediction.level), f"picture:    {picture}"]
    else:
        lines.append("no press has a pluck: there is nothing to compare with the model")
    _answer(json, result, [*lines, *(f"recording:  {path}" for path in recordings)])
    return 0


@app.command
def phases(files: list[Path], /, *, json: Json = False) -> int:
    """Find when the string was met and let go in recorded presses.

    Parameters
    ----------
    files
        Recordings.
    """
    from analysis.summary.press import HEADER, press_line, press_summary

    both = _load(files)
    warnings = [f"{p.path}: {warning}" for p, f in both for warning in f.warnings]
    lines = [HEADER, *(press_line(p, f) for p, f in both), *warnings]
    _answer(json, {"files": [press_summary(p, f) for p, f in both]}, lines)
    return 0


@app.command
def predict(
    rig: RigName = "paper", *, level: Level = "elastica", plot: Picture = None, json: Json = False
) -> int:
    """Predict a press by the model alone; the picture shows all levels."""
    from analysis.model.predict import LEVELS
    from analysis.model.predict import predict as predict_press
    from analysis.summary.prediction import prediction_lines, prediction_summary

    bench = _load_rig(rig)
    found = predict_press(bench, level)
    result, lines = prediction_summary(bench, found), prediction_lines(bench, found)
    if plot:
        from analysis.figures.pluck import plot_pluck

        plot_pluck(plot, bench, list(LEVELS))
        result["picture"] = str(plot)
        lines.append(f"picture: {plot}")
    _answer(json, result, lines)
    return 0


@app.command
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

    both = _load(files)
    pressed, found = [p for p, _ in both], [f for _, f in both]
    prediction = predict_press(pressed[0].rig, level)
    comparison = compare_presses(found, prediction)
    simulated = any(p.simulated for p in pressed)
    lines = [*comparison_lines(comparison, level)]
    if simulated:
        lines.insert(0, "SIMULATED: at least one of these presses was made on the stand-in")
    result = comparison_summary(comparison) | {"simulated": simulated}
    if plot:
        _draw(plot, pressed, found, prediction)
        lines.append(f"picture: {plot}")
        result["picture"] = str(plot)
    _answer(json, result, lines)
    return 0


@app.command
def info(file: Path, /, *, json: Json = False) -> int:
    """Describe a recording.

    Parameters
    ----------
    file
        The recording.
    """
    from daq.reading import describe

    found = describe(file)
    lines = [f"{'SIMULATED' if found['simulated'] else 'measured'}: {file}"]
    for name, value in found.items():
        if isinstance(value, dict):
            lines += [f"{name}:", *(f"  {key}: {item}" for key, item in value.items())]
        else:
            lines.append(f"{name}: {value}")
    _answer(json, dict(found), lines)
    return 0


@app.command(name="stand-in")
def stand_in(
    scene: str = "paper",
    /,
    *,
    rig: RigName = "paper",
    seed: Seed = 0,
    fast: Annotated[bool, Flag] = False,
    json: Json = False,
) -> int:
    """Serve the simulated bench to any client until it is interrupted.

    Parameters
    ----------
    scene
        Path of a scene file, or name of a packaged one.
    seed
        Of every random number.
    fast
        Let simulated time go as fast as it can, and not with the clock on the wall.
    """
    from sim_backend.bench import StandIn
    from sim_backend.scene import load_scene

    bench = _load_rig(rig)
    with (
        _signals_stop(),
        StandIn(bench, load_scene(scene), seed or 0, paced=not fast) as served,
        suppress(KeyboardInterrupt),
    ):
        result = {"serial_port": served.serial_port, "daq_address": served.daq_address}
        lines = [
            f"scene {scene} of rig {bench.name}, SIMULATED; Ctrl-C ends it",
            f"serial port:  {served.serial_port}",
            f"DAQ address:  {served.daq_address}",
        ]
        _answer(json, result, lines)
        sys.stdout.flush()
        served.serve_forever()
    return 0


@app.command
def doctor(rig: RigName = "paper", *, json: Json = False) -> int:
    """Tell what is installed, connected and missing, with the remedy."""
    from robot.doctor import examine

    found = examine(_load_rig(rig), Path())
    lines = []
    for finding in found:
        lines.append(f"{'ok     ' if finding.ok else 'MISSING'} {finding.name}: {finding.detail}")
        if not finding.ok:
            lines.append(f"        remedy: {finding.remedy}")
    _answer(json, {"checks": [asdict(finding) for finding in found]}, lines)
    return 0


def main() -> None:
    """Run the command line and exit with its status."""
    try:
        status = app(print_error=False, exit_on_error=False)
    except CycloptsError as error:
        status = _fail(f"{error}\nsautereau --help tells the commands", status=2)
    except BrokenPipeError:
        sys.stderr.close()  # whoever read our output has gone, and with it any use of a message
        status = 1
    except KeyboardInterrupt as error:
        status = _fail("\n".join(["interrupted", *getattr(error, "__notes__", [])]))
    except Exception as error:
        from rig.errors import SautereauError

        if not isinstance(error, SautereauError | OSError):
            raise
        status = _fail("\n".join([str(error), *getattr(error, "__notes__", [])]))
    sys.exit(status)


def _load_rig(name: str) -> "Rig":
    from rig.load import load_rig

    return load_rig(name)


def _expected(rig: "Rig") -> "tuple[Expectation | None, list[str]]":
    """Return what the model expects a press to meet, or why it expects nothing."""
    from analysis.errors import ModelError
    from analysis.model.predict import expectation, predict

    try:
        return expectation(predict(rig)), []
    except ModelError as error:
        return None, [f"planned as if the key were empty, for the model says: {error}"]


def _load(files: list[Path]) -> "list[tuple[Press, Phases]]":
    from analysis.phases import find_phases
    from analysis.press import load_press

    both = []
    with _bar(len(files)) as step:
        for file in files:
            press = load_press(file)
            both.append((press, find_phases(press)))
            step()
    return both


@contextmanager
def _hardware(rig: "Rig", simulation: Simulation) -> "Iterator[tuple[Rig, str, int | None]]":
    """Yield the rig with the addresses to use, the scene's text and the seed."""
    if not simulation.sim and simulation.scene is None:
        yield rig, "", None
        return
    import secrets

    from sim_backend.bench import StandIn
    from sim_backend.scene import load_scene

    scene = load_scene(simulation.scene or "paper")
    seed = simulation.seed if simulation.seed is not None else secrets.randbits(32)
    with StandIn(rig, scene, seed) as served:
        yield served.rig, scene.model_dump_json(), seed


def _draw(path: Path, presses: Any, found: Any, prediction: "Prediction") -> None:
    from analysis.figures.comparison import plot_comparison

    plot_comparison(path, presses, found, prediction)


@contextmanager
def _signals_stop() -> Iterator[None]:
    """Let SIGTERM and a closed terminal end a command as Ctrl-C does: by an exception."""

    def interrupt(number: int, _frame: object) -> None:
        raise KeyboardInterrupt(signal.Signals(number).name)

    names = [name for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {name: signal.signal(getattr(signal, name), interrupt) for name in names}
    try:
        yield
    finally:
        for name, handler in before.items():
            signal.signal(getattr(signal, name), handler)


@contextmanager
def _bar(total: int) -> "Iterator[Any]":
    """Yield a function that advances a progress bar on a terminal, and does nothing else."""
    if total < 2 or not sys.stderr.isatty():
        yield lambda: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as progress:
        task = progress.add_task("", total=total)
        yield lambda: progress.advance(task)


def _seed_fits(value: int | None) -> None:
    if value is not None and not 0 <= value < 2**63:
        raise ValueError("a seed is a whole number from 0 to 2**63 - 1")


def _json(result: dict[str, Any]) -> str:
    import json

    return json.dumps(result, indent=2, default=str, allow_nan=False)


def _answer(as_json: bool, result: dict[str, Any], lines: list[str]) -> None:
    sys.stdout.write((_json(result) if as_json else "\n".join(lines)) + "\n")


def _say(wanted: bool, line: str) -> None:
    if wanted:
        sys.stdout.write(line + "\n")
        sys.stdout.flush()


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text + "\n", encoding="utf-8")


def _fail(message: str, status: int = 1) -> int:
    sys.stderr.write(f"sautereau: {message}\n")
    return status


if __name__ == "__main__":
    main()

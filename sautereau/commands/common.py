"""What the commands share: their parameters, the way they answer, the bench they get."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from sautereau.analysis.model.plectrum.levels import levels_help

if TYPE_CHECKING:
    from rich.progress import Progress

    from sautereau.analysis.model.predict import Prediction
    from sautereau.analysis.phases import Phases
    from sautereau.analysis.press.load import Press
    from sautereau.rig.schema import Rig
    from sautereau.sim_backend.scene import Scene
    from sautereau.trajectory.expected import Expectation

Flag = Parameter(negative=())
Json = Annotated[
    bool, Parameter(negative=(), help="Print one JSON object in SI units and nothing else.")
]
RigName = Annotated[str, Parameter(help="Path of a rig file, or name of a packaged one.")]
Level = Annotated[str, Parameter(help=levels_help())]
PICTURES = (".png", ".svg", ".pdf", ".jpg", ".webp", ".eps")
"""Suffixes of the pictures that are drawn."""


def _can_be_drawn(_: object, path: Path | None) -> None:
    """Refuse a picture that could not be written, before there is any work to lose."""
    if path is None:
        return
    faults = []
    if path.suffix.lower() not in PICTURES:
        faults.append(f"it ends in {path.suffix or 'nothing'}; end it in {', '.join(PICTURES)}")
    if not path.parent.is_dir():
        faults.append(f"there is no folder {path.parent}; make it first")
    if faults:
        raise ValueError(f"picture {path}: {'; '.join(faults)}")


Picture = Annotated[
    Path | None,
    Parameter(help="File for a picture; its suffix tells how.", validator=_can_be_drawn),
]
Seed = Annotated[int | None, Parameter(validator=lambda _, value: seed_fits(value))]


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

    @property
    def wanted(self) -> bool:
        """Whether there is to be a stand-in."""
        return self.sim or self.scene is not None

    def load(self) -> "Scene":
        """Return the stand-in's scene."""
        from sautereau.sim_backend.scene import load_scene

        return load_scene(self.scene or "paper")


def load_rig(name: str) -> "Rig":
    from sautereau.rig.load import load_rig

    return load_rig(name)


def expected_of(rig: "Rig") -> "tuple[Expectation | None, list[str]]":
    """Return what the model expects a press to meet, or why it expects nothing."""
    from sautereau.analysis.errors import ModelError
    from sautereau.analysis.model.predict import expectation, predict

    try:
        return expectation(predict(rig)), []
    except ModelError as error:
        return None, [f"planned as if the key were empty, for the model says: {error}"]


def load(files: list[Path]) -> "list[tuple[Press, Phases]]":
    from sautereau.analysis.phases import find_phases
    from sautereau.analysis.press.load import load_press

    both = []
    with bar(len(files)) as step:
        for file in files:
            press = load_press(file)
            both.append((press, find_phases(press)))
            step()
    return both


@dataclass(frozen=True)
class Bench:
    """The bench that a command presses on, real or simulated."""

    rig: "Rig"
    """With the addresses to use."""
    scene: str = ""
    """Of the stand-in, as text; empty on the hardware."""
    seed: int | None = None
    """Of the stand-in's random numbers."""
    reached: str = ""
    """What the stand-in settled on where its scene asks for an accuracy."""
    truth: Callable[[], Any] | None = None
    """What really happened in the last press, where the scene lets it be recorded."""

    @property
    def where(self) -> str:
        """On what the rig is, as it is said to people."""
        return "the stand-in: SIMULATED" if self.scene else "the hardware"

    def keep_truth(self, recording: Path) -> None:
        """Leave what really happened beside a recording, where the scene lets it."""
        if self.truth:
            write(recording.with_suffix(".truth.json"), json_text(asdict(self.truth())))


@contextmanager
def hardware(rig: "Rig", simulation: Simulation) -> Iterator[Bench]:
    """Yield the hardware of a rig, or the stand-in for it."""
    if not simulation.wanted:
        yield Bench(rig)
        return
    from sautereau.sim_backend.bench import StandIn

    scene = simulation.load()
    seed = simulation.seed if simulation.seed is not None else fresh_seed()
    with StandIn(rig, scene, seed) as served:

        def truth() -> Any:
            return served.truth()[-1]

        yield Bench(
            served.rig,
            scene.model_dump_json(),
            seed,
            str(served.bench.reached or ""),
            truth if scene.record_truth else None,
        )


def fresh_seed() -> int:
    """Return a seed that nobody has chosen."""
    import secrets

    return secrets.randbits(32)


def draw(path: Path, presses: Any, found: Any, prediction: "Prediction") -> None:
    from sautereau.analysis.figures.comparison import plot_comparison

    plot_comparison(path, presses, found, prediction)


@contextmanager
def signals_stop() -> Iterator[None]:
    """Let SIGTERM and a closed terminal end a command as Ctrl-C does: by an exception."""

    def interrupt(number: int, _frame: object) -> None:
        raise KeyboardInterrupt(signal.Signals(number).name)

    with on_signals(("SIGTERM", "SIGHUP"), interrupt):
        yield


@contextmanager
def on_signals(names: tuple[str, ...], handle: Callable[[int, Any], None]) -> Iterator[None]:
    """Let a function handle the signals of these names that the system has, for a while."""
    known = [name for name in names if hasattr(signal, name)]
    before = {name: signal.signal(getattr(signal, name), handle) for name in known}
    try:
        yield
    finally:
        for name, handler in before.items():
            signal.signal(getattr(signal, name), handler)


@contextmanager
def bar(total: int) -> "Iterator[Any]":
    """Yield a function that advances a progress bar on a terminal, and does nothing else."""
    with _progress() as progress:
        if progress is None or total < 2:
            yield lambda: None
            return
        task = progress.add_task("", total=total)
        yield lambda: progress.advance(task)


@contextmanager
def share_bar() -> "Iterator[Callable[[float], None]]":
    """Yield a function that takes the share that is done, from 0 to 1; as `bar`."""
    with _progress() as progress:
        if progress is None:
            yield lambda share: None
            return
        task = progress.add_task("", total=1.0)
        yield lambda share: progress.update(task, completed=share)


@contextmanager
def _progress() -> "Iterator[Progress | None]":
    """Yield a progress display on a terminal, else None."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as progress:
        yield progress


def seed_fits(value: int | None) -> None:
    if value is not None and not 0 <= value < 2**63:
        raise ValueError("a seed is a whole number from 0 to 2**63 - 1")


def json_text(result: dict[str, Any]) -> str:
    import json

    return json.dumps(result, indent=2, default=str, allow_nan=False)


def answer(as_json: bool, result: dict[str, Any], lines: list[str]) -> None:
    sys.stdout.write((json_text(result) if as_json else "\n".join(lines)) + "\n")


def say(wanted: bool, line: str) -> None:
    if wanted:
        sys.stdout.write(line + "\n")
        sys.stdout.flush()


def write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text + "\n", encoding="utf-8")


def fail(message: str, status: int = 1) -> int:
    sys.stderr.write(f"sautereau: {message}\n")
    return status

"""Record the sensors without the robot; serve the stand-in, and measure its speed and accuracy."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

from sautereau.commands import common
from sautereau.commands.output import FileOutput, Output
from sautereau.commands.running import on_signals

if TYPE_CHECKING:
    from sautereau.daq.source.source import InputSettings, SourceSettings


def acquire(
    rig: common.RigName = "paper",
    *,
    out: common.OutFile = common.Dated("acquire-DATE.mcap"),
    duration: Annotated[common.Time, common.ABOVE_0] | None = None,
    triggered: bool = False,
    dry_run: bool = False,
    notes: str = "",
    simulation: common.Simulation = common.Simulation(),
    output: FileOutput = FileOutput(),
) -> int:
    """Record all channels without the robot, until a given time or Ctrl-C.

    Parameters
    ----------
    rig
        Path of a rig file, which may have [daq] alone, or name of a packaged rig.
    out
        File of the recording.
    duration
        Duration of the recording, such as "60 s". Default: until Ctrl-C.
    triggered
        Start at the trigger's edge instead of immediately.
    dry_run
        Print the settings that the device would use, and start nothing.
    notes
        Operator's notes, saved in the recording.
    """
    from sautereau.daq.file.reading import read_session
    from sautereau.daq.source.continuous import record
    from sautereau.daq.source.source import open_source
    from sautereau.rig.load import load_rig_to_acquire

    if triggered and simulation.requested and not dry_run:
        return output.fail(
            "--triggered: nothing presses the key of the stand-in, so that its trigger has no edge;"
            " record without --triggered, or make a press with `sautereau press --sim`",
            2,
        )
    served = common.bench(load_rig_to_acquire(rig), simulation, moves=False)
    with _asked_to_stop() as asked, served.connected() as bench:
        if dry_run:
            with open_source(bench.rig.daq, None, triggered=triggered) as acquisition:
                settings = acquisition.settings()
            return output.answer(asdict(settings), _lines(settings))
        output.say(f"rig {bench.rig.name} on {bench.where}; Ctrl-C ends the recording")
        with output.progress("recording", shown=duration is not None) as show:
            rate = bench.rig.daq.sample_rate
            n = record(
                bench.rig,
                out,
                duration,
                triggered=triggered,
                scene=bench.scene,
                seed=bench.seed,
                notes=notes,
                keep_going=lambda: not asked(),
                on_block=lambda n_read: show(n_read / rate / duration) if duration else None,
            )
    result: dict[str, Any] = {
        "recording": str(out),
        "n_samples": n,
        "channels": [channel.name for channel in bench.rig.daq.channels],
        "stopped": asked(),
        "simulated": read_session(out).simulated,
        "seed": bench.seed,
    }
    count = len(bench.rig.daq.channels)
    return output.answer(result, [f"recording:  {out}, {n} samples of each of {count} channels"])


def _lines(settings: "SourceSettings") -> list[str]:
    simulated = ", SIMULATED" if settings.simulated else ""
    return [
        f"device:     {settings.device}{simulated}",
        *(
            f"channel:    {c.name} on {c.terminal}, +-{c.range:g} V within the device's"
            f" {c.device_low:g} to {c.device_high:g} V, {_input(c)}, {c.sensor}"
            for c in settings.channels
        ),
        f"rate:       {settings.rate:.9g} Hz, of every channel;"
        f" requested: {settings.requested_rate:.9g} Hz",
        f"buffer:     {settings.buffer} samples of each channel,"
        f" {settings.buffer / settings.rate:.3g} s",
        f"reads:      {settings.block} samples, {settings.rate / settings.block:.3g} per second",
        f"trigger:    {settings.trigger or 'none: starts immediately'}",
        "nothing was started",
    ]


def _input(settings: "InputSettings") -> str:
    """Return how an input is set, and how far its samples are from the time of their row."""
    found = [settings.terminal_configuration or "unknown terminal configuration"]
    if settings.coupling:
        found.append(f"{settings.coupling.upper()} coupling")
    if settings.excitation:
        found.append(f"{settings.excitation * 1e3:g} mA excitation")
    if settings.delay:
        found.append(f"delay {settings.delay * 1e6:.4g} us")
    return ", ".join(found)


@contextmanager
def _asked_to_stop() -> Iterator[Callable[[], bool]]:
    """Yield a function that returns whether Ctrl-C, SIGTERM or a closed terminal requested a stop.

    The first request lets the current block finish; a second one interrupts immediately.
    """
    asked: list[int] = []

    def ask(number: int, _frame: object) -> None:
        asked.append(number)
        if len(asked) > 1:
            raise KeyboardInterrupt(signal.Signals(number).name)

    with on_signals(("SIGINT", "SIGTERM", "SIGHUP"), ask):
        yield lambda: bool(asked)


def stand_in(
    scene: str = "paper",
    /,
    *,
    rig: common.RigName = "paper",
    seed: common.Seed = 0,
    fast: bool = False,
    output: Output = Output(),
) -> int:
    """Serve the simulated bench to any client until it is interrupted.

    Parameters
    ----------
    scene
        Path of a scene file, or name of a packaged one.
    seed
        Seed of every random number.
    fast
        Run as fast as possible instead of in real time.
    """
    from sautereau.entrance.bench import rig_and_scene
    from sautereau.sim_backend.bench import StandIn

    bench, simulated = rig_and_scene(rig, scene)
    with (
        StandIn(bench.values, simulated, seed or 0, paced=not fast) as served,
        suppress(KeyboardInterrupt),
    ):
        result = {"serial_port": served.serial_port, "daq_address": served.daq_address}
        lines = [
            f"scene {scene} of rig {bench.name}, SIMULATED; stop with Ctrl-C",
            served.bench.reached,
            f"serial port:  {served.serial_port}",
            f"DAQ address:  {served.daq_address}",
        ]
        output.answer(result, lines)
        sys.stdout.flush()
        served.serve_forever()
    return 0


def trade(
    rig: common.RigName = "paper",
    *,
    scene: str = "pluck",
    fresh: Annotated[bool, common.RARE] = False,
    plot: common.Picture = None,
    output: FileOutput = FileOutput(),
) -> int:
    """Measure speed and accuracy of the stand-in's solvers on this machine.

    Parameters
    ----------
    scene
        Path of a scene file, or name of a packaged one.
    fresh
        Measure again instead of reusing an earlier measurement on this machine.
    """
    from sautereau.entrance.bench import rig_and_scene
    from sautereau.sim_backend.trade import results
    from sautereau.sim_backend.trade.study import run_trade

    bench, simulated = rig_and_scene(rig, scene)
    with output.progress("measuring speed and accuracy"):
        measured = run_trade(bench.values, simulated, fresh=fresh)
    document, lines = results.trade_document(measured), results.trade_text(measured)
    return output.answer(document, lines, plot, draw=lambda: results.trade_figure(measured))

"""Serve the stand-in, and measure its speed and accuracy."""

import sys
from contextlib import suppress
from typing import Annotated

from sautereau.commands import common
from sautereau.commands.output import FileOutput, Output, save_plot


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
    if plot:
        save_plot(plot, results.trade_figure(measured))
    return output.answer(results.trade_document(measured), results.trade_text(measured), plot)

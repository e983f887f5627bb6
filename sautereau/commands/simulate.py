"""Serve the stand-in, and measure its speed and accuracy."""

import sys
from contextlib import suppress
from typing import Annotated

from sautereau.commands.common import (
    Flag,
    Json,
    Picture,
    RigName,
    Seed,
    answer,
    fail,
    fraction_bar,
    load_rig,
    signals_stop,
)


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
        Seed of every random number.
    fast
        Run as fast as possible instead of in real time.
    """
    from sautereau.sim_backend.bench import StandIn
    from sautereau.sim_backend.scene import load_scene

    bench = load_rig(rig)
    with (
        signals_stop(),
        StandIn(bench, load_scene(scene), seed or 0, paced=not fast) as served,
        suppress(KeyboardInterrupt),
    ):
        result = {"serial_port": served.serial_port, "daq_address": served.daq_address}
        lines = [
            f"scene {scene} of rig {bench.name}, SIMULATED; stop with Ctrl-C",
            *([str(served.bench.reached)] if served.bench.reached else []),
            f"serial port:  {served.serial_port}",
            f"DAQ address:  {served.daq_address}",
        ]
        answer(json, result, lines)
        sys.stdout.flush()
        served.serve_forever()
    return 0


def trade(
    rig: RigName = "paper",
    *,
    scene: str = "pluck",
    fresh: Annotated[bool, Flag] = False,
    stability: Annotated[bool, Flag] = False,
    plot: Picture = None,
    json: Json = False,
) -> int:
    """Measure speed and accuracy of the stand-in's solvers on this machine.

    Parameters
    ----------
    scene
        Path of a scene file, or name of a packaged one.
    fresh
        Measure again instead of reusing an earlier measurement on this machine.
    stability
        Map at which steps the engines are stable, and at which they refuse to run.
    """
    from sautereau.sim_backend.scene import load_scene
    from sautereau.sim_backend.trade.results import plot_trade, trade_document, trade_text
    from sautereau.sim_backend.trade.stability import (
        run_stability,
        stability_document,
        stability_text,
    )
    from sautereau.sim_backend.trade.study import run_trade

    bench = load_rig(rig)
    if stability:
        with signals_stop(), fraction_bar() as progress:
            found = run_stability(bench, progress=progress)
        answer(json, stability_document(found), stability_text(found))
        if found.silent_failures:
            return fail(json, "an engine diverged without an error; see the table")
        return 0
    with signals_stop(), fraction_bar() as progress:
        measured = run_trade(bench, load_scene(scene), fresh=fresh, progress=progress)
    result, lines = trade_document(measured), trade_text(measured)
    if plot:
        plot_trade(measured, plot)
        result["picture"] = str(plot)
        lines.append(f"picture: {plot}")
    answer(json, result, lines)
    return 0

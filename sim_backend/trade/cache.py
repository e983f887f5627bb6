"""Trades kept in the user's cache, each under its bench, scene, machine and version."""

import contextlib
import hashlib
import json
import os
import platform
import tempfile
from dataclasses import asdict, replace
from importlib.metadata import version
from pathlib import Path

from sautereau.rig.load import rig_json
from sautereau.rig.schema import Rig
from sautereau.sim_backend.scene import Scene
from sautereau.sim_backend.trade.points import Point, Trade


def machine() -> str:
    """Return what this machine is, without its name."""
    system = f"{platform.system()}, Python {platform.python_version()}"
    return f"{platform.machine()}, {os.cpu_count()} cores, {system}"


def stored_trade(rig: Rig, scene: Scene) -> Trade | None:
    """Return what was measured before, or None where there is none that is whole."""
    try:
        document = json.loads(_path(rig, scene).read_text(encoding="utf-8"))
        points = tuple(Point(**point) for point in document.pop("points"))
        pareto = tuple(document.pop("pareto"))
        return replace(Trade(points=points, pareto=pareto, **document), cached=True)
    except (OSError, ValueError, TypeError, KeyError):
        return None


def store_trade(rig: Rig, scene: Scene, trade: Trade) -> None:
    """Keep a trade, so that no other process ever sees half of it."""
    path = _path(rig, scene)
    with contextlib.suppress(OSError):  # without a cache it is only slower
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, suffix=".part")
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            json.dump(asdict(trade), file)
        Path(name).replace(path)


def _path(rig: Rig, scene: Scene) -> Path:
    import platformdirs

    parts = [version("sautereau"), platform.node(), machine(), rig_json(rig), repr(scene)]
    name = hashlib.sha256("\n".join(parts).encode()).hexdigest()
    return platformdirs.user_cache_path("sautereau", appauthor=False) / "trade" / f"{name}.json"

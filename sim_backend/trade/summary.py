"""A trade as JSON, and as text."""

from dataclasses import asdict
from typing import Any

from sautereau.sim_backend.trade.points import Point, Trade

HEADER = "  engine   plectrum  string  iterations        step       error  force error  x real time"


def trade_document(trade: Trade) -> dict[str, Any]:
    """Return the JSON object of a trade; errors in s and 1, null where a point failed."""
    points = [_document(point) for point in trade.points]
    return {
        "scene": trade.scene,
        "machine": trade.machine,
        "wanted_error": trade.wanted,
        "points": points,
        "pareto": [points[i] for i in trade.pareto],
        "recommended": None if trade.recommended is None else points[trade.recommended],
    }


def trade_text(trade: Trade) -> list[str]:
    """Return the lines of a trade: its points, those not beaten marked, and what to take."""
    lines = [f"{trade.scene or 'scene'}: error against the reference, and speed", HEADER]
    order = sorted(range(len(trade.points)), key=lambda i: _order(trade.points[i]))
    for i in order:
        mark = ">" if i == trade.recommended else "*" if i in trade.pareto else " "
        lines.append(f"{mark} {_row(trade.points[i])}")
    lines.append("* no other is both faster and more accurate")
    wanted = f"{trade.wanted * 1e6:.3g} us"
    if trade.recommended is None:
        lines.append(f"none is as accurate as {wanted}: take the first of the table")
    else:
        lines.append(f"> recommended: the fastest within {wanted}")
    again = "; measured before, --fresh measures again" if trade.cached else ""
    lines.append(f"on {trade.machine}{again}")
    return lines


def _document(point: Point) -> dict[str, Any]:
    return asdict(point) | {"failed": bool(point.failed), "reason": point.failed or None}


def _order(point: Point) -> tuple[bool, float, float]:
    failed = point.error is None
    return failed, point.error or 0.0, -(point.real_time_factor or 0.0)


def _row(point: Point) -> str:
    what = (
        f"{point.engine:8} {point.level:9} {point.string:7} {point.iterations:10d}"
        f" {point.dt * 1e6:8.4g} us"
    )
    if point.error is None or point.force_error is None or point.real_time_factor is None:
        return f"{what}  failed: {point.failed}"
    return (
        f"{what} {point.error * 1e6:8.3g} us {100 * point.force_error:10.2g} %"
        f" {point.real_time_factor:12.3g}"
    )

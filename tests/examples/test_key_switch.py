"""Force curves in the formats of public collections are imported and replayed as presses."""

import numpy as np
import pytest

from examples.key_switch import GRAM_FORCE, lines, study

TRAVEL = np.arange(0, 3.3, 0.005)  # mm
FORCE = np.interp(TRAVEL, [0, 1.5, 1.502, 3, 3.2, 3.3], [0, 75, 35, 45, 200, 320])
"""gf, a switch that snaps."""
PREAMBLE = "MAX FORCE = 320.0,3.3\nUNIT = gf,mm\nDATA COUNT = {n},\nRECORDING RATE = 0.0005,\n"
GAUGE = "Maximum,320.0,@,No.9\nData Quantity,{n},,\nNo.,Force,Unit,Displacement,Unit,Judge,Time\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("head", "row", "columns"),
    [
        ("Millis,Steps,Travel (mm),Scale raw,Scale (grams)\n", "{k},8,{x:.4f},1.00,{f:.4f}",
         ("Travel (mm)", "Scale (grams)")),
        (PREAMBLE, "{f:.1f},{x:.3f}", ("2", "1")),
        (GAUGE, "{k},{f:.1f},gf,{x:.3f},mm,OK,9:30:57 AM", ("Displacement", "Force")),
    ],
)  # fmt: skip
def test_a_force_curve_becomes_a_press(tmp_path, head, row, columns):
    rows = [row.format(k=k, x=x, f=f) for k, (x, f) in enumerate(zip(TRAVEL, FORCE, strict=True))]
    path = tmp_path / "switch.csv"
    path.write_text(head.format(n=len(rows)) + "\n".join(rows) + "\n")
    found = study(path, *columns, tmp_path)
    assert found.peak == pytest.approx(75 * GRAM_FORCE, rel=0.01)
    assert found.fall == pytest.approx(40 * GRAM_FORCE, rel=0.02)
    assert found.imported.rate == 20_000.0
    assert "derivative of the displacement" in "\n".join(lines(found))
    snap = 0.2 + 0.0025 + 1.5e-3 / 0.05
    assert min(abs(pluck.release - snap) for pluck in found.phases.plucks) < 1e-3

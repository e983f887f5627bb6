"""Reading the paper's Table 1: what its numbers give, and which of them contradict each other.

python -m examples.table_1

rewrites docs/table-1.md; every figure on that page comes from here, its text from
table_1.md.in.
"""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from examples import release_fit
from sautereau.analysis.model.string.string import first_mode_release_speed
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig

PAGE = Path(__file__).parents[1] / "docs" / "table-1.md"
DURATION, V_OSC = 20e-3, 0.46
"""s and m/s, the paper's time from contact to release and its speed of the released string."""

TEXT = Path(__file__).with_suffix(".md.in").read_text(encoding="utf-8")


def releases(rig: Rig) -> dict[str, release_fit.Release]:
    """Return the releases of the page's table by what was asked for."""
    return {
        f"pluck duration {DURATION * 1e3:.3g} ms": release_fit.fit_release(rig, DURATION),
        f"Vosc = {V_OSC:.2g} m/s": release_fit.fit_release(rig, v_osc=V_OSC),
        "both": release_fit.fit_release(rig, DURATION, V_OSC),
    }


def page(rig: Rig, stamp: str) -> str:
    """Return the page, with a stamp that says when it was written."""
    plectrum, string = rig.plectrum, rig.string
    found = releases(rig)
    _, fast, both = found.values()
    first_share = first_mode_release_speed(string, fast.lift) / fast.v_osc
    first = release_fit.fit_release(rig, DURATION, V_OSC / first_share)
    ei = plectrum.bending_stiffness
    return TEXT.format(
        stamp=stamp,
        modulus=plectrum.youngs_modulus / 1e9,
        width=plectrum.width * 1e3,
        thickness=plectrum.thickness * 1e3,
        ei=ei,
        tip_stiffness=3 * ei / plectrum.length**3,
        string=string,
        length=string.length * 1e3,
        density=string.linear_density * 1e3,
        wire=string.diameter * 1e3,
        element=string.linear_density * plectrum.width * 1e3,
        b=string.plucking_point / string.length,
        overlap=plectrum.overlap * 1e3,
        first_share=first_share,
        duration=DURATION * 1e3,
        press=rig.press,
        v_osc=V_OSC,
        table="\n".join(_row(what, release, ei) for what, release in found.items()),
        lift=fast.lift * 1e3,
        short=fast.duration * 1e3,
        scale=both.bending_stiffness / ei,
        both_overlap=both.overlap * 1e3,
        first_lift=V_OSC / first_mode_release_speed(string, 1.0) * 1e3,
        first_scale=first.bending_stiffness / ei,
        first_overlap=first.overlap * 1e3,
    )


def _row(what: str, release: release_fit.Release, ei: float) -> str:
    pluck = release.pluck
    cells = (
        release.bending_stiffness / ei,
        release.overlap * 1e3,
        release.duration * 1e3,
        release.lift * 1e3,
        pluck.force[-1],
        np.degrees(pluck.angle[-1]),
        release.v_osc,
        first_mode_release_speed(release.rig.string, release.lift),
    )
    return " | ".join([f"| {what}", *(f"{cell:.3g}" for cell in cells)]) + " |"


def main() -> None:
    day = datetime.now(UTC).date().isoformat()
    stamp = f"Written by `python -m examples.table_1` on {day}."
    PAGE.write_text(page(load_rig(), stamp), encoding="utf-8")


if __name__ == "__main__":
    main()

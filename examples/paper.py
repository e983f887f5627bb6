"""The paper's figures by this software, and its printed numbers beside the results.

python -m examples.paper FOLDER

writes the figures into a folder and rewrites docs/paper.md and docs/table-1.md, whose texts are in
paper.md.in and table_1.md.in.
"""

import sys
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

import sautereau as st
from examples import table_1
from examples.paper_figures import figures
from examples.paper_numbers import (
    CONTACT,
    DRAWS,
    FRICTION_MAX,
    MEANT,
    RELEASE,
    SPREAD,
    Errors,
    candidates,
    draw_errors,
    explain,
    first_mode,
    model_errors,
    overlap_at,
    string_speed,
)
from examples.release_fit import Release, release_as_is
from examples.session import study as session
from sautereau.analysis.model.predict import predict
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig
from sautereau.trajectory.press import plan_press

DOCS = Path(__file__).parents[1] / "docs"
TEXT = Path(__file__).with_suffix(".md.in").read_text(encoding="utf-8")
INSTRUMENTS = 2000  # Drawn for the error of the slope


def page(rig: Rig, pressed: st.Session, day: str, draws: int = INSTRUMENTS) -> str:
    """Return the page about the printed numbers, with the day on which it was written."""
    trajectory, model = plan_press(rig), predict(rig)
    phases = pressed[0].phases
    (held,) = phases.plucks
    speed = pressed[0].data["jack_speed"]
    cruise = speed[phases.start + 10e-3 : held.release + 50e-3]
    share = first_mode(rig)
    meant = candidates(rig)
    _, soft, _, turned = meant.values()
    shares = (0.25, 1.0, 4.0)
    return TEXT.format(
        day=day,
        presses=len(pressed),
        planned_speed=float(np.max(trajectory.rise.velocity)),
        speed=float(cruise.mean()),
        held_speed=float(speed[held.contact : held.release].mean()),
        rise=trajectory.rise.position.max() * 1e3,
        measured_rise=pressed[0].data["jack_rise"].max() * 1e3,
        contact=model.contact * 1e3,
        release=model.release * 1e3,
        measured_contact=(held.contact - phases.start) * 1e3,
        measured_release=(held.release - phases.start) * 1e3,
        v_osc=model.v_osc,
        first_v_osc=model.v_osc * share,
        v_s=string_speed(release_as_is(rig)),
        slope_error=100 * pressed.compare().document["slope_error"]["value"],
        ratio=1 / share,
        duration=(RELEASE - CONTACT) * 1e3,
        candidates="\n".join(_candidate(rig, *each) for each in meant.items()),
        soft=soft.bending_stiffness / rig.plectrum.bending_stiffness,
        soft_v_s=string_speed(soft),
        inverse=100 * MEANT[1],
        draws=draws,
        friction_max=FRICTION_MAX,
        chances="\n".join(
            _chances(name, draw_errors(rig, levers=levers, surface=surface, draws=draws))
            for name, levers, surface in (
                ("levers known", False, False),
                ("levers known, string on the surface", False, True),
                ("levers drawn", True, False),
                ("levers drawn, string on the surface", True, True),
            )
        ),
        turned_slope=100 * model_errors(rig, turned.rig)[0],
        spread=100 * SPREAD,
        scalar_draws=DRAWS,
        scalars="\n".join(_scalars(rig, all_modes) for all_modes in (False, True)),
        overlaps=", ".join(f"{overlap_at(rig, each) * 1e3:.2f} mm" for each in shares)
        + " belong to "
        + " and ".join(f"{each:g}" for each in shares)
        + " times Table 1's",
    )


def _candidate(rig: Rig, name: str, release: Release) -> str:
    cells = (
        release.bending_stiffness / rig.plectrum.bending_stiffness,
        release.overlap * 1e3,
        release.lift * 1e3,
        release.pluck.string_force[-1],
        release.v_osc * first_mode(rig),
        release.v_osc,
        string_speed(release),
    )
    slope = model_errors(rig, release.rig)[0]
    return " | ".join([f"| {name}", *(f"{cell:.3g}" for cell in cells), f"{100 * slope:+.0f} % |"])


def _chances(name: str, errors: Errors) -> str:
    low, high = np.quantile(errors.slope, (0.025, 0.975))
    told = errors.slope[errors.as_said]
    least = f", down to {told.min():+.0%}" if len(told) else ""
    steep, flat, flatter = MEANT
    true = errors.slope <= flatter, errors.slope <= flat, errors.slope >= steep, errors.as_said
    return (
        f"| {name} | {low:+.0%} to {high:+.0%} | {' | '.join(map(_fraction, true))}{least} |"
    ).replace("%", " %")


def _fraction(true: np.ndarray) -> str:
    """Return a fraction, or the 95 % bound of one that was not seen: 3 of all draws."""
    return f"{true.mean():.2g}" if true.any() else f"under {3 / len(true):.2g}"


def _scalars(rig: Rig, all_modes: bool) -> str:
    found = explain(rig, all_modes=all_modes)
    cells = [
        "{1:.2f}, {0:.2f} to {2:.2f}".format(*np.percentile(values, (2.5, 50, 97.5)))
        for values in (
            found.stiffness / rig.plectrum.bending_stiffness,
            found.overlap * 1e3,
            found.clearance * 1e3,
        )
    ] + [
        f"{np.corrcoef(values, found.friction)[0, 1]:+.2f}"
        for values in (found.stiffness, found.overlap)
    ]
    return " | ".join(["| " + ("of all modes" if all_modes else "as printed"), *cells]) + " |"


def main() -> None:
    rig, pressed, folder = load_rig(), session(), Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, figure in figures(rig, pressed).items():
        figure.savefig(folder / name, dpi=120)
        print(folder / name)
    day = datetime.now(UTC).date().isoformat()
    for name, text in (
        ("paper.md", page(rig, pressed, day)), ("table-1.md", table_1.page(rig, day))
    ):  # fmt: skip
        (DOCS / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()

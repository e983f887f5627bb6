"""Reading the paper's Table 1: what its numbers give, and which of them contradict each other.

python -m examples.table_1

rewrites docs/table-1.md; every figure on that page comes from here.
"""
# ruff: noqa: E501 (a row of a Markdown table is one line)

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

TEXT = """\
# Reading Table 1

{stamp}

*The paper* is the article on a robot that presses a harpsichord key at a constant jack speed. This page
shows how sautereau uses its Table 1. `rig/paper.toml` contains the same values.

## Printed and used values

| quantity | printed | used | why |
|---|---|---|---|
| plectrum's Young's modulus | 2.9e9 MPa | {modulus:.3g}e9 Pa | acetal has 2 to 3 GPa |
| plectrum's W and h | 0.75 and 0.48 mm | {width:.3g} mm wide, {thickness:.3g} mm thick in the bending plane | EI = E W h^3 / 12 = {ei:.5g} N m^2; the stiffness against a tip load is 3 EI / length^3 = {tip_stiffness:.4g} N/m |
| string's tension | 66.95 N.m-2 | {tension:.4g} N | with {frequency:.4g} Hz and {length:.4g} mm the string has {density:.4g} g/m: steel of {wire:.2g} mm |
| string's element of mass | 4.45e-4 mg | {element:.3g} g | linear density times the plectrum's width |
| string's stiffness, equation 2 | T L / b(1-b) | T / (L b (1-b)) = {stiffness:.4g} N/m with b = {b:.4g} | dimensions |
| string above the plectrum's tip | (Ls, 150) mm, that is no overlap | an overlap, {overlap:.3g} mm in the rig | without overlap the string slips off at once |
| Vosc | formula of the first mode | c h / (2 L b (1-b)) with c = 2 L f, all modes | the first mode alone gives {first_share:.3g} of it |

## Contradicting values

In the paper the string is held for {duration:.3g} ms (contact at 27 ms, release at 47 ms) at a jack speed
of {speed:.3g} m/s, and Vosc is {v_osc:.2g} m/s. With Table 1's bending stiffness only the overlap can be
chosen, and no overlap gives both values. The following results are for the elastica as plectrum and a
spring as string, on the plectrum's mid-line as in the paper's equations:

{table}

For {v_osc:.2g} m/s the string must be released at a lift of {lift:.3g} mm. Table 1's plectrum reaches this
lift after {short:.2g} ms. Both values are correct if the bending stiffness is {scale:.2g} times that of
Table 1 and the overlap is {both_overlap:.2f} mm. If Vosc is the speed of the first mode alone,
{v_osc:.2g} m/s needs a lift of {first_lift:.3g} mm, a factor of {first_scale:.2g} and an overlap of
{first_overlap:.2f} mm. In both cases the plectrum is not that of Table 1.

To compute another pair:

```python
from examples.release_fit import fit_release
from sautereau.rig.load import load_rig

found = fit_release(load_rig(), duration=20e-3, v_osc=0.46)
print(found.bending_stiffness, found.overlap)
```
"""
HEAD = (
    "| requested | EI over Table 1's | overlap (mm) | pluck duration (ms) | lift (mm) | force (N)"
    " | angle (deg) | Vosc, all modes (m/s) | Vosc, first mode (m/s) |\n" + "|---" * 9 + "|"
)


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
        tension=string.tension,
        frequency=string.frequency,
        length=string.length * 1e3,
        density=string.linear_density * 1e3,
        wire=string.diameter * 1e3,
        element=string.linear_density * plectrum.width * 1e3,
        stiffness=string.static_stiffness,
        b=string.plucking_point / string.length,
        overlap=plectrum.overlap * 1e3,
        first_share=first_share,
        duration=DURATION * 1e3,
        speed=rig.press.jack_speed,
        v_osc=V_OSC,
        table="\n".join([HEAD, *(_row(what, r, ei) for what, r in found.items())]),
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

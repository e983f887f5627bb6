"""Exponents of touch by the plectrum's thickness, in presses of the independent simulator.

Plectra of several thicknesses and overlaps pluck the same string, on a stiff key and on one that
bends. The exponents that the analysis finds are compared with those of the true load, by the same
regression.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.figures import Figure
from benchmarks.independent import ONE_FACTOR, Conditions, Pressed, press
from benchmarks.simulated import judged_recording
from sautereau.analysis.campaign.row import row_of
from sautereau.analysis.campaign.table import empty_campaign
from sautereau.analysis.campaign.touch import FELT, find_touch
from sautereau.analysis.press.features import Row
from sautereau.analysis.session.analysed import analyse_recording

CONDITIONS = ("all stiff", "key bends at 350 Hz")
PLECTRA, PRESSES = 8, 2
CUTS = (0.38e-3, 0.55e-3), (0.2e-3, 0.32e-3)  # m, ranges of thickness and overlap
LIMIT = 0.1  # Dimensionless, largest error of an exponent
THICKNESS = "plectrum_thickness"


def run() -> list[Figure]:
    """Return the errors of the exponents of thickness."""
    figures = []
    for name in CONDITIONS:
        for felt, error in exponent_errors(ONE_FACTOR[name]).items():
            what = f"{name}: exponent of {felt}, relative error"
            figures.append(Figure(what, error, "1", "limit", LIMIT))
    return figures


def exponent_errors(conditions: Conditions) -> dict[str, float]:
    """Return the relative errors of the exponents of thickness, by quantity."""
    found: list[Row] = []
    true: list[Row] = []
    random = np.random.default_rng(15)
    for plectrum in range(PLECTRA):
        thickness = CUTS[0][0] * (CUTS[0][1] / CUTS[0][0]) ** (plectrum / (PLECTRA - 1))
        overlap = random.uniform(*CUTS[1])
        choir = replace(conditions.choirs[0], thickness=thickness, overlap=overlap)
        for seed in range(PRESSES):
            made = press(replace(conditions, choirs=(choir,)), 100 * plectrum + seed)
            recorded = judged_recording(made, {"plectrum.contact": "surface"})
            row = row_of(analyse_recording(recorded), Path(f"{plectrum}/{seed}.mcap"))
            found.append(row | {"plectrum": str(plectrum), "size": 1, "mtime": 1})
            true.append(found[-1] | {"plucks": 1} | _true(made))
    exponents = [
        {name: felt.exponents[THICKNESS].value for name, felt in _touch(rows).felt.items()}
        for rows in (found, true)
    ]
    return {name: value / exponents[1][name] - 1 for name, value in exponents[0].items()}


def _touch(rows: list[Row]):
    return find_touch(empty_campaign(Path("touch.parquet"), "benchmark").grown(rows, ()))


def _true(made: Pressed) -> dict[str, float]:
    """Return what is felt of the true load, referred to the finger."""
    pluck, c = made.truth.plucks[0], made.conditions
    lever = c.choirs[0].arm / c.press_arm
    held = (made.times > pluck.last_contact) & (made.times < pluck.release - 1e-4)
    load, rise = made.truth.load[0][held], made.truth.rise[0][held]
    force = float(np.interp(pluck.release - 1e-4, made.times, made.truth.force))
    slope = float(np.polyfit(rise, load, 1)[0])
    values = (force, slope * lever**2, pluck.release_force * lever)
    return dict(zip(FELT, values, strict=True))

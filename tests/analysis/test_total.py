"""Total uncertainties of identified parameters, against benches whose fixed numbers are not the
rig's."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from benchmarks.identify import FREE
from benchmarks.uncertain import NOMINAL, RANGES, conditions, inertia_of, recorded, true
from sautereau.analysis.identify.identified import identify
from sautereau.analysis.results.fit import Fit
from sautereau.analysis.text import in_rig_units
from tests.budget import amount

STATED = {"inertia": 7e-4, "coulomb": 1e-3}  # What the rigs say of the fitted numbers
BENCHES = range(300, 300 + amount(36, 200))
SLOW_RETURN = 0.04  # m/s, so that the finger keeps the key, and the friction shows on its way back


def bench(number):
    """Return a bench whose fixed and fitted numbers are drawn, and the fitted ones by name."""
    rng = np.random.default_rng([45, number])
    drawn = true(rng, RANGES)
    drawn |= {"plectrum.overlap": rng.uniform(0.18e-3, 0.33e-3)}
    drawn |= {"plectrum.youngs_modulus": rng.uniform(2.2e9, 3.6e9)}
    friction = rng.uniform(0, 0.15) if rng.random() < 0.5 else 0.0
    base = replace(
        NOMINAL,
        inertia=rng.uniform(5.5e-4, 9.5e-4),
        pivot_coulomb=rng.uniform(0.4e-3, 2e-3),
        speed=rng.uniform(0.05, 0.12),
        return_speed=SLOW_RETURN,
        choirs=(replace(NOMINAL.choirs[0], friction=friction),),
    )
    made = conditions(rng, drawn, base)
    (choir,) = made.choirs
    values = choir.bending_stiffness, choir.overlap, inertia_of(made), made.pivot_coulomb
    return made, dict(zip(FREE, values, strict=True))


@cache
def heavy():
    """Return the fit to presses of a jack of 9 g where the rig says 6 g, within 4 to 12 g."""
    rng = np.random.default_rng(9)
    made = conditions(rng, true(rng, {}) | {"jack.mass": 9e-3}, NOMINAL)
    ranges = {"jack.mass": (4e-3, 12e-3)}
    pressed, phases = recorded(made, range(1, 3), ranges, **STATED)
    return identify(pressed, phases, FREE, starts=1), inertia_of(made)


@pytest.mark.slow
def test_a_jack_of_9_g_where_the_rig_says_6_g_is_within_the_interval_of_the_inertia():
    found, inertia = heavy()
    estimate = next(e for e in found.estimates if e.name == "key.inertia")
    assert estimate.value > 1.1 * inertia
    assert estimate.low < inertia < estimate.high
    assert not estimate.identifiable
    assert estimate.measurements[0].what.startswith("measure jack.mass")
    assert estimate.std == pytest.approx(np.hypot(estimate.std_noise, estimate.std_inputs))
    stiffness = found.estimates[0]
    assert stiffness.identifiable


@pytest.mark.slow
def test_all_columns_are_in_text_json_and_table():
    found, _ = heavy()
    fit = Fit(found.rig, True, (), None, found)
    assert list(fit.params.columns)[2:5] == ["std", "std_noise", "std_inputs"]
    one = fit.document["parameters"]["key.inertia"]
    assert one["std"] ** 2 == pytest.approx(one["std_noise"] ** 2 + one["std_inputs"] ** 2)
    text = str(fit)
    assert " mm " in text
    assert "0.000" not in text
    assert "also fitted, without being requested: jack.string_clearance" in text
    assert {"jack.string_clearance", "plectrum.friction"} <= set(fit.document["also_fitted"])


@pytest.mark.slow
def test_total_intervals_hold_on_benches_with_drawn_fixed_numbers():
    """0.9 and not 0.95 is required of 36 benches, as they miss 3 one time in four. All keys are
    rigid."""
    held, far, modes = {name: [] for name in FREE}, [], 0
    for number in BENCHES:
        made, values = bench(number)
        pressed, phases = recorded(made, range(1, 3), RANGES, **STATED)
        found = identify(pressed, phases, FREE, starts=1)
        modes += len(found.modes) > 0
        for e in found.estimates:
            if e.name in values and e.low is not None:
                held[e.name].append(e.low <= values[e.name] <= e.high)
                off = abs(e.value - values[e.name]) / e.std
                far.append(e.identifiable and off > 3)
    for name, own in held.items():
        assert len(own) >= 0.95 * len(BENCHES), name
        assert np.mean(own) >= 0.9, name
    assert not any(far)
    assert modes <= 0.05 * len(BENCHES)


@pytest.mark.parametrize(
    ("value", "std", "unit", "said"),
    [
        (0.00035310000000000004, 6.9e-6, "m", ("0.3531", "0.0069", "mm")),
        (8.0574e-4, 1.46e-4, "kg*m**2", ("8.1e-4", "1.5e-4", "kg m^2")),
        (0.5e-3, 4e-3, "N*m", ("0.5", "4", "mN m")),
        (2.9e9, 0.12e9, "Pa", ("2.90", "0.12", "GPa")),
        (0.07, 0.012, "", ("0.070", "0.012", "")),
        (0.006, None, "kg", ("6.0000", "-", "g")),
    ],
)
def test_values_have_the_units_of_rig_files_and_digits_by_their_uncertainty(value, std, unit, said):
    text, (spread,), name = in_rig_units(value, std, unit, [std])
    assert (text, spread, name) == said

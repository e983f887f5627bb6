"""What is unknown is not counted as passed."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from sautereau.analysis.identify.quality import Quality
from sautereau.analysis.phases.checks import about_instants
from sautereau.analysis.phases.contact import Contact
from sautereau.analysis.phases.find import find_phases
from sautereau.analysis.report.fits import read_fit
from sautereau.entrance.session import Session
from tests.recordings import write_recording

GOOD = Quality(1e-3, 1e-3, None, None, 1.0, 0.0, {}, True, False, ())
FIT = {
    "parameters": {
        "key.inertia": {
            "unit": "kg*m**2", "value": 7e-4, "std": 1e-5, "ci95": None, "identifiable": True
        }
    },
    "presses": ["a"], "level": "elastica", "residual": 1e-3, "residual_before": 1e-3,
}  # fmt: skip


@pytest.mark.parametrize(
    ("noise", "reasons", "fits", "verdict"),
    [
        (1e-3, (), True, "the model fits"),
        (1e-3, ("a",), False, "DOES NOT FIT"),
        (None, (), None, "unknown: the recordings have no rest before or after the press"),
        (None, ("a",), False, "DOES NOT FIT"),
    ],
)
def test_a_model_fits_if_the_noise_is_known(noise, reasons, fits, verdict):
    good = replace(GOOD, noise=noise, reasons=reasons)
    assert good.fits is fits
    assert verdict in good.verdict


def test_a_ramp_without_rest(tmp_path, paper):
    """No press, and 125 mN are left: it is unknown whether the model fits."""
    n = 1000
    signals = 0.05 * np.sin(np.pi * np.arange(n) / n) ** 2, np.linspace(0, 1, n)
    scales = [[paper.daq.channel(name).scale] for name in ("velocity", "force")]
    path = write_recording(tmp_path / "a.mcap", paper, np.array(signals) / scales)
    fit = Session([path]).identify(["plectrum.overlap"], starts=1)
    found = fit.document
    assert found["fits"] is found["quality"]["noise"] is None
    assert found["parameters"]["plectrum.overlap"]["ci95"] is None
    assert fit.values == {}
    text = "\n".join(fit.lines())
    assert "whether the model fits is unknown" in text
    assert "no 95 % intervals" in text


@pytest.mark.parametrize(
    ("fits", "said"),
    [({}, "is unknown"), ({"fits": None}, "is unknown"), ({"fits": False}, "does not fit")],
)
def test_the_report_shows_the_verdict(tmp_path, fits, said):
    path = tmp_path / "fit1.json"
    path.write_text(json.dumps(FIT | fits))
    assert said in read_fit(path).about
    path.write_text(json.dumps(FIT | {"fits": True}))
    assert "fit" not in read_fit(path).about.partition("after")[2]


def test_an_uncertainty_that_is_not_a_number_is_large(make_press):
    held = find_phases(make_press()).plucks[0]
    contact = Contact(held.contact, held.contact_std, 1.0, 1.0, 1.0, 0.0)
    assert about_instants([held], [contact], 0.0, None) == []
    unknown = replace(held, release_std=math.nan)
    (said,) = about_instants([unknown], [contact], 0.0, None)
    assert "release nan" in said.text

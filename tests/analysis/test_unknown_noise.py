"""What is unknown is not counted as passed."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sautereau.analysis.identify.quality import Quality
from sautereau.analysis.phases.checks import about_instants
from sautereau.analysis.phases.contact import Contact
from sautereau.analysis.phases.find import find_phases
from sautereau.entrance.session import Session
from tests.recordings import write_recording

GOOD = Quality(1e-3, 1e-3, None, None, 1.0, 0.0, {}, True, False, ())


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


@pytest.mark.slow
def test_a_ramp_without_rest(tmp_path, paper):
    """No press, and 125 mN are left: it is unknown whether the model fits."""
    n = 1000
    signals = 0.005 * np.sin(np.pi * np.arange(n) / n) ** 2, np.linspace(0, 1, n)
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


def test_an_uncertainty_that_is_not_a_number_is_large(make_press):
    held = find_phases(make_press()).plucks[0]
    contact = Contact(held.contact, held.contact_std, 1.0, 1.0, 1.0, 0.0)
    assert about_instants([held], [contact], 0.0, None) == []
    unknown = replace(held, release_std=math.nan)
    (said,) = about_instants([unknown], [contact], 0.0, None)
    assert "release nan" in said.text

"""Any finite number in any field of a rig is predicted with finite numbers, or refused by name."""

import re
import warnings

import numpy as np
import pytest

from sautereau.analysis.errors import ModelError
from sautereau.analysis.model.batch import predict_many
from sautereau.analysis.model.choirs import pluck_of
from sautereau.analysis.model.pluck.paths import Status
from sautereau.analysis.model.predict import predict
from sautereau.rig.disk import named_text
from sautereau.rig.document import rig_document
from sautereau.rig.errors import RigError
from sautereau.rig.load import load_rig, parse_rig, with_values
from sautereau.trajectory.errors import TrajectoryError

RIG = load_rig()
NUMBERS = (1e300, -1e300, 1e30, 1e-100, 1e-300, 1e20, 1e-20, 1e6, 1e-6, 0.0, -1.0)


def fields(document, path=()):
    """Yield the dotted key and the unit of each quantity, None of a plain number."""
    for name, value in document.items():
        if isinstance(value, dict):
            yield from fields(value, (*path, name))
        elif isinstance(value, float) or re.fullmatch(r"[-+.\de]+ [^ ].*", str(value)):
            unit = value.partition(" ")[2] if isinstance(value, str) else None
            yield ".".join((*path, name)), unit


FIELDS = list(fields(rig_document(RIG)))


@pytest.mark.parametrize(("key", "unit"), FIELDS, ids=[key for key, _ in FIELDS])
def test_any_number_is_predicted_or_refused(key, unit):
    for number in NUMBERS:
        value = number if unit is None else f"{number!r} {unit}"
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            try:
                found = predict(with_values(RIG, {key: value}))
            except (RigError, ModelError, TrajectoryError) as error:
                assert "nan" not in str(error).lower()  # noqa: PT017 - either way is right
                continue
        scalars = (found.plectrum_force, found.pluck_duration, found.release_lift, found.v_osc)
        assert np.isfinite([*scalars, found.peak_force, found.work]).all()


def test_a_string_lifted_like_a_rubber_band_is_refused():
    soft = with_values(RIG, {"string.tension": "1 N"})
    stiff = {"overlap": 1e-3, "thickness": 1e-3, "youngs_modulus": 1e11}
    with pytest.raises(ModelError, match=r"beyond 108 mm, 100 % of the way"):
        pluck_of(soft.plectrum.model_copy(update=stiff), soft.string, "elastica")
    one = {f"plectrum.{name}": value for name, value in stiff.items()}
    one |= {"string.tension": 1.0, "press.jack_rise": 1.0}
    assert predict_many(RIG, one).status.item() == Status.STRING_OUT_OF_RANGE


@pytest.mark.parametrize(
    ("key", "value", "named"),
    [
        ("youngs_modulus", "2.9 MPa", "plectrum.youngs_modulus"),
        ("youngs_modulus", "2.9 GPa", None),
        ("youngs_modulus", "310 GPa", "plectrum.youngs_modulus"),
        ("jack_arm", "2.15 m", "key.jack_arm"),
        ("mass", "6 kg", "jack.mass"),
        ("string_clearance", "1.944 m", "jack.string_clearance"),
        ("tension", "66.95 kN", "string.tension"),
        ("frequency", "365 kHz", "string.frequency"),
        ("diameter", "0.31 um", "string.diameter"),
    ],
)
def test_a_value_that_no_instrument_has_is_to_be_confirmed(key, value, named, caplog):
    """By a range, since a source stays where the value beside it is changed."""
    text, *_ = named_text("paper", "sautereau.rig", "rig", RigError)

    def warned(given):
        caplog.clear()
        parse_rig(re.sub(rf"^{key} = .*", f"{key} = {given}", text, flags=re.MULTILINE))
        return {each.getMessage().split(": ")[2] for each in caplog.records}

    of_source = warned(f'{{ value = "{value}", source = "me" }}')
    assert (named in of_source) if named else not of_source
    confirmed = warned(f'{{ value = "{value}", assumed = ["{value}", "{value}"] }}')
    assert confirmed == of_source - {
        f"{table}.{key}" for table in ("plectrum", "key", "jack", "string")
    }

"""The voicing study: that its numbers are what beams and players say."""

import numpy as np
import pytest

from examples.voicing import LENGTH, THICKNESS, TIP_THICKNESS, main, study
from sautereau.rig.load import load_rig

RIG = load_rig()


@pytest.fixture(scope="module")
def studied():
    return study(RIG)


def column(voices, name):
    return np.array([getattr(voice, name) for voice in voices])


def test_the_rig_as_it_is_is_medium(studied):
    for voices, value in zip(studied, (0.48e-3, 0.48e-3, 4.5e-3), strict=True):
        (same,) = [voice for voice in voices if voice.value == value]
        assert same.word == "medium"
    # 0.516 N on the jack, at 215 and 171 mm from the pin.
    assert studied[0][THICKNESS.index(0.48e-3)].finger_force == pytest.approx(0.649, abs=1e-3)


def test_more_wood_is_harder(studied):
    thickness, tip, length = studied
    for voices in (thickness, tip):
        assert (np.diff(column(voices, "finger_force")) > 0).all()
        assert (np.diff(column(voices, "work")) > 0).all()
        assert (np.diff(column(voices, "v_osc")) > 0).all()
    assert (np.diff(column(length, "finger_force")) < 0).all()
    assert [voices[0].word for voices in studied] == ["soft", "soft", "hard"]
    assert [voices[-1].word for voices in studied] == ["hard", "medium", "soft"]


def test_the_slope_at_first_contact_is_the_springs_in_series(studied):
    """String and cantilever of the length to the string; the tip's half is a thinner one."""
    rest_of = RIG.plectrum.overlap
    stiffness = RIG.string.static_stiffness
    width, modulus = RIG.plectrum.width, RIG.plectrum.youngs_modulus

    def ei(thickness):
        return modulus * width * thickness**3 / 12

    def compliance(value, field):
        length = value if field == "length" else RIG.plectrum.length
        thick = value if field == "thickness" else RIG.plectrum.thickness
        s = length - rest_of
        outer = max(s - length / 2, 0) if field == "tip_thickness" else 0.0
        tip = value if field == "tip_thickness" else thick
        return (s**3 - outer**3) / (3 * ei(thick)) + outer**3 / (3 * ei(tip))

    for voices in studied:
        for voice in voices:
            height, force = voice.pluck.height, voice.pluck.vertical_force
            near = (height > 0) & (height < 0.03e-3)
            slope = np.polyfit(height[near], force[near], 2)[-2]
            expected = 1 / (1 / stiffness + compliance(voice.value, voice.field))
            assert slope == pytest.approx(expected, rel=5e-3)


def test_table_and_plot(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", ["voicing", str(tmp_path / "voicing.png")])
    main()
    printed = capsys.readouterr().out.splitlines()
    cuts = len(THICKNESS) + len(TIP_THICKNESS) + len(LENGTH)
    assert sum(line.split()[-1] in ("soft", "medium", "hard") for line in printed) == cuts
    assert (tmp_path / "voicing.png").read_bytes().startswith(b"\x89PNG")

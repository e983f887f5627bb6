"""A rig file has a base, and differences; the base is another file, a packaged rig, or several."""

import tomllib

import pytest

from sautereau.rig.document import rig_from_json, rig_json
from sautereau.rig.edit import edit_rig
from sautereau.rig.errors import RigError
from sautereau.rig.layers import Layers
from sautereau.rig.load import load_rig, with_values
from sautereau.rig.text import commented_rig

STRING = """
[[more_choirs]]
jack_arm = "225 mm"
jack = { mass = "5 g", register_friction = "10 mN", string_clearance = "2.5 mm" }
plectrum = { length = "4 mm", width = "0.7 mm", thickness = "0.4 mm", youngs_modulus = "2 GPa", \
poisson_ratio = 0.3, density = "1200 kg/m^3", overlap = "0.2 mm" }
string = { tension = "60 N", length = "400 mm", plucking_point = "90 mm", frequency = "365 Hz" }
"""


@pytest.fixture
def rigs(tmp_path):
    """Return a function that writes rig files, and loads the last one."""

    def write(**texts):
        for name, text in texts.items():
            (tmp_path / f"{name}.toml").write_text(text, encoding="utf-8")
        return load_rig(tmp_path / f"{list(texts)[-1]}.toml")

    return write


def test_all_but_the_differences_is_the_base(rigs, paper):
    rig = rigs(a='name = "a"\nbase = "paper"\n[plectrum]\noverlap = "0.3 mm"\n')
    assert rig.plectrum.overlap == pytest.approx(0.3e-3)
    assert rig.name == "a"
    assert rig.replaced({"plectrum.overlap": 0.263e-3}).plectrum == paper.plectrum
    assert rig.arm == paper.arm
    # The range and the source of the base are those of its value, not of the new one.
    about = {"plectrum.overlap"}
    assert rig.assumed == {k: v for k, v in paper.assumed.items() if k not in about}
    assert rig.sources == {k: v for k, v in paper.sources.items() if k not in about}


def test_bench_and_instrument_combine_and_the_last_one_counts(rigs, paper):
    rig = rigs(
        bench=commented_rig("bench") + '\n[plectrum]\noverlap = "0.1 mm"\n',
        instrument=commented_rig("instrument"),
        key='name = "g4"\nbase = ["bench.toml", "instrument.toml"]\n[jack]\nmass = "7 g"\n',
    )
    assert rig.plectrum == paper.plectrum
    run_up = dict.fromkeys(("press.run_up_acceleration", "press.run_up_jerk"))
    assert rig.press == with_values(paper, run_up).press
    assert (rig.daq, rig.controller) == (paper.daq, paper.controller)
    assert rig.jack.mass == pytest.approx(7e-3)
    assert rig.jack.tongue == paper.jack.tongue


def test_a_new_key_needs_few_keys(rigs, tmp_path):
    def keys(node):
        for name, value in node.items():
            yield from keys(value) if isinstance(value, dict) and "value" not in value else [name]

    (tmp_path / "bench.toml").write_text(commented_rig("bench"))
    text = commented_rig("instrument", "a4", "bench.toml", tmp_path)
    rig = rigs(bench=commented_rig("bench"), a4=text)
    assert rig.name == "a4"
    assert len(list(keys(tomllib.loads(text)))) <= 35


def test_a_new_key_starts_from_the_numbers_of_its_base(rigs, tmp_path):
    """With their ranges and sources; of the paper are only those that a rig needs."""
    base = (
        'name = "mine"\nbase = "paper"\n[key]\npress_arm = { value = "160 mm", source = "ruler" }\n'
        '[plectrum]\noverlap = { value = "0.3 mm", assumed = ["0.2 mm", "0.4 mm"] }\n[string]\n'
        'diameter = "0.2 mm"\n'
    )
    mine = rigs(mine=base)
    a4 = rigs(a4=commented_rig("instrument", "a4", "mine.toml", tmp_path))
    assert (a4.key, a4.plectrum, a4.string) == (mine.key, mine.plectrum, mine.string)
    assert (a4.assumed, a4.sources) == (mine.assumed, mine.sources)
    part = commented_rig("bench") + '[plectrum]\noverlap = "0.3 mm"\n'
    (tmp_path / "part.toml").write_text(part)
    a5 = rigs(a5=commented_rig("instrument", "a5", "part.toml", tmp_path))
    assert a5.plectrum.overlap == mine.plectrum.overlap


def test_a_base_of_a_base_and_one_that_is_inherited_twice(rigs):
    rig = rigs(
        a='base = "paper"\n[plectrum]\noverlap = "0.2 mm"\nwidth = "0.7 mm"\n',
        b='base = "a.toml"\n[plectrum]\noverlap = "0.3 mm"\n',
        c='name = "c"\nbase = ["b.toml", "a.toml"]\n',
    )
    assert rig.plectrum.overlap == pytest.approx(0.3e-3)
    assert rig.plectrum.width == pytest.approx(0.7e-3)


def test_paths_are_those_of_the_file_that_names_them(tmp_path):
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner/wedge.csv").write_text(
        "x [mm], z [mm]\n0,-0.25\n0,0.25\n2,0.25\n4.5,0.25\n4.5,0.05\n2,-0.2\n"
    )
    (tmp_path / "inner/a.toml").write_text(
        'base = "paper"\n[plectrum]\noutline = { file = "wedge.csv" }\n'
    )
    key = tmp_path / "key.toml"
    key.write_text('name = "k"\nbase = "inner/a.toml"\n')
    outline = load_rig(key).plectrum.outline
    assert outline is not None
    assert outline.x[-1] == pytest.approx(4.5e-3)
    key.write_text('name = "k"\nbase = "inner/a.toml"\n[plectrum]\noutline = false\n')
    assert load_rig(key).plectrum.outline is None


def test_an_entry_of_a_list_is_changed_by_its_index_or_all_are_replaced(rigs, paper):
    two = 'base = "paper"\n' + STRING
    changed = rigs(a=two, b='name="b"\nbase="a.toml"\n[more_choirs.0.plectrum]\nfriction = 0.1\n')
    assert changed.more_choirs[0].plectrum.friction == 0.1
    assert changed.more_choirs[0].string.tension == 60
    assert rigs(a=two, b='name="b"\nbase="a.toml"\nmore_choirs = []\n').more_choirs == ()
    channel = rigs(b='name = "b"\nbase = "paper"\n[daq.channels.1]\ndelay = "2 ms"\n')
    assert channel.daq.channels[1].delay == pytest.approx(2e-3)
    assert channel.daq.channels[1].sensor == paper.daq.channels[1].sensor
    assert "daq.channels.1.delay" not in channel.assumed
    assert "daq.channels.0.delay" in channel.assumed


def test_a_list_that_replaces_that_of_the_base_is_said(rigs):
    with pytest.raises(RigError, match=r"more_choirs\.0\.jack: missing") as caught:
        rigs(
            a='base = "paper"\n' + STRING,
            b='name = "b"\nbase = "a.toml"\n[[more_choirs]]\njack_arm = "220 mm"\n',
        )
    assert any("[more_choirs.0]" in note for note in caught.value.__notes__)
    with pytest.raises(RigError, match=r"line 3: daq\.channels\.7: the base has 2 entries"):
        rigs(b='name = "b"\nbase = "paper"\n[daq.channels.7]\nrange = "2 V"\n')


def test_faults_name_the_file_and_the_line_where_the_value_stands(rigs):
    with pytest.raises(RigError) as caught:
        rigs(
            a='base = "paper"\n[plectrum]\noverlap = "9 mm"\nwidth = "3 V"\n[string]\ntensio = 3\n',
            b='name = "b"\nbase = "a.toml"\n[jack]\nmass = { value = "3 g", source = 3 }\n',
        )
    first, *faults = str(caught.value).splitlines()
    assert "b.toml: 3 faults" in first
    assert [("a.toml" in f, f.split("line ")[1][:1]) for f in faults] == [
        (True, "4"), (True, "6"), (False, "4"),
    ]  # fmt: skip
    with pytest.raises(RigError, match=r"a\.toml, line 3: plectrum\.overlap: 9 mm is not less"):
        rigs(a='base = "paper"\n[plectrum]\noverlap = "9 mm"\n', b='name="b"\nbase="a.toml"\n')


@pytest.mark.parametrize(
    ("base", "said"),
    [
        ('"b.toml"', "b.toml has itself as base"),
        ('"a.toml"', "b.toml has itself as base"),
        ('"gone.toml"', "gone.toml: cannot be read"),
        ('"papre"', "did you mean 'paper'"),
        ("3", "3 is refused"),
        ('["paper", ""]', "'' is refused"),
    ],
)
def test_bases_that_cannot_be(rigs, base, said):
    with pytest.raises(RigError, match="line 2: base: ") as caught:
        rigs(a='base = "b.toml"\n', b=f'name = "b"\nbase = {base}\n')
    assert said in str(caught.value)


def test_a_chain_of_bases_has_an_end(rigs):
    with pytest.raises(RigError, match=r"k21\.toml: it is the base of a base"):
        rigs(**{f"k{n}": f'base = "k{n + 1}.toml"\n' for n in range(30, -1, -1)})


def test_the_name_is_not_inherited(rigs):
    with pytest.raises(RigError, match="name: missing"):
        rigs(a='base = "paper"\n')


def test_a_recording_needs_no_base(rigs, tmp_path):
    rig = rigs(
        a='base = "paper"\n[plectrum]\nwidth = "0.7 mm"\n',
        b='name="b"\nbase="a.toml"\n[plectrum]\noverlap = { value = "0.3 mm", source = "read" }\n',
    )
    stored = rig_json(rig)
    (tmp_path / "a.toml").unlink()
    back = rig_from_json(stored)
    assert back == rig
    assert (back.assumed, back.sources) == (rig.assumed, rig.sources)


def test_an_edit_writes_differences(rigs, tmp_path):
    rigs(b='name = "b"\nbase = "paper"\n\n[plectrum]\noverlap = "0.3 mm"  # mine\n')
    file = tmp_path / "b.toml"
    values = {
        "controller.port": "COM4", "daq.channels.1.delay": "2 ms", "plectrum.overlap": "0.31 mm",
        "arm.base_x": {"value": "-270 mm", "assumed": ["-271 mm", "-269 mm"]},
        "arm.home_angles.1": "-91 deg",
    }  # fmt: skip
    edit_rig(file, values, "setup").save()
    rig = load_rig(file)
    assert rig.controller.port == "COM4"
    assert rig.daq.channels[1].delay == pytest.approx(2e-3)
    assert rig.sources["daq.channels.1.delay"] == "setup"
    assert rig.assumed["arm.base_x"] == (-0.271, -0.269)
    assert rig.arm.home_angles[0] == 0
    assert "# mine" in file.read_text()
    assert len(file.read_text().splitlines()) < 25
    with pytest.raises(RigError, match="base_q"):
        edit_rig(file, {"arm.base_q": "1 mm"})


def test_the_differences_are_listed(tmp_path):
    text = 'name = "b"\nbase = "paper"\n[plectrum]\noverlap = "0.3 mm"\n[jack]\ntongue = false\n'
    found = Layers(text, "b.toml", tmp_path).differences
    assert found["plectrum.overlap"] == ("0.263 mm", "0.3 mm")
    assert found["jack.tongue.pivot"] == ("12 mm", None)
    assert len(found) == 5  # the name, the overlap, three values of the tongue


def test_the_sizes_of_an_outline_go_before_those_of_the_base(rigs):
    rig = rigs(
        a='base = "paper"\nname = "carved"\n[plectrum.outline]\nx = ["0 mm", "5.5 mm"]\n'
        'top = ["0.02 mm", "0 mm"]\nbottom = ["-0.4 mm", "-0.2 mm"]\n'
    )
    assert rig.plectrum.length == pytest.approx(5.5e-3)
    assert rig.plectrum.thickness == pytest.approx(0.42e-3)

"""A table of keys, as CSV or TOML, makes a rig of each from one base."""

import pytest

from sautereau.rig.errors import RigError
from sautereau.rig.keys import read_keys

CSV = """key,tension [N],string.length [mm],plucking_point,overlap [mm],plectrum.outline,recordings
c3,60,500,"110 mm",0.25,,
a3,,450,"100 mm",,wedge.csv,a3/*.mcap
"""
WEDGE = "x [mm], z [mm]\n0,-0.25\n0,0.25\n2,0.25\n4.5,0.25\n4.5,0.05\n2,-0.2\n"
TOML = """
base = "mine.toml"
[keys.c3]
string = { tension = "60 N", length = "500 mm", plucking_point = "110 mm" }
plectrum.overlap = "0.25 mm"
[keys.a3]
recordings = ["a3/*.mcap"]
string.length = "450 mm"
string.plucking_point = "100 mm"
plectrum.outline = { file = "wedge.csv" }
"""


@pytest.fixture
def keys(tmp_path):
    (tmp_path / "wedge.csv").write_text(WEDGE)
    (tmp_path / "mine.toml").write_text('name = "m"\nbase = "paper"\n[jack]\nmass = "7 g"\n')

    def read(text, name="keys.csv", base=None):
        path = tmp_path / name
        path.write_text(text)
        return read_keys(path, base)

    return read


def test_csv_and_toml_say_the_same(keys, tmp_path, paper):
    found = keys(CSV, base=str(tmp_path / "mine.toml"))
    assert found == keys(TOML, "keys.toml")
    c3, a3 = found
    assert (c3.name, a3.name) == ("c3", "a3") == (c3.rig.name, a3.rig.name)
    assert c3.rig.string.length == pytest.approx(0.5)
    assert c3.rig.plectrum.overlap == pytest.approx(0.25e-3)
    assert a3.rig.string.tension == paper.string.tension
    assert a3.rig.plectrum.outline.x[-1] == pytest.approx(4.5e-3)
    assert a3.rig.jack.mass == pytest.approx(7e-3)
    assert a3.recordings == (str(tmp_path / "a3/*.mcap"),)
    assert "plectrum.overlap" not in c3.rig.assumed
    assert "plectrum.overlap" in a3.rig.assumed


def test_decimal_commas_and_the_packaged_rig(keys, paper):
    (key,) = keys("key;overlap [mm];plectrum.poisson_ratio\nc;0,25;0,3\n")
    assert key.rig.plectrum.overlap == pytest.approx(0.25e-3)
    assert key.rig.plectrum.poisson_ratio == 0.3
    assert key.rig.arm == paper.arm


FAULTS = {
    "keys.csv": [
        ("", ["no column `key`"]),
        ("\nkey,overlap\n", ["no column `key`"]),
        ("key,overlap\n", ["no key"]),
        ("key,length [mm]\nc,3\n", ["length: it may be"]),
        ("key,plectrum.lenght [mm],overlap,overlap\n", ["did you mean 'length'", "occurs twice"]),
        ("key,overlap [mm]\nc,0.2\nc,0.3\n,0.2\n", ["line 3: key 'c'", "line 4: key ''"]),
        ("key,overlap [mm]\nc,0.2\nd,9\ne,x\n", ["line 3: d: ", "9 mm is not less", "line 4: e"]),
        ("key,plectrum.outline\nc,none.csv\n", ["line 2: c: plectrum.outline: outline file"]),
    ],
    "keys.toml": [
        ("keys = 3\nbench = 4", ["bench: unknown key", "no table of a key"]),
        ("[keys]\nc = 3", ["no table of a key"]),
        ('[keys.c]\nname = "d"\n', ["line 1: c: name: that of a key"]),
        ("[keys.c]\nrecordings = 3\n", ["recordings: 3 is refused"]),
        (
            '[keys.c]\nplectrum.overlap = "9 mm"\n[keys.d]\nstrin = 3\n',
            ["c: plectrum.over", "strin"],
        ),
    ],
}


@pytest.mark.parametrize(
    ("file", "text", "said"), [(file, *each) for file, cases in FAULTS.items() for each in cases]
)
def test_faults_name_line_and_key(keys, file, text, said):
    with pytest.raises(RigError, match="table of keys") as caught:
        keys(text, file)
    for word in said:
        assert word in str(caught.value)


def test_one_base_only(keys):
    with pytest.raises(RigError, match="it has the base"):
        keys(TOML, "keys.toml", "paper")


def test_many_faulty_keys_are_counted(keys):
    rows = "\n".join(f"k{k},9" for k in range(12))
    with pytest.raises(RigError, match="and 7 more keys"):
        keys(f"key,overlap [mm]\n{rows}\n")

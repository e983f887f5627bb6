"""Maps in the user's cache: exact, replaced if damaged, found by all their inputs."""

import subprocess
import sys
import threading

import numpy as np
import pytest

from sautereau.analysis.model.plectrum.fe import level as cache
from sautereau.analysis.model.plectrum.fe.level import FE, _table
from sautereau.analysis.model.plectrum.profile import profile_of
from sautereau.analysis.model.plectrum.tapered import samples
from sautereau.rig.load import load_rig

PLECTRUM = load_rig("paper").plectrum
MADE = samples(profile_of(PLECTRUM), 0.85, 2.0)
"""In place of finite elements, which would take two seconds."""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Keep these tests' maps out of the user's cache."""
    monkeypatch.setattr(cache, "cache_folder", lambda: tmp_path)
    _table.cache_clear()
    yield tmp_path
    _table.cache_clear()


@pytest.fixture
def uniform(folder, monkeypatch):
    """Return a level whose map has just been made and stored."""
    with monkeypatch.context() as patched:
        patched.setattr("sautereau.analysis.model.plectrum.fe.build.build", lambda *_: (MADE, None))
        return FE(PLECTRUM)


def test_a_stored_map_comes_back_exactly(uniform, folder, monkeypatch):
    def never(*_):
        raise AssertionError

    monkeypatch.setattr("sautereau.analysis.model.plectrum.fe.build.build", never)
    _table.cache_clear()
    again = FE(PLECTRUM)
    for found, expected in zip(again.bend(4.3e-3, 0.4), uniform.bend(4.3e-3, 0.4), strict=True):
        assert found == expected
    assert not list(folder.glob("*.part"))


def test_a_stored_map_comes_back_without_the_elements_library(uniform, folder):
    """Importing it takes longer than all the rest; benchmarks/calculix.py has the times."""
    lines = (
        "import sys, pathlib",
        "from sautereau.analysis.model.plectrum.fe import level as cache",
        "from sautereau.analysis.model.plectrum.levels import plectrum_map",
        "from sautereau.rig.load import load_rig",
        f"cache.cache_folder = lambda: pathlib.Path({str(folder)!r})",
        "plectrum_map(load_rig().plectrum, 'fe')",
        "assert 'skfem' not in sys.modules",
    )
    subprocess.run([sys.executable, "-c", "\n".join(lines)], check=True)


def test_modulus_and_width_need_no_other_map(uniform, monkeypatch):
    monkeypatch.delattr("sautereau.analysis.model.plectrum.fe.build.build")
    other = FE(PLECTRUM.model_copy(update={"youngs_modulus": 5.8e9, "width": 1.5e-3}))
    assert other.bend(4.3e-3, 2.0).z == pytest.approx(float(uniform.bend(4.3e-3, 0.5).z))
    rubbed = FE(PLECTRUM.model_copy(update={"friction": 0.1}))
    assert rubbed.bend(4.3e-3, 0.5) == uniform.bend(4.3e-3, 0.5, 0.1)


@pytest.mark.parametrize(
    "change", [{"poisson_ratio": 0.3}, {"thickness": 0.4e-3}, {"overlap": 2e-3}]
)
def test_whatever_shapes_the_map_is_in_its_name(uniform, change, monkeypatch):
    monkeypatch.delattr("sautereau.analysis.model.plectrum.fe.build.build")
    with pytest.raises(ImportError):
        FE(PLECTRUM.model_copy(update=change))


def flip(content):
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


@pytest.mark.parametrize(
    "damage",
    [
        flip,
        lambda c: c[: len(c) // 2],
        lambda c: b"",
        lambda c: b"PK\x03\x04" + c[:9],
        lambda c: None,
    ],
    ids=["one bit", "cut", "empty", "no archive", "another's"],
)
def test_a_damaged_file_is_replaced(uniform, tmp_path, damage, monkeypatch):
    made = []

    def build(*_):
        made.append(True)
        return MADE, None

    monkeypatch.setattr("sautereau.analysis.model.plectrum.fe.build.build", build)
    (path,) = tmp_path.iterdir()
    good = path.read_bytes()
    bad = damage(good)
    if bad is None:  # a complete file under another name
        key = "0" * 64
        (tmp_path / f"{key}.npz").write_bytes(good)
        assert cache._read(tmp_path / f"{key}.npz", key) is None
        return
    path.write_bytes(bad)
    _table.cache_clear()
    FE(PLECTRUM)
    assert made == [True]
    assert cache._read(path, path.stem) is not None
    _table.cache_clear()
    FE(PLECTRUM)
    assert made == [True]


def test_without_a_cache_it_still_works(uniform, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    monkeypatch.setattr(cache, "cache_folder", lambda: tmp_path / "file" / "below")
    monkeypatch.setattr("sautereau.analysis.model.plectrum.fe.build.build", lambda *_: (MADE, None))
    _table.cache_clear()
    assert FE(PLECTRUM).bend(4.3e-3, 0.4) == uniform.bend(4.3e-3, 0.4)


def test_no_wrong_byte_of_a_file_passes(uniform, tmp_path):
    key = "b" * 64
    path = tmp_path / f"{key}.npz"
    cache._write(path, key, MADE)
    good = path.read_bytes()
    for place in range(0, len(good), 9 * len(good) // 10000 + 1):
        path.write_bytes(good[:place] + bytes([good[place] ^ 0xFF]) + good[place + 1 :])
        found = cache._read(path, key)  # a byte of a date, say, is read over
        if found is not None:
            np.testing.assert_array_equal(found.laws, MADE.laws)
            np.testing.assert_array_equal(found.line, MADE.line)
            assert (found.q_max, found.nearest) == (MADE.q_max, MADE.nearest)


def test_many_writers_of_one_map_leave_a_complete_file(uniform, folder):
    key = "a" * 64
    path = folder / "many" / f"{key}.npz"
    writers = [threading.Thread(target=cache._write, args=(path, key, MADE)) for _ in range(8)]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    assert cache._read(path, key) is not None
    assert list(path.parent.iterdir()) == [path]

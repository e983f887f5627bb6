"""Arrays within structures, arrays of structures and cells, as MATLAB and numpy save them."""

import numpy as np
import pytest
from scipy.io import savemat

from sautereau.daq.convert.from_arrays import open_mat, open_npz
from sautereau.daq.errors import RecordingError

T = np.arange(50) / 1e3
V = np.sin(T)


def cell(*elements):
    made = np.empty(len(elements), object)
    made[:] = elements
    return made


def structures(*elements):
    """Return an array of structures with the fields `name` and `data`."""
    made = np.empty((1, len(elements)), [("name", object), ("data", object)])
    made[0, :] = elements
    return made


@pytest.mark.parametrize(
    ("saved", "found"),
    [
        ({"r": {"t": T, "v": V}}, {"r.t": T, "r.v": V}),
        ({"r": {"a": {"v": V}, "n": "x"}}, {"r.a.v": V}),
        ({"c": structures(("a", T), ("b", V))}, {"c(1).data": T, "c(2).data": V}),
        ({"c": structures(("a", T), ("b", V[:7]))}, {"c(1).data": T, "c(2).data": V[:7]}),
        ({"r": {"c": structures(("a", T), ("b", V)), "t": T}},
         {"r.c(1).data": T, "r.c(2).data": V, "r.t": T}),
        ({"c": cell(V, T[:7])}, {"c(1)": V, "c(2)": T[:7]}),
        ({"c": cell({"v": V}, {"v": T})}, {"c(1).v": V, "c(2).v": T}),
        ({"c": cell("a", "bcd"), "v": V}, {"v": V}),
        ({"m": np.column_stack([T, V])}, {"m(1)": T, "m(2)": V}),
    ],
)  # fmt: skip
def test_matlab(tmp_path, saved, found):
    savemat(tmp_path / "a.mat", saved)
    source = open_mat(tmp_path / "a.mat")
    assert set(source.names) == set(found)
    read = source.read(list(found))
    assert all(np.array_equal(read[name], found[name]) for name in found)


def test_records_of_numpy(tmp_path):
    records = np.array(list(zip(T, V, strict=True)), [("t", "f8"), ("v", "f4")])
    np.savez(tmp_path / "a.npz", records=records, v=V)
    source = open_npz(tmp_path / "a.npz")
    assert source.names == ("records.t", "records.v", "v")
    assert np.array_equal(source.read(["records.v"])["records.v"], V.astype("f4"))


def test_what_cannot_be_read_is_not_called_damaged(tmp_path):
    np.savez(tmp_path / "a.npz", ragged=cell(V, T[:7]))
    with pytest.raises(RecordingError, match="allow_pickle") as raised:
        open_npz(tmp_path / "a.npz")
    assert "damaged" not in str(raised.value)

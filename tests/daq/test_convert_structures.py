"""Arrays within structures, arrays of structures and cells, as MATLAB and numpy save them."""

import numpy as np
import pytest
from scipy.io import savemat

from sautereau.daq.convert.from_arrays import open_mat, open_numpy
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
    for place, (name, data) in zip(made[0], elements, strict=True):
        place["name"], place["data"] = name, data
    return made


SAVED = {
    "one": {"t": T, "v": V},
    "nested": {"a": {"v": V}, "n": "x"},
    "array": structures(("a", T), ("b", V[:7])),
    "both": {"c": structures(("a", T), ("b", V)), "t": T},
    "cell": cell(V, T[:7]),
    "records": cell({"v": V}, {"v": T}),
    "words": cell("a", "bcd"),
    "matrix": np.column_stack([T, V]),
}
FOUND = {
    "one.t": T,
    "one.v": V,
    "nested.a.v": V,
    "array(1).data": T,
    "array(2).data": V[:7],
    "both.c(1).data": T,
    "both.c(2).data": V,
    "both.t": T,
    "cell(1)": V,
    "cell(2)": T[:7],
    "records(1).v": V,
    "records(2).v": T,
    "matrix(1)": T,
    "matrix(2)": V,
}


def test_matlab(tmp_path):
    savemat(tmp_path / "a.mat", SAVED)
    source = open_mat(tmp_path / "a.mat")
    assert set(source.names) == set(FOUND)
    read = source.read(list(FOUND))
    assert all(np.array_equal(read[name], FOUND[name]) for name in FOUND)


def test_records_of_numpy(tmp_path):
    records = np.array(list(zip(T, V, strict=True)), [("t", "f8"), ("v", "f4")])
    np.savez(tmp_path / "a.npz", records=records, v=V)
    source = open_numpy(tmp_path / "a.npz")
    assert source.names == ("records.t", "records.v", "v")
    assert np.array_equal(source.read(["records.v"])["records.v"], V.astype("f4"))


def test_what_cannot_be_read_is_not_called_damaged(tmp_path):
    np.savez(tmp_path / "a.npz", ragged=cell(V, T[:7]))
    with pytest.raises(RecordingError, match="allow_pickle") as raised:
        open_numpy(tmp_path / "a.npz")
    assert "damaged" not in str(raised.value)

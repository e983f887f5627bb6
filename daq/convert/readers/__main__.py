"""Read a file with a library, and write its arrays of numbers as npz on standard output.

This is a program of its own, because the libraries crash, block their process or fill its memory
on some damaged files. The first array holds, as JSON, the names of the others, their properties in
the file and the document of an export by sautereau.

python -m sautereau.daq.convert.readers KIND FILE MOST_VALUES SECONDS
"""

import io
import json
import os
import sys
from contextlib import redirect_stdout
from importlib import import_module

import numpy as np

from sautereau.daq.convert.readers import refuse

READERS = {
    "MATLAB": "arrays:read_mat",
    "HDF5": "arrays:read_hdf5",
    "numpy": "arrays:read_numpy",
    "lvm": "lvm:read",
    "universal": "uff:read",
    "workbook": "xlsx:read",
    "sound": "arrays:read_sound",
    "MDF": "mdf:read",
    "ROS bag": "rosbag:read",
}
"""Function of this folder that reads a kind of file."""


def main() -> None:
    """Read the file; a fault is the last line on standard error, and status 1."""
    kind, path, most, seconds = sys.argv[1:]
    limit(0.5e9 + 16 * int(most), int(seconds))  # The libraries, the values and one copy of them
    module, _, function = READERS[kind].partition(":")
    try:
        with redirect_stdout(sys.stderr):  # asammdf prints what it ignores
            read = getattr(import_module(f"sautereau.daq.convert.readers.{module}"), function)
            arrays, about, document = read(path, int(most))
        refuse(sum(array.size for array in arrays.values()), int(most))
    except BaseException as error:  # noqa: BLE001 (the readers raise many kinds)
        # rosbags repeats the definition of a message.
        text = " ".join(str(error).split())[:400] or "its memory is limited"
        print(f"{type(error).__name__}: {text}", file=sys.stderr, flush=True)  # noqa: T201
        os._exit(1)  # at the end, asammdf would print faults of its half-made objects
    file = io.BytesIO()
    np.savez(file, np.array(json.dumps([list(arrays), about, document])), *arrays.values())
    sys.stdout.buffer.write(file.getbuffer())


def limit(memory: float, seconds: int) -> None:
    """Limit memory (bytes) and processor time (s), where the system can."""
    try:
        import resource
    except ImportError:  # Windows
        return
    for kind, value in ((resource.RLIMIT_DATA, memory), (resource.RLIMIT_CPU, seconds)):
        _, hard = resource.getrlimit(kind)
        most = int(value) if hard == resource.RLIM_INFINITY else min(int(value), hard)
        resource.setrlimit(kind, (most, hard))


if __name__ == "__main__":
    main()

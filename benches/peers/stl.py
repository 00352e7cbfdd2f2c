"""Binary STL files, for the scripts beside this one."""

import numpy as np


def read_binary_stl(path):
    """Corners of all triangles, [n, 3, 3]."""
    with open(path, "rb") as file:
        file.seek(80)
        count = int(np.frombuffer(file.read(4), "<u4")[0])
        record = np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
        return np.frombuffer(file.read(count * record.itemsize), record)["v"].astype(float)

"""Binary STL files, for the scripts beside this one."""

import numpy as np

RECORD = np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])


def read_binary_stl(path):
    """Corners of all triangles, [n, 3, 3]."""
    with open(path, "rb") as file:
        file.seek(80)
        count = int(np.frombuffer(file.read(4), "<u4")[0])
        return np.frombuffer(file.read(count * RECORD.itemsize), RECORD)["v"].astype(float)


def binary_stl(corners):
    """The file of triangles, [n, 3, 3], without normals."""
    rows = np.zeros(len(corners), RECORD)
    rows["v"] = corners
    return bytes(80) + np.array(len(rows), "<u4").tobytes() + rows.tobytes()


def triangles(solid):
    """Corners of the triangles of a solid of manifold3d, [n, 3, 3]."""
    mesh = solid.to_mesh()
    return np.asarray(mesh.vert_properties, np.float32)[:, :3][np.asarray(mesh.tri_verts)]

"""Parts that tests make, and the program that answers must equal."""

import os
import struct
from pathlib import Path

import numpy as np
import pytest


def solid(occupied, size):
    """Vertices and triangles of the boundary of a set of cubes, outward."""
    occupied = np.pad(np.asarray(occupied, dtype=bool), 1)
    vertices, triangles = {}, []
    corner = lambda p: vertices.setdefault(tuple(int(x) for x in p), len(vertices))
    for cell in np.argwhere(occupied):
        for axis in range(3):
            for side in (0, 1):
                step = np.zeros(3, dtype=int)
                step[axis] = 2 * side - 1
                if occupied[tuple(cell + step)]:
                    continue
                u, v = np.eye(3, dtype=int)[[(axis + 1) % 3, (axis + 2) % 3]]
                low = cell + (np.eye(3, dtype=int)[axis] if side else 0)
                a, b, c, d = (corner(p) for p in (low, low + u, low + u + v, low + v))
                triangles += [(a, b, c), (a, c, d)] if side else [(a, c, b), (a, d, c)]
    points = (np.array(list(vertices), dtype=np.float64) - 1) * size
    return points, np.array(triangles, dtype=np.int64)


@pytest.fixture(scope="session")
def pocket():
    """A block of 40 x 30 x 20 mm with a deep pocket: vertices, triangles."""
    occupied = np.ones((8, 6, 4), dtype=bool)
    occupied[2:4, 2:4, 1:] = False
    return solid(occupied, 5.0)


@pytest.fixture(scope="session")
def mesh(pocket):
    import deepmill

    return deepmill.Mesh(*pocket, name="pocket.stl")


@pytest.fixture(scope="session")
def stl(pocket, tmp_path_factory):
    """The block as a binary STL."""
    vertices, triangles = pocket
    path = tmp_path_factory.mktemp("part") / "pocket.stl"
    with path.open("wb") as file:
        file.write(bytes(80) + struct.pack("<I", len(triangles)))
        for corners in vertices[triangles]:
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            normal /= np.linalg.norm(normal)
            file.write(np.vstack([normal, corners]).astype("<f4").tobytes() + bytes(2))
    return path


@pytest.fixture(scope="session")
def program():
    """The program of the same sources."""
    root = Path(__file__).resolve().parents[2]
    target = Path(os.environ.get("CARGO_TARGET_DIR", root / "target"))
    path = target / "release" / "deepmill"
    if not path.is_file():
        pytest.skip("the program is not built: cargo build --release")
    return path

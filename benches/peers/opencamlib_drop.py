#!/usr/bin/env python3
"""OpenCAMLib's batch drop-cutter on the same part and directions, for comparison with the labeler.

    pip install opencamlib numpy
    python benches/peers/opencamlib_drop.py PART.stl [N_POINTS] [N_DIRS]

For each of the labeler's directions the part is turned so that the direction points up, and a ball cutter
is dropped at the axes of N_POINTS ball centers. That answers "does the cutter's ball and shank hit a
triangle" for a shank of the ball's radius; there is no holder, no spindle and no count of what is in the
way, so it is the easier half of what the labeler computes, with triangles instead of sites. Points are drawn
evenly by area. Binary STL, millimeters; scaled up to 80 mm like data sets.
"""

import math
import sys
import time

import numpy as np
import opencamlib as ocl

from stl import read_binary_stl

CR_MM, LENGTH_MM = 1.5, 500.0


def sample(triangles, n, rng):
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    area = np.linalg.norm(cross, axis=1)
    face = rng.choice(len(triangles), n, p=area / area.sum())
    u, v = np.sqrt(rng.random(n)), rng.random(n)
    weights = np.stack([1 - u, u * (1 - v), u * v], 1)
    return (weights[:, :, None] * triangles[face]).sum(1), cross[face] / area[face, None]


def directions(m):
    k = np.arange(m)
    z = 1 - (k + 0.5) / m
    r, a = np.sqrt(1 - z * z), k * math.pi * (3 - math.sqrt(5))
    return np.stack([r * np.cos(a), r * np.sin(a), z], 1)


def basis(w):
    u = np.cross(w, [1.0, 0.0, 0.0] if abs(w[0]) < 0.9 else [0.0, 1.0, 0.0])
    u /= np.linalg.norm(u)
    return np.stack([u, np.cross(w, u), w])


def main():
    path = sys.argv[1]
    n = int(sys.argv[2]) if len(sys.argv) > 2 else 7000
    m = int(sys.argv[3]) if len(sys.argv) > 3 else 150
    triangles = read_binary_stl(path)
    edge = np.ptp(triangles.reshape(-1, 3), axis=0).min()
    triangles = triangles * max(1.0, 80.0 / edge)
    points, normals = sample(triangles, n, np.random.default_rng(0))
    centers = points + CR_MM * normals
    cutter = ocl.BallCutter(2 * CR_MM, LENGTH_MM)  # kept: the library holds no reference of its own
    total, blocked = 0.0, np.zeros(n, dtype=int)
    for d in directions(m):
        frame = basis(d)
        turned, at = triangles @ frame.T, centers @ frame.T
        surface = ocl.STLSurf()
        for a, b, c in turned:
            surface.addTriangle(ocl.Triangle(ocl.Point(*a), ocl.Point(*b), ocl.Point(*c)))
        start = time.perf_counter()
        drop = ocl.BatchDropCutter()
        drop.setSTL(surface)
        drop.setCutter(cutter)
        for x, y, _ in at:
            drop.appendPoint(ocl.CLPoint(x, y, -1e4))
        drop.run()
        tips = np.array([point.z for point in drop.getCLPoints()])
        total += time.perf_counter() - start
        blocked += tips > at[:, 2] - CR_MM + 1e-3
    print(f"{path}: {len(triangles)} triangles, {n} points, {m} directions")
    print(f"batch drop-cutter: {total:.2f} s; ball and shank collide everywhere at {np.mean(blocked == m):.1%}")


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""A bore that three others cross: which part of its wall tools of its very radius reach from +z, and wider ones.

    pip install manifold3d numpy
    cargo build --release
    python benches/peers/crossed_bores.py DEEPMILL

The block is 40 x 40 x 30 mm, the bore has a radius of 4 mm; the holder is well above the part.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import manifold3d
import numpy as np

from stl import binary_stl, triangles

RADIUS = 4.0
# Height and radius of the bores across, mm.
ACROSS = [(-8.0, 1.5), (0.0, 2.0), (8.0, 1.0)]
HALF_HEIGHT = 15.0
# What is nearer than this to an end of the bore is its rim, mm.
RIM_MM = 1.0


def cylinder(radius, facets):
    return manifold3d.Manifold.cylinder(60.0, radius, radius, facets, True)


def block(facets):
    body = manifold3d.Manifold.cube([40.0, 40.0, 2.0 * HALF_HEIGHT], True) - cylinder(RADIUS, facets)
    for k, (height, radius) in enumerate(ACROSS):
        body -= cylinder(radius, 16).rotate([90.0, 0.0, 30.0 * k]).translate([0.0, 0.0, height])
    return triangles(body)


def reached(program, part, out, cutter):
    command = [program, "label", str(part), "--unit", "mm", "--directions", "up", "--cutter", *cutter, "--out", str(out)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    labels = np.load(out / "labels.npz")
    points, normals = labels["points"], labels["normals"]
    from_axis = np.hypot(points[:, 0], points[:, 1])
    inward = -(normals[:, :2] * points[:, :2]).sum(1) > 0.9 * from_axis
    wall = (from_axis < RADIUS + 1e-3) & inward
    free = ~(labels["inaccessible"] | labels["tip_does_not_fit"]) & wall
    rim = HALF_HEIGHT - np.abs(points[:, 2]) < RIM_MM
    return wall.sum(), free.sum(), (free & ~rim).sum()


def main():
    print("facets  radius  end   sites  reached  off the rim")
    with tempfile.TemporaryDirectory() as folder:
        for facets in (12, 20, 32, 64):
            part = Path(folder, f"crossed{facets}.stl")
            part.write_bytes(binary_stl(block(facets)))
            for radius in (RADIUS, 1.02 * RADIUS, 1.05 * RADIUS):
                for end, corner in (("flat", ["--corner", "0"]), ("ball", [])):
                    cutter = [f"{radius},60,20,40", *corner]
                    n, free, off_rim = reached(sys.argv[1], part, Path(folder, "out"), cutter)
                    print(f"{facets:6}  {radius:6.2f}  {end}  {n:5}  {free:7}  {off_rim:11}")


if __name__ == "__main__":
    main()

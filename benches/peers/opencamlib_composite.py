#!/usr/bin/env python3
"""Drop heights of whole tools by OpenCAMLib against this crate's closed formulas.

    pip install opencamlib numpy
    cargo build --release --example drop_heights
    python benches/peers/opencamlib_composite.py PART.stl... [--points 100] [--directions 20]

A tool is the highest of its elements, as in OpenCAMLib's composite cutters: a ball, bull nose or cylinder for the tip, a
cylinder for each step, one wider than the part for the spindle. `drop_heights` says where the tools stand and how far its
tip and its steps must be raised; here OpenCAMLib drops the same elements at the same places. Binary STL, millimeters.
"""

import argparse
import collections
import subprocess

import numpy as np
import opencamlib as ocl

from stl import read_binary_stl

TOOLS = [("1,20,5,20", 1.0), ("1.5,6,40,5", 1.5), ("2,2,9,5", 0.5), ("1.5,10,10,10", 0.0)]
LENGTH_MM, FLOOR_MM, SPINDLE_MM = 1000.0, -1e4, 4e3
TOLERANCE_MM = 0.01  # as in examples/drop_heights.rs: on both sides tools are shrunk by it


def basis(w):
    u = np.cross(w, [1.0, 0.0, 0.0] if abs(w[0]) < 0.9 else [0.0, 1.0, 0.0])
    u /= np.linalg.norm(u)
    return np.stack([u, np.cross(w, u), w])


def tip_cutter(cr, corner):
    """The cutter, and the height of the reference point above its lower end."""
    radius = cr - TOLERANCE_MM
    if corner == cr:
        return ocl.BallCutter(2 * radius, LENGTH_MM), radius
    if corner == 0:
        return ocl.CylCutter(2 * radius, LENGTH_MM), -TOLERANCE_MM
    return ocl.BullCutter(2 * radius, corner - TOLERANCE_MM, LENGTH_MM), corner - TOLERANCE_MM


def drop(surface, cutter, points):
    batch = ocl.BatchDropCutter()
    batch.setSTL(surface)
    batch.setCutter(cutter)
    for x, y, _ in points:
        batch.appendPoint(ocl.CLPoint(x, y, FLOOR_MM))
    batch.run()
    return np.array([point.z for point in batch.getCLPoints()])


def compare(path, lengths, corner, n_points, n_directions):
    program = ["target/release/examples/drop_heights"]
    command = program + [path, str(n_points), str(n_directions), lengths, str(corner)]
    rows = np.array([
        [float(x) for x in line.split(",")]
        for line in subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
    ])
    cr, ch, fr, fh = (float(x) for x in lengths.split(","))
    first = cr + (cr - corner)
    steps = [(first, cr), (first + ch, fr), (first + ch + fh, SPINDLE_MM)]
    triangles = read_binary_stl(path)
    groups = collections.OrderedDict()
    for row in rows:
        groups.setdefault(tuple(row[:3]), []).append(row)
    differences = []
    for direction, group in groups.items():
        d = np.array(direction) / np.linalg.norm(direction)
        frame, group = basis(d), np.array(group)
        surface = ocl.STLSurf()
        for a, b, c in triangles @ frame.T:
            surface.addTriangle(ocl.Triangle(ocl.Point(*a), ocl.Point(*b), ocl.Point(*c)))
        at = group[:, 3:6] @ frame.T
        cutter, lift = tip_cutter(cr, corner)
        tip = drop(surface, cutter, at)
        tip_raise = np.where(tip > FLOOR_MM, tip + lift - at[:, 2], -np.inf)
        step_raise = np.full(len(at), -np.inf)
        for height, radius in steps:
            cylinder = ocl.CylCutter(2 * (radius - TOLERANCE_MM), LENGTH_MM)
            z = drop(surface, cylinder, at) - height - TOLERANCE_MM
            z = np.where(z > 0.5 * FLOOR_MM, z - at[:, 2], -np.inf)
            step_raise = np.maximum(step_raise, z)
        for ours, theirs in [(group[:, 6], tip_raise), (group[:, 7], step_raise)]:
            same = ours == theirs  # both -inf
            differences.append(np.where(same, 0.0, np.abs(ours - theirs)))
    differences = np.concatenate(differences)
    n = len(differences)
    print(f"{path} {lengths} corner {corner}: {n} heights, greatest difference "
          f"{differences.max():.2e} mm, above 1e-6: {np.sum(differences > 1e-6)}, above 1e-3: {np.sum(differences > 1e-3)}")
    return differences


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("parts", nargs="+")
    parser.add_argument("--points", type=int, default=100)
    parser.add_argument("--directions", type=int, default=20)
    args = parser.parse_args()
    everything = [
        compare(part, lengths, corner, args.points, args.directions)
        for part in args.parts
        for lengths, corner in TOOLS
    ]
    everything = np.concatenate(everything)
    print(f"all: {len(everything)} heights, greatest difference {everything.max():.2e} mm, "
          f"above 1e-6 mm: {np.sum(everything > 1e-6)}")


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
"""The surface that OpenCAMLib's drop-cutter leaves, against the answers of the labeler for +z.

    pip install opencamlib numpy
    python benches/peers/opencamlib_touch.py DEEPMILL PART.stl… [N_SITES]

For flat, ball and bull-nose ends, DEEPMILL labels N_SITES sites of each part for +z alone. Here the tool, shrunk by
the gouge tolerance, is dropped by OpenCAMLib at every place of a grid, and then of a finer one about the best places
of every site. A site is left uncut by the distance of the nearest of all tools there. An accessible site must be cut
to within the finish tolerance and what the grid costs; any other must not be cut closer than the finish tolerance.
Binary STL, millimeters.
"""

import json
import subprocess
import sys
import tempfile

import numpy as np
import opencamlib as ocl

from stl import read_binary_stl

RADIUS, LENGTH = 3.0, 100.0
TOOLS = {"flat": 0.0, "bull nose": 1.0, "ball": 3.0}
SPACING, FINER, BEST = 0.1, 10, 4
# Surfaces that face down by more than this are out of the question.
LEAST_COSINE = 0.1


def label(deepmill, part, corner, n_sites):
    with tempfile.TemporaryDirectory() as out:
        cutter = f"{RADIUS},{LENGTH},{RADIUS + 1},{LENGTH}"
        command = [deepmill, "label", part, "--cutter", cutter, "--directions", "up", "--sites", str(n_sites)]
        command += ["--corner", str(corner), "--no-picture", "--json", "--out", out]
        settings = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        labels = np.load(f"{out}/labels.npz")
        reached = ~(labels["inaccessible"].astype(bool) | labels["tip_does_not_fit"].astype(bool))
        return labels["points"].astype(float), labels["normals"].astype(float), reached, settings


def tool(corner, shrunk):
    """What is left of the tool; its tip is raised by as much."""
    radius, corner = RADIUS - shrunk, max(corner - shrunk, 0.0)
    if corner == 0.0:
        return ocl.CylCutter(2 * radius, LENGTH)
    if corner == radius:
        return ocl.BallCutter(2 * radius, LENGTH)
    return ocl.BullCutter(2 * radius, corner, LENGTH)


def drop(surface, cutter, places):
    batch = ocl.BatchDropCutter()
    batch.setSTL(surface)
    batch.setCutter(cutter)
    for x, y in places:
        batch.appendPoint(ocl.CLPoint(x, y, -1e4))
    batch.run()
    return np.array([point.z for point in batch.getCLPoints()])


def distance(offset, corner):
    """Distance of points from a tool that goes up for ever; `offset` from its tip."""
    across = np.hypot(offset[..., 0], offset[..., 1])
    # The tool is the disc within its corner and all above, grown by the corner.
    beyond, below = np.maximum(across - (RADIUS - corner), 0), np.minimum(offset[..., 2] - corner, 0)
    return np.hypot(beyond, below) - corner


def uncut(surface, cutter, shrunk, corner, points):
    low, high = points.min(0)[:2] - RADIUS - SPACING, points.max(0)[:2] + RADIUS + SPACING
    n = np.ceil((high - low) / SPACING).astype(int) + 1
    x, y = (low[k] + SPACING * np.arange(n[k]) for k in range(2))
    places = np.stack(np.meshgrid(x, y, indexing="ij"), -1)
    tips = (drop(surface, cutter, places.reshape(-1, 2)) - shrunk).reshape(n)
    reach = int(np.ceil((RADIUS + 2 * SPACING) / SPACING))
    steps = np.arange(-reach, reach + 1)
    fine = SPACING / FINER * np.arange(-FINER, FINER + 1)
    fine = np.stack(np.meshgrid(fine, fine, indexing="ij"), -1).reshape(-1, 2)
    best, finer = np.empty(len(points)), []
    for k, p in enumerate(points):
        i, j = (np.clip(np.round((p[a] - low[a]) / SPACING).astype(int) + steps, 0, n[a] - 1) for a in range(2))
        at = places[np.ix_(i, j)].reshape(-1, 2)
        d = distance(p - np.concatenate([at, tips[np.ix_(i, j)].reshape(-1, 1)], 1), corner)
        best[k] = d.min()
        finer.append(at[np.argsort(d)[:BEST], None] + fine)
    at = np.concatenate([f.reshape(-1, 2) for f in finer])
    tips = drop(surface, cutter, at) - shrunk
    d = distance(np.repeat(points, BEST * len(fine), 0) - np.concatenate([at, tips[:, None]], 1), corner)
    return np.minimum(best, d.reshape(len(points), -1).min(1))


def main():
    deepmill, parts = sys.argv[1], [a for a in sys.argv[2:] if not a.isdigit()]
    n_sites = next((int(a) for a in sys.argv[2:] if a.isdigit()), 1000)
    for part in parts:
        surface = ocl.STLSurf()
        triangles = read_binary_stl(part)
        corners = [[ocl.Point(*p) for p in triangle] for triangle in triangles]
        for a, b, c in corners:
            surface.addTriangle(ocl.Triangle(a, b, c))
        for name, corner in TOOLS.items():
            points, normals, reached, settings = label(deepmill, part, corner, n_sites)
            finish, shrunk = settings["finish_mm"], settings["tolerance_mm"]
            of = normals[:, 2] >= -LEAST_COSINE
            points, normals, reached = points[of], normals[of], reached[of]
            left = uncut(surface, tool(corner, shrunk), shrunk, corner, points)
            slack = SPACING / FINER
            missed = left[~reached] < finish - slack
            wrong = left[reached] > finish + slack
            print(
                f"{part} {name}: {len(points)} sites, {reached.mean():.2%} accessible; left at most"
                f" {left[reached].max(initial=0):.3f} mm there, {wrong.sum()} above {finish + slack:.3f};"
                f" elsewhere at least {left[~reached].min(initial=np.inf):.3f} mm, {missed.sum()} below"
                f" {finish - slack:.3f}",
                flush=True,
            )


if __name__ == "__main__":
    main()

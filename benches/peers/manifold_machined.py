#!/usr/bin/env python3
"""The machined part against solids: the part dilated by the tool, then eroded, with manifold3d.

    pip install manifold3d numpy
    python benches/peers/manifold_machined.py DEEPMILL [ACCURACY]

Along +z a tool without a holder that comes down everywhere leaves the closing of the part by the tool, continued
upward: the part, dilated by the reflected tool, is where the reference point may not be; what the tool never covers
then is left. Here both steps are Minkowski sums of solids. Parts of few triangles, a ball of N_AROUND facets around
and an end mill; volumes within the stock's box, mm^3.
"""

import json
import subprocess
import sys
import tempfile
import time

import numpy as np
from manifold3d import CrossSection, Manifold

from stl import binary_stl, triangles

N_AROUND = 24
HIGH = 80.0


def box(low, high):
    low, high = np.array(low, float), np.array(high, float)
    return Manifold.cube(high - low).translate(low)


def parts():
    block = box([0, 0, 0], [40, 30, 20])
    yield "pocket", block - box([10, 8, 10], [30, 22, 25])
    yield "slot 4 wide", block - box([-1, 13, 10], [41, 17, 25])
    yield "angle", box([0, 0, 0], [40, 30, 10]) + box([0, 0, 0], [10, 30, 30])
    bore = Manifold.cylinder(30, 4.0, 4.0, 64).translate([20, 15, 8])
    yield "blind bore R4", block - bore
    wedge = CrossSection([[[12, 5], [28, 5], [20, 25]]]).extrude(30)
    yield "triangular pocket", block - wedge.translate([0, 0, 9])


def tools():
    """Name, arguments, and the solid about the reference point, reaching far up."""
    r = 3.0
    turned = [[r * np.sin(a), -r * np.cos(a)] for a in np.linspace(0, np.pi / 2, N_AROUND // 4 + 1)]
    outline = [[0.0, -r], *turned[1:], [r, HIGH], [0.0, HIGH]]
    yield "ball R3", [], Manifold.revolve(CrossSection([outline]), N_AROUND)
    yield "flat R3", ["--corner", "0"], Manifold.cylinder(HIGH, r, r, N_AROUND)


def left_by_solids(part, tool):
    low, high = np.array(part.bounding_box()).reshape(2, 3)
    stock = box(low, high)
    # Dilated by the reflected tool, then eroded: what no place of the tool covers.
    blocked = part.minkowski_sum(tool.scale([-1, -1, -1]))
    around = box(low - [10, 10, 10], high + [10, 10, 10 + HIGH])
    free = around - blocked
    removed = free.minkowski_sum(tool)
    return (stock - part - removed).volume(), (stock - part).volume()


def left_by_deepmill(deepmill, part, arguments, accuracy):
    with tempfile.TemporaryDirectory() as folder:
        with open(f"{folder}/part.stl", "wb") as file:
            file.write(binary_stl(triangles(part)))
        command = [deepmill, "machined", f"{folder}/part.stl", "--cutter", "3,60,3,60", "--directions", "up"]
        command += ["--accuracy", str(accuracy), "--no-picture", "--json", "--out", folder, *arguments]
        return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)["left_mm3"]


def main():
    deepmill, accuracy = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else 0.2
    print("part, tool, to remove, left by solids, by deepmill, difference as a share of accuracy x surface, seconds")
    for name, part in parts():
        for tool_name, arguments, tool in tools():
            start = time.time()
            solids, to_remove = left_by_solids(part, tool)
            seconds = time.time() - start
            ours = left_by_deepmill(deepmill, part, arguments, accuracy)
            share = abs(ours - solids) / (accuracy * part.surface_area())
            print(f"{name}, {tool_name}, {to_remove:.1f}, {solids:.1f}, {ours:.1f}, {share:.4f}, {seconds:.1f}")


if __name__ == "__main__":
    main()

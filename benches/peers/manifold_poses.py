#!/usr/bin/env python3
"""Poses of tools given by their profile, against solids of revolution that manifold3d intersects with the part.

    pip install manifold3d numpy
    cargo build --release --example free_poses
    python benches/peers/manifold_poses.py DEEPMILL FREE_POSES [PART.stl…]

Of four made parts, and of those given, N_POSES random poses each, shared among the tools: a place of the cutting
profile touches a random place of the surface with the opposite normal, in a random direction, and is moved along the
normal by up to NEAR. A pose is free iff nothing of the part is deeper in the tool than TOLERANCE: iff the tool, eroded
by that, does not intersect the part. Two solids hold it: eroded by BAND more, its polygons within the circles, and by
BAND less, its polygons about them. Where the first intersects, the pose is not free; where the second does not, it is;
what is between is the facets' thickness. Profiles are read and eroded here, from their text. Parts that are given are closed
solids, binary STL, millimeters.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from manifold3d import CrossSection, FillRule, JoinType, Manifold, Mesh

from stl import binary_stl, read_binary_stl, triangles

N_POSES, N_AROUND = 2000, 128
TOLERANCE, BAND, NEAR = 0.05, 0.002, 0.6
CHORD, NONE = 5e-4, 1e-9
HIGH, WIDE = 400.0, 300.0
# Of the holder: height of the nose above the tip, its height and radius.
STICK_OUT, HOLDER = 32.0, (30.0, 12.0)
TOOLS = {
    "lollipop": f"0:0 1.5:{3 + 6.75**0.5:.9f}@0:3 | 1.5:20 3:22",
    "T-slot": "6:0 6:3 2.5:3 | 2.5:22 4:22",
    "barrel": f"{364**0.5 - 16:.9f}:0 {364**0.5 - 16:.9f}:12@-16:6 | 2.5:12 2.5:30",
    "dovetail": f"8:0 {8 - 12**0.5:.9f}:6 3:6 | 3:30 6:30",
    "hollow flank": "2:0 6:4@6:0 | 6:12 2:12 2:30",
}


def profile(text):
    """Corners of radius and height, arcs in chords, and pieces that cut: two ends and the angle of the normal of each."""
    points, pieces, cuts = [], [], True
    for word in text.split():
        if word == "|":
            cuts = False
            continue
        word, _, center = word.partition("@")
        end = np.array(word.split(":"), float)
        if not points:
            points.append(np.zeros(2))
        start, chain = points[-1], [end]
        if center:
            middle = np.array(center.split(":"), float)
            a, b = start - middle, end - middle
            radius, turn = np.hypot(*a), np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b)
            n = int(np.ceil(abs(turn) / (2 * np.arccos(1 - CHORD / radius))))
            angles = np.arctan2(a[1], a[0]) + turn * np.arange(1, n) / n
            chain = [middle + radius * np.array([np.cos(t), np.sin(t)]) for t in angles] + [end]
        for point in chain:
            run = point - points[-1]
            if cuts and np.hypot(*run) > 0:
                pieces.append((points[-1], point, np.arctan2(-run[0], run[1])))
            points.append(point)
    return points, pieces


def eroded(points, by, about):
    """The tool in its holder, eroded; its circles within polygons if `about`."""
    held = [p for p in points if p[1] < STICK_OUT]
    held.append(np.array([points[-1][0], STICK_OUT]))
    nose, radius = HOLDER
    spindle = STICK_OUT + nose
    held += [np.array(p) for p in [(radius, STICK_OUT), (radius, spindle), (WIDE, spindle), (WIDE, HIGH)]]
    right = [p for p in held if p[0] > 0]
    outline = [(p[0], p[1]) for p in right] + [(-p[0], p[1]) for p in reversed(right)]
    if held[0][0] == 0 and held[1][0] > 0 and held[1][1] > held[0][1]:
        outline.append((0.0, held[0][1]))
    section = CrossSection([outline], FillRule.NonZero).offset(-by, JoinType.Round, 2.0, 64)
    half = section ^ CrossSection([[(0, -1), (WIDE + 1, -1), (WIDE + 1, HIGH + 1), (0, HIGH + 1)]])
    wider = 1 / np.cos(np.pi / N_AROUND) if about else 1.0
    return Manifold.revolve(half.scale((wider, 1.0)), N_AROUND)


def box(low, high):
    low, high = np.array(low, float), np.array(high, float)
    return Manifold.cube(high - low).translate(low)


def parts(files):
    block = box([0, 0, 0], [60, 40, 40])
    yield "T-slot", block - box([24.5, -1, 28], [35.5, 41, 41]) - box([19.5, -1, 19], [40.5, 41, 28])
    groove = Manifold.cylinder(8, 12, 12, 96).translate([30, 20, 12])
    yield "grooved bore", block - Manifold.cylinder(41, 8, 8, 96).translate([30, 20, 8]) - groove
    plate = box([0, 0, 0], [60, 40, 12]) + Manifold.cylinder(20, 6, 4, 64).translate([14, 14, 11])
    yield "plate with bosses", plate + box([30, 8, 11], [52, 14, 26]) - box([34, 20, 5], [54, 34, 13])
    rim = Manifold.cylinder(10, 26, 26, 96) + Manifold.cylinder(10, 26, 26, 96).translate([0, 0, 24])
    yield "spool", rim + Manifold.cylinder(30, 10, 14, 96)
    for file in files:
        corners = np.asarray(read_binary_stl(file), np.float32).reshape(-1, 3)
        vertices, index = np.unique(corners, axis=0, return_inverse=True)
        solid = Manifold(Mesh(vertices, index.reshape(-1, 3).astype(np.uint32)))
        assert not solid.is_empty(), f"{file} is no solid: {solid.status()}"
        yield file.rsplit("/", 1)[-1], solid


def random_pose(random, corners, areas, pieces):
    """Direction from the tip to the holder, and the tip."""
    a, b, c = corners[random.choice(len(corners), p=areas)].astype(float)
    u, v = random.random(2)
    u, v = (1 - u, 1 - v) if u + v > 1 else (u, v)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal)
    lengths = np.array([np.hypot(*(q - p)) for p, q, _ in pieces])
    low, high, angle = pieces[random.choice(len(pieces), p=lengths / lengths.sum())]
    radius, height = low + (high - low) * random.random()
    across = random.normal(size=3)
    across -= normal * (across @ normal)
    across /= np.linalg.norm(across)
    # cos·out + sin·direction is the opposite of the normal.
    direction = -np.sin(angle) * normal + np.cos(angle) * across
    out = -np.cos(angle) * normal - np.sin(angle) * across
    site = a + u * (b - a) + v * (c - a) + normal * random.uniform(-NEAR, NEAR)
    direction = direction.astype(np.float32).astype(float)
    return direction / np.linalg.norm(direction), site - (radius * out + height * direction)


def turned(solid, direction, tip):
    other = np.eye(3)[np.argmin(np.abs(direction))]
    x = np.cross(other, direction)
    x /= np.linalg.norm(x)
    return solid.transform(np.column_stack([x, np.cross(direction, x), direction, tip]))


def free_by_program(folder, deepmill, free_poses, corners, poses):
    rows = [f"{k},{name},{text},{STICK_OUT}" for k, (name, text) in enumerate(TOOLS.items())]
    files = {"shop.csv": "T,name,profile,stick_out\n" + "\n".join(rows) + "\n"}
    files["holder.csv"] = "height,lower,upper\n{0},{1},{1}\n".format(HOLDER[0], 2 * HOLDER[1])
    for name, text in files.items():
        with open(f"{folder}/{name}", "w") as file:
            file.write(text)
    command = [deepmill, "tools", "--library", f"{folder}/shop.csv", "--holder", f"{folder}/holder.csv"]
    command += ["--export", "csv", "--strict", "--out", f"{folder}/tools"]
    subprocess.run(command, check=True, capture_output=True)
    Path(folder, "part.stl").write_bytes(binary_stl(corners))
    lines = [" ".join([str(k), *(repr(float(x)) for x in [*d, *tip])]) for k, d, tip in poses]
    command = [free_poses, f"{folder}/part.stl", f"{folder}/tools/library.csv", str(TOLERANCE)]
    run = subprocess.run(command, input="\n".join(lines), check=True, capture_output=True, text=True)
    return [line == "1" for line in run.stdout.split()]


def main():
    deepmill, free_poses, *files = sys.argv[1:]
    profiles = [profile(text) for text in TOOLS.values()]
    more = [eroded(points, TOLERANCE + BAND, False) for points, _ in profiles]
    less = [eroded(points, TOLERANCE - BAND, True) for points, _ in profiles]
    random, failed = np.random.default_rng(1), 0
    print("part, tool: poses free in both, not free in both, within the facets' thickness, disagreements")
    for name, part in list(parts(files)):
        corners = triangles(part)
        sides = corners.astype(float)
        areas = np.linalg.norm(np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]), axis=1)
        areas /= areas.sum()
        poses = []
        for i in range(N_POSES):
            k = i % len(TOOLS)
            poses.append((k, *random_pose(random, corners, areas, profiles[k][1])))
        with tempfile.TemporaryDirectory() as folder:
            found = free_by_program(folder, deepmill, free_poses, corners, poses)
        counts = np.zeros((len(TOOLS), 4), int)
        for (k, direction, tip), is_free in zip(poses, found):
            hits = [(turned(solid[k], direction, tip) ^ part).volume() > NONE for solid in (more, less)]
            decided = hits[0] == hits[1]
            agrees = is_free != hits[0]
            counts[k, 2 if not decided else 3 if not agrees else 0 if is_free else 1] += 1
            if decided and not agrees:
                print("disagrees:", name, list(TOOLS)[k], direction.tolist(), tip.tolist(), is_free)
        for tool, row in zip(TOOLS, counts):
            print(f"{name}, {tool}: {', '.join(map(str, row))}")
        print(f"{name}: {', '.join(map(str, counts.sum(axis=0)))}", flush=True)
        failed += counts[:, 3].sum()
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()

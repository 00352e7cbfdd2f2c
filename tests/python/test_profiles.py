"""Tools given by their profile as arrays."""

import math
import subprocess

import deepmill
import numpy as np
import pytest
from conftest import solid

NONE = [math.nan, math.nan]
LOLLIPOP = "0:0 1.5:5.598076211353316@0:3 | 1.5:20 3:22"
HOLDER = [[20, 15, 15], [30, 20, 25]]


def lollipop(**options):
    points = [[0, 0], [1.5, 3 + math.sqrt(6.75)], [1.5, 20], [3, 22]]
    arcs = np.array([[0, 3], NONE, NONE])
    return deepmill.Tool.from_profile(points, 40, HOLDER, arcs=arcs, cuts=[True, False, False], **options)


@pytest.fixture(scope="module")
def slotted():
    """A block with a T-slot along y: 5 mm wide, below z = 10 for 5 mm 15 mm wide."""
    occupied = np.ones((7, 6, 4), dtype=bool)
    occupied[3, :, 1:] = False
    occupied[2:5, :, 1] = False
    return deepmill.Mesh(*solid(occupied, 5.0), name="slotted.stl")


def test_arrays_and_text_are_the_same_profile():
    tool = lollipop(name="ball 6")
    assert tool.name == "ball 6" and tool.profile == LOLLIPOP and tool.stick_out_mm == 40
    assert deepmill.Tool.from_profile(LOLLIPOP, 40, HOLDER).profile == LOLLIPOP
    assert deepmill.Tool("3,20,20,20").profile is None
    order = np.asfortranarray(np.array([[10.5, 0], [10.5, 9], [5, 9], [5, 40]], dtype=np.float32))
    disc = deepmill.Tool.from_profile(order, 60, HOLDER, cuts=np.array([True, True, False]), clearance=0.1)
    assert disc.profile == "10.5:0 10.5:9 5:9 | 5:40" and disc.clearance_mm == 0.1
    drill = deepmill.Tool.from_profile([[0, 0], [2.5, 1.5], [2.5, 40]], 50, HOLDER, drill=True, overall=80)
    assert drill.profile == "drill 0:0 2.5:1.5 2.5:40"


def test_a_disc_reaches_the_undercut_that_no_straight_tool_reaches(slotted):
    disc = deepmill.Tool.from_profile(
        [[7, 0], [7, 4], [2, 4], [2, 30]], 30, [[20, 15, 15]], cuts=[True, True, False], name="T"
    )
    outcome = deepmill.analyze(slotted, [disc, "2,26,15,20"], sites=3000, directions="up")
    (x, y, z), down = outcome.points.T, outcome.normals[:, 2] < -0.5
    # Faces that look down above the wide part of the slot; beyond 7 mm from its middle, 17.5 mm, the disc cannot be.
    undercut = down & (abs(z - 10) < 1e-3)
    assert undercut.sum() > 50 and (abs(x[undercut] - 17.5) <= 7.5).all()
    assert outcome["T"].accessible[undercut].mean() > 0.9
    assert not outcome[1].accessible[undercut].any()
    # Under the block its upper face comes as far in as it is wider than its neck, 5 mm.
    from_edges = np.minimum(np.minimum(x, 35 - x), np.minimum(y, 30 - y))
    below = down & (z < 1e-3)
    assert not outcome["T"].accessible[below & (from_edges > 5.2)].any()
    assert outcome["T"].accessible[below & (from_edges < 4.8)].mean() > 0.9


def test_answers_are_those_of_the_program(program, stl, tmp_path):
    (tmp_path / "tools.csv").write_text(f"name,profile,stick_out\nL6,{LOLLIPOP},40\n")
    (tmp_path / "holder.csv").write_text("height,lower,upper\n20,30,30\n30,40,50\n")
    arguments = ["--tools", tmp_path / "tools.csv", "--holder", tmp_path / "holder.csv", "--sites", 800, "--no-picture"]
    command = [program, "label", stl, *map(str, arguments), "--directions", "20", "--out", tmp_path / "out"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    file = np.load(tmp_path / "out" / "L6" / "labels.npz", allow_pickle=False)
    outcome = deepmill.analyze(deepmill.Mesh.read(stl), lollipop(), sites=800, directions=20)
    assert np.array_equal(file["inaccessible"], outcome[0].inaccessible)
    assert np.array_equal(file["points"], outcome.points)
    assert outcome[0].inaccessible.any() and not outcome[0].inaccessible.all()

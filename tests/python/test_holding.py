"""What holds the part in setups: as the program answers, and as computed by hand."""

import deepmill
import numpy as np
import pytest
from conftest import solid
from test_same_bits import assert_same, run


@pytest.fixture(scope="module")
def block():
    return deepmill.Mesh(*solid(np.ones((4, 3, 2), dtype=bool), 10.0), name="block.stl")


def setups(mesh, **options):
    return deepmill.setups(mesh, "2,40,10,20", "3-axis", sites=1500, **options)


def test_a_vise_has_the_bytes_of_the_program(program, stl, tmp_path):
    arguments = ["--cutter", "2,20,20,20", "--machine", "3-axis", "--sites", 600, "--setups", 2]
    arguments += ["--vise", "60,60,5,20", "--table", "25,300"]
    run(program, "setups", stl, *arguments, "--out", tmp_path / "a")
    outcome = deepmill.setups(
        deepmill.Mesh.read(stl), "2,20,20,20", "3-axis", sites=600, at_most=2, vise=(60, 60, 5, 20), table=[25, 300]
    )
    outcome.save(tmp_path / "b")
    assert_same(tmp_path / "b", tmp_path / "a")
    assert all("vise" in setup["held_by"] for setup in outcome.setups)


def heights_of_sides(outcome):
    """Of the sites on upright faces: height, and whether a setup reaches it."""
    upright = abs(outcome.normals[:, 2]) < 0.5
    return outcome.points[upright, 2], outcome.first[upright] >= 0


def test_a_table_keeps_a_ball_off_the_sides_below_its_radius(block):
    free, held = setups(block, given="+z"), setups(block, given="+z", table=0)
    # Nothing but the underside is out of reach: 40 x 30 of 2 (40 x 30 + 40 x 20 + 30 x 20) mm².
    assert free.reached_share == pytest.approx(1 - 1200 / 5200, abs=0.002)
    height, reached = heights_of_sides(held)
    # The ball of radius 2 stands on the table: its equator is at 2 mm. At 1.7 mm it would leave 0.0225 mm.
    assert reached[height >= 2].all() and not reached[height < 1.7].any() and (height < 1.7).sum() > 20
    assert held.setups[0]["held_by"] == "table" and free.setups[0]["held_by"] is None
    lower, reached = heights_of_sides(setups(block, given="+z", table=(5, 200)))
    assert reached.all()


def test_fixtures_are_of_all_setups_or_of_one(block):
    corners, triangles = solid(np.ones((1, 1, 1), dtype=bool), 10.0)
    lid = deepmill.Mesh(corners * [6, 5, 1] + [-10, -10, 20], triangles, name="lid")
    both = setups(block, given=["+z", "-z"], fixtures=[lid])
    one = setups(block, given=["+z", "-z"], fixtures=[(1, lid)])
    free = setups(block, given=["+z", "-z"])
    assert free.reached_share == pytest.approx(1)
    # The lid covers all of the upper face and is 10 mm wider: no setup reaches the face; the sides are reached from
    # below, but for what a ball of radius 2 does not reach above the lid.
    assert (both.first[both.normals[:, 2] > 0.5] < 0).all() and (both.first[both.normals[:, 2] < -0.5] == 1).all()
    height, reached = heights_of_sides(both)
    assert reached[height <= 18].all() and not reached[height > 18.3].any()
    # The first setup reaches nothing at all then; the second, without the lid, all but the upper face.
    assert (one.first != 0).all() and (one.first[one.normals[:, 2] < 0.5] == 1).all()
    assert "lid" in one.setups[0]["held_by"] and not one.setups[1]["held_by"]
    assert one.setups[0]["kept_out"] == pytest.approx(1 - 1200 / 5200, abs=0.002)
    assert not one.setups[1]["kept_out"]

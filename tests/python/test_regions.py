"""Answers about chosen faces: every way to choose them names the same region."""

import types

import deepmill
import numpy as np
import pytest

# The block of 40 x 30 x 20 mm has a pocket over x and y from 10 to 20, down to z = 5.
FLOOR, WALLS, PART = 100.0, 600.0, 5800.0


def of_pocket(mesh):
    """The triangles of floor and walls."""
    middle = mesh.vertices[mesh.triangles].mean(axis=1)
    across, along = middle[:, 0], middle[:, 1]
    return (across >= 10) & (across <= 20) & (along >= 10) & (along <= 20) & (middle[:, 2] > 1)


def analyze(mesh, **options):
    return deepmill.analyze(mesh, "2,5,20,20", sites=400, directions=20, search=0, **options)


def area(mesh, **options):
    region = analyze(mesh, **options).region
    assert region["part_area_mm2"] == pytest.approx(PART)
    return region["area_mm2"]


def test_boxes_and_normals_hold_the_areas_computed_by_hand(mesh):
    assert area(mesh, only="box:10,10,1,20,20,20") == pytest.approx(FLOOR + WALLS)
    assert area(mesh, only="box:10,10,1,20,20,10") == pytest.approx(FLOOR + 4 * 10 * 5)
    assert area(mesh, only=["box:10,10,1,20,20,20", "normal:0,0,1"]) == pytest.approx(1200 + WALLS)
    assert area(mesh, except_="box:10,10,1,20,20,20") == pytest.approx(PART - FLOOR - WALLS)
    assert area(mesh, only="box:10,10,1,20,20,20", except_=("normal:0,0,1",)) == pytest.approx(WALLS)
    assert analyze(mesh).region is None and analyze(mesh, only=(), except_=[]).region is None


def test_triangles_are_chosen_by_rows_by_marks_and_by_meshes(mesh):
    marks = of_pocket(mesh)
    open_mesh = types.SimpleNamespace(vertices=mesh.vertices, faces=mesh.triangles[marks])
    rows = np.flatnonzero(marks)
    forced = deepmill.Mesh(mesh.vertices, mesh.triangles[marks], force=True, name="pocket")
    for only in [marks, rows, rows.astype(np.uint16), rows[::-1], [rows[:3], rows[3:]], open_mesh, forced]:
        outcome = analyze(mesh, only=only)
        assert outcome.region["area_mm2"] == pytest.approx(FLOOR + WALLS)
        assert marks[outcome.faces].all()
    assert analyze(mesh, only=marks).region["only"] == [f"{len(rows)} of {len(marks)} triangles"]
    assert analyze(mesh, except_=forced).region["except"] == ["faces:pocket"]


def test_areas_shares_and_findings_are_of_the_region_and_all_of_the_part_blocks(mesh):
    whole = deepmill.analyze(mesh, "2,5,20,20", sites=4000, directions="up")
    of_floor = deepmill.analyze(mesh, "2,5,20,20", sites=400, directions="up", only="box:10,10,1,20,20,5.5")
    assert of_floor.area_shares.sum() == pytest.approx(1)
    assert of_floor.surface_mm2 == pytest.approx(FLOOR + 4 * 10 * 0.5)
    # The holder, of radius 20, would have to enter the pocket: 9 mm of tool for 15 mm of depth.
    assert of_floor[0].inaccessible.all() and whole[0].inaccessible[of_pocket(mesh)[whole.faces]].mean() > 0.3
    assert sum(finding["area_mm2"] for finding in of_floor.findings) == pytest.approx(of_floor.surface_mm2)


def test_findings_of_a_folder_are_a_region(mesh, tmp_path):
    first = deepmill.analyze(mesh, "2,5,20,20", sites=2000, directions="up", except_="normal:0,0,-1")
    first.save(tmp_path, pictures=False)
    again = analyze(mesh, only=f"findings:{tmp_path}")
    assert again.region["area_mm2"] == pytest.approx(sum(f["area_mm2"] for f in first.findings), rel=0.1)


def test_places_are_those_of_a_part_far_from_the_origin(pocket):
    vertices, triangles = pocket
    far = deepmill.Mesh(vertices + [1e6, 0, 0], triangles)
    assert far.origin_mm is not None
    assert area(far, only="box:1000010,10,1,1000020,20,20") == pytest.approx(FLOOR + WALLS)
    marks = of_pocket(deepmill.Mesh(*pocket))
    chosen = types.SimpleNamespace(vertices=vertices + [1e6, 0, 0], faces=triangles[marks])
    assert area(far, only=chosen) == pytest.approx(FLOOR + WALLS)
    assert area(far, only=marks) == pytest.approx(FLOOR + WALLS)

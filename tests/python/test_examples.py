"""Examples of docstrings and of the guide run, and the module is whole."""

import doctest
import re
from pathlib import Path

import deepmill
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]


def documented():
    yield "deepmill", deepmill.__doc__
    for name in deepmill.__all__:
        item = getattr(deepmill, name)
        yield name, item.__doc__
        for member in vars(item) if isinstance(item, type) else []:
            if not member.startswith("_"):
                yield f"{name}.{member}", getattr(item, member).__doc__


def test_examples_of_docstrings_give_what_they_state():
    runner, parser = doctest.DocTestRunner(), doctest.DocTestParser()
    n_examples = 0
    for name, text in documented():
        example = parser.get_doctest(text or "", {}, name, None, 0)
        n_examples += len(example.examples)
        runner.run(example)
    assert n_examples > 20 and runner.summarize(verbose=False).failed == 0


def test_every_public_item_has_a_docstring():
    missing = [name for name, text in documented() if not text and not name.startswith(("__version__", "Error."))]
    assert not missing


def blocks():
    text = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    return [block for block in re.findall(r"```python\n(.*?)```", text, re.S) if "import deepmill\n" in block]


@pytest.mark.parametrize("block", blocks(), ids=lambda block: block.splitlines()[-1][:40])
def test_the_guide_runs(block, stl, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "part.stl").write_bytes(stl.read_bytes())
    exec(compile(block, "docs/python.md", "exec"), {})


def test_octrees_are_consistent():
    points = np.random.default_rng(1).random((500, 3)) * 30
    up = np.tile([0.0, 0.0, 1.0], (500, 1))
    tree = deepmill.Octree([(points, up), deepmill.Sites(points[:200], up[:200])], depth=4)
    assert len(tree) == 5 and tree.point_ranges == [(0, 500), (500, 700)]
    assert np.abs(tree.points).max() <= 1 and tree.scales.shape == (2,)
    for level in (tree[depth] for depth in range(5)):
        n = len(level)
        assert np.array_equal(level.neighbors[:, 13], np.arange(n))
        assert (np.diff(level.keys.astype(np.int64)) > 0).all()
        assert np.array_equal(np.flatnonzero(level.children >= 0), level.nonempty)
        here, there = np.nonzero(level.neighbors >= 0)
        assert np.array_equal(level.neighbors[level.neighbors[here, there], 26 - there], here)
    nodes = tree[4].nonempty[tree.node_of_point]
    clouds = tree[4].keys[nodes] >> np.uint64(48)
    assert np.array_equal(clouds, [0] * 500 + [1] * 200)
    with pytest.raises(IndexError):
        tree[5]


def test_samples_repeat_and_are_labeled_by_the_published_definition(mesh):
    first, again = (next(deepmill.online([mesh], seed=5, sites=400)) for _ in range(2))
    assert np.array_equal(first.points, again.points) and np.array_equal(first.inaccessible, again.inaccessible)
    exact = deepmill.analyze(
        deepmill.Sites(first.points, first.normals), deepmill.Tool(first.cutter_mm), directions="published"
    )[0]
    assert np.array_equal(exact.inaccessible, first.inaccessible)
    assert np.array_equal(exact.occlusion, first.occlusion)
    assert exact.tip_does_not_fit is None and first.cutter_mm.shape == (4,)


def test_a_part_far_from_the_origin_is_labeled_about_a_local_one(pocket, mesh):
    shift = np.array([1e5, 0, 2e4])
    far = deepmill.Mesh(pocket[0] + shift, pocket[1], name=mesh.name)
    clamp = deepmill.Mesh(pocket[0] + np.array([0, 0, 21.0]), pocket[1], name="clamp")
    far_clamp = deepmill.Mesh(clamp.vertices + shift, clamp.triangles, name="clamp")
    near = deepmill.analyze(mesh, "2,10,20,20", sites=500, fixtures=[clamp], table=-1)
    moved = deepmill.analyze(far, "2,10,20,20", sites=500, fixtures=[far_clamp], table=2e4 - 1)
    assert mesh.origin_mm is None and moved.mesh is far and np.abs(far.origin_mm - shift).max() < 100
    assert any("far from the origin" in notice for notice in moved.notices) and not near.notices
    assert np.abs(moved.points + far.origin_mm - shift - near.points).max() < 1e-2
    assert (moved[0].accessible == near[0].accessible).mean() > 0.99


def test_what_was_changed_of_a_part_is_among_the_notices(pocket):
    class Inward:
        vertices, faces = pocket[0], pocket[1][:, ::-1]

    outcome = deepmill.analyze(Inward(), "2,10,20,20", sites=200)
    assert any("turned" in notice for notice in outcome.notices) and outcome.mesh.notices == outcome.notices
    assert outcome.mesh.volume_mm3 > 0 and outcome.faces.max() < len(outcome.mesh.faces)


def test_outcomes_are_read_back_from_their_folder(mesh, tmp_path):
    clamp = deepmill.Mesh([[0, 0, 20.5], [20, 0, 20.5], [0, 20, 20.5], [0, 0, 40]],
                          [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], name="clamp")
    tools = ["2,10,20,20", deepmill.Tool("3,20,20,20", kind="flat")]
    outcome = deepmill.analyze(mesh, tools, sites=300, fixtures=[clamp], table=1, rest=True)
    outcome.save(tmp_path)
    read = deepmill.read_outcome(str(tmp_path))
    assert read.warnings == outcome.warnings and read.notices == outcome.notices
    assert [finding for finding in read.findings] == [finding for finding in outcome.findings]
    assert (read.mesh.vertices == mesh.vertices).all() and read.part == outcome.part
    for of, was in zip(read, outcome):
        assert of.tool.name == was.tool.name and of.findings == was.findings
        assert (of.inaccessible == was.inaccessible).all() and (of.rest_mm == was.rest_mm).all()
    with pytest.raises(deepmill.FileError, match="outcome.npz"):
        deepmill.read_outcome(tmp_path / "elsewhere")


def test_fixtures_and_tables_block(mesh):
    clamp = deepmill.Mesh([[0, 0, 0], [20, 0, 0], [0, 20, 0], [0, 0, 20]] + np.array([5.0, 5.0, 20.0]),
                          [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], name="clamp")
    free = deepmill.analyze(mesh, "2,10,20,20", sites=800)[0]
    held = deepmill.analyze(mesh, "2,10,20,20", sites=800, fixtures=[clamp], table=0)
    assert held[0].accessible.sum() < free.accessible.sum()
    assert any(finding["fixture"] for finding in held[0].findings)

"""What Python computes and writes is what the program computes and writes."""

import io
import subprocess
import zipfile

import deepmill
import numpy as np
import pytest


def run(program, *arguments):
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def files(folder):
    return {path.relative_to(folder).as_posix(): path for path in folder.rglob("*") if path.is_file()}


def assert_same(ours, theirs):
    assert files(ours).keys() == files(theirs).keys()
    for name, path in files(theirs).items():
        assert path.read_bytes() == files(ours)[name].read_bytes(), name


def arrays(path):
    archive = zipfile.ZipFile(path)
    names = [name for name in archive.namelist() if name.endswith(".npy")]
    return {name[:-4]: np.load(io.BytesIO(archive.read(name))) for name in names}


CASES = [
    (["--cutter", "3,20,20,20"], lambda: "3,20,20,20", {}),
    (
        ["--cutter", "3,10,20,20", "--corner", "0", "--directions", "cone:60:80", "--seed", "7", "--occlusion"],
        lambda: deepmill.Tool("3,10,20,20", kind="flat"),
        {"directions": "cone:60:80", "seed": 7, "occlusion": True},
    ),
    (
        ["--cutter", "2,5,20,20", "--cutter", "1,12,10,20", "--table", "-1", "--clearance-limit", "2", "--search", "0", "--rest"],
        lambda: ["2,5,20,20", "1,12,10,20"],
        {"table": -1, "clearance_limit": 2, "search": 0, "rest": True},
    ),
    (
        ["--cutter", "1.5,6,40,5", "--obstacles", "published"],
        lambda: "1.5,6,40,5",
        {"obstacles": "published"},
    ),
    (
        ["--cutter", "1.5,6,40,5", "--smooth=30", "--tolerance", "0.02", "--finish", "0.1", "--allowance", "0.3"],
        lambda: "1.5,6,40,5",
        {"smooth": 30, "tolerance": 0.02, "finish": 0.1, "allowance": 0.3},
    ),
    (
        [
            "--cutter", "2,5,20,20",
            "--only", "box:10,10,1,20,20,10", "--only", "normal:0,0,1", "--except", "normal:1,0,0:5",
        ],
        lambda: "2,5,20,20",
        {"only": ["box:10,10,1,20,20,10", "normal:0,0,1"], "except_": "normal:1,0,0:5"},
    ),
]


@pytest.mark.parametrize(("arguments", "tools", "options"), CASES)
def test_folders_of_labels_have_the_bytes_of_the_program(program, stl, tmp_path, arguments, tools, options):
    run(program, "label", stl, *arguments, "--sites", 1500, "--report", "--also", "csv", "--out", tmp_path / "program")
    outcome = deepmill.analyze(deepmill.Mesh.read(stl), tools(), sites=1500, **options)
    paths = outcome.save(tmp_path / "python", report=True, also="csv")
    assert_same(tmp_path / "python", tmp_path / "program")
    assert {path.name for path in paths} == {path.name for path in files(tmp_path / "python").values()}
    page = outcome.report(tmp_path / "alone.html")
    assert page.read_bytes() == (tmp_path / "program" / "report.html").read_bytes()


def test_arrays_are_those_of_the_file(program, stl, tmp_path):
    options = ["--cutter", "2,5,20,20", "--sites", 1500, "--occlusion", "--no-picture"]
    run(program, "label", stl, *options, "--out", tmp_path)
    outcome = deepmill.analyze(deepmill.Mesh.read(stl), "2,5,20,20", sites=1500, occlusion=True)
    file, answers = arrays(tmp_path / "labels.npz"), outcome[0]
    for name in ["points", "normals", "faces"]:
        assert np.array_equal(file[name], getattr(outcome, name)), name
    for name in ["inaccessible", "tip_does_not_fit", "occlusion", "accessible_directions"]:
        assert np.array_equal(file[name], getattr(answers, name)), name
    assert answers.inaccessible.any() and not answers.inaccessible.all()


def test_arrays_in_answer_as_the_file_does(stl, pocket, mesh):
    of_file = deepmill.analyze(deepmill.Mesh.read(stl), "2,5,20,20", sites=1500)
    of_arrays = deepmill.analyze(mesh, "2,5,20,20", sites=1500)

    class LikeTrimesh:
        vertices, faces = pocket

    of_object = deepmill.analyze(LikeTrimesh(), "2,5,20,20", sites=1500)
    for other in [of_arrays, of_object]:
        assert (of_file[0].inaccessible == other[0].inaccessible).mean() > 0.999
        assert other.surface_mm2 == pytest.approx(of_file.surface_mm2)


def test_setups_and_tools_have_the_bytes_of_the_program(program, stl, tmp_path):
    options = ["--cutter", "2,20,20,20", "--machine", "3-axis", "--sites", 800, "--except", "normal:0,0,-1"]
    run(program, "setups", stl, *options, "--out", tmp_path / "a")
    setups = deepmill.setups(
        deepmill.Mesh.read(stl), "2,20,20,20", "3-axis", sites=800, except_="normal:0,0,-1"
    )
    setups.save(tmp_path / "b")
    assert_same(tmp_path / "b", tmp_path / "a")
    assert len(setups) == len(setups.setups) >= setups.at_least
    assert (setups.first >= 0).sum() <= setups.can_be_reached.sum()

    table = tmp_path / "tools.csv"
    table.write_text("name,CR,CH,FR,FH\nD4,2,20,20,20\nD10,5,30,20,20\n")
    run(program, "tools", stl, "--library", table, "--sites", 800, "--only", "normal:0,0,1", "--out", tmp_path / "c")
    tools, notices = deepmill.read_tools(table)
    outcome = deepmill.compare(deepmill.Mesh.read(stl), tools, sites=800, only="normal:0,0,1")
    outcome.save(tmp_path / "d")
    assert not notices and [tool.name for tool in outcome.tools] == ["D4", "D10"]
    theirs = files(tmp_path / "c")
    for name, path in files(tmp_path / "d").items():
        assert path.read_bytes() == theirs[name].read_bytes(), name
    assert outcome.accessible.shape == outcome.least_stick_out_mm.shape == (2, len(outcome.points))
    assert setups.region["part_area_mm2"] == outcome.region["part_area_mm2"] == pytest.approx(5800)
    assert setups.region["area_mm2"] == pytest.approx(4600) and outcome.region["area_mm2"] == pytest.approx(1200)


def test_volumes_have_the_bytes_of_the_program(program, stl, tmp_path):
    arguments = ["--cutter", "2,5,20,20", "--directions", "up", "--volume", 2.5]
    run(program, "label", stl, *arguments, "--out", tmp_path / "a")
    volume = deepmill.volume(deepmill.Mesh.read(stl), "2,5,20,20", 2.5, directions="up")
    volume.save(tmp_path / "b")
    assert_same(tmp_path / "b", tmp_path / "a")
    assert volume.answers.shape == volume.accessible_directions.shape == (16, 12, 8)
    center = np.array([15, 15, 15])  # of the pocket
    i, j, k = np.rint((center - volume.origin_mm) / volume.step_mm).astype(int)
    assert volume.answers[i, j, k] != 3 and volume.answers[0, 0, 0] == 3
    assert volume.share("accessible") == (volume.answers == 0).sum() / (volume.answers != 3).sum()
    assert np.array_equal(volume.answers == 0, volume.accessible_directions > 0)


def test_the_machined_part_has_the_bytes_of_the_program(program, stl, tmp_path):
    arguments = ["--cutter", "3,20,20,20", "--directions", "up", "--stock", "box:1", "--accuracy", 0.5]
    run(program, "machined", stl, *arguments, "--out", tmp_path / "a")
    machined = deepmill.machined(
        deepmill.Mesh.read(stl), "3,20,20,20", directions="up", stock=1, accuracy=0.5
    )
    machined.save(tmp_path / "b")
    assert_same(tmp_path / "b", tmp_path / "a")
    assert 0 < machined.left_mm3 < machined.to_remove_mm3
    assert machined.left_mm3 == pytest.approx(sum(body["volume_mm3"] for body in machined.bodies))
    assert machined.faces.max() < len(machined.vertices) and len(machined.tools) == 1
    for stock in ["box", -1, float("nan"), np.zeros(3)]:
        with pytest.raises((deepmill.Error, TypeError)):
            deepmill.machined(deepmill.Mesh.read(stl), "3,20,20,20", stock=stock)


def test_predictions_are_those_of_the_program(program, stl, tmp_path):
    run(program, "predict", stl, "--cutter", "1.5,6,40,5", "--sites", 1500, "--out", tmp_path)
    file = arrays(tmp_path / "predictions.npz")
    network = deepmill.Network.shipped()
    prediction = network.predict(file["points"], file["normals"], "1.5,6,40,5", part=deepmill.Mesh.read(stl))
    for name in ["logits_inaccessible", "logits_occlusion", "coarse_answers"]:
        assert np.array_equal(file[name], getattr(prediction, name)), name


def test_an_explanation_of_an_outcome_is_that_of_its_folder(mesh, tmp_path):
    outcome = deepmill.analyze(mesh, ["3,5,20,20", "2,5,20,20"], sites=600)
    outcome.save(tmp_path, pictures=False)
    tool = outcome[1].tool.name
    site = int(np.flatnonzero(outcome[1].inaccessible)[0])
    ours = outcome.explain(site, tool=tool)
    theirs = deepmill.explain(tmp_path / tool, site)
    assert ours == theirs == deepmill.explain(outcome, site, tool=1)
    assert ours["answer"] == "inaccessible" and ours["sentences"]
    near = outcome.explain(at=outcome.points[site], tool=-1)
    assert near["site"] == site and near["distance_mm"] == 0

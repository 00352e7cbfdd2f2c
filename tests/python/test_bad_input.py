"""Input that is not right: each an exception that names the argument, what was found and what is right."""

import deepmill
import numpy as np
import pytest

CORNERS = np.array([[0, 0, 0], [30, 0, 0], [0, 30, 0], [0, 0, 30]], dtype=float)
TRIANGLES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
UP = np.tile([0.0, 0.0, 1.0], (4, 1))


def with_value(array, value):
    array = np.array(array, dtype=float)
    array[2, 1] = value
    return array


def with_corner(value, dtype=np.int64):
    array = TRIANGLES.astype(dtype)
    array[1, 2] = value
    return array


class Half:
    vertices = CORNERS


class Raises:
    @property
    def vertices(self):
        raise RuntimeError("broken property")


ARRAYS = [
    (lambda: deepmill.Mesh(CORNERS[:, :2], TRIANGLES), ["vertices", "float64 of shape [4, 2]", "[n, 3]"]),
    (lambda: deepmill.Mesh(CORNERS.ravel(), TRIANGLES), ["vertices", "shape [12]", "[n, 3]"]),
    (lambda: deepmill.Mesh(CORNERS[None], TRIANGLES), ["vertices", "shape [1, 4, 3]", "[n, 3]"]),
    (lambda: deepmill.Mesh(CORNERS[:0], TRIANGLES), ["vertices", "shape [0, 3]", "at least 1"]),
    (lambda: deepmill.Mesh([], TRIANGLES), ["vertices", "[n, 3]"]),
    (lambda: deepmill.Mesh(CORNERS.astype(complex), TRIANGLES), ["vertices", "complex128", "real numbers"]),
    (lambda: deepmill.Mesh(CORNERS.astype(bool), TRIANGLES), ["vertices", "bool", "real numbers"]),
    (lambda: deepmill.Mesh(CORNERS.astype(str), TRIANGLES), ["vertices", "real numbers"]),
    (lambda: deepmill.Mesh(CORNERS.astype(object), TRIANGLES), ["vertices", "object", "real numbers"]),
    (lambda: deepmill.Mesh([[0, 0, 0], [1, 1]], TRIANGLES), ["vertices", "[n, 3]"]),
    (lambda: deepmill.Mesh(None, TRIANGLES), ["vertices", "None", "[n, 3]"]),
    (lambda: deepmill.Mesh("part.stl", TRIANGLES), ["vertices", "[n, 3]"]),
    (lambda: deepmill.Mesh(with_value(CORNERS, np.nan), TRIANGLES), ["vertices", "NaN in row 2", "finite"]),
    (lambda: deepmill.Mesh(with_value(CORNERS, -np.inf), TRIANGLES), ["vertices", "-inf in row 2", "finite"]),
    (lambda: deepmill.Mesh(with_value(CORNERS, 1e300), TRIANGLES), ["vertex 2", "within"]),
    (lambda: deepmill.Mesh(np.ma.masked_greater(CORNERS, 20), TRIANGLES), ["vertices", "masked", "[n, 3]"]),
    (lambda: deepmill.Mesh(CORNERS), ["triangles", "not given", "[m, 3]"]),
    (lambda: deepmill.Mesh(Half()), ["triangles", "not given", "faces"]),
    (lambda: deepmill.Mesh(CORNERS, TRIANGLES.astype(float)), ["triangles", "float64", "integers"]),
    (lambda: deepmill.Mesh(CORNERS, TRIANGLES[:, :2]), ["triangles", "shape [4, 2]", "[m, 3]"]),
    (lambda: deepmill.Mesh(CORNERS, TRIANGLES[:0]), ["triangles", "shape [0, 3]", "at least 1"]),
    (lambda: deepmill.Mesh(CORNERS, with_corner(4)), ["triangles", "4 in row 1", "from 0 to 3"]),
    (lambda: deepmill.Mesh(CORNERS, with_corner(-1)), ["triangles", "-1 in row 1", "from 0 to 3"]),
    (lambda: deepmill.Mesh(CORNERS, with_corner(2**63, np.uint64)), ["triangles", str(2**63), "from 0 to 3"]),
    (lambda: deepmill.Mesh(CORNERS, with_corner(2**32, np.int64)), ["triangles", str(2**32), "from 0 to 3"]),
    (lambda: deepmill.Mesh(CORNERS, TRIANGLES[:3]), ["open edge"]),
    (lambda: deepmill.Mesh(CORNERS, TRIANGLES, unit="ft"), ["unit", "`ft`", "mm, cm, m or in"]),
    (lambda: deepmill.Mesh(CORNERS, TRIANGLES, weld=float("nan")), ["weld", "nan", "a number"]),
    (lambda: deepmill.Mesh(CORNERS, TRIANGLES, weld=2), ["weld"]),
    (lambda: deepmill.Sites(CORNERS, UP[:3]), ["normals", "3 rows", "4, as many as points"]),
    (lambda: deepmill.Sites(CORNERS, 2 * UP), ["site 0", "normal"]),
    (lambda: deepmill.Sites(CORNERS, with_value(UP, np.nan)), ["normals", "NaN in row 2"]),
    (lambda: deepmill.Sites(with_value(CORNERS, 1e39), UP), ["site 2"]),
    (lambda: deepmill.Tool("1,2,3"), ["lengths", "`1,2,3`", "four lengths"]),
    (lambda: deepmill.Tool([1, 2, 3]), ["lengths", "shape [3]", "four lengths"]),
    (lambda: deepmill.Tool(), ["lengths", "not complete", "cr, ch, fr and fh"]),
    (lambda: deepmill.Tool("1,2,3,4", cr=1), ["lengths", "two ways"]),
    (lambda: deepmill.Tool("-1,2,3,4"), ["CR", "-1"]),
    (lambda: deepmill.Tool("1,2,3,4", corner=5), ["corner", "5", "between 0 and CR"]),
    (lambda: deepmill.Tool("1,2,3,4", kind="drill"), ["kind", "`drill`", "ball or flat"]),
    (lambda: deepmill.Tool("1,2,3,4", kind="flat", corner=0.5), ["corner", "0.5", "none with a kind"]),
    (lambda: analyze("1,2"), ["tools", "`1,2`", "four lengths"]),
    (lambda: analyze([]), ["tools", "none", "one or more"]),
    (lambda: analyze(["1,2,3,4", "1,2,3,4"]), ["tools", "`1-2-3-4` twice", "one tool only"]),
    (lambda: analyze(sites=1), ["sites", "1", "2 or more"]),
    (lambda: analyze(sites="all"), ["sites", "`all`", "vertices"]),
    (lambda: analyze(directions=0), ["directions", "0", "1 to"]),
    (lambda: analyze(directions="sideways"), ["directions", "`sideways`"]),
    (lambda: analyze(directions=np.zeros((2, 3))), ["direction"]),
    (lambda: analyze(directions=np.ones((2, 2))), ["directions", "shape [2, 2]", "[n, 3]"]),
    (lambda: analyze(obstacles="walls"), ["obstacles", "`walls`", "centroids"]),
    (lambda: analyze(only="cube:1"), ["only", "`cube:1`", "box:X,Y,Z"]),
    (lambda: analyze(only=""), ["only", "``", "box:X,Y,Z"]),
    (lambda: analyze(except_="normal:0,0,0"), ["only, except_", "normal", "a direction"]),
    (lambda: analyze(only="box:90,0,0,95,1,1"), ["only, except_", "no face", "the part reaches from"]),
    (lambda: analyze(only="findings:nowhere"), ["nowhere"]),
    (lambda: analyze(only="faces:nowhere.stl"), ["nowhere.stl"]),
    (lambda: analyze(only=np.array([4])), ["only", "4", "triangles of the part from 0 to 3"]),
    (lambda: analyze(only=np.array([-1])), ["only", "-1", "from 0 to 3"]),
    (lambda: analyze(only=np.array([], dtype=int)), ["only", "shape [0]", "one or more"]),
    (lambda: analyze(except_=np.zeros(4, dtype=bool)), ["except_", "bool of shape [4]", "one or more"]),
    (lambda: analyze(except_=np.ones(5, dtype=bool)), ["except_", "shape [5]", "bool of shape [4]"]),
    (lambda: analyze(only=np.array([0.5])), ["only", "float64", "numbers of triangles"]),
    (lambda: analyze(only=np.zeros((2, 2), dtype=int)), ["only", "shape [2, 2]", "numbers of triangles"]),
    (lambda: analyze(only="normal:0,0,1", obstacles="published"), ["only, except_", "points", "triangles that block"]),
    (lambda: cloud(only="normal:0,0,1"), ["only, except_", "points", "triangles that block"]),
    (lambda: cloud(only=np.array([0])), ["only", "points", "a mesh"]),
    (lambda: analyze(seed=-1), ["seed", "-1", "from 0 on"]),
    (lambda: analyze(seed=2**64), ["seed", str(2**64)]),
    (lambda: analyze(smooth=200), ["smooth", "200", "0 to 180"]),
    (lambda: analyze(occlusion_share=2.0), ["share", "2"]),
    (lambda: analyze(tolerance=-1.0), ["tolerance", "-1"]),
    (lambda: analyze(finish=float("inf")), ["finish", "inf"]),
    (lambda: analyze(table=float("inf")), ["table", "inf"]),
    (lambda: analyze(allowance=-1.0), ["allowance", "-1"]),
    (lambda: deepmill.compare(tetrahedron(), "1,2,3,4", share=0), ["share", "0", "above 0"]),
    (lambda: deepmill.setups(tetrahedron(), "1,2,3,4", "6-axis"), ["machine", "`6-axis`", "3-axis"]),
    (lambda: deepmill.setups(tetrahedron(), "1,2,3,4", "3-axis", at_most=0), ["at_most", "0", "1 or more"]),
    (lambda: deepmill.setups(tetrahedron(), "1,2,3,4", "3-axis", given=[[0, 0, 0]]), ["given", "without length"]),
    (lambda: setups(vise=(100, 50)), ["vise", "shape [2]", "jaw width"]),
    (lambda: setups(vise=(100, -50, 10)), ["vise", "-50", "above 0"]),
    (lambda: setups(vise="100,50,10"), ["vise", "jaw width"]),
    (lambda: setups(vise=(100, float("nan"), 10)), ["vise", "NaN", "above 0"]),
    (lambda: setups(table=(1, 2, 3)), ["table", "shape [3]", "below the part"]),
    (lambda: setups(table=-1), ["table", "-1"]),
    (lambda: setups(table="low"), ["table", "how far below"]),
    (lambda: setups(fixtures=[(2, tetrahedron())], given="+z"), ["fixtures", "2", "1"]),
    (lambda: setups(fixtures=[(1, tetrahedron())]), ["fixtures", "given"]),
    (lambda: profile([[0, 0, 0]]), ["profile", "shape [1, 3]", "[n, 2]"]),
    (lambda: profile([0, 1, 2]), ["profile", "shape [3]", "[n, 2]"]),
    (lambda: profile(np.zeros((0, 2))), ["profile", "shape [0, 2]", "at least 1"]),
    (lambda: profile([[0, 0], [np.nan, 2]]), ["profile", "NaN in row 1", "finite"]),
    (lambda: profile([[0, 1], [3, 2]]), ["profile", "height 1 first", "height 0"]),
    (lambda: profile([[0, 0]]), ["sections of the profile", "0", "1 to 64"]),
    (lambda: profile([[0, 0], [3, 5], [3, 2]]), ["height", "2"]),
    (lambda: profile([[0, 0], [3, 5]], arcs=[[0, 3], [0, 3]]), ["arcs", "2 rows", "1, one less than points"]),
    (lambda: profile([[0, 0], [3, 5]], arcs=[[0, np.nan]]), ["arcs", "NaN in row 0", "all NaN"]),
    (lambda: profile([[0, 0], [3, 5]], arcs=[[0, 1]]), ["center"]),
    (lambda: profile([[0, 0], [3, 5]], cuts=[1]), ["cuts", "int64", "bool of shape [1]"]),
    (lambda: profile([[0, 0], [3, 5]], cuts=[True, True]), ["cuts", "shape [2]", "bool of shape [1]"]),
    (lambda: profile([[0, 0], [3, 5]], cuts=[False]), ["profile", "without a cutting portion"]),
    (lambda: profile("0:0 3:5", cuts=[True]), ["cuts", "given with text"]),
    (lambda: profile("0:0 round"), ["profile", "round", "radius:height"]),
    (lambda: profile([[0, 0], [3, 5]], holder=[[20, 15]]), ["holder", "shape [1, 2]", "[k, 3]"]),
    (lambda: profile([[0, 0], [3, 5]], holder=[[20, 15, -1]]), ["holder", "-1"]),
    (lambda: profile([[0, 0], [3, 5]], stick_out=0), ["stick-out", "0"]),
    (lambda: deepmill.volume(tetrahedron(), "1,2,3,4", 0), ["step", "0"]),
    (lambda: deepmill.volume(tetrahedron(), ["1,2,3,4", "1,3,3,4"], 5), ["volume", "2 tools", "one tool"]),
    (lambda: deepmill.volume(tetrahedron(), "1,9,3,4", 9).share("all"), ["answer", "`all`", "tip_does_not_fit"]),
    (lambda: network().predict(CORNERS, UP, "1.5,6,40,5"), ["sites", "few_sites"]),
    (lambda: network().predict(CORNERS, UP, deepmill.Tool("1,2,3,4", kind="flat")), ["cutter", "ball end"]),
    (lambda: network().predict(CORNERS, UP, "1.5,6,40,5", occlusion_share=0), ["share", "0", "above 0"]),
    (lambda: deepmill.online([]), ["training set", "empty", "one part"]),
    (lambda: deepmill.online([tetrahedron()], "huge"), ["cutters", "`huge`", "uniform"]),
    (lambda: deepmill.online([tetrahedron()], turn="half"), ["turn", "`half`", "quarter"]),
    (lambda: deepmill.online([tetrahedron()], tilt=2), ["tilt", "2", "0 to 1"]),
    (lambda: deepmill.online([tetrahedron()], size_mm=(5, 1)), ["size_mm", "least <= greatest"]),
    (lambda: sample(inaccessible=[True]), ["inaccessible", "shape [1]", "bool of shape [4]"]),
    (lambda: sample(occlusion=[0, 1, 0, 1]), ["occlusion", "int64", "bool of shape [4]"]),
    (lambda: sample(cutter=deepmill.Tool("1,2,3,4", kind="flat")), ["cutter", "ball end"]),
    (lambda: deepmill.Trainer([]), ["samples", "empty", "one sample"]),
    (lambda: deepmill.Trainer([sample()], preset="huge"), ["preset", "huge", "tiny"]),
    (lambda: deepmill.Trainer([sample()], settings={"epochs": 3}), ["settings", "`epochs`", "n_epochs"]),
    (lambda: deepmill.Trainer([sample()], settings={"lr": -1.0}), ["lr", "-1", "above 0"]),
    (lambda: deepmill.Trainer([sample()], settings={"lr": set()}), ["settings", "JSON"]),
    (lambda: deepmill.Trainer([sample()], definition="ours"), ["definition", "`ours`", "mesh or published"]),
    (lambda: deepmill.Octree([]), ["clouds", "empty"]),
    (lambda: deepmill.Octree([(CORNERS, UP)], depth=11), ["depth", "11"]),
    (lambda: labeled().save("nowhere", also=["pdf"]), ["also", "`pdf`", "glb or csv"]),
    (lambda: labeled().save("nowhere", unit="ft"), ["unit", "`ft`", "mm, cm, m or in"]),
    (lambda: deepmill.explain(labeled()), ["site", "not given", "site or at"]),
    (lambda: deepmill.explain(labeled(), 10**6), ["site", "1000000"]),
    (lambda: deepmill.explain(labeled(), at=[0, 0]), ["at", "shape [2]", "x, y, z"]),
]

TYPES = [
    (lambda: analyze(sitez=5), ["no option sitez", "sites"]),
    (lambda: analyze(sites=5.5), ["sites", "5.5 (float)", "whole number"]),
    (lambda: analyze(seed=True), ["seed", "True (bool)", "whole number"]),
    (lambda: analyze(table="low"), ["table", "'low' (str)", "a number"]),
    (lambda: analyze(occlusion="yes"), ["occlusion", "'yes' (str)", "True or False"]),
    (lambda: analyze(only=5), ["only", "5 (int)", "array of triangles"]),
    (lambda: analyze(except_=[5]), ["except_", "5 (int)", "array of triangles"]),
    (lambda: deepmill.volume(tetrahedron(), "1,2,3,4", 5, only="normal:0,0,1"), ["no option only"]),
    (lambda: analyze(progress=5), ["progress", "5 (int)", "callable"]),
    (lambda: analyze(5), ["tools", "5 (int)", "deepmill.Tool"]),
    (lambda: analyze([None]), ["tools", "None", "deepmill.Tool"]),
    (lambda: analyze(fixtures=[5]), ["fixtures", "5 (int)", "deepmill.Mesh"]),
    (lambda: deepmill.analyze("part.stl", "1,2,3,4"), ["part", "str", "Mesh.read"]),
    (lambda: deepmill.analyze(5, "1,2,3,4"), ["part", "5 (int)", "vertices and faces"]),
    (lambda: deepmill.sample(5), ["mesh", "5 (int)"]),
    (lambda: deepmill.setups(tetrahedron(), "1,2,3,4", 3), ["machine", "3 (int)", "str"]),
    (lambda: deepmill.Mesh(CORNERS, TRIANGLES, name=5), ["name", "5 (int)", "str"]),
    (lambda: deepmill.Mesh.read(5), ["path", "5 (int)", "PathLike"]),
    (lambda: labeled().save("nowhere", also=5), ["also", "5 (int)", "glb"]),
    (lambda: deepmill.compare(tetrahedron(), "1,9,3,4", sites=50).save("nowhere", report=True), ["no option report"]),
    (lambda: deepmill.Trainer([5]), ["samples", "5 (int)", "deepmill.Sample"]),
    (lambda: deepmill.Trainer([sample()], settings=5), ["settings", "5 (int)", "dict"]),
    (lambda: deepmill.Trainer([sample()], preset="tiny").train(5), ["progress", "5 (int)", "callable"]),
    (lambda: deepmill.Octree([5]), ["clouds", "5 (int)", "pairs"]),
    (lambda: deepmill.Octree(5), ["clouds", "5 (int)", "sequence"]),
]


def tetrahedron():
    return deepmill.Mesh(CORNERS, TRIANGLES)


def analyze(tools="1,2,3,4", **options):
    return deepmill.analyze(tetrahedron(), tools, **{"sites": 50, **options})


def cloud(**options):
    return deepmill.analyze(deepmill.Sites(CORNERS, UP), "1,2,3,4", **options)


def setups(**options):
    return deepmill.setups(tetrahedron(), "1,2,3,4", "3-axis", **{"sites": 50, **options})


def profile(points, stick_out=30, holder=((20, 15, 15),), **options):
    return deepmill.Tool.from_profile(points, stick_out, holder, **options)


def labeled():
    return analyze("1,20,3,4")


def sample(cutter="1.5,6,40,5", inaccessible=np.zeros(4, dtype=bool), occlusion=np.ones(4, dtype=bool)):
    return deepmill.Sample(CORNERS, UP, cutter, inaccessible, occlusion)


def network():
    return deepmill.Network.shipped()


@pytest.mark.parametrize(("call", "words"), ARRAYS)
def test_values_that_are_not_right_are_errors_in_words(call, words):
    with pytest.raises(deepmill.Error) as raised:
        call()
    assert isinstance(raised.value, ValueError) and raised.value.kind
    assert "\n" not in str(raised.value)
    for word in words:
        assert word in str(raised.value), str(raised.value)


@pytest.mark.parametrize(("call", "words"), TYPES)
def test_other_types_are_type_errors_in_words(call, words):
    with pytest.raises(TypeError) as raised:
        call()
    for word in words:
        assert word in str(raised.value), str(raised.value)


def test_errors_of_the_caller_pass_through():
    with pytest.raises(RuntimeError, match="broken property"):
        deepmill.analyze(Raises(), "1,2,3,4")


def test_files_are_both_errors_of_ours_and_of_the_system(tmp_path):
    with pytest.raises(deepmill.FileError, match="no.stl: cannot be read: .*; check the path") as raised:
        deepmill.Mesh.read(tmp_path / "no.stl")
    assert isinstance(raised.value, (OSError, deepmill.Error)) and raised.value.errno == 2
    bad = tmp_path / "bad.stl"
    bad.write_bytes(b"solid\nfacet\n")
    with pytest.raises(OSError, match="bad.stl"):
        deepmill.Mesh.read(bad)
    with pytest.raises(deepmill.FileError, match="cannot be written"):
        analyze().save(bad / "folder")
    with pytest.raises(deepmill.FileError, match="labels.npz"):
        deepmill.explain(tmp_path, 0)
    with pytest.raises(deepmill.FileError):
        deepmill.Network.read(bad)
    with pytest.raises(deepmill.FileError):
        deepmill.read_tools(bad)


def test_any_order_stride_byte_order_and_type_is_the_same_mesh():
    expected = tetrahedron()
    spread = np.zeros((4, 7))
    spread[:, 1:6:2] = CORNERS
    odd = np.frombuffer(b"x" + CORNERS.tobytes(), dtype=np.uint8)[1:].view(np.float64).reshape(4, 3)
    read_only = CORNERS.copy()
    read_only.flags.writeable = False
    assert not odd.flags.aligned
    for vertices in [
        np.asfortranarray(CORNERS), spread[:, 1:6:2], CORNERS[::-1][::-1], CORNERS.astype(">f8"), odd, read_only,
        CORNERS.astype(np.float32), CORNERS.astype(np.float16), CORNERS.astype(np.int16), CORNERS.tolist(),
    ]:
        assert np.array_equal(deepmill.Mesh(vertices, TRIANGLES).vertices, expected.vertices)
    for dtype in ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", ">i4", ">u8"]:
        triangles = np.asfortranarray(TRIANGLES.astype(dtype))
        assert np.array_equal(deepmill.Mesh(CORNERS, triangles).triangles, expected.triangles)
    assert deepmill.Mesh(CORNERS / 10, TRIANGLES, unit="cm").volume_mm3 == pytest.approx(4500)


def test_input_is_copied_and_output_cannot_be_written():
    vertices = CORNERS.copy()
    mesh = deepmill.Mesh(vertices, TRIANGLES)
    vertices[:] = 0
    assert mesh.volume_mm3 == pytest.approx(4500)
    outcome = deepmill.analyze(mesh, "1,20,3,4", sites=50, occlusion=True)
    arrays = [mesh.vertices, mesh.triangles, outcome.points, outcome.area_shares, outcome[0].inaccessible]
    for array in arrays:
        assert not array.flags.writeable and not array.flags.owndata
        with pytest.raises(ValueError):
            array[:] = 0
        with pytest.raises(ValueError):
            array.flags.writeable = True
    first, second = outcome.points, outcome.points
    assert np.shares_memory(first, second)
    kept = first.copy()
    del outcome, second, arrays
    assert np.array_equal(first, kept)


def test_numbers_and_names_of_tools_that_there_are_not():
    outcome = labeled()
    with pytest.raises(IndexError):
        outcome[1]
    with pytest.raises(KeyError):
        outcome["D6"]
    with pytest.raises(TypeError):
        outcome[0.5]
    assert outcome[-1].tool.name == outcome["1-20-3-4"].tool.name


OPTIONS = [
    "directions", "sites", "seed", "smooth", "occlusion", "occlusion_share", "obstacles", "only", "except_", "fixtures", "table",
    "tolerance", "finish", "allowance", "search", "prove", "clearance_limit", "rest", "name", "progress",
]
HOSTILE = [
    0, -1, 3, 2**31, 2**63, 2**64, -(2**70), 0.0, -0.5, 1e-300, 1e300, float("inf"), float("nan"), True, False, "",
    "0", "nan", "x" * 1000, "\x00", "\ud800", b"bytes", [], [0], [[0, 0, 1]], {}, {1: 2}, object(), np.nan,
    np.array(5), np.array([1.0]), np.zeros((0, 3)), np.full((3, 3), np.inf), np.array("text"), 1 + 2j, print, type,
]


@pytest.mark.parametrize("option", OPTIONS)
def test_no_value_of_an_option_is_a_fault_of_ours(option):
    small = {"sites": 20, "directions": 4, "search": 0}
    for value in HOSTILE:
        try:
            deepmill.analyze(tetrahedron(), "1,2,3,4", **{**small, option: value})
        except (deepmill.Error, TypeError):
            pass


@pytest.mark.parametrize("value", HOSTILE, ids=lambda value: repr(value)[:20])
def test_no_argument_is_a_fault_of_ours(value):
    outcome = deepmill.analyze(tetrahedron(), "1,2,3,4", sites=20, directions=4, search=0)
    calls = [
        lambda: deepmill.Mesh(value),
        lambda: deepmill.Mesh(value, TRIANGLES),
        lambda: deepmill.Mesh(CORNERS, value),
        lambda: deepmill.Mesh(CORNERS, TRIANGLES, weld=value, force=True),
        lambda: deepmill.Mesh(CORNERS * (value if type(value) in (int, float) else 1), TRIANGLES),
        lambda: deepmill.Mesh(CORNERS, TRIANGLES, unit=value),
        lambda: deepmill.Sites(value, value),
        lambda: deepmill.Tool(value),
        lambda: deepmill.Tool(cr=value, ch=value, fr=value, fh=value),
        lambda: deepmill.Tool("1,2,3,4", corner=value),
        lambda: deepmill.Tool("1,2,3,4", clearance=value),
        lambda: deepmill.Tool("1,2,3,4", allowance=value),
        lambda: profile(value),
        lambda: profile([[0, 0], [3, 5]], value),
        lambda: profile([[0, 0], [3, 5]], 30, value),
        lambda: profile([[0, 0], [3, 5]], arcs=value),
        lambda: profile([[0, 0], [3, 5]], cuts=value),
        lambda: setups(vise=value, at_most=1),
        lambda: setups(table=value, at_most=1),
        lambda: setups(fixtures=value, at_most=1),
        lambda: deepmill.analyze(value, "1,2,3,4"),
        lambda: deepmill.analyze(tetrahedron(), value, sites=20),
        lambda: deepmill.compare(tetrahedron(), "1,2,3,4", share=value, sites=20, directions=4),
        lambda: deepmill.setups(tetrahedron(), "1,2,3,4", value, sites=20),
        lambda: deepmill.setups(tetrahedron(), "1,2,3,4", "3-axis", given=value, sites=20),
        lambda: deepmill.volume(tetrahedron(), "1,2,3,4", value, directions=4, search=0),
        lambda: outcome.explain(value),
        lambda: outcome.explain(at=value),
        lambda: outcome.explain(0, tool=value),
        lambda: outcome[value],
        lambda: deepmill.Octree(value),
        lambda: deepmill.Octree([(CORNERS, UP)], depth=value),
        lambda: deepmill.online([tetrahedron()], seed=value, sites=20),
        lambda: deepmill.online([tetrahedron()], size_mm=value, sites=20),
        lambda: deepmill.online(value),
        lambda: deepmill.Trainer(value),
        lambda: deepmill.Trainer([sample()], settings={"lr": value}, preset="tiny"),
        lambda: sample(cutter=value),
        lambda: sample(inaccessible=value),
    ]
    for call in calls:
        try:
            with np.errstate(all="ignore"):
                call()
        except (deepmill.Error, TypeError, LookupError):
            pass

"""The example that trains a PyTorch network runs where torch and trimesh are installed; CI has neither."""

import re
from pathlib import Path

import deepmill
import numpy as np
import pytest

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "python" / "train_torch.py"


def test_a_network_trained_on_labels_of_a_part_answers_for_other_cutters(capsys):
    pytest.importorskip("torch")
    pytest.importorskip("trimesh")
    exec(compile(EXAMPLE.read_text(encoding="utf-8"), str(EXAMPLE), "exec"), {})
    rows = re.findall(r"cutters (seen|not seen): ([\d.]+) % right, ([\d.]+) % by", capsys.readouterr().out)
    assert [name for name, _, _ in rows] == ["seen", "not seen"]
    for _, right, common in rows:
        assert float(right) > 90 and float(right) > float(common)


def test_arrays_go_through_dlpack_without_a_copy():
    corners = [[0, 0, 0], [30, 0, 0], [0, 30, 0], [0, 0, 30]]
    mesh = deepmill.Mesh(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    sample = next(deepmill.online([mesh], seed=1, sites=100))
    tree = deepmill.Octree([(sample.points, sample.normals)], depth=3)
    if np.lib.NumpyVersion(np.__version__) < "2.1.0":
        pytest.skip("NumPy before 2.1 exports no array that is read-only")
    arrays = [sample.points, sample.normals, sample.inaccessible, sample.cutter_mm, tree[3].neighbors, tree[3].keys]
    for array in arrays:
        other = np.from_dlpack(array)
        assert np.shares_memory(other, array) and other.dtype == array.dtype and np.array_equal(other, array)
        assert not other.flags.writeable

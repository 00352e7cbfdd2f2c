"""What a user may write; `mypy --strict` checks it against the types of the package."""

from pathlib import Path

import deepmill
import numpy as np
from numpy.typing import NDArray


class TrimeshLike:
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]


def report(stage: str, done: int, of: int) -> None:
    print(stage, done, of)


def label(path: Path) -> NDArray[np.bool_]:
    mesh = deepmill.Mesh.read(path, "in", repair=True)
    tool = deepmill.Tool(cr=3, ch=20, fr=20, fh=20, kind="flat")
    outcome = deepmill.analyze(mesh, [tool, "1.5,6,40,5"], directions="cone:60:150", progress=report)
    share: float = float(outcome.area_shares[outcome[0].inaccessible].sum())
    print(share, [finding["area_mm2"] for finding in outcome.findings])
    saved: list[Path] = outcome.save("results", report=True, also=["glb"])
    print(deepmill.read_outcome("results").part == outcome.part)
    print(saved, outcome.explain(0, tool="1.5-6-40-5")["sentences"])
    return outcome[0].inaccessible


def arrays(vertices: NDArray[np.float32], triangles: NDArray[np.int32], other: TrimeshLike) -> None:
    mesh = deepmill.Mesh(vertices, triangles, unit="cm")
    sites = deepmill.sample(other, sites=500)
    prediction = deepmill.Network.shipped().predict(sites.points, sites.normals, (1.5, 6, 40, 5))
    logits: NDArray[np.float32] = prediction.logits_inaccessible
    tree = deepmill.Octree([sites, (sites.points, sites.normals)], depth=4)
    neighbors: NDArray[np.int32] = tree[4].neighbors
    print(logits, neighbors, len(deepmill.setups(mesh, "3,20,20,20", "3+2:60", at_most=3)))
    for sample in deepmill.online([mesh, other], "short", seed=1, epochs=1):
        cutter: NDArray[np.float64] = sample.cutter_mm
        print(cutter, sample.inaccessible)
    region = deepmill.analyze(mesh, "3,20,20,20", only=["normal:0,0,1", np.arange(3), other], except_=mesh).region
    print(region["area_mm2"] if region else "all")
    disc = deepmill.Tool.from_profile([[7, 0], [7, 4], [2, 4], [2, 30]], 30, [[20, 15, 15]], cuts=[True, True, False])
    held = deepmill.setups(mesh, disc, "3-axis", given="+z", vise=(100, 60, 15), table=(0, 400), fixtures=[(1, other)])
    print(disc.profile, held.first)
    trainer = deepmill.Trainer([sample], preset="tiny", settings={"n_epochs": 1})
    if trainer.train(lambda step: bool(step["loss"] < 1)):
        print(trainer.history, trainer.network.save("weights.safetensors"))
    tools, notices = deepmill.read_tools("library.json", unit="mm")
    print(notices, deepmill.compare(mesh, tools).table)


try:
    label(Path("part.stl"))
except deepmill.FileError as error:
    print(error.kind, error.errno)

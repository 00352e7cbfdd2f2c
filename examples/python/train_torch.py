"""Labels a part of trimesh, trains a small PyTorch network on the labels, and compares on cutters not seen before."""

import time

import deepmill
import numpy as np
import torch
import trimesh


def box(size, at):
    return trimesh.creation.box(size, trimesh.transformations.translation_matrix(at))


places = [(-36, 30), (-24, 20), (-6, 30), (12, 35), (32, 15)]                          # x and height of ribs, mm
ribs = [box((4, 50, height), (x, 0, 9 + height / 2)) for x, height in places]
mesh = deepmill.Mesh(trimesh.util.concatenate([box((90, 60, 10), (0, 0, 5)), *ribs]))  # joined to one body
draw = np.random.default_rng(1)
lengths = np.round(draw.uniform([1, 2, 8, 10], [4, 30, 25, 40], (24, 4)), 1)           # CR, CH, FR, FH, mm
start = time.perf_counter()
outcome = deepmill.analyze(mesh, [",".join(map(str, row)) for row in lengths], sites=1000, directions=80)
print(f"{len(outcome)} cutters at {len(outcome.points)} sites labeled in {time.perf_counter() - start:.1f} s")

torch.manual_seed(1)
sites = torch.cat([torch.from_dlpack(outcome.points) / 45, torch.from_dlpack(outcome.normals)], 1)  # no copies
tools = torch.tensor(lengths / [4, 30, 25, 40], dtype=torch.float32)
inputs = torch.stack([torch.cat([sites, tool.expand(len(sites), 4)], 1) for tool in tools])
labels = torch.stack([torch.from_dlpack(answers.inaccessible) for answers in outcome])
wide = torch.nn.Sequential(torch.nn.Linear(10, 128), torch.nn.SiLU(), torch.nn.Linear(128, 128), torch.nn.SiLU())
network = torch.nn.Sequential(wide, torch.nn.Linear(128, 1))
optimizer = torch.optim.AdamW(network.parameters(), 3e-3)
for step in range(800):                                            # with the first 18 cutters
    tool, site = torch.randint(18, (2000,)), torch.randint(len(sites), (2000,))
    logits, target = network(inputs[tool, site])[:, 0], labels[tool, site].float()
    optimizer.zero_grad()
    torch.nn.functional.binary_cross_entropy_with_logits(logits, target).backward()
    optimizer.step()
with torch.no_grad():
    right = (network(inputs)[..., 0] > 0) == labels
for name, which in [("seen", slice(0, 18)), ("not seen", slice(18, 24))]:
    share, out = 100 * right[which].float().mean().item(), 100 * labels[which].float().mean().item()
    print(f"cutters {name}: {share:.1f} % right, {max(out, 100 - out):.1f} % by the commoner answer")

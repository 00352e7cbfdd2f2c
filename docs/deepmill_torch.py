"""deepmill's network in PyTorch: reads NPZ files and weights that deepmill has written, gives the same logits.

    pip install torch==2.15.0 ocnn==2.3.3 safetensors numpy
    python docs/deepmill_torch.py WEIGHTS.safetensors predictions/predictions.npz

The octree and its layers are ocnn's; the network's names are those of the weights, so they load as they are. docs/python.md.
"""

import json
import sys

import numpy as np
import torch
from ocnn.modules import InputFeature
from ocnn.nn import OctreeConv, OctreeDeconv
from ocnn.octree import Octree, Points, xyz2key
from safetensors import safe_open
from torch import nn


class ConvBn(nn.Module):
    def __init__(self, c_in, c_out, kernel=3, stride=1):
        super().__init__()
        self.conv, self.bn = OctreeConv(c_in, c_out, [kernel], stride), nn.BatchNorm1d(c_out)

    def forward(self, x, octree, depth):
        return self.bn(self.conv(x, octree, depth))


class UpBn(nn.Module):
    def __init__(self, c_in, c_out):
        super().__init__()
        self.deconv, self.bn = OctreeDeconv(c_in, c_out, [2], 2), nn.BatchNorm1d(c_out)

    def forward(self, x, octree, depth):
        return torch.relu(self.bn(self.deconv(x, octree, depth)))


class Plain(nn.Module):
    def __init__(self, c_in, c_out, bias=False):
        super().__init__()
        self.linear = nn.Linear(c_in, c_out, bias)

    def forward(self, x):
        return self.linear(x)


class PlainBn(nn.Module):
    def __init__(self, c_in, c_out, relu):
        super().__init__()
        self.conv, self.bn, self.relu = Plain(c_in, c_out), nn.BatchNorm1d(c_out), relu

    def forward(self, x):
        y = self.bn(self.conv(x))
        return torch.relu(y) if self.relu else y


class Residual(nn.Module):
    def __init__(self, c_in, c_out):
        super().__init__()
        self.conv3x3a, self.conv3x3b = ConvBn(c_in, c_out), ConvBn(c_out, c_out)
        self.conv1x1 = PlainBn(c_in, c_out, False) if c_in != c_out else nn.Identity()

    def forward(self, x, octree, depth):
        y = torch.relu(self.conv3x3a(x, octree, depth))
        return torch.relu(self.conv3x3b(y, octree, depth) + self.conv1x1(x))


class Blocks(nn.Module):
    def __init__(self, c_in, c_out, n):
        super().__init__()
        self.resblks = nn.ModuleList(Residual(c_in if i == 0 else c_out, c_out) for i in range(n))

    def forward(self, x, octree, depth):
        for block in self.resblks:
            x = block(x, octree, depth)
        return x


def cutter_module(hidden, width, batch_norm):
    def norm(c):
        return nn.BatchNorm1d(c) if batch_norm else nn.Identity()
    return nn.Sequential(nn.Linear(4, hidden), nn.ReLU(), norm(hidden), nn.Dropout(),
                         nn.Linear(hidden, width), nn.ReLU(), norm(width), nn.Dropout())


def interpolate(x, octree, depth, points):
    """Trilinear, weights renormalized over the nodes that exist."""
    corners = torch.tensor([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)])
    at = (points + 1) * 2 ** (depth - 1) - 0.5
    cells = at.floor()[:, None] + corners
    inside = ((cells >= 0) & (cells < 2 ** depth)).all(2)
    i, j, k = cells.clamp(0, 2 ** depth - 1).long().unbind(2)
    keys, wanted = octree.key(depth), xyz2key(i, j, k, depth=depth)
    rows = torch.searchsorted(keys, wanted.flatten()).clamp(max=len(keys) - 1).view_as(wanted)
    weights = (1 - (at[:, None] - cells).abs()).prod(2) * (inside & (keys[rows] == wanted))
    return (x[rows] * weights[..., None]).sum(1) / weights.sum(1, keepdim=True)


class Network(nn.Module):
    """`config` is that of the weights (`deepmill weights FILE --json`)."""

    def __init__(self, config):
        super().__init__()
        cut, n = config["cutter"], len(config["encoder_widths"])
        enc, dec = [config["stem_width"], *config["encoder_widths"]], [config["encoder_widths"][-1], *config["decoder_widths"]]
        self.input, self.n = config["input"], n
        coarse = 4 if self.input.get("coarse_directions") else 0
        channels = sum({"N": 3, "D": 1, "P": 3}[letter] for letter in self.input["features"]) + coarse
        self.conv1 = ConvBn(channels, enc[0])
        self.downsample = nn.ModuleList(ConvBn(enc[i], enc[i + 1], 2, 2) for i in range(n))
        self.encoder = nn.ModuleList(Blocks(enc[i + 1], enc[i + 1], config["encoder_blocks"][i]) for i in range(n))
        for i in range(n):
            setattr(self, f"fc_module_{i + 1}", cutter_module(cut["hidden_width"], cut["width"], cut["batch_norm"]))
        self.upsample = nn.ModuleList(UpBn(config["encoder_widths"][-1] if i == 0 else dec[i], dec[i + 1]) for i in range(n))
        self.decoder = nn.ModuleList(
            Blocks(enc[n - 1 - i] + cut["width"] + dec[i + 1], dec[i + 1], config["decoder_blocks"][i]) for i in range(n))
        read = dec[-1] + (3 if self.input["point_normals"] else 0) + coarse
        self.calibration = [(1.0, 0.0), (1.0, 0.0)]
        self.header, self.header_2 = (nn.Sequential(PlainBn(read, config["head_width"], True), Plain(config["head_width"], 2, True)) for _ in range(2))

    def forward(self, points, normals, cutter_mm, coarse=None):
        """Points and normals `[n, 3]`, mm; CR, CH, FR, FH in mm; `coarse_answers` of deepmill's predictions, `[n, 4]`, for a network with
        `coarse_directions`. Logits of both heads, `[n, 2]` each."""
        low, high = points.min(0).values, points.max(0).values
        scale = 2 / (high - low).max()
        points = ((points - (low + high) / 2) * scale).clamp(-1, 1)
        octree = Octree(self.input["depth"], self.input["full_depth"])
        # ocnn has no cell for what lies on the far faces of the cube.
        octree.build_octree(Points(points.clamp(max=1 - 2e-7).float(), normals.float()))
        octree.construct_all_neigh()
        cutter = (cutter_mm * scale).clamp(max=4).float()[None]
        x, depth, skips = InputFeature(self.input["features"])(octree), self.input["depth"], []
        if coarse is not None:
            x = torch.cat([x, means(octree, depth, points.clamp(max=1 - 2e-7).float(), coarse.float())], 1)
        x = torch.relu(self.conv1(x, octree, depth))
        for i in range(self.n):
            skips.append(x)
            x = torch.relu(self.downsample[i](x, octree, depth))
            depth -= 1
            x = self.encoder[i](x, octree, depth)
        for i in range(self.n):
            seen = getattr(self, f"fc_module_{i + 1}")(cutter)
            x = self.upsample[i](x, octree, depth)
            depth += 1
            x = torch.cat([skips.pop(), seen.expand(len(x), -1), x], 1)
            x = self.decoder[i](x, octree, depth)
        x = interpolate(x, octree, depth, points.float())
        if self.input["point_normals"]:
            x = torch.cat([x, normals.float()], 1)
        if coarse is not None:
            x = torch.cat([x, coarse.float()], 1)
        # Head 1 has its positive class first.
        (a, b), (c, d) = self.calibration
        return self.header(x) * a + torch.tensor([b, 0.0]), self.header_2(x) * c + torch.tensor([0.0, d])


def means(octree, depth, points, rows):
    """Means of the points' rows in each finest node, zero in empty ones."""
    cells = ((points + 1) * 2 ** (depth - 1)).floor().long()
    keys = xyz2key(*cells.T, None, depth)
    node = torch.searchsorted(octree.keys[depth], keys)
    sums = torch.zeros(len(octree.keys[depth]), rows.shape[1]).index_add(0, node, rows)
    counts = torch.bincount(node, minlength=len(sums)).clamp(min=1)
    return sums / counts[:, None]


def load(path):
    """The network of a file of weights, for prediction. Box normalization, cutter lengths scaled, cutter modules at all stages."""
    with safe_open(path, "pt") as file:
        about = json.loads(file.metadata()["deepmill"])
        state = {name: file.get_tensor(name) for name in file.keys()}
    network = Network(about["config"])
    network.calibration = [(c["slope"], c["offset"]) for c in about.get("calibration", [])] or network.calibration
    network.load_state_dict({name: t.float() if t.is_floating_point() else t for name, t in state.items()})
    return network.eval()


def main(weights, archive):
    with np.load(archive) as z:
        points, normals, cutter = (torch.from_numpy(z[name]).double() for name in ["points", "normals", "cutter"])
        coarse = torch.from_numpy(z["coarse_answers"]) if "coarse_answers" in z else None
        stored = [z["logits_inaccessible"], z["logits_occlusion"]]
    with torch.no_grad():
        found = load(weights)(points, normals, cutter, coarse)
    for name, a, b in zip(["inaccessible", "occlusion"], found, stored):
        # The file has the positive class second; head 1 of the weights has it first.
        a = a.numpy()[:, ::-1] if name == "inaccessible" else a.numpy()
        print(f"{name}: {len(b)} sites, largest difference of a logit {np.abs(a - b).max():.2e} (logits up to {np.abs(b).max():.1f}), "
              f"{(a.argmax(1) != b.argmax(1)).sum()} answers differ")


if __name__ == "__main__":
    main(*sys.argv[1:])

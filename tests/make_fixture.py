"""Makes a parity fixture for `deepmill parity` from the published `ocnn` and `torch` packages.

    pip install ocnn==2.3.3 torch numpy safetensors
    python tests/make_fixture.py tests/fixtures/parity            # the fixture of `cargo test`, under 4 MB
    python tests/make_fixture.py /tmp/official --official         # official widths, too large to commit

The octree and its layers are ocnn's; the network around them is written out below.
Float32 on the CPU with one thread, and everything again in float64.
"""

import argparse
import copy
import json
import pathlib

import numpy as np
import ocnn
import torch
from ocnn.nn import OctreeConv, OctreeDeconv, OctreeInterp
from ocnn.octree import Octree, Points
from safetensors.torch import save_file
from torch import nn

DEPTH, FULL_DEPTH = 5, 2
SGD = {"lr": 0.1, "momentum": 0.9, "weight_decay": 5e-4, "steps": 3}
NARROW = dict(
    encoder=[4, 4, 6, 8, 10], decoder=[10, 8, 6, 5, 5], encoder_blocks=[1, 2, 1, 1],
    decoder_blocks=[1, 1, 1, 2], head=5, cutter=[4, 6], points=[260, 1, 190],
)
OFFICIAL = dict(
    encoder=[32, 32, 64, 128, 256], decoder=[256, 256, 128, 96, 96], encoder_blocks=[2, 3, 4, 6],
    decoder_blocks=[2, 2, 2, 2], head=64, cutter=[32, 256], points=[900, 700],
)


class ConvBn(nn.Module):
    def __init__(self, c_in, c_out, kernel=3, stride=1):
        super().__init__()
        self.conv = OctreeConv(c_in, c_out, [kernel], stride, nempty=False)
        self.bn = nn.BatchNorm1d(c_out)

    def forward(self, x, octree, depth):
        return self.bn(self.conv(x, octree, depth))


class UpBn(nn.Module):
    def __init__(self, c_in, c_out):
        super().__init__()
        self.deconv = OctreeDeconv(c_in, c_out, [2], 2, nempty=False)
        self.bn = nn.BatchNorm1d(c_out)

    def forward(self, x, octree, depth):
        return torch.relu(self.bn(self.deconv(x, octree, depth)))


class Plain(nn.Module):
    """A linear layer under the key `linear`."""

    def __init__(self, c_in, c_out, bias=False):
        super().__init__()
        self.linear = nn.Linear(c_in, c_out, bias)

    def forward(self, x):
        return self.linear(x)


class PlainBn(nn.Module):
    def __init__(self, c_in, c_out, relu):
        super().__init__()
        self.conv = Plain(c_in, c_out)
        self.bn = nn.BatchNorm1d(c_out)
        self.relu = relu

    def forward(self, x):
        y = self.bn(self.conv(x))
        return torch.relu(y) if self.relu else y


class Residual(nn.Module):
    def __init__(self, c_in, c_out):
        super().__init__()
        self.conv3x3a = ConvBn(c_in, c_out)
        self.conv3x3b = ConvBn(c_out, c_out)
        if c_in != c_out:
            self.conv1x1 = PlainBn(c_in, c_out, relu=False)

    def forward(self, x, octree, depth):
        y = torch.relu(self.conv3x3a(x, octree, depth))
        y = self.conv3x3b(y, octree, depth)
        return torch.relu(y + (self.conv1x1(x) if hasattr(self, "conv1x1") else x))


class Blocks(nn.Module):
    def __init__(self, c_in, c_out, n):
        super().__init__()
        self.resblks = nn.ModuleList(Residual(c_in if i == 0 else c_out, c_out) for i in range(n))

    def forward(self, x, octree, depth):
        for block in self.resblks:
            x = block(x, octree, depth)
        return x


def cutter_module(hidden, width):
    return nn.Sequential(
        nn.Linear(4, hidden), nn.ReLU(), nn.BatchNorm1d(hidden), nn.Dropout(0.0),
        nn.Linear(hidden, width), nn.ReLU(), nn.BatchNorm1d(width), nn.Dropout(0.0))


class Net(nn.Module):
    def __init__(self, c):
        super().__init__()
        enc, dec, n = c["encoder"], c["decoder"], len(c["encoder_blocks"])
        self.n, width = n, c["cutter"][1]
        self.conv1 = ConvBn(4, enc[0])
        self.downsample = nn.ModuleList(ConvBn(enc[i], enc[i + 1], 2, 2) for i in range(n))
        self.encoder = nn.ModuleList(
            Blocks(enc[i + 1], enc[i + 1], c["encoder_blocks"][i]) for i in range(n))
        for i in range(n):
            setattr(self, f"fc_module_{i + 1}", cutter_module(*c["cutter"]))
        self.upsample = nn.ModuleList(UpBn(dec[i], dec[i + 1]) for i in range(n))
        self.decoder = nn.ModuleList(
            Blocks(enc[n - 1 - i] + width + dec[i + 1], dec[i + 1], c["decoder_blocks"][i])
            for i in range(n))
        for name in ["header", "header_2"]:
            head = nn.Sequential(PlainBn(dec[-1], c["head"], True), Plain(c["head"], 2, True))
            setattr(self, name, head)
        self.interp = OctreeInterp("linear", nempty=False)

    def forward(self, feature, octree, cutter, points, batch_id):
        kept, d, skips = {}, DEPTH, []
        x = kept["conv1"] = torch.relu(self.conv1(feature, octree, d))
        for i in range(self.n):
            skips.append(x)
            x = kept[f"downsample.{i}"] = torch.relu(self.downsample[i](x, octree, d))
            d -= 1
            x = kept[f"encoder.{i}"] = self.encoder[i](x, octree, d)
        for i in range(self.n):
            f = kept[f"fc_module_{i + 1}"] = getattr(self, f"fc_module_{i + 1}")(cutter)
            x = kept[f"upsample.{i}"] = self.upsample[i](x, octree, d)
            d += 1
            rows = f[octree.batch_id(d).long()]
            x = self.decoder[i](torch.cat([skips.pop(), rows, x], 1), octree, d)
            kept[f"decoder.{i}"] = x
        query = torch.cat([points, batch_id.unsqueeze(1).to(points)], 1)  # rescaled in place
        x = kept["interp"] = self.interp(x, octree, d, query)
        kept["logits_1"], kept["logits_2"] = self.header(x), self.header_2(x)
        return kept


def made_up_shape(n, rng):
    """Points of a bumpy sphere with a flat cap, prepared as the published data are."""
    d = rng.normal(size=(n, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    p = d * (1 + 0.25 * np.sin(5 * d[:, :1]) * np.cos(4 * d[:, 1:2])) * [1.0, 0.8, 0.6]
    p[:, 2] = np.minimum(p[:, 2], 0.35)
    normals = np.where(p[:, 2:] >= 0.35, [[0.0, 0.0, 1.0]], d)
    p -= p.mean(0)
    p *= 0.8 / max(np.abs(p).max(), 1e-9)
    if n > 20:
        p[0] = [0.25, -0.5, 0.125]                     # on a cell border
        p[1] = [0.25 - 1e-8, -0.5, 0.125 + 1e-8]       # beside it
        p[2] = p[3]                                    # doubled
        p[4] = [0.975, -0.98, 0.2]                     # within half a cell of two faces
        normals[5] = 0.0
    return p.round(6).astype(np.float32), normals.round(6).astype(np.float32)


def build(points, normals, sizes):
    octrees, node_of, start = [], [], 0
    for n in sizes:
        cloud = Points(torch.tensor(points[start:start + n]), torch.tensor(normals[start:start + n]))
        cloud.orient_normal("xyz")
        octree = Octree(DEPTH, FULL_DEPTH)
        inverse = octree.build_octree(cloud)
        node_of.append(inverse.long() + sum(o.nnum_nempty[DEPTH].item() for o in octrees))
        octrees.append(octree)
        start += n
    octree = ocnn.octree.merge_octrees(octrees)
    octree.construct_all_neigh()
    return octree, torch.cat(node_of).int()


def octree_tensors(octree, point_node):
    out = {
        "octree.nnum": octree.nnum.long(), "octree.nnum_nempty": octree.nnum_nempty.long(),
        "octree.batch_nnum": octree.batch_nnum.long(),
        "octree.batch_nnum_nempty": octree.batch_nnum_nempty.long(),
        "octree.point_node": point_node,
        "octree.points": octree.points[DEPTH], "octree.normals": octree.normals[DEPTH],
    }
    for d in range(DEPTH + 1):
        out[f"octree.d{d}.keys"] = octree.keys[d].long()
        out[f"octree.d{d}.children"] = octree.children[d].int()
        if d > 0:
            out[f"octree.d{d}.neigh"] = octree.neighs[d].int()
    return out


def strided(name, tensor, limit):
    if not tensor.is_floating_point() or tensor.numel() <= limit:
        return name, tensor
    step = -(-tensor.numel() // limit)
    return f"{name}#{step}", tensor.flatten()[::step]


def train(net, inputs, labels, prefix, out, limit):
    """Three SGD steps; records loss, gradients and state as the oracle's page describes."""
    net.train()
    optimizer = torch.optim.SGD(net.parameters(), SGD["lr"], SGD["momentum"],
                                weight_decay=SGD["weight_decay"])
    losses = []

    def loss_of(kept):
        return sum(nn.functional.cross_entropy(kept[f"logits_{i + 1}"], labels[i])
                   for i in range(2)) / 2

    for step in range(SGD["steps"]):
        kept = net(*inputs)
        loss = loss_of(kept)
        optimizer.zero_grad()
        loss.backward()
        losses.append(loss.item())
        if step == 0:
            for i in (1, 2):
                out[f"{prefix}train.logits_{i}"] = kept[f"logits_{i}"].detach()
            for name, p in net.named_parameters():
                name, grad = strided(f"{prefix}grad.{name}", p.grad.float(), limit)
                out[name] = grad
        optimizer.step()
    state = copy.deepcopy(net.state_dict())
    with torch.no_grad():
        losses.append(loss_of(net(*inputs)).item())
        net.load_state_dict(state)
        net.eval()
        kept = net(*inputs)
    out[f"{prefix}train.loss"] = torch.tensor(losses, dtype=torch.float64)
    for name, value in state.items():
        value = value.float() if value.is_floating_point() else value
        name, value = strided(f"{prefix}post.{name}", value, limit)
        out[name] = value
    for i in (1, 2):
        out[f"{prefix}post.logits_{i}"] = kept[f"logits_{i}"]


def operation(name, module, call, inputs, out):
    """Forward and backward of one module in float64, on values that float32 holds exactly."""
    inputs = {k: v.float().double().requires_grad_() for k, v in inputs.items()}
    if module is not None:
        for key, value in module.state_dict().items():
            if value.is_floating_point():
                out[f"{name}.{key}"] = value.float()
        module.load_state_dict({k: v.float() if v.is_floating_point() else v
                                for k, v in module.state_dict().items()})
        module.double()
    y = call(*inputs.values())
    gy = torch.randn_like(y).float().double()
    y.backward(gy)
    out.update({f"{name}.{k}": v.detach() for k, v in inputs.items()})
    out.update({f"{name}.grad.{k}": v.grad for k, v in inputs.items()})
    out[f"{name}.y"], out[f"{name}.gy"] = y.detach(), gy
    if module is not None:
        out.update({f"{name}.grad.{k}": p.grad for k, p in module.named_parameters()})
        if module.training:
            out.update({f"{name}.after.{k}": b for k, b in module.named_buffers()
                        if b.is_floating_point()})


def shuffle_norms(module):
    for m in module.modules():
        if isinstance(m, nn.BatchNorm1d):
            m.weight.data.uniform_(0.5, 1.5)
            m.bias.data.uniform_(-0.5, 0.5)
            m.running_mean.uniform_(-0.5, 0.5)
            m.running_var.uniform_(0.5, 1.5)


def operations(octree, points, batch_id):
    out = {}
    n = [int(k) for k in octree.nnum]
    for name, layer, rows, depth in [
            ("conv3", OctreeConv(3, 4, [3], 1), n[4], 4),
            ("down", OctreeConv(3, 4, [2], 2), n[4], 4),
            ("up", OctreeDeconv(3, 4, [2], 2), n[3], 3)]:
        operation(name, layer, lambda x: layer(x, octree, depth), {"x": torch.randn(rows, 3)}, out)
    interp = OctreeInterp("linear")
    query = torch.cat([points, batch_id.unsqueeze(1).float()], 1).double()
    operation("interp", None, lambda x: interp(x, octree, DEPTH, query.clone()),
              {"x": torch.randn(n[DEPTH], 2)}, out)
    for name in ["bn_train", "bn_eval"]:
        norm = nn.BatchNorm1d(6)
        shuffle_norms(norm)
        norm.train(name == "bn_train")
        operation(name, norm, norm, {"x": torch.randn(200, 6) * 2 + 1}, out)
    for name, c_in, c_out in [("resblock", 4, 3), ("resblock_same", 3, 3)]:
        block = Residual(c_in, c_out)
        shuffle_norms(block)
        operation(name, block, lambda x: block(x, octree, 3), {"x": torch.randn(n[3], c_in)}, out)
    module = cutter_module(8, 16)
    shuffle_norms(module)
    operation("fc_module", module, module, {"x": torch.rand(16, 4) * 10}, out)
    head = nn.Sequential(PlainBn(6, 5, True), Plain(5, 2, True))
    shuffle_norms(head)
    operation("header", head, head, {"x": torch.randn(200, 6)}, out)
    logits = torch.randn(100, 2).double().requires_grad_()
    labels = torch.randint(0, 2, (100,))
    loss = nn.functional.cross_entropy(logits, labels)
    loss.backward()
    out.update({"ce.logits": logits.detach(), "ce.labels": labels.int(),
                "ce.loss": loss.detach().reshape(1), "ce.grad.logits": logits.grad})
    p = torch.randn(50).double().requires_grad_()
    optimizer = torch.optim.SGD([p], SGD["lr"], SGD["momentum"], weight_decay=SGD["weight_decay"])
    out["sgd.p0"] = p.detach().clone()
    for i in range(3):
        p.grad = torch.randn(50).float().double()
        out[f"sgd.g{i}"] = p.grad.clone()
        optimizer.step()
        out[f"sgd.p{i + 1}"] = p.detach().clone()
    return {k: v.float() if v.is_floating_point() else v for k, v in out.items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--official", action="store_true")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--points", type=int, nargs="+", help="points of each shape")
    args = parser.parse_args()
    torch.manual_seed(args.seed)
    torch.set_num_threads(1)
    rng = np.random.default_rng(args.seed)
    config = OFFICIAL if args.official else NARROW
    limit = 4000 if args.official else 300
    sizes = config["points"] = args.points or config["points"]
    shapes = [made_up_shape(n, rng) for n in sizes]
    points, normals = (np.concatenate([s[i] for s in shapes]) for i in range(2))
    batch_id = torch.repeat_interleave(torch.arange(len(sizes)), torch.tensor(sizes)).int()
    cutter = torch.tensor(rng.uniform([1, 0.1, 5, 0.1], [2, 10.1, 100, 10.1], (len(sizes), 4))).float()
    labels = [torch.tensor(rng.integers(0, 2, len(points))) for _ in range(2)]
    octree, point_node = build(points, normals, sizes)
    feature = octree.get_input_feature("ND", nempty=False)
    torch_points = torch.tensor(points)

    net = Net(config)
    shuffle_norms(net)
    args.folder.mkdir(parents=True, exist_ok=True)
    save = lambda name, tensors: save_file(
        {k: v.detach().contiguous().clone() for k, v in tensors.items()}, args.folder / f"{name}.safetensors")
    save("weights", net.state_dict())
    torch.save(net.state_dict(), args.folder / "weights.pth")
    save("input", {"points": torch_points, "normals": torch.tensor(normals), "batch_id": batch_id,
                   "cutter": cutter, "labels": labels[0].int(), "labels_2": labels[1].int()})

    out = octree_tensors(octree, point_node)
    out["input_feature"] = feature
    double = copy.deepcopy(net).double()
    inputs = (feature, octree, cutter, torch_points, batch_id)
    inputs64 = (feature.double(), octree, cutter.double(), torch_points.double(), batch_id)
    with torch.no_grad():
        for name, value in net.eval()(*inputs).items():
            out[f"eval.{name}"] = value
        kept = double.eval()(*inputs64)
        for i in (1, 2):
            out[f"f64.eval.logits_{i}"] = kept[f"logits_{i}"]
    train(net, inputs, labels, "", out, limit)
    train(double, inputs64, labels, "f64.", out, limit)
    save("expected", out)
    save("ops", operations(octree, torch_points, batch_id))
    (args.folder / "config.json").write_text(json.dumps({
        "seed": args.seed, "batch": len(sizes), "depth": DEPTH, "full_depth": FULL_DEPTH,
        "encoder_channel": config["encoder"], "decoder_channel": config["decoder"],
        "encoder_blocks": config["encoder_blocks"], "decoder_blocks": config["decoder_blocks"],
        "head_channel": config["head"], "in_channels": 4, "out_channels": 2, "nempty": False,
        "interp": "linear", "bn_eps": 1e-5, "bn_momentum": 0.1, "dropout": 0.0, "sgd": SGD,
        "points_per_shape": sizes, "parameters": sum(p.numel() for p in net.parameters()),
        "made_with": {"torch": torch.__version__, "ocnn": "2.3.3"},
    }, indent=1) + "\n")


if __name__ == "__main__":
    main()

"""Trains the same network in PyTorch and in deepmill: same data, same settings, same wall-clock time.

    pip install torch ocnn
    cargo build --release
    python benches/peers/learning.py --deepmill target/release/deepmill --data DATA --validate VAL

DATA and VAL are folders of `deepmill dataset build`. Both sides train a U-Net of the reference's kind
(layers of PyPI's ocnn; widths for a CPU, cutter modules without batch norm) with SGD at a constant rate,
batches of 4 and clipped gradients, then predict VAL. Reading the data set is
not counted. Scores are averages over samples; F1 of the classes inaccessible and occlusion.
"""

import argparse
import csv
import json
import os
import pathlib
import platform
import signal
import subprocess
import tempfile
import time

import reference

STEM, ENCODER, DECODER = 16, [32, 48, 96, 96], [96, 48, 32, 16]
ENCODER_BLOCKS, DECODER_BLOCKS = [1, 2, 2, 1], [2, 2, 1, 1]
HEAD, CUTTER, BATCH = 64, 32, 4

SETTINGS = f"""seed = 1
n_epochs = 1000000
samples_per_epoch = 40
batch_size = {BATCH}
lr = 0.05
momentum = 0.9
weight_decay = 5e-4
clip_norm = 5.0
evaluate_every = 1000000
[schedule]
kind = "constant"
[augment]
mirror = false
turn = "none"
[network]
stem_width = {STEM}
encoder_widths = {ENCODER}
encoder_blocks = {ENCODER_BLOCKS}
decoder_widths = {DECODER}
decoder_blocks = {DECODER_BLOCKS}
head_width = {HEAD}
[network.cutter]
placement = "all"
hidden_width = 32
width = {CUTTER}
batch_norm = false
dropout = 0.0
"""


def ours(args):
    """Trains and scores with deepmill; returns samples seen and the four scores."""
    with tempfile.TemporaryDirectory() as folder:
        config, run = pathlib.Path(folder, "settings.toml"), pathlib.Path(folder, "run")
        config.write_text(SETTINGS)
        threads = ["--threads", str(args.threads)]
        process = subprocess.Popen([args.deepmill, *threads, "train", "--data", *args.data, "--out", run,
                                    "--config", config], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
        rows = []
        while sum(float(row["seconds"]) for row in rows) < args.seconds:
            time.sleep(0.2)
            if process.poll() is not None:
                raise SystemExit("deepmill train ended early")
            if (run / "history.csv").exists():
                rows = list(csv.DictReader((run / "history.csv").open()))
        process.send_signal(signal.SIGINT)
        process.wait()
        table = subprocess.run([args.deepmill, *threads, "--json", "eval", "--data", *args.validate, "--model",
                                run / "model.safetensors"], check=True, stdout=subprocess.PIPE,
                               stderr=subprocess.DEVNULL).stdout
        sets = [row for row in json.loads(table)["per_sample"] if row["engine"] == "network"]
        return 40 * len(rows), [sets[-1][key] for key in ("acc_i", "f1_i", "acc_o", "f1_o")]


def samples(folders):
    """Points, normals, cutter, labels of both heads (classes as deepmill has them) of every sample."""
    import numpy as np
    for folder in map(pathlib.Path, folders):
        for part in json.loads((folder / "manifest.json").read_text())["parts"]:
            if part["content"] is None:
                continue
            with np.load(folder / part["content"]["file"]) as z:
                for k in range(len(z["cutters"])):
                    yield (z["points"], z["normals"], z["cutters"][k].astype("f4"),
                           (~z["inaccessible"][:, k]).astype("i8"), z["occlusion"][:, k].astype("i8"))


def small(torch, ocnn):
    """The network of `SETTINGS`."""
    def cutter_module():
        return torch.nn.Sequential(torch.nn.Linear(4, 32), torch.nn.ReLU(),
                                   torch.nn.Linear(32, CUTTER), torch.nn.ReLU())
    return reference.network(
        torch, ocnn, cutter_module, CUTTER, encoder_channel=[STEM, *ENCODER],
        decoder_channel=[ENCODER[-1], *DECODER], encoder_blocks=ENCODER_BLOCKS,
        decoder_blocks=DECODER_BLOCKS, head_channel=HEAD)


def theirs(args):
    """Trains and scores with PyTorch; returns samples seen and the four scores."""
    import numpy as np
    import ocnn
    import torch

    torch.set_num_threads(args.threads)
    torch.manual_seed(1)
    random = np.random.default_rng(1)

    def batch(chosen):
        octrees, queries, cutters = [], [], []
        for i, (points, normals, cutter, *_) in enumerate(chosen):
            low, high = points.min(0), points.max(0)
            scale = 2 / (high - low).max()
            p = torch.from_numpy((points - (low + high) / 2) * scale).clamp(-0.999999, 0.999999)
            octree = ocnn.octree.Octree(5, 2)
            octree.build_octree(ocnn.octree.Points(p, torch.from_numpy(normals)))
            octrees.append(octree)
            queries.append(torch.cat([p, torch.full((len(p), 1), float(i))], dim=1))
            cutters.append(torch.from_numpy(cutter * scale))
        octree = ocnn.octree.merge_octrees(octrees)
        octree.construct_all_neigh()
        labels = [torch.from_numpy(np.concatenate([s[k] for s in chosen])) for k in (3, 4)]
        return octree, torch.cat(queries), torch.stack(cutters).float(), labels

    data = ocnn.modules.InputFeature("ND")
    train, validation = list(samples(args.data)), list(samples(args.validate))
    net = small(torch, ocnn)
    sgd = torch.optim.SGD(net.parameters(), 0.05, momentum=0.9, weight_decay=5e-4)
    order, seen, start = [], 0, time.perf_counter()
    while time.perf_counter() - start < args.seconds:
        if len(order) < BATCH:
            order = list(random.permutation(len(train)))
        octree, query, cutter, labels = batch([train[order.pop()] for _ in range(BATCH)])
        sgd.zero_grad()
        logits = net(data(octree), octree, octree.depth, query, cutter)
        sum(torch.nn.functional.cross_entropy(x, y) for x, y in zip(logits, labels)).backward()
        torch.nn.utils.clip_grad_norm_(net.parameters(), 5.0)
        sgd.step()
        seen += BATCH

    net.eval()
    scores = []
    for sample in validation:
        octree, query, cutter, labels = batch([sample])
        with torch.no_grad():
            logits = net(data(octree), octree, octree.depth, query, cutter)
        row = []
        for x, y, positive in zip(logits, labels, (0, 1)):
            found, truth = x.argmax(1) == positive, y == positive
            hits, errors = (found & truth).sum().item(), (found != truth).sum().item()
            row += [1 - errors / len(truth), 2 * hits / max(2 * hits + errors, 1) if hits + errors else 1.0]
        scores.append(row)
    return seen, np.mean(scores, axis=0).tolist()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", nargs="+", required=True, help="data sets to train on")
    parser.add_argument("--validate", nargs="+", required=True, help="data sets to score on")
    parser.add_argument("--deepmill", default="target/release/deepmill", help="the program")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=120.0, help="of training, each side")
    parser.add_argument("--side", choices=["deepmill", "PyTorch"], help="only this one")
    args = parser.parse_args()
    print(f"{platform.platform()}, {os.cpu_count()} processors, {args.threads} threads, {args.seconds} s each")
    print(f"{'':<9} {'samples':>8} {'Acc_i':>6} {'F1_i':>6} {'Acc_o':>6} {'F1_o':>6}")
    for name, side in {"deepmill": ours, "PyTorch": theirs}.items():
        if args.side in (None, name):
            seen, scores = side(args)
            print(f"{name:<9} {seen:>8} " + " ".join(f"{100 * x:>6.1f}" for x in scores), flush=True)


if __name__ == "__main__":
    main()

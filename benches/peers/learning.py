"""Trains the same network in PyTorch and in deepmill: same data, same settings, same processor time.

    pip install torch ocnn matplotlib
    cargo build --release
    python benches/peers/learning.py --deepmill target/release/deepmill --data DATA --validate VAL
    python benches/peers/learning.py --data DATA --validate VAL --threads 1 --seconds 3600 --side deepmill > a.csv
    python benches/peers/learning.py --data DATA --validate VAL --threads 1 --seconds 3600 --side PyTorch > b.csv
    python benches/peers/learning.py --draw a.csv b.csv --picture learning.svg

DATA and VAL are folders of `deepmill dataset build`. Both sides train a U-Net of the reference's kind
(layers of PyPI's ocnn; widths for a CPU, cutter modules without batch norm) with SGD at a constant rate,
batches of 4 and clipped gradients, and predict VAL with the weights of several times. Time is that of
the processor (Linux), all threads together: other work beside does not count, nor does reading the data
set or predicting. Scores are averages over samples; F1 of the classes inaccessible and occlusion.
"""

import argparse
import csv
import json
import os
import pathlib
import platform
import shutil
import signal
import subprocess
import sys
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


# Seconds of training after which the weights are scored, up to `--seconds`.
TIMES = [30, 60, 120, 300, 600, 1200, 1800, 2400, 3000, 3600, 5400, 7200, 10800, 14400]
SCORES = ["acc_i", "f1_i", "acc_o", "f1_o"]


def times(args):
    return [seconds for seconds in TIMES if seconds < args.seconds] + [args.seconds]


def processor_seconds(process):
    """Of a running process, all its threads."""
    fields = pathlib.Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def ours(args):
    """Trains and scores with deepmill: seconds, samples seen and the four scores at every time."""
    with tempfile.TemporaryDirectory() as folder:
        config, run = pathlib.Path(folder, "settings.toml"), pathlib.Path(folder, "run")
        config.write_text(SETTINGS)
        threads = ["--threads", str(args.threads)]
        process = subprocess.Popen([args.deepmill, *threads, "train", "--data", *args.data, "--out", run,
                                    "--config", config], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
        # The first epoch is counted by the clock: what was before it is reading.
        start, left, kept, n_rows = None, times(args), [], 0
        while left:
            time.sleep(0.2)
            if process.poll() is not None:
                raise SystemExit("deepmill train ended early")
            if not (run / "model.safetensors").exists():
                continue
            rows = list(csv.DictReader((run / "history.csv").open()))
            if len(rows) == n_rows:
                continue
            n_rows = len(rows)
            if start is None:
                start = processor_seconds(process) - float(rows[0]["seconds"]) * args.threads
            seconds = processor_seconds(process) - start
            if seconds >= left[0]:
                weights = pathlib.Path(folder, f"{len(kept)}.safetensors")
                shutil.copy(run / "model.safetensors", weights)
                kept.append((seconds, 40 * n_rows, weights))
                left = [later for later in left if later > seconds]
        process.send_signal(signal.SIGINT)
        process.wait()
        for seconds, seen, weights in kept:
            table = subprocess.run([args.deepmill, *threads, "--json", "eval", "--data", *args.validate, "--model",
                                    weights], check=True, stdout=subprocess.PIPE,
                                   stderr=subprocess.DEVNULL).stdout
            sets = [row for row in json.loads(table)["per_sample"] if row["engine"] == "network"]
            yield seconds, seen, [sets[-1][key] for key in SCORES]


def samples(folders):
    """Points, normals, cutter, labels of both heads (classes as deepmill has them) of every sample."""
    import numpy as np
    for folder in map(pathlib.Path, folders):
        for part in json.loads((folder / "manifest.json").read_text())["parts"]:
            if part["content"] is None:
                continue
            with np.load(folder / part["content"]["file"]) as z:
                arrays = {name: z[name] for name in ("points", "normals", "cutters", "inaccessible", "occlusion")}
            for k, cutter in enumerate(arrays["cutters"]):
                yield (arrays["points"], arrays["normals"], cutter.astype("f4"),
                       ~arrays["inaccessible"][:, k], arrays["occlusion"][:, k].copy())


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
    """Trains and scores with PyTorch: as `ours`."""
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
        labels = [torch.from_numpy(np.concatenate([s[k] for s in chosen]).astype("i8")) for k in (3, 4)]
        return octree, torch.cat(queries), torch.stack(cutters).float(), labels

    data = ocnn.modules.InputFeature("ND")
    train, validation = list(samples(args.data)), list(samples(args.validate))
    net = small(torch, ocnn)
    sgd = torch.optim.SGD(net.parameters(), 0.05, momentum=0.9, weight_decay=5e-4)

    def scores():
        net.eval()
        rows = []
        for sample in validation:
            octree, query, cutter, labels = batch([sample])
            with torch.no_grad():
                logits = net(data(octree), octree, octree.depth, query, cutter)
            row = []
            for x, y, positive in zip(logits, labels, (0, 1)):
                found, truth = x.argmax(1) == positive, y == positive
                hits, errors = (found & truth).sum().item(), (found != truth).sum().item()
                row += [1 - errors / len(truth),
                        2 * hits / max(2 * hits + errors, 1) if hits + errors else 1.0]
            rows.append(row)
        net.train()
        return np.mean(rows, axis=0).tolist()

    order, seen, spent = [], 0, 0.0
    for until in times(args):
        start = time.process_time()
        while spent + time.process_time() - start < until:
            if len(order) < BATCH:
                order = list(random.permutation(len(train)))
            octree, query, cutter, labels = batch([train[order.pop()] for _ in range(BATCH)])
            sgd.zero_grad()
            logits = net(data(octree), octree, octree.depth, query, cutter)
            sum(torch.nn.functional.cross_entropy(x, y) for x, y in zip(logits, labels)).backward()
            torch.nn.utils.clip_grad_norm_(net.parameters(), 5.0)
            sgd.step()
            seen += BATCH
        spent += time.process_time() - start
        yield spent, seen, scores()


def draw(files, picture):
    """The scores of tables of this program over time."""
    import matplotlib
    matplotlib.use("svg")
    from matplotlib import pyplot

    rows = [row for file in files for row in csv.DictReader(line for line in open(file) if line[0] != "#")]
    figure, axes = pyplot.subplots(1, 4, figsize=(12, 3), sharex=True, layout="constrained")
    names = ["accuracy, accessibility", "F1, inaccessible", "accuracy, occlusion", "F1, occlusion"]
    for axis, score, name in zip(axes, SCORES, names):
        for side in dict.fromkeys(row["side"] for row in rows):
            own = [row for row in rows if row["side"] == side]
            axis.plot([float(row["seconds"]) / 60 for row in own], [100 * float(row[score]) for row in own],
                      marker=".", label=side)
        axis.set(title=name + " (%)", xlabel="minutes of one core")
        axis.grid(alpha=0.3)
    axes[0].legend()
    figure.savefig(picture)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", nargs="+", help="data sets to train on")
    parser.add_argument("--validate", nargs="+", help="data sets to score on")
    parser.add_argument("--deepmill", default="target/release/deepmill", help="the program")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=240.0, help="of processor time in training, each side")
    parser.add_argument("--side", choices=["deepmill", "PyTorch"], help="only this one")
    parser.add_argument("--draw", nargs="+", metavar="CSV", help="draw these tables, train nothing")
    parser.add_argument("--picture", default="learning.svg", help="SVG of --draw")
    args = parser.parse_args()
    if args.draw:
        return draw(args.draw, args.picture)
    if not args.data or not args.validate:
        parser.error("--data and --validate are missing")
    print(f"# {platform.platform()}, {os.cpu_count()} processors, {args.threads} threads")
    table = csv.writer(sys.stdout, lineterminator="\n")
    table.writerow(["side", "seconds", "samples", *SCORES])
    for name, side in {"deepmill": ours, "PyTorch": theirs}.items():
        if args.side in (None, name):
            for seconds, seen, scores in side(args):
                table.writerow([name, f"{seconds:.0f}", seen, *(f"{score:.4f}" for score in scores)])
                sys.stdout.flush()


if __name__ == "__main__":
    main()

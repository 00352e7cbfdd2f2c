"""Times the network against its reference structure in PyTorch, on the same clouds and threads.

    pip install torch ocnn
    cargo build --release
    python benches/peers/unet.py --deepmill target/release/deepmill CLOUD.npz...

Clouds are archives with `points` and `normals`, both [n, 3]: eight of about 7,000 points for the
published table. Every measurement is a process of its own, so that its peak memory is its own; the
two sides take turns. Each process repeats the work until `--seconds` have passed and reports the
median. The reference structure is the U-Net of PyPI's ocnn with DeepMill's cutter features and two
heads; its weights are random, which does not matter to its speed.
"""

import argparse
import json
import os
import platform
import resource
import statistics
import subprocess
import sys
import time

import reference

WORKS = ["octree", "forward", "step"]


def published(torch, ocnn):
    """The network of the paper."""
    def unit(c_in, c_out):
        return [torch.nn.Linear(c_in, c_out), torch.nn.ReLU(),
                torch.nn.BatchNorm1d(c_out), torch.nn.Dropout(0.3)]
    return reference.network(
        torch, ocnn, lambda: torch.nn.Sequential(*unit(4, 32), *unit(32, 256)), 256)


def worker(args):
    """One measurement of the PyTorch side, as JSON on standard output."""
    import numpy as np
    import ocnn
    import torch

    torch.set_num_threads(args.threads)
    torch.manual_seed(0)
    depth, n = 5, args.batch
    clouds = []
    for i in range(n):
        with np.load(args.clouds[i % len(args.clouds)]) as cloud:
            p, normals = (torch.from_numpy(np.array(cloud[k], "f4")) for k in ("points", "normals"))
        p = p - p.mean(0)
        clouds.append((p / p.abs().max() * 0.8, normals.abs()))

    def build():
        octrees = []
        for p, normals in clouds:
            octree = ocnn.octree.Octree(depth, 2)
            octree.build_octree(ocnn.octree.Points(p, normals))
            octrees.append(octree)
        octree = ocnn.octree.merge_octrees(octrees)
        octree.construct_all_neigh()
        return octree

    octree = build()
    ids = torch.cat([torch.full((len(p), 1), float(i)) for i, (p, _) in enumerate(clouds)])
    query = torch.cat([torch.cat([p for p, _ in clouds]), ids], dim=1)
    cutter = torch.tensor([[1.5, 5.0 + i, 20.0, 5.0] for i in range(n)])
    labels = torch.arange(len(query)) % 2
    base = peak_memory()
    if args.work == "octree":
        run = build
    else:
        data = ocnn.modules.InputFeature("ND")(octree)
        network = published(torch, ocnn)
        if args.work == "forward":
            network.eval()

            def run():
                with torch.no_grad():
                    network(data, octree, depth, query, cutter)
        else:
            network.train()
            if n == 1:  # its batch norm over shapes refuses a single one
                network.cutters.eval()
            sgd = torch.optim.SGD(network.parameters(), 0.1, momentum=0.9, weight_decay=5e-4)

            def run():
                sgd.zero_grad()
                logits = network(data, octree, depth, query, cutter)
                loss = sum(torch.nn.functional.cross_entropy(x, labels) for x in logits)
                loss.backward()
                sgd.step()

    run()
    times, start = [], time.perf_counter()
    while not times or time.perf_counter() - start < args.seconds:
        before = time.perf_counter()
        run()
        times.append(time.perf_counter() - before)
    print(json.dumps({"seconds": statistics.median(times), "repeats": len(times),
                      "peak_bytes": peak_memory(), "start_bytes": base,
                      "version": f"torch {torch.__version__}, ocnn {ocnn.__version__}"}))


def peak_memory():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def processor():
    """Name of the processor, where Linux tells it."""
    try:
        lines = open("/proc/cpuinfo", encoding="utf8").read().splitlines()
        return next(line.split(":")[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor()


def measure(command):
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clouds", nargs="+", help="archives with points and normals")
    parser.add_argument("--deepmill", default="target/release/deepmill", help="the program")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=8.0, help="per measurement")
    parser.add_argument("--batches", type=int, nargs="+", default=[1, 8])
    parser.add_argument("--work", choices=WORKS, help="only this one")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--batch", type=int, default=1, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.worker:
        return worker(args)

    version = subprocess.run([args.deepmill, "--version"], check=True, stdout=subprocess.PIPE, text=True)
    print(f"{processor()}, {platform.platform()}, {os.cpu_count()} processors, {args.threads} threads")
    print(f"{'work':<8} {'batch':>5} {'PyTorch s':>10} {'deepmill s':>10} {'ratio':>6}"
          f" {'PyTorch MB':>11} {'deepmill MB':>11} {'ratio':>6}")
    for work in WORKS if args.work is None else [args.work]:
        for batch in args.batches:
            common = [*args.clouds, "--threads", str(args.threads), "--seconds", str(args.seconds),
                      "--work", work, "--batch", str(batch)]
            peer = measure([sys.executable, __file__, "--worker", *common])
            ours = measure([args.deepmill, "--json", "bench", "network", *common])
            mb = [x["peak_bytes"] / 1e6 for x in (peer, ours)]
            print(f"{work:<8} {batch:>5} {peer['seconds']:>10.4f} {ours['seconds']:>10.4f}"
                  f" {peer['seconds'] / ours['seconds']:>6.1f} {mb[0]:>11.0f} {mb[1]:>11.0f}"
                  f" {mb[0] / mb[1]:>6.1f}", flush=True)
    print(f"{version.stdout.strip()}; {peer['version']}, python {platform.python_version()}")


if __name__ == "__main__":
    main()

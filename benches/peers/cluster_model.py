"""Prints the model of a training step on many nodes (docs/cluster.md).

    python benches/peers/cluster_model.py

A step of B samples on N nodes, b = B / N samples each:

    T(N)  = b c + u + exposed
    tree  = 2 P s (N - 1) / N / w  +  2 K (N - 1) a        P numbers of s bytes, K buckets
    exposed = max(0, tree - h b c)                         h: share of the compute that the tree can run beside
    efficiency = T(1) / (N T(N)) for the same B (strong), T(1) / T(N) for the same b (weak)

c: seconds per sample, forward and backward, measured. u: seconds of the update, the same on every node: 20 bytes per parameter
through a memory of 10 GB/s, assumed. w: bytes per second of a node's link; a: seconds per message, assumed. Not in it: parts of
unequal size, for which all wait, and drawing samples.
"""

import argparse

BYTES_PER_NUMBER = 4
BUCKET = 1 << 20
# Share of a step's compute that is the last group's backward, with one group per process: two thirds.
OVERLAP = 2 / 3

# Parameters, and seconds per sample on two cores: 0.065 s of processor time, and docs/benchmarks.md (a step of eight).
NETWORKS = {
    "slim, 3.9 M": {"n": 3_922_772, "sample_s": 0.065 / 2},
    "reference, 43.3 M": {"n": 43_313_668, "sample_s": 0.662 / 8},
}
UPDATE_S = 20 / 10e9
# Bytes per second and seconds per message: of the link alone, and what its usual software takes for a small message.
LINKS = {"10 Gbit/s": (1.25e9, 20e-6), "100 Gbit/s": (12.5e9, 2e-6)}
NODES = [8, 64, 512]


def step_s(network, link, n_nodes, samples_per_node, speed=1.0, overlap=OVERLAP, size=BYTES_PER_NUMBER):
    """Seconds of a step; `speed` is that of a node, in units of two cores."""
    bandwidth, latency = link
    compute = samples_per_node * network["sample_s"] / speed
    n_buckets = -(-network["n"] // BUCKET)
    tree = 2 * network["n"] * size * (n_nodes - 1) / n_nodes / bandwidth
    tree += 2 * n_buckets * (n_nodes - 1) * latency
    return compute + network["n"] * UPDATE_S + max(0.0, tree - overlap * compute)


def efficiency(network, link, n_nodes, batch, weak, speed, **more):
    """Of `n_nodes` against one; `batch` is the whole step's, or with `weak` that of each node."""
    if weak:
        one = step_s(network, link, 1, batch, speed, **more)
        return one / step_s(network, link, n_nodes, batch, speed, **more)
    if n_nodes > batch:
        return None
    one = step_s(network, link, 1, batch, speed, **more)
    return one / n_nodes / step_s(network, link, n_nodes, batch / n_nodes, speed, **more)


def table(speed):
    """Efficiency over networks, links and numbers of nodes of `speed`."""
    print("| network | link | step | " + " | ".join(f"{n} nodes" for n in NODES) + " |")
    print("|---|---|---|" + "---|" * len(NODES))
    cases = [("128 samples", 128, False), ("8 samples per node", 8, True)]
    for name, network in NETWORKS.items():
        for link_name, link in LINKS.items():
            for case, batch, weak in cases:
                found = [efficiency(network, link, n, batch, weak, speed) for n in NODES]
                cells = ["—" if e is None else f"{100 * e:.0f} %" for e in found]
                print(f"| {name} | {link_name} | {case} | " + " | ".join(cells) + " |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--speeds", type=float, nargs="+", default=[1, 16])
    for speed in parser.parse_args().speeds:
        print(f"\nNodes of {2 * speed:g} cores, if a sample takes 1/{speed:g} of the time on two:\n")
        table(speed)


if __name__ == "__main__":
    main()

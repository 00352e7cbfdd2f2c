"""Seconds of labels from Python beside those of the program, in turns.

python benches/peers/python_labels.py target/release/deepmill PART.stl [CUTTER] [RUNS]
"""

import json
import statistics
import subprocess
import sys
import tempfile
import time

import deepmill


def of_program(program, part, cutter):
    with tempfile.TemporaryDirectory() as folder:
        command = [program, "label", part, "--cutter", cutter, "--no-picture", "--force", "--json", "--out", folder]
        result = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    seconds = result.get("seconds", result)
    return sum(seconds[stage] for stage in ["sites_s", "labels_s", "findings_s"])


def of_python(part, cutter):
    mesh = deepmill.Mesh.read(part, force=True)
    start = time.perf_counter()
    outcome = deepmill.analyze(mesh, cutter)
    outcome[0].inaccessible.sum()
    seconds = time.perf_counter() - start
    return seconds, seconds - sum(outcome.seconds)


def main(program, part, cutter="1.5,6,40,5", runs="16"):
    theirs, ours, beside = [], [], []
    for run in range(int(runs)):
        for python in (run % 2, 1 - run % 2):
            if python:
                seconds, rest = of_python(part, cutter)
                ours.append(seconds)
                beside.append(rest)
            else:
                theirs.append(of_program(program, part, cutter))
    ratios = [of_ours / of_theirs for of_ours, of_theirs in zip(ours, theirs)]
    print(f"program: {min(theirs):.3f} s at least, {statistics.median(theirs):.3f} s median")
    print(f"Python:  {min(ours):.3f} s at least, {statistics.median(ours):.3f} s median, ", end="")
    print(f"{1e3 * statistics.median(beside):.2f} ms of it outside of the library")
    print(f"ratio of each two in turn: {statistics.median(ratios):.3f} median")


main(*sys.argv[1:])

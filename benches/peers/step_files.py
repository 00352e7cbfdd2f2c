#!/usr/bin/env python3
"""Holds the STEP files of a folder, as `deepmill` reads them, against Open CASCADE.

    pip install cadquery-ocp
    cargo build --release --features step
    python benches/peers/step_files.py FOLDER [--program target/release/deepmill] [--chord 0.02]

Of every file: the volume and area of its solids by Open CASCADE (exact surfaces, mm), what `deepmill check --json` has, or
why it is refused. Bodies that overlap are joined by deepmill and counted twice by Open CASCADE. Ends with code 1 if the
volume of a file that is accepted is off by more than 1 %.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import time

from OCP.BRepGProp import BRepGProp
from OCP.GProp import GProp_GProps
from OCP.IFSelect import IFSelect_RetDone
from OCP.STEPControl import STEPControl_Reader
from OCP.TopAbs import TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer


def exact(path):
    """Volume, area and number of solids."""
    reader = STEPControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_RetDone:
        return None
    reader.TransferRoots()
    volume = area = 0.0
    n = 0
    explorer = TopExp_Explorer(reader.OneShape(), TopAbs_SOLID)
    while explorer.More():
        for which in ("VolumeProperties_s", "SurfaceProperties_s"):
            props = GProp_GProps()
            getattr(BRepGProp, which)(explorer.Current(), props)
            if which.startswith("V"):
                volume += props.Mass()
            else:
                area += props.Mass()
        n += 1
        explorer.Next()
    return abs(volume), area, n


def main():
    args = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    args.add_argument("folder")
    args.add_argument("--program", default="target/release/deepmill")
    args.add_argument("--chord", default="0.02")
    args = args.parse_args()
    files = sorted(p for p in pathlib.Path(args.folder).rglob("*") if p.suffix.lower() in (".step", ".stp"))
    accepted = wrong = 0
    for path in files:
        known = exact(path)
        start = time.monotonic()
        try:
            done = subprocess.run([args.program, "check", str(path), "--chord", args.chord, "--json"], capture_output=True, text=True, timeout=300)
        except subprocess.TimeoutExpired:
            print(f"{path.name}: more than 300 s")
            continue
        seconds = time.monotonic() - start
        found = json.loads(done.stdout or "{}")
        words = "no solid by Open CASCADE" if known is None else f"{known[2]} solids, {known[0]:.6g} mm3, {known[1]:.6g} mm2"
        if "volume_mm3" not in found:
            print(f"{path.name}: {words}; refused in {seconds:.1f} s: {found.get('error', done.stderr)[:230]}")
            continue
        accepted += 1
        volume, area = found["volume_mm3"], found["area_mm2"]
        off = abs(volume / known[0] - 1) if known and known[0] else float("nan")
        wrong += off > 0.01
        print(f"{path.name}: {words}; {volume:.6g} mm3 ({100 * off:.2f} % off), {area:.6g} mm2, {found.get('n_triangles', '?')} triangles, {seconds:.1f} s")
    print(f"{accepted} of {len(files)} accepted, {wrong} off by more than 1 %")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())

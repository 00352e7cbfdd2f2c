#!/usr/bin/env python3
"""Edits a part that `deepmill watch` watches, and tests its page in a headless Chromium; measures what an edit takes.

    apt-get install chromium; pip install numpy pillow
    python benches/peers/watch_page.py PART.stl [--program deepmill] [--edits 50] [--out SHOTS] [-- OPTIONS OF LABEL]

The part is a binary STL file. An edit moves all corners in the upper half of its longest side along that side, by another
length up to a hundredth of it each time, and writes the file in place. Tested: the picture changes, what changed is
outlined; camera, section, tab, selection, the tool and scrolling stay; a broken file is said and the picture stays; the page asks
nobody but its own server, and the console is silent; memory of the program and of the page does not grow over the
edits. Measured: from the end of a write until the answers are served, until the page has drawn them, and until the
version is complete; first without a browser, which draws with the same processors here. Ends with code 1 if something
does not hold.
"""

import argparse
import pathlib
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

from report_page import BROWSERS, SOFTWARE, Browser, Tests, differing, stage, values


def read(path):
    import numpy as np
    data = pathlib.Path(path).read_bytes()
    kind = np.dtype([("normal", "<3f4"), ("corners", "<9f4"), ("more", "<u2")])
    return data[:84], np.frombuffer(data, kind, offset=84)


def edited(part, share):
    """The part, longer by a share of its longest side."""
    head, triangles = part
    triangles = triangles.copy()
    corners = triangles["corners"].reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    k = int((high - low).argmax())
    upper = corners[:, k] > 0.5 * (low[k] + high[k])
    corners[upper, k] += share * (high[k] - low[k])
    triangles["corners"] = corners.reshape(-1, 9)
    return head + triangles.tobytes()


def resident_mib(pid):
    for line in pathlib.Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) / 1024


def outlined(picture):
    """Pixels of the outline of what changed."""
    return sum(r > 180 and g < 90 and b > 140 for r, g, b in values(picture))


def wait_for(browser, version):
    """Until the page has drawn this version; the time."""
    browser.run(f"new Promise((r) => {{ const f = () => report.live.version >= {version} && !report.viewer.waiting ? r() : setTimeout(f, 5); f(); }})")
    return time.monotonic()


def wait_until_complete(browser):
    """Until the page has drawn all that there is of its version."""
    browser.run("new Promise((r) => { const f = () => report.live.bar.dataset.kind === 'shown' && !report.viewer.waiting ? r() : setTimeout(f, 5); f(); })")


def state(url, after):
    import json
    import urllib.request
    with urllib.request.urlopen(f"{url}state?after={after}", timeout=60) as answer:
        return json.load(answer)


def served(url, version, is_complete):
    """Until the answers of this version are served, or all that there is of it; the time."""
    after = -1
    while True:
        now = state(url, after)
        if now["version"] >= version and (now["kind"] == "shown" or not is_complete):
            return time.monotonic()
        after = now["number"]


def say(n_triangles, times):
    for name, all_of in times.items():
        print(f"     {n_triangles} triangles, {len(all_of)} edits, {name} after: median {statistics.median(all_of):.3f} s, worst {max(all_of):.3f} s")


def main():
    args = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    args.add_argument("part")
    args.add_argument("--program", default="deepmill")
    args.add_argument("--edits", type=int, default=50)
    args.add_argument("--out", default="watch-shots", help="folder of the screenshots")
    own = sys.argv[1:]
    split = own.index("--") if "--" in own else len(own)
    options = own[split + 1:] or ["--cutter", "1.5,6,40,5"]
    args = args.parse_args(own[:split])
    browser_program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser_program is None:
        print("skipped: no Chromium on this machine (apt-get install chromium)")
        return 0
    out = pathlib.Path(args.out)
    out.mkdir(parents=True, exist_ok=True)
    part, tests = read(args.part), Tests()
    folder = tempfile.mkdtemp()
    path = pathlib.Path(folder) / "part.stl"
    path.write_bytes(edited(part, 0))
    program = subprocess.Popen([args.program, "watch", str(path), *options], stdout=subprocess.PIPE, text=True)
    url = next("http://" + line.split("http://")[1].strip() for line in program.stdout if "http://" in line)
    # Nobody reads on: the pipe must not fill.
    import threading
    threading.Thread(target=lambda: [None for _ in program.stdout], daemon=True).start()
    times, complete, version = [], [], 1
    for k in range(args.edits):
        path.write_bytes(edited(part, 0.0002 * (1 + k % 50)))
        start, version = time.monotonic(), version + 1
        times.append(served(url, version, False) - start)
        complete.append(served(url, version, True) - start)
    say(len(part[1]), {"without a browser, answers served": times, "complete": complete})
    path.write_bytes(edited(part, 0))
    version += 1
    served(url, version, True)
    browser = Browser(browser_program, SOFTWARE)
    try:
        browser.size(1280, 800)
        tests.hold("the view starts", browser.visit(url), "")
        browser.settle()
        box = stage(browser)
        browser.run("report.viewer.look(30, 40)")
        browser.run("report.viewer.setCut('y')")
        n_findings = browser.run("report.viewer.data.views[0].findings.length")
        if n_findings:
            browser.run("(() => { const v = report.viewer; v.selected = 1; v.mark(); v.change(); })()")
        browser.run("(() => { const v = report.viewer; v.choose(nearest(v.data, v.camera.middle, (i) => !!v.data.pose(0, i))); })()")
        browser.settle()
        before = browser.picture().crop(box)
        before.save(out / "before.png")
        axis = "(() => { const pose = report.viewer.toolAt(); return pose && pose.axis; })()"
        tests.hold("the tool is at a site", browser.run(axis) is not None, browser.run(axis))
        kept = "(() => { const v = report.viewer, c = v.camera; return JSON.stringify([c.azimuth, c.elevation, c.center, c.scale, v.cut, v.view]); })()"
        was = browser.run(kept)
        chosen = "(() => { const v = report.viewer; return v.selected ? v.data.views[0].findings[v.selected - 1].id : null; })()"
        was_chosen = browser.run(chosen)

        path.write_bytes(edited(part, 0.1))
        version += 1
        wait_for(browser, version)
        wait_until_complete(browser)
        browser.settle()
        after = browser.picture()
        after.save(out / "after.png")
        tests.hold("an edit changes the picture", differing(before, after.crop(box)) > 0.002, "")
        tests.hold("camera, section and tab stay", browser.run(kept) == was, was)
        is_chosen = browser.run(chosen)
        tests.hold("the selection stays, or its finding is gone", is_chosen in (was_chosen, None), f"{was_chosen}, {is_chosen}")
        tests.hold("the tool stays, or its site has no pose", browser.run("report.viewer.site") >= 0, browser.run(axis))
        said = browser.run("document.getElementById('live').innerText")
        tests.hold("the change is said", "reachable" in said, repr(said))
        browser.run("report.viewer.setCut('off'); report.viewer.home()")
        browser.settle()
        n = outlined(browser.picture())
        browser.picture().save(out / "outlined.png")
        tests.hold("what changed is outlined", n > 20, f"{n} pixels")

        path.write_bytes(edited(part, 0)[:-700])
        browser.run("new Promise((r) => { const f = () => document.getElementById('live').dataset.kind === 'error' ? r() : setTimeout(f, 50); f(); })")
        browser.settle()
        browser.picture().save(out / "broken.png")
        said = browser.run("document.getElementById('live').innerText")
        tests.hold("a broken file is said", "part.stl" in said, repr(said[:120]))
        tests.hold("and the version before stays", browser.run("report.live.version") == version, "")

        times, drawn, complete = [], [], []
        memory = []
        for k in range(args.edits):
            path.write_bytes(edited(part, 0.0002 * (1 + k % 50)))
            start, version = time.monotonic(), version + 1
            times.append(served(url, version, False) - start)
            drawn.append(wait_for(browser, version) - start)
            complete.append(served(url, version, True) - start)
            wait_until_complete(browser)
            if k % 10 == 9 or k == 0:
                heap = browser.call("Runtime.getHeapUsage")["usedSize"] / 2**20 if browser.call("HeapProfiler.collectGarbage") is not None else 0
                memory.append((k + 1, resident_mib(program.pid), heap))
        say(len(part[1]), {"answers served": times, "drawn": drawn, "complete": complete})
        for k, mib, heap in memory:
            print(f"     after {k} edits: program {mib:.1f} MiB, page {heap:.1f} MiB")
        third = [m for m in memory if m[0] > args.edits // 3]
        if len(third) > 1:
            tests.hold("the program's memory does not grow", third[-1][1] < 1.1 * third[0][1] + 5, "")
            tests.hold("the page's memory does not grow", third[-1][2] < 1.1 * third[0][2] + 2, "")
        browser.size(390, 844, 2, True)
        browser.settle()
        browser.picture().save(out / "phone.png")
        width = browser.run("document.documentElement.scrollWidth")
        tests.hold("a phone's width is kept", width <= 390, f"{width} of 390")
        foreign = [request for request in browser.requests if not request.startswith((url[:80], "data:", "blob:"))]
        tests.hold("nothing is requested from elsewhere", not foreign, foreign)
        tests.hold("the console is silent", not browser.faults, browser.faults)
    finally:
        browser.close()
        program.kill()
        shutil.rmtree(folder, ignore_errors=True)
    print(f"screenshots in {out}; {tests.failed} failed")
    return int(tests.failed > 0)


if __name__ == "__main__":
    sys.exit(main())

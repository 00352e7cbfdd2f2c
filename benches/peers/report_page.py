#!/usr/bin/env python3
"""Opens a report page in a headless Chromium and tests it by pixels; takes screenshots; measures frames.

    apt-get install chromium poppler-utils; pip install pillow
    deepmill label PART.stl --cutter 1.5,6,40,5 --report --out labels
    python benches/peers/report_page.py labels/report.html [--out SHOTS] [--frames 20]

Without a browser it says so and ends with code 0: no test needs one. The browser is driven over a pipe (Chrome DevTools
Protocol), without a network: a request to anywhere, or a line in the console, is a failure. WebGL is rendered in software
(SwiftShader). Ends with code 1 if something does not hold.

Tested: the view draws the part in the legend's colors; turning changes the picture; a section shows the cut and moves; the pointer
finds a site; a click on a site draws the tool there, whole and cut; a click on a finding brings its color to the middle; tabs change the colors; the page without WebGL shows its tables and
a message; phone and print layouts fit their width.
"""

import argparse
import base64
import io
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

BROWSERS = ["chromium", "chromium-browser", "google-chrome"]
SOFTWARE = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


class Browser:
    """A headless Chromium at the other end of two pipes."""

    def __init__(self, program, flags):
        self.folder = tempfile.mkdtemp()
        to_browser, self.out = os.pipe()
        self.inp, from_browser = os.pipe()
        moved = [os.dup2(to_browser, 103), os.dup2(from_browser, 104)]

        def place():
            os.dup2(103, 3)
            os.dup2(104, 4)

        command = [program, "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--remote-debugging-pipe", "--hide-scrollbars",
                   "--disable-background-networking", "--disable-component-update", "--no-first-run",
                   f"--user-data-dir={self.folder}", *flags, "about:blank"]
        self.process = subprocess.Popen(command, close_fds=False, preexec_fn=place, stdout=subprocess.DEVNULL,
                                        stderr=subprocess.DEVNULL)
        for end in [to_browser, from_browser, *moved]:
            os.close(end)
        self.buffer, self.number, self.session = b"", 0, None
        self.faults, self.requests = [], []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ["Page", "Runtime", "Log", "Network"]:
            self.call(f"{domain}.enable")

    def read(self):
        while b"\0" not in self.buffer:
            more = os.read(self.inp, 1 << 20)
            if not more:
                raise EOFError("the browser has ended")
            self.buffer += more
        text, self.buffer = self.buffer.split(b"\0", 1)
        return json.loads(text)

    def call(self, method, **params):
        self.number += 1
        message = {"id": self.number, "method": method, "params": params}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.out, json.dumps(message).encode() + b"\0")
        while True:
            answer = self.read()
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]
            self.note(answer)

    def note(self, event):
        method, params = event.get("method"), event.get("params", {})
        if method == "Runtime.consoleAPICalled":
            self.faults.append("console: " + " ".join(str(a.get("value")) for a in params["args"]))
        elif method == "Runtime.exceptionThrown":
            self.faults.append("exception: " + json.dumps(params["exceptionDetails"])[:500])
        elif method == "Log.entryAdded" and params["entry"]["level"] in ("error", "warning"):
            text = params["entry"]["text"]
            # The browser's own remark about software rendering and about reading pixels back.
            if "GPU stall" not in text and "software" not in text.lower():
                self.faults.append("log: " + text)
        elif method == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"][:80])

    def run(self, expression):
        result = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in result:
            raise RuntimeError(json.dumps(result["exceptionDetails"])[:800])
        return result["result"].get("value")

    def size(self, width, height, scale=1, mobile=False):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=scale, mobile=mobile)

    def open(self, path):
        return self.visit(pathlib.Path(path).resolve().as_uri())

    def visit(self, url):
        self.call("Page.navigate", url=url)
        for _ in range(600):
            if self.run("document.readyState === 'complete' && !!window.report"):
                break
            time.sleep(0.1)
        return self.run("window.report.ready")

    def settle(self):
        """Waits until nothing moves and the fine picture is drawn."""
        time.sleep(0.3)
        for _ in range(40):
            self.run("new Promise((r) => setTimeout(() => requestAnimationFrame(() => requestAnimationFrame(r)), 450))")
            if self.run("(() => { const v = window.report.viewer; return !v || (!v.waiting && v.canvas.width >= Math.round(v.width * v.fine) && v.last === 0); })()"):
                return

    def picture(self, full=False):
        from PIL import Image
        shot = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=full)
        return Image.open(io.BytesIO(base64.b64decode(shot["data"]))).convert("RGB")

    def mouse(self, kind, x, y, **more):
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def click(self, selector):
        box = self.run(f"(() => {{ const e = document.querySelector({json.dumps(selector)}); e.scrollIntoView({{block: 'center'}});"
                       " const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; })()")
        for kind in ["mouseMoved", "mousePressed", "mouseReleased"]:
            self.mouse(kind, *box, button="none" if kind == "mouseMoved" else "left", clickCount=1)

    def close(self):
        self.process.terminate()
        self.process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)


def values(image):
    """The pixels in rows."""
    return list(image.get_flattened_data() if hasattr(image, "get_flattened_data") else image.getdata())


def hue_share(image, box, color, spread=0.10):
    """Share of the pixels of a box that have a shade of `color`."""
    import colorsys
    want = colorsys.rgb_to_hls(*(c / 255 for c in color))
    pixels = values(image.crop(box))

    def same(pixel):
        h, _, s = colorsys.rgb_to_hls(*(c / 255 for c in pixel))
        near = min(abs(h - want[0]), 1 - abs(h - want[0])) < spread
        return near and s > 0.25 if want[2] > 0.2 else s < 0.2
    return sum(map(same, pixels)) / len(pixels)


def differing(a, b):
    """Share of the pixels that differ visibly."""
    from PIL import ImageChops
    pixels = values(ImageChops.difference(a, b).convert("L"))
    return sum(p > 12 for p in pixels) / len(pixels)


class Tests:
    def __init__(self):
        self.failed = 0

    def hold(self, what, holds, found=""):
        self.failed += not holds
        print(f"{'ok  ' if holds else 'FAIL'} {what} {found}", flush=True)


def stage(browser):
    box = browser.run("(() => { const b = document.getElementById('canvas').getBoundingClientRect(); return [b.x, b.y, b.right, b.bottom]; })()")
    return [int(v) for v in box]


def seen_site(browser, which="true"):
    """The seen site nearest to the middle of those that hold `which`, an expression of its number `i`, and where it is."""
    return browser.run("""(() => { const v = report.viewer; v.draw(1); const w = v.canvas.width, h = v.canvas.height, s = v.gpu.sites(0, 0, w, h), is = new Map();
        const holds = (n) => { if (!is.has(n)) { const i = n - 1; is.set(n, WHICH); } return is.get(n); };
        let best = -1, gap = 1e9; s.forEach((n, k) => { if (n) { const x = k % w, y = h - 1 - Math.floor(k / w), d = Math.hypot(x - w / 2, y - h / 2); if (d < gap && holds(n)) { gap = d; best = k; } } });
        return best < 0 ? null : [s[best] - 1, (best % w) / v.ratio, (h - 1 - Math.floor(best / w)) / v.ratio]; })()""".replace("WHICH", which))


def place_of(browser, site):
    """Where a site is on the canvas."""
    return browser.run(f"(() => {{ const v = report.viewer, q = v.camera.project(v.data.place({site})); return [v.width / 2 + q[0] * v.camera.scale, v.height / 2 - q[1] * v.camera.scale]; }})()")


def tool(browser, box, tests, out):
    """A click on a site with a pose draws the tool; a section cuts it, its box and a second click hide it."""
    browser.mouse("mouseMoved", box[0] + 3, box[3] - 3)
    browser.run("report.viewer.home()")
    browser.settle()
    site = seen_site(browser, "!!v.data.pose(v.view, i)")
    if site is None:
        print("     no site with a pose is seen: no tool")
        return
    # Its own place, not a pixel between sites.
    near = place_of(browser, site[0])
    at = [box[0] + near[0], box[1] + near[1]]

    def click():
        browser.mouse("mouseMoved", *at)
        # Coarse frames have coarse sites.
        browser.settle()
        for kind in ["mousePressed", "mouseReleased"]:
            browser.mouse(kind, *at, button="left", clickCount=1)
        browser.mouse("mouseMoved", box[0] + 3, box[3] - 3)
        browser.settle()

    without = browser.picture()
    click()
    tests.hold("a click chooses its site", browser.run("report.viewer.site") == site[0], site)
    shown = browser.picture()
    shown.save(out / "tool.png")
    tests.hold("and draws the tool there", differing(without.crop(box), shown.crop(box)) > 0.005, "")
    select = "(() => { const e = document.getElementById('axis'); e.value = '%s'; e.dispatchEvent(new Event('change')); })()"
    browser.run(select % "tool")
    browser.settle()
    cut = browser.picture()
    cut.save(out / "tool-section.png")
    # The cutting portion's color as a cut shows it.
    n = sum(abs(r - 230) < 14 and abs(g - 133) < 14 and abs(b - 41) < 22 for r, g, b in values(cut.crop(box)))
    tests.hold("a section through it cuts it", n > 100, f"{n} pixels of what cuts")
    browser.run(select % "off")
    browser.click("#tool")
    browser.mouse("mouseMoved", box[0] + 3, box[3] - 3)
    browser.settle()
    hidden = differing(shown.crop(box), browser.picture().crop(box))
    tests.hold("its box hides it", hidden > 0.005 and browser.run("report.viewer.toolAt()") is None, f"{100 * hidden:.1f} % of the pixels")
    browser.click("#tool")
    browser.settle()
    click()
    gone, chosen = differing(without.crop(box), browser.picture().crop(box)), browser.run("report.viewer.site")
    tests.hold("a second click takes it away", gone < 0.002 and chosen == -1, f"site {chosen}, {100 * gone:.2f} % of the pixels")


def desktop(browser, path, tests, out):
    browser.size(1280, 800)
    tests.hold("the view starts", browser.open(path), "")
    browser.settle()
    first = browser.picture()
    first.save(out / "desktop.png")
    box = stage(browser)
    views = browser.run("report.viewer.data.views.map((v) => ({classes: v.classes, findings: v.findings.length, counts: v.classes.map((_, k) => v.of.reduce((n, c) => n + (c === k), 0))}))")
    view = views[0]
    # The ground is gray too: a color says more.
    largest = max(range(len(view["classes"])), key=lambda k: (max(view["classes"][k]["color"]) - min(view["classes"][k]["color"]) > 60) * view["counts"][k])
    color = view["classes"][largest]["color"]
    share = hue_share(first, box, color)
    tests.hold(f"`{view['classes'][largest]['name']}` is seen", share > 0.02, f"{100 * share:.1f} % of the pixels")

    x, y = (box[0] + box[2]) / 2, (box[1] + box[3]) / 2
    browser.mouse("mousePressed", x, y, button="left", clickCount=1)
    for k in range(1, 6):
        browser.mouse("mouseMoved", x + 20 * k, y - 6 * k, button="left", buttons=1)
    browser.mouse("mouseReleased", x + 100, y - 30, button="left", clickCount=1)
    browser.settle()
    turned = browser.picture()
    tests.hold("a drag turns the part", differing(first.crop(box), turned.crop(box)) > 0.02, "")
    browser.run("report.viewer.home()")
    browser.settle()
    tests.hold("Fit goes back", differing(first.crop(box), browser.picture().crop(box)) < 0.002, "")

    browser.run("(() => { const e = document.getElementById('axis'); e.value = 'y'; e.dispatchEvent(new Event('change')); })()")
    browser.settle()
    flipped = browser.run("(() => { document.getElementById('flip').click(); return report.viewer.cut; })()")
    browser.settle()
    cut = browser.picture()
    cut.save(out / "section.png")
    closed = browser.run("report.viewer.data.about.closed")
    cap = sum(hatch(p) for p in values(cut.crop(box)))
    tests.hold("a section shows the cut", (not closed) or cap > 500, f"{cap} pixels of the cut, plane {flipped}")
    browser.run("(() => { const e = document.getElementById('cut'); e.value = +e.min + 0.25 * (e.max - e.min); e.dispatchEvent(new Event('input')); })()")
    browser.settle()
    moved = browser.picture()
    tests.hold("the slider moves it", differing(cut.crop(box), moved.crop(box)) > 0.005, "")
    browser.run("report.viewer.setCut('off')")
    browser.settle()

    site = seen_site(browser)
    browser.mouse("mouseMoved", box[0] + site[1], box[1] + site[2])
    browser.settle()
    words = browser.run("document.getElementById('tip').innerText")
    shown = browser.run("getComputedStyle(document.getElementById('tip')).display")
    tests.hold("the pointer finds its site", shown == "block" and f"site\t{site[0]}" in words, repr(words[:60]))
    near = place_of(browser, site[0])
    gap = ((near[0] - site[1]) ** 2 + (near[1] - site[2]) ** 2) ** 0.5 / browser.run("report.viewer.camera.scale * report.viewer.data.about.spacing_mm")
    tests.hold("and that site is there", gap < 1.7, f"{gap:.2f} spacings away")
    browser.picture().save(out / "hover.png")
    tool(browser, box, tests, out)

    for number in range(1, min(view["findings"], 3) + 1):
        browser.click(f"#view0 tr[data-finding='{number}']")
        time.sleep(0.6)
        browser.settle()
        picture = browser.picture()
        picture.save(out / f"finding-{number}.png")
        seen = browser.run(f"(() => {{ const v = report.viewer, f = v.data.views[0].finding; v.draw(1); const s = v.gpu.sites(0, 0, v.canvas.width, v.canvas.height); return s.reduce((n, i) => n + (i && f[i - 1] === {number} ? 1 : 0), 0); }})()")
        k = browser.run(f"report.viewer.data.views[0].of[report.viewer.data.views[0].finding.indexOf({number})]")
        middle = [int(box[0] + 0.2 * (box[2] - box[0])), int(box[1] + 0.2 * (box[3] - box[1])), int(box[0] + 0.8 * (box[2] - box[0])), int(box[1] + 0.8 * (box[3] - box[1]))]
        share = hue_share(picture, middle, view["classes"][k]["color"])
        tests.hold(f"a click flies to finding {number}", seen > 300 and share > 0.005, f"{seen} pixels, {100 * share:.1f} % of the middle has its color")
    for tab in range(1, len(views)):
        before = browser.picture()
        browser.run("report.viewer.home()")
        browser.click(f"#tab{tab}")
        browser.settle()
        picture = browser.picture()
        picture.save(out / f"tab-{tab}.png")
        tests.hold(f"tab {tab} is shown", browser.run(f"!document.getElementById('view{tab}').hidden && report.viewer.view === {tab}") and differing(before, picture) > 0.002, "")
    browser.click("#tab0") if len(views) > 1 else None
    browser.run("report.viewer.home()")


def other_sizes(browser, path, tests, out):
    browser.call("Emulation.setEmulatedMedia", media="", features=[{"name": "prefers-color-scheme", "value": "dark"}])
    browser.settle()
    dark = browser.picture()
    dark.save(out / "dark.png")
    tests.hold("dark is dark", sum(values(dark.resize((32, 20)).convert("L"))) / 640 < 110, "")
    browser.call("Emulation.setEmulatedMedia", media="", features=[{"name": "prefers-color-scheme", "value": "light"}])
    browser.size(390, 844, 2, True)
    browser.open(path)
    browser.settle()
    width = browser.run("document.documentElement.scrollWidth")
    browser.picture().save(out / "phone.png")
    tests.hold("a phone's width is kept", width <= 390, f"{width} of 390")
    browser.run("window.scrollTo(0, 520)")
    browser.settle()
    browser.picture().save(out / "phone-below.png")
    browser.size(1280, 800)
    browser.open(path)
    browser.settle()
    pdf = base64.b64decode(browser.call("Page.printToPDF", printBackground=False, preferCSSPageSize=True)["data"])
    (out / "print.pdf").write_bytes(pdf)
    if shutil.which("pdftoppm"):
        subprocess.run(["pdftoppm", "-r", "60", "-png", str(out / "print.pdf"), str(out / "print")], check=True)
    tests.hold("it prints", len(pdf) > 20_000, f"{len(pdf)} bytes")


def main():
    args = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    args.add_argument("page")
    args.add_argument("--out", default="report-shots", help="folder of the screenshots")
    args.add_argument("--frames", type=int, default=12, help="frames to time; 0 for none")
    args = args.parse_args()
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        print("skipped: no Chromium on this machine (apt-get install chromium)")
        return 0
    out = pathlib.Path(args.out)
    out.mkdir(parents=True, exist_ok=True)
    tests = Tests()
    browser = Browser(program, SOFTWARE)
    try:
        desktop(browser, args.page, tests, out)
        other_sizes(browser, args.page, tests, out)
        if args.frames:
            browser.size(1280, 800)
            browser.open(args.page)
            browser.settle()
            facts = browser.run("[report.viewer.data.nSites, report.viewer.data.about.n_triangles, report.viewer.canvas.width, report.viewer.canvas.height]")
            for samples in [1, 0.5, 0.34]:
                took = browser.run(f"report.viewer.measure({args.frames}, {samples})")
                print(f"     {facts[0]} sites, {facts[1]} triangles, {facts[2]} x {facts[3]} pixels, {samples} samples: {took:.1f} ms a frame, {1000 / took:.1f} per second (SwiftShader)")
        foreign = [url for url in browser.requests if not url.startswith(("file:", "data:", "blob:"))]
        tests.hold("nothing is requested from elsewhere", not foreign, foreign)
        tests.hold("the console is silent", not browser.faults, browser.faults)
    finally:
        browser.close()
    browser = Browser(program, ["--disable-3d-apis"])
    try:
        browser.size(1280, 800)
        started = browser.open(args.page)
        browser.settle()
        browser.picture().save(out / "without-webgl.png")
        words = browser.run("document.body.innerText")
        tests.hold("without WebGL: tables and a message", not started and "No 3-D view" in words and "Findings" in words, "")
    finally:
        browser.close()
    print(f"screenshots in {out}; {tests.failed} failed")
    return int(tests.failed > 0)


def hatch(pixel):
    """Whether a pixel has the color of a cut, light or dark stripe, or between."""
    r, g, b = pixel
    t = r / 107
    return 0.80 < t < 1.02 and abs(g - 115 * t) < 4 and abs(b - 128 * t) < 4


if __name__ == "__main__":
    sys.exit(main())

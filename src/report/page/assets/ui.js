"use strict";
// What the page does: draws when something changes, turns, cuts, flies to findings, says what a site is.

const $ = (id) => document.getElementById(id);
const still = () => matchMedia("(prefers-reduced-motion: reduce)").matches;
/** A number with about four digits. */
const short = (x) => !Number.isFinite(x) ? "–" : x === 0 ? "0" : Math.abs(x) >= 1e7 || Math.abs(x) < 1e-3 ? x.toPrecision(3) : Math.abs(x) >= 1e3 ? x.toFixed(0) : String(+x.toPrecision(4));
/** A vector with two decimals, none of them minus zero. */
const vector = (p) => p.map((x) => ((Math.round(100 * x) || 0) / 100).toFixed(2)).join(", ");

class Viewer {
  constructor(data) {
    this.data = data;
    this.canvas = $("canvas");
    this.gpu = new Gpu(this.canvas, data);
    this.camera = new Camera(data.about.low_box_mm, data.about.high_box_mm);
    this.cut = null; this.selected = 0; this.hover = 0; this.site = -1; this.off = new Set();
    this.moving = 1; this.view = 0;
    this.show(0);
    this.listen(); this.attach();
    new ResizeObserver(() => this.resize()).observe(this.canvas.parentElement);
    this.resize(); this.home();
  }
  // --- drawing ---
  resize() {
    const box = this.canvas.getBoundingClientRect(), before = this.fitted;
    this.fine = Math.min(devicePixelRatio || 1, 2);
    this.width = box.width || 1; this.height = box.height || 1;
    this.fitted = this.camera.fit(this.width, this.height).scale;
    if (before) this.camera.scale *= this.fitted / before;
    this.change();
  }
  /** Draws in the next frame, coarsely if frames are slow, and finely when nothing changes any more. */
  change() {
    clearTimeout(this.rest);
    this.rest = setTimeout(() => { this.last = 0; this.draw(this.slow ? 1 : 2); }, 140);
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame((now) => {
      this.waiting = false;
      const took = now - (this.last || now);
      if (took > 45 && took < 1500) { this.moving = Math.max(0.34, this.moving * 0.75); this.slow = true; }
      else if (took > 0 && took < 20) this.moving = Math.min(1, this.moving * 1.06);
      this.last = now;
      this.draw(this.moving);
    });
  }
  /** Draws with `samples` samples per pixel side; fewer than one: a coarser canvas. */
  draw(samples) {
    // A few sizes only: a new size costs new textures.
    const coarse = samples >= 0.9 ? 1 : samples >= 0.6 ? 0.7 : samples >= 0.45 ? 0.5 : 0.34;
    this.ratio = this.fine * coarse;
    const [width, height] = [this.width, this.height].map((v) => Math.max(1, Math.round(v * this.ratio)));
    if (this.canvas.width !== width || this.canvas.height !== height) { this.canvas.width = width; this.canvas.height = height; }
    samples = Math.max(1, samples);
    const style = getComputedStyle(document.documentElement), ground = style.getPropertyValue("--ground").trim();
    const rgb = (hex) => [1, 3, 5].map((k) => parseInt(hex.length === 4 ? hex[(k + 1) / 2].repeat(2) : hex.slice(k, k + 2), 16) / 255);
    const palette = new Float32Array(48);
    const { classes, layer } = this.data.views[this.view], colors = classes.map((c) => c.color).concat(layer ? layer.colors : []);
    colors.forEach((color, i) => palette.set((this.off.has(i % classes.length) ? [176, 186, 198] : color).map((v) => v / 255), 3 * i));
    this.gpu.draw(this.camera, { ratio: this.ratio, cut: this.cut, palette, ground: rgb(ground), cap: [0.42, 0.45, 0.5], changes: !!this.data.views[this.view].changed, selected: this.selected, hover: this.hover || this.site + 1, tool: this.toolAt(), coarse: coarse < 0.6 }, samples);
    this.overlay();
  }
  /** The tool in its pose at the chosen site, if one is known and shown. */
  toolAt() {
    return this.site >= 0 && $("tool").checked ? this.data.pose(this.view, this.site) : null;
  }
  /** Chooses a site, or none. */
  choose(site) {
    this.site = site;
    this.offer();
    if ($("axis").value === "tool") this.setCut(this.toolAt() ? "tool" : "off");
    this.change();
  }
  /** The section through the tool is there with the tool. */
  offer() {
    $("toolbox").hidden = !this.data.hasTools;
    document.querySelector("#axis [value=tool]").hidden = !this.toolAt();
  }
  /** Outlines of fixtures and table, in front of all but what a section leaves out. */
  outline() {
    const points = this.data.about.outlines, { scale } = this.camera, cut = this.cut;
    if (!points.length) return;
    const path = $("outlines").firstElementChild;
    if (!$("fixtures").firstElementChild.checked) { path.setAttribute("d", ""); return; }
    const depth = (p) => (cut ? cut[3] - dot(p, cut) : 1), words = [];
    for (let i = 0; i < points.length; i += 2) {
      let [a, b] = [points[i], points[i + 1]];
      const [at, bt] = [depth(a), depth(b)];
      if (at < 0 && bt < 0) continue;
      if (at < 0 || bt < 0) { const edge = add(a, add(b, a, -1), at / (at - bt)); if (at < 0) a = edge; else b = edge; }
      const [p, q] = [a, b].map((r) => { const [x, y] = this.camera.project(r); return `${(0.5 * this.width + x * scale).toFixed(1)} ${(0.5 * this.height - y * scale).toFixed(1)}`; });
      words.push(`M${p}L${q}`);
    }
    path.setAttribute("d", words.join(""));
  }
  /** In a section that is seen: what is left standing on the sites at it, along their normals, as wide as a site. */
  rests() {
    const svg = $("rests"), { about, views, place, normal } = this.data, { scale, back } = this.camera, cut = this.cut;
    if (!svg) return;
    const { of, classes, values } = views[this.view], rest = values.find((value) => value.name === "rest");
    const seen = rest && cut && dot(cut, back) > 0.05, words = classes.map(() => []), most = 2 * this.camera.radius;
    for (let i = 0; seen && i < about.n_sites; i++) {
      const r = Math.min(rest.of[i], most);
      if (!(r > 0)) continue;
      const p = place(i), off = dot(cut, p) - cut[3];
      if (Math.abs(off) > 0.75 * about.spacing_mm) continue;
      const n = normal(i), across = dot(cut, n);
      if (Math.abs(across) > 0.7) continue;
      const foot = add(p, cut, -off), ends = [foot, add(foot, add(n, cut, -across), r)];
      const [a, b] = ends.map((q) => { const [x, y] = this.camera.project(q); return `${(0.5 * this.width + x * scale).toFixed(1)} ${(0.5 * this.height - y * scale).toFixed(1)}`; });
      words[of[i]].push(`M${a}L${b}`);
    }
    const path = (k) => `<path d="${words[k].join("")}" stroke="rgb(${classes[k].color})" stroke-width="${(0.9 * about.spacing_mm * scale).toFixed(1)}"/>`;
    svg.innerHTML = words.map((_, k) => (words[k].length ? path(k) : "")).join("");
  }
  /** Scale bar, axes, outlines and what is left in a section. */
  overlay() {
    this.outline(); this.rests();
    const unit = this.data.about.unit, scale = this.camera.scale * unit.mm, most = 160 / scale, power = 10 ** Math.floor(Math.log10(most));
    const length = [5, 2, 1].map((k) => k * power).find((l) => l <= most) || power;
    $("scale").firstElementChild.style.width = `${length * scale}px`;
    $("scale").lastElementChild.textContent = `${+length.toPrecision(1)} ${unit.name}`;
    const { right, up, back } = this.camera, colors = ["#c0392b", "#2e8b4a", "#2f6fd0"];
    const axes = [0, 1, 2].map((k) => ({ k, x: right[k], y: up[k], z: back[k] })).sort((a, b) => a.z - b.z);
    $("axes").innerHTML = axes.map(({ k, x, y }) => `<line x1="42" y1="42" x2="${42 + 26 * x}" y2="${42 - 26 * y}" stroke="${colors[k]}" stroke-width="2.5"/>` +
      `<text x="${42 + 34 * x}" y="${42 - 34 * y}" fill="${colors[k]}">${"xyz"[k]}</text>`).join("");
  }
  /** The tab `v`. */
  show(v) {
    const view = this.data.views[v];
    this.view = v; this.selected = 0; this.off = new Set();
    this.paint();
    document.querySelectorAll("[role=tab]").forEach((tab, i) => { tab.setAttribute("aria-selected", i === v); tab.tabIndex = i === v ? 0 : -1; });
    document.querySelectorAll("[role=tabpanel]").forEach((panel, i) => { panel.hidden = i !== v; });
    this.mark();
    if (this.fitted) this.choose(this.site); else this.offer();
  }
  /** Groups of the sites, with the layer upon them if it is shown. */
  paint() {
    const { of, classes, layer, finding, changed } = this.data.views[this.view];
    const shown = layer && layer.shown ? of.map((group, i) => group + classes.length * layer.of[i]) : of;
    this.gpu.setClasses(changed ? shown.map((group, i) => group | 128 * changed[i]) : shown, finding);
  }
  /** Shows these data in place of those before; camera, section, tab, hidden groups and selection stay. */
  take(data) {
    const before = this.data.views[this.view], { camera, off, site } = this;
    const was = site < 0 ? null : { place: this.data.place(site), normal: this.data.normal(site) };
    const chosen = this.selected ? before.findings[this.selected - 1] : null;
    const shown = new Map(this.data.views.map((view) => [view.name, view.layer && view.layer.shown]));
    this.data = data;
    this.gpu.take(data);
    this.camera = new Camera(data.about.low_box_mm, data.about.high_box_mm);
    this.camera.turnTo(camera.azimuth, camera.elevation);
    this.fitted = this.camera.fit(this.width, this.height).scale;
    Object.assign(this.camera, { center: camera.center, scale: camera.scale });
    this.attach();
    data.views.forEach((view, v) => {
      if (!view.layer || typeof shown.get(view.name) !== "boolean") return;
      view.layer.shown = shown.get(view.name);
      document.querySelectorAll(`#view${v} input[data-layer]`).forEach((box) => { box.checked = view.layer.shown; });
    });
    const v = Math.max(0, data.views.findIndex((view) => view.name === before.name));
    this.hover = 0; $("tip").style.display = "none";
    // Other sites may lie there.
    this.site = was ? nearest(data, was.place, (i) => dot(was.normal, data.normal(i)) > 0.5) : -1;
    this.show(v);
    const view = data.views[v];
    if (JSON.stringify(view.classes) === JSON.stringify(before.classes)) {
      this.off = off;
      document.querySelectorAll(`#view${v} tr[data-class]`).forEach((row) => row.classList.toggle("off", off.has(+row.dataset.class)));
    }
    if (chosen) this.selected = 1 + view.findings.findIndex((finding) => finding.id === chosen.id);
    const fixtures = $("fixtures");
    if (fixtures) fixtures.hidden = !data.about.outlines.length;
    if (fixtures && fixtures.hidden) $("outlines").firstElementChild.setAttribute("d", "");
    this.mark(); this.range(); this.change();
  }
  mark() {
    document.querySelectorAll("tr[data-finding]").forEach((row) => row.setAttribute("aria-selected", !row.closest("[role=tabpanel]").hidden && +row.dataset.finding === this.selected));
  }
  // --- the eye ---
  home() {
    this.camera.turnTo(-58, 30);
    Object.assign(this.camera, this.camera.fit(this.width, this.height));
    this.change();
  }
  look(azimuth, elevation) {
    const c = this.camera, zoom = c.scale / this.fitted, aim = new Camera(this.data.about.low_box_mm, this.data.about.high_box_mm);
    aim.turnTo(azimuth, elevation);
    const fit = aim.fit(this.width, this.height);
    return this.fly({ azimuth, elevation, center: zoom > 1.3 ? c.center : fit.center, scale: zoom > 1.3 ? c.scale : fit.scale });
  }
  /** Moves the eye in 0.4 seconds; resolves when it is there. */
  fly(to) {
    const c = this.camera, from = { azimuth: c.azimuth, elevation: c.elevation, center: c.center, scale: c.scale }, start = performance.now();
    const turn = ((to.azimuth - from.azimuth + 540) % 360) - 180;
    return new Promise((done) => {
      const step = (now) => {
        const t = still() ? 1 : Math.min(1, Math.max(0, (now - start) / 400)), s = t * t * (3 - 2 * t), mix = (a, b) => a + s * (b - a);
        c.turnTo(from.azimuth + s * turn, mix(from.elevation, to.elevation));
        c.center = from.center.map((x, k) => mix(x, to.center[k]));
        c.scale = from.scale * (to.scale / from.scale) ** s;
        this.change();
        if (t < 1) requestAnimationFrame(step); else done();
      };
      requestAnimationFrame(step);
    });
  }
  /** Flies to a finding; what stands before it is cut away. */
  async goTo(number) {
    const finding = this.data.views[this.view].findings[number - 1];
    if (!finding) return;
    this.selected = number; this.setCut("off"); this.mark();
    const { finding: of } = this.data.views[this.view];
    this.choose(nearest(this.data, finding.at_mm, (i) => of[i] === number));
    const n = finding.normal, flat = norm(n) > 0.1, size = Math.max(norm(add(finding.high_mm, finding.low_mm, -1)), 4 * this.data.about.spacing_mm);
    const azimuth = flat && Math.hypot(n[0], n[1]) > 0.2 ? Math.atan2(n[1], n[0]) * 180 / Math.PI + 22 : this.camera.azimuth;
    const elevation = flat ? Math.asin(Math.max(-1, Math.min(1, n[2]))) * 180 / Math.PI : 30;
    const tilted = elevation > 50 ? elevation - 28 : elevation < -50 ? elevation + 28 : elevation + 16;
    const scale = Math.max(this.fitted, Math.min(0.3 * Math.min(this.width, this.height) / size, 8 * this.fitted));
    const middle = finding.low_mm.map((l, k) => 0.5 * (l + finding.high_mm[k]));
    await this.fly({ azimuth, elevation: tilted, center: scale > 1.5 * this.fitted ? middle : this.camera.middle, scale });
    if (this.selected !== number) return;
    this.cutFree(number, finding, flat ? n : this.camera.back);
    this.change();
  }
  /** Pixels in which a finding is seen, in a coarse picture. */
  seen(number) {
    const of = this.data.views[this.view].finding;
    this.draw(0.5);
    return this.gpu.sites(0, 0, this.canvas.width, this.canvas.height).reduce((n, site) => n + (site && of[site - 1] === number ? 1 : 0), 0);
  }
  /** If less than half of what a finding could show is seen: the section, before it or through its place, that shows most of it. */
  cutFree(number, { area_mm2, at_mm }, n) {
    const of = this.data.views[this.view].finding, open = this.seen(number);
    const most = Math.min(area_mm2 * (this.camera.scale * this.ratio) ** 2, 0.6 * this.canvas.width * this.canvas.height);
    const facing = Math.max(0.25, Math.abs(dot(n, this.camera.back)));
    if (open > 0.5 * most * facing) return;
    let before = -Infinity;
    for (let i = 0; i < of.length; i++) if (of[i] === number) before = Math.max(before, dot(n, this.data.place(i)));
    const axes = [0, 1, 2].map((k) => [0, 1, 2].map((i) => (i === k ? Math.sign(this.camera.back[k]) || 1 : 0)));
    const cuts = [[...n, before + 0.6 * this.data.about.spacing_mm], ...[n, ...axes, this.camera.back].map((m) => [...m, dot(m, at_mm) + 1e-3 * this.camera.radius])];
    let best = [1.3 * open, null];
    for (const cut of cuts) { this.cut = cut; const count = this.seen(number); if (count > best[0]) best = [count, cut]; }
    this.cut = best[1];
    if (this.cut) $("axis").value = "free";
    this.range();
  }
  // --- the section ---
  setCut(axis, flip) {
    const k = "xyz".indexOf(axis);
    if (axis === "off") this.cut = null;
    else if (k >= 0) this.cut = [0, 1, 2].map((i) => (i === k ? 1 : 0)).concat(this.camera.middle[k]);
    else if (axis === "view") this.cut = [...this.camera.back, dot(this.camera.back, this.camera.middle)];
    else if (axis === "tool") this.cut = throughTool(this.toolAt(), this.data.normal(this.site), this.camera.back);
    if (flip && this.cut) this.cut = this.cut.map((v) => -v);
    if (axis !== "free" || !this.cut) $("axis").value = axis;
    this.range(); this.change();
  }
  /** The slider follows the section. */
  range() {
    const slider = $("cut");
    $("cutting").hidden = !this.cut;
    if (!this.cut) return;
    const n = this.cut.slice(0, 3), along = this.camera.corners.map((p) => dot(n, p));
    [slider.min, slider.max] = [Math.min(...along), Math.max(...along)];
    slider.step = (slider.max - slider.min) / 1000 || 1;
    slider.value = this.cut[3];
    this.say();
  }
  say() {
    const k = [0, 1, 2].find((i) => Math.abs(this.cut[i]) > 0.9999);
    const { name, mm } = this.data.about.unit, at = this.cut[3] / mm;
    $("place").textContent = k === undefined ? `${short(at)} ${name}` : `${"xyz"[k]} = ${short(at * Math.sign(this.cut[k]))} ${name}`;
  }
  // --- sites ---
  /** The site seen at a place of the canvas, CSS pixels; -1 if there is none. */
  at(x, y) {
    return this.gpu.sites(x * this.ratio, this.canvas.height - 1 - y * this.ratio, 1, 1)[0] - 1;
  }
  facts(i) {
    const view = this.data.views[this.view], f = view.finding ? view.finding[i] : 0;
    const { name, mm } = this.data.about.unit, at = this.data.place(i).map((x) => x / mm);
    const rows = [["site", i], ["answer", view.classes[view.of[i]].name],
      [`place, ${name}`, mm === 1 ? vector(at) : at.map((x) => x.toFixed(4)).join(", ")],
      ["normal", vector(this.data.normal(i))]];
    if (view.layer && view.layer.of[i]) rows.push([view.layer.name, "yes"]);
    const pose = this.data.pose(this.view, i);
    if (pose) rows.push(["tool axis", pose.axis.map((x) => short(Math.round(1e4 * x) / 1e4 || 0)).join(", ")],
      [`tool tip, ${name}`, mm === 1 ? vector(pose.tip) : pose.tip.map((x) => (x / mm).toFixed(4)).join(", ")]);
    if (f) rows.push(["finding", `${f} (${short(view.findings[f - 1].area_mm2 / mm / mm)} ${name}²)`]);
    for (const value of view.values) if (!Number.isNaN(value.of[i])) rows.push([value.name,
      value.unit === "mm" ? `${short(value.of[i] / mm)} ${name}` : short(value.of[i]) + (value.unit ? ` ${value.unit}` : "")]);
    return rows;
  }
  tip(x, y) {
    const i = this.at(x, y), tip = $("tip");
    this.hover = i + 1;
    tip.style.display = i < 0 ? "none" : "block";
    if (i >= 0) {
      tip.replaceChildren(table(this.facts(i)));
      const box = tip.getBoundingClientRect();
      tip.style.left = `${Math.max(4, Math.min(x + 16, this.width - box.width - 6))}px`;
      tip.style.top = `${Math.max(4, y + 16 + box.height > this.height ? y - box.height - 12 : y + 16)}px`;
    }
    return i;
  }
  // --- hands ---
  listen() {
    const c = this.canvas, fingers = new Map();
    let travel = 0;
    const place = (e) => { const box = c.getBoundingClientRect(); return [e.clientX - box.left, e.clientY - box.top]; };
    const pan = (dx, dy) => { this.camera.center = add(this.camera.center, this.camera.across(-dx / this.camera.scale, dy / this.camera.scale)); };
    const zoom = (factor, [x, y]) => {
      const scale = Math.max(0.2 * this.fitted, Math.min(400 * this.fitted, this.camera.scale * factor));
      const [dx, dy] = [x - 0.5 * this.width, 0.5 * this.height - y], t = 1 / this.camera.scale - 1 / scale;
      this.camera.center = add(this.camera.center, this.camera.across(dx * t, dy * t));
      this.camera.scale = scale; this.change();
    };
    c.addEventListener("pointerdown", (e) => { c.setPointerCapture(e.pointerId); fingers.set(e.pointerId, place(e)); travel = 0; });
    c.addEventListener("pointermove", (e) => {
      const now = place(e), before = fingers.get(e.pointerId);
      if (!before) {
        if (e.pointerType === "mouse" && !this.looking) {
          this.looking = true;
          requestAnimationFrame(() => { this.looking = false; if (fingers.size === 0) { const old = this.hover; this.tip(...now); if (old !== this.hover) this.change(); } });
        }
        return;
      }
      const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
      travel += Math.hypot(dx, dy);
      if (fingers.size === 2) {
        const other = [...fingers].find(([id]) => id !== e.pointerId)[1], gap = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
        pan(0.5 * dx, 0.5 * dy); zoom(gap(now) / Math.max(1, gap(before)), now.map((v, k) => 0.5 * (v + other[k])));
      } else if (e.buttons & 6 || e.shiftKey || e.ctrlKey) pan(dx, dy);
      else this.camera.turnTo(this.camera.azimuth - 0.45 * dx, this.camera.elevation + 0.45 * dy);
      fingers.set(e.pointerId, now); $("tip").style.display = "none"; this.hover = 0; this.change();
    });
    const up = (e) => {
      if (fingers.delete(e.pointerId) && travel < 4 && e.type === "pointerup") {
        const i = this.tip(...place(e)), view = this.data.views[this.view], f = i >= 0 && view.finding ? view.finding[i] : 0;
        this.selected = f; this.mark(); this.choose(i === this.site ? -1 : i);
        const row = f && document.querySelector(`[role=tabpanel]:not([hidden]) tr[data-finding="${f}"]`);
        if (row) row.scrollIntoView({ block: "nearest" });
      }
    };
    c.addEventListener("pointerup", up); c.addEventListener("pointercancel", up);
    c.addEventListener("pointerleave", () => { $("tip").style.display = "none"; if (this.hover) { this.hover = 0; this.change(); } });
    c.addEventListener("wheel", (e) => { e.preventDefault(); zoom(Math.exp(-0.0015 * e.deltaY * (e.deltaMode ? 20 : 1)), place(e)); }, { passive: false });
    c.addEventListener("contextmenu", (e) => e.preventDefault());
    c.addEventListener("dblclick", () => { this.selected = 0; this.mark(); this.choose(-1); this.home(); });
    c.addEventListener("keydown", (e) => {
      const turn = { ArrowLeft: [5, 0], ArrowRight: [-5, 0], ArrowUp: [0, 5], ArrowDown: [0, -5] }[e.key], factor = { "+": 1.2, "=": 1.2, "-": 1 / 1.2 }[e.key];
      if (turn) this.camera.turnTo(this.camera.azimuth + turn[0], this.camera.elevation + turn[1]);
      else if (factor) zoom(factor, [0.5 * this.width, 0.5 * this.height]);
      else if (e.key === "Home") this.home();
      else if (e.key === "Escape") { this.selected = 0; this.mark(); this.setCut("off"); this.choose(-1); } else return;
      e.preventDefault(); this.change();
    });
    c.addEventListener("webglcontextlost", (e) => { e.preventDefault(); fail("The browser gave up the 3-D view; load the page again."); });
    document.querySelectorAll("[data-look]").forEach((button) => button.addEventListener("click", () => this.look(...button.dataset.look.split(",").map(Number))));
    $("home").addEventListener("click", () => { this.selected = 0; this.mark(); this.choose(-1); this.home(); });
    $("tool").addEventListener("change", () => this.choose(this.site));
    $("axis").addEventListener("change", (e) => this.setCut(e.target.value));
    $("cut").addEventListener("input", (e) => { this.cut[3] = +e.target.value; this.say(); this.change(); });
    $("flip").addEventListener("click", () => { this.cut = this.cut.map((v) => -v); this.range(); this.change(); });
    const fixtures = $("fixtures");
    if (fixtures) fixtures.addEventListener("change", () => this.change());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.change());
    addEventListener("beforeprint", () => {
      const theme = document.documentElement.dataset.theme;
      document.documentElement.dataset.theme = "light"; document.documentElement.style.setProperty("--ground", "#ffffff");
      this.draw(2); $("print").src = this.canvas.toDataURL("image/png");
      document.documentElement.style.removeProperty("--ground");
      if (theme) document.documentElement.dataset.theme = theme; else delete document.documentElement.dataset.theme;
      this.change();
    });
  }
  /** Listens to tabs and tables. */
  attach() {
    const tabs = [...document.querySelectorAll("[role=tab]")];
    tabs.forEach((tab, i) => {
      tab.addEventListener("click", () => this.show(i));
      tab.addEventListener("keydown", (e) => {
        const way = { ArrowRight: 1, ArrowLeft: -1 }[e.key];
        if (way) { const next = (i + way + tabs.length) % tabs.length; this.show(next); tabs[next].focus(); }
      });
    });
    const rows = (name, act) => document.querySelectorAll(`tr[data-${name}]`).forEach((row) => {
      const go = () => act(+row.dataset[name], row);
      row.addEventListener("click", go);
      row.addEventListener("keydown", (e) => { if (e.key === "Enter" || e.key === " ") { e.preventDefault(); go(); } });
    });
    document.querySelectorAll("[role=tabpanel]").forEach((panel, v) => panel.querySelectorAll("input[data-layer]").forEach((box) => {
      box.addEventListener("change", () => { this.data.views[v].layer.shown = box.checked; this.paint(); this.change(); });
    }));
    rows("finding", (number) => this.goTo(number));
    rows("class", (k, row) => { row.classList.toggle("off", !this.off.delete(k) && !!this.off.add(k)); this.change(); });
  }
  /** Milliseconds per frame over a turn of `n` frames at `samples` samples per pixel side, each frame waited for. */
  measure(n, samples = 1) {
    this.draw(samples); this.gpu.sites(0, 0, 1, 1);
    const start = performance.now();
    for (let k = 0; k < n; k++) { this.camera.turnTo(this.camera.azimuth + 360 / n, 30); this.draw(samples); this.gpu.sites(0, 0, 1, 1); this.gpu.gl.readPixels(0, 0, 1, 1, this.gpu.gl.RGBA, this.gpu.gl.UNSIGNED_BYTE, new Uint8Array(4)); }
    return (performance.now() - start) / n;
  }
}

/** A table of names and values. */
function table(rows) {
  const table = document.createElement("table");
  for (const cells of rows) { const row = table.insertRow(); for (const cell of cells) row.insertCell().textContent = cell; }
  return table;
}

function fail(words) {
  $("message").style.display = "flex"; $("message").textContent = words;
  document.querySelectorAll(".tools, #scale, #axes, #tip").forEach((e) => { e.style.display = "none"; });
}

/** Tabs without a 3-D view. */
function plainTabs() {
  const tabs = [...document.querySelectorAll("[role=tab]")], panels = [...document.querySelectorAll("[role=tabpanel]")];
  const show = (v) => { tabs.forEach((t, i) => t.setAttribute("aria-selected", i === v)); panels.forEach((p, i) => { p.hidden = i !== v; }); };
  tabs.forEach((tab, i) => tab.addEventListener("click", () => show(i)));
  show(0);
}

$("theme").addEventListener("click", () => {
  const root = document.documentElement, dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  root.dataset.theme = dark ? "light" : "dark";
  if (window.report && window.report.viewer) window.report.viewer.change();
});
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((d) => { d.open = true; }));
/** For tests: the viewer when it is ready, or why there is none. */
window.report = { ready: load().then((data) => { window.report.viewer = new Viewer(data); return true; }).catch((error) => {
  plainTabs();
  fail(`No 3-D view here (${error.message}). Tables and findings are complete; a current browser with WebGL 2 shows the part.`);
  return false;
}) };

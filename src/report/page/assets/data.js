"use strict";
// The numbers of the page: one deflated block, its parts named in the description (`src/report/page/pack.rs` writes it).

/** Bytes of the block, unpacked. */
async function unpack(text) {
  const packed = Uint8Array.from(atob(text.trim()), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Columns of 16-bit numbers: differences from row to row (zigzag), low bytes, then high bytes, column by column. */
function deltas(bytes, n, nColumns) {
  const out = new Uint16Array(n * nColumns);
  for (let c = 0; c < nColumns; c++) {
    const low = 2 * c * n, high = low + n;
    for (let i = 0, value = 0; i < n; i++) {
      const code = bytes[low + i] | (bytes[high + i] << 8);
      value = (value + ((code >>> 1) ^ -(code & 1))) & 0xffff;
      out[i * nColumns + c] = value;
    }
  }
  return out;
}

/** Indices: variable-length distances from the next index that has not occurred. */
function indices(bytes, n) {
  const out = new Uint32Array(n);
  for (let i = 0, at = 0, next = 0; i < n; i++) {
    let code = 0, shift = 0, byte;
    do { byte = bytes[at++]; code |= (byte & 127) << shift; shift += 7; } while (byte & 128);
    out[i] = next - code;
    if (code === 0) next++;
  }
  return out;
}

/** Numbers of four bytes: all first bytes, all second bytes, and so on. */
function words(bytes, n) {
  const out = new Uint8Array(4 * n);
  for (let k = 0; k < 4; k++) for (let i = 0; i < n; i++) out[4 * i + k] = bytes[k * n + i];
  return out.buffer;
}

/** Place and normal of `n` points as a vertex has them: three 16-bit coordinates, two bytes of normal. */
function vertices(part, name, n) {
  const places = deltas(part(name + ".places"), n, 3), normals = part(name + ".normals");
  const buffer = new ArrayBuffer(8 * n), shorts = new Uint16Array(buffer), signed = new Int8Array(buffer);
  for (let i = 0; i < n; i++) {
    shorts.set(places.subarray(3 * i, 3 * i + 3), 4 * i);
    signed[8 * i + 6] = normals[i] << 24 >> 24;
    signed[8 * i + 7] = normals[n + i] << 24 >> 24;
  }
  return buffer;
}

/** The unit vector that two bytes of an octahedron stand for. */
function unfold(a, b) {
  let x = a / 127, y = b / 127;
  const z = 1 - Math.abs(x) - Math.abs(y), t = Math.max(-z, 0);
  x += x >= 0 ? -t : t; y += y >= 0 ? -t : t;
  const l = Math.hypot(x, y, z);
  return [x / l, y / l, z / l];
}

/** The poses of a tab: of a site its tool, the axis from tip to spindle and the tip, mm; null if none is known. */
function poses(part, v, { tools, views, n_sites }, place) {
  const { pose } = views[v];
  if (!pose || pose === "first") return null;
  const axes = new Float32Array(words(part(`view${v}.axes`), 3 * pose.n_axes)), row = new Uint32Array(words(part(`view${v}.axis`), n_sites));
  const columns = [0, 1, 2].map((k) => new Uint32Array(words(part(`view${v}.tip${k}`), pose.n_tips))), of = new Int32Array(n_sites);
  for (let i = 0, next = 0; i < n_sites; i++) of[i] = row[i] ? next++ : -1;
  const step = (code) => (code >>> 1) ^ -(code & 1);
  return (i) => (of[i] < 0 ? null : { tool: tools[pose.tool], axis: [...axes.subarray(3 * row[i] - 3, 3 * row[i])],
    tip: place(i).map((x, k) => x + pose.step_mm * step(columns[k][of[i]])) });
}

/** Everything of the page, ready to draw. */
async function load() {
  const about = JSON.parse(document.getElementById("about").textContent);
  const bytes = await unpack(document.getElementById("block").textContent);
  const part = (name) => { const [at, length] = about.parts[name]; return bytes.subarray(at, at + length); };
  const data = { about, low: about.low_mm, step: about.step_mm, nSites: about.n_sites };
  if (about.n_triangles) {
    data.vertices = vertices(part, "mesh", about.n_vertices);
    data.indices = indices(part("mesh.indices"), 3 * about.n_triangles);
  }
  data.sites = vertices(part, "sites", about.n_sites);
  const shorts = new Uint16Array(data.sites), signed = new Int8Array(data.sites);
  data.place = (i) => [0, 1, 2].map((k) => data.low[k] + data.step * shorts[4 * i + k]);
  data.normal = (i) => unfold(signed[8 * i + 6], signed[8 * i + 7]);
  data.views = about.views.map((view, v) => ({
    ...view,
    of: part(`view${v}.class`),
    changed: view.has_changes ? part(`view${v}.changed`) : null,
    layer: view.layer ? { ...view.layer, of: part(`view${v}.layer`) } : null,
    finding: view.has_findings ? new Uint32Array(words(part(`view${v}.finding`), about.n_sites)) : null,
    values: view.values.map((value, k) => {
      const four = words(part(`view${v}.value${k}`), about.n_sites);
      return { ...value, of: value.real ? new Float32Array(four) : new Uint32Array(four) };
    }),
  }));
  const of = about.views.map((_, v) => poses(part, v, about, data.place));
  const first = (i) => { for (const pose of of) { const found = pose && pose(i); if (found) return found; } return null; };
  data.hasTools = of.some((pose) => pose);
  data.pose = (v, i) => (of[v] ? of[v](i) : about.views[v].pose === "first" ? first(i) : null);
  return data;
}

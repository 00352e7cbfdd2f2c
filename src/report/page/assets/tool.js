"use strict";
// The tool in a pose at the site that was clicked: a solid of revolution, translucent, cut by the section. One pass more
// than those of `gpu.js`, whose colors are mixed with it there.

const TOOL_V = CHUNK + `
layout(location = 0) in vec3 a_place; layout(location = 1) in vec3 a_normal;
uniform vec3 u_tip, u_axis, u_side, u_front;
out vec3 v_place, v_normal;
vec3 turn(vec3 p) { return p.x * u_side + p.y * u_front + p.z * u_axis; }
void main() { v_place = u_tip + turn(a_place); v_normal = turn(a_normal); gl_Position = clip(view(v_place)); }`;
// Normal, and in alpha the portion from 1 on, 8 more on the cut. There the portion is that at the plane, not that of the
// wall behind it.
const TOOL_F = CHUNK + `
in vec3 v_place, v_normal; uniform vec3 u_tip, u_axis; uniform vec2 u_portions[8]; out vec4 o_tool;
void main() {
  float beyond = dot(u_cut.xyz, v_place) - u_cut.w;
  if (beyond > 0.0) discard;
  bool cut = !gl_FrontFacing;
  vec3 p = cut ? v_place - u_back * (beyond / max(1e-4, dot(u_cut.xyz, u_back))) : v_place;
  float height = dot(p - u_tip, u_axis), kind = u_portions[7].x;
  for (int k = 6; k >= 0; k--) if (height <= u_portions[k].y + 1e-4) kind = u_portions[k].x;
  o_tool = vec4(0.5 + 0.5 * normalize(v_normal), (kind + (cut ? 9.0 : 1.0)) / 15.0);
}`;
/** Of what cuts, neck, shank and holder. */
const PORTIONS = [[0.90, 0.52, 0.16], [0.66, 0.74, 0.82], [0.50, 0.62, 0.74], [0.36, 0.42, 0.50]];
const AROUND = 96;

/** A unit vector across another one, and the third of both. */
function across(axis) {
  const k = axis.map(Math.abs).indexOf(Math.min(...axis.map(Math.abs))), e = [0, 1, 2].map((i) => (i === k ? 1 : 0));
  const side = unit(add(e, axis, -axis[k]));
  return [side, cross(axis, side)];
}

/** Places and normals of the triangles of a tool, and the corners of these. */
function revolve({ points }) {
  const lines = points.slice(1).map((b, k) => { const a = points[k], d = [b[0] - a[0], b[1] - a[1]], l = Math.hypot(...d) || 1; return { a, b, n: [d[1] / l, -d[0] / l] }; });
  // A corner of less than 20 degrees is one of an arc that is drawn in lines.
  const soft = (m, n) => { const s = m && n && m.n[0] * n.n[0] + m.n[1] * n.n[1] > 0.94; return s ? [0.5 * (m.n[0] + n.n[0]), 0.5 * (m.n[1] + n.n[1])] : n.n; };
  const out = [], corners = [];
  lines.forEach((line, k) => {
    const first = out.length / 6, ends = [[line.a, soft(lines[k - 1], line)], [line.b, soft(lines[k + 1], line)]];
    for (let i = 0; i <= AROUND; i++) {
      const c = Math.cos(2 * Math.PI * i / AROUND), s = Math.sin(2 * Math.PI * i / AROUND);
      for (const [[r, h], [u, w]] of ends) out.push(r * c, r * s, h, u * c, u * s, w);
      const at = first + 2 * i;
      if (i < AROUND) corners.push(at, at + 2, at + 1, at + 1, at + 2, at + 3);
    }
  });
  return { places: new Float32Array(out), corners: new Uint32Array(corners) };
}

/** The pass of the tool. */
class ToolPass {
  constructor(gpu) {
    this.gpu = gpu; this.program = gpu.program(TOOL_V, TOOL_F);
    this.size = [0, 0]; this.shapes = new Map();
  }
  /** Forgets the shapes of the data before. */
  clear() {
    const { gl } = this.gpu;
    for (const { array, buffers } of this.shapes.values()) { gl.deleteVertexArray(array); buffers.forEach((buffer) => gl.deleteBuffer(buffer)); }
    this.shapes.clear();
  }
  shape(tool) {
    if (this.shapes.has(tool)) return this.shapes.get(tool);
    const { gl } = this.gpu, { places, corners } = revolve(tool), array = gl.createVertexArray(), buffers = [gl.createBuffer(), gl.createBuffer()];
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers[0]); gl.bufferData(gl.ARRAY_BUFFER, places, gl.STATIC_DRAW);
    for (const k of [0, 1]) { gl.enableVertexAttribArray(k); gl.vertexAttribPointer(k, 3, gl.FLOAT, false, 24, 12 * k); }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers[1]); gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    this.shapes.set(tool, { array, buffers, n: corners.length });
    return this.shapes.get(tool);
  }
  resize() {
    const { gpu } = this, { gl } = gpu;
    if (this.size[0] === gpu.size[0] && this.size[1] === gpu.size[1]) return;
    // New textures take the place of what the active unit holds.
    gl.activeTexture(gl.TEXTURE4);
    for (const old of this.targets || []) gl.deleteTexture(old);
    if (this.frame) gl.deleteFramebuffer(this.frame);
    this.targets = [gpu.target(gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE), gpu.target(gl.DEPTH_COMPONENT24, gl.DEPTH_COMPONENT, gl.UNSIGNED_INT)];
    this.frame = gpu.frame(...this.targets);
    this.size = [...gpu.size];
  }
  /** Draws the tool in its pose; returns what the colors need. */
  draw(camera, values, { tool, axis, tip }) {
    const { gpu } = this, { gl } = gpu, top = tool.points[tool.points.length - 1][1], widest = Math.max(...tool.points.map(([r]) => r));
    const span = camera.radius + norm(add(tip, camera.middle, -1)) + top + widest, [side, front] = across(axis);
    const portions = [...tool.portions.slice(0, 7), ...Array(8).fill(tool.portions[tool.portions.length - 1])].slice(0, 8);
    this.resize();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 0]); gl.clearBufferfv(gl.DEPTH, 0, [1]);
    gpu.use(this.program, { ...values, u_radius: span, u_tip: tip, u_axis: axis, u_side: side, u_front: front, u_portions: portions.flat() });
    const { array, n } = this.shape(tool);
    gl.bindVertexArray(array);
    gl.drawElements(gl.TRIANGLES, n, gl.UNSIGNED_INT, 0);
    this.targets.forEach((texture, k) => { gl.activeTexture(gl.TEXTURE4 + k); gl.bindTexture(gl.TEXTURE_2D, texture); });
    return { u_tool: 4, u_tool_depth: 5, u_span: span, u_parts: PORTIONS.flat() };
  }
}

/** The site that is nearest to a place, of those for which `is` holds; -1 if there is none. */
function nearest(data, place, is) {
  let best = -1, least = Infinity;
  for (let i = 0; i < data.nSites; i++) {
    const gap = norm(add(data.place(i), place, -1));
    if (gap < least && is(i)) { least = gap; best = i; }
  }
  return best;
}

/** A plane through the axis of the tool and the site, its open side toward the eye. */
function throughTool({ axis, tip }, normal, back) {
  const flat = cross(axis, normal), m = norm(flat) > 0.05 ? unit(flat) : unit(add(back, axis, -dot(back, axis) || 1e-6));
  const turned = dot(m, back) < 0 ? m.map((x) => -x) : m;
  return [...turned, dot(turned, tip)];
}

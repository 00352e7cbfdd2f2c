"use strict";
// Three passes of WebGL 2: the surface (normal and depth of every pixel), the nearest site of every pixel, the colors.

const CHUNK = `#version 300 es
precision highp float; precision highp int; precision highp usampler2D; precision highp sampler2D;
uniform vec3 u_low, u_middle, u_center, u_right, u_up, u_back;
uniform float u_extent, u_radius;   // mm: range of the coordinates; of the depth
uniform vec2 u_half;                // mm: half the canvas
uniform vec4 u_cut;                 // what is beyond this plane is cut away
vec3 unfold(vec2 e) {
  vec3 n = vec3(e, 1.0 - abs(e.x) - abs(e.y));
  float t = max(-n.z, 0.0);
  n.xy += vec2(n.x >= 0.0 ? -t : t, n.y >= 0.0 ? -t : t);
  return normalize(n);
}
vec3 view(vec3 p) { vec3 q = p - u_center; return vec3(dot(q, u_right), dot(q, u_up), dot(p - u_middle, u_back)); }
vec4 clip(vec3 q) { return vec4(q.xy / u_half, -q.z / u_radius, 1.0); }
`;
const SURFACE_V = CHUNK + `
layout(location = 0) in vec3 a_place; layout(location = 1) in vec2 a_normal;
out vec3 v_place, v_normal;
void main() { v_place = u_low + a_place * u_extent; v_normal = unfold(a_normal); gl_Position = clip(view(v_place)); }`;
const SURFACE_F = CHUNK + `
in vec3 v_place, v_normal; uniform bool u_caps; out vec4 o_surface;
void main() {
  if (dot(u_cut.xyz, v_place) > u_cut.w) discard;
  vec3 n = normalize(v_normal);
  bool inside = !gl_FrontFacing;
  if (inside) n = -n;
  o_surface = vec4(0.5 + 0.5 * n, inside && u_caps ? 0.5 : 1.0);
}`;
// A disc for each site where there is no surface.
const DISC_V = CHUNK + `
layout(location = 0) in vec3 a_place; layout(location = 1) in vec2 a_normal; uniform float u_disc;
out vec3 v_place, v_normal; out vec2 v_corner;
void main() {
  vec3 p = u_low + a_place * u_extent; v_normal = unfold(a_normal);
  vec3 a = normalize(cross(v_normal, abs(v_normal.z) < 0.7 ? vec3(0, 0, 1) : vec3(1, 0, 0))), b = cross(v_normal, a);
  v_corner = vec2(gl_VertexID & 1, gl_VertexID >> 1 & 1) * 2.0 - 1.0;
  v_place = p + u_disc * (v_corner.x * a + v_corner.y * b);
  gl_Position = dot(v_normal, u_back) < 0.0 ? vec4(2, 2, 2, 1) : clip(view(v_place));
}`;
const DISC_F = CHUNK + `
in vec3 v_place, v_normal; in vec2 v_corner; out vec4 o_surface;
void main() {
  if (dot(v_corner, v_corner) > 1.0 || dot(u_cut.xyz, v_place) > u_cut.w) discard;
  o_surface = vec4(0.5 + 0.5 * normalize(v_normal), 1.0);
}`;
// A square in the canvas about each site; the depth test keeps the site of least cost: squared distance plus a weight for another normal.
const SITE_V = CHUNK + `
layout(location = 0) in vec3 a_place; layout(location = 1) in vec2 a_normal; uniform float u_reach, u_every;
flat out vec3 v_site, v_normal; flat out uint v_number;
void main() {
  vec3 p = u_low + a_place * u_extent;
  v_site = view(p); v_normal = unfold(a_normal); v_number = uint(gl_VertexID >> 2) * uint(u_every) + 1u;
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1 & 1) * 2.0 - 1.0;
  bool away = dot(v_normal, u_back) < -0.25 || dot(u_cut.xyz, p) > u_cut.w + u_reach;
  gl_Position = away ? vec4(2, 2, 2, 1) : vec4((v_site.xy + corner * u_reach) / u_half, 0.0, 1.0);
}`;
const SITE_F = CHUNK + `
uniform sampler2D u_surface, u_depth; uniform float u_reach, u_spacing; uniform vec2 u_size;
flat in vec3 v_site, v_normal; flat in uint v_number; out uint o_site;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec2 xy = (gl_FragCoord.xy / u_size * 2.0 - 1.0) * u_half - v_site.xy;
  if (dot(xy, xy) > u_reach * u_reach) discard;
  vec4 s = texelFetch(u_surface, at, 0);
  if (s.a < 0.75) discard;
  float z = (1.0 - 2.0 * texelFetch(u_depth, at, 0).r) * u_radius - v_site.z;
  float square = dot(xy, xy) + z * z;
  if (square > u_reach * u_reach) discard;
  float weight = 4.0 * u_spacing * u_spacing;
  gl_FragDepth = (square + weight * (1.0 - dot(normalize(2.0 * s.xyz - 1.0), v_normal))) / (u_reach * u_reach + 2.0 * weight);
  o_site = v_number;
}`;
const COLOR_V = `#version 300 es
void main() { gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0); }`;
const COLOR_F = CHUNK + `
uniform sampler2D u_surface, u_depth; uniform usampler2D u_site, u_class;
uniform vec3 u_palette[16], u_ground, u_cap; uniform ivec2 u_size; uniform uint u_selected, u_hover; uniform float u_samples, u_edges, u_pixel; uniform bool u_changes;
uniform sampler2D u_tool, u_tool_depth; uniform bool u_has_tool; uniform float u_span; uniform vec3 u_parts[4];
out vec4 o_color;
/** Whether the answer of the site at a pixel has changed: bit 7 of its group. */
bool changed(ivec2 p) {
  uint site = texelFetch(u_site, clamp(p, ivec2(0), u_size - 1), 0).r;
  int i = int(site) - 1;
  return site > 0u && (texelFetch(u_class, ivec2(i & 2047, i >> 11), 0).r & 128u) > 0u;
}
float depth(ivec2 p) { return (1.0 - 2.0 * texelFetch(u_depth, p, 0).r) * u_radius; }
vec3 color(ivec2 p) {
  vec4 s = texelFetch(u_surface, p, 0);
  if (s.a < 0.25) return u_ground;
  if (s.a < 0.75) return u_cap * (mod(float(p.x + p.y), 8.0 * u_samples) < 2.0 * u_samples ? 0.82 : 1.0);
  vec3 n = 2.0 * s.xyz - 1.0;
  vec3 v = normalize(vec3(dot(n, u_right), dot(n, u_up), dot(n, u_back)));
  uint site = texelFetch(u_site, p, 0).r;
  vec3 base = vec3(0.69, 0.73, 0.776);
  if (site > 0u) {
    int i = int(site - 1u);
    uvec4 c = texelFetch(u_class, ivec2(i & 2047, i >> 11), 0);
    base = u_palette[c.r & 127u];
    uint finding = c.g | c.b << 8 | c.a << 16;
    if (u_selected > 0u && finding != u_selected) base = mix(base, vec3(dot(base, vec3(0.3, 0.5, 0.2))), 0.75) * 0.5 + 0.42;
    if (site == u_hover) base = mix(base, vec3(1.0), 0.55);
    if (u_changes && (c.r & 128u) > 0u) {
      int r = int(2.0 * u_samples);
      bool inside = true;
      for (int k = 0; k < 4; k++) inside = inside && changed(p + ivec2(k == 0 ? r : k == 1 ? -r : 0, k == 2 ? r : k == 3 ? -r : 0));
      if (!inside) return vec3(1.0, 0.0, 0.8);
    }
  }
  float edge = 1.0;
  if (u_edges > 0.0) {
    float z = depth(p);
    for (int k = 0; k < 4; k++) {
      ivec2 q = p + ivec2(k == 0 ? 1 : k == 1 ? -1 : 0, k == 2 ? 1 : k == 3 ? -1 : 0);
      if (any(lessThan(q, ivec2(0))) || any(greaterThanEqual(q, u_size))) continue;
      vec4 t = texelFetch(u_surface, q, 0);
      vec3 step = vec3(vec2(q - p) * u_pixel, depth(q) - z);
      bool far = abs(dot(step, v)) > 5.0 * u_pixel && t.a > 0.25;
      if (t.a < 0.25 || far || dot(2.0 * t.xyz - 1.0, n) < 0.866) edge = 0.5;
    }
  }
  vec3 light = normalize(vec3(-0.30, 0.40, 0.87));
  return base * (0.30 + 0.72 * (0.5 + 0.5 * dot(v, light))) * edge;
}
int portion(ivec2 p) { return int(texelFetch(u_tool, clamp(p, ivec2(0), u_size - 1), 0).a * 15.0 + 0.5); }
/** The tool over what is behind it, and through what is before it; of a section the cut only is dense. */
vec3 tool(ivec2 p, vec3 under) {
  int code = portion(p), r = max(1, int(u_samples));
  if (code == 0) return under;
  vec4 t = texelFetch(u_tool, p, 0);
  vec3 n = 2.0 * t.xyz - 1.0;
  bool cut = code > 8, edge = false;
  for (int k = 0; k < 4; k++) {
    ivec2 q = p + ivec2(k == 0 ? r : k == 1 ? -r : 0, k == 2 ? r : k == 3 ? -r : 0);
    edge = edge || portion(q) != code || (!cut && dot(2.0 * texelFetch(u_tool, clamp(q, ivec2(0), u_size - 1), 0).xyz - 1.0, n) < 0.8);
  }
  float z = (1.0 - 2.0 * texelFetch(u_tool_depth, p, 0).r) * u_span, surface = texelFetch(u_surface, p, 0).a;
  bool before = cut || surface < 0.25 || (surface > 0.75 && z > depth(p));
  vec3 v = vec3(dot(n, u_right), dot(n, u_up), dot(n, u_back)), light = normalize(vec3(-0.30, 0.40, 0.87));
  vec3 base = u_parts[(code - 1) & 7] * (cut ? 1.0 : 0.45 + 0.6 * (0.5 + 0.5 * dot(normalize(v), light)));
  return mix(under, edge ? base * 0.35 : base, before ? (cut ? 0.94 : edge ? 0.85 : 0.6) : edge ? 0.45 : 0.16);
}
void main() {
  int k = int(u_samples);
  vec3 sum = vec3(0.0);
  for (int i = 0; i < k * k; i++) {
    ivec2 p = ivec2(gl_FragCoord.xy) * k + ivec2(i % k, i / k);
    vec3 c = color(p);
    sum += u_has_tool ? tool(p, c) : c;
  }
  o_color = vec4(sum / float(k * k), 1.0);
}`;

/** Triangles of a coarser surface on the same vertices: one vertex for each of 160 cells along the longest edge and octant of normals. */
function coarser(vertices, indices) {
  const shorts = new Uint16Array(vertices), signed = new Int8Array(vertices), n = shorts.length / 4, first = new Map(), cell = 65536 / 160, of = new Uint32Array(n);
  for (let i = 0; i < n; i++) {
    const [x, y, z] = [0, 1, 2].map((k) => Math.floor(shorts[4 * i + k] / cell)), [nx, ny, nz] = unfold(signed[8 * i + 6], signed[8 * i + 7]);
    const key = (((x * 160 + y) * 160 + z) * 2 + (nx > 0)) * 4 + (ny > 0) * 2 + (nz > 0);
    if (!first.has(key)) first.set(key, i);
    of[i] = first.get(key);
  }
  const out = [];
  for (let t = 0; t < indices.length; t += 3) {
    const [a, b, c] = [of[indices[t]], of[indices[t + 1]], of[indices[t + 2]]];
    if (a !== b && b !== c && c !== a) out.push(a, b, c);
  }
  return new Uint32Array(out);
}

class Gpu {
  constructor(canvas, data) {
    const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, depth: false, preserveDrawingBuffer: true, powerPreference: "high-performance" });
    if (!gl) throw new Error("WebGL 2 is not available");
    this.gl = gl; this.canvas = canvas;
    this.surfaces = [this.program(SURFACE_V, SURFACE_F), this.program(DISC_V, DISC_F)];
    this.site = this.program(SITE_V, SITE_F);
    this.colors = this.program(COLOR_V, COLOR_F);
    this.tool = new ToolPass(this);
    this.arrays = [];
    this.classes = this.texture();
    this.size = [0, 0];
    this.take(data);
  }
  /** Draws these data from now on. */
  take(data) {
    for (const { array, buffers } of this.arrays) { this.gl.deleteVertexArray(array); buffers.forEach((buffer) => this.gl.deleteBuffer(buffer)); }
    this.arrays = [];
    this.tool.clear();
    this.data = data;
    const discs = !data.indices;
    this.surface = this.surfaces[+discs];
    // Four vertices and two triangles a site: software draws them far faster than instances.
    const sites = new Float64Array(data.sites), squares = new Float64Array(4 * sites.length), corners = new Uint32Array(6 * sites.length);
    sites.forEach((site, i) => {
      squares.fill(site, 4 * i, 4 * i + 4);
      corners.set([0, 1, 2, 2, 1, 3].map((k) => 4 * i + k), 6 * i);
    });
    this.siteArray = this.array(squares, corners);
    this.meshArray = discs ? null : this.array(data.vertices, data.indices);
    this.full = { mesh: this.meshArray, nMesh: discs ? 0 : data.indices.length, sites: this.siteArray, nSites: corners.length, wide: 1 };
    this.coarse = { ...this.full };
  }
  program(vertex, fragment) {
    const gl = this.gl, program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source); gl.compileShader(shader); gl.attachShader(program, shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) throw new Error(gl.getShaderInfoLog(shader));
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(gl.getProgramInfoLog(program));
    const places = {};
    for (let i = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS) - 1; i >= 0; i--) {
      const { name, type } = gl.getActiveUniform(program, i);
      places[name.replace("[0]", "")] = [gl.getUniformLocation(program, name), type];
    }
    return { program, places };
  }
  array(buffer, indices) {
    const gl = this.gl, array = gl.createVertexArray(), buffers = [gl.createBuffer(), gl.createBuffer()];
    this.arrays.push({ array, buffers });
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers[0]);
    gl.bufferData(gl.ARRAY_BUFFER, buffer, gl.STATIC_DRAW);
    gl.vertexAttribPointer(0, 3, gl.UNSIGNED_SHORT, true, 8, 0);
    gl.vertexAttribPointer(1, 2, gl.BYTE, true, 8, 6);
    for (const k of [0, 1]) gl.enableVertexAttribArray(k);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers[1]);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    return array;
  }
  texture() {
    const gl = this.gl, texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    for (const k of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, k, gl.NEAREST);
    for (const k of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, k, gl.CLAMP_TO_EDGE);
    return texture;
  }
  /** Prepares what is drawn while the part moves if frames are slow: a coarser surface, and one site of four. */
  prepareCoarse() {
    if (this.coarse.ready) return;
    this.coarse.ready = true;
    if (this.full.nMesh > 600000) {
      const indices = coarser(this.data.vertices, this.data.indices);
      Object.assign(this.coarse, { mesh: this.array(this.data.vertices, indices), nMesh: indices.length });
    }
    if (this.data.indices && this.data.nSites > 30000) {
      const few = new Float64Array(this.data.sites).filter((_, i) => i % 4 === 0), squares = new Float64Array(4 * few.length), corners = new Uint32Array(6 * few.length);
      few.forEach((site, i) => { squares.fill(site, 4 * i, 4 * i + 4); corners.set([0, 1, 2, 2, 1, 3].map((k) => 4 * i + k), 6 * i); });
      Object.assign(this.coarse, { sites: this.array(squares, corners), nSites: corners.length, wide: 2 });
    }
  }
  /** The group of every site and the number of its finding. */
  setClasses(of, finding) {
    const gl = this.gl, rows = Math.max(1, Math.ceil(of.length / 2048)), bytes = new Uint8Array(4 * 2048 * rows);
    for (let i = 0; i < of.length; i++) {
      const f = finding ? finding[i] : 0;
      bytes[4 * i] = of[i]; bytes[4 * i + 1] = f; bytes[4 * i + 2] = f >> 8; bytes[4 * i + 3] = f >> 16;
    }
    gl.bindTexture(gl.TEXTURE_2D, this.classes);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8UI, 2048, rows, 0, gl.RGBA_INTEGER, gl.UNSIGNED_BYTE, bytes);
  }
  /** A texture to draw on, as large as all of them. */
  target(inner, format, type) {
    const { gl } = this, texture = this.texture();
    gl.texImage2D(gl.TEXTURE_2D, 0, inner, ...this.size, 0, format, type, null);
    return texture;
  }
  frame(color, depth) {
    const { gl } = this, frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, color, 0);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, depth, 0);
    return frame;
  }
  resize(width, height) {
    if (this.size[0] === width && this.size[1] === height) return;
    const gl = this.gl;
    for (const old of this.targets || []) gl.deleteTexture(old);
    for (const old of this.frames || []) gl.deleteFramebuffer(old);
    this.size = [width, height];
    const depth = () => this.target(gl.DEPTH_COMPONENT24, gl.DEPTH_COMPONENT, gl.UNSIGNED_INT);
    this.targets = [this.target(gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE), depth(), this.target(gl.R32UI, gl.RED_INTEGER, gl.UNSIGNED_INT), depth()];
    this.frames = [this.frame(this.targets[0], this.targets[1]), this.frame(this.targets[2], this.targets[3])];
  }
  use({ program, places }, values) {
    const gl = this.gl;
    gl.useProgram(program);
    const set = {
      [gl.FLOAT]: (l, v) => gl.uniform1f(l, v), [gl.FLOAT_VEC2]: (l, v) => gl.uniform2fv(l, v), [gl.FLOAT_VEC3]: (l, v) => gl.uniform3fv(l, v),
      [gl.FLOAT_VEC4]: (l, v) => gl.uniform4fv(l, v), [gl.BOOL]: (l, v) => gl.uniform1i(l, v), [gl.UNSIGNED_INT]: (l, v) => gl.uniform1ui(l, v),
      [gl.INT_VEC2]: (l, v) => gl.uniform2iv(l, v), [gl.SAMPLER_2D]: (l, v) => gl.uniform1i(l, v), [gl.UNSIGNED_INT_SAMPLER_2D]: (l, v) => gl.uniform1i(l, v),
    };
    for (const name in places) set[places[name][1]](places[name][0], values[name]);
  }
  /** Draws with `samples` samples per pixel side, a whole number. */
  draw(camera, look, samples) {
    if (look.coarse) this.prepareCoarse();
    const what = look.coarse ? this.coarse : this.full;
    const gl = this.gl, { data, canvas } = this, most = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    samples = Math.max(1, Math.floor(Math.min(samples, most / canvas.width, most / canvas.height)));
    this.resize(canvas.width * samples, canvas.height * samples);
    this.samples = samples;
    const perPixel = 1 / (camera.scale * look.ratio);
    const half = [0.5 * canvas.width * perPixel, 0.5 * canvas.height * perPixel];
    const values = {
      u_low: data.low, u_extent: 65535 * data.step, u_middle: camera.middle, u_center: camera.center, u_right: camera.right, u_up: camera.up, u_back: camera.back,
      u_radius: camera.radius, u_half: half, u_cut: look.cut || [0, 0, 0, 1], u_caps: !!look.cut && data.about.closed, u_disc: 0.8 * data.about.spacing_mm,
      u_reach: 1.6 * what.wide * data.about.spacing_mm, u_spacing: what.wide * data.about.spacing_mm, u_every: what.wide * what.wide, u_size: this.size, u_surface: 0, u_depth: 1, u_site: 2, u_class: 3,
      u_palette: look.palette, u_ground: look.ground, u_cap: look.cap, u_selected: look.selected, u_hover: look.hover, u_samples: samples,
      u_edges: data.indices ? 1 : 0, u_changes: look.changes, u_pixel: perPixel / samples,
    };
    gl.viewport(0, 0, ...this.size);
    gl.enable(gl.DEPTH_TEST); gl.depthFunc(gl.LESS); gl.disable(gl.BLEND);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frames[0]);
    gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 0]); gl.clearBufferfv(gl.DEPTH, 0, [1]);
    this.use(this.surface, values);
    if (data.indices) {
      gl.bindVertexArray(what.mesh);
      gl.drawElements(gl.TRIANGLES, what.nMesh, gl.UNSIGNED_INT, 0);
    } else {
      gl.bindVertexArray(this.siteArray);
      gl.drawElements(gl.TRIANGLES, 6 * data.nSites, gl.UNSIGNED_INT, 0);
    }
    this.targets.slice(0, 2).forEach((texture, k) => { gl.activeTexture(gl.TEXTURE0 + k); gl.bindTexture(gl.TEXTURE_2D, texture); });
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frames[1]);
    gl.clearBufferuiv(gl.COLOR, 0, [0, 0, 0, 0]); gl.clearBufferfv(gl.DEPTH, 0, [1]);
    this.use(this.site, values);
    gl.bindVertexArray(what.sites);
    gl.drawElements(gl.TRIANGLES, what.nSites, gl.UNSIGNED_INT, 0);
    gl.activeTexture(gl.TEXTURE2); gl.bindTexture(gl.TEXTURE_2D, this.targets[2]);
    gl.activeTexture(gl.TEXTURE3); gl.bindTexture(gl.TEXTURE_2D, this.classes);
    const noTool = { u_tool: 0, u_tool_depth: 1, u_span: 1, u_parts: PORTIONS.flat() };
    const tool = look.tool ? this.tool.draw(camera, values, look.tool) : noTool;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.disable(gl.DEPTH_TEST);
    this.use(this.colors, { ...values, ...tool, u_has_tool: !!look.tool });
    gl.bindVertexArray(null);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.activeTexture(gl.TEXTURE0);
  }
  /** Numbers of the sites seen, from 1 on, in a rectangle of the canvas, device pixels from the lower left; 0: none. */
  sites(x, y, width, height) {
    const gl = this.gl, k = this.samples, at = (v) => Math.floor(v * k);
    const [w, h] = [Math.max(1, at(width)), Math.max(1, at(height))], out = new Uint32Array(4 * w * h);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frames[1]);
    gl.readPixels(at(x), at(y), w, h, gl.RGBA_INTEGER, gl.UNSIGNED_INT, out);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return out.filter((_, i) => i % 4 === 0);
  }
}

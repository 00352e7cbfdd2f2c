"use strict";
// A parallel projection: azimuth and elevation of the eye, the point in the middle of the canvas, pixels per millimeter.

const add = (a, b, t = 1) => [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const norm = (a) => Math.hypot(...a);
const unit = (a) => { const l = norm(a) || 1; return a.map((x) => x / l); };
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

class Camera {
  constructor(low, high) {
    this.middle = low.map((l, k) => 0.5 * (l + high[k]));
    this.corners = [...Array(8).keys()].map((i) => low.map((l, k) => (i >> k & 1 ? high[k] : l)));
    this.radius = 0.505 * norm(add(high, low, -1)) || 1;
    this.center = this.middle; this.scale = 1; this.turnTo(-58, 30);
  }
  /** The eye in this direction, degrees: azimuth from +x, elevation from the plane of x and y. */
  turnTo(azimuth, elevation) {
    this.azimuth = ((azimuth % 360) + 360) % 360;
    this.elevation = Math.max(-90, Math.min(90, elevation));
    const [a, e] = [this.azimuth, this.elevation].map((d) => d * Math.PI / 180);
    const [ca, sa, ce, se] = [Math.cos(a), Math.sin(a), Math.cos(e), Math.sin(e)];
    this.right = [-sa, ca, 0]; this.up = [-se * ca, -se * sa, ce]; this.back = [ce * ca, ce * sa, se];
  }
  /** Place in the plane of the canvas, mm from its middle, and height toward the eye, mm from the part's middle. */
  project(p) {
    const q = add(p, this.center, -1);
    return [dot(q, this.right), dot(q, this.up), dot(add(p, this.middle, -1), this.back)];
  }
  /** Millimeters in the plane of the canvas as a vector of space. */
  across(x, y) { return add(this.right.map((r) => r * x), this.up, y); }
  /** The scale at which all of the part is seen, and the middle there. */
  fit(width, height) {
    const qs = this.corners.map((p) => { const q = add(p, this.middle, -1); return [dot(q, this.right), dot(q, this.up)]; });
    const span = (k) => [Math.min(...qs.map((q) => q[k])), Math.max(...qs.map((q) => q[k]))];
    const [x, y] = [span(0), span(1)];
    const scale = Math.min(0.9 * width / (x[1] - x[0] || 1), 0.8 * height / (y[1] - y[0] || 1));
    return { scale, center: add(this.middle, this.across(0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]))) };
  }
}

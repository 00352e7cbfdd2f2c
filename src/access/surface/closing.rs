//! What one point of the surface proves about the directions around: see [`refine`](super::refine).

use super::query::Probe;
use super::tool::{Stand, Tip, across};
use glam::DVec3;

/// What points prove about the directions around.
pub(super) struct Closing<'a> {
    pub probe: &'a Probe,
    /// Speed of the reference point, mm per radian.
    pub drift: f64,
    /// Whether the tip counts too: it is known that the steps are clear somewhere.
    pub tip: bool,
}

impl Closing<'_> {
    /// Within which angle of the direction a point, local to the tool, stays in some step or in the tip; not positive
    /// if it is in none.
    pub fn angle(&self, point: DVec3) -> f64 {
        let (aside, length) = (across(point).length(), point.length());
        let mut margin = f64::NEG_INFINITY;
        for [height, radius] in self.probe.steps() {
            margin = margin.max((point.z - height).min(radius - aside));
        }
        if self.tip {
            match self.probe.tip() {
                Tip::Round { ring, radius } => {
                    if ring == 0.0 && self.drift == 0.0 && length < radius {
                        return std::f64::consts::PI;
                    }
                    margin = margin.max(point.z.min(ring + radius - aside));
                }
                Tip::Flat { height, radius } => {
                    margin = margin.max((point.z - height).min(radius - aside));
                }
            }
        }
        margin / (length + self.drift)
    }

    /// The point of a triangle, of a few, that closes most.
    pub fn best_point(&self, corners: &[DVec3; 3], stand: &Stand) -> (DVec3, f64) {
        let [a, b, c] = *corners;
        let mut best = (a, 0.0);
        let mut consider = |point: DVec3| {
            let angle = self.angle(stand.local(point));
            if angle > best.1 {
                best = (point, angle);
            }
        };
        [a, b, c, 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)].into_iter().for_each(&mut consider);
        // The places of the facet nearest to points on the axis within the steps.
        let heights = corners.map(|p| (p - stand.reference).dot(stand.axes[2]));
        let (bottom, top) = (
            heights[0].min(heights[1]).min(heights[2]),
            heights[0].max(heights[1]).max(heights[2]),
        );
        for &[height, radius] in self.probe.steps() {
            if radius == f64::INFINITY || top <= height {
                continue;
            }
            let low = bottom.max(height);
            for share in SHARES {
                let on_axis = stand.reference + stand.axes[2] * (low + share * (top - low));
                consider(nearest(on_axis, corners));
            }
        }
        if self.tip {
            consider(nearest(stand.reference, corners));
        }
        best
    }
}

/// Where on the axis, between the lowest and the highest that a triangle has in a step.
const SHARES: [f64; 4] = [0.06, 0.2, 0.45, 0.8];

/// The point of a triangle nearest to `p`, or nearly: any point of it would do.
fn nearest(p: DVec3, [a, b, c]: &[DVec3; 3]) -> DVec3 {
    let n = (*b - *a).cross(*c - *a);
    let squared = n.length_squared();
    if squared == 0.0 {
        return *a;
    }
    let weight = |q: DVec3, r: DVec3| ((r - q).cross(p - q).dot(n) / squared).clamp(0.0, 1.0);
    let [u, v, w] = [weight(*b, *c), weight(*c, *a), weight(*a, *b)];
    (*a * u + *b * v + *c * w) / (u + v + w)
}

//! What of a tool is seen from below: of what it does when it comes down along its axis, all that counts.

use super::body::{Body, Curve, Element, WIDE};
use crate::tool::cutter::Profile;

/// The underside of a shrunk tool: how high it first is as wide.
#[derive(Debug, Clone)]
pub(in crate::access::surface) struct Underside {
    /// See [`Body::retracting`].
    elements: Vec<Element>,
    radius: f64,
}

/// What cuts of a shrunk tool.
#[derive(Debug, Clone)]
pub(in crate::access::surface) struct Cuts {
    body: Body,
    heights: [f64; 2],
    radius: f64,
}

impl Cuts {
    pub fn new(profile: &Profile, shrink: f64) -> Self {
        let mut body = Body::new(profile, shrink);
        body.elements.retain(|element| element.cuts);
        let all = body.elements.iter();
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        let heights = all.fold(none, |[low, high], e| [low.min(e.low), high.max(e.high)]);
        let radius = body.elements.iter().map(|element| element.most).fold(0.0, f64::max);
        Cuts { body, heights, radius }
    }

    /// Heights of both ends, mm.
    pub fn heights(&self) -> [f64; 2] {
        self.heights
    }

    /// Greatest radius, mm.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Whether a place, distance from the axis and height, is in it.
    pub fn holds(&self, distance: f64, height: f64) -> bool {
        let radius = self.body.radius_at(height);
        radius > 0.0 && distance <= radius
    }
}

/// Discs that a part of the tool which does not cut is given as.
const DISCS: usize = 8;

impl Underside {
    pub fn new(profile: &Profile, shrink: f64) -> Self {
        let elements = Body::new(profile, shrink).retracting().elements;
        let cutting = elements.iter().filter(|element| element.cuts);
        let radius = cutting.map(|element| element.most).fold(0.0, f64::max);
        Underside { elements, radius }
    }

    /// Greatest radius of what cuts, mm.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Lowest height of what cuts at a distance from the axis, mm; infinite where nothing does, or what does not cut is
    /// lower.
    #[inline]
    pub fn height(&self, distance: f64) -> f64 {
        let wide = |element: &&Element| element.most >= distance;
        let lowest = self.elements.iter().find(wide).filter(|element| element.cuts);
        lowest.map_or(f64::INFINITY, |element| first_as_wide(element, distance))
    }

    /// Height and radius, mm, of discs within what does not cut, from below; infinite radii for a half-space.
    pub fn discs(&self) -> Vec<[f64; 2]> {
        let mut discs: Vec<[f64; 2]> = Vec::new();
        for element in self.elements.iter().filter(|element| !element.cuts) {
            if element.most > 0.5 * WIDE {
                discs.push([element.low, f64::INFINITY]);
                break;
            }
            let low = element.curve.radius_at(element.low);
            for k in 0..=DISCS {
                let radius = low + (element.most - low) * (k as f64 / DISCS as f64);
                if discs.last().is_none_or(|[_, before]| radius > *before) && radius > 0.0 {
                    discs.push([first_as_wide(element, radius), radius]);
                }
            }
        }
        discs
    }
}

/// The lowest height of a rising element at which it is as wide as this.
fn first_as_wide(element: &Element, radius: f64) -> f64 {
    let Element { low, high, curve, .. } = *element;
    if curve.radius_at(low) >= radius {
        return low;
    }
    let height = match curve {
        Curve::Line { radius: at_0, slope } => (radius - at_0) / slope,
        Curve::Arc { center: [c, z], radius: arc } => {
            z - (arc * arc - (radius - c) * (radius - c)).max(0.0).sqrt()
        }
    };
    height.clamp(low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_underside_is_where_the_tool_first_is_as_wide() {
        let texts = [
            "0:0 1.5:5.598@0:3 | 1.5:20 3:22",
            "6:0 6:3 3:3 | 3:20 6:20",
            "2:0 6:4@6:0 | 6:12 9:15",
            "0:0 3:3@0:3 3:6 | 2.6:6 2.6:20 4:24 4:40",
        ];
        for text in texts {
            let profile: Profile = text.parse().unwrap();
            let (body, under) = (Body::new(&profile, 0.01), Underside::new(&profile, 0.01));
            let discs = under.discs();
            for k in 1..1000 {
                let distance = 0.01 * f64::from(k);
                let wide = |height: &f64| body.radius_at(*height) >= distance;
                let first = (0..50_000).map(|k| 1e-3 * f64::from(k)).find(wide);
                if distance <= under.radius() {
                    let [found, first] = [under.height(distance), first.unwrap()];
                    assert!((found - first).abs() < 2e-3, "{text} {distance}: {found} {first}");
                } else {
                    assert!(under.height(distance).is_infinite());
                    let disc = discs.iter().find(|[_, radius]| *radius >= distance);
                    let (Some([height, _]), Some(first)) = (disc, first) else { continue };
                    assert!(*height >= first - 2e-3, "{text} {distance}: {height} {first}");
                }
            }
        }
    }
}

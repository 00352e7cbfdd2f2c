//! Bands that hold a tool: what the boxes of triangles are compared with.

use super::body::Body;
use crate::access::surface::bvh::{Band, Bvh};

/// Cylinders between two heights that hold a body.
#[derive(Debug)]
pub(super) struct Bands {
    /// Heights of both ends and radius, mm, from below.
    bands: Vec<[f64; 3]>,
    /// Of the tool and all its ways, mm.
    size: f64,
}

/// More are slower than the triangles that they spare.
const MOST_BANDS: usize = 8;
/// Parts of an arc or a cone that bands begin as.
const SLICES: usize = 6;

impl Bands {
    /// ```text
    /// bands = slices of the body
    /// more than there may be: the two neighbors become one that together gain the least volume
    /// ```
    pub fn new(body: &Body, size: f64) -> Bands {
        let mut bands = body.slices(SLICES);
        let joined = |a: &[f64; 3], b: &[f64; 3]| [a[0], b[1], a[2].max(b[2])];
        let volume = |band: &[f64; 3]| (band[1] - band[0]) * band[2] * band[2];
        while bands.len() > 1 {
            let gain = |k: usize| {
                volume(&joined(&bands[k], &bands[k + 1]))
                    - volume(&bands[k])
                    - volume(&bands[k + 1])
            };
            let gains = (0..bands.len() - 1).map(|k| (k, gain(k)));
            let Some((k, gain)) = gains.min_by(|a, b| a.1.total_cmp(&b.1)) else { break };
            if gain > 0.0 && bands.len() <= MOST_BANDS {
                break;
            }
            bands[k] = joined(&bands[k], &bands[k + 1]);
            bands.remove(k + 1);
        }
        Bands { bands, size }
    }

    /// Of the tool and all its ways, mm.
    pub fn size(&self) -> f64 {
        self.size
    }

    /// For [`Bvh::visit`], with radii that are greater by this, mm.
    pub fn widened(&self, bvh: &Bvh, by: f64) -> Vec<Band> {
        let band = |&[low, high, radius]: &[f64; 3]| bvh.band([low, high], radius + by, self.size);
        self.bands.iter().map(band).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tool::cutter::Profile;

    #[test]
    fn bands_hold_the_tool_and_not_much_more() {
        let texts =
            ["0:0 1.5:5.598@0:3 | 1.5:20 3:22", "6:0 6:3 3:3 | 3:20 6:20", "2:0 6:4@6:0 | 6:12"];
        for text in texts {
            let body = Body::new(&text.parse::<Profile>().unwrap(), 0.01);
            for body in [body.retracting(), body] {
                let bands = Bands::new(&body, 100.0).bands;
                assert!(bands.len() <= MOST_BANDS);
                let mut sums = [0.0; 2];
                for k in 0..4000 {
                    let height = 0.01 * f64::from(k);
                    let radius = body.radius_at(height);
                    let over = |band: &&[f64; 3]| (band[0]..=band[1]).contains(&height);
                    let held = bands.iter().filter(over).map(|band| band[2]).fold(0.0, f64::max);
                    assert!(radius <= held, "{text} {height}: {radius} {held}");
                    sums = [sums[0] + radius, sums[1] + held];
                }
                assert!(sums[1] < 1.05 * sums[0], "{text}: {sums:?}");
            }
        }
    }
}

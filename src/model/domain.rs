//! The domain of a network: the ranges of ratios it was trained for, since labels depend on ratios of lengths alone.

use crate::answers::{OutsideDomain, QUANTITIES};
use crate::tool::cutter::CutterParams;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// What a network saw in training. Lengths are in units of the largest edge of the sites' bounding box; lengths beyond
/// twice that edge count as twice, because they collide with the same points.
///
/// ```
/// use deepmill::{cutter::CutterParams, model::Domain};
/// use deepmill::glam::Vec3;
/// let plate = [Vec3::ZERO, Vec3::new(80.0, 40.0, 8.0)];
/// let mut domain = Domain::of(&plate, "1,5,20,5".parse()?);
/// domain.include(&Domain::of(&plate, "2,10,100,10".parse()?));
/// assert!(domain.outside(&plate, "1.5,6,40,5".parse()?).is_empty());
/// let outside = domain.outside(&plate, "6,10,40,10".parse()?);
/// assert_eq!(outside[0].to_string(), "CR is 0.075 of the largest edge, trained from 0.0125 to 0.025");
/// assert!(outside[0].is_far());
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Domain {
    /// Least and greatest of CR, CH, FR and FH over the largest edge.
    pub(crate) cutter: [[f64; 2]; 4],
    /// Least and greatest of the smallest box edge over the largest.
    pub(crate) thinness: [f64; 2],
    /// Least and greatest number of sites.
    pub(crate) n_sites: [f64; 2],
}

/// Lengths beyond so many largest edges are all the same.
const LONGEST: f64 = 2.0;

impl Domain {
    /// That of a single part and cutter.
    pub fn of(points_mm: &[Vec3], cutter: CutterParams) -> Self {
        let least = points_mm.iter().copied().reduce(Vec3::min).unwrap_or_default();
        let greatest = points_mm.iter().copied().reduce(Vec3::max).unwrap_or_default();
        let edges = (greatest - least).as_dvec3();
        let largest = edges.max_element().max(f64::MIN_POSITIVE);
        let n_sites = points_mm.len() as f64;
        Domain {
            cutter: cutter.to_array().map(|length| [(length / largest).min(LONGEST); 2]),
            thinness: [edges.min_element() / largest; 2],
            n_sites: [n_sites; 2],
        }
    }

    /// Widens the domain by another.
    pub fn include(&mut self, other: &Domain) {
        for (range, other) in self.ranges_mut().into_iter().zip(other.ranges()) {
            *range = [range[0].min(other[0]), range[1].max(other[1])];
        }
    }

    /// What of a part and a cutter is outside; the number of sites counts only if it is below half of the least.
    pub fn outside(&self, points_mm: &[Vec3], cutter: CutterParams) -> Vec<OutsideDomain> {
        let found = Domain::of(points_mm, cutter);
        let all = QUANTITIES.into_iter().zip(self.ranges()).zip(found.ranges());
        let all =
            all.map(|((quantity, range), [value, _])| OutsideDomain { quantity, value, range });
        all.filter(|o| o.is_outside() && (!o.is_count() || o.is_below_half())).collect()
    }

    /// Least number of sites.
    pub(super) fn least_n_sites(&self) -> usize {
        self.n_sites[0] as usize
    }

    /// Greatest number of sites.
    pub(super) fn most_n_sites(&self) -> usize {
        self.n_sites[1] as usize
    }

    /// All ranges in the order of the fields.
    pub fn ranges(&self) -> [[f64; 2]; 6] {
        let [cr, ch, fr, fh] = self.cutter;
        [cr, ch, fr, fh, self.thinness, self.n_sites]
    }

    /// From [`Domain::ranges`].
    pub fn from_ranges([cr, ch, fr, fh, thinness, n_sites]: [[f64; 2]; 6]) -> Self {
        Domain { cutter: [cr, ch, fr, fh], thinness, n_sites }
    }

    fn ranges_mut(&mut self) -> [&mut [f64; 2]; 6] {
        let [cr, ch, fr, fh] = &mut self.cutter;
        [cr, ch, fr, fh, &mut self.thinness, &mut self.n_sites]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cutter(lengths: [f64; 4]) -> CutterParams {
        CutterParams::from_array(lengths)
    }

    #[test]
    fn answers_depend_on_ratios_alone_and_so_does_the_domain() {
        let points = [Vec3::ZERO, Vec3::new(100.0, 50.0, 20.0)];
        let twice = points.map(|p| 2.0 * p);
        let small = Domain::of(&points, cutter([1.0, 5.0, 20.0, 5.0]));
        assert_eq!(small, Domain::of(&twice, cutter([2.0, 10.0, 40.0, 10.0])));
        assert_eq!(small.thinness, [0.2; 2]);
        let wide = [1.0, 5.0, 300.0, 5.0];
        assert_eq!(
            Domain::of(&points, cutter(wide)),
            Domain::of(&points, cutter([1.0, 5.0, 900.0, 5.0]))
        );
    }

    #[test]
    fn near_and_far_are_told_apart_and_sites_may_be_many_but_not_few() {
        let line = |n: usize| (0..n).map(|i| Vec3::splat(i as f32)).collect::<Vec<_>>();
        let at = |cr: f64| cutter([cr, 1.0, 10.0, 1.0]);
        let domain = Domain::of(&line(101), at(1.0));
        let names = |points: &[Vec3], cr| {
            let outside = domain.outside(points, at(cr));
            outside.iter().map(|o| (o.quantity, o.is_far())).collect::<Vec<_>>()
        };
        assert_eq!(names(&line(101), 1.0), []);
        assert_eq!(names(&line(101), 1.9), [("CR", false)]);
        assert_eq!(names(&line(101), 2.1), [("CR", true)]);
        let many: Vec<Vec3> = line(101).into_iter().chain(line(50)).collect();
        assert_eq!(names(&many, 1.0), []);
        assert_eq!(names(&line(101).repeat(3), 1.0), []);
        let few = |n: usize| -> Vec<Vec3> {
            line(101).into_iter().rev().take(n - 1).chain(line(1)).collect()
        };
        assert_eq!(names(&few(51), 1.0), []);
        assert_eq!(names(&few(50), 1.0), [("number of sites", true)]);
        let message = domain.outside(&few(50), at(1.0))[0].to_string();
        assert_eq!(message, "number of sites is 50, trained with 101");
    }
}

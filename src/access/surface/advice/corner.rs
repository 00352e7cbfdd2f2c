//! Inner corners that are sharper than the tool.

use super::ball::Rolled;
use super::{PartChange, PartLength, Region, rounded};
use crate::Result;
use crate::access::surface::tool::Outline;
use crate::exec::par;
use crate::tool::directions::{DirectionSet, Directions};
use glam::DVec3;

/// Sites whose corners differ by less than this, mm, have one radius.
const SAME_RADIUS_MM: f64 = 0.06;
/// What less of a region is freed is no advice.
const LEAST_SHARE: f64 = 0.02;
/// Sine of the greatest angle between a corner and what it runs along or across.
const LEVEL: f64 = 0.02;
/// A fillet is met within this, mm, and this share of the ball's radius.
const ON_FILLET: [f64; 2] = [0.02, 0.02];

/// A site in an inner corner.
struct InCorner {
    site: usize,
    from_mm: Option<f64>,
    rolled: Rolled,
    is_freed: bool,
}

/// Which tools' radius a corner must have, by how it runs to the direction.
#[derive(Clone, Copy, PartialEq)]
enum Runs {
    Any,
    Across,
    Along,
}

impl Region<'_> {
    /// The radii that inner corners would need, one for every radius that they have.
    pub(super) fn corners(&self) -> Result<Vec<PartChange>> {
        let (corner, side) = (self.cutter.corner_mm(), self.cutter.side_mm());
        let needed: &[(f64, Runs)] = match side > 0.0 {
            false => &[(corner, Runs::Any)],
            true => &[(corner, Runs::Across), (corner + side, Runs::Along)],
        };
        let mut all = Vec::new();
        for &(radius, runs) in needed {
            if radius > 0.0 {
                all.extend(self.corners_of(radius, runs)?);
            }
        }
        Ok(all)
    }

    fn corners_of(&self, radius: f64, runs: Runs) -> Result<Vec<PartChange>> {
        let outline = Outline::new(&self.cutter, self.options.finish_mm);
        let (chords, bvh) = (&self.obstacles.chords, &self.obstacles.bvh);
        let tolerances = self.options.tolerance.of_triangles(&outline, chords, bvh)?;
        let found = par::map(self.n(), |site| {
            let at = (self.points[site], self.normals[site]);
            let rolled = self.obstacles.rolled(at, radius, &tolerances)?;
            let gap = rolled.center.distance(at.0) - radius;
            // No farther than a corner of three faces fills; else it is something else than a corner.
            if gap < 0.0 || gap > radius {
                return None;
            }
            let from_mm = self.own_radius(&rolled, radius);
            Some(InCorner { site, from_mm, rolled, is_freed: false })
        });
        let mut found: Vec<InCorner> = found.into_iter().flatten().collect();
        self.label_fillet(&mut found, radius, runs)?;
        found.retain(|corner| corner.is_freed);
        Ok(self.by_radius(&found, radius))
    }

    /// Labels the points of the fillet that would replace the sites.
    fn label_fillet(&self, found: &mut [InCorner], radius: f64, runs: Runs) -> Result<()> {
        let place = |corner: &InCorner| {
            let away = (self.points[corner.site] - corner.rolled.center).normalize_or_zero();
            (corner.rolled.center + away * radius, -away)
        };
        if runs == Runs::Any {
            let places: Vec<_> = found.iter().map(place).collect();
            let reached = self.reaches(&places, self.directions)?;
            found.iter_mut().zip(reached).for_each(|(corner, freed)| corner.is_freed = freed);
            return Ok(());
        }
        // Sites with the same directions together.
        let mut groups: Vec<(Vec<usize>, Vec<usize>)> = Vec::new();
        for (k, corner) in found.iter().enumerate() {
            let which = self.directions_that(&corner.rolled.touched, runs);
            match groups.iter_mut().find(|(of, _)| *of == which) {
                Some((_, members)) => members.push(k),
                None => groups.push((which, vec![k])),
            }
        }
        for (which, members) in groups {
            if which.is_empty() {
                continue;
            }
            let vector = |&k: &usize| self.directions.vectors()[k].as_dvec3().to_array();
            let vectors = which.iter().map(vector).collect();
            let directions = Directions::new(DirectionSet::List { vectors })?;
            let places: Vec<_> = members.iter().map(|&k| place(&found[k])).collect();
            let reached = self.reaches(&places, &directions)?;
            members.iter().zip(reached).for_each(|(&k, freed)| found[k].is_freed = freed);
        }
        Ok(())
    }

    /// The directions that a corner between two faces runs across, or along.
    fn directions_that(&self, touched: &[DVec3], runs: Runs) -> Vec<usize> {
        let &[a, b] = touched else { return Vec::new() };
        let edge = a.cross(b).normalize_or_zero();
        let fits = |k: &usize| {
            let direction = self.directions.vectors()[*k].as_dvec3();
            match runs {
                Runs::Across => edge.dot(direction).abs() <= LEVEL,
                _ => edge.cross(direction).length() <= LEVEL,
            }
        };
        (0..self.directions.len()).filter(fits).collect()
    }

    /// The radius that the corner has now; `None` where more than two faces meet.
    fn own_radius(&self, rolled: &Rolled, radius: f64) -> Option<f64> {
        let &[a, b] = &rolled.touched[..] else { return None };
        let middle = (a + b).normalize_or_zero();
        let k = 1.0 / a.dot(middle);
        let (center, ray) = (rolled.center, |u: DVec3| self.obstacles.ray(rolled.center, u, 0.0));
        let (distance, _) = ray(-middle)?;
        let own = (k * radius - distance) / (k - 1.0);
        let near = ON_FILLET[0] + ON_FILLET[1] * radius;
        if own <= near {
            return Some(0.0);
        }
        let (of_fillet, half) = (center - middle * (k * (radius - own)), a.dot(middle));
        let is_met = |u: DVec3| {
            let Some((t, _)) = ray(u) else { return false };
            let (to, met) = (of_fillet - center, center + u * t);
            let across = (to - u * to.dot(u)).length_squared();
            let of_arc = to.dot(u) + (own * own - across).max(0.0).sqrt();
            let from_middle = (center + u * of_arc - of_fillet).dot(-middle);
            match across <= own * own && from_middle >= half * own {
                true => (t - of_arc).abs() <= near,
                false => [a, b].iter().any(|n| (n.dot(met - center) + radius).abs() <= near),
            }
        };
        let is_fillet = [a, b].iter().all(|&n| is_met(-(middle + 0.5 * n).normalize_or_zero()));
        Some(if is_fillet { own } else { 0.0 })
    }

    /// One change for the sites of every radius.
    fn by_radius(&self, freed: &[InCorner], to_mm: f64) -> Vec<PartChange> {
        let mut radii: Vec<f64> = freed.iter().filter_map(|corner| corner.from_mm).collect();
        radii.sort_by(f64::total_cmp);
        let groups: Vec<&[f64]> = radii.chunk_by(|a, b| b - a <= SAME_RADIUS_MM).collect();
        let of = |k: usize| {
            let group = groups[k];
            let most = group.last().copied().unwrap_or(0.0);
            let from_mm = rounded(group[group.len() / 2]);
            // Sites where three faces meet go with the sharpest.
            let is_member = |corner: &&InCorner| match corner.from_mm {
                Some(own) => group[0] <= own && own <= most,
                None => k == 0,
            };
            let members: Vec<&InCorner> = freed.iter().filter(is_member).collect();
            let share = members.len() as f64 / self.n() as f64;
            let at_mm = members.first().map_or(DVec3::ZERO, |corner| self.points[corner.site]);
            let change = PartChange {
                kind: PartLength::CornerRadius,
                from_mm,
                to_mm: rounded(to_mm),
                at_mm,
                depth_mm: None,
                share,
            };
            (share >= LEAST_SHARE && from_mm + SAME_RADIUS_MM < to_mm).then_some(change)
        };
        (0..groups.len()).filter_map(of).collect()
    }
}

//! Faces in the way that would have to be lower.

use super::{PartChange, PartLength, Region, rounded};
use crate::Result;
use crate::access::surface::bvh::Bvh;
use crate::access::surface::explain::{Blocked, BlockedQuery};
use crate::access::surface::obstacles::TriangleObstacles;
use crate::answers::SiteAnswer;
use crate::geom::Sites;
use glam::{DVec3, Vec3};

/// Sites of a region at which what blocks is looked for.
const N_EXPLAINED: usize = 4;
/// What less of a region is freed is no advice.
const LEAST_SHARE: f64 = 0.25;
/// What would be cut off is at most this share of the surface.
const MOST_CUT: f64 = 0.2;
/// What would be cut off has a face on top that is level within this, as a cosine.
const LEVEL: f64 = 0.999;
/// Heights that differ by less are the same, mm.
const SAME_MM: f64 = 1e-3;
/// What would be cut off is lower than the step by this, mm.
const BELOW_MM: f64 = 0.01;

impl Region<'_> {
    /// How much lower what blocks would have to be, if cutting it off frees sites.
    pub(super) fn heights(&self, (sites, members): (&Sites, &[u32])) -> Result<Vec<PartChange>> {
        let n = members.len().min(N_EXPLAINED);
        let few = (0..n).map(|k| members[(2 * k + 1) * members.len() / (2 * n)]);
        let query = BlockedQuery {
            sites,
            held: (self.tool, self.clearance_mm),
            directions: self.directions,
            options: &self.options,
        };
        let mut best: Option<PartChange> = None;
        for site in few {
            let Some((direction, blocked)) = self.obstacles.least_blocked(&query, site)? else {
                continue;
            };
            let found = self.lowered(direction, &blocked)?;
            best = match (best, found) {
                (Some(best), Some(found)) if found.share <= best.share => Some(best),
                (best, found) => found.or(best),
            };
        }
        Ok(best.into_iter().collect())
    }

    /// What cutting off all that is connected with the blocking face, above the blocked step, would free.
    fn lowered(&self, direction: Vec3, blocked: &Blocked) -> Result<Option<PartChange>> {
        if blocked.face >= self.obstacles.n_of_part() {
            return Ok(None);
        }
        let up = direction.as_dvec3().normalize();
        let height = blocked.at_mm.dot(up) - blocked.penetration_mm - BELOW_MM;
        let Some((lower, by_mm)) = self.obstacles.cut_off(blocked.face, up, height) else {
            return Ok(None);
        };
        let changed = Region {
            obstacles: &lower,
            points: self.points.clone(),
            normals: self.normals.clone(),
            cutter: self.cutter.clone(),
            options: self.options,
            ..*self
        };
        let places: Vec<_> = self.points.iter().copied().zip(self.normals.clone()).collect();
        let labels = changed.label(&self.cutter, &places, self.directions)?;
        let is_freed = |i: usize| {
            let is_left = self.points[i].dot(up) <= height;
            is_left && labels.answers[i] == SiteAnswer::Accessible
        };
        let n_freed = (0..self.n()).filter(|&i| is_freed(i)).count();
        let share = n_freed as f64 / self.n() as f64;
        let of_part = PartChange {
            kind: PartLength::HeightInTheWay,
            from_mm: rounded(by_mm),
            to_mm: 0.0,
            at_mm: blocked.at_mm,
            depth_mm: None,
            share,
        };
        Ok((share >= LEAST_SHARE).then_some(of_part))
    }
}

impl TriangleObstacles {
    /// The obstacles without what of the part is above a height along `up` and connected there with a face, and by how
    /// much that is lower then, mm; `None` if it is too much of the part, or
    /// nothing of it ends in a level face.
    fn cut_off(&self, face: u32, up: DVec3, height: f64) -> Option<(TriangleObstacles, f64)> {
        let n_of_part = self.n_of_part() as usize;
        let of_part = &self.triangles[..n_of_part];
        let above = self.above(face, up, height)?;
        let top = |f: usize| of_part[f].iter().map(|p| p.dot(up)).fold(f64::MIN, f64::max);
        let highest = above.iter().map(|&f| top(f)).fold(f64::MIN, f64::max);
        let is_top = |f: usize| {
            let [a, b, c] = of_part[f];
            let facing = (b - a).cross(c - a).normalize_or_zero().dot(up);
            facing >= LEVEL && top(f) >= highest - SAME_MM
        };
        if !above.iter().any(|&f| is_top(f)) {
            return None;
        }
        let area = |t: &[DVec3; 3]| 0.5 * (t[1] - t[0]).cross(t[2] - t[0]).length();
        let mut is_above = vec![false; n_of_part];
        above.iter().for_each(|&f| is_above[f] = true);
        let (mut triangles, mut faces) = (Vec::new(), Vec::new());
        for (f, corners) in of_part.iter().enumerate() {
            let kept = match is_above[f] {
                true => below(corners, up, height),
                false => vec![*corners],
            };
            faces.extend(kept.iter().map(|_| f as u32));
            triangles.extend(kept);
        }
        let [whole, kept] = [of_part, &triangles[..]].map(|all| all.iter().map(area).sum::<f64>());
        if whole - kept > MOST_CUT * whole {
            return None;
        }
        triangles.extend_from_slice(&self.triangles[n_of_part..]);
        let chords = self.chords.of_faces(&faces);
        let lower = TriangleObstacles { bvh: Bvh::new(&triangles), chords, triangles };
        Some((lower, highest - height))
    }

    /// The triangles of the part that reach above a height along `up` and are connected there with a face.
    fn above(&self, face: u32, up: DVec3, height: f64) -> Option<Vec<usize>> {
        let of_part = &self.triangles[..self.n_of_part() as usize];
        let is_high = |p: &DVec3| p.dot(up) > height;
        let key = |p: &DVec3| p.to_array().map(|x| (x + 0.0).to_bits());
        let corners = of_part.iter().enumerate().flat_map(|(f, corners)| {
            corners.iter().filter(|p| is_high(p)).map(move |p| (key(p), f as u32))
        });
        // One list: a small one for every triangle would leave the memory in pieces.
        let mut corners_above: Vec<([u64; 3], u32)> = corners.collect();
        corners_above.sort_unstable();
        let mut is_seen = vec![false; of_part.len()];
        let (mut open, mut found) = (vec![face as usize], Vec::new());
        while let Some(f) = open.pop() {
            if std::mem::replace(&mut is_seen[f], true) {
                continue;
            }
            found.push(f);
            for p in of_part[f].iter().filter(|p| is_high(p)) {
                let first = corners_above.partition_point(|(of, _)| *of < key(p));
                let same = corners_above[first..].iter().take_while(|(of, _)| *of == key(p));
                open.extend(same.map(|(_, f)| *f as usize).filter(|&f| !is_seen[f]));
            }
        }
        found.sort_unstable();
        of_part[face as usize].iter().any(is_high).then_some(found)
    }
}

/// What of a triangle is not above a height.
fn below(corners: &[DVec3; 3], up: DVec3, height: f64) -> Vec<[DVec3; 3]> {
    let mut rim: Vec<DVec3> = Vec::with_capacity(4);
    for k in 0..3 {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        let (over_a, over_b) = (a.dot(up) - height, b.dot(up) - height);
        if over_a <= 0.0 {
            rim.push(a);
        }
        if (over_a <= 0.0) != (over_b <= 0.0) {
            rim.push(a.lerp(b, over_a / (over_a - over_b)));
        }
    }
    (2..rim.len()).map(|k| [rim[0], rim[k - 1], rim[k]]).collect()
}

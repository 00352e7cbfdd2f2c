//! Which finding is which known one.

use super::KnownFinding;
use crate::geom::Sites;
use crate::report::findings::{Bounds, Finding, Findings};
use glam::DVec3;

/// Findings whose mean normals are further apart than this cosine are on other sides.
const OTHER_SIDE: f64 = -0.5;

/// Per finding, its known one: those of its tool and cause, the largest overlap first, one to one. Known ones were
/// `moved` since.
pub fn pairs(
    findings: &Findings,
    (members, sites): (&[Vec<u32>], &Sites),
    (known, tool): (&[KnownFinding], &str),
    moved: DVec3,
) -> Vec<Option<usize>> {
    let mut overlaps = Vec::new();
    for (k, (finding, members)) in findings.list.iter().zip(members).enumerate() {
        for (j, known) in known.iter().enumerate() {
            if known.tool != tool || known.cause != finding.cause {
                continue;
            }
            let overlap = overlap((finding, members, sites), known, moved);
            if overlap > 0.0 {
                overlaps.push((overlap, k, j));
            }
        }
    }
    // A stable sort: equal overlaps stay in the order of the findings, then of the baseline.
    overlaps.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut of_finding = vec![None; findings.list.len()];
    let mut is_taken = vec![false; known.len()];
    for (_, k, j) in overlaps {
        if of_finding[k].is_none() && !is_taken[j] {
            of_finding[k] = Some(j);
            is_taken[j] = true;
        }
    }
    of_finding
}

/// The area of the finding that the known one covers, as a share of the larger of both.
fn overlap(
    (finding, members, sites): (&Finding, &[u32], &Sites),
    known: &KnownFinding,
    moved: DVec3,
) -> f64 {
    if finding.normal.dot(known.normal) < OTHER_SIDE {
        return 0.0;
    }
    let site_mm2 = finding.area_mm2 / finding.n_sites.max(1) as f64;
    let spacing_mm = site_mm2.sqrt();
    let reach_mm = known.reach_mm.unwrap_or(0.0).max(spacing_mm);
    let box_of = |[low, high]: Bounds| [low + moved - reach_mm, high + moved + reach_mm];
    let [low, high] = box_of(known.bounds);
    let is_in_box = |p: DVec3| p.cmpge(low).all() && p.cmple(high).all();
    if finding.high_mm.cmplt(low).any() || finding.low_mm.cmpgt(high).any() {
        return 0.0;
    }
    let is_near = |p: DVec3| known.points.iter().any(|q| p.distance(*q + moved) <= reach_mm);
    let place = |i: &&u32| sites.points[**i as usize].as_dvec3();
    let is_covered = |i: &&u32| {
        let p = place(i);
        is_in_box(p) && (known.points.is_empty() || is_near(p))
    };
    let covered_mm2 = site_mm2 * members.iter().filter(is_covered).count() as f64;
    covered_mm2 / finding.area_mm2.max(known.area_mm2).max(f64::MIN_POSITIVE)
}

/// At most `n` places of `members`, each as far from those before it as can be, and how far the others are at most
/// from the nearest.
pub fn thinned(members: &[u32], place: impl Fn(u32) -> DVec3, n: usize) -> (Vec<DVec3>, f64) {
    let Some(first) = members.first() else { return (Vec::new(), 0.0) };
    let mut chosen = vec![place(*first)];
    let distance = |i: &u32| place(*i).distance_squared(chosen[0]);
    let mut distances: Vec<f64> = members.iter().map(distance).collect();
    loop {
        // The first among equals.
        let furthest =
            (0..members.len()).reduce(|a, b| if distances[b] > distances[a] { b } else { a });
        let furthest = furthest.unwrap_or(0);
        let most = distances[furthest];
        if chosen.len() >= n || most == 0.0 {
            return (chosen, most.sqrt());
        }
        let next = place(members[furthest]);
        for (distance, i) in distances.iter_mut().zip(members) {
            *distance = distance.min(place(*i).distance_squared(next));
        }
        chosen.push(next);
    }
}

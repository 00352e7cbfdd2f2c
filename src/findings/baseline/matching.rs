//! Which findings are which known ones.

use super::cells::Cover;
use super::{KnownFinding, SMALL_SITES};
use crate::findings::{Finding, Findings};
use crate::geom::Sites;
use glam::DVec3;
use std::collections::HashMap;

/// A finding and a known one are of one group if they have this share of the smaller of both areas in common.
const SHARED: f64 = 0.5;
/// Sites of a patch are neighbors within so many spacings.
const NEIGHBOR_SPACINGS: f64 = 2.5;

/// What findings and known ones have in common.
pub struct Matches {
    /// Per finding, its known one: those of its cause first, of these the largest overlap first, one to one.
    pub pairs: Vec<Option<usize>>,
    /// Per finding, the other known ones that it is of, the largest overlap first.
    pub others: Vec<Vec<usize>>,
    /// Per finding, its group; one that is of no known one has a group of its own.
    pub group: Vec<usize>,
    /// Per known one, its group.
    pub group_of_known: Vec<usize>,
    /// Per finding, the largest patch of it that nothing covers.
    pub patches: Vec<Patch>,
    /// Per finding, the area that scattered sites of the baseline alone cover, mm².
    pub scattered_mm2: Vec<f64>,
}

/// Sites of a finding that neither known ones nor scattered sites cover, and that are connected.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Patch {
    /// Number of sites.
    pub n_sites: usize,
    /// Where the first of them is, mm.
    pub at_mm: DVec3,
}

impl Patch {
    /// Its area, as a part of the finding's, mm².
    pub fn area_mm2(self, of: &Finding) -> f64 {
        self.n_sites as f64 * of.area_mm2 / of.n_sites.max(1) as f64
    }

    /// Whether it has the area of [`SMALL_SITES`] sites or more.
    pub fn is_large(self, of: &Finding, site_mm2: f64) -> bool {
        // Less an error of rounding: areas of all sites may be equal.
        self.area_mm2(of) >= (1.0 - 1e-9) * SMALL_SITES * site_mm2
    }
}

/// Matches findings with what is known: with known ones, of which `covers` has `None` for those of other tools, and
/// with sites that were scattered.
pub fn matches(
    findings: &Findings,
    (members, sites): (&[Vec<u32>], &Sites),
    (known, covers): (&[KnownFinding], &[Option<Cover>]),
    scattered: &[Cover],
) -> Matches {
    let n = findings.list.len();
    let mut overlaps = Vec::new();
    let (mut patches, mut scattered_mm2) = (Vec::with_capacity(n), Vec::with_capacity(n));
    for (k, (finding, members)) in findings.list.iter().zip(members).enumerate() {
        let site_mm2 = finding.area_mm2 / finding.n_sites.max(1) as f64;
        let mut is_covered = vec![false; members.len()];
        for (j, (known, cover)) in known.iter().zip(covers).enumerate() {
            let Some(cover) = cover else { continue };
            let mut n_common = 0;
            for (i, is_covered) in members.iter().zip(&mut is_covered) {
                if cover.covers_site(sites, *i) {
                    (*is_covered, n_common) = (true, n_common + 1);
                }
            }
            if n_common > 0 {
                overlaps.push(Overlap::new((k, finding), (j, known), site_mm2 * n_common as f64));
            }
        }
        let open = members.iter().zip(&is_covered).filter(|(_, is_covered)| !**is_covered);
        let was_scattered = |i: &u32| scattered.iter().any(|cover| cover.covers_site(sites, *i));
        let (known, open): (Vec<u32>, Vec<u32>) = open.map(|(i, _)| *i).partition(was_scattered);
        scattered_mm2.push(site_mm2 * known.len() as f64);
        let open: Vec<DVec3> = open.iter().map(|i| sites.points[*i as usize].as_dvec3()).collect();
        patches.push(largest_patch(&open, NEIGHBOR_SPACINGS * site_mm2.sqrt()));
    }
    // A stable sort: equal overlaps stay in the order of the findings, then of the baseline.
    overlaps
        .sort_by(|a, b| b.is_same_cause.cmp(&a.is_same_cause).then(b.share.total_cmp(&a.share)));
    let mut pairs = vec![None; n];
    let mut is_taken = vec![false; known.len()];
    for &Overlap { k, j, .. } in &overlaps {
        if pairs[k].is_none() && !is_taken[j] {
            pairs[k] = Some(j);
            is_taken[j] = true;
        }
    }
    let mut sets = Sets::new(n + known.len());
    let mut others = vec![Vec::new(); n];
    for overlap in &overlaps {
        let &Overlap { k, j, .. } = overlap;
        let is_pair = pairs[k] == Some(j);
        if is_pair || overlap.is_shared {
            sets.join(k, n + j);
        }
        // Of a finding that has a name already, what joined in it; of a piece, what it is a piece of.
        if !is_pair && overlap.is_shared && (pairs[k].is_none() || !is_taken[j]) {
            others[k].push(j);
        }
    }
    let mut groups = (0..n + known.len()).map(|member| sets.root(member)).collect::<Vec<_>>();
    let group_of_known = groups.split_off(n);
    Matches { pairs, others, group: groups, group_of_known, patches, scattered_mm2 }
}

/// A finding that a known one covers in part.
struct Overlap {
    k: usize,
    j: usize,
    is_same_cause: bool,
    /// Of the larger of both areas.
    share: f64,
    is_shared: bool,
}

impl Overlap {
    fn new((k, finding): (usize, &Finding), (j, known): (usize, &KnownFinding), mm2: f64) -> Self {
        let (a, b) = (finding.area_mm2, known.area_mm2);
        let share = mm2 / a.max(b).max(f64::MIN_POSITIVE);
        let is_same_cause = finding.cause == known.cause;
        Overlap { k, j, is_same_cause, share, is_shared: mm2 >= SHARED * a.min(b) }
    }
}

/// The patch of most places that are connected by steps of at most `step_mm`; of equal ones, that of the first place.
fn largest_patch(places: &[DVec3], step_mm: f64) -> Patch {
    let cell = |p: DVec3| (p / step_mm).floor().to_array().map(|index| index as i64);
    let mut in_cell: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    let mut sets = Sets::new(places.len());
    for (a, p) in places.iter().enumerate() {
        let [x, y, z] = cell(*p);
        for offset in 0..27 {
            let key = [x + offset % 3 - 1, y + offset / 3 % 3 - 1, z + offset / 9 - 1];
            for b in in_cell.get(&key).into_iter().flatten() {
                if p.distance(places[*b]) <= step_mm {
                    sets.join(a, *b);
                }
            }
        }
        in_cell.entry([x, y, z]).or_default().push(a);
    }
    let mut sizes = vec![0; places.len()];
    (0..places.len()).for_each(|a| sizes[sets.root(a)] += 1);
    // A root is the first of its set.
    let largest = (0..places.len()).reduce(|a, b| if sizes[b] > sizes[a] { b } else { a });
    largest.map_or(Patch::default(), |a| Patch { n_sites: sizes[a], at_mm: places[a] })
}

/// Disjoint sets; the root of one is its least member.
struct Sets {
    parent: Vec<usize>,
}

impl Sets {
    fn new(n: usize) -> Self {
        Sets { parent: (0..n).collect() }
    }

    fn root(&mut self, mut member: usize) -> usize {
        while self.parent[member] != member {
            self.parent[member] = self.parent[self.parent[member]];
            member = self.parent[member];
        }
        member
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b)] = a.min(b);
    }
}

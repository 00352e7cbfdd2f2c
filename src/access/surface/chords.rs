//! The chord errors of the facets of a mesh: their [definition](super::tolerance).

use super::facets::{Facet, Facets};
use super::folds::{Fold, FoldKind, Side, edge, folds, height, smoothness};
use crate::exec::par;
use crate::geom::Mesh;
use crate::spatial::CountingSort;
use glam::{DMat2, DVec2, DVec3};
use std::collections::BTreeSet;
use std::f64::consts::FRAC_1_SQRT_2;

/// Facets of one curve have at least this ratio of widths; below the next it is none.
const SAME_CURVE: f64 = 0.5;
const OTHER_SURFACE: f64 = 0.25;
/// More than what the estimate of a chord error may lack, as a factor.
const ESTIMATE: f64 = 1.1;
/// The concave curve that a facet replaces.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Chord {
    /// Distance between facet and curve, mm.
    pub error: f64,
    /// Curvature, 1/mm.
    curvature: f64,
}

impl Chord {
    /// What is granted beyond [`LEAST_MM`] to a tool of this radius.
    pub fn granted(self, radius: f64) -> f64 {
        ESTIMATE * self.error * (radius * self.curvature).min(1.0)
    }

    fn max(self, other: Chord) -> Chord {
        Chord { error: self.error.max(other.error), curvature: self.curvature.max(other.curvature) }
    }
}

/// The chords of all faces of a mesh.
#[derive(Debug)]
pub(super) struct Chords(Vec<Chord>);

impl Chords {
    /// Of a face; nothing of one that is not of the mesh.
    pub fn at(&self, face: u32) -> Chord {
        self.0.get(face as usize).copied().unwrap_or_default()
    }

    /// Those of some of the faces, or of pieces of them.
    pub fn of_faces(&self, faces: &[u32]) -> Self {
        Chords(faces.iter().map(|&f| self.0[f as usize]).collect())
    }

    /// Number of faces.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    pub fn of(mesh: &Mesh) -> Self {
        let mut folds = folds(mesh);
        let flat = folds.iter().filter(|fold| fold.kind == FoldKind::Flat);
        let facets = Facets::of(mesh, flat.map(Fold::faces));
        let widths = Widths { mesh, facets: &facets };
        count_continued(&widths, &mut folds);
        let flat = || folds.iter().filter(|fold| fold.kind == FoldKind::Flat);
        let mut across = vec![[None; 3]; mesh.triangles.len()];
        let mut around = vec![Vec::new(); facets.all().len()];
        for side in folds.iter().flat_map(Fold::sides).filter(|side| side.counted > 0.0) {
            across.as_flattened_mut()[side.half as usize] = Some(side);
            if let Some(k) = facets.number(side.half as usize / 3) {
                around[k].push(side);
            }
        }
        let facet_chords =
            par::map(around.len(), |k: usize| facet_chord(&widths, &facets.all()[k], &around[k]));
        let from_facet = |f: usize| facets.number(f).and_then(|k| facet_chords[k]);
        let height_at = |half: u32| match from_facet(half as usize / 3) {
            Some(_) => widths.at(half),
            None => height(mesh, half),
        };
        let chord = |f: usize| match from_facet(f) {
            Some(chord) => chord,
            None if across[f].iter().all(Option::is_none) => Chord::default(),
            None => chord(mesh, f, &across[f], height_at),
        };
        let own = par::map(mesh.triangles.len(), chord);
        // The two triangles of a strip's quadrangle are one facet.
        let mut by_facet = own.clone();
        for fold in flat() {
            let [x, y] = fold.faces();
            if from_facet(x).is_none() && is_similar(mesh, fold.halves) {
                by_facet[x] = by_facet[x].max(own[y]);
                by_facet[y] = by_facet[y].max(own[x]);
            }
        }
        let mut chords = by_facet.clone();
        let plane = PlaneNeighbors::of(mesh, flat());
        for fold in folds.iter().filter(|fold| fold.kind == FoldKind::Corner) {
            let ([x, y], [p, q]) = (fold.faces(), fold.halves);
            for (own, of, other) in [(x, y, q), (y, x, p)] {
                let granted = by_facet[of];
                chords[own] = chords[own].max(granted);
                if from_facet(of).is_none() || granted.error <= 0.0 {
                    continue;
                }
                let cut_off = widths.cut_off(other, granted.error / oblique(mesh, fold.halves));
                plane.reaching_in(mesh, own, &cut_off, |f, share| {
                    let error = share * granted.error;
                    chords[f] = chords[f].max(Chord { error, ..granted });
                });
            }
        }
        Chords(chords)
    }
}

/// What reaches in less than this, as a share of the chord error, is only touched.
const LEAST_SHARE: f64 = 1e-3;

/// Distance from a curve across it, over distance in the plane that meets it in an edge; at least that at 45°.
fn oblique(mesh: &Mesh, halves: [u32; 2]) -> f64 {
    let [n, m] = halves.map(|half| mesh.area_vector(half as usize / 3).normalize_or_zero());
    n.cross(m).length().max(FRAC_1_SQRT_2)
}

/// The faces that are in one plane with a face, over each of its edges.
struct PlaneNeighbors(Vec<[Option<u32>; 3]>);

impl PlaneNeighbors {
    fn of<'a>(mesh: &Mesh, flat: impl Iterator<Item = &'a Fold>) -> Self {
        let mut over = vec![[None; 3]; mesh.triangles.len()];
        for &Fold { halves: [x, y], .. } in flat {
            over.as_flattened_mut()[x as usize] = Some(y / 3);
            over.as_flattened_mut()[y as usize] = Some(x / 3);
        }
        PlaneNeighbors(over)
    }

    /// Calls `then` with the faces in one plane with a face at the edge of a facet that reach in between the facet and
    /// its curve, and how far, as a share of the chord error.
    fn reaching_in(
        &self,
        mesh: &Mesh,
        face: usize,
        cut_off: &CutOff,
        mut then: impl FnMut(usize, f64),
    ) {
        let (mut seen, mut next) = (BTreeSet::from([face as u32]), vec![face as u32]);
        while let Some(f) = next.pop() {
            for over in self.0[f as usize].into_iter().flatten() {
                if !seen.insert(over) {
                    continue;
                }
                let share = cut_off.share(&mesh.corners(over as usize));
                if share > LEAST_SHARE {
                    then(over as usize, share);
                    next.push(over);
                }
            }
        }
    }
}

/// What is between a facet and the curve that it replaces, in a plane that meets the facet in an edge.
struct CutOff {
    /// Of the edge, if it is between the facet's sides; else of the chord that the side is.
    ends: [DVec3; 2],
    is_chord: bool,
    /// Greatest distance from the chord, mm.
    error: f64,
}

impl CutOff {
    /// How far a triangle in the plane reaches in, as a share of the error. Over a chord the curve is a parabola; along
    /// an edge between the sides all of the error is assumed.
    fn share(&self, corners: &[DVec3; 3]) -> f64 {
        let [a, b] = self.ends;
        let length = (b - a).length();
        let along = (b - a) / length;
        let places = corners.map(|p| [(p - a).dot(along), (p - a).reject_from(along).length()]);
        if !self.is_chord {
            let is_beside = |s: f64| (-self.error..=length + self.error).contains(&s);
            let is_near = places.iter().any(|[s, away]| is_beside(*s) && *away < self.error);
            return f64::from(u8::from(is_near));
        }
        let steep = 4.0 * self.error / (length * length);
        // Above the parabola, negative in it, the height is convex along the sides of the triangle.
        let lowest = (0..3).map(|k| {
            let ([s, away], [s1, away1]) = (places[k], places[(k + 1) % 3]);
            let (run, rise) = (s1 - s, away1 - away);
            let above = |t: f64| {
                let at = s + run * t;
                away + rise * t - steep * at * (length - at)
            };
            let slope = rise + steep * run * (2.0 * s - length);
            let t = -slope / (2.0 * steep * run * run).max(f64::MIN_POSITIVE);
            above(t.clamp(0.0, 1.0))
        });
        (-lowest.fold(0.0, f64::min) / self.error).min(1.0)
    }
}

/// How far faces and facets extend from their edges.
struct Widths<'a> {
    mesh: &'a Mesh,
    facets: &'a Facets,
}

impl Widths<'_> {
    /// Of a half edge.
    fn at(&self, half: u32) -> f64 {
        let facet = self.facets.facet(half as usize / 3);
        facet.map_or_else(|| height(self.mesh, half), |facet| facet.width(edge(self.mesh, half)))
    }

    /// What a facet of many triangles cuts off from its curve along one of their edges.
    fn cut_off(&self, half: u32, error: f64) -> CutOff {
        let edge = edge(self.mesh, half);
        let side = self.facets.facet(half as usize / 3).and_then(|facet| facet.side(edge));
        CutOff { error, is_chord: side.is_some(), ends: side.unwrap_or(edge) }
    }
}

/// Whether the faces over an edge are about as high on it.
fn is_similar(mesh: &Mesh, [x, y]: [u32; 2]) -> bool {
    let [x, y] = [height(mesh, x), height(mesh, y)];
    x.min(y) >= SAME_CURVE * x.max(y)
}

/// How much a neighbor counts for the curve of a facet, by the ratio of its height on the edge to the facet's own.
fn weight(ratio: f64) -> f64 {
    if ratio >= 1.0 {
        return 1.0;
    }
    let share = ((ratio - OTHER_SURFACE) / (SAME_CURVE - OTHER_SURFACE)).clamp(0.0, 1.0);
    share * 2.0 / (1.0 + ratio.max(SAME_CURVE))
}

/// Counts the turns that belong to a curve, by their [`smoothness`] and by how much the curve goes on beyond one of the
/// two facets: two planes that meet in a blunt edge are no curve, whatever else is beside them.
///
/// ```text
/// goes on beyond a facet = min(1, 2/l · Σ l' max(0, -t·t') w' · smoothness(θ') · similarity(κ, κ'))
/// l: length of the edge; t: in the facet, across the edge; κ: turn over the facet's width; primes: its other folds
/// ```
///
/// So half of the edge is to have a turn across from it.
fn count_continued(widths: &Widths, folds: &mut [Fold]) {
    let (mesh, facets) = (widths.mesh, widths.facets);
    let curved: Vec<usize> = (0..folds.len()).filter(|&k| folds[k].turn > 0.0).collect();
    let turning = par::map(curved.len(), |k: usize| {
        folds[curved[k]].sides().map(|side| Turning::of(widths, side))
    });
    let facet = |k: usize| facets.first(turning.as_flattened()[k].half as usize / 3) as usize;
    let mut sort = CountingSort::default();
    sort.clear(mesh.triangles.len());
    (0..2 * curved.len()).for_each(|k| sort.count(facet(k)));
    sort.finish_counting();
    let mut by_facet = vec![0; 2 * curved.len()];
    (0..2 * curved.len()).for_each(|k| by_facet[sort.place(facet(k))] = k as u32);
    let goes_on = |k: usize| {
        let side = &turning.as_flattened()[k];
        let needed = 0.5 * side.outward.length_squared();
        let mut found = 0.0;
        for &other in &by_facet[sort.range(facet(k), facet(k))] {
            found += side.found_across(&turning.as_flattened()[other as usize]);
            if found >= needed {
                return 1.0;
            }
        }
        if needed > 0.0 { found / needed } else { 0.0 }
    };
    let counted = par::map(curved.len(), |k: usize| goes_on(2 * k).max(goes_on(2 * k + 1)));
    for (&k, goes_on) in curved.iter().zip(counted) {
        folds[k].counted = smoothness(folds[k].turn) * goes_on;
    }
}

/// A turn of a facet, as the others of the facet see it.
struct Turning {
    half: u32,
    /// In the facet, across the edge, as long as the edge.
    outward: DVec3,
    /// Of the turn over the facet's width, 1/mm.
    curvature: f64,
    /// By the neighbor's width and the turn.
    counted: f64,
}

impl Turning {
    fn of(widths: &Widths, side: Side) -> Self {
        let [a, b] = edge(widths.mesh, side.half);
        let normal = widths.mesh.area_vector(side.half as usize / 3).normalize_or_zero();
        let (own, others) = (widths.at(side.half), widths.at(side.other));
        let counted = if own > 0.0 { weight(others / own) * smoothness(side.turn) } else { 0.0 };
        let (half, outward) = (side.half, (b - a).cross(normal));
        Turning { half, outward, curvature: side.turn / own, counted }
    }

    /// What of its edge another of the same facet faces, times its length; nothing of itself.
    fn found_across(&self, other: &Turning) -> f64 {
        let across = -self.outward.dot(other.outward);
        match across > 0.0 && other.counted > 0.0 {
            true => across * other.counted * similarity(self.curvature, other.curvature),
            false => 0.0,
        }
    }
}

/// How much two curvatures may be those of one curve.
fn similarity(one: f64, other: f64) -> f64 {
    /// Ratios in one curve are at least the second; below the first it is another.
    const RATIOS: [f64; 2] = [0.1, 0.25];
    let [least, same] = RATIOS;
    ((one.min(other) / one.max(other) - least) / (same - least)).clamp(0.0, 1.0)
}

/// The chord of a face whose neighbors rise over some of its edges; `height_at` is how far these extend from an edge.
fn chord(
    mesh: &Mesh,
    f: usize,
    across: &[Option<Side>; 3],
    height_at: impl Fn(u32) -> f64,
) -> Chord {
    let corners = mesh.corners(f);
    let normal = mesh.area_vector(f).normalize_or_zero();
    let u = (corners[1] - corners[0]).normalize_or_zero();
    let v = normal.cross(u);
    let flat = corners.map(|p| DVec2::new((p - corners[0]).dot(u), (p - corners[0]).dot(v)));
    let mut shape = DMat2::ZERO;
    for (k, fold) in across.iter().enumerate() {
        let Some(Side { turn, counted, other, .. }) = *fold else { continue };
        let own = height(mesh, (3 * f + k) as u32);
        let edge = (flat[(k + 1) % 3] - flat[k]).normalize_or_zero();
        if own <= 0.0 || edge == DVec2::ZERO {
            continue;
        }
        let t = edge.perp();
        let counted = weight(height_at(other) / own) * counted * turn / own;
        shape += DMat2::from_cols(t * t.x, t * t.y) * counted;
    }
    let second = |a: usize, b: usize| (flat[a] - flat[b]).dot(shape * (flat[a] - flat[b]));
    let q = [second(0, 1), second(1, 2), second(2, 0)];
    let on_edges = q.iter().fold(0.0, |a: f64, b| a.max(*b)) / 8.0;
    let within = q.iter().sum::<f64>() / 18.0;
    Chord { error: on_edges.max(within), curvature: greatest_eigenvalue(shape) }
}

/// The chord of a facet of many triangles, of which some rise over some of its edges; none of one that has neighbors of
/// its curve on one side alone.
///
/// ```text
/// Λ = 1 / min(A, pᵀMp) · Σ w(ratio) · θ · l/2 · t tᵀ        A: area; l: length of the edge
/// M = Σ l/2 · h · t tᵀ                                     p: greatest eigenvector of the sum; h: width on the edge
/// ```
///
/// Of a triangle the first is what [`chord`] has. The second is less where some of a side turns against nothing: of a
/// strip with bores across its edges.
fn facet_chord(widths: &Widths, facet: &Facet, around: &[Side]) -> Option<Chord> {
    /// Cosine with the curve's direction of what is on one of its sides.
    const SIDE: f64 = 0.5;
    let (mut turns, mut swept) = (DMat2::ZERO, DMat2::ZERO);
    let mut sides = Vec::new();
    for &Side { turn, counted, half, other } in around {
        let [a, b] = edge(widths.mesh, half).map(|p| facet.flat(p));
        let (own, t) = (widths.at(half), (b - a).normalize_or_zero().perp());
        let counted = weight(widths.at(other) / own) * counted;
        if own > 0.0 && counted > 0.0 {
            let across = DMat2::from_cols(t * t.x, t * t.y) * (0.5 * (b - a).length());
            turns += across * (counted * turn);
            swept += across * (counted * own);
            sides.push(t);
        }
    }
    let greatest = greatest_eigenvalue(turns);
    if greatest <= 0.0 {
        return None;
    }
    // A column of what the other eigenvalue leaves.
    let rest =
        turns - DMat2::from_diagonal(DVec2::splat(turns.x_axis.x + turns.y_axis.y - greatest));
    let longer = rest.x_axis.length_squared() >= rest.y_axis.length_squared();
    let p = if longer { rest.x_axis } else { rest.y_axis }.normalize_or(DVec2::X);
    let is_on = |sign: f64| sides.iter().any(|t| sign * t.dot(p) > SIDE);
    if !(is_on(1.0) && is_on(-1.0)) {
        return None;
    }
    let shape = turns * (1.0 / (0.5 * facet.double_area).min(p.dot(swept * p)));
    let mut across: f64 = 0.0;
    for (k, a) in facet.hull.iter().enumerate() {
        for b in &facet.hull[k + 1..] {
            across = across.max((*a - *b).dot(shape * (*a - *b)));
        }
    }
    Some(Chord { error: across / 8.0, curvature: greatest_eigenvalue(shape) })
}

fn greatest_eigenvalue(shape: DMat2) -> f64 {
    let half_trace = 0.5 * (shape.x_axis.x + shape.y_axis.y);
    half_trace + (half_trace * half_trace - shape.determinant()).max(0.0).sqrt()
}

//! Claims about the mesh definition, each on bodies whose answer is known.

use super::labels::SurfaceLabels;
use super::tool::Tip;
use super::{
    ContactTolerance, Reached, RefinementOptions, SurfaceOptions, TriangleObstacles, Warning,
};
use super::{drop, penetrate, raise};
use crate::access::evidence::SurfaceEvidence;
use crate::answers::SiteAnswer;
use crate::exec::par;
use crate::geom::{Mesh, Sites, solids};
use crate::numeric::rng::{Purpose, Stream};
use crate::tool::cutter::{Cutter, CutterParams};
use crate::tool::directions::{DirectionSet, Directions};
use glam::{DMat3, DQuat, DVec2, DVec3, Vec3, dvec2, dvec3};
use std::f64::consts::{PI, TAU};

mod closed;
mod engines;
mod explain;
mod invariance;
mod known;
mod library;
mod margins;
mod search;
mod shapes;

fn ball(lengths: [f64; 4]) -> Cutter {
    Cutter::ball_end(CutterParams::from_array(lengths)).unwrap()
}

fn bull(lengths: [f64; 4], corner: f64) -> Cutter {
    Cutter::bull_nose(CutterParams::from_array(lengths), corner).unwrap()
}

fn list(vectors: &[Vec3]) -> Directions {
    let vectors = vectors.iter().map(|d| d.as_dvec3().to_array()).collect();
    Directions::new(DirectionSet::List { vectors }).unwrap()
}

fn up() -> Directions {
    list(&[Vec3::Z])
}

fn hemisphere(n: usize) -> Directions {
    Directions::fibonacci_hemisphere(n).unwrap()
}

fn exactly(tolerance: f64) -> SurfaceOptions {
    SurfaceOptions {
        tolerance: ContactTolerance::Millimeters(tolerance),
        occlusion: false,
        refinement: None,
        n_samples: 2000,
        ..SurfaceOptions::default()
    }
}

fn implied() -> SurfaceOptions {
    SurfaceOptions { tolerance: ContactTolerance::Tessellation, ..exactly(1.0) }
}

fn label(
    mesh: &Mesh,
    sites: &Sites,
    cutter: &Cutter,
    directions: &Directions,
    options: &SurfaceOptions,
) -> SurfaceLabels {
    TriangleObstacles::new(mesh, &[])
        .unwrap()
        .surface_labels(sites, cutter, directions, options)
        .unwrap()
}

fn answers(
    mesh: &Mesh,
    sites: &Sites,
    cutter: &Cutter,
    directions: &Directions,
    options: &SurfaceOptions,
) -> Vec<SiteAnswer> {
    label(mesh, sites, cutter, directions, options).answers
}

fn n_of(answer: SiteAnswer, answers: &[SiteAnswer]) -> usize {
    answers.iter().filter(|a| **a == answer).count()
}

/// Sites spread over the faces that `keep` admits by centroid and normal, `n` to a face.
fn sites_on(mesh: &Mesh, n: usize, keep: impl Fn(DVec3, DVec3) -> bool) -> Sites {
    let mut sites = Sites::default();
    let mut stream = Stream::new(5, 0, 0, Purpose::Probe);
    for f in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(f);
        let normal = mesh.area_vector(f).normalize();
        if !keep((a + b + c) / 3.0, normal) {
            continue;
        }
        for _ in 0..n {
            let (u, v) = (stream.range(0.01, 0.99), stream.range(0.01, 0.99));
            let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
            sites.points.push((a + (b - a) * u + (c - a) * v).as_vec3());
            sites.normals.push(normal.as_vec3());
            sites.faces.push(f as u32);
        }
    }
    sites
}

fn everywhere(mesh: &Mesh, n: usize) -> Sites {
    sites_on(mesh, n, |_, _| true)
}

/// A ring of `n` facets with a bore through it, standing on z = 0.
fn tube(inner: f64, outer: f64, height: f64, n: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for (radius, z) in [(outer, 0.0), (outer, height), (inner, height), (inner, 0.0)] {
        for k in 0..n {
            let angle = TAU * f64::from(k) / f64::from(n);
            mesh.vertices.push(dvec3(radius * angle.cos(), radius * angle.sin(), z));
        }
    }
    for ring in 0..4 {
        for k in 0..n {
            let (next, k1) = ((ring + 1) % 4, (k + 1) % n);
            let [a, b, c, d] = [ring * n + k, ring * n + k1, next * n + k1, next * n + k];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

/// Facets of a bore for a chord error.
fn facets(radius: f64, chord_error: f64) -> u32 {
    (PI / (1.0 - chord_error / radius).acos()).ceil() as u32
}

/// A block 40 × 40 mm, its top at z = 20, with a slot along y, `width` wide and `depth` deep.
pub(super) fn slotted(width: f64, depth: f64) -> Mesh {
    let (w, floor) = (0.5 * width, 20.0 - depth);
    let outline = [
        [-20.0, 0.0],
        [20.0, 0.0],
        [20.0, 20.0],
        [w, 20.0],
        [w, floor],
        [-w, floor],
        [-w, 20.0],
        [-20.0, 20.0],
    ];
    let cap = [[0, 5, 6], [0, 6, 7], [0, 1, 4], [0, 4, 5], [1, 2, 3], [1, 3, 4]];
    let mut mesh = solids::prism(&outline.map(DVec2::from_array), &cap, 40.0);
    mesh.vertices.iter_mut().for_each(|p| *p = dvec3(p.x, -p.z + 20.0, p.y));
    mesh
}

/// A sphere about the origin whose vertices lie on it.
fn sphere(radius: f64, n: u32) -> Mesh {
    let mut mesh = Mesh::default();
    let at = |i: u32, j: u32| {
        let (polar, around) =
            (PI * f64::from(i) / f64::from(n), TAU * f64::from(j) / f64::from(2 * n));
        dvec3(polar.sin() * around.cos(), polar.sin() * around.sin(), polar.cos()) * radius
    };
    mesh.vertices.push(at(0, 0));
    for i in 1..n {
        mesh.vertices.extend((0..2 * n).map(|j| at(i, j)));
    }
    mesh.vertices.push(at(n, 0));
    let index = |i: u32, j: u32| match i {
        0 => 0,
        i if i == n => (n - 1) * 2 * n + 1,
        i => 1 + (i - 1) * 2 * n + j % (2 * n),
    };
    for i in 0..n {
        for j in 0..2 * n {
            let [a, b, c, d] = [index(i, j), index(i + 1, j), index(i + 1, j + 1), index(i, j + 1)];
            mesh.triangles.extend(
                [[a, b, c], [a, c, d]]
                    .into_iter()
                    .filter(|t| t[0] != t[1] && t[1] != t[2] && t[0] != t[2]),
            );
        }
    }
    mesh
}

/// Every triangle cut into four.
fn subdivided(mesh: &Mesh) -> Mesh {
    let mut fine = Mesh::default();
    for f in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(f);
        let [d, e, g] = [0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)];
        for corners in [[a, d, g], [d, b, e], [g, e, c], [d, e, g]] {
            let n = fine.vertices.len() as u32;
            fine.vertices.extend(corners);
            fine.triangles.push([n, n + 1, n + 2]);
        }
    }
    fine
}

fn cutters() -> Vec<Cutter> {
    let params = CutterParams::from_array([1.5, 6.0, 8.0, 5.0]);
    vec![
        ball([1.0, 20.0, 5.0, 20.0]),
        ball([1.5, 6.0, 40.0, 5.0]),
        ball([2.0, 0.2, 5.0, 0.2]),
        bull([1.5, 6.0, 8.0, 5.0], 0.0),
        bull([2.0, 10.0, 12.0, 5.0], 0.5),
        bull([1.5, 6.0, 8.0, 5.0], 0.005),
        Cutter::tapered(params, 0.1, 5).unwrap(),
        Cutter::stepped(1.5, &[(5.0, 1.5), (8.0, 6.0), (9.0, 12.0)], false).unwrap(),
    ]
}

/// Checks the fast engine against the plain loops: what it finds free is free, what they find free with a little less
/// tolerance is found, and directions whose own pose is free are counted. Returns the number of pairs that are left to
/// the resolution.
fn assert_equal_to_the_reference(
    mesh: &Mesh,
    sites: &Sites,
    cutter: &Cutter,
    directions: &Directions,
    tolerance: f64,
) -> usize {
    let obstacles = TriangleObstacles::new(mesh, &[]).unwrap();
    let options = exactly(tolerance);
    let law = |tolerance: f64| {
        let options = exactly(tolerance);
        obstacles.reached_by_drop_heights(sites, cutter, directions, &options, RESOLUTION_MM)
    };
    let (less, more) =
        (law((1.0 - RESOLUTION_SHARE) * tolerance).unwrap(), law(tolerance + EPSILON_MM).unwrap());
    let fast = obstacles.accessible_directions(sites, cutter, directions, &options).unwrap();
    let labels = obstacles.surface_labels(sites, cutter, directions, &options).unwrap();
    let (mut n_left, mut n_missed) = (0, 0);
    for i in 0..sites.len() {
        let mut any = false;
        for d in 0..directions.len() {
            let (found, k) = (fast.is_accessible(d, i), i * directions.len() + d);
            any |= found;
            let place = (i, sites.points[i], sites.normals[i], directions.vectors()[d]);
            assert!(!found || more[k] != Reached::No, "{place:?} is not free: {cutter:?}");
            n_missed += usize::from(!found && less[k] == Reached::Yes);
            n_left += usize::from((less[k] == Reached::Yes) != (more[k] == Reached::Yes));
        }
        assert!(!any || labels.answers[i] == SiteAnswer::Accessible, "{i} {cutter:?}");
        assert_counts_of_own_poses(&obstacles, &labels, (sites, i), cutter, directions, tolerance);
    }
    // The search gives up after so many tests.
    assert!(n_missed * 50 <= sites.len() * directions.len(), "{n_missed} missed: {cutter:?}");
    n_left
}

/// Checks the counts of directions of a site against the drop heights of the tool that touches with its normal.
fn assert_counts_of_own_poses(
    obstacles: &TriangleObstacles,
    labels: &SurfaceLabels,
    (sites, i): (&Sites, usize),
    cutter: &Cutter,
    directions: &Directions,
    tolerance: f64,
) {
    let count = |tolerance: f64| {
        let one = sites.subset(&[i]);
        let options = exactly(tolerance);
        let problem = obstacles.problem((&one).into(), cutter, &options).unwrap();
        let (mut free, mut clear) = (0, 0);
        for &d in directions.vectors() {
            let stand = problem.own_stand(0, d);
            let all = obstacles.triangles.iter().map(|t| (*t, tolerance));
            let raise = super::verdict::raise_over(all, &problem.outline, 0.0, &stand);
            clear += u32::from(raise.steps <= 0.0);
            free += u32::from(raise.steps <= 0.0 && raise.tip <= 0.0);
        }
        [free, clear]
    };
    let [less, less_clear] = count(tolerance - EPSILON_MM);
    let found = [labels.accessible_directions[i], labels.evidence.collision_free_directions[i]];
    assert!(found[0] >= less && found[0] <= found[1], "{i} {less} {found:?} {cutter:?}");
    assert!(found[1] >= less_clear || cutter.side_mm() > 0.0, "{i} {less_clear} {found:?}");
}

#[test]
fn no_share_is_said_to_be_0_that_is_not() {
    let words = |unproven_share| Warning::Profile { unproven_share }.to_string();
    assert!(words(1.0 / 7000.0).contains("at less than 0.1 % of the sites"));
    assert!(words(0.0005).contains("at 0.1 % of the sites"), "{}", words(0.0005));
    assert!(words(0.0).ends_with("a retreat is proven wherever a pose is free"));
    let rests = Warning::RestsOnTolerance { n_sites: 1, share: 1.0 / 7000.0, greatest_mm: 0.1 };
    assert!(rests.to_string().starts_with("1 sites (less than 0.1 %) are"));
}

/// The most by which the tolerance of two engines may seem to differ, mm.
const EPSILON_MM: f64 = 1e-6;
/// Of the reference engine.
const RESOLUTION_MM: f64 = 4e-3;
/// By so much of the tolerance poses may be missed that are free.
const RESOLUTION_SHARE: f64 = 0.3;

//! Claims about the part itself, each on bodies whose answer is known.

use super::tool::Tip;
use super::{ContactTolerance, SiteAnswer, SurfaceLabels, SurfaceOptions, TriangleObstacles};
use super::{drop, penetrate, raise};
use crate::cutter::{Cutter, CutterParams};
use crate::directions::{DirectionSet, Directions};
use crate::geom::{Mesh, Sites, solids};
use crate::par;
use crate::rng::{Purpose, Stream};
use glam::{DMat3, DQuat, DVec2, DVec3, Vec3, dvec3};
use std::f64::consts::{PI, TAU};

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
    TriangleObstacles::new(mesh, &[]).unwrap().label(sites, cutter, directions, options).unwrap()
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
fn slotted(width: f64, depth: f64) -> Mesh {
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

/// Checks that the fast engine lies between the drop heights for a little less and a little more tolerance.
fn assert_equal_but_for_knife_edges(
    mesh: &Mesh,
    sites: &Sites,
    cutter: &Cutter,
    directions: &Directions,
    tolerance: f64,
) -> usize {
    let obstacles = TriangleObstacles::new(mesh, &[]).unwrap();
    let law = |tolerance: f64| {
        obstacles.label_by_drop_heights(sites, cutter, directions, &exactly(tolerance)).unwrap()
    };
    let fast = obstacles.label(sites, cutter, directions, &exactly(tolerance)).unwrap();
    let (less, more) = (law(tolerance - EPSILON_MM), law(tolerance + EPSILON_MM));
    let mut n_edges = 0;
    for i in 0..sites.len() {
        for (least, found, greatest) in [
            (
                &less.collision_free_directions,
                &fast.collision_free_directions,
                &more.collision_free_directions,
            ),
            (&less.accessible_directions, &fast.accessible_directions, &more.accessible_directions),
        ] {
            assert!(
                (least[i]..=greatest[i]).contains(&found[i]),
                "site {i} {cutter:?}: {} {} {}",
                least[i],
                found[i],
                greatest[i]
            );
            n_edges += usize::from(least[i] < greatest[i]);
        }
    }
    n_edges
}

/// The most by which the tolerance of two engines may seem to differ, mm.
const EPSILON_MM: f64 = 1e-6;

#[test]
fn penetration_of_a_triangle_is_what_its_drop_height_says() {
    let mut stream = Stream::new(1, 0, 0, Purpose::Probe);
    let (mut n_hits, mut n_misses) = (0, 0);
    for trial in 0..60_000 {
        let size = [0.3, 2.0, 10.0, 60.0][trial % 4];
        // Half of the triangles have corners on a grid: vertical, horizontal and flat ones are among them.
        let mut at = || {
            let p = dvec3(
                stream.range(-size, size),
                stream.range(-size, size),
                stream.range(-size, size),
            );
            if trial % 8 < 4 { p } else { (p / (0.5 * size)).round() * (0.5 * size) }
        };
        let corners = [at(), at(), at()];
        let radius = stream.range(0.2, 3.0);
        let tip = match trial % 3 {
            0 => Tip::Round { ring: 0.0, radius },
            1 => Tip::Round { ring: stream.range(0.1, 3.0), radius },
            _ => Tip::Flat { height: stream.range(-1.0, 1.0), radius },
        };
        let drop = drop::tip(&corners, tip);
        let penetrates = penetrate::tip(&corners, tip);
        // Moving the triangle by its distance from the knife edge in height is the same as moving the tool.
        for shift in [0.0, -drop + 1e-7, -drop - 1e-7] {
            let shift = if shift.is_finite() { shift } else { 0.0 };
            let moved = corners.map(|p| p + DVec3::Z * shift);
            let expected = drop + shift > 0.0;
            let knife_edge = drop.is_finite() && (drop + shift).abs() < 0.9e-7;
            if !knife_edge && penetrate::tip(&moved, tip) != expected && !at_rim(&moved, tip) {
                panic!("{trial} {tip:?} {moved:?}: drop height {}", drop + shift);
            }
        }
        n_hits += usize::from(penetrates);
        n_misses += usize::from(!penetrates);
    }
    assert!(n_hits > 5000 && n_misses > 5000, "{n_hits} {n_misses}");
}

/// Whether the answer changes when the tip's radius changes by 1e-9 mm.
fn at_rim(corners: &[DVec3; 3], tip: Tip) -> bool {
    let with = |by: f64| match tip {
        Tip::Round { ring, radius } => Tip::Round { ring, radius: radius + by },
        Tip::Flat { height, radius } => Tip::Flat { height: height - by, radius: radius + by },
    };
    penetrate::tip(corners, with(1e-6)) != penetrate::tip(corners, with(-1e-6))
}

#[test]
fn drop_heights_on_a_plane_and_a_point_are_the_textbook_ones() {
    let plane = [dvec3(-50.0, -50.0, -50.0), dvec3(50.0, -50.0, 50.0), dvec3(0.0, 80.0, 0.0)];
    let root = 2f64.sqrt();
    assert!((drop::disc(&plane, 2.0) - 2.0).abs() < 1e-12, "45 degrees, uphill at the rim");
    let on_plane = |ring, radius| drop::tip(&plane, Tip::Round { ring, radius });
    assert!((on_plane(0.0, 2.0) - 2.0 * root).abs() < 1e-12, "the ball's center");
    assert!((on_plane(3.0, 2.0) - (3.0 + 2.0 * root)).abs() < 1e-12, "the bull nose");
    let point = [dvec3(1.0, 0.0, 5.0); 3];
    let on_point = |ring, radius| drop::tip(&point, Tip::Round { ring, radius });
    assert!((on_point(0.0, 2.0) - (5.0 + 3f64.sqrt())).abs() < 1e-12);
    assert!((on_point(1.0, 2.0) - 7.0).abs() < 1e-12);
    assert_eq!(on_point(0.0, 0.5), f64::NEG_INFINITY);
    let edge = [dvec3(-9.0, 1.0, 0.0), dvec3(9.0, 1.0, 0.0), dvec3(9.0, 1.0, 0.0)];
    assert!((drop::tip(&edge, Tip::Round { ring: 0.0, radius: 2.0 }) - 3f64.sqrt()).abs() < 1e-12);
    assert_eq!(drop::disc(&edge, f64::INFINITY), 0.0);
}

#[test]
fn the_fast_engine_equals_the_drop_heights() {
    let meshes = [
        tube(2.5, 12.0, 15.0, 12),
        slotted(4.0, 8.0),
        solids::torus(12.0, 5.0, 12, 8),
        sphere(10.0, 5),
    ];
    let directions = hemisphere(20);
    let mut n_edges = 0;
    let mut n_sites = 0;
    for mesh in &meshes {
        let n = 150usize.div_ceil(mesh.triangles.len());
        let sites = everywhere(mesh, n);
        for cutter in cutters() {
            n_edges += assert_equal_but_for_knife_edges(mesh, &sites, &cutter, &directions, 0.01);
            n_sites += sites.len();
        }
    }
    assert!(n_edges * 1000 < n_sites, "{n_edges} of {n_sites}");
}

#[test]
fn the_fast_engine_equals_the_drop_heights_whole_sphere_and_odd_tolerances() {
    let mesh = tube(3.0, 9.0, 10.0, 12);
    let sites = everywhere(&mesh, 1);
    let directions = Directions::new(DirectionSet::FibonacciSphere { n_dirs: 20 }).unwrap();
    for tolerance in [1e-4, 0.003, 0.1, 0.4] {
        for cutter in cutters() {
            assert_equal_but_for_knife_edges(&mesh, &sites, &cutter, &directions, tolerance);
        }
    }
}

#[test]
fn answers_do_not_depend_on_samples_threads_or_counting() {
    let mesh = slotted(5.0, 9.0);
    let sites = everywhere(&mesh, 20);
    let cutter = ball([1.5, 6.0, 8.0, 5.0]);
    let directions = hemisphere(30);
    let all = label(&mesh, &sites, &cutter, &directions, &exactly(0.01));
    for n_samples in [0, 10, 50_000] {
        let options = SurfaceOptions { n_samples, ..exactly(0.01) };
        let other = label(&mesh, &sites, &cutter, &directions, &options);
        assert_eq!(SurfaceLabels { stats: all.stats, ..other }, all);
    }
    for n_threads in [1, 3] {
        let one = par::with_threads(n_threads, || {
            label(&mesh, &sites, &cutter, &directions, &exactly(0.01))
        });
        assert_eq!(one.unwrap(), all);
    }
    let options = SurfaceOptions { counts: false, ..exactly(0.01) };
    let quick = label(&mesh, &sites, &cutter, &directions, &options);
    assert_eq!((quick.answers, quick.witness), (all.answers, all.witness));
}

#[test]
fn on_a_sphere_the_collision_free_directions_are_the_analytic_ones() {
    let (radius, n) = (12.0, 60);
    let mesh = sphere(radius, n);
    let chord_error = radius * (1.0 - (PI / f64::from(n)).cos().powi(2)) + 1e-4;
    let cutter = ball([1.5, 4.0, 6.0, 3.0]);
    let directions = Directions::new(DirectionSet::FibonacciSphere { n_dirs: 200 }).unwrap();
    let directions = list(directions.vectors());
    let normals: Vec<Vec3> = Directions::fibonacci_hemisphere(30).unwrap().vectors().to_vec();
    let points = normals.iter().map(|n| (n.as_dvec3() * radius).as_vec3()).collect();
    let sites = Sites { points, normals, faces: vec![] };
    let labels = label(&mesh, &sites, &cutter, &directions, &exactly(0.01));
    for (i, normal) in sites.normals.iter().enumerate() {
        // The steps are cylinders without an upper end; a convex body is hit iff its center is near enough.
        let free = |radius: f64| {
            let directions = directions.vectors().iter().filter(|d| {
                let cos = f64::from(normal.dot(**d));
                let along = -(12.0 + 1.5) * cos;
                let aside = (12.0 + 1.5) * (1.0 - cos * cos).max(0.0).sqrt();
                cutter.steps().iter().all(|step| {
                    let below = (step.height_mm + 0.01 - along).max(0.0);
                    let beyond = (aside - (step.radius_mm - 0.01)).max(0.0);
                    below.hypot(beyond) >= radius
                })
            });
            directions.count() as u32
        };
        let found = labels.collision_free_directions[i];
        assert!(
            (free(radius + 1e-4)..=free(radius - chord_error)).contains(&found),
            "{i}: {found}"
        );
        assert_eq!(labels.accessible_directions[i], found, "a ball fits on a sphere");
    }
}

#[test]
fn on_the_top_of_a_wide_box_tilt_is_limited_by_the_plane() {
    let mut mesh = solids::cuboid(dvec3(400.0, 400.0, 50.0));
    mesh.vertices.iter_mut().for_each(|p| *p -= dvec3(200.0, 200.0, 50.0));
    let cutter = Cutter::stepped(1.5, &[(5.0, 1.5), (8.0, 6.0), (9.0, 12.0)], false).unwrap();
    let sites = Sites { points: vec![Vec3::ZERO], normals: vec![Vec3::Z], faces: vec![] };
    for degrees in 0..90 {
        let tilt = f64::from(degrees).to_radians();
        let direction = dvec3(tilt.sin(), 0.0, tilt.cos());
        let clear = cutter.steps().iter().all(|step| {
            1.5 + (step.height_mm + 0.01) * tilt.cos() - (step.radius_mm - 0.01) * tilt.sin() >= 0.0
        });
        let labels = label(&mesh, &sites, &cutter, &list(&[direction.as_vec3()]), &exactly(0.01));
        assert_eq!(labels.answers[0] == SiteAnswer::Accessible, clear, "{degrees}");
    }
}

#[test]
fn outside_a_cylinder_and_on_all_walls_of_a_box_the_tool_stands_beside_the_wall() {
    let cutter = ball([1.5, 30.0, 10.0, 5.0]);
    let flat = bull([1.5, 30.0, 10.0, 5.0], 0.0);
    for mesh in [tube(2.5, 12.0, 15.0, 100), solids::cuboid(dvec3(30.0, 20.0, 10.0))] {
        let walls =
            sites_on(&mesh, 3, |p, n| n.z.abs() < 0.1 && n.dot(p - dvec3(0.0, 0.0, p.z)) > 0.0);
        for cutter in [&cutter, &flat] {
            let found = answers(&mesh, &walls, cutter, &up(), &exactly(0.01));
            assert_eq!(n_of(SiteAnswer::Accessible, &found), walls.len());
        }
    }
}

#[test]
fn a_bore_that_the_tool_fits_is_accessible_all_around_for_any_chord_error() {
    for (radius, cr) in [(2.5, 1.0), (2.5, 2.0), (10.0, 2.0), (1.5, 1.0), (4.0, 1.5)] {
        let cutter = ball([cr, 30.0, 20.0, 5.0]);
        for chord_error in [0.001, 0.003, 0.01, 0.02, 0.05, 0.1] {
            let n = facets(radius, chord_error);
            if n < 10 {
                continue;
            }
            let mesh = tube(radius, radius + 8.0, 15.0, n);
            let inside = |p: DVec3, n: DVec3| n.z.abs() < 0.1 && n.dot(dvec3(p.x, p.y, 0.0)) < 0.0;
            let bore = sites_on(&mesh, 6, inside);
            for directions in [up(), hemisphere(60)] {
                let labels = label(&mesh, &bore, &cutter, &directions, &implied());
                let n_accessible = n_of(SiteAnswer::Accessible, &labels.answers);
                let greatest = labels.tolerance_mm.iter().fold(0.0, |a: f64, b| a.max(*b));
                assert_eq!(
                    n_accessible,
                    bore.len(),
                    "bore {radius}, CR {cr}, {n} facets, {greatest}"
                );
            }
        }
    }
}

#[test]
fn a_tool_wider_than_its_bore_is_not_let_in_by_the_tolerance() {
    for chord_error in [0.001, 0.01, 0.05] {
        let mesh = tube(2.5, 10.0, 15.0, facets(2.5, chord_error));
        let inside = |p: DVec3, n: DVec3| n.z.abs() < 0.1 && n.dot(dvec3(p.x, p.y, 0.0)) < 0.0;
        let bore = sites_on(&mesh, 3, inside);
        let found = answers(&mesh, &bore, &ball([2.6, 30.0, 20.0, 5.0]), &up(), &implied());
        assert_eq!(n_of(SiteAnswer::Accessible, &found), 0, "{chord_error}");
    }
}

#[test]
fn a_plain_through_hole_is_accessible_from_above() {
    let mesh = tube(2.5, 15.0, 10.0, 64);
    let sites = sites_on(&mesh, 10, |_, n| n.z > -0.5);
    let found = answers(&mesh, &sites, &ball([1.0, 20.0, 10.0, 5.0]), &up(), &implied());
    assert_eq!(n_of(SiteAnswer::Accessible, &found), sites.len());
}

#[test]
fn in_a_slot_a_tenth_too_narrow_the_tip_does_not_fit() {
    for (width, expected) in [(3.1, SiteAnswer::Accessible), (2.9, SiteAnswer::TipDoesNotFit)] {
        let mesh = slotted(width, 2.8);
        let floor = sites_on(&mesh, 40, |p, n| n.z > 0.5 && p.z < 19.0);
        let middle = |sites: &Sites| {
            (0..sites.len()).filter(|&i| sites.points[i].x.abs() < 0.01).collect::<Vec<_>>()
        };
        let cutters = [
            ball([1.5, 30.0, 10.0, 5.0]),
            bull([1.5, 30.0, 10.0, 5.0], 0.5),
            bull([1.5, 30.0, 10.0, 5.0], 0.0),
        ];
        for cutter in cutters {
            let mut sites = floor.clone();
            sites.points.iter_mut().for_each(|p| p.x = 0.0);
            assert!(!middle(&sites).is_empty());
            // A bull nose stands over the site when it looks along the normal.
            let found = answers(&mesh, &sites, &cutter, &up(), &exactly(0.01));
            assert_eq!(n_of(expected, &found), sites.len(), "{width} {cutter:?}");
        }
    }
}

#[test]
fn a_wide_ball_does_not_fit_between_the_walls_of_a_narrow_slot() {
    let mesh = slotted(3.0, 5.0);
    let walls = sites_on(&mesh, 30, |p, n| n.x.abs() > 0.9 && p.x.abs() < 2.0);
    let found = answers(&mesh, &walls, &ball([6.0, 30.0, 10.0, 5.0]), &up(), &implied());
    assert_eq!(n_of(SiteAnswer::TipDoesNotFit, &found), walls.len());
    let found = answers(&mesh, &walls, &ball([6.0, 30.0, 10.0, 5.0]), &hemisphere(150), &implied());
    assert_eq!(n_of(SiteAnswer::Accessible, &found), 0);
    let found = answers(&mesh, &walls, &ball([1.0, 30.0, 10.0, 5.0]), &up(), &implied());
    assert!(n_of(SiteAnswer::Accessible, &found) * 10 > 7 * walls.len());
}

#[test]
fn a_greater_tolerance_never_makes_a_site_less_accessible() {
    let mesh = solids::torus(9.0, 4.0, 30, 16);
    let sites = everywhere(&mesh, 1);
    let directions = hemisphere(60);
    for cutter in cutters() {
        let mut before = vec![[0, 0]; sites.len()];
        for tolerance in [1e-5, 1e-3, 0.004, 0.01, 0.05, 0.2, 0.9] {
            let labels = label(&mesh, &sites, &cutter, &directions, &exactly(tolerance));
            let counts = labels.collision_free_directions.iter().zip(&labels.accessible_directions);
            for (before, (&free, &accessible)) in before.iter_mut().zip(counts) {
                assert!(free >= before[0] && accessible >= before[1], "{tolerance} {cutter:?}");
                *before = [free, accessible];
            }
        }
    }
}

#[test]
fn more_triangles_by_subdivision_change_nothing() {
    let coarse = tube(3.0, 9.0, 12.0, 16);
    let fine = subdivided(&subdivided(&coarse));
    let sites = everywhere(&coarse, 3);
    let directions = hemisphere(40);
    for cutter in cutters() {
        let [a, b] =
            [&coarse, &fine].map(|mesh| label(mesh, &sites, &cutter, &directions, &exactly(0.01)));
        assert_eq!(a.answers, b.answers);
        assert_eq!(a.collision_free_directions, b.collision_free_directions);
        assert_eq!(a.accessible_directions, b.accessible_directions);
    }
}

#[test]
fn moved_turned_and_mirrored_parts_have_the_same_answers() {
    let mesh = slotted(4.0, 8.0);
    let sites = everywhere(&mesh, 8);
    let directions = list(hemisphere(40).vectors());
    let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -1.1, 2.0));
    let mirror = DMat3::from_diagonal(dvec3(-1.0, 1.0, 1.0));
    for (map, shift) in [
        (DMat3::IDENTITY, dvec3(17.3, -250.0, 31.0)),
        (turn, DVec3::ZERO),
        (mirror, DVec3::ZERO),
        (turn * mirror, dvec3(5.0, 6.0, 70.0)),
    ] {
        let mut moved = mesh.clone();
        moved.vertices.iter_mut().for_each(|p| *p = map * *p + shift);
        if map.determinant() < 0.0 {
            moved.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        }
        let moved_sites = Sites {
            points: sites.points.iter().map(|p| (map * p.as_dvec3() + shift).as_vec3()).collect(),
            normals: sites
                .normals
                .iter()
                .map(|n| (map * n.as_dvec3()).as_vec3().normalize())
                .collect(),
            faces: sites.faces.clone(),
        };
        let turned: Vec<Vec3> =
            directions.vectors().iter().map(|d| (map * d.as_dvec3()).as_vec3()).collect();
        // Sites and directions are rounded to f32: 3e-5 mm at 300 mm.
        for cutter in &cutters()[..3] {
            let at = |tolerance| label(&mesh, &sites, cutter, &directions, &exactly(tolerance));
            let [less, more] = [at(0.01 - 1e-4), at(0.01 + 1e-4)];
            let found = label(&moved, &moved_sites, cutter, &list(&turned), &exactly(0.01));
            for i in 0..sites.len() {
                let range = less.accessible_directions[i]..=more.accessible_directions[i];
                assert!(range.contains(&found.accessible_directions[i]), "{i}");
            }
        }
    }
}

#[test]
fn a_fixture_blocks_and_is_not_asked_about() {
    let part = solids::cuboid(dvec3(20.0, 20.0, 10.0));
    let mut clamp = solids::cuboid(dvec3(10.0, 20.0, 5.0));
    clamp.vertices.iter_mut().for_each(|p| *p += dvec3(0.0, 0.0, 10.5));
    let top = sites_on(&part, 60, |_, n| n.z > 0.5);
    let cutter = ball([1.0, 20.0, 1.0, 20.0]);
    let with = TriangleObstacles::new(&part, &[clamp]).unwrap();
    let labels = with.label(&top, &cutter, &up(), &exactly(0.01)).unwrap();
    for (i, p) in top.points.iter().enumerate() {
        let expected = if p.x < 10.99 { SiteAnswer::Inaccessible } else { SiteAnswer::Accessible };
        if (p.x - 10.99).abs() > 0.01 && !(10.5..11.0).contains(&p.x) {
            assert_eq!(
                labels.answers[i] == SiteAnswer::Accessible,
                expected == SiteAnswer::Accessible,
                "{p}"
            );
        }
    }
    assert_eq!(with.n_triangles(), 24);
}

#[test]
fn in_space_the_tip_is_at_the_point() {
    let part = solids::cuboid(dvec3(20.0, 20.0, 10.0));
    let obstacles = TriangleObstacles::new(&part, &[]).unwrap();
    let cutter = ball([1.0, 20.0, 5.0, 20.0]);
    let points = [
        Vec3::new(10.0, 10.0, 10.5),
        Vec3::new(10.0, 10.0, 9.5),
        Vec3::new(10.0, 10.0, 2.0),
        Vec3::new(22.0, 10.0, 1.0),
    ];
    let queries = crate::access::Queries::Volume(&points);
    let labels = obstacles.label(queries, &cutter, &up(), &exactly(0.01)).unwrap();
    assert_eq!(
        labels.answers,
        [
            SiteAnswer::Accessible,
            SiteAnswer::TipDoesNotFit,
            SiteAnswer::Inaccessible,
            SiteAnswer::Accessible
        ]
    );
}

#[test]
fn unusable_questions_are_named() {
    let mut mesh = solids::cuboid(DVec3::splat(10.0));
    let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
    let sites = everywhere(&mesh, 1);
    let cutter = ball([1.0, 20.0, 5.0, 20.0]);
    for tolerance in [0.0, -1.0, 1.0, f64::NAN] {
        assert!(
            obstacles.label(&sites, &cutter, &up(), &exactly(tolerance)).is_err(),
            "{tolerance}"
        );
    }
    let bare = Sites { normals: vec![], ..sites.clone() };
    let message = obstacles.label(&bare, &cutter, &up(), &exactly(0.01)).unwrap_err().to_string();
    assert!(message.contains("0 normals for 12 sites"), "{message}");
    let zero = raise(&mesh, &cutter, 0.01, DVec3::ZERO, Vec3::ZERO);
    assert!(zero.is_err());
    mesh.vertices[3].x = f64::NAN;
    let message = TriangleObstacles::new(&mesh, &[]).unwrap_err().to_string();
    assert!(message.starts_with("vertex 3"), "{message}");
    assert!(
        TriangleObstacles::new(&Mesh::default(), &[])
            .unwrap()
            .label(&sites, &cutter, &up(), &exactly(0.01))
            .is_ok()
    );
}

#[test]
fn what_lies_between_the_directions_is_found_and_what_is_closed_is_proven() {
    // A deep bore, tilted against every direction of the set, and its blind end.
    let mut mesh = tube(2.5, 10.0, 30.0, 48);
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.35, 0.21, 0.0);
    mesh.vertices.iter_mut().for_each(|p| *p = turn * *p);
    let axis = turn * DVec3::Z;
    let inside =
        |p: DVec3, n: DVec3| n.dot(axis).abs() < 0.1 && n.dot(p - axis * p.dot(axis)) < 0.0;
    let sites = sites_on(&mesh, 2, inside);
    let cutter = ball([1.0, 60.0, 5.0, 20.0]);
    let coarse = Directions::fibonacci_hemisphere(75).unwrap();
    let none = label(&mesh, &sites, &cutter, &coarse, &implied());
    assert!(
        none.open_directions
            .iter()
            .zip(&none.answers)
            .all(|(open, a)| (*open == 1.0) == (*a != SiteAnswer::Accessible))
    );
    let refined =
        SurfaceOptions { refinement: Some(super::RefinementOptions::proving()), ..implied() };
    let found = label(&mesh, &sites, &cutter, &coarse, &refined);
    assert!(n_of(SiteAnswer::Accessible, &none.answers) * 2 < sites.len());
    assert_eq!(n_of(SiteAnswer::Accessible, &found.answers), sites.len());
    let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
    for i in 0..sites.len() {
        let one =
            Sites { points: vec![sites.points[i]], normals: vec![sites.normals[i]], faces: vec![] };
        let tolerance = exactly(found.tolerance_mm[i] + EPSILON_MM);
        let law = obstacles.label_by_drop_heights(
            &one,
            &cutter,
            &list(&[found.witness[i].unwrap()]),
            &tolerance,
        );
        assert_eq!(law.unwrap().answers, [SiteAnswer::Accessible], "{i}");
    }
}

#[test]
fn a_site_proven_inaccessible_is_so_in_any_direction() {
    let mesh = slotted(4.0, 15.0);
    let sites = everywhere(&mesh, 6);
    let directions = Directions::fibonacci_hemisphere(150).unwrap();
    let many = Directions::fibonacci_hemisphere(4000).unwrap();
    let options = super::RefinementOptions::proving();
    let refined = SurfaceOptions { refinement: Some(options), ..exactly(0.01) };
    for cutter in [
        ball([1.0, 20.0, 5.0, 20.0]),
        ball([1.5, 3.0, 20.0, 5.0]),
        bull([1.5, 3.0, 20.0, 5.0], 0.5),
    ] {
        let found = label(&mesh, &sites, &cutter, &directions, &refined);
        let uniform = label(&mesh, &sites, &cutter, &many, &exactly(0.01));
        let mut n_proven = 0;
        for i in 0..sites.len() {
            if uniform.answers[i] == SiteAnswer::Accessible {
                assert_eq!(
                    found.answers[i],
                    SiteAnswer::Accessible,
                    "{i} {} {} {:?} {cutter:?}",
                    found.open_directions[i],
                    sites.points[i],
                    uniform.witness[i]
                );
            }
            if found.answers[i] == SiteAnswer::Inaccessible && found.open_directions[i] == 0.0 {
                n_proven += 1;
                assert_eq!(uniform.collision_free_directions[i], 0, "{i} {cutter:?}");
            }
        }
        let n_inaccessible = n_of(SiteAnswer::Inaccessible, &found.answers);
        assert!(n_proven * 2 > n_inaccessible, "{n_proven} of {n_inaccessible} {cutter:?}");
    }
}

#[test]
fn clearance_is_how_far_the_steps_may_grow() {
    // Between two walls 10 mm apart, a tool of radius 1.5 that touches one.
    let mesh = slotted(10.0, 15.0);
    let mut walls = sites_on(&mesh, 5, |p, n| n.x.abs() > 0.9 && p.x.abs() < 6.0);
    // Above the floor by more than the ball needs, and with wall beside the shank.
    walls.points.iter_mut().for_each(|p| p.z = p.z.clamp(6.6, 17.0));
    let cutter = ball([1.5, 40.0, 20.0, 5.0]);
    let options = SurfaceOptions { clearance_limit_mm: Some(3.0), ..exactly(0.01) };
    let labels = label(&mesh, &walls, &cutter, &up(), &options);
    for (clearance, answer) in labels.clearance_mm.iter().zip(&labels.answers) {
        // The wall touched is the tolerance away from the shrunk tool.
        assert_eq!(*answer, SiteAnswer::Accessible);
        assert!((clearance - 0.01).abs() < 2e-4, "{clearance}");
    }
    let floor = sites_on(&mesh, 20, |p, n| n.z > 0.5 && p.z < 19.0);
    let labels = label(&mesh, &floor, &cutter, &up(), &options);
    for (i, p) in floor.points.iter().enumerate() {
        let expected = (5.0 - p.x.abs() - 1.49).min(3.0);
        let found = labels.clearance_mm[i];
        assert!((found - expected).abs() < 2e-4, "{p} {found} {expected}");
        assert_eq!(found < 0.0, labels.answers[i] == SiteAnswer::Inaccessible);
    }
    // As the labels of grown tools say.
    let torus = solids::torus(9.0, 4.0, 30, 16);
    let sites = everywhere(&torus, 1);
    let directions = hemisphere(20);
    let cutter = ball([1.0, 6.0, 4.0, 3.0]);
    let labels = label(&torus, &sites, &cutter, &directions, &options);
    for growth in [-0.5, -0.1, 0.005, 0.2, 1.0] {
        let grown = cutter.with_clearance(growth).unwrap();
        let found = label(&torus, &sites, &grown, &directions, &exactly(0.01));
        for i in 0..sites.len() {
            let clearance = f64::from(labels.clearance_mm[i]);
            if (clearance - growth).abs() > 2e-4 {
                let inaccessible = found.answers[i] == SiteAnswer::Inaccessible;
                assert_eq!(inaccessible, clearance < growth, "{i} {clearance} {growth}");
            }
        }
    }
    let bad = SurfaceOptions { clearance_limit_mm: Some(0.0), ..exactly(0.01) };
    assert!(
        TriangleObstacles::new(&mesh, &[]).unwrap().label(&floor, &cutter, &up(), &bad).is_err()
    );
}

#[test]
fn the_search_in_space_proves_nothing_that_is_open() {
    let mesh = slotted(4.0, 12.0);
    let points: Vec<Vec3> = (0..60)
        .map(|k| {
            let k = k as f32;
            Vec3::new(-6.0 + 0.2 * k, 0.1 * k - 3.0, 3.0 + 0.35 * k)
        })
        .collect();
    let queries = crate::access::Queries::Volume(&points);
    let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
    let refined =
        SurfaceOptions { refinement: Some(super::RefinementOptions::proving()), ..exactly(0.01) };
    for cutter in [ball([1.0, 10.0, 5.0, 10.0]), bull([1.5, 6.0, 10.0, 5.0], 0.5)] {
        let found = obstacles.label(queries, &cutter, &hemisphere(60), &refined).unwrap();
        let uniform = obstacles.label(queries, &cutter, &hemisphere(3000), &exactly(0.01)).unwrap();
        for (i, point) in points.iter().enumerate() {
            let (one, many) = (found.answers[i], uniform.answers[i]);
            assert!(many != SiteAnswer::Accessible || one == many, "{point} {one:?}");
            let proven = one == SiteAnswer::Inaccessible && found.open_directions[i] == 0.0;
            assert!(!proven || uniform.collision_free_directions[i] == 0, "{point}");
        }
    }
}

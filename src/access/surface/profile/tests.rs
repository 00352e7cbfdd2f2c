use super::body::Body;
use super::meet::penetrates;
use super::outline::Outline;
use super::reference;
use crate::access::surface::labels::SurfaceLabels;
use crate::access::surface::{SurfaceOptions, TriangleObstacles, raise};
use crate::access::{self, Obstacles, Queries};
use crate::answers::SiteAnswer;
use crate::exec::par;
use crate::geom::{Mesh, Sites, solids};
use crate::numeric::rng::{Purpose, Stream};
use crate::tool::cutter::{Assembly, Profile, Section};
use crate::tool::directions::{DirectionSet, Directions};
use glam::{DVec2, DVec3, Vec3, dvec2, dvec3};
use std::f64::consts::TAU;

mod allowance;
mod drilling;
mod explain;
mod search;
mod space;

fn families() -> Vec<Profile> {
    let deg = f64::to_radians;
    [
        Profile::lollipop(3.0, 1.5),
        Profile::lollipop(2.0, 0.6),
        Profile::lollipop(5.0, 4.0),
        Profile::t_slot(10.5, 9.0, 0.0, 5.0),
        Profile::t_slot(6.0, 2.0, 0.4, 2.0),
        Profile::dovetail(8.0, deg(30.0), 6.0, 3.0),
        Profile::barrel(5.0, 85.0, 1.0, 20.0),
        Profile::barrel(4.0, 20.0, 2.0, 9.0),
        Profile::lens(6.0, 30.0, 1.0, 8.0),
        Profile::chamfer(0.5, deg(45.0), 5.0),
        Profile::chamfer(0.0, deg(59.0), 4.0),
        // A hollow flank: a corner rounding cutter.
        "2:0 6:4@6:0 | 6:12".parse(),
        // Ball, relieved neck, shank.
        "0:0 3:3@0:3 3:6 | 2.6:6 2.6:20 4:24 4:40".parse(),
    ]
    .map(Result::unwrap)
    .to_vec()
}

fn random_triangle(stream: &mut Stream, size: f64) -> [DVec3; 3] {
    let mut at = |low: f64, high: f64| stream.range(low, high);
    let middle = dvec3(at(-12.0, 12.0), at(-12.0, 12.0), at(-3.0, 15.0));
    [0; 3].map(|_| middle + size * dvec3(at(-1.0, 1.0), at(-1.0, 1.0), at(-1.0, 1.0)))
}

#[test]
fn a_triangle_is_penetrated_iff_some_point_of_it_is_deeper_than_the_tolerance() {
    let mut stream = Stream::new(5, 0, 0, Purpose::Probe);
    let (mut n_in, mut n_out, mut n_edge) = (0, 0, 0);
    for profile in families() {
        let outline = Outline::new(&profile);
        for tolerance in [0.01, 0.05, 0.2, 0.6] {
            let body = Body::new(&profile, tolerance);
            for size in [0.05, 0.7, 4.0, 30.0] {
                for _ in 0..60 {
                    let corners = random_triangle(&mut stream, size);
                    let found = penetrates(&body, &corners, DVec2::ZERO).is_some();
                    let expected = reference::penetrates(&outline, &corners, tolerance, 1e-4);
                    // Hollow arcs are chords: see `CHORD_MM`.
                    let [more, less] = [3e-4, -3e-4]
                        .map(|by| reference::penetrates(&outline, &corners, tolerance + by, 1e-4));
                    match expected {
                        Some(expected) if more == less => {
                            assert_eq!(found, expected, "{profile} {tolerance} {corners:?}");
                            if expected { n_in += 1 } else { n_out += 1 }
                        }
                        _ => n_edge += 1,
                    }
                }
            }
        }
    }
    assert!(n_in > 1000 && n_out > 1000 && n_edge < 300, "{n_in} {n_out} {n_edge}");
}

#[test]
fn a_tolerance_beyond_the_radius_of_an_arc_hides_nothing_that_is_deeper() {
    let mut stream = Stream::new(8, 0, 0, Purpose::Probe);
    let mut n_in = 0;
    for profile in families() {
        let outline = Outline::new(&profile);
        // No tolerance is more than half of the radius.
        for share in [0.2, 0.35, 0.5] {
            let tolerance = share * profile.cutting_radius_mm();
            let body = Body::new(&profile, tolerance);
            for size in [0.05, 0.7, 4.0] {
                for _ in 0..200 {
                    let corners = random_triangle(&mut stream, size);
                    if reference::penetrates(&outline, &corners, tolerance + 1e-3, 1e-4)
                        == Some(true)
                    {
                        let found = penetrates(&body, &corners, DVec2::ZERO).is_some();
                        assert!(found, "{profile} {tolerance} {corners:?}");
                        n_in += 1;
                    }
                }
            }
        }
    }
    assert!(n_in > 1000, "{n_in}");
}

#[test]
fn a_moved_tool_penetrates_iff_it_does_in_some_place_on_the_way() {
    let mut stream = Stream::new(6, 0, 0, Purpose::Probe);
    let (mut n_in, mut n_out) = (0, 0);
    for profile in families() {
        let body = Body::new(&profile, 0.01);
        for size in [0.3, 4.0, 30.0] {
            for _ in 0..60 {
                let corners = random_triangle(&mut stream, size);
                let core = dvec2(stream.range(-9.0, 9.0), stream.range(-9.0, 9.0));
                let swept = penetrates(&body, &corners, core).is_some();
                let n = 200;
                let any = (0..=n).any(|k| {
                    let by = core * (f64::from(k) / f64::from(n));
                    let moved = corners.map(|p| p - by.extend(0.0));
                    penetrates(&body, &moved, DVec2::ZERO).is_some()
                });
                assert!(swept || !any, "{profile} {core} {corners:?}");
                if swept && !any {
                    // Between two of the places.
                    let wider = Body::new(&profile, 0.01 + 0.05);
                    assert!(penetrates(&wider, &corners, core).is_none(), "{profile} {corners:?}");
                    continue;
                }
                if swept { n_in += 1 } else { n_out += 1 }
            }
        }
    }
    assert!(n_in > 300 && n_out > 300, "{n_in} {n_out}");
}

#[test]
fn the_retracting_tool_holds_the_tool_at_every_height_above() {
    for profile in families() {
        let body = Body::new(&profile, 0.01);
        let retracting = body.retracting();
        let radius = Body::radius_at;
        let mut widest = 0f64;
        for k in 0..4000 {
            let z = f64::from(k) * 0.01;
            widest = widest.max(radius(&body, z));
            let found = radius(&retracting, z);
            assert!((found - widest).abs() < 0.02, "{profile} {z}: {found} {widest}");
            assert!(found >= radius(&body, z) - 1e-9);
        }
    }
}

/// Walls of a profile in x and z, drawn along y; open at both ends.
fn drawn_along_y(outline: &[[f64; 2]], length: f64) -> Mesh {
    let outline: Vec<DVec2> = outline.iter().map(|p| DVec2::from_array(*p)).collect();
    let mut mesh = solids::prism(&outline, &[], length);
    mesh.vertices.iter_mut().for_each(|p| *p = dvec3(p.x, -p.z, p.y));
    mesh
}

/// Points of the faces with their normals, `n` along each edge, of those that are wanted.
fn sites_on(mesh: &Mesh, n: u32, wanted: impl Fn(DVec3, DVec3) -> bool) -> Sites {
    let mut sites = Sites::default();
    for f in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(f);
        let normal = (b - a).cross(c - a).normalize();
        for i in 0..n {
            for j in 0..n - i {
                let [u, v] = [i, j].map(|k| (f64::from(k) + 0.31) / f64::from(n));
                if u + v >= 1.0 {
                    continue;
                }
                let p = a + (b - a) * u + (c - a) * v;
                if wanted(p, normal) {
                    sites.points.push(p.as_vec3());
                    sites.normals.push(normal.as_vec3());
                }
            }
        }
    }
    sites
}

fn label(mesh: &Mesh, sites: &Sites, profile: Profile, stick_out: f64) -> SurfaceLabels {
    let holder = [Section::cylinder(30.0, 20.0)];
    let tool = Assembly::from_profile(profile, &holder, stick_out).unwrap();
    let obstacles = TriangleObstacles::new(mesh, &[]).unwrap();
    let up = Directions::up();
    obstacles
        .surface_labels(sites, &tool.cutter().unwrap(), &up, &SurfaceOptions::default())
        .unwrap()
}

fn share(labels: &SurfaceLabels) -> f64 {
    labels.share(SiteAnswer::Accessible)
}

/// A T-slot along y: 11 mm wide at its mouth, 21.2 below the lips, 9 mm high there.
fn t_slot() -> Mesh {
    let half = [[30.0, 0.0], [30.0, 40.0], [5.5, 40.0], [5.5, 28.0], [10.6, 28.0], [10.6, 19.0]];
    let other = half.iter().rev().map(|[x, z]| [-x, *z]);
    let outline: Vec<[f64; 2]> = half.iter().copied().chain(other).collect();
    drawn_along_y(&outline, 40.0)
}

/// The same between two walls: a cutter fits, but comes in neither from above nor from an end.
fn closed_t_slot() -> Mesh {
    let mut mesh = t_slot();
    for y in [-40.0, 0.0] {
        let first = mesh.vertices.len() as u32;
        for (x, z) in [(-30.0, 0.0), (30.0, 0.0), (30.0, 45.0), (-30.0, 45.0)] {
            mesh.vertices.push(dvec3(x, y, z));
        }
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    }
    mesh
}

fn undercut(p: DVec3, n: DVec3) -> bool {
    // Farther from the ends than a cutter outside reaches in.
    (-33.0..-7.0).contains(&p.y)
        && p.x.abs() < 10.7
        && (18.9..28.1).contains(&p.z)
        && (n.x.abs() > 0.9 || n.z < -0.9)
}

#[test]
fn a_t_slot_is_reached_by_its_cutter_and_by_no_other() {
    let mesh = t_slot();
    let sites = sites_on(&mesh, 12, undercut);
    assert!(sites.len() > 200);
    let of = |profile: Profile| label(&mesh, &sites, profile, 60.0);
    let right = of(Profile::t_slot(10.5, 8.9, 0.0, 5.0).unwrap());
    assert_eq!(share(&right), 1.0);
    assert!(right.evidence.retreat_unproven.iter().all(|unproven| !unproven));
    // Of the slot's own height: one height will do.
    assert_eq!(share(&of(Profile::t_slot(10.5, 9.0, 0.0, 5.0).unwrap())), 1.0);
    assert_eq!(share(&of(Profile::t_slot(10.5, 9.2, 0.0, 5.0).unwrap())), 0.0);
    // Its neck does not fit between the lips.
    assert_eq!(share(&of(Profile::t_slot(10.5, 8.9, 0.0, 5.6).unwrap())), 0.0);
    // An end mill.
    assert_eq!(share(&of("5:0 5:30 | 5:60".parse().unwrap())), 0.0);
}

#[test]
fn a_t_slot_that_is_closed_at_both_ends_cannot_be_left() {
    let mesh = closed_t_slot();
    let middle = |p: DVec3, n: DVec3| undercut(p, n) && (-27.0..-13.0).contains(&p.y);
    let sites = sites_on(&mesh, 16, middle);
    let labels = label(&mesh, &sites, Profile::t_slot(10.5, 8.9, 0.0, 5.0).unwrap(), 60.0);
    assert_eq!(share(&labels), 0.0);
    assert!(labels.evidence.retreat_unproven.iter().all(|unproven| *unproven));
}

#[test]
fn a_dovetail_way_is_reached_by_the_cutter_of_its_angle() {
    let angle = 30f64.to_radians();
    let lower = 14.0;
    let upper = lower - 8.0 * angle.tan();
    let half = [[30.0, 0.0], [30.0, 18.0], [upper, 18.0], [lower, 10.0]];
    let other = half.iter().rev().map(|[x, z]| [-x, *z]);
    let outline: Vec<[f64; 2]> = half.iter().copied().chain(other).collect();
    let mesh = drawn_along_y(&outline, 40.0);
    let flank = |p: DVec3, n: DVec3| n.z < -0.3 && p.z > 9.0;
    let sites = sites_on(&mesh, 12, flank);
    let reached = |degrees: f64| {
        let profile = Profile::dovetail(8.0, degrees.to_radians(), 9.0, 2.0).unwrap();
        share(&label(&mesh, &sites, profile, 50.0))
    };
    assert_eq!(reached(30.0), 1.0);
    // A flank that leans more touches with its lower edge alone, one that leans less with its upper one.
    let [steep, flat] = [reached(29.5), reached(30.5)];
    assert!(steep < 1.0 || flat < 1.0, "{steep} {flat}");
    let end_mill = label(&mesh, &sites, "4:0 4:20 | 4:60".parse().unwrap(), 50.0);
    assert_eq!(share(&end_mill), 0.0);
}

/// A surface of revolution from radii and heights.
fn revolved(outline: &[[f64; 2]], n: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for k in 0..n {
        let angle = TAU * f64::from(k) / f64::from(n);
        for [r, z] in outline {
            mesh.vertices.push(dvec3(r * angle.cos(), r * angle.sin(), *z));
        }
    }
    let rows = outline.len() as u32;
    for k in 0..n {
        let (a, b) = (k * rows, (k + 1) % n * rows);
        for row in 0..rows {
            let next = (row + 1) % rows;
            mesh.triangles.push([a + row, b + row, b + next]);
            mesh.triangles.push([a + row, b + next, a + next]);
        }
    }
    mesh
}

#[test]
fn a_groove_in_a_bore_is_left_through_the_bore_or_not_at_all() {
    // A bore of radius 4 with a groove of radius 5.5 from height 10 to 20.
    let section = [
        [4.0, 0.0],
        [12.0, 0.0],
        [12.0, 30.0],
        [4.0, 30.0],
        [4.0, 20.0],
        [5.5, 20.0],
        [5.5, 10.0],
        [4.0, 10.0],
    ];
    let mesh = revolved(&section, 180);
    let wall = |p: DVec3, _: DVec3| {
        (p.truncate().length() - 5.5).abs() < 0.01 && (13.4..16.6).contains(&p.z)
    };
    let sites = sites_on(&mesh, 2, wall);
    assert!(sites.len() > 50, "{}", sites.len());
    let of = |radius: f64| label(&mesh, &sites, Profile::lollipop(radius, 2.0).unwrap(), 40.0);
    let narrow = of(3.9);
    let unproven = narrow.evidence.retreat_unproven.iter().filter(|unproven| **unproven).count();
    assert_eq!((share(&narrow), unproven), (1.0, 0));
    let wide = of(4.1);
    assert_eq!(share(&wide), 0.0);
    assert!(wide.evidence.retreat_unproven.iter().all(|unproven| *unproven));
    // As a ball end it has no room beside the bore.
    let ball: Profile = "0:0 3.9:3.9@0:3.9 3.9:10 | 3.9:60".parse().unwrap();
    let blocked = label(&mesh, &sites, ball, 40.0);
    assert_eq!(share(&blocked), 0.0);
    assert!(blocked.evidence.retreat_unproven.iter().all(|unproven| !unproven));
}

#[test]
fn a_barrel_fits_a_hollow_wall_iff_its_arc_is_below_the_walls() {
    let wall = |radius: f64, sign: f64| {
        let n = 64;
        let at = |k: i32| {
            let z = 16.0 * f64::from(k) / f64::from(n) - 8.0;
            let sag = radius - (radius * radius - z * z).sqrt();
            [-sign * sag, z]
        };
        // Seen from above the wall is on the right: material beyond it.
        let mut outline: Vec<[f64; 2]> = (0..=n).rev().map(at).collect();
        outline.extend([[20.0, -8.0], [20.0, 8.0]]);
        drawn_along_y(&outline, 30.0)
    };
    let reached = |radius: f64, sign: f64| {
        let mesh = wall(radius, sign);
        let on = |p: DVec3, n: DVec3| n.x < -0.5 && p.z.abs() < 4.0;
        let sites = sites_on(&mesh, 2, on);
        assert!(sites.len() > 20);
        share(&label(&mesh, &sites, Profile::barrel(5.0, 85.0, 1.0, 24.0).unwrap(), 60.0))
    };
    assert_eq!(reached(95.0, 1.0), 1.0);
    assert_eq!(reached(60.0, 1.0), 0.0);
    assert_eq!(reached(60.0, -1.0), 1.0);
}

#[test]
fn a_profile_that_only_widens_has_the_answers_of_its_cutter() {
    // A pocket with a boss.
    let section = [[3.0, 0.0], [20.0, 0.0], [20.0, 12.0], [9.0, 12.0], [9.0, 4.0], [3.0, 9.0]];
    let mesh = revolved(&section, 64);
    let sites = sites_on(&mesh, 2, |_, _| true);
    let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
    let directions = Directions::new(DirectionSet::FibonacciHemisphere { n_dirs: 24 }).unwrap();
    let directions = Directions::new(DirectionSet::List {
        vectors: directions.vectors().iter().map(|d| d.as_dvec3().to_array()).collect(),
    })
    .unwrap();
    let options =
        SurfaceOptions { refinement: None, occlusion: false, ..SurfaceOptions::default() };
    let holder = [Section::cylinder(10.0, 8.0)];
    for (text, tip, flutes) in [
        ("0:0 1.5:1.5@0:1.5 1.5:10 | 1.5:40", [1.5, 1.5], 10.0),
        ("1:0 1.5:0.5@1:0.5 1.5:10 | 1.5:40", [1.5, 0.5], 10.0),
        ("1.5:0 1.5:10 | 1.5:40", [1.5, 0.0], 10.0),
    ] {
        let profile: Profile = text.parse().unwrap();
        let tool = Assembly::from_profile(profile, &holder, 14.0).unwrap();
        let tip = crate::tool::cutter::TipShape::Straight { radius_mm: tip[0], corner_mm: tip[1] };
        let body = [Section::cylinder(40.0, 1.5)];
        let plain = Assembly::new(tip, &body, &holder, 14.0).unwrap().with_flutes(flutes).unwrap();
        let [found, expected] = [tool, plain].map(|tool| {
            obstacles
                .surface_labels(&sites, &tool.cutter().unwrap(), &directions, &options)
                .unwrap()
        });
        let differ = (0..sites.len()).filter(|&i| {
            let reached = |labels: &SurfaceLabels| labels.answers[i] == SiteAnswer::Accessible;
            reached(&found) != reached(&expected)
        });
        let differ: Vec<(usize, Vec3, Vec3)> =
            differ.map(|i| (i, sites.points[i], sites.normals[i])).collect();
        // Poses are searched less far than for cutters of steps.
        let more = differ.iter().filter(|d| found.answers[d.0] == SiteAnswer::Accessible).count();
        assert!(
            more == 0 && differ.len() * 100 < sites.len(),
            "{text}: {} of {}: {differ:?}",
            differ.len(),
            sites.len()
        );
        let share = share(&expected);
        assert!((0.2..0.9).contains(&share), "{share}");
    }
}

#[test]
fn witnesses_are_free_by_the_definition_alone() {
    let mesh = t_slot();
    let sites = sites_on(&mesh, 6, undercut);
    let profile = Profile::t_slot(10.5, 8.9, 0.3, 5.0).unwrap();
    let labels = label(&mesh, &sites, profile.clone(), 60.0);
    let outline = Outline::new(&profile);
    for witness in labels.evidence.witness.iter().flatten().step_by(97) {
        assert_eq!(witness.direction, Vec3::Z);
        for f in 0..mesh.triangles.len() {
            let corners = mesh.corners(f).map(|p| p - witness.tip_mm);
            let penetrated = reference::penetrates(&outline, &corners, 0.015, 0.02);
            assert_ne!(penetrated, Some(true), "{witness:?} {corners:?}");
        }
    }
    assert!(labels.evidence.witness.iter().flatten().count() > 50);
}

#[test]
fn answers_depend_on_the_site_alone_and_on_no_number_of_threads() {
    let mesh = t_slot();
    let sites = sites_on(&mesh, 5, |p, _| p.x.abs() < 12.0 && p.z > 18.0);
    let profile = || Profile::t_slot(10.5, 8.9, 0.3, 5.0).unwrap();
    let all = label(&mesh, &sites, profile(), 60.0);
    assert!((0.1..0.99).contains(&share(&all)), "{}", share(&all));
    let some: Vec<usize> = (0..sites.len()).rev().step_by(3).collect();
    for threads in [1, 3] {
        let few =
            par::with_threads(threads, || label(&mesh, &sites.subset(&some), profile(), 60.0));
        let few = few.unwrap();
        for (k, &i) in some.iter().enumerate() {
            assert_eq!(few.answers[k], all.answers[i], "{i}");
            assert_eq!(few.evidence.witness[k], all.evidence.witness[i], "{i}");
            assert_eq!(few.evidence.retreat_unproven[k], all.evidence.retreat_unproven[i], "{i}");
        }
    }
}

#[test]
fn what_is_not_computed_of_a_profile_is_refused_by_name() {
    let mesh = t_slot();
    let sites = sites_on(&mesh, 1, |_, _| true);
    let holder = [Section::cylinder(30.0, 20.0)];
    let tool = Assembly::from_profile(Profile::lollipop(3.0, 1.5).unwrap(), &holder, 60.0).unwrap();
    let cutter = tool.cutter().unwrap();
    let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
    let (up, usual) = (Directions::up(), SurfaceOptions::default());
    let clearance = SurfaceOptions { clearance_limit_mm: Some(1.0), ..usual };
    for message in [
        obstacles.label(&sites, &cutter, &up, &usual).unwrap_err().to_string(),
        obstacles.surface_labels(&sites, &cutter, &up, &clearance).unwrap_err().to_string(),
        access::label(&sites, Obstacles::Queries, &cutter, &up, &Default::default())
            .unwrap_err()
            .to_string(),
        raise(&mesh, &cutter, 0.01, DVec3::ZERO, Vec3::Z).unwrap_err().to_string(),
        tool.with_flutes(2.0).unwrap_err().to_string(),
    ] {
        assert!(message.contains("profile"), "{message}");
    }
}

#[test]
fn the_floor_of_a_t_slot_is_reached_into_its_corners() {
    let mesh = t_slot();
    let mut sites = Sites::default();
    for k in 0..=300 {
        let x = 10.595 * (k as f32 / 150.0 - 1.0);
        for y in [-20.0, -8.3, -36.54] {
            sites.points.push(Vec3::new(x, y, 19.0));
            sites.normals.push(Vec3::Z);
        }
    }
    let labels = label(&mesh, &sites, Profile::t_slot(10.5, 8.9, 0.0, 5.0).unwrap(), 60.0);
    let missed = (0..sites.len()).filter(|&i| labels.answers[i] != SiteAnswer::Accessible);
    let missed: Vec<f32> = missed.map(|i| sites.points[i].x).collect();
    assert!(missed.is_empty(), "{missed:?}");
}

//! Parts with analytic answers, and tips that do not fit.

use super::*;
use crate::access::surface::chords::Chords;

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
                let offset = (12.0 + 1.5) * (1.0 - cos * cos).max(0.0).sqrt();
                cutter.steps().iter().all(|step| {
                    let below = (step.height_mm + 0.01 - along).max(0.0);
                    let beyond = (offset - (step.radius_mm - 0.01)).max(0.0);
                    below.hypot(beyond) >= radius
                })
            });
            directions.count() as u32
        };
        let found = labels.evidence.collision_free_directions[i];
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
                let greatest = labels.evidence.tolerance_mm.iter().fold(0.0, |a: f64, b| a.max(*b));
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
            // Beside the slot's open ends a wide tool reaches in from outside.
            sites.points.iter_mut().for_each(|p| (p.x, p.y) = (0.0, p.y.clamp(-18.0, 18.0)));
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
fn where_a_tip_gouges_the_work_does_not_grow_with_the_triangles_in_it() {
    // The tips are wider than the slot, and a good part of its rim is in them.
    let slot = slotted(6.0, 5.0);
    let floor = sites_on(&slot, 40, |p, n| n.z > 0.5 && p.z < 19.0);
    let finer = |mesh: &Mesh, n: usize| (0..n).fold(mesh.clone(), |mesh, _| subdivided(&mesh));
    let meshes = [finer(&slot, 3), finer(&slot, 5)];
    let lengths = [5.0, 30.0, 10.0, 5.0];
    for cutter in [ball(lengths), bull(lengths, 1.0), bull(lengths, 0.0)] {
        let [coarse, fine] = meshes.each_ref().map(|mesh| {
            let labels = label(mesh, &floor, &cutter, &hemisphere(30), &exactly(0.01));
            assert!(n_of(SiteAnswer::TipDoesNotFit, &labels.answers) * 2 > floor.len());
            labels.evidence.stats.triangles_tested
        });
        assert!(fine < 2 * coarse, "{cutter:?}: 16 times the triangles, {coarse} and {fine} tests");
    }
}

#[test]
fn a_flat_end_reaches_the_whole_floor_of_a_slot_and_tilting_it_a_little_changes_nothing() {
    let mesh = slotted(10.0, 8.0);
    let floor = sites_on(&mesh, 60, |p, n| n.z > 0.5 && p.z < 19.0);
    let flat = bull([3.0, 30.0, 20.0, 5.0], 0.0);
    for tilt in [0.0, 1e-6, 1e-4, 1e-3] {
        let direction = dvec3(tilt, 0.5 * tilt, 1.0).normalize().as_vec3();
        let found = answers(&mesh, &floor, &flat, &list(&[direction]), &exactly(0.01));
        assert_eq!(n_of(SiteAnswer::Accessible, &found), floor.len(), "tilted by {tilt}");
    }
    let wide = bull([5.2, 30.0, 20.0, 5.0], 0.0);
    let middle = floor
        .subset(&(0..floor.len()).filter(|&i| floor.points[i].y.abs() < 14.0).collect::<Vec<_>>());
    let found = answers(&mesh, &middle, &wide, &up(), &exactly(0.01));
    assert_eq!(n_of(SiteAnswer::Accessible, &found), 0, "wider than the slot");
}

#[test]
fn a_tool_of_the_radius_of_a_bore_reaches_all_of_it_and_a_wider_one_none() {
    for chord_error in [0.001, 0.01, 0.1] {
        let mesh = tube(4.0, 12.0, 15.0, facets(4.0, chord_error));
        let inside = |p: DVec3, n: DVec3| n.z.abs() < 0.1 && n.dot(dvec3(p.x, p.y, 0.0)) < 0.0;
        let bore = sites_on(&mesh, 3, inside);
        for corner in [0.0, 1.0, 4.0] {
            let found =
                answers(&mesh, &bore, &bull([4.0, 40.0, 20.0, 5.0], corner), &up(), &implied());
            let n_reached = n_of(SiteAnswer::Accessible, &found);
            assert_eq!(n_reached, bore.len(), "{chord_error} {corner}");
            let wide = bull([1.02 * 4.0, 40.0, 20.0, 5.0], corner);
            let found = answers(&mesh, &bore, &wide, &up(), &implied());
            assert_eq!(n_of(SiteAnswer::Accessible, &found), 0, "{chord_error} {corner}");
        }
    }
}

/// Every triangle cut in four, as many times as given; corners rounded to 32 bits, as files do.
pub(super) fn quartered(mesh: &Mesh, n: usize) -> Mesh {
    let mut mesh = mesh.clone();
    for _ in 0..n {
        let mut middles = std::collections::BTreeMap::new();
        let mut vertices = mesh.vertices.clone();
        let mut triangles = Vec::new();
        for &[a, b, c] in &mesh.triangles {
            let mut middle = |p: u32, q: u32| {
                *middles.entry([p.min(q), p.max(q)]).or_insert_with(|| {
                    vertices.push(0.5 * (mesh.vertices[p as usize] + mesh.vertices[q as usize]));
                    vertices.len() as u32 - 1
                })
            };
            let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
            triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        mesh = Mesh { vertices, triangles };
    }
    mesh.vertices.iter_mut().for_each(|p| *p = p.as_vec3().as_dvec3());
    mesh
}

#[test]
fn facets_cut_into_many_triangles_have_the_chord_of_their_curve() {
    for n in [12, 40, 100, 400] {
        let mesh = tube(2.5, 10.0, 15.0, n);
        let whole = Chords::of(&mesh);
        for times in [1, 2, 3] {
            let cut = quartered(&mesh, times);
            let chords = Chords::of(&cut);
            assert_eq!(chords.len(), whole.len() << (2 * times));
            let of_bore = 4 * n as usize..6 * n as usize;
            for f in 0..chords.len() {
                let [own, of] =
                    [chords.at(f as u32).error, whole.at((f >> (2 * times)) as u32).error];
                if of_bore.contains(&(f >> (2 * times))) {
                    assert!((own - of).abs() <= 0.02 * of, "{n}, {times}, {f}: {own}, {of}");
                    continue;
                }
                // Faces at the ends of the bore reach in between its chords and its curve, by no more than these.
                let from_axis = cut.corners(f).map(|p| p.truncate().length());
                let reaches_in = from_axis.iter().any(|r| *r < 2.5 - 1e-4);
                let is_outside = from_axis.iter().all(|r| *r > 2.5 + 1e-4);
                assert!(
                    own <= whole.at(of_bore.start as u32).error * 1.02,
                    "{n}, {times}, {f}: {own}"
                );
                assert!(if reaches_in { own > 0.0 } else { !is_outside || own == 0.0 });
            }
        }
    }
}

#[test]
fn a_tool_of_the_radius_of_a_finer_cut_bore_reaches_it_and_a_wider_one_does_not() {
    for chord_error in [0.005, 0.05] {
        let mesh = quartered(&tube(2.5, 10.0, 12.0, facets(2.5, chord_error)), 2);
        let inside = |p: DVec3, n: DVec3| n.z.abs() < 0.1 && n.dot(dvec3(p.x, p.y, 0.0)) < 0.0;
        let bore = sites_on(&mesh, 1, inside);
        let bore = bore.subset(&(0..bore.len()).step_by(7).collect::<Vec<_>>());
        for (radius, share) in [(2.45, 1.0), (2.5, 1.0), (2.6, 0.0)] {
            for cutter in [ball([radius, 30.0, 20.0, 5.0]), bull([radius, 30.0, 20.0, 5.0], 0.0)] {
                let found = answers(&mesh, &bore, &cutter, &up(), &implied());
                let n = n_of(SiteAnswer::Accessible, &found);
                assert_eq!(n as f64 / bore.len() as f64, share, "{radius}, {chord_error}");
            }
        }
    }
}

/// A tube with a recess in the middle of every facet of its bore, as if it were drilled across.
fn recessed(inner: f64, outer: f64, height: f64, n: u32, depth: f64) -> Mesh {
    let mut mesh = tube(inner, outer, height, n);
    mesh.triangles.retain(|corners| corners.iter().any(|v| *v < 2 * n));
    for k in 0..n {
        let k1 = (k + 1) % n;
        let outline = [2 * n + k, 2 * n + k1, 3 * n + k1, 3 * n + k];
        let [a, b, c, d] = outline.map(|v| mesh.vertices[v as usize]);
        let outward = -(b - a).cross(d - a).normalize();
        let first = mesh.vertices.len() as u32;
        for out in [0.0, depth] {
            for (s, t) in [(0.2, 0.3), (0.7, 0.3), (0.7, 0.6), (0.2, 0.6)] {
                mesh.vertices.push(a.lerp(b, s).lerp(d.lerp(c, s), t) + outward * out);
            }
        }
        let rings = [outline, [0, 1, 2, 3].map(|j| first + j), [4, 5, 6, 7].map(|j| first + j)];
        for pair in rings.windows(2) {
            for j in 0..4 {
                let next = (j + 1) % 4;
                let [p, q] = [pair[0][j], pair[0][next]];
                let [p1, q1] = [pair[1][j], pair[1][next]];
                mesh.triangles.extend([[p, q, q1], [p, q1, p1]]);
            }
        }
        let [p, q, r, s] = rings[2];
        mesh.triangles.extend([[p, q, r], [p, r, s]]);
    }
    mesh
}

#[test]
fn a_tool_of_the_radius_of_a_bore_that_is_crossed_reaches_it_and_a_wider_one_does_not() {
    for n in [12, 20, 32, 64] {
        let mesh = recessed(2.5, 10.0, 12.0, n, 1.0);
        assert!(crate::geom::check::check(&mesh).is_closed());
        let inside = |p: DVec3, n: DVec3| {
            let from_axis = p.truncate().length();
            n.dot(dvec3(p.x, p.y, 0.0)) < -0.9 * from_axis && from_axis < 2.51
        };
        let all = sites_on(&mesh, 3, inside);
        // On the rim a wider one is within the tolerance.
        let low: Vec<usize> = (0..all.len()).filter(|&i| all.points[i].z < 11.0).collect();
        let bore = all.subset(&low);
        for (radius, share) in [(2.45, 1.0), (2.5, 1.0), (2.7, 0.0)] {
            for cutter in [ball([radius, 30.0, 20.0, 5.0]), bull([radius, 30.0, 20.0, 5.0], 0.0)] {
                let found = answers(&mesh, &bore, &cutter, &up(), &implied());
                let reached = n_of(SiteAnswer::Accessible, &found) as f64 / bore.len() as f64;
                assert_eq!(reached, share, "{radius}, {n} facets");
            }
        }
    }
}

#[test]
fn planes_that_meet_in_a_blunt_edge_are_no_curve_however_many_their_triangles() {
    let outline = [[-20.0, -5.0], [20.0, -5.0], [20.0, 7.3], [0.0, 0.0], [-20.0, 0.0]];
    let cap = [[0, 1, 3], [1, 2, 3], [0, 3, 4]];
    let mesh = solids::prism(&outline.map(DVec2::from_array), &cap, 30.0);
    let greatest = |mesh: &Mesh| {
        let chords = Chords::of(mesh);
        (0..chords.len() as u32).map(|f| chords.at(f).error).fold(0.0, f64::max)
    };
    for n in 0..3 {
        assert_eq!(greatest(&quartered(&mesh, n)), 0.0);
    }
}

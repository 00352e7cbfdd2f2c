//! Parts with analytic answers, and tips that do not fit.

use super::*;

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
            labels.stats.triangles_tested
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

//! The search between the directions, and clearance.

use super::*;

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
        none.evidence
            .open_directions
            .iter()
            .zip(&none.answers)
            .all(|(open, a)| (*open == 1.0) == (*a != SiteAnswer::Accessible))
    );
    let refined = SurfaceOptions { refinement: Some(RefinementOptions::proving()), ..implied() };
    let found = label(&mesh, &sites, &cutter, &coarse, &refined);
    assert!(n_of(SiteAnswer::Accessible, &none.answers) * 2 < sites.len());
    assert_eq!(n_of(SiteAnswer::Accessible, &found.answers), sites.len());
    for pose in &found.evidence.witness {
        let pose = pose.unwrap();
        let center = pose.tip_mm + cutter.corner_mm() * pose.direction.as_dvec3().normalize();
        let most = found.evidence.tolerance_mm.iter().fold(0.0, |a: f64, b| a.max(*b));
        let raised = raise(&mesh, &cutter, most + EPSILON_MM, center, pose.direction).unwrap();
        assert!(raised.steps <= 0.0 && raised.tip <= 0.0, "{raised:?}");
    }
}

#[test]
fn a_site_proven_inaccessible_is_so_in_any_direction() {
    let mesh = slotted(4.0, 15.0);
    let sites = everywhere(&mesh, 6);
    let directions = Directions::fibonacci_hemisphere(150).unwrap();
    let many = Directions::fibonacci_hemisphere(4000).unwrap();
    let options = RefinementOptions::proving();
    let refined = SurfaceOptions { refinement: Some(options), ..exactly(0.01) };
    let (mut n_proven, mut n_inaccessible) = (0, 0);
    for cutter in [
        ball([1.0, 20.0, 5.0, 20.0]),
        ball([1.5, 3.0, 20.0, 5.0]),
        bull([1.5, 3.0, 20.0, 5.0], 0.5),
    ] {
        let found = label(&mesh, &sites, &cutter, &directions, &refined);
        let uniform = label(&mesh, &sites, &cutter, &many, &exactly(0.01));
        for i in 0..sites.len() {
            if uniform.answers[i] == SiteAnswer::Accessible {
                assert_eq!(
                    found.answers[i],
                    SiteAnswer::Accessible,
                    "{i} {} {} {:?} {cutter:?}",
                    found.evidence.open_directions[i],
                    sites.points[i],
                    uniform.evidence.witness[i]
                );
            }
            if found.answers[i] == SiteAnswer::Inaccessible
                && found.evidence.open_directions[i] == 0.0
            {
                n_proven += 1;
                assert_eq!(uniform.evidence.collision_free_directions[i], 0, "{i} {cutter:?}");
            }
        }
        n_inaccessible += n_of(SiteAnswer::Inaccessible, &found.answers);
    }
    assert!(n_proven * 2 > n_inaccessible, "{n_proven} of {n_inaccessible}");
}

/// How far from the site's own a pose of a ball of radius 1.5 may be on a plane: the root of 2·1.5·0.02, mm.
const SHIFT_MM: f32 = 0.25;

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
        // What cuts may touch, and the holder is far above.
        assert_eq!(*answer, SiteAnswer::Accessible);
        assert_eq!(*clearance, 3.0);
    }
    // Flutes of 8 mm: the shank is beside the wall touched, which is the tolerance away from the shrunk tool.
    let step = |height_mm, radius_mm| crate::tool::cutter::Step { height_mm, radius_mm };
    let upper = vec![step(6.5, 1.5), step(41.5, 20.0), step(46.5, f64::INFINITY)];
    let short = Cutter::from_parts([1.5, 0.0], vec![step(1.5, 1.5)], upper).unwrap();
    let labels = label(&mesh, &walls, &short, &up(), &options);
    for (p, clearance) in walls.points.iter().zip(&labels.clearance_mm) {
        let below_top = 6.5 + 0.01 - (20.0 - p.z);
        assert!((clearance - below_top.clamp(0.01, 3.0)).abs() < 2e-4, "{p} {clearance}");
    }
    let floor = sites_on(&mesh, 20, |p, n| n.z > 0.5 && p.z < 19.0);
    let labels = label(&mesh, &floor, &cutter, &up(), &options);
    for (i, p) in floor.points.iter().enumerate() {
        // Negative: by how much all steps must shrink.
        let expected = 5.0 - p.x.abs() - 1.49;
        let expected = if expected > 0.0 { 3.0 } else { expected };
        let found = labels.clearance_mm[i];
        // A ball that is a little beside the site touches it within the finish tolerance.
        if (-SHIFT_MM..0.0).contains(&expected) && labels.answers[i] == SiteAnswer::Accessible {
            continue;
        }
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
        let grown = match growth > 0.0 {
            true => cutter.with_clearance(growth).unwrap(),
            false => cutter.grown(growth).unwrap(),
        };
        let found = label(&torus, &sites, &grown, &directions, &exactly(0.01));
        for i in 0..sites.len() {
            let clearance = f64::from(labels.clearance_mm[i]);
            // Of a grown tool another pose may be free.
            let is_near = (growth - f64::from(SHIFT_MM)..growth).contains(&clearance);
            if (clearance - growth).abs() > 2e-4 && !is_near {
                let inaccessible = found.answers[i] == SiteAnswer::Inaccessible;
                assert_eq!(inaccessible, clearance < growth, "{i} {clearance} {growth}");
            }
        }
    }
    let bad = SurfaceOptions { clearance_limit_mm: Some(0.0), ..exactly(0.01) };
    assert!(
        TriangleObstacles::new(&mesh, &[])
            .unwrap()
            .surface_labels(&floor, &cutter, &up(), &bad)
            .is_err()
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
        SurfaceOptions { refinement: Some(RefinementOptions::proving()), ..exactly(0.01) };
    for cutter in [ball([1.0, 10.0, 5.0, 10.0]), bull([1.5, 6.0, 10.0, 5.0], 0.5)] {
        let found = obstacles.surface_labels(queries, &cutter, &hemisphere(60), &refined).unwrap();
        let uniform =
            obstacles.surface_labels(queries, &cutter, &hemisphere(3000), &exactly(0.01)).unwrap();
        let mut n_missed = 0;
        for (i, point) in points.iter().enumerate() {
            let (one, many) = (found.answers[i], uniform.answers[i]);
            n_missed += usize::from(many == SiteAnswer::Accessible && one != many);
            let proven =
                one == SiteAnswer::Inaccessible && found.evidence.open_directions[i] == 0.0;
            assert!(!proven || uniform.evidence.collision_free_directions[i] == 0, "{point}");
        }
        // Between the directions only poses on the axis are tried.
        assert!(n_missed * 10 < points.len(), "{n_missed}");
    }
}

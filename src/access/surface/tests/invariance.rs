//! Changes of part and tool that change answers in one way or not at all; fixtures, space, bad input.

use super::*;

#[test]
fn a_greater_tolerance_never_makes_a_site_less_accessible() {
    let mesh = solids::torus(9.0, 4.0, 30, 16);
    let sites = everywhere(&mesh, 1);
    let directions = hemisphere(60);
    for cutter in cutters() {
        let mut before = vec![SiteAnswer::Inaccessible; sites.len()];
        for tolerance in [1e-5, 1e-3, 0.004, 0.01, 0.05, 0.2, 0.9] {
            let labels = label(&mesh, &sites, &cutter, &directions, &exactly(tolerance));
            for (before, after) in before.iter_mut().zip(labels.answers) {
                let is_kept = *before != SiteAnswer::Accessible || after == SiteAnswer::Accessible;
                assert!(is_kept, "{tolerance} {cutter:?}");
                *before = after;
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
                let [less, found, more] = [&less, &found, &more]
                    .map(|labels| labels.answers[i] == SiteAnswer::Accessible);
                assert!(less <= found && found <= more, "{i}");
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
    let labels = with.surface_labels(&top, &cutter, &up(), &exactly(0.01)).unwrap();
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
fn triangles_without_area_are_no_obstacles_and_keep_the_numbers_of_the_others() {
    let part = slotted(4.0, 8.0);
    let sites = everywhere(&part, 3);
    let cutter = ball([1.0, 10.0, 20.0, 20.0]);
    let plain = label(&part, &sites, &cutter, &up(), &exactly(0.01));
    let high = part.bounds().unwrap().1.z + 20.0;
    let at = |k: f64| dvec3(3.1, 4.7, high) + k * dvec3(0.3, 0.7, 0.1);
    for corners in [[at(0.0); 3], [at(0.0), at(0.0), at(5.0)], [at(0.0), at(3.3), at(9.7)]] {
        let mut more = part.clone();
        let n = more.vertices.len() as u32;
        more.vertices.extend(corners);
        more.triangles.insert(0, [n, n + 1, n + 2]);
        let obstacles = TriangleObstacles::new(&more, &[more.clone()]).unwrap();
        assert_eq!(obstacles.n_without_area(), 2);
        assert_eq!(obstacles.n_triangles(), 2 * part.triangles.len());
        let labels = obstacles.surface_labels(&sites, &cutter, &up(), &exactly(0.01)).unwrap();
        assert_eq!(labels.answers, plain.answers, "{corners:?}");
        // The reference engine holds to it, too.
        let below = |mesh: &Mesh| raise(mesh, &cutter, 0.01, at(0.0) - DVec3::Z, Vec3::Z).unwrap();
        assert_eq!(below(&more), below(&part), "{corners:?}");
    }
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
    let labels = obstacles.surface_labels(queries, &cutter, &up(), &exactly(0.01)).unwrap();
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
fn unusable_arguments_are_named() {
    let mut mesh = solids::cuboid(DVec3::splat(10.0));
    let obstacles = TriangleObstacles::new(&mesh, &[]).unwrap();
    let sites = everywhere(&mesh, 1);
    let cutter = ball([1.0, 20.0, 5.0, 20.0]);
    for tolerance in [0.0, -1.0, 1.0, f64::NAN] {
        assert!(
            obstacles.surface_labels(&sites, &cutter, &up(), &exactly(tolerance)).is_err(),
            "{tolerance}"
        );
    }
    let bare = Sites { normals: vec![], ..sites.clone() };
    let message =
        obstacles.surface_labels(&bare, &cutter, &up(), &exactly(0.01)).unwrap_err().to_string();
    assert!(message.contains("0 normals for 12 sites"), "{message}");
    let zero = raise(&mesh, &cutter, 0.01, DVec3::ZERO, Vec3::ZERO);
    assert!(zero.is_err());
    mesh.vertices[3].x = f64::NAN;
    let message = TriangleObstacles::new(&mesh, &[]).unwrap_err().to_string();
    assert!(message.starts_with("vertex 3"), "{message}");
    assert!(TriangleObstacles::new(&Mesh::default(), &[]).is_err());
}

#[test]
fn an_answer_is_a_function_of_its_site_alone() {
    let mesh = slotted(4.0, 8.0);
    let sites = everywhere(&mesh, 6);
    let prove = RefinementOptions { prove: true, n_kept: 8, ..RefinementOptions::default() };
    let options = SurfaceOptions { refinement: Some(prove), ..implied() };
    let directions = hemisphere(30);
    let mut stream = Stream::new(9, 0, 0, Purpose::Probe);
    for cutter in cutters() {
        let all = label(&mesh, &sites, &cutter, &directions, &options);
        for n_threads in [1, 3] {
            // Some of the sites, in another order.
            let key: Vec<f64> = (0..sites.len()).map(|_| stream.range(0.0, 1.0)).collect();
            let mut some: Vec<usize> = (0..sites.len()).filter(|&i| key[i] < 0.4).collect();
            some.sort_by(|&i, &j| key[i].total_cmp(&key[j]));
            let few = sites.subset(&some);
            let asked = || label(&mesh, &few, &cutter, &directions, &options);
            let found = par::with_threads(n_threads, asked).unwrap();
            for (k, &i) in some.iter().enumerate() {
                assert_eq!(found.answers[k], all.answers[i], "{cutter:?} {i}");
                assert_eq!(found.evidence.witness[k], all.evidence.witness[i], "{cutter:?} {i}");
                assert_eq!(
                    found.evidence.open_directions[k], all.evidence.open_directions[i],
                    "{cutter:?} {i}"
                );
                let counts = |of: &SurfaceLabels, k: usize| {
                    [of.accessible_directions[k], of.evidence.collision_free_directions[k]]
                };
                assert_eq!(counts(&found, k), counts(&all, i), "{cutter:?} {i}");
            }
        }
    }
}

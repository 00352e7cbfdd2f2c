//! The fast engine against drop heights in closed form.

use super::*;

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
        // Moving the triangle by its distance from the borderline case in height is the same as moving the tool.
        for shift in [0.0, -drop + 1e-7, -drop - 1e-7] {
            let shift = if shift.is_finite() { shift } else { 0.0 };
            let moved = corners.map(|p| p + DVec3::Z * shift);
            let expected = drop + shift > 0.0;
            let borderline = drop.is_finite() && (drop + shift).abs() < 0.9e-7;
            if !borderline && penetrate::tip(&moved, tip) != expected && !at_rim(&moved, tip) {
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

/// Found by fuzzing: an edge along the tool's axis but for roundings gave a height between those of its ends.
#[test]
fn a_ball_rests_on_the_upper_end_of_an_edge_that_is_upright_but_for_roundings() {
    let top = dvec3(1.0 / 6.0, 1.0 / 6.0, -1.0 / 12.0);
    let tip = Tip::Round { ring: 0.0, radius: 0.24 };
    let on_top = drop::tip(&[top; 3], tip);
    assert!((on_top - top.z - (0.24f64.powi(2) - 1.0 / 18.0).sqrt()).abs() < 1e-12);
    for exponent in 3..18 {
        for lean in [DVec2::X, DVec2::NEG_X, DVec2::Y, DVec2::splat(-1.0), dvec2(1.0, -1.0)] {
            let bottom = top + (lean * 0.1f64.powi(exponent)).extend(-18.0);
            for corners in [[top, bottom, bottom], [bottom, bottom, top], [bottom, top, top]] {
                let height = drop::tip(&corners, tip);
                assert!((height - on_top).abs() < 1e-9, "{lean} 1e-{exponent}: {height}");
            }
        }
    }
}

#[test]
fn the_fast_engine_equals_the_reference() {
    let meshes = [
        tube(2.5, 12.0, 15.0, 12),
        slotted(4.0, 8.0),
        solids::torus(12.0, 5.0, 12, 8),
        sphere(10.0, 5),
    ];
    let directions = list(hemisphere(6).vectors());
    let (mut n_left, mut n_pairs) = (0, 0);
    for mesh in &meshes {
        let n = 20usize.div_ceil(mesh.triangles.len());
        let sites = everywhere(mesh, n);
        for cutter in cutters() {
            n_left += assert_equal_to_the_reference(mesh, &sites, &cutter, &directions, 0.01);
            n_pairs += sites.len() * directions.len();
        }
    }
    assert!(n_left * 50 < n_pairs, "{n_left} of {n_pairs}");
}

#[test]
fn the_fast_engine_equals_the_reference_whole_sphere_and_odd_tolerances() {
    let mesh = tube(3.0, 9.0, 10.0, 12);
    let sites = everywhere(&mesh, 1);
    let directions = Directions::new(DirectionSet::FibonacciSphere { n_dirs: 5 }).unwrap();
    let directions = list(directions.vectors());
    let sites = sites.subset(&(0..sites.len()).step_by(8).collect::<Vec<_>>());
    for tolerance in [0.003, 0.1, 0.4] {
        for cutter in cutters() {
            assert_equal_to_the_reference(&mesh, &sites, &cutter, &directions, tolerance);
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
        let evidence = SurfaceEvidence { stats: all.evidence.stats, ..other.evidence };
        assert_eq!(SurfaceLabels { evidence, ..other }, all);
    }
    for n_threads in [1, 3] {
        let one = par::with_threads(n_threads, || {
            label(&mesh, &sites, &cutter, &directions, &exactly(0.01))
        });
        assert_eq!(one.unwrap(), all);
    }
    let options = SurfaceOptions { counts: false, ..exactly(0.01) };
    let quick = label(&mesh, &sites, &cutter, &directions, &options);
    assert_eq!((quick.answers, quick.evidence.witness), (all.answers, all.evidence.witness));
}

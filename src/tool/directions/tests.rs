//! Tests of the direction sets.

use super::*;

fn vectors(set: DirectionSet) -> Vec<Vec3> {
    Directions::new(set).unwrap().vectors().to_vec()
}

#[test]
fn every_form_of_text_is_read_and_written_again() {
    for (text, n) in [
        ("published", 152),
        ("deepmill++", 102),
        ("hemisphere:7", 7),
        ("sphere:20", 20),
        ("latlong:3x8", 24),
        ("cone:30:12", 12),
        ("cone:180:5", 5),
        ("cone:33.3:12:1,0,-0.5", 12),
        ("circle:1,0,0:36", 36),
        ("list:0,0,1;0,1,0", 2),
    ] {
        let directions: Directions = text.parse().unwrap();
        assert_eq!((directions.len(), directions.to_string().as_str()), (n, text));
    }
    assert_eq!("up".parse::<Directions>().unwrap(), Directions::up());
    let plain: DirectionSet = "150".parse().unwrap();
    assert_eq!(plain, DirectionSet::FibonacciHemisphere { n_dirs: 150 });
    for text in [
        "",
        "x",
        "4-axis:x:90,-30",
        "sphere",
        "sphere:-1",
        "cone:30",
        "list:",
        "list:0,0",
        "circle:3",
        "0",
    ] {
        assert!(text.parse::<Directions>().is_err(), "{text}");
    }
    for text in ["cone:200:5", "cone:0:5", "cone:-30:5", "cone:NaN:5"] {
        let message = text.parse::<Directions>().unwrap_err().to_string();
        assert!(message.contains(text) && message.contains("180 degrees"), "{message}");
        assert!(!message.contains("radians"), "{message}");
    }
}

#[test]
fn every_set_holds_as_many_unit_vectors_as_it_says() {
    let axis = [1.0, 2.0, -2.0];
    let sets = [
        (DirectionSet::Published, 152),
        (DirectionSet::DeepMillPlusPlus, 102),
        (DirectionSet::FibonacciHemisphere { n_dirs: 150 }, 150),
        (DirectionSet::FibonacciSphere { n_dirs: 33 }, 33),
        (DirectionSet::LatLong { n_polar: 5, n_azimuth: 12 }, 60),
        (DirectionSet::Cone { axis, half_angle_rad: 0.4, n_dirs: 20 }, 20),
        (DirectionSet::Circle { axis, n_dirs: 8 }, 8),
        (DirectionSet::List { vectors: vec![[0.0, 0.0, 3.0]] }, 1),
    ];
    for (set, n) in sets {
        let text = format!("{set:?}");
        let found = vectors(set);
        assert_eq!(found.len(), n, "{text}");
        assert!(found.iter().all(|d| (d.length() - 1.0).abs() < 1e-6), "{text}");
    }
}

#[test]
fn hemisphere_follows_its_formula() {
    let found = vectors(DirectionSet::FibonacciHemisphere { n_dirs: 4 });
    let heights: Vec<f32> = found.iter().map(|d| d.z).collect();
    assert_eq!(heights, [0.875, 0.625, 0.375, 0.125]);
    let azimuth = f64::from(found[1].y).atan2(f64::from(found[1].x));
    assert!((azimuth - PI * (3.0 - 5f64.sqrt())).abs() < 1e-6);
}

/// As numbers, so that no change of the formula goes unseen: computed apart, in Python's doubles.
#[test]
fn published_directions_are_pinned() {
    let found = vectors(DirectionSet::Published);
    assert_eq!(found, Directions::published().vectors());
    let bytes: Vec<u8> =
        found.iter().flat_map(|d| d.to_array()).flat_map(f32::to_le_bytes).collect();
    let hash = hmac_sha256::Hash::hash(&bytes).map(|b| format!("{b:02x}")).concat();
    assert_eq!(hash, "8f5a2b6c19fa33be53cfb1f3f6759ce003882609d3b6f87e192479812e08c96c");
}

/// Computed apart: `y = (2i + 1)/200 − 1`, `θ = i·3.1415926·(3 − √5)`.
#[test]
fn the_directions_of_deepmill_plus_plus_follow_their_rule() {
    let found = vectors(DirectionSet::DeepMillPlusPlus);
    // i = 0: θ = 0, r = √(1 − 0.995²) = 0.0998749. i = 1: θ = 137.5°, r = √(1 − 0.985²) = 0.1725543,
    // r cos θ = −0.1272360, r sin θ = 0.1165588. i = 2: θ = 275°, z < 0, left out. i = 3: θ = 52.5°.
    let by_hand = [
        (0, [0.099_874_92, -0.995, 0.0]),
        (1, [-0.127_236, -0.985, 0.116_559]),
        (2, [0.159_563, -0.965, 0.208_122]),
        (101, [0.0, 0.0, 1.0]),
    ];
    for (k, d) in by_hand {
        assert!((found[k] - Vec3::from_array(d)).length() < 1e-6, "{k}: {}", found[k]);
    }
    assert!(found.iter().all(|d| d.z >= 0.0));
    assert!(found[..101].is_sorted_by(|a, b| a.y < b.y));
}

/// Lines of the published list, from its beginning, middle and end. With π in place of 3.1415926 the last digits of
/// most lines differ.
#[test]
fn the_directions_of_deepmill_plus_plus_have_the_printed_digits() {
    let found = vectors(DirectionSet::DeepMillPlusPlus);
    for (k, line) in [
        (3, "-0.092068 -0.935 0.342489"),
        (9, "-0.56465 -0.825 0.0233504"),
        (50, "0.329255 0.005 0.944228"),
        (53, "-0.995234 0.065 0.0726883"),
        (81, "-0.788339 0.615 0.0172067"),
        (99, "0.00376534 0.975 0.222173"),
        (100, "0.0996262 0.995 0.00704444"),
    ] {
        let printed: Vec<f64> = line.split(' ').map(|x| x.parse().unwrap()).collect();
        for (printed, found) in printed.into_iter().zip(found[k].to_array()) {
            // Half of the sixth digit, and the rounding of single precision.
            let digits = 10f64.powi(printed.abs().log10().floor() as i32 - 5);
            let bound = 0.5 * digits + f64::from(f32::EPSILON) * printed.abs();
            assert!((f64::from(found) - printed).abs() <= bound, "{k}: {found}, {printed}");
        }
    }
}

#[test]
fn sets_lie_where_they_should() {
    let axis = [0.0, 1.0, 0.0];
    let circle = vectors(DirectionSet::Circle { axis, n_dirs: 7 });
    assert!(circle.iter().all(|d| d.y.abs() < 1e-7));
    let cone = vectors(DirectionSet::Cone { axis, half_angle_rad: 0.3, n_dirs: 50 });
    assert!(cone.iter().all(|d| f64::from(d.y) > libm::cos(0.3)));
    let lat_long = vectors(DirectionSet::LatLong { n_polar: 3, n_azimuth: 8 });
    for d in &lat_long {
        let mirrored = Vec3::new(-d.x, d.y, d.z);
        assert!(lat_long.iter().any(|e| (*e - mirrored).length() < 1e-6));
    }
    let sphere = vectors(DirectionSet::FibonacciSphere { n_dirs: 100 });
    assert!(sphere.iter().copied().sum::<Vec3>().length() < 1.0);
}

#[test]
fn bases_are_right_handed_and_orthonormal() {
    for d in vectors(DirectionSet::FibonacciSphere { n_dirs: 500 }) {
        let [u, v, w] = basis(d.as_dvec3().normalize());
        assert!((u.cross(v) - w).length() < 1e-12 && (u.length() - 1.0).abs() < 1e-12);
    }
    let [u, v, w] = basis(DVec3::NEG_Z);
    assert!((u.cross(v) - w).length() < 1e-15);
}

#[test]
fn sets_without_directions_are_refused() {
    let zero = DirectionSet::List { vectors: vec![[0.0; 3]] };
    for set in [
        DirectionSet::FibonacciHemisphere { n_dirs: 0 },
        DirectionSet::LatLong { n_polar: usize::MAX, n_azimuth: 2 },
        DirectionSet::List { vectors: vec![] },
        DirectionSet::Circle { axis: [f64::NAN, 0.0, 1.0], n_dirs: 3 },
        DirectionSet::Cone { axis: [0.0, 0.0, 1.0], half_angle_rad: 0.0, n_dirs: 3 },
        zero,
    ] {
        assert!(Directions::new(set).is_err());
    }
}

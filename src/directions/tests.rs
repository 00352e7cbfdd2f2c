//! Tests of the direction sets.

use super::*;

fn vectors(set: DirectionSet) -> Vec<Vec3> {
    Directions::new(set).unwrap().vectors().to_vec()
}

#[test]
fn every_form_of_text_is_read_and_written_again() {
    for (text, n) in [
        ("published", 152),
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

//! What an answer rests on, in its first line: which tool axes were allowed, and what the part stands on.

use crate::part_itself::SurfaceArgs;
use deepmill::directions::{DirectionSet, Directions};

/// `tool axes: …; the part stands on …`, of the mesh definition.
pub fn premise(directions: &Directions, surface: &SurfaceArgs) -> String {
    let axes = axes(directions, surface.searches());
    let (table, n_fixtures) = surface.held_by();
    let fixtures = match n_fixtures {
        0 => String::new(),
        1 => ", with 1 fixture in the way".into(),
        n => format!(", with {n} fixtures in the way"),
    };
    match table {
        Some(z) => format!("{axes}; the part stands on a table at z = {z} mm{fixtures}"),
        None => format!(
            "{axes}; the part stands on nothing{fixtures}: its underside counts (--table Z puts a table there)"
        ),
    }
}

/// As [`premise`], with points as obstacles: there is no table and no search, but a bottom rule, if `bottom_mm` has its
/// tolerance.
pub fn premise_of_points(directions: &Directions, bottom_mm: Option<f64>) -> String {
    let axes = axes(directions, false);
    match bottom_mm {
        Some(mm) => {
            format!("{axes}; bottom rule: sites less than {mm} mm above the lowest are accessible")
        }
        None => format!("{axes}; the part stands on nothing: its underside counts"),
    }
}

fn axes(directions: &Directions, searched: bool) -> String {
    let n = directions.len();
    let is_region =
        !matches!(directions.set(), DirectionSet::Circle { .. } | DirectionSet::List { .. });
    let between = if searched && is_region { " and those between" } else { "" };
    let axes = match directions.set() {
        DirectionSet::FibonacciHemisphere { .. } | DirectionSet::LatLong { .. } => {
            "the upper half, down to the horizontal".to_string()
        }
        DirectionSet::DeepMillPlusPlus => {
            "an upper half about y and +z, those of DeepMill++".to_string()
        }
        DirectionSet::Published => "+z and an upper half about y, as published".to_string(),
        DirectionSet::FibonacciSphere { .. } => "all around".to_string(),
        DirectionSet::Cone { axis, half_angle_rad, .. } => {
            let degrees = (1e6 * half_angle_rad.to_degrees()).round() / 1e6;
            format!("within {degrees} degrees of {}", words(axis))
        }
        DirectionSet::Circle { axis, .. } => format!("across {}", words(axis)),
        DirectionSet::List { vectors } if vectors.len() == 1 => {
            return format!("tool axes: {} alone", words(&vectors[0]));
        }
        _ => return format!("tool axes: the {n} given"),
    };
    format!("tool axes: {axes} ({n} tested{between})")
}

fn words([x, y, z]: &[f64; 3]) -> String {
    match [x, y, z].map(|x| *x + 0.0) {
        [0.0, 0.0, z] if z > 0.0 => "+z".into(),
        [0.0, 0.0, _] => "-z".into(),
        _ => format!("{x}, {y}, {z}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn allowed_axes_and_the_lack_of_a_table_are_named() {
        let of = |set: &str| premise_of_points(&set.parse().unwrap(), None);
        assert!(of("up").starts_with("tool axes: +z alone; the part stands on nothing"));
        assert!(
            of("150").starts_with("tool axes: the upper half, down to the horizontal (150 tested)")
        );
        assert!(of("cone:30:12").contains("within 30 degrees of +z (12 tested)"));
        assert!(of("4-axis:x:-30,90").contains("the 25 given"));
        assert!(axes(&"sphere:9".parse().unwrap(), true).contains("(9 tested and those between)"));
        let published = premise_of_points(&Directions::published(), Some(1.0));
        assert!(published.contains("as published (152 tested)"), "{published}");
        assert!(published.contains("bottom rule: sites less than 1 mm above the lowest"));
        assert!(!published.contains("underside"), "it is accessible by rule: {published}");
    }
}

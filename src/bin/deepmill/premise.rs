//! What an answer rests on, in its first line: which tool axes were allowed, and what the part stands on.

use crate::part_itself::SurfaceArgs;
use deepmill::directions::{DirectionSet, Directions};

/// `tool axes: …; the part stands on …`; without triangles as obstacles there is no table and no search.
pub fn premise(directions: &Directions, surface: Option<&SurfaceArgs>) -> String {
    let searched = surface.is_some_and(SurfaceArgs::searches);
    let axes = axes(directions, searched);
    let (table, n_fixtures) = surface.map_or((None, 0), SurfaceArgs::held_by);
    let fixtures = match n_fixtures {
        0 => String::new(),
        1 => ", with 1 fixture in the way".into(),
        n => format!(", with {n} fixtures in the way"),
    };
    match (table, surface) {
        (Some(z), _) => format!("{axes}; the part stands on a table at z = {z} mm{fixtures}"),
        (None, Some(_)) => format!(
            "{axes}; the part stands on nothing{fixtures}: its underside counts (--table Z puts a table there)"
        ),
        (None, None) => format!("{axes}; the part stands on nothing: its underside counts"),
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
        let of = |set: &str| premise(&set.parse().unwrap(), None);
        assert!(of("up").starts_with("tool axes: +z alone; the part stands on nothing"));
        assert!(
            of("150").starts_with("tool axes: the upper half, down to the horizontal (150 tested)")
        );
        assert!(of("cone:30:12").contains("within 30 degrees of +z (12 tested)"));
        assert!(of("4-axis:x:-30,90").contains("the 25 given"));
        assert!(axes(&"sphere:9".parse().unwrap(), true).contains("(9 tested and those between)"));
    }
}

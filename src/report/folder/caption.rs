//! What decided the answers, in a line for a picture.

use crate::data::files::Provenance;
use crate::data::files::settings::Blocking;
use crate::tool::directions::DirectionSet;

/// Directions, obstacles beyond the part and warnings in a line for a picture.
pub fn setup(provenance: &Provenance) -> String {
    let settings = &provenance.settings;
    let mut words = Vec::new();
    if let Some(n) = settings.n_directions {
        let kind = settings.directions.as_ref().map_or("a set", kind);
        words.push(format!("{n} directions ({kind})"));
    }
    if let Some(part_itself) = &settings.part_itself {
        let fixtures = part_itself.fixtures.len();
        if fixtures > 0 {
            words.push(format!("{fixtures} fixture{}", if fixtures == 1 { "" } else { "s" }));
        }
        if let Some(z) = part_itself.table_z_mm {
            words.push(format!("table at z = {z} mm"));
        }
        if let Some(tolerance) = part_itself.tolerance_mm {
            words.push(format!("tolerance {tolerance} mm"));
        }
    }
    if let Some(Blocking::Points(Some(n))) = settings.obstacles {
        words.push(format!("{n} further obstacles"));
    }
    words.extend(settings.model.clone());
    match &settings.warnings_in_words()[..] {
        [] => {}
        [one] => words.push(format!("warning: {one}")),
        [first, rest @ ..] => words.push(format!("warning: {first} (and {} more)", rest.len())),
    }
    words.join("  ·  ")
}

/// The recipe's name, as files have it.
fn kind(set: &DirectionSet) -> &'static str {
    match set {
        DirectionSet::FibonacciHemisphere { .. } => "fibonacci-hemisphere",
        DirectionSet::Published => "published",
        DirectionSet::DeepMillPlusPlus => "deepmill++",
        DirectionSet::FibonacciSphere { .. } => "fibonacci-sphere",
        DirectionSet::LatLong { .. } => "lat-long",
        DirectionSet::Cone { .. } => "cone",
        DirectionSet::Circle { .. } => "circle",
        DirectionSet::List { .. } => "list",
    }
}

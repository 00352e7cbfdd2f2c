//! Parts made from nothing but a seed: closed, manifold, one body each, exactly repeatable.
//!
//! A family is a recipe with random sizes (millimetres): prisms, bodies of revolution, sweeps and
//! bent bodies, united and cut. What is drawn is accepted only if it is one sound body with a
//! longest box edge of 40–250 mm; otherwise it is drawn again from the next random stream.
//! A part takes milliseconds to some tens of milliseconds.
//!
//! ```
//! use deepmill::data::generated::{Family, part};
//! let mesh = part(Family::PocketBlock, 1, 0);
//! assert_eq!(mesh, part(Family::PocketBlock, 1, 0));
//! ```

mod blocks;
mod demo;
mod family;
mod finish;
mod freeform;
mod outline;
mod solid;
mod wheels;

pub use demo::demo_part;
pub use family::Family;

use crate::geom::Mesh;
use crate::rng::{Purpose, Stream};

/// Draws of one part before the recipe itself must be wrong.
const MAX_ATTEMPTS: u64 = 64;

/// Part number `index` of `family` in the series of `seed`; corners in mm, exact in f32.
///
/// The box is centred in x and y and stands on z = 0. Six parts in ten lie as drawn, main opening
/// mostly up, a quarter on another side, the rest are tilted anyhow.
///
/// # Panics
/// If a family's recipe fails 64 times in a row, which is a fault of this crate: the tests demand
/// that it fails rarely.
pub fn part(family: Family, seed: u64, index: u64) -> Mesh {
    attempts(family, seed, index).0
}

/// The part, and how many draws it took.
fn attempts(family: Family, seed: u64, index: u64) -> (Mesh, u64) {
    for attempt in 0..MAX_ATTEMPTS {
        let key = family as u64 * MAX_ATTEMPTS + attempt;
        let solid = family.draw(&mut Stream::new(seed, key, index, Purpose::Part));
        let turn = finish::orientation(&mut Stream::new(seed, key, index, Purpose::Orientation));
        if let Some(mesh) = finish::finish(&solid, &turn) {
            return (mesh, attempt + 1);
        }
    }
    panic!("{} {seed} {index}: no sound part in {MAX_ATTEMPTS} draws", family.name());
}

/// Any family, chosen evenly: part number `index` of a mixed series of `seed`.
pub fn mixed_part(seed: u64, index: u64) -> (Family, Mesh) {
    let family = mixed_family(index);
    (family, part(family, seed, index))
}

/// The family of part number `index` of a mixed series.
pub fn mixed_family(index: u64) -> Family {
    Family::ALL[(index % Family::ALL.len() as u64) as usize]
}

/// A whole number, uniform in `low..=high`.
fn whole(random: &mut Stream, low: usize, high: usize) -> usize {
    low + random.below(high - low + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_family_draws_sound_parts_without_many_attempts() {
        const N_SEEDS: u64 = 6;
        let drawn = crate::par::map(Family::ALL.len() * N_SEEDS as usize, |k| {
            let family = Family::ALL[k / N_SEEDS as usize];
            let (mesh, n_attempts) = attempts(family, 5, k as u64 % N_SEEDS);
            (family, mesh.triangles.len(), n_attempts)
        });
        for series in drawn.chunks(N_SEEDS as usize) {
            let total: u64 = series.iter().map(|s| s.2).sum();
            assert!(total <= 2 * N_SEEDS, "{}: {total} draws", series[0].0.name());
            assert!(series.iter().all(|s| (12..60_000).contains(&s.1)));
        }
    }

    #[test]
    fn names_are_unique_and_found_again() {
        for &family in Family::ALL {
            assert_eq!(Family::named(family.name()), Some(family));
        }
    }

    #[test]
    fn the_demo_part_is_the_one_described() {
        let mesh = demo_part();
        let (low, high) = mesh.bounds().unwrap();
        assert_eq!((high - low).to_array(), [100.0, 70.0, 40.0]);
        assert!(mesh.volume() > 1e5 && mesh.volume() < 2.4e5, "{}", mesh.volume());
    }
}

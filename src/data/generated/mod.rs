//! Generated parts: closed, manifold, one body each, a function of a seed alone.
//!
//! A family is a recipe with random sizes (millimeters): prisms, bodies of revolution, sweeps and
//! bent bodies, united and cut. What is drawn is accepted only if it is one sound body with a
//! longest box edge of 40–250 mm; otherwise it is drawn again from the next random stream.
//! A part takes milliseconds to some tens of milliseconds.
//!
//! ```
//! use deepmill::data::generated::{Family, part};
//! let mesh = part(Family::PocketBlock, 1, 0);
//! assert_eq!(mesh, part(Family::PocketBlock, 1, 0));
//! ```

mod blades;
mod blocks;
mod brackets;
mod demo;
mod family;
mod finish;
mod freeform;
mod grooves;
mod outline;
mod plates;
mod relief;
mod shells;
mod solid;
mod turned;
mod wheels;

pub use demo::demo_part;
pub use family::Family;

use crate::geom::Mesh;
use crate::numeric::rng::{Purpose, Stream};
use glam::DMat3;

/// Draws of one part before the recipe itself must be wrong.
const MAX_ATTEMPTS: u64 = 64;

/// How a part lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[doc(hidden)] // of the program
#[non_exhaustive]
pub enum Lie {
    /// As drawn: the main opening mostly up.
    AsDrawn,
    /// Six parts in ten as drawn, a quarter on another side, the rest rotated at random.
    Turned,
}

/// Part number `index` of `family` in the series of `seed`, lying as [`Lie::Turned`] says.
///
/// Corners are in mm and exact in f32; the box is centered in x and y and stands on z = 0.
///
/// # Panics
/// If a family's recipe fails 64 times in a row, which is a fault of this crate: the tests demand
/// that it fails rarely.
pub fn part(family: Family, seed: u64, index: u64) -> Mesh {
    part_lying(family, seed, index, Lie::Turned)
}

/// As [`part`], in the pose `lie`.
///
/// # Panics
/// As [`part`].
#[doc(hidden)] // of the program
pub fn part_lying(family: Family, seed: u64, index: u64, lie: Lie) -> Mesh {
    attempts(family, seed, index, lie).0
}

/// The family of part number `index` when the families take turns.
#[doc(hidden)] // of the program
pub fn family_of(index: u64) -> Family {
    Family::ALL[(index % Family::ALL.len() as u64) as usize]
}

/// Part number `index` of the series of `seed` in which the families take turns.
///
/// # Panics
/// As [`part`].
#[doc(hidden)] // of the program
pub fn mixed_part(seed: u64, index: u64) -> Mesh {
    part(family_of(index), seed, index)
}

/// The part, and how many draws it took.
fn attempts(family: Family, seed: u64, index: u64, lie: Lie) -> (Mesh, u64) {
    for attempt in 0..MAX_ATTEMPTS {
        let key = family as u64 * MAX_ATTEMPTS + attempt;
        let stream = |purpose| Stream::new(seed, key, index, purpose);
        let solid = family.draw(&mut stream(Purpose::Part));
        let turn = match lie {
            Lie::AsDrawn => DMat3::IDENTITY,
            Lie::Turned => finish::orientation(&mut stream(Purpose::Orientation)),
        };
        if let Some(mesh) = finish::finish(&solid, &turn) {
            return (mesh, attempt + 1);
        }
    }
    panic!("{} {seed} {index}: no sound part in {MAX_ATTEMPTS} draws", family.name());
}

/// A whole number, uniform in `low..=high`.
fn whole(random: &mut Stream, low: usize, high: usize) -> usize {
    low + random.below(high - low + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exec::par;
    use crate::geom::check::{self, Fault};

    const N_SEEDS: u64 = 3;

    /// Fingerprints recorded on x86-64 Linux; they may change only with a recipe.
    const PRINTS: [u64; 5] = [
        6632783550417426866,
        12202473149326995456,
        5869915689676340072,
        1470964683890633965,
        6666427967392978711,
    ];
    const DEMO_PRINT: u64 = 16453397318151876355;

    /// FNV-1a over the f32 bits of all corners and over the triangles.
    fn fingerprint(mesh: &Mesh) -> u64 {
        let corners = mesh.vertices.iter().flat_map(|v| v.as_vec3().to_array().map(f32::to_bits));
        let words = corners.chain(mesh.triangles.iter().flatten().copied());
        words.fold(0xcbf2_9ce4_8422_2325, |hash, word| {
            (hash ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3)
        })
    }

    #[test]
    fn every_family_draws_sound_parts_without_many_attempts() {
        let n_parts = Family::ALL.len() * N_SEEDS as usize;
        let drawn = par::map(n_parts, |k| {
            let family = Family::ALL[k / N_SEEDS as usize];
            attempts(family, k as u64 % N_SEEDS, 40, Lie::Turned)
        });
        for (k, series) in drawn.chunks(N_SEEDS as usize).enumerate() {
            let name = Family::ALL[k].name();
            let total: u64 = series.iter().map(|s| s.1).sum();
            assert!(total <= 3 * N_SEEDS, "{name}: {total} draws");
            for (mesh, _) in series {
                let report = check::check(mesh);
                assert!(report.blocking().is_none(), "{name}: {:?}", report.findings);
                assert_eq!(report.count(Fault::Degenerate), 0, "{name}");
                let exact = mesh.vertices.iter().all(|v| v.as_vec3().as_dvec3() == *v);
                assert!(exact && mesh.triangles.len() < 40_000, "{name}");
                let (low, high) = mesh.bounds().unwrap();
                assert!(low.z == 0.0 && (low + high).truncate().length() < 1e-3, "{name}");
            }
        }
        let total: u64 = drawn.iter().map(|d| d.1).sum();
        assert!(total * 5 <= 6 * n_parts as u64, "{total} draws for {n_parts} parts");
    }

    #[test]
    fn parts_have_the_same_bits_everywhere_and_on_any_number_of_threads() {
        let parts = [Family::Gear, Family::ValveBody, Family::Blisk, Family::Lump, Family::Maze];
        let prints = || par::map(parts.len(), |k| fingerprint(&part(parts[k], 11, 3)));
        let [one, three] = [1, 3].map(|n| par::with_threads(n, prints).unwrap());
        assert_eq!(one, three);
        assert_eq!(one, PRINTS);
        assert_eq!(fingerprint(&demo_part()), DEMO_PRINT);
    }

    #[test]
    fn parts_differ_by_family_seed_and_index() {
        let base = part(Family::TSlot, 1, 0);
        assert_ne!(base, part(Family::TSlot, 1, 1));
        assert_ne!(base, part(Family::TSlot, 2, 0));
        assert_ne!(base, part(Family::Dovetail, 1, 0));
        assert_eq!(mixed_part(1, 2), part(Family::ALL[2], 1, 2));
    }

    #[test]
    #[cfg(feature = "formats")]
    fn a_binary_stl_holds_a_part_exactly() {
        use crate::geom::formats::{ReadOptions, read_mesh, write_stl};
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("part.stl");
        for &family in &[Family::Enclosure, Family::Propeller, Family::Superquadric] {
            let mesh = part(family, 1, 0);
            write_stl(&path, &mesh).unwrap();
            let read = read_mesh(&path, &ReadOptions::default()).unwrap();
            let sides =
                |m: &Mesh| -> Vec<_> { (0..m.triangles.len()).map(|f| m.corners(f)).collect() };
            assert_eq!(read.vertices.len(), mesh.vertices.len());
            assert!(sides(&read) == sides(&mesh));
        }
    }

    #[test]
    fn names_are_unique_and_found_again() {
        for &family in Family::ALL {
            assert_eq!(family.to_string().parse::<Family>().unwrap(), family);
        }
        assert!("no such thing".parse::<Family>().is_err());
    }

    #[test]
    fn the_demo_part_is_the_one_described() {
        let mesh = demo_part();
        let (low, high) = mesh.bounds().unwrap();
        assert_eq!((high - low).to_array(), [100.0, 70.0, 40.0]);
        assert!(mesh.volume() > 1e5 && mesh.volume() < 2.4e5, "{}", mesh.volume());
        // A slot that is open at the top, as deep as described, and a roof over the T-slot.
        let has = |x: f64, z: f64| mesh.vertices.iter().any(|v| v.x == x && v.z == z);
        assert!(has(-44.0, 23.0) && has(-24.0, 14.0) && has(-30.0, 40.0));
        assert!(mesh.vertices.iter().any(|v| v.z == 8.0 && (v.y + 22.0).abs() < 2.0));
    }
}

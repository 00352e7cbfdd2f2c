//! The sets of parts of Table 1.

use super::parts::{Part, SEED};
use super::study::Study;
use deepmill::data::generated::{self, Family};
use deepmill::par;

/// Families of smooth parts that are curved both ways: CAD parts are of others.
const FREEFORM: [Family; 4] = [Family::Twisted, Family::Knot, Family::Lump, Family::Superquadric];
/// Families of complex parts.
const COMPLEX: [Family; 5] =
    [Family::Lattice, Family::Blisk, Family::Engraved, Family::Impeller, Family::HeatSink];
/// A complex part is the one with most triangles of so many draws, if there are as many parts.
const N_DRAWS: u64 = 8;
/// Most freeform parts.
const N_FREEFORM: usize = 12;

/// A test set. Its parts are in no training set; those of the second and third are of another series than the
/// training's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Set {
    /// Test parts of the study that are not freeform.
    Cad,
    /// Smooth parts.
    Freeform,
    /// Lattices, bladed, engraved and finned parts.
    Complex,
}

impl Set {
    pub const ALL: [Set; 3] = [Set::Cad, Set::Freeform, Set::Complex];

    pub fn name(self) -> &'static str {
        match self {
            Set::Cad => "CAD",
            Set::Freeform => "freeform",
            Set::Complex => "complex",
        }
    }

    /// Its parts.
    pub fn parts(self, study: &Study) -> Vec<Part> {
        let at_most = study.args.parts_count as usize;
        match self {
            Set::Cad => cad(study, study.test_parts()),
            Set::Freeform => {
                par::map(N_FREEFORM.min(at_most), |k| draw(FREEFORM[k % FREEFORM.len()], k as u64))
            }
            Set::Complex => {
                let n_draws = N_DRAWS.min(study.args.parts_count);
                par::map(COMPLEX.len().min(at_most), |k| most_complex(COMPLEX[k], n_draws))
            }
        }
    }
}

/// The training parts that are not freeform.
pub fn training_parts(study: &Study) -> Vec<Part> {
    cad(study, study.training_parts())
}

/// Those that are not freeform; the user's parts all count as CAD.
fn cad(study: &Study, parts: &[Part]) -> Vec<Part> {
    let is_freeform = |part: &Part| {
        let of = |family: &Family| part.name.starts_with(&format!("{family}-"));
        study.args.parts.is_empty() && FREEFORM.iter().any(of)
    };
    parts.iter().filter(|part| !is_freeform(part)).cloned().collect()
}

fn draw(family: Family, index: u64) -> Part {
    let mesh = generated::part(family, SEED + 1, index);
    Part { name: format!("{family}-{index:04}"), mesh }
}

/// The one with most triangles of some draws.
fn most_complex(family: Family, n_draws: u64) -> Part {
    let mut best = draw(family, 0);
    for part in (1..n_draws).map(|index| draw(family, index)) {
        if part.mesh.triangles.len() > best.mesh.triangles.len() {
            best = part;
        }
    }
    best
}

//! The network that comes with the crate; `shipped/README.md` says what it is.

use super::{Model, weights};
use crate::Result;
use std::path::Path;

/// Weights in bf16, as `deepmill weights --bf16` writes them, in two planes: behind the header the low bytes of all
/// numbers, then the high ones. Archives compress that better: 5.6 MB in place of 6.4.
const PLANES: &[u8] = include_bytes!("shipped/weights.planes");

impl Model<f32> {
    /// The network that comes with the crate: it answers by the mesh definition, for ball ends and machine parts of any
    /// size, in the ratios of [`Model::domain`], directions over the upper hemisphere. Its data, commands and scores
    /// are in `src/model/shipped/README.md`.
    ///
    /// # Errors
    /// Never, as long as the file in the crate belongs to this version; a test holds that.
    pub fn shipped() -> Result<Self> {
        let file = Self::shipped_file();
        weights::from_bytes(&file, Path::new("the network that comes with deepmill"))?.into_octree()
    }

    /// The safetensors file of [`Self::shipped`].
    #[doc(hidden)] // of the program
    #[must_use]
    pub fn shipped_file() -> Vec<u8> {
        join_planes(PLANES)
    }
}

/// Undoes the planes.
fn join_planes(file: &[u8]) -> Vec<u8> {
    let length =
        file.first_chunk().expect("a safetensors file begins with the length of its header");
    let (header, planes) = file.split_at(8 + u64::from_le_bytes(*length) as usize);
    let (low, high) = planes.split_at(planes.len() / 2);
    let numbers = low.iter().zip(high).flat_map(|(&low, &high)| [low, high]);
    header.iter().copied().chain(numbers).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answers::Definition;
    use crate::model::Calibration;
    use crate::tool::cutter::{CutterParams, CutterSet};
    use glam::Vec3;

    #[test]
    fn shipped_weights_are_small_and_belong_to_this_version() {
        assert!(PLANES.len() <= 8_000_000, "{} bytes", PLANES.len());
        let model = Model::shipped().unwrap();
        let cutter = CutterParams::from_array([1.5, 6.0, 40.0, 5.0]).to_array();
        let up = model.predict(&[Vec3::ZERO], &[Vec3::Z], cutter).unwrap();
        assert_eq!(up.logits_inaccessible.len(), 1);
    }

    /// The hash is in `shipped/README.md`, of the file before it was stored in planes.
    #[test]
    fn the_planes_give_back_every_byte_of_the_file() {
        let hash = hmac_sha256::Hash::hash(&Model::shipped_file());
        let hash: String = hash.iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(hash, "098c52d19f18eaa58e07c55a580bcfbbf15e07735a1943611a714152fdc93860");
        let header = "\x02\0\0\0\0\0\0\0{}";
        let joined = join_planes(format!("{header}acebdf").as_bytes());
        assert_eq!(joined, format!("{header}abcdef").as_bytes());
    }

    /// A disc of 47 mm and a ball of 12 mm on a part of 80 mm had wrong answers while sizes were not drawn in training.
    #[test]
    fn the_shipped_network_says_what_it_learned_and_where_it_does_not_hold() {
        let model = Model::shipped().unwrap();
        assert_eq!(model.definition, Some(Definition::Part));
        assert!(model.calibration.iter().all(|c| *c != Calibration::IDENTITY));
        let domain = *model.domain().unwrap();
        let corners = |edge: f32| [vec![Vec3::ZERO; 6999], vec![Vec3::splat(edge)]].concat();
        let outside = |edge, cr| {
            domain.outside(&corners(edge), CutterParams::from_array([cr, 6.0, 40.0, 5.0]))
        };
        for (edge, cr) in [(80.0, 1.5), (47.0, 1.5), (80.0, 6.0), (500.0, 1.5)] {
            assert_eq!(outside(edge, cr), [], "{edge} {cr}");
        }
        for set in CutterSet::PUBLISHED {
            let ends = |end: usize| CutterParams::from_array(set.ranges_mm().map(|r| r[end]));
            for (edge, cutter) in [(20.0, ends(0)), (20.0, ends(1)), (500.0, ends(0))] {
                assert_eq!(domain.outside(&corners(edge), cutter), [], "{set} {edge}");
            }
        }
        assert_eq!(outside(8.0, 1.5)[0].quantity, "CR");
        assert!(outside(80.0, 30.0)[0].is_far());
    }
}

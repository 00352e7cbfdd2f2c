//! The network that comes with the crate; `shipped/README.md` says what it is.

use super::{Model, weights};
use crate::Result;
use std::path::Path;

/// Weights in bf16, as `deepmill weights --bf16` writes them.
const FILE: &[u8] = include_bytes!("shipped/weights.safetensors");

impl Model<f32> {
    /// The network that comes with the crate: it answers by the mesh definition, for ball ends and machine parts of any size,
    /// in the ratios of [`Model::domain`], directions over the upper hemisphere. Its data, commands and scores are in
    /// `src/model/shipped/README.md`.
    ///
    /// # Errors
    /// Never, as long as the file in the crate belongs to this version; a test holds that.
    pub fn shipped() -> Result<Self> {
        weights::from_bytes(FILE, Path::new("the network that comes with deepmill"))?.into_octree()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answers::Definition;
    use crate::cutter::CutterParams;
    use crate::model::Calibration;
    use glam::Vec3;

    #[test]
    fn shipped_weights_are_small_and_belong_to_this_version() {
        assert!(FILE.len() <= 8_000_000, "{} bytes", FILE.len());
        let model = Model::shipped().unwrap();
        let cutter = CutterParams::from_array([1.5, 6.0, 40.0, 5.0]).to_array();
        let up = model.predict(&[Vec3::ZERO], &[Vec3::Z], cutter).unwrap();
        assert_eq!(up.logits_inaccessible.len(), 1);
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
        assert_eq!(outside(8.0, 1.5)[0].quantity, "CR");
        assert!(outside(80.0, 30.0)[0].is_far());
    }
}

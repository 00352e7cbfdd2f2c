//! The network that comes with the crate; `shipped/README.md` says what it is.

use super::{Domain, Model, weights};
use crate::Result;
use crate::answers::Definition;
use std::path::Path;

/// Weights in bf16, as `deepmill weights --bf16` writes them.
const FILE: &[u8] = include_bytes!("shipped/weights.safetensors");

/// Its cutters over the largest edges of its training parts, 80 to 1707 mm, which were written before files held a domain.
const DOMAIN: Domain = Domain {
    cutter: [
        [1.0 / 1707.0, 2.0 / 80.0],
        [0.1 / 1707.0, 10.1 / 80.0],
        [5.0 / 1707.0, 100.0 / 80.0],
        [0.1 / 1707.0, 10.1 / 80.0],
    ],
    thinness: [0.0468, 1.0],
    n_sites: [7000.0; 2],
};

impl Model<f32> {
    /// The network that comes with the crate, trained on machine parts with ball-end cutters drawn as in
    /// the paper, directions over the upper hemisphere. Its data, commands and scores are in
    /// `src/model/shipped/README.md`.
    ///
    /// # Errors
    /// Never, as long as the file in the crate belongs to this version; a test holds that.
    pub fn shipped() -> Result<Self> {
        let mut model =
            weights::from_bytes(FILE, Path::new("the network that comes with deepmill"))?;
        model.domain.get_or_insert(DOMAIN);
        model.definition.get_or_insert(Definition::Sites);
        Ok(model)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutter::CutterParams;
    use glam::Vec3;

    #[test]
    fn shipped_weights_are_small_and_belong_to_this_version() {
        assert!(FILE.len() <= 8_000_000, "{} bytes", FILE.len());
        let model = Model::shipped().unwrap();
        let cutter = CutterParams::from_array([1.5, 6.0, 40.0, 5.0]).to_array();
        let up = model.predict(&[Vec3::ZERO], &[Vec3::Z], cutter).unwrap();
        assert_eq!(up.logits_inaccessible.len(), 1);
    }

    /// A disc of 47 mm and a ball of 12 mm on a part of 80 mm, both with wrong answers in the past.
    #[test]
    fn the_shipped_network_says_where_it_does_not_hold() {
        let domain = *Model::shipped().unwrap().domain().unwrap();
        let corners = |edge: f32| [vec![Vec3::ZERO; 6999], vec![Vec3::splat(edge)]].concat();
        let outside = |edge, cr| {
            domain.outside(&corners(edge), CutterParams::from_array([cr, 6.0, 40.0, 5.0]))
        };
        assert!(outside(80.0, 1.5).is_empty() && outside(1000.0, 1.5).is_empty());
        assert_eq!(outside(47.0, 1.5)[0].quantity, "CR");
        assert!(outside(80.0, 6.0)[0].is_far());
    }
}

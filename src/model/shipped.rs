//! The network that comes with the crate; `shipped/README.md` says what it is.

use super::{Model, weights};
use crate::Result;
use std::path::Path;

/// Weights in bf16, as `deepmill weights --bf16` writes them.
const FILE: &[u8] = include_bytes!("shipped/weights.safetensors");

impl Model<f32> {
    /// The network that comes with the crate, trained on machine parts with ball-end cutters drawn as in
    /// the paper, directions over the upper hemisphere. Its data, commands and scores are in
    /// `src/model/shipped/README.md`.
    ///
    /// # Errors
    /// Never, as long as the file in the crate belongs to this version; a test holds that.
    pub fn shipped() -> Result<Self> {
        weights::from_bytes(FILE, Path::new("the network that comes with deepmill"))
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
}

//! What the network learns from: one part's sites, one cutter, and the labels of both heads.

use crate::cutter::CutterParams;
use crate::geom::Sites;
use crate::{Error, Result};
use std::sync::Arc;

/// One training or test example. Sites are shared between the cutters of a part.
#[derive(Debug, Clone)]
pub struct Sample {
    /// Name of the part.
    pub name: String,
    /// Sites of the part, mm.
    pub sites: Arc<Sites>,
    /// The cutter, mm.
    pub cutter: CutterParams,
    /// Head 1, per site: the cutter collides in every direction.
    pub inaccessible: Vec<bool>,
    /// Head 2, per site: among those most often in the way.
    pub occlusion: Vec<bool>,
}

impl Sample {
    /// Checks that every vector has one entry per site.
    ///
    /// # Errors
    /// Names the sample and the vector that is too short or too long.
    pub fn check(&self) -> Result<()> {
        let n = self.sites.len();
        let lengths = [
            ("normals", self.sites.normals.len()),
            ("inaccessible", self.inaccessible.len()),
            ("occlusion", self.occlusion.len()),
        ];
        match lengths.iter().find(|(_, len)| *len != n) {
            _ if n == 0 => Err(Error::geometry(
                format!("sample {}", self.name),
                "it has no sites",
                "leave it out of the data set",
            )),
            Some((what, len)) => Err(Error::geometry(
                format!("sample {}", self.name),
                format!("{len} {what} for {n} sites"),
                "build the data set again",
            )),
            None => Ok(()),
        }
    }
}

/// Where training draws its samples: a fixed list, or one that makes them on the spot.
pub trait Source: Sync {
    /// Samples per epoch.
    fn len(&self) -> usize;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Sample `index` of `epoch`. The same arguments always give the same sample.
    ///
    /// # Errors
    /// If the sample cannot be made or read.
    fn sample(&self, epoch: u64, index: usize) -> Result<Sample>;
}

impl Source for [Sample] {
    fn len(&self) -> usize {
        <[Sample]>::len(self)
    }

    fn sample(&self, _epoch: u64, index: usize) -> Result<Sample> {
        Ok(self[index].clone())
    }
}

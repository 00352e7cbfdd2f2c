//! Reading answers: lists of one length, and only names that this crate writes.

use super::{OutsideDomain, QUANTITIES, SiteAnswers};
use crate::{Error, Result};
use glam::Vec3;
use serde::{Deserialize, Deserializer, de};

/// [`SiteAnswers`] as they are read.
#[derive(Deserialize, Default)]
#[serde(default, rename = "SiteAnswers")]
pub(super) struct Unchecked {
    inaccessible: Vec<bool>,
    occlusion: Vec<bool>,
    tip_does_not_fit: Vec<bool>,
    accessible_directions: Vec<u32>,
    accessible_share: Vec<f32>,
    witness: Vec<Option<Vec3>>,
    clearance_mm: Vec<f32>,
    rest_mm: Vec<f32>,
    rest_volume_mm3: Vec<f32>,
    probability_inaccessible: Vec<f32>,
    probability_occlusion: Vec<f32>,
    outside_domain: Vec<OutsideDomain>,
}

impl TryFrom<Unchecked> for SiteAnswers {
    type Error = Error;

    /// # Errors
    /// If a list about sites is neither empty nor as long as `inaccessible`, a share or probability is not from 0 to 1,
    /// or a witness is no unit vector.
    fn try_from(read: Unchecked) -> Result<Self> {
        let n = read.inaccessible.len();
        for (name, len) in [
            ("tip_does_not_fit", read.tip_does_not_fit.len()),
            ("accessible_directions", read.accessible_directions.len()),
            ("accessible_share", read.accessible_share.len()),
            ("witness", read.witness.len()),
            ("clearance_mm", read.clearance_mm.len()),
            ("rest_mm", read.rest_mm.len()),
            ("rest_volume_mm3", read.rest_volume_mm3.len()),
            ("probability_inaccessible", read.probability_inaccessible.len()),
            ("probability_occlusion", read.probability_occlusion.len()),
        ] {
            check_length(name, len, n)?;
        }
        for (name, list) in [
            ("accessible_share", &read.accessible_share),
            ("probability_inaccessible", &read.probability_inaccessible),
            ("probability_occlusion", &read.probability_occlusion),
        ] {
            if let Some(found) = list.iter().find(|share| !(0.0..=1.0).contains(*share)) {
                return Err(Error::argument(name, found, "0 to 1", WRITE_AGAIN));
            }
        }
        for (name, list, expected) in [
            ("rest_mm", &read.rest_mm, "0 mm or more"),
            ("rest_volume_mm3", &read.rest_volume_mm3, "0 mm³ or more"),
        ] {
            if let Some(found) = list.iter().find(|rest| !(0.0..f32::INFINITY).contains(*rest)) {
                return Err(Error::argument(name, found, expected, WRITE_AGAIN));
            }
        }
        if let Some(found) = read.witness.iter().flatten().find(|w| !w.is_normalized()) {
            return Err(Error::argument("witness", found, "unit vectors", WRITE_AGAIN));
        }
        Ok(SiteAnswers {
            inaccessible: read.inaccessible,
            occlusion: read.occlusion,
            tip_does_not_fit: read.tip_does_not_fit,
            accessible_directions: read.accessible_directions,
            accessible_share: read.accessible_share,
            witness: read.witness,
            clearance_mm: read.clearance_mm,
            rest_mm: read.rest_mm,
            rest_volume_mm3: read.rest_volume_mm3,
            probability_inaccessible: read.probability_inaccessible,
            probability_occlusion: read.probability_occlusion,
            outside_domain: read.outside_domain,
        })
    }
}

const WRITE_AGAIN: &str = "write the answers again";

/// Passes lists about `n` sites.
fn check_length(name: &'static str, len: usize, n: usize) -> Result<()> {
    if len == 0 || len == n {
        return Ok(());
    }
    let found = format!("a list of {len}");
    Err(Error::argument(name, found, format!("none, or {n} as answers"), WRITE_AGAIN))
}

/// By hand: a derived one would ask for names that live forever in what is read.
impl<'de> Deserialize<'de> for OutsideDomain {
    fn deserialize<D: Deserializer<'de>>(from: D) -> std::result::Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(rename = "OutsideDomain")]
        struct Unchecked {
            quantity: String,
            value: f64,
            range: [f64; 2],
        }
        let Unchecked { quantity, value, range } = Unchecked::deserialize(from)?;
        let known = QUANTITIES.into_iter().find(|known| *known == quantity);
        let unknown = || de::Error::unknown_variant(&quantity, &QUANTITIES);
        Ok(OutsideDomain { quantity: known.ok_or_else(unknown)?, value, range })
    }
}

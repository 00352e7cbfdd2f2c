//! Answers as they are written and read: lists of one length, and only names that this crate writes.

use super::{NetworkEvidence, OutsideDomain, QUANTITIES, SiteAnswer, SiteAnswers};
use crate::{Error, Result};
use glam::Vec3;
use serde::ser::SerializeStruct;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

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
        let network = NetworkEvidence {
            probability_inaccessible: read.probability_inaccessible,
            probability_occlusion: read.probability_occlusion,
            outside_domain: read.outside_domain,
        };
        Ok(SiteAnswers {
            of_sites: of_sites(&read.inaccessible, &read.tip_does_not_fit),
            tests_tip: !read.tip_does_not_fit.is_empty(),
            occlusion: read.occlusion,
            accessible_directions: read.accessible_directions,
            accessible_share: read.accessible_share,
            witness: read.witness,
            clearance_mm: read.clearance_mm,
            rest_mm: read.rest_mm,
            rest_volume_mm3: read.rest_volume_mm3,
            network: Some(network).filter(|network| *network != NetworkEvidence::default()),
        })
    }
}

/// Answers as files have them, of flags of which one at most is set; of the tip's there may be none.
pub(crate) fn of_sites(inaccessible: &[bool], tip_does_not_fit: &[bool]) -> Vec<SiteAnswer> {
    let tip = |i: usize| tip_does_not_fit.get(i).copied().unwrap_or(false);
    let answer = |(i, &inaccessible): (usize, &bool)| match (inaccessible, tip(i)) {
        (false, true) => SiteAnswer::TipDoesNotFit,
        (inaccessible, _) => SiteAnswer::of(inaccessible),
    };
    inaccessible.iter().enumerate().map(answer).collect()
}

/// As they are read again: the answers as flags, every list by its name.
impl Serialize for SiteAnswers {
    fn serialize<S: Serializer>(&self, to: S) -> std::result::Result<S::Ok, S::Error> {
        let none = NetworkEvidence::default();
        let network = self.network.as_ref().unwrap_or(&none);
        let mut fields = to.serialize_struct("SiteAnswers", 12)?;
        fields.serialize_field("inaccessible", &self.inaccessible())?;
        fields.serialize_field("occlusion", &self.occlusion)?;
        fields.serialize_field("tip_does_not_fit", &self.tip_does_not_fit())?;
        fields.serialize_field("accessible_directions", &self.accessible_directions)?;
        fields.serialize_field("accessible_share", &self.accessible_share)?;
        fields.serialize_field("witness", &self.witness)?;
        fields.serialize_field("clearance_mm", &self.clearance_mm)?;
        fields.serialize_field("rest_mm", &self.rest_mm)?;
        fields.serialize_field("rest_volume_mm3", &self.rest_volume_mm3)?;
        fields.serialize_field("probability_inaccessible", &network.probability_inaccessible)?;
        fields.serialize_field("probability_occlusion", &network.probability_occlusion)?;
        fields.serialize_field("outside_domain", &network.outside_domain)?;
        fields.end()
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

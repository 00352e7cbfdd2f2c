//! The answers of an engine, labeler or network, for the sites of one part and one cutter.
//!
//! The exact labeler ([`access::Labeler`](crate::access::Labeler)) and the network
//! ([`model::Predictor`](crate::model::Predictor)) take the same [`Sites`](crate::geom::Sites) and the same
//! [`Cutter`](crate::tool::cutter::Cutter), and both return [`SiteAnswers`]. `true` is always the positive class:
//! *inaccessible*, *occlusion point*.

#[cfg(feature = "approx")]
mod approximate;
mod checked;
mod share_limit;
mod site;
mod spot_check;

pub(crate) use checked::of_sites;
pub use site::{NetworkEvidence, SiteAnswer, SiteAnswers};
pub use spot_check::SpotCheck;
#[doc(hidden)] // of files and of evaluation
pub use spot_check::{CONFIDENCE, SpotChecked};

use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;
use std::fmt;
use std::str::FromStr;

/// By which definition answers are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Definition {
    /// The published one: the sites are the obstacles, see [`access::label`](crate::access::label()).
    Sites,
    /// The mesh definition: the part's triangles are the obstacles, see [`access::surface`](crate::access::surface).
    Part,
    /// The published definition for points of the space around the part, see [`data::volume`](crate::data::volume).
    SitesInSpace,
    /// The mesh definition, for points of the space around it.
    PartInSpace,
}

impl Definition {
    /// All of them.
    pub const ALL: [Definition; 4] =
        [Definition::Sites, Definition::Part, Definition::SitesInSpace, Definition::PartInSpace];

    /// Whether triangles are the obstacles.
    pub fn is_by_mesh(self) -> bool {
        matches!(self, Definition::Part | Definition::PartInSpace)
    }

    /// Whether it is about points of space, not of the surface.
    pub fn is_in_space(self) -> bool {
        matches!(self, Definition::SitesInSpace | Definition::PartInSpace)
    }
}

impl fmt::Display for Definition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Definition::Sites => "published definition, points as obstacles",
            Definition::Part => "mesh definition",
            Definition::SitesInSpace => "published definition, points as obstacles, in space",
            Definition::PartInSpace => "mesh definition, in space",
        })
    }
}

/// One number that is not among those of a network's [`Domain`](crate::model::Domain).
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct OutsideDomain {
    /// What it measures.
    pub quantity: &'static str,
    /// The number.
    pub value: f64,
    /// Least and greatest in training.
    pub range: [f64; 2],
}

/// Beyond this factor outside of its range a number is far outside.
const FAR: f64 = 2.0;
/// The one quantity that is not a length.
pub(crate) const N_SITES: &str = "number of sites";
/// All of them, in the order of the ranges of a network's domain.
pub(crate) const QUANTITIES: [&str; 6] = ["CR", "CH", "FR", "FH", "smallest edge", N_SITES];

impl OutsideDomain {
    pub(crate) fn is_outside(&self) -> bool {
        !(self.range[0]..=self.range[1]).contains(&self.value)
    }

    /// Whether it is a count and no length.
    pub(crate) fn is_count(&self) -> bool {
        self.quantity == N_SITES
    }

    pub(crate) fn is_below_half(&self) -> bool {
        self.value < self.range[0] / FAR
    }

    /// Whether the number is beyond twice the greatest or below half of the least.
    pub fn is_far(&self) -> bool {
        !(self.range[0] / FAR..=self.range[1] * FAR).contains(&self.value)
    }
}

impl fmt::Display for OutsideDomain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let OutsideDomain { quantity, value, range: [least, greatest] } = self;
        let unit = if self.is_count() { "" } else { " of the largest edge" };
        let short = |x: &f64| (x * 1e4).round() / 1e4;
        let [value, least, greatest] = [value, least, greatest].map(short);
        write!(f, "{quantity} is {value}{unit}, trained ")?;
        match self.is_count() && least == greatest {
            true => write!(f, "with {least}"),
            false => write!(f, "from {least} to {greatest}"),
        }
    }
}

fn check_bound(bound: f64) -> Result<()> {
    if (0.0..=1.0).contains(&bound) {
        return Ok(());
    }
    let remedy = "give a share such as 0.01";
    Err(Error::argument("bound of the error", bound, "0 to 1", remedy))
}

fn check_probabilities(probabilities: &[f32], n: usize) -> Result<()> {
    let sound = probabilities.iter().filter(|p| (0.0..=1.0).contains(*p)).count();
    if sound == n && probabilities.len() == n {
        return Ok(());
    }
    let expected = format!("{n} probabilities, one per site");
    let remedy = "verify the answers of a network";
    Err(Error::argument("predicted answers", sound, expected, remedy))
}

/// Whether the positive class has the greater logit; equal logits mean "no".
pub(crate) fn is_positive<T: PartialOrd>([no, yes]: [T; 2]) -> bool {
    yes > no
}

/// Marks the `ceil(share·n)` greatest values by `compare`, lower index first among equals.
///
/// `share` is in [0, 1]; a product within 1e-9 above a whole number counts as that number.
pub(crate) fn mark_top_share<T>(
    values: &[T],
    share: f64,
    compare: impl Fn(&T, &T) -> Ordering,
) -> Vec<bool> {
    mark_top(values, n_of_share(share, values.len()), compare)
}

/// Marks the `wanted` greatest values by `compare`, lower index first among equals.
pub(crate) fn mark_top<T>(
    values: &[T],
    wanted: usize,
    compare: impl Fn(&T, &T) -> Ordering,
) -> Vec<bool> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    if wanted < order.len() {
        let rank = |&a: &usize, &b: &usize| compare(&values[b], &values[a]).then(a.cmp(&b));
        order.select_nth_unstable_by(wanted, rank);
        order.truncate(wanted);
    }
    let mut marks = vec![false; values.len()];
    order.into_iter().for_each(|i| marks[i] = true);
    marks
}

/// How a share of a number of sites becomes a whole number. A product within 1e-9 of a whole number counts as that
/// number.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Rounding {
    /// Up: the text of the paper.
    #[default]
    Ceil,
    /// Down: the published data.
    Floor,
}

impl Rounding {
    /// Both.
    pub const ALL: [Rounding; 2] = [Rounding::Ceil, Rounding::Floor];

    /// `ceil` or `floor`.
    pub fn name(self) -> &'static str {
        match self {
            Rounding::Ceil => "ceil",
            Rounding::Floor => "floor",
        }
    }

    /// `share·n` as a whole number.
    ///
    /// # Panics
    /// If `share` is not in [0, 1].
    ///
    /// ```
    /// use deepmill::answers::Rounding;
    /// assert_eq!([Rounding::Ceil, Rounding::Floor].map(|r| r.n_of_share(0.1, 4948)), [495, 494]);
    /// assert_eq!([Rounding::Ceil, Rounding::Floor].map(|r| r.n_of_share(0.1, 30)), [3, 3]);
    /// ```
    pub fn n_of_share(self, share: f64, n: usize) -> usize {
        assert!((0.0..=1.0).contains(&share), "a share of {share}");
        match self {
            Rounding::Ceil => (share * n as f64 - 1e-9).ceil().max(0.0) as usize,
            Rounding::Floor => (share * n as f64 + 1e-9).floor().max(0.0) as usize,
        }
    }
}

impl fmt::Display for Rounding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Reads a [name](Rounding::name).
impl FromStr for Rounding {
    type Err = Error;

    /// # Errors
    /// If neither has it.
    fn from_str(name: &str) -> Result<Self> {
        Rounding::ALL.into_iter().find(|rounding| rounding.name() == name).ok_or_else(|| {
            let remedy = "floor is the published definition";
            Error::argument("rounding", format!("`{name}`"), "ceil or floor", remedy)
        })
    }
}

/// [`Rounding::Ceil`] of a share.
pub(crate) fn n_of_share(share: f64, n: usize) -> usize {
    Rounding::Ceil.n_of_share(share, n)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ties_go_to_the_lower_index_and_rounding_is_forgiven() {
        let marked = |values: &[i32], share| mark_top_share(values, share, i32::cmp);
        assert_eq!(marked(&[3, 9, 9, 1], 0.5), [false, true, true, false]);
        assert_eq!(marked(&[9, 9, 9, 9, 9], 0.3), [true, true, false, false, false]);
        assert_eq!(marked(&[1; 30], 0.1).iter().filter(|m| **m).count(), 3);
        assert_eq!(marked(&[], 0.1), [false; 0]);
        assert_eq!(marked(&[1, 2], 0.0), [false; 2]);
        assert_eq!(marked(&[1, 2], 1.0), [true; 2]);
    }

    #[test]
    fn one_tie_rule_for_both_heads() {
        assert!(is_positive([0.0, 1e-9]) && !is_positive([0.5, 0.5]) && !is_positive([1.0, 0.5]));
        assert!(!is_positive([f32::NAN, 1.0]));
    }
}

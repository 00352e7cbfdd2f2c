//! The answers of an engine, labeler or network, for the sites of one part and one cutter.
//!
//! The exact labeler ([`access::Labeler`](crate::access::Labeler)) and the network
//! ([`model::Predictor`](crate::model::Predictor)) take the same [`Sites`] and the same
//! [`Cutter`](crate::cutter::Cutter), and both return [`SiteAnswers`]. `true` is always the positive class:
//! *inaccessible*, *occlusion point*.

#[cfg(feature = "approx")]
mod approximate;
mod checked;
mod share_limit;
mod spot_check;

pub use spot_check::SpotCheck;
#[doc(hidden)] // of files and of evaluation
pub use spot_check::{CONFIDENCE, SpotChecked};

use crate::geom::{Sites, spacing};
use crate::{Error, Result};
use glam::Vec3;
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

/// Answers per site, in the order of the sites. A list is empty if the engine does not compute it, or its option
/// is off; otherwise it has one entry per site, which is checked when it is deserialized.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "checked::Unchecked")]
#[non_exhaustive]
pub struct SiteAnswers {
    /// The cutter collides in every direction.
    pub inaccessible: Vec<bool>,
    /// Among the sites that most often collide with the cutter where it stands at inaccessible ones. (One entry per
    /// obstacle that is ranked, where the labeler ranks others than the sites: see
    /// [`Obstacles`](crate::access::Obstacles).)
    pub occlusion: Vec<bool>,
    /// In some direction only the tip penetrates the part, in none nothing does; answered by the mesh definition alone.
    pub tip_does_not_fit: Vec<bool>,
    /// Number of directions in which the cutter has a free pose there: without collision and, by the mesh definition,
    /// with a tip that fits.
    pub accessible_directions: Vec<u32>,
    /// Share of the directions in which the cutter has a free pose there, in [0, 1]: counted among those tested, or the
    /// answer of a network with a head for it.
    pub accessible_share: Vec<f32>,
    /// A direction in which the cutter has a free pose there, a unit vector from tip to spindle.
    pub witness: Vec<Option<Vec3>>,
    /// How far every height and radius of the cutter may grow before the site becomes inaccessible (positive), or must
    /// shrink before it becomes accessible (negative), mm, within the limit of the options. `docs/labeling.md` has the
    /// formula.
    pub clearance_mm: Vec<f32>,
    /// How much the tool leaves there: distance along the normal to the surface of what it leaves, mm; 0 where it is
    /// accessible. `docs/rest.md` has the definition.
    pub rest_mm: Vec<f32>,
    /// Volume of what is left nearer to the site than to others, mm³; `docs/rest.md` has the definition.
    pub rest_volume_mm3: Vec<f32>,
    /// Probability of `inaccessible`, from a network.
    pub probability_inaccessible: Vec<f32>,
    /// Probability of `occlusion`, from a network.
    pub probability_occlusion: Vec<f32>,
    /// What of the part and the cutter the network was not trained for: its answers may be wrong there.
    pub outside_domain: Vec<OutsideDomain>,
}

impl SiteAnswers {
    /// The two answers that a network learns; the other lists are empty.
    pub fn new(inaccessible: Vec<bool>, occlusion: Vec<bool>) -> Self {
        SiteAnswers { inaccessible, occlusion, ..SiteAnswers::default() }
    }

    /// Number of sites.
    pub fn len(&self) -> usize {
        self.inaccessible.len()
    }

    /// Whether there are no sites.
    pub fn is_empty(&self) -> bool {
        self.inaccessible.is_empty()
    }

    /// Number of inaccessible sites.
    pub fn n_inaccessible(&self) -> usize {
        count(&self.inaccessible)
    }

    /// Number of occlusion points.
    pub fn n_occlusion(&self) -> usize {
        count(&self.occlusion)
    }

    /// Per site: not inaccessible, and the tip fits, where that was tested.
    pub fn accessible(&self) -> Vec<bool> {
        let tip = |i: usize| self.tip_does_not_fit.get(i).copied().unwrap_or(false);
        (0..self.len()).map(|i| !self.inaccessible[i] && !tip(i)).collect()
    }

    /// With the shares of accessible directions, of which `n_directions` were tested.
    pub(crate) fn with_shares_of(mut self, n_directions: usize) -> Self {
        let share = |&n: &u32| (f64::from(n) / n_directions.max(1) as f64) as f32;
        self.accessible_share = self.accessible_directions.iter().map(share).collect();
        self
    }

    pub(crate) fn check_sites(&self, sites: &Sites) -> Result<()> {
        if sites.len() == self.len() {
            return Ok(());
        }
        let (found, expected) = (sites.len(), format!("{}, as many as answers", self.len()));
        let remedy = "give the sites that the answers are about";
        Err(Error::argument("number of sites", found, expected, remedy))
    }

    /// The sites whose predicted answer *occlusion* is least certain, in their order: the fewest of greatest
    /// `u = min(p, 1 − p)` such that the mean of `u` over all others, the share of wrong answers to expect if the
    /// probabilities are calibrated, is at most `bound`. Among equals the higher index is left out. All of them for a
    /// `bound` of 0.
    ///
    /// # Errors
    /// If `bound` is not in [0, 1], or there is not one probability in [0, 1] per site.
    ///
    /// ```
    /// use deepmill::answers::SiteAnswers;
    /// let mut answers = SiteAnswers::new(vec![true, false, false, true], vec![]);
    /// answers.probability_occlusion = vec![0.98, 0.4, 0.0, 0.55];
    /// assert_eq!(answers.least_certain_occlusion(0.01)?, [1, 3]);
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    pub fn least_certain_occlusion(&self, bound: f64) -> Result<Vec<usize>> {
        least_certain(&self.probability_occlusion, self.len(), bound)
    }

    /// Share of the surface that is inaccessible: every site counts by the area it stands for, estimated from the
    /// distances to its neighbors. `sites` are those of the answers.
    ///
    /// # Errors
    /// If the sites fail [`Sites::check`], or are not as many as the answers.
    ///
    /// ```
    /// use deepmill::{answers::SiteAnswers, geom::Sites};
    /// use deepmill::glam::Vec3;
    /// let points = (0..100).map(|i| Vec3::new((i % 10) as f32, (i / 10) as f32, 0.0)).collect();
    /// let sites = Sites::new(points, vec![Vec3::Z; 100])?;
    /// let answers = SiteAnswers::new((0..100).map(|i| i < 50).collect(), vec![]);
    /// assert!((answers.inaccessible_area_share(&sites)? - 0.5).abs() < 0.01);
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    pub fn inaccessible_area_share(&self, sites: &Sites) -> Result<f64> {
        self.check_sites(sites)?;
        let areas = spacing::relative_areas(sites)?;
        let total: f64 = areas.iter().sum();
        let marked = areas.iter().zip(&self.inaccessible).filter(|(_, marked)| **marked);
        // A sum of nothing is -0.
        let marked = marked.fold(0.0, |sum, (area, _)| sum + area);
        Ok(if total > 0.0 { marked / total } else { 0.0 })
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

fn least_certain(probabilities: &[f32], n: usize, bound: f64) -> Result<Vec<usize>> {
    check_bound(bound)?;
    check_probabilities(probabilities, n)?;
    if bound == 0.0 {
        return Ok((0..n).collect());
    }
    let uncertainty = |i: &usize| probabilities[*i].min(1.0 - probabilities[*i]);
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|a, b| uncertainty(a).total_cmp(&uncertainty(b)).then(b.cmp(a)));
    let (mut sum, mut n_kept) = (0.0, 0);
    for i in &order {
        sum += f64::from(uncertainty(i));
        if sum > bound * (n_kept + 1) as f64 {
            break;
        }
        n_kept += 1;
    }
    let mut chosen = order.split_off(n_kept);
    chosen.sort_unstable();
    Ok(chosen)
}

fn count(marks: &[bool]) -> usize {
    marks.iter().filter(|marked| **marked).count()
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

    #[test]
    fn what_the_tip_cannot_reach_is_not_accessible() {
        let mut answers = SiteAnswers::new(vec![true, false, false], vec![]);
        assert_eq!(answers.accessible(), [false, true, true]);
        answers.tip_does_not_fit = vec![false, false, true];
        assert_eq!(answers.accessible(), [false, true, false]);
    }

    #[test]
    fn area_shares_ask_for_the_sites_of_the_answers() {
        let sites = Sites::new(vec![Vec3::X], vec![Vec3::Z]).unwrap();
        let error = SiteAnswers::default().inaccessible_area_share(&sites).unwrap_err();
        assert!(error.to_string().contains("as many as answers"), "{error}");
    }
}

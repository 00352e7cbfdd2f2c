//! The answer for a site, and the answers for all sites of a part.

use super::{OutsideDomain, check_bound, check_probabilities, checked};
use crate::geom::{Sites, spacing};
use crate::{Error, Result};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// The answer for one site.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum SiteAnswer {
    /// In some direction no step penetrates the part, and the tip fits.
    Accessible,
    /// In every direction some step (shank, holder or spindle) penetrates the part.
    Inaccessible,
    /// In some direction no step penetrates the part, but in all of these the tip does.
    TipDoesNotFit,
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

#[cfg(test)]
mod tests {
    use super::*;

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

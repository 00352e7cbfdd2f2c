//! The answer for a site, and the answers for all sites of a part.

use super::{OutsideDomain, check_bound, check_probabilities, checked};
use crate::geom::{Sites, spacing};
use crate::{Error, Result};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// The answer for one site. By the published definition a step penetrates the part if another site is in it, and the
/// tip is not tested.
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

impl SiteAnswer {
    /// Of what an engine without regard to the tip answers.
    pub(crate) fn of(inaccessible: bool) -> Self {
        if inaccessible { SiteAnswer::Inaccessible } else { SiteAnswer::Accessible }
    }
}

/// Answers per site, in the order of the sites, with the evidence for them. A list of evidence is empty if the engine
/// does not compute it, or its option is off; otherwise it has one entry per site, which is checked when it is
/// deserialized.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(try_from = "checked::Unchecked")]
pub struct SiteAnswers {
    pub(crate) of_sites: Vec<SiteAnswer>,
    /// Whether the tip was tested: by the mesh definition alone.
    pub(crate) tests_tip: bool,
    pub(crate) occlusion: Vec<bool>,
    pub(crate) accessible_directions: Vec<u32>,
    pub(crate) accessible_share: Vec<f32>,
    pub(crate) witness: Vec<Option<Vec3>>,
    pub(crate) clearance_mm: Vec<f32>,
    pub(crate) rest_mm: Vec<f32>,
    pub(crate) rest_volume_mm3: Vec<f32>,
    pub(crate) network: Option<NetworkEvidence>,
}

/// What a network gives beside its answers.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct NetworkEvidence {
    /// Per site: probability that it is inaccessible.
    pub probability_inaccessible: Vec<f32>,
    /// Per site: probability that it is an occlusion point.
    pub probability_occlusion: Vec<f32>,
    /// What of the part and the cutter the network was not trained for: its answers may be wrong there.
    pub outside_domain: Vec<OutsideDomain>,
}

impl NetworkEvidence {
    /// Probabilities of a network in whose domain part and cutter are.
    pub fn new(probability_inaccessible: Vec<f32>, probability_occlusion: Vec<f32>) -> Self {
        let outside_domain = Vec::new();
        NetworkEvidence { probability_inaccessible, probability_occlusion, outside_domain }
    }
}

impl SiteAnswers {
    /// The two answers that a network learns, without evidence.
    pub fn new(inaccessible: Vec<bool>, occlusion: Vec<bool>) -> Self {
        let of_sites = inaccessible.into_iter().map(SiteAnswer::of).collect();
        SiteAnswers { of_sites, occlusion, ..SiteAnswers::default() }
    }

    /// Answers by the mesh definition, without evidence.
    pub fn by_mesh(of_sites: Vec<SiteAnswer>) -> Self {
        let tests_tip = !of_sites.is_empty();
        SiteAnswers { of_sites, tests_tip, ..SiteAnswers::default() }
    }

    /// The answer for a site.
    ///
    /// # Panics
    /// If there are not so many sites.
    pub fn of(&self, site: usize) -> SiteAnswer {
        self.of_sites[site]
    }

    /// The answer for every site.
    pub fn of_sites(&self) -> &[SiteAnswer] {
        &self.of_sites
    }

    /// Number of sites.
    pub fn len(&self) -> usize {
        self.of_sites.len()
    }

    /// Whether there are no sites.
    pub fn is_empty(&self) -> bool {
        self.of_sites.is_empty()
    }

    /// Whether it was tested if the tip fits: by the mesh definition.
    pub fn tests_tip(&self) -> bool {
        self.tests_tip
    }

    /// Per site: the cutter collides in every direction.
    pub fn inaccessible(&self) -> Vec<bool> {
        self.are(SiteAnswer::Inaccessible)
    }

    /// Per site: in some direction only the tip penetrates the part, in none nothing does; empty if that was not
    /// [tested](SiteAnswers::tests_tip).
    pub fn tip_does_not_fit(&self) -> Vec<bool> {
        if self.tests_tip { self.are(SiteAnswer::TipDoesNotFit) } else { Vec::new() }
    }

    /// Per site: neither inaccessible nor too narrow for the tip.
    pub fn accessible(&self) -> Vec<bool> {
        self.are(SiteAnswer::Accessible)
    }

    pub(crate) fn is_inaccessible(&self, site: usize) -> bool {
        self.of(site) == SiteAnswer::Inaccessible
    }

    fn are(&self, answer: SiteAnswer) -> Vec<bool> {
        self.of_sites.iter().map(|of_site| *of_site == answer).collect()
    }

    /// Among the sites that most often collide with the cutter where it stands at inaccessible ones; empty if not
    /// wanted. (One entry per obstacle that is ranked, where the labeler ranks others than the sites: see
    /// [`Obstacles`](crate::access::Obstacles).)
    pub fn occlusion(&self) -> &[bool] {
        &self.occlusion
    }

    /// Per site: number of directions in which the cutter has a free pose there: without collision and, by the mesh
    /// definition, with a tip that fits.
    pub fn accessible_directions(&self) -> &[u32] {
        &self.accessible_directions
    }

    /// Per site: share of the directions in which the cutter has a free pose there, in [0, 1]: counted among those
    /// tested, or the answer of a network with a head for it.
    pub fn accessible_share(&self) -> &[f32] {
        &self.accessible_share
    }

    /// Per site: a direction in which the cutter has a free pose there, a unit vector from tip to spindle.
    pub fn witness(&self) -> &[Option<Vec3>] {
        &self.witness
    }

    /// Per site: how far every height and radius of the cutter may grow before the site becomes inaccessible
    /// (positive), or must shrink before it becomes accessible (negative), mm, within the limit of the options.
    /// `docs/labeling.md` has the formula.
    pub fn clearance_mm(&self) -> &[f32] {
        &self.clearance_mm
    }

    /// Per site: how much the tool leaves there, the distance along the normal to the surface of what it leaves, mm; 0
    /// where it is accessible. `docs/rest.md` has the definition.
    pub fn rest_mm(&self) -> &[f32] {
        &self.rest_mm
    }

    /// Per site: volume of what is left nearer to it than to others, mm³; `docs/rest.md` has the definition.
    pub fn rest_volume_mm3(&self) -> &[f32] {
        &self.rest_volume_mm3
    }

    /// What a network gives beside its answers; `None` of exact ones.
    pub fn network(&self) -> Option<&NetworkEvidence> {
        self.network.as_ref()
    }

    pub(crate) fn probability_inaccessible(&self) -> &[f32] {
        self.network.as_ref().map_or(&[], |network| &network.probability_inaccessible)
    }

    pub(crate) fn probability_occlusion(&self) -> &[f32] {
        self.network.as_ref().map_or(&[], |network| &network.probability_occlusion)
    }

    /// With what a network gives beside them.
    #[must_use]
    pub fn with_network(mut self, evidence: NetworkEvidence) -> Self {
        self.network = Some(evidence);
        self
    }

    /// Share of the sites with this answer; 0 if there are none.
    pub fn share(&self, answer: SiteAnswer) -> f64 {
        let n = self.of_sites.iter().filter(|of_site| **of_site == answer).count();
        n as f64 / self.len().max(1) as f64
    }

    /// Number of inaccessible sites.
    pub fn n_inaccessible(&self) -> usize {
        self.of_sites.iter().filter(|of_site| **of_site == SiteAnswer::Inaccessible).count()
    }

    /// Number of occlusion points.
    pub fn n_occlusion(&self) -> usize {
        self.occlusion.iter().filter(|marked| **marked).count()
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
    /// use deepmill::answers::{NetworkEvidence, SiteAnswers};
    /// let evidence = NetworkEvidence::new(vec![], vec![0.98, 0.4, 0.0, 0.55]);
    /// let answers = SiteAnswers::new(vec![true, false, false, true], vec![]).with_network(evidence);
    /// assert_eq!(answers.least_certain_occlusion(0.01)?, [1, 3]);
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    pub fn least_certain_occlusion(&self, bound: f64) -> Result<Vec<usize>> {
        least_certain(self.probability_occlusion(), self.len(), bound)
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
        let marked = areas.iter().zip(&self.of_sites);
        let marked = marked.filter(|(_, of_site)| **of_site == SiteAnswer::Inaccessible);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_tip_cannot_reach_is_not_accessible() {
        let answers = SiteAnswers::new(vec![true, false, false], vec![]);
        assert_eq!(
            (answers.accessible(), answers.tip_does_not_fit()),
            (vec![false, true, true], vec![])
        );
        use SiteAnswer::{Accessible, Inaccessible, TipDoesNotFit};
        let answers = SiteAnswers::by_mesh(vec![Inaccessible, Accessible, TipDoesNotFit]);
        assert_eq!(answers.accessible(), [false, true, false]);
        assert_eq!(answers.inaccessible(), [true, false, false]);
        assert_eq!(answers.tip_does_not_fit(), [false, false, true]);
    }

    #[test]
    fn area_shares_ask_for_the_sites_of_the_answers() {
        let sites = Sites::new(vec![Vec3::X], vec![Vec3::Z]).unwrap();
        let error = SiteAnswers::default().inaccessible_area_share(&sites).unwrap_err();
        assert!(error.to_string().contains("as many as answers"), "{error}");
    }
}

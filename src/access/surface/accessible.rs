//! In which directions a tool may stand at each site.

use super::labels::SurfaceOptions;
use super::obstacles::{TriangleObstacles, extent};
use super::problem::{Problem, WORD};
use super::profile::{self, ProfileTool};
use super::site::SiteState;
use super::tool::axes;
use super::verdict::Verdict;
use crate::Result;
use crate::access::{CollisionMatrix, Queries};
use crate::exec::par;
use crate::geom::Sites;
use crate::tool::cutter::Cutter;
use crate::tool::directions::Directions;

/// For one tool: per direction, the sites at which it may stand.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AccessibleDirections {
    n_sites: usize,
    /// Per direction a bit per site.
    rows: Vec<Vec<u64>>,
    only_tip: Vec<bool>,
}

impl AccessibleDirections {
    /// Whether the tool may stand at a site in a direction: no step penetrates the part, and the tip fits.
    ///
    /// # Panics
    /// If either is out of range.
    pub fn is_accessible(&self, direction: usize, site: usize) -> bool {
        assert!(site < self.n_sites);
        self.rows[direction][site / WORD] >> (site % WORD) & 1 == 1
    }

    /// Whether the tool may stand at a site in some direction.
    ///
    /// # Panics
    /// If the site is out of range.
    pub fn reaches(&self, site: usize) -> bool {
        (0..self.rows.len()).any(|direction| self.is_accessible(direction, site))
    }

    /// Per site, whether the tool has a free pose there in some direction.
    pub fn sites(&self) -> Vec<bool> {
        (0..self.n_sites).map(|site| self.reaches(site)).collect()
    }

    /// Bits of one direction: site `i` is bit `i % 64` of word `i / 64`, bits past the end are 0.
    ///
    /// # Panics
    /// If the direction is out of range.
    pub fn words(&self, direction: usize) -> &[u64] {
        &self.rows[direction]
    }

    /// Number of directions.
    pub fn n_directions(&self) -> usize {
        self.rows.len()
    }

    /// Number of sites.
    pub fn n_sites(&self) -> usize {
        self.n_sites
    }

    /// With more in the way: the directions of each of `parts` after those of the one before, so many in all. A part
    /// answers for the sites of these rows, which have all that `self` reaches. What is in the way then is no fault of
    /// the tip.
    #[cfg(all(feature = "formats", feature = "generate"))]
    pub(crate) fn with_more_in_the_way(
        &self,
        rows: &[usize],
        parts: &[AccessibleDirections],
        n_directions: usize,
    ) -> Self {
        let mut words = Vec::with_capacity(n_directions);
        for part in parts {
            for k in 0..part.n_directions() {
                let mut row = vec![0; self.n_sites.div_ceil(WORD)];
                let reached = rows.iter().enumerate().filter(|(j, _)| part.is_accessible(k, *j));
                reached.for_each(|(_, &i)| row[i / WORD] |= 1 << (i % WORD));
                words.push(row);
            }
        }
        words.resize(n_directions, vec![0; self.n_sites.div_ceil(WORD)]);
        let only_tip = self.only_tip.clone();
        AccessibleDirections { n_sites: self.n_sites, rows: words, only_tip }
    }

    /// Per site, whether the tip is all that hinders the tool: it is accessible from no direction, and in some no step
    /// penetrates the part.
    pub fn only_tip(&self) -> &[bool] {
        &self.only_tip
    }
}

impl TriangleObstacles {
    /// In which of `directions`, just these, the cutter may stand at each site: the verdicts of
    /// [`TriangleObstacles::label`], each kept.
    ///
    /// # Errors
    /// As [`TriangleObstacles::label`].
    ///
    /// ```
    /// use deepmill::access::surface::{SurfaceOptions, TriangleObstacles};
    /// use deepmill::{cutter::Cutter, directions::Directions, geom::sites, geom::solids};
    ///
    /// let part = solids::cuboid(deepmill::glam::DVec3::new(30.0, 20.0, 10.0));
    /// let sites = sites::sample(&part, &sites::SiteOptions::default().with_n_sites(200))?;
    /// let cutter = Cutter::ball_end([1.5, 20.0, 20.0, 5.0].into())?;
    /// let both: Directions = "list:0,0,1;0,0,-1".parse()?;
    /// let obstacles = TriangleObstacles::new(&part, &[])?;
    /// let found = obstacles.accessible_directions(&sites, &cutter, &both, &SurfaceOptions::default())?;
    /// for (i, normal) in sites.normals.iter().enumerate() {
    ///     assert_eq!([0, 1].map(|d| found.is_accessible(d, i)), [normal.z > -0.5, normal.z < 0.5]);
    /// }
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    pub fn accessible_directions(
        &self,
        sites: &Sites,
        cutter: &Cutter,
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> Result<AccessibleDirections> {
        let _floats = par::DefaultFloats::set();
        options.check()?;
        extent(sites.len(), 1, directions, options).require_directions()?;
        let problem = self.problem(Queries::Sites(sites), cutter, options)?;
        if let Some(profile) = cutter.profile() {
            let tool = ProfileTool::new(&self.bvh, &problem.tolerances, profile, options.finish_mm);
            return Ok(of_profile(profile::accessible(&tool, &problem.contacts, directions)));
        }
        let every: Vec<usize> = (0..sites.len()).collect();
        let own = problem.own_by_points(cutter, directions, options)?;
        let all = problem.all_by_points(cutter, directions, options, &every)?;
        let axes: Vec<_> = directions.vectors().iter().map(|&d| axes(d)).collect();
        let blocks = par::map_blocks(sites.len(), WORD, |range| {
            let mut block = Block { accessible: vec![0; axes.len()], only_tip: Vec::new() };
            block.fill(&problem, range, &axes, [&own, &all]);
            block
        });
        let row = |k: usize| blocks.iter().map(|block| block.accessible[k]).collect();
        Ok(AccessibleDirections {
            n_sites: sites.len(),
            rows: (0..axes.len()).map(row).collect(),
            only_tip: blocks.iter().flat_map(|block| block.only_tip.iter().copied()).collect(),
        })
    }
}

/// From the answers per site, and per direction.
fn of_profile(found: Vec<(Vec<bool>, bool)>) -> AccessibleDirections {
    let n_directions = found.first().map_or(0, |(accessible, _)| accessible.len());
    let mut rows = vec![vec![0u64; found.len().div_ceil(WORD)]; n_directions];
    for (i, (accessible, _)) in found.iter().enumerate() {
        for (row, is_accessible) in rows.iter_mut().zip(accessible) {
            row[i / WORD] |= u64::from(*is_accessible) << (i % WORD);
        }
    }
    let only_tip = found.iter().map(|(_, only_tip)| *only_tip).collect();
    AccessibleDirections { n_sites: found.len(), rows, only_tip }
}

/// The sites of a word.
struct Block {
    /// Per direction.
    accessible: Vec<u64>,
    only_tip: Vec<bool>,
}

impl Block {
    fn fill(
        &mut self,
        problem: &Problem,
        range: std::ops::Range<usize>,
        axes: &[super::tool::Axes],
        by_points: [&CollisionMatrix; 2],
    ) {
        let mut state = SiteState::default();
        for i in range {
            let (mut is_accessible, mut gouges) = (false, false);
            problem.verdicts(i, axes, by_points, &mut state, |k, verdict| {
                is_accessible |= verdict == Verdict::Free;
                gouges |= verdict == Verdict::TipGouges;
                self.accessible[k] |= u64::from(verdict == Verdict::Free) << (i % WORD);
            });
            self.only_tip.push(gouges && !is_accessible);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::surface::Reached;
    use crate::answers::SiteAnswer;
    use crate::geom::sites::{SiteOptions, sample};
    use crate::geom::solids;
    use crate::tool::cutter::CutterParams;

    #[test]
    fn a_site_is_accessible_where_the_drop_height_says_so() {
        let part = solids::torus(14.0, 6.0, 24, 12);
        let sites = sample(&part, &SiteOptions::default().with_n_sites(60)).unwrap();
        let directions: Directions = "sphere:12".parse().unwrap();
        let obstacles = TriangleObstacles::new(&part, &[]).unwrap();
        let options = SurfaceOptions { refinement: None, ..SurfaceOptions::default() };
        for lengths in [[1.5, 4.0, 12.0, 5.0], [7.0, 30.0, 7.0, 5.0]] {
            let cutter = Cutter::ball_end(CutterParams::from_array(lengths)).unwrap();
            let found =
                obstacles.accessible_directions(&sites, &cutter, &directions, &options).unwrap();
            assert_eq!((found.n_sites(), found.n_directions()), (60, 12));
            let labels = obstacles.surface_labels(&sites, &cutter, &directions, &options).unwrap();
            let law = obstacles
                .reached_by_drop_heights(&sites, &cutter, &directions, &options, 0.05)
                .unwrap();
            for i in 0..sites.len() {
                for d in 0..directions.len() {
                    let reached = law[i * directions.len() + d];
                    assert!(!found.is_accessible(d, i) || reached != Reached::No, "{i} {d}");
                }
                // Labels of an even set test +z as well.
                let any = (0..12).any(|d| found.is_accessible(d, i));
                assert!(!any || labels.answers[i] == SiteAnswer::Accessible);
                assert!(!(any && found.only_tip()[i]));
            }
        }
    }
}

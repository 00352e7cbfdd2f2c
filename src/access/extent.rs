//! Upper estimates of the memory of labeling, bytes: checked before anything of that size is allocated.
//!
//! | what | bytes |
//! |---|---|
//! | answers by direction | a bit for each query, direction and cutter, and 128 bytes for each direction and cutter |
//! | kept in another order | the same again |
//! | answers by query | 160 for each query and cutter |
//! | β | 8 for each obstacle and cutter, and the same for each thread |
//! | scratch | 128 for each query and obstacle, and the same for each thread |

use crate::Result;
use crate::exec::memory::{product, require};
use crate::exec::par;

const OF_ROW: usize = 128;
const OF_ANSWER: usize = 160;
const OF_POINT: usize = 128;
/// Of a query by the mesh definition: contact, tolerance, tallies and statistics.
const OF_CONTACT: usize = 512;

/// How much is to be labeled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct Extent {
    /// Sites, or points of space.
    pub n_queries: usize,
    /// Points that block.
    pub n_obstacles: usize,
    /// Cutters that are labeled at once.
    pub n_cutters: usize,
    /// Directions tested.
    pub n_directions: usize,
    /// Whether β is counted.
    pub occlusion: bool,
}

impl Extent {
    /// A bit for each query and direction, of one cutter.
    fn matrix(&self) -> u64 {
        let row = self.n_queries.div_ceil(64).saturating_mul(8).saturating_add(OF_ROW);
        product([self.n_directions, row])
    }

    /// Checks that [`label_many`](super::label_many) fits into the memory.
    ///
    /// # Errors
    /// [`Error::TooLarge`](crate::Error::TooLarge) if it does not.
    pub fn require_memory(&self) -> Result<()> {
        let Extent { n_queries, n_obstacles, n_cutters, .. } = *self;
        let n_threads = par::threads() + 1;
        let matrices = self.matrix().saturating_mul(n_cutters as u64 + 1);
        let beta = if self.occlusion { product([n_obstacles, n_cutters, n_threads, 8]) } else { 0 };
        let points = n_queries.saturating_add(n_obstacles);
        let rest =
            [product([n_queries, n_cutters, OF_ANSWER]), product([points, n_threads, OF_POINT])];
        self.require("labeling", rest.into_iter().chain([matrices, beta]))
    }

    /// Checks that labeling against triangles fits, one cutter after the other.
    pub(super) fn require_surface(&self) -> Result<()> {
        let matrices = self.matrix().saturating_mul(2);
        self.require("labeling against triangles", [matrices, self.contacts()])
    }

    /// Checks that a bit for each site, direction and tool fits.
    pub(super) fn require_directions(&self) -> Result<()> {
        // Points, blocks and rows of the tool at work; the rows of all tools.
        let matrices = self.matrix().saturating_mul(self.n_cutters as u64 + 4);
        self.require("accessible directions", [matrices, self.contacts()])
    }

    /// Checks that what each of many tools reaches fits.
    pub(super) fn require_library(&self) -> Result<()> {
        // The directions that points leave open are listed for each site.
        let lists = product([self.n_queries, self.n_directions.saturating_add(6), 4]);
        let answers = product([self.n_queries, self.n_cutters, OF_ANSWER]);
        self.require("tools", [self.matrix().saturating_mul(2), lists, answers, self.contacts()])
    }

    fn contacts(&self) -> u64 {
        product([self.n_queries, self.n_cutters, OF_ANSWER])
            .saturating_add(product([self.n_queries, OF_CONTACT]))
    }

    fn require(&self, operation: &'static str, bytes: impl IntoIterator<Item = u64>) -> Result<()> {
        let needed_bytes = bytes.into_iter().fold(0, u64::saturating_add);
        let Extent { n_queries, n_obstacles, n_cutters, n_directions, .. } = self;
        let remedy = format!(
            "take fewer sites ({n_queries}), directions ({n_directions}), obstacles ({n_obstacles}) or cutters at once ({n_cutters})"
        );
        require(operation, needed_bytes, remedy)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::access::surface::{SurfaceOptions, TriangleObstacles};
    use crate::access::{LabelOptions, Obstacles, label_many};
    use crate::geom::{Sites, solids};
    use crate::tool::cutter::Cutter;
    use crate::tool::directions::{DirectionSet, Directions};
    use glam::Vec3;

    /// What would take petabytes is refused before a byte of that is allocated.
    #[test]
    fn what_cannot_fit_is_refused_with_its_numbers() {
        let all = Extent {
            n_queries: 10_000_000,
            n_obstacles: 10_000_000,
            n_cutters: 1000,
            n_directions: 1_000_000,
            occlusion: true,
        };
        type Check = fn(&Extent) -> Result<()>;
        let checks: [Check; 4] = [
            Extent::require_memory,
            Extent::require_surface,
            Extent::require_directions,
            Extent::require_library,
        ];
        let small = Extent { n_queries: 100, n_obstacles: 100, n_directions: 10, ..all };
        for check in checks {
            check(&Extent { n_cutters: 1, ..small }).unwrap();
            if cfg!(target_os = "linux") {
                let message = check(&all).unwrap_err().to_string();
                for words in ["needs about ", "bytes, the limit is ", "(10000000)", "(1000000)"] {
                    assert!(message.contains(words), "{message}");
                }
            }
        }
        let most = Extent { n_queries: usize::MAX, n_directions: usize::MAX, ..all };
        assert_eq!(most.matrix(), u64::MAX);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn every_entry_checks_before_it_allocates() {
        let n = 6_000_000;
        let sites = Sites { points: vec![Vec3::ZERO; n], normals: vec![Vec3::Z; n], faces: vec![] };
        let directions =
            Directions::new(DirectionSet::FibonacciSphere { n_dirs: 1_000_000 }).unwrap();
        let cutter = Cutter::ball_end([1.5, 6.0, 40.0, 5.0].into()).unwrap();
        let obstacles = TriangleObstacles::new(&solids::cuboid(glam::DVec3::ONE), &[]).unwrap();
        let (options, of_surface) = (LabelOptions::default(), SurfaceOptions::default());
        let cutters = [cutter.clone()];
        for error in [
            label_many(&sites, Obstacles::Queries, &cutters, &directions, &options).unwrap_err(),
            obstacles.surface_labels(&sites, &cutter, &directions, &of_surface).unwrap_err(),
            obstacles.accessible_directions(&sites, &cutter, &directions, &of_surface).unwrap_err(),
            obstacles.reach_many(&sites, &[], &directions, &of_surface).unwrap_err(),
        ] {
            assert!(matches!(error, crate::Error::TooLarge { .. }), "{error}");
        }
    }
}

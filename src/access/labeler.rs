//! The labeler: a definition of the labels and a direction set, ready for any sites and cutters.

use super::labels::{LabelOptions, Labels};
use super::points::driver::label;
use super::points::problem::Obstacles;
use super::surface::{SurfaceOptions, TriangleObstacles};
use crate::Result;
use crate::answers::SiteAnswers;
use crate::geom::{Mesh, Sites};
use crate::tool::cutter::Cutter;
use crate::tool::directions::Directions;

/// Answers exactly, by one of two definitions; takes and returns what
/// [`Predictor`](crate::model::Predictor) does.
///
#[cfg_attr(feature = "weights", doc = "```")]
#[cfg_attr(not(feature = "weights"), doc = "```ignore")]
/// use deepmill::access::Labeler;
/// use deepmill::answers::SiteAnswer;
/// use deepmill::model::{Model, Predictor};
/// use deepmill::{cutter::Cutter, geom::Sites};
/// use deepmill::glam::Vec3;
/// // A floor site beside a tall post.
/// let sites = Sites::new(vec![Vec3::ZERO, Vec3::new(3.0, 0.0, 9.0)], vec![Vec3::Z; 2])?;
/// let cutter: Cutter = "1.5,6,40,5".parse()?;
/// let labeler = Labeler::published();
/// let predictor = Predictor::new(Model::shipped()?).allow_out_of_domain(); // two sites are few
/// let (exact, predicted) = (labeler.answer(&sites, &cutter)?, predictor.answer(&sites, &cutter)?);
/// assert_eq!(exact.len(), predicted.len());
/// assert!(exact.of(0) != SiteAnswer::Inaccessible && exact.witness()[1].is_some());
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug)]
pub struct Labeler {
    directions: Directions,
    definition: Definition,
}

#[derive(Debug)]
enum Definition {
    Sites(LabelOptions),
    Part(Box<TriangleObstacles>, SurfaceOptions),
}

impl Labeler {
    /// By the published definition: the query sites are the obstacles, [`Directions::published`] the directions, and
    /// [`LabelOptions::published`] the options.
    pub fn published() -> Self {
        Labeler::of_sites(Directions::published(), LabelOptions::published())
    }

    /// With the query sites as obstacles; the published definition needs its directions and options, too
    /// ([`Labeler::published`]).
    pub fn of_sites(directions: Directions, options: LabelOptions) -> Self {
        Labeler { directions, definition: Definition::Sites(options) }
    }

    /// By the mesh definition: the triangles of `part` and of `fixtures` are the obstacles, see
    /// [`surface`](super::surface).
    ///
    /// Open meshes and those that face inward are taken as they are, as by [`TriangleObstacles::new`];
    /// [`require_labelable`](crate::geom::check::require_labelable) refuses them.
    ///
    /// # Errors
    /// As [`TriangleObstacles::new`].
    pub fn of_part(
        part: &Mesh,
        fixtures: &[Mesh],
        directions: Directions,
        options: SurfaceOptions,
    ) -> Result<Self> {
        let obstacles = Box::new(TriangleObstacles::new(part, fixtures)?);
        Ok(Labeler { directions, definition: Definition::Part(obstacles, options) })
    }

    /// The answers for `sites` and `cutter`.
    ///
    /// # Errors
    /// As [`label`](super::label()), or as [`TriangleObstacles::label`].
    pub fn answer(&self, sites: &Sites, cutter: &Cutter) -> Result<SiteAnswers> {
        let labels = match &self.definition {
            Definition::Sites(options) => {
                let options = LabelOptions { beta: false, ..*options };
                label(sites, Obstacles::Queries, cutter, &self.directions, &options)
            }
            Definition::Part(obstacles, options) => {
                let options = SurfaceOptions { beta: false, ..*options };
                obstacles.label(sites, cutter, &self.directions, &options)
            }
        };
        labels.map(|labels| labels.answers)
    }

    /// As [`Labeler::answer`], with what the answers rest on.
    ///
    /// # Errors
    /// As [`Labeler::answer`].
    pub fn label(&self, sites: &Sites, cutter: &Cutter) -> Result<Labels> {
        match &self.definition {
            Definition::Sites(options) => {
                label(sites, Obstacles::Queries, cutter, &self.directions, options)
            }
            Definition::Part(obstacles, options) => {
                obstacles.label(sites, cutter, &self.directions, options)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::sites::{SiteOptions, sample};
    use crate::geom::solids;
    use glam::DVec3;

    #[test]
    fn both_definitions_answer_in_the_same_form() {
        let part = solids::cuboid(DVec3::new(40.0, 30.0, 20.0));
        let sites = sample(&part, &SiteOptions { n_sites: 300, ..Default::default() }).unwrap();
        let cutter: Cutter = "1.5,20,20,5".parse().unwrap();
        let by_sites = Labeler::of_sites("150".parse().unwrap(), LabelOptions::default());
        let options = SurfaceOptions::default();
        let by_part = Labeler::of_part(&part, &[], Directions::up(), options).unwrap();
        for labeler in [&by_sites, &by_part] {
            let answers = labeler.answer(&sites, &cutter).unwrap();
            let reached: Vec<bool> = answers.witness.iter().map(Option::is_some).collect();
            assert_eq!(answers.accessible(), reached);
            assert!((0..300).all(|i| reached[i] || sites.normals[i].z < 0.9), "the top");
            assert_eq!((answers.occlusion.len(), answers.accessible_directions.len()), (300, 300));
        }
        assert!(by_sites.answer(&sites, &cutter).unwrap().tip_does_not_fit().is_empty());
        let about_part = by_part.answer(&sites, &cutter).unwrap();
        assert_eq!(about_part.tip_does_not_fit().len(), 300);
        assert!(about_part.n_inaccessible() > 0, "the underside");
    }
}

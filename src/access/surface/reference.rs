//! The definition in plain loops: all poses of a tool along one direction, in `f64`.

use super::labels::{SiteAnswer, SurfaceOptions};
use super::obstacles::{TriangleObstacles, tested};
use super::pose::PoseSet;
use super::tool::{Contact, Outline, Stand, axes};
use super::verdict::{Raise, raise_over};
use crate::access::Queries;
use crate::cutter::{Cutter, require_steps};
use crate::directions::Directions;
use crate::{Result, par};
use glam::{DVec2, DVec3, Vec3};

/// What the plain loops find at one query along one direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Reached {
    /// Some pose is free.
    Yes,
    /// Every pose penetrates a triangle.
    No,
    /// No free pose was found, and not all poses are closed: what is left is narrower than the resolution.
    Undecided,
}

/// Triangles with the tolerance against each.
type Toleranced = [([DVec3; 3], f64)];

impl TriangleObstacles {
    /// Whether the tool reaches each of `queries` along each of `directions`, `[n_queries, n_directions]` row-major, by
    /// plain loops: slow, the reference.
    ///
    /// ```text
    /// cells = one square around the disc of poses
    /// for every cell:
    ///     drop height of the whole tool at its middle not above where it is: reached
    ///     one triangle penetrates the tool shrunk by the half diagonal, at its middle: so it does in all poses of the cell
    ///     half diagonal below the resolution: undecided
    ///     else: cut in four
    /// ```
    ///
    /// # Errors
    /// As [`TriangleObstacles::label`].
    #[doc(hidden)] // checked by benches
    pub fn reached_by_drop_heights<'a>(
        &self,
        queries: impl Into<Queries<'a>>,
        cutter: &Cutter,
        directions: &Directions,
        options: &SurfaceOptions,
        resolution_mm: f64,
    ) -> Result<Vec<Reached>> {
        options.check()?;
        require_steps(cutter.profile(), "label it, or give the tool by lengths")?;
        let problem = self.problem(queries.into(), cutter, options)?;
        let triangles: Vec<_> = problem.all_triangles().collect();
        let outline = &problem.outline;
        let rows = par::map(problem.contacts.len(), |i| {
            let contact = (&problem.contacts[i], problem.rim(i));
            let of = |d: &Vec3| reached(&triangles, outline, contact, *d, resolution_mm);
            directions.vectors().iter().map(of).collect::<Vec<_>>()
        });
        Ok(rows.into_iter().flatten().collect())
    }

    /// Answers by [`TriangleObstacles::reached_by_drop_heights`]: accessible where some direction is reached; elsewhere
    /// the tip does not fit where no step penetrates in some direction, with the tool as it touches with the site's
    /// normal.
    ///
    /// # Errors
    /// As [`TriangleObstacles::label`].
    pub fn label_by_drop_heights<'a>(
        &self,
        queries: impl Into<Queries<'a>>,
        cutter: &Cutter,
        directions: &Directions,
        options: &SurfaceOptions,
        resolution_mm: f64,
    ) -> Result<Vec<SiteAnswer>> {
        let (queries, tested) = (queries.into(), tested(directions)?);
        let reached =
            self.reached_by_drop_heights(queries, cutter, &tested, options, resolution_mm)?;
        let problem = self.problem(queries, cutter, options)?;
        let rows: Vec<&[Reached]> = reached.chunks(tested.len()).collect();
        let answer = |i: usize| {
            if rows[i].contains(&Reached::Yes) {
                return SiteAnswer::Accessible;
            }
            let free = |d: &Vec3| {
                let stand = problem.own_stand(i, *d);
                raise_over(problem.all_triangles(), &problem.outline, 0.0, &stand).steps <= 0.0
            };
            match tested.vectors().iter().any(free) {
                true => SiteAnswer::TipDoesNotFit,
                false => SiteAnswer::Inaccessible,
            }
        };
        Ok(par::map(rows.len(), answer))
    }
}

fn reached(
    triangles: &Toleranced,
    outline: &Outline,
    (contact, rim): (&Contact, f64),
    direction: Vec3,
    resolution: f64,
) -> Reached {
    let axes = axes(direction);
    let poses = PoseSet::new(outline);
    let radius = poses.radius();
    let [u, v, d] = axes;
    let raise = |at: DVec2, more: f64| {
        let o = poses.offset(at);
        let stand = Stand { reference: contact.point + u * o.x + v * o.y + d * o.z, axes };
        let Raise { steps, tip } = raise_over(triangles.iter().copied(), outline, more, &stand);
        steps.max(tip)
    };
    let normal = contact.normal.map(|n| DVec3::new(n.dot(u), n.dot(v), n.dot(d)));
    let may_touch = |at: DVec2| normal.is_none_or(|normal| poses.touches(at, 0.0, (normal, rim)));
    let own = Stand { reference: contact.reference_point(outline, d), axes };
    let Raise { steps, tip } = raise_over(triangles.iter().copied(), outline, 0.0, &own);
    if steps.max(tip) <= 0.0 {
        return Reached::Yes;
    }
    let mut found = Reached::No;
    let mut cells = vec![(DVec2::ZERO, radius)];
    while let Some((middle, half)) = cells.pop() {
        let reach = half * std::f64::consts::SQRT_2;
        if (middle.abs() - half).max(DVec2::ZERO).length() > radius || raise(middle, reach) > 0.0 {
            continue;
        }
        if may_touch(middle) && raise(middle, 0.0) <= 0.0 {
            return Reached::Yes;
        }
        if reach <= resolution {
            found = Reached::Undecided;
            continue;
        }
        let half = 0.5 * half;
        for corner in [[-half, -half], [half, -half], [-half, half], [half, half]] {
            cells.push((middle + DVec2::from_array(corner), half));
        }
    }
    found
}

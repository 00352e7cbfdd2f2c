//! The definition in plain loops: all poses of a tool along one direction, in `f64`.

use super::drop;
use super::labels::SurfaceOptions;
use super::obstacles::{TriangleObstacles, tested};
use super::pose::PoseSet;
use super::tool::{Contact, Outline, Stand, axes};
use super::verdict::{Raise, raise_over};
use crate::Result;
use crate::access::Queries;
use crate::answers::SiteAnswer;
use crate::exec::par;
use crate::tool::cutter::{Cutter, require_steps};
use crate::tool::directions::Directions;
use glam::{DVec2, DVec3, Vec3};
use std::rc::Rc;

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
    ///     else: cut in four; triangles that the tool, grown by the half diagonal, is clear of are left out there
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
    let stand = |at: DVec2| {
        let o = poses.offset(at);
        Stand { reference: contact.point + u * o.x + v * o.y + d * o.z, axes }
    };
    let raise = |triangles: &Toleranced, at: DVec2, more: f64| {
        let Raise { steps, tip } = raise_over(triangles.iter().copied(), outline, more, &stand(at));
        steps.max(tip)
    };
    let near = |triangles: &Toleranced, at: DVec2, reach: f64| -> Rc<Toleranced> {
        let stand = stand(at);
        triangles.iter().filter(|of| is_near(of, outline, reach, &stand)).copied().collect()
    };
    let normal = contact.normal.map(|n| DVec3::new(n.dot(u), n.dot(v), n.dot(d)));
    let may_touch = |at: DVec2| normal.is_none_or(|normal| poses.touches(at, 0.0, (normal, rim)));
    let own = Stand { reference: contact.reference_point(outline, d), axes };
    let Raise { steps, tip } = raise_over(triangles.iter().copied(), outline, 0.0, &own);
    if steps.max(tip) <= 0.0 {
        return Reached::Yes;
    }
    let mut found = Reached::No;
    let mut cells = vec![(DVec2::ZERO, radius, Rc::from(triangles))];
    while let Some((middle, half, triangles)) = cells.pop() {
        let reach = half * std::f64::consts::SQRT_2;
        let is_outside = (middle.abs() - half).max(DVec2::ZERO).length() > radius;
        if is_outside || raise(&triangles, middle, reach) > 0.0 {
            continue;
        }
        if may_touch(middle) && raise(&triangles, middle, 0.0) <= 0.0 {
            return Reached::Yes;
        }
        if reach <= resolution {
            found = Reached::Undecided;
            continue;
        }
        let (half, near) = (0.5 * half, near(&triangles, middle, reach));
        for corner in [[-half, -half], [half, -half], [-half, half], [half, half]] {
            cells.push((middle + DVec2::from_array(corner), half, near.clone()));
        }
    }
    found
}

/// Whether a triangle may penetrate the tool that stands within `reach` of a place: the steps, and a disc under the
/// tip.
fn is_near(
    (corners, tolerance): &([DVec3; 3], f64),
    outline: &Outline,
    reach: f64,
    stand: &Stand,
) -> bool {
    let corners = stand.triangle(corners);
    let under_tip = [-outline.radius(), outline.radius()];
    outline
        .steps(*tolerance)
        .chain([under_tip])
        .any(|[height, radius]| drop::disc(&corners, radius + reach) > height - reach)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::rng::{Purpose, Stream};
    use crate::tool::cutter::CutterParams;

    #[test]
    fn what_penetrates_in_some_pose_of_a_cell_is_near_it() {
        let params = CutterParams::from_array([3.0, 5.0, 8.0, 10.0]);
        let cutters = [
            Cutter::ball_end(params),
            Cutter::bull_nose(params, 1.0),
            Cutter::flat_end(params),
            Cutter::tapered(params, 0.2, 4),
        ];
        let mut stream = Stream::new(7, 0, 0, Purpose::Probe);
        let mut n_penetrate = 0;
        for cutter in cutters {
            let outline = Outline::new(&cutter.unwrap(), 0.01);
            for _ in 0..5000 {
                let mut point = |r: f64| DVec3::ZERO.map(|_| stream.range(-r, r));
                let (low, edges) = (point(15.0), [point(4.0), point(4.0)]);
                let axes = axes(point(1.0).as_vec3().normalize_or(Vec3::Z));
                let (middle, aside) = (point(3.0), point(1.0).normalize_or_zero());
                let reach = stream.range(0.0, 2.0);
                let triangle = ([low, low + edges[0], low + edges[1]], 0.01);
                let moved = Stand { reference: middle + aside * (0.999 * reach), axes };
                let Raise { steps, tip } =
                    raise_over([triangle].into_iter(), &outline, 0.0, &moved);
                let is_near =
                    is_near(&triangle, &outline, reach, &Stand { reference: middle, axes });
                assert!(is_near || steps.max(tip) <= 0.0, "{triangle:?}, {reach}");
                n_penetrate += usize::from(is_near && steps.max(tip) > 0.0);
            }
        }
        assert!(n_penetrate > 1000, "{n_penetrate}");
    }
}

//! A region of a part: the faces, or pieces of faces, that answers are about.
//!
//! # Definition
//!
//! The region is all of the surface that one of the selectors `only` holds (all, if there are none) and no selector
//! `except` holds. Triangles are cut where the border of a selector crosses them: by the planes of boxes exactly, and
//! by a lattice about selected sites, so that pieces belong to the site nearest to them. The cuts are the same on both
//! sides of an edge, so pieces hang together as the triangles did.
//!
//! ```text
//! for every triangle: pieces = [triangle]; for every plane: cut the pieces that it crosses
//! keep the pieces of which the middle is in the region
//! ```
//!
//! Only the sites are restricted: all of the part blocks, as before.

use super::Mesh;
use super::sites::{self, SiteOptions, Sites};
use crate::exec::par;
use crate::spatial::{AabbGrid, PointGrid};
use crate::{Error, Result};
use glam::DVec3;
use std::collections::HashMap;

/// What holds a part of a surface.
///
/// ```
/// use deepmill::geom::{selection::{Selection, Selector}, solids};
/// use deepmill::glam::DVec3;
///
/// let part = solids::cuboid(DVec3::new(40.0, 30.0, 20.0));
/// let up = Selector::Normal { direction: DVec3::Z, within_rad: 0.1 };
/// let top = Selection::default().with_only(vec![up]).of(&part)?;
/// assert!((top.mesh.area() - 40.0 * 30.0).abs() < 1e-6); // mm²
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum Selector {
    /// All between two corners, mm; faces on its border are within.
    Box {
        /// Least corner.
        low: DVec3,
        /// Greatest corner.
        high: DVec3,
    },
    /// Faces with normals near a direction.
    Normal {
        /// The direction, of any length but zero.
        direction: DVec3,
        /// Greatest angle, radians.
        within_rad: f64,
    },
    /// Faces that lie on those of another mesh, within a hundred-thousandth of the part's diagonal, and face the same
    /// way.
    Faces(Mesh),
    /// What is nearer to chosen sites than to others that face the same way.
    Sites {
        /// All sites of the part.
        sites: Sites,
        /// Per site, whether it is chosen.
        chosen: Vec<bool>,
        /// Mean distance of neighbors, mm.
        spacing_mm: f64,
    },
}

/// Which part of a surface answers are about.
///
/// ```
/// use deepmill::geom::{selection::{Selection, Selector}, solids};
/// use deepmill::glam::DVec3;
/// let up = Selector::Normal { direction: DVec3::Z, within_rad: 0.1 };
/// let region = Selection::default().with_only(vec![up]).of(&solids::cuboid(DVec3::splat(10.0)))?;
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct Selection {
    /// What any of these holds; everything, if there are none.
    pub only: Vec<Selector>,
    /// But not what one of these holds.
    pub except: Vec<Selector>,
}

setters!(Selection {
    with_only(only: Vec<Selector>),
    with_except(except: Vec<Selector>),
});

/// A region of a part, as a mesh of its own.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// The pieces, mm; open at the region's border.
    pub mesh: Mesh,
    /// Of each triangle of the pieces, the part's triangle that it is of.
    pub faces: Vec<u32>,
    /// Whether it is in the region, or only around it.
    is_in: Vec<bool>,
}

/// Faces within this share of the diagonal of selected ones lie on them.
const ON_FACE: f64 = 1e-5;
/// Cosine of the angle within which faces face the same way.
const SAME_WAY: f64 = 0.9;
/// Boxes lie open by this share of the diagonal: faces on their border are within.
const BORDER: f64 = 1e-9;
/// Radius of the search for the nearest site, in spacings.
const REACH: f64 = 3.0;
/// Width of what surrounds a region, in distances between sites.
const MARGIN: f64 = 4.0;
/// Sites are spread over at most so many times the area of the region.
const MOST_AROUND: f64 = 16.0;
/// Triangles per parallel task.
const BLOCK: usize = 512;
/// Corners of a piece: three, and one more for each plane that cuts it off.
type Polygon = Vec<DVec3>;

impl Selection {
    /// The region of `part`.
    ///
    /// # Errors
    /// If the part fails [`Mesh::check`], a selector has no size or direction, or the region has no area.
    pub fn of(&self, part: &Mesh) -> Result<Region> {
        let region = self.pieces(part, None)?;
        if region.mesh.area() > 0.0 {
            return Ok(region);
        }
        let (low, high) = part.bounds().unwrap_or_default();
        let words = |p: DVec3| format!("{}, {}, {}", p.x, p.y, p.z);
        let remedy = format!("the part reaches from {} to {} mm", words(low), words(high));
        Err(Error::argument("region", "no face", "a region with an area", remedy))
    }

    /// Near-uniform sites on the `region` of `part`, about as many as wanted: their faces are those of the region.
    /// Sites are spread over what surrounds the region, too, so that they are as dense at its border as within.
    ///
    /// # Errors
    /// As [`Selection::of`] and [`sites::sample`].
    pub fn sample(&self, part: &Mesh, region: &Region, options: &SiteOptions) -> Result<Sites> {
        let n = options.n_sites.max(1) as f64;
        let margin = MARGIN * (region.mesh.area() / n).sqrt();
        let (low, high) = region.mesh.bounds().unwrap_or_default();
        let around = [low - margin, high + margin];
        let wide = self.pieces(part, Some(around))?;
        let n_wide = n * (wide.mesh.area() / region.mesh.area()).min(MOST_AROUND);
        let n_sites = (n_wide.round() as usize).clamp(1, sites::MAX_SITES);
        let all = sites::sample(&wide.mesh, &SiteOptions { n_sites, ..*options })?;
        let is_in = |i: &usize| wide.is_in[all.faces[*i] as usize];
        let rows: Vec<usize> = (0..all.len()).filter(is_in).collect();
        // Pieces of the region are not cut by the box about it: they come in the same order.
        let mut number = Vec::with_capacity(wide.is_in.len());
        let mut n_before = 0;
        for is_in in &wide.is_in {
            number.push(n_before);
            n_before += u32::from(*is_in);
        }
        if rows.len() < 2 || n_before as usize != region.faces.len() {
            // A region between the sites.
            return sites::sample(&region.mesh, options);
        }
        let faces = rows.iter().map(|&i| number[all.faces[i] as usize]).collect();
        Ok(Sites { faces, ..all.subset(&rows) })
    }

    /// The region, or all pieces within a box, which the region is in.
    fn pieces(&self, part: &Mesh, around: Option<[DVec3; 2]>) -> Result<Region> {
        part.check()?;
        self.only.iter().chain(&self.except).try_for_each(Selector::check)?;
        let diagonal = part.diagonal();
        let ready = |selector| Ready::new(selector, diagonal);
        let only: Vec<Ready> = self.only.iter().map(ready).collect();
        let except: Vec<Ready> = self.except.iter().map(ready).collect();
        let outline = around.map(|[low, high]| Selector::Box { low, high });
        let outline = outline.as_ref().map(ready);
        let cuts: Vec<&Cuts> =
            only.iter().chain(&except).chain(&outline).map(|ready| &ready.cuts).collect();
        let pieces = par::map_blocks(part.triangles.len(), BLOCK, |range| {
            let mut found: Vec<(u32, bool, Polygon)> = Vec::new();
            for f in range.filter(|f| part.has_area(*f)) {
                let normal = part.area_vector(f).normalize();
                for piece in cut(part.corners(f), &cuts) {
                    let middle = piece.iter().sum::<DVec3>() / piece.len() as f64;
                    let holds = |ready: &Ready| ready.holds(middle, normal);
                    let is_in =
                        (only.is_empty() || only.iter().any(holds)) && !except.iter().any(holds);
                    if is_in || outline.as_ref().is_some_and(holds) {
                        found.push((f as u32, is_in, piece));
                    }
                }
            }
            found
        });
        let mut region = Region { mesh: Mesh::default(), faces: Vec::new(), is_in: Vec::new() };
        let mut number: HashMap<[u64; 3], u32> = HashMap::new();
        for (face, is_in, piece) in pieces.into_iter().flatten() {
            let corners: Vec<u32> = piece
                .iter()
                .map(|p| {
                    let bits = (*p + 0.0).to_array().map(f64::to_bits);
                    *number.entry(bits).or_insert_with(|| {
                        region.mesh.vertices.push(*p);
                        region.mesh.vertices.len() as u32 - 1
                    })
                })
                .collect();
            for k in 1..corners.len() - 1 {
                region.mesh.triangles.push([corners[0], corners[k], corners[k + 1]]);
                region.faces.push(face);
                region.is_in.push(is_in);
            }
        }
        Ok(region)
    }
}

impl Region {
    /// Of which every piece is in the region; `None` if there is not one number of a face for each.
    #[doc(hidden)] // of `analysis`
    pub fn whole(mesh: Mesh, faces: Vec<u32>) -> Option<Self> {
        let n = mesh.triangles.len();
        (faces.len() == n).then(|| Region { mesh, faces, is_in: vec![true; n] })
    }

    /// Sites on [`Region::mesh`], with the part's triangles as their faces.
    ///
    /// # Panics
    /// If a site names a triangle that the region lacks.
    pub fn on_part(&self, sites: &Sites) -> Sites {
        let faces = sites.faces.iter().map(|f| self.faces[*f as usize]).collect();
        Sites { faces, ..sites.clone() }
    }
}

impl Selector {
    fn check(&self) -> Result<()> {
        let refused = |found: String, expected: &str| {
            let remedy = "write for example box:0,0,0,40,30,20 or normal:0,0,1:10";
            Err(Error::argument("region", found, expected, remedy))
        };
        match self {
            Selector::Box { low, high } => {
                let has_size = low.is_finite() && high.is_finite() && low.cmple(*high).all();
                if has_size {
                    return Ok(());
                }
                refused(format!("box from {low} to {high}"), "the least corner, then the greatest")
            }
            Selector::Normal { direction, within_rad } => {
                let has_length = direction.is_finite() && direction.length() > 1e-12;
                if has_length && (0.0..=std::f64::consts::PI).contains(within_rad) {
                    return Ok(());
                }
                refused(format!("normal {direction}"), "a direction, and 0 to 180 degrees")
            }
            Selector::Faces(mesh) => mesh.check(),
            Selector::Sites { sites, chosen, .. } if chosen.len() == sites.len() => sites.check(),
            Selector::Sites { .. } => refused("sites".into(), "a choice for every site"),
        }
    }
}

/// Planes across the axes, ascending, and the box outside of which nothing is cut.
struct Cuts {
    at: [Vec<f64>; 3],
    within: Option<[DVec3; 2]>,
}

/// A selector and its search structures.
struct Ready<'a> {
    selector: &'a Selector,
    cuts: Cuts,
    /// What lies this near counts, mm.
    border: f64,
    boxes: Option<AabbGrid>,
    grid: Option<PointGrid>,
}

impl<'a> Ready<'a> {
    fn new(selector: &'a Selector, diagonal: f64) -> Self {
        let none = Cuts { at: Default::default(), within: None };
        let mut ready =
            Ready { selector, cuts: none, border: BORDER * diagonal, boxes: None, grid: None };
        match selector {
            Selector::Box { low, high } => {
                ready.cuts.at = [0, 1, 2].map(|k| vec![low[k], high[k]]);
            }
            Selector::Normal { .. } => {}
            Selector::Faces(mesh) => {
                ready.border = ON_FACE * diagonal;
                let room = DVec3::splat(ready.border);
                let bounds = |f: usize| {
                    let [a, b, c] = mesh.corners(f);
                    (a.min(b).min(c) - room, a.max(b).max(c) + room)
                };
                let boxes: Vec<_> = (0..mesh.triangles.len()).map(bounds).collect();
                ready.boxes = Some(AabbGrid::new(&boxes));
            }
            Selector::Sites { sites, chosen, spacing_mm } => {
                let places = sites.points.iter().zip(chosen).filter(|(_, chosen)| **chosen);
                let empty = [DVec3::INFINITY, DVec3::NEG_INFINITY];
                let [low, high] = places.fold(empty, |[low, high], (p, _)| {
                    [low.min(p.as_dvec3()), high.max(p.as_dvec3())]
                });
                let within = [low - *spacing_mm, high + *spacing_mm];
                ready.cuts.at = [0, 1, 2].map(|k| lattice(within[0][k], within[1][k], *spacing_mm));
                ready.cuts.within = Some(within);
                ready.grid = Some(PointGrid::new(&sites.points));
            }
        }
        ready
    }

    /// Whether it holds a piece of a face with this middle and normal.
    fn holds(&self, middle: DVec3, normal: DVec3) -> bool {
        match self.selector {
            Selector::Box { low, high } => {
                let room = DVec3::splat(self.border);
                middle.cmpge(*low - room).all() && middle.cmple(*high + room).all()
            }
            Selector::Normal { direction, within_rad } => {
                let direction = direction.normalize();
                let angle = libm::atan2(normal.cross(direction).length(), normal.dot(direction));
                angle <= within_rad + 1e-9
            }
            Selector::Faces(mesh) => {
                let boxes = self.boxes.as_ref();
                let near = boxes.map_or(&[][..], |boxes| boxes.in_cell(boxes.cell_of(middle)));
                near.iter().any(|f| {
                    let other = mesh.area_vector(*f as usize).normalize_or_zero();
                    other.dot(normal) > SAME_WAY
                        && distance(middle, mesh.corners(*f as usize)) <= self.border
                })
            }
            Selector::Sites { sites, chosen, spacing_mm } => {
                let mut best = (f64::INFINITY, u32::MAX);
                if let Some(grid) = &self.grid {
                    let radius = (REACH * spacing_mm) as f32;
                    grid.for_each_within(middle.as_vec3(), radius, |i, square| {
                        let faces = f64::from(sites.normals[i as usize].dot(normal.as_vec3()));
                        if faces > 0.5 && (square, i) < best {
                            best = (square, i);
                        }
                    });
                }
                chosen.get(best.1 as usize).copied().unwrap_or(false)
            }
        }
    }
}

/// Planes half a step apart.
fn lattice(low: f64, high: f64, step: f64) -> Vec<f64> {
    /// Most planes of an axis.
    const MOST: f64 = 512.0;
    let n = (2.0 * (high - low) / step).clamp(1.0, MOST).ceil();
    if !n.is_finite() {
        return Vec::new();
    }
    (0..=n as u32).map(|k| low + (high - low) * f64::from(k) / n).collect()
}

/// The pieces of a triangle between all planes.
fn cut(corners: [DVec3; 3], cuts: &[&Cuts]) -> Vec<Polygon> {
    let [a, b, c] = corners;
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    let mut pieces = vec![corners.to_vec()];
    for cuts in cuts {
        let misses = |[l, h]: [DVec3; 2]| low.cmpgt(h).any() || high.cmplt(l).any();
        if cuts.within.is_some_and(misses) {
            continue;
        }
        for axis in 0..3 {
            let at = &cuts.at[axis];
            let first = at.partition_point(|at| *at <= low[axis]);
            for at in at[first..].iter().take_while(|at| **at < high[axis]) {
                pieces = pieces.into_iter().flat_map(|piece| halves(piece, axis, *at)).collect();
            }
        }
    }
    pieces
}

/// A convex piece below and above a plane across an axis; one that the plane does not cross stays whole.
fn halves(piece: Polygon, axis: usize, at: f64) -> Vec<Polygon> {
    let is_below = |p: &DVec3| p[axis] < at;
    let is_above = |p: &DVec3| p[axis] > at;
    if !piece.iter().any(is_below) || !piece.iter().any(is_above) {
        return vec![piece];
    }
    let (mut below, mut above) = (Vec::new(), Vec::new());
    for (k, p) in piece.iter().enumerate() {
        let q = &piece[(k + 1) % piece.len()];
        if !is_above(p) {
            below.push(*p);
        }
        if !is_below(p) {
            above.push(*p);
        }
        if (is_below(p) && is_above(q)) || (is_above(p) && is_below(q)) {
            let crossing = crossing(*p, *q, axis, at);
            below.push(crossing);
            above.push(crossing);
        }
    }
    vec![below, above]
}

/// Where an edge crosses a plane: the same from both ends, so that neighbors share it.
fn crossing(p: DVec3, q: DVec3, axis: usize, at: f64) -> DVec3 {
    let (p, q) = if p[axis] < q[axis] { (p, q) } else { (q, p) };
    let mut point = p + (q - p) * ((at - p[axis]) / (q[axis] - p[axis]));
    point[axis] = at;
    point
}

/// Distance of a point from a triangle with area, mm.
fn distance(p: DVec3, corners: [DVec3; 3]) -> f64 {
    super::sites::nearest_in_triangle(p, corners).distance(p)
}

#[cfg(test)]
mod tests;

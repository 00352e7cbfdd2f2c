//! The color of a point of the surface: that of the nearest site that faces the same way.

use super::raster::{Fragment, Surface};
use super::{Coloring, PartView, Rgb};
use crate::geom::spacing::Spacing;
use crate::spatial::PointGrid;
use glam::{DVec3, Vec3};

/// Weight of a difference in normals: perpendicular faces count like this many squared spacings.
const NORMAL_WEIGHT: f64 = 4.0;
/// Radius of the search, in spacings.
const REACH: f64 = 2.0;
/// Radius of a disc, in mean distances between sites.
const DISC: f64 = 0.8;
/// Color of what a section cuts.
const CUT: Rgb = [108, 115, 126];
/// Color of a surface without sites.
pub const METAL: Rgb = [176, 186, 198];

/// The surface of a part and the colors of its sites.
pub struct Painter<'a> {
    /// What is drawn: the mesh, or a disc for each site.
    pub surface: Surface,
    /// The sites by place; `None` if each face belongs to a site already.
    grid: Option<PointGrid>,
    spacing: f64,
    part: PartView<'a>,
    coloring: &'a Coloring<'a>,
}

impl<'a> Painter<'a> {
    /// Prepares `part`; without a mesh each site becomes a disc.
    pub fn new(part: &PartView<'a>, coloring: &'a Coloring<'a>) -> Self {
        let n_sites = part.sites.len().max(1) as f64;
        let (surface, grid, spacing) = match part.mesh {
            Some(mesh) => {
                let spacing = (mesh.area() / n_sites).sqrt();
                (Surface::of_mesh(mesh), Some(PointGrid::new(&part.sites.points)), spacing)
            }
            None => {
                let spacing = Spacing::measure_on_sheet(part.sites).map_or(0.0, |s| s.mean_mm);
                let radius = if spacing > 0.0 { DISC * spacing } else { 1.0 };
                (Surface::of_sites(part.sites, radius), None, spacing)
            }
        };
        Painter { surface, grid, spacing, part: *part, coloring }
    }

    /// Whether edge lines make sense: they do on a mesh, not between discs.
    pub fn has_edges(&self) -> bool {
        self.grid.is_some()
    }

    /// The color, before shading, of a fragment seen at `point`.
    pub fn at(&self, fragment: &Fragment, point: DVec3) -> Rgb {
        match fragment.is_cut() {
            true => CUT,
            false => self.color_at(fragment.face as usize, point, fragment.normal),
        }
    }

    /// The color of face `face` of the surface, or of a piece of it, at `point`.
    pub fn color_at(&self, face: usize, point: DVec3, normal: Vec3) -> Rgb {
        let site = match &self.grid {
            None => Some(Surface::site_of_disc(face as u32)),
            Some(grid) => self.nearest(grid, point.as_vec3(), normal),
        };
        site.map_or(METAL, |i| self.coloring.color(i as usize))
    }

    fn nearest(&self, grid: &PointGrid, point: Vec3, normal: Vec3) -> Option<u32> {
        let weight = NORMAL_WEIGHT * self.spacing * self.spacing;
        let mut best = (f64::INFINITY, None);
        grid.for_each_within(point, (REACH * self.spacing) as f32, |i, square| {
            let away = 1.0 - f64::from(normal.dot(self.part.sites.normals[i as usize]));
            let candidate = (square + weight * away, Some(i));
            if candidate < best {
                best = candidate;
            }
        });
        best.1.or_else(|| grid.nearest(point).map(|(i, _)| i))
    }
}

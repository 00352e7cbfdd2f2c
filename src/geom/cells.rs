//! Voronoi cells of sites on their surface: which site a point belongs to, and how even the cells are.

use super::sites::{OPPOSITE, same_sheet};
use super::spacing::{Spacing, mean_and_cv};
use super::{Mesh, Sites};
use crate::Result;
use crate::exec::par;
use crate::numeric::rng::{Purpose, Stream};
use crate::spatial::KdTree;
use glam::DVec3;

/// How far from a site, in mean spacings, two opposite neighbors make it a rim site. At 1.2 a few
/// cells of turbine blades still held both sides; at 2 blades and fins lose more evenness.
const RIM_REACH: f64 = 2.0;
/// Cosine of the angle (72°) by which a rim site's cell may turn from its side: two normals both
/// within 71.6° of a third are not 143° apart.
const RIM_TURN: f64 = 0.317;
/// How far away, in mean spacings, a point looks for a site of its own sheet.
const SEARCH: f64 = 3.0;
/// Sites or probes per parallel task.
const BLOCK: usize = 1024;

/// Tells which site a point of the surface belongs to.
///
/// It is the nearest site on the point's own sheet. A site that has neighbors
/// on two opposite sheets sits on the rim of a wall, such as the narrow side of a thin plate; its cell keeps to
/// its own face and one of the two sheets, the nearer. So no cell holds points of both sides of a
/// wall thinner than the spacing. A point with no such site within three spacings has no owner.
pub struct VoronoiCells {
    points: Vec<DVec3>,
    normals: Vec<DVec3>,
    /// For a rim site, the unit vector midway between its normal and that of the sheet it keeps to.
    sides: Vec<Option<DVec3>>,
    tree: KdTree,
    search_mm: f64,
}

/// How even the cells of sites are.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct CellSpread {
    /// Coefficient of variation of the cells' areas.
    pub area_cv: f64,
    /// Share of the surface that belongs to no site: on faces far smaller than a cell.
    pub unowned: f64,
    /// Greatest straight distance found between a point of the surface and the nearest site, mm:
    /// a lower bound of the covering radius.
    pub covering_mm: f64,
}

impl VoronoiCells {
    /// Cells of `sites`.
    ///
    /// # Errors
    /// If the sites fail [`Sites::check`].
    pub fn build(sites: &Sites) -> Result<Self> {
        sites.check()?;
        let points: Vec<DVec3> = sites.points.iter().map(|p| p.as_dvec3()).collect();
        let normals: Vec<DVec3> = sites.normals.iter().map(|n| n.as_dvec3()).collect();
        let mean_mm = Spacing::measure_on_sheet(sites).map_or(f64::INFINITY, |s| s.mean_mm);
        let tree = KdTree::build(&points);
        let sides = par::map_blocks(points.len(), BLOCK, |range| {
            range.map(|i| rim_side(i, &points, &normals, &tree, mean_mm)).collect::<Vec<_>>()
        });
        let search_mm = SEARCH * mean_mm;
        Ok(VoronoiCells { sides: sides.concat(), points, normals, tree, search_mm })
    }

    /// The site to which `point` of the surface, with outward unit `normal` there, belongs.
    pub fn owner(&self, point: DVec3, normal: DVec3) -> Option<u32> {
        let own = |i: u32| {
            let i = i as usize;
            same_sheet(point - self.points[i], normal, self.normals[i])
                && self.sides[i].is_none_or(|side| normal.dot(side) > RIM_TURN)
        };
        self.tree.nearest(point, self.search_mm, own).map(|(site, _)| site)
    }

    /// Measures the cells by Monte Carlo: `per_site` random points of `mesh` per site are given to
    /// their owners. With mean count μ, counting noise adds 1/μ to the square of the coefficient of
    /// variation and is taken off again. All zero without sites or faces.
    ///
    /// # Panics
    /// If a face names a missing vertex ([`Mesh::check`]).
    pub fn spread(&self, mesh: &Mesh, per_site: usize, seed: u64) -> CellSpread {
        let ends = cumulative_areas(mesh);
        let n_probes = if ends.is_empty() { 0 } else { self.points.len() * per_site };
        let probes = par::map_blocks(n_probes, BLOCK, |range| {
            let mut stream = Stream::new(seed, 0, range.start as u64, Purpose::Probe);
            let probe = |_| {
                let (point, normal) = random_point(mesh, &ends, &mut stream);
                let nearest = self.tree.nearest(point, f64::INFINITY, |_| true);
                (self.owner(point, normal), nearest.map_or(0.0, |(_, square)| square.sqrt()))
            };
            range.map(probe).collect::<Vec<_>>()
        });
        self.summarize(&probes.concat())
    }

    /// From the owner of each probe and its distance to the nearest site.
    fn summarize(&self, probes: &[(Option<u32>, f64)]) -> CellSpread {
        let mut counts = vec![0.0; self.points.len()];
        let owners = probes.iter().filter_map(|(owner, _)| *owner);
        owners.for_each(|site| counts[site as usize] += 1.0);
        let n_owned = counts.iter().sum::<f64>();
        if n_owned == 0.0 {
            return CellSpread { area_cv: 0.0, unowned: 0.0, covering_mm: 0.0 };
        }
        let (mean, cv) = mean_and_cv(&counts);
        CellSpread {
            area_cv: (cv * cv - 1.0 / mean).max(0.0).sqrt(),
            unowned: 1.0 - n_owned / probes.len() as f64,
            covering_mm: probes.iter().map(|probe| probe.1).fold(0.0, f64::max),
        }
    }
}

/// For a site with neighbors on opposite sheets, midway between its normal and that of the nearest of these.
fn rim_side(
    i: usize,
    points: &[DVec3],
    normals: &[DVec3],
    tree: &KdTree,
    mean_mm: f64,
) -> Option<DVec3> {
    let mut near: Vec<(f64, DVec3)> = Vec::new();
    tree.within(points[i], RIM_REACH * mean_mm, |j, square| {
        let j = j as usize;
        if same_sheet(points[j] - points[i], normals[i], normals[j]) {
            near.push((square, normals[j]));
        }
    });
    near.sort_by(|x, y| x.0.total_cmp(&y.0));
    let is_opposed = |m: &DVec3| near.iter().any(|(_, n)| m.dot(*n) <= OPPOSITE);
    let side = near.iter().map(|(_, n)| *n).find(is_opposed)?;
    Some((normals[i] + side).try_normalize().unwrap_or(normals[i]))
}

/// Area of each face and all before it, mm².
fn cumulative_areas(mesh: &Mesh) -> Vec<f64> {
    let areas = (0..mesh.triangles.len()).map(|f| 0.5 * mesh.area_vector(f).length());
    let add = |sum: &mut f64, area: f64| {
        *sum += area;
        Some(*sum)
    };
    areas.scan(0.0, add).collect()
}

/// A point uniform by area, and the normal of its face.
fn random_point(mesh: &Mesh, ends: &[f64], stream: &mut Stream) -> (DVec3, DVec3) {
    let target = stream.unit() * ends[ends.len() - 1];
    let face = ends.partition_point(|&end| end <= target).min(ends.len() - 1);
    let [a, b, c] = mesh.corners(face);
    let (u, v) = (stream.unit().sqrt(), stream.unit());
    (a + (b - a + (c - b) * v) * u, mesh.area_vector(face).normalize_or_zero())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::sites::{SiteOptions, sample};
    use crate::geom::solids::{cuboid, torus};
    use glam::dvec3;

    #[test]
    fn no_cell_holds_both_sides_of_a_plate_thinner_than_the_spacing() {
        for thickness in [0.1, 1.0, 1.9] {
            let plate = cuboid(dvec3(50.0, 40.0, thickness));
            let n_sites = (plate.area() / (0.866 * 2.0 * 2.0)) as usize;
            let sites = sample(&plate, &SiteOptions { n_sites, ..SiteOptions::default() }).unwrap();
            let spacing = Spacing::measure_on_sheet(&sites).unwrap();
            assert!((1.7..2.1).contains(&spacing.mean_mm) && spacing.cv < 0.12, "{spacing:?}");
            let cells = VoronoiCells::build(&sites).unwrap();
            let mut sides = vec![[false; 2]; sites.len()];
            let ends = cumulative_areas(&plate);
            let mut stream = Stream::new(3, 0, 0, Purpose::Probe);
            for _ in 0..200 * sites.len() {
                let (point, normal) = random_point(&plate, &ends, &mut stream);
                let owner = cells.owner(point, normal).unwrap() as usize;
                if normal.z.abs() > 0.5 {
                    sides[owner][usize::from(normal.z > 0.0)] = true;
                }
            }
            assert!(sides.iter().all(|side| *side != [true, true]), "thickness {thickness}");
            let share = |z: f32| sites.normals.iter().filter(|n| n.z == z).count() as f64;
            // The rim takes a row of about 90 from both sides alike.
            assert!((share(1.0) / share(-1.0) - 1.0).abs() < 0.04, "{}", share(1.0));
            let expected = 2000.0 / plate.area() * sites.len() as f64;
            assert!(share(1.0) > 0.9 * expected, "{} of {expected}", share(1.0));
        }
    }

    #[test]
    fn relaxed_cells_are_even_and_cover_the_surface() {
        let mesh = torus(20.0, 8.0, 60, 30);
        let sites =
            sample(&mesh, &SiteOptions { n_sites: 1500, ..SiteOptions::default() }).unwrap();
        let spread = VoronoiCells::build(&sites).unwrap().spread(&mesh, 64, 1);
        let mean = Spacing::measure(&sites).unwrap().mean_mm;
        assert!(spread.area_cv < 0.10 && spread.unowned == 0.0, "{spread:?}");
        assert!((0.6..super::super::spacing::COVERING).contains(&(spread.covering_mm / mean)));
    }

    /// Gamma distribution of shape 3.575 (Tanemura 2003): 1/√3.575 = 0.529.
    #[test]
    fn random_sites_have_the_known_variation_of_poisson_voronoi_cells() {
        let mesh = torus(20.0, 8.0, 60, 30);
        let ends = cumulative_areas(&mesh);
        let mut stream = Stream::new(5, 0, 0, Purpose::Probe);
        let mut sites = Sites::default();
        for _ in 0..4000 {
            let (point, normal) = random_point(&mesh, &ends, &mut stream);
            sites.points.push(point.as_vec3());
            sites.normals.push(normal.as_vec3());
        }
        let spread = VoronoiCells::build(&sites).unwrap().spread(&mesh, 32, 1);
        assert!((spread.area_cv - 0.529).abs() < 0.03, "{spread:?}");
        // Distances in the plane: Rayleigh, √(4/π − 1) = 0.523.
        let spacing = Spacing::measure(&sites).unwrap();
        assert!((spacing.cv - 0.523).abs() < 0.02, "{spacing:?}");
    }

    #[test]
    fn sites_without_normals_are_refused() {
        let sites = Sites { points: vec![glam::Vec3::ZERO; 3], ..Sites::default() };
        assert!(
            VoronoiCells::build(&sites)
                .err()
                .unwrap()
                .to_string()
                .contains("0 normals for 3 sites")
        );
    }

    #[test]
    fn empty_input_gives_zero() {
        let cells = VoronoiCells::build(&Sites::default()).unwrap();
        assert_eq!(cells.owner(DVec3::ZERO, DVec3::Z), None);
        assert_eq!(cells.spread(&Mesh::default(), 8, 1).area_cv, 0.0);
    }
}

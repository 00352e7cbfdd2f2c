//! Sample sites: near-uniform points on a surface, with outward normals.
//!
//! [`sample`] spreads points by area (`start`) and lets them repel each other along the surface
//! (`relax`) until their spacing is even; `docs/sites.md` says why and how well. Cost: about 30 µs
//! of one core per site.
//!
//! ```
//! use deepmill::geom::sites::{SiteOptions, sample};
//! use deepmill::geom::{solids, spacing::Spacing};
//!
//! let part = solids::cuboid(deepmill::glam::DVec3::new(30.0, 20.0, 10.0));
//! let sites = sample(&part, &SiteOptions::default().with_n_sites(1000))?;
//! assert!(Spacing::measure(&sites).unwrap().cv < 0.12);
//! # Ok::<(), deepmill::Error>(())
//! ```

mod normals;
mod relax;
mod sheet;
mod start;
mod surface;

use crate::exec::{memory, par};
use crate::geom::Mesh;
use crate::{Error, Result};
use glam::Vec3;
use serde::{Deserialize, Serialize};
pub(crate) use sheet::OPPOSITE;
pub(crate) use sheet::same_sheet;
use std::collections::HashSet;
use surface::Surface;
pub(crate) use surface::nearest_in_triangle;

/// Points on a surface with outward unit normals; all vectors have the same length.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Sites {
    /// Positions, mm.
    pub points: Vec<Vec3>,
    /// Outward unit normals.
    pub normals: Vec<Vec3>,
    /// Face each site lies on; empty for a point cloud without a mesh.
    pub faces: Vec<u32>,
}

impl Sites {
    /// Points and normals of these rows, on no mesh; no normals of points in space.
    pub(crate) fn subset(&self, rows: &[usize]) -> Sites {
        let normals = if self.normals.is_empty() { &[] } else { rows };
        Sites {
            points: rows.iter().map(|&i| self.points[i]).collect(),
            normals: normals.iter().map(|&i| self.normals[i]).collect(),
            faces: Vec::new(),
        }
    }

    /// These and then others, on no mesh.
    pub(crate) fn followed_by(&self, others: &Sites) -> Sites {
        Sites {
            points: [&self.points[..], &others.points].concat(),
            normals: [&self.normals[..], &others.normals].concat(),
            faces: Vec::new(),
        }
    }

    /// Sites at `points`, mm, with outward unit `normals`, on no mesh.
    ///
    /// # Errors
    /// As [`Sites::check`].
    ///
    /// ```
    /// use deepmill::{geom::Sites, glam::Vec3};
    /// assert_eq!(Sites::new(vec![Vec3::ZERO, Vec3::X], vec![Vec3::Z; 2])?.len(), 2);
    /// assert!(Sites::new(vec![Vec3::ZERO], vec![Vec3::ONE]).is_err());
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    pub fn new(points: Vec<Vec3>, normals: Vec<Vec3>) -> Result<Self> {
        let sites = Sites { points, normals, faces: Vec::new() };
        sites.check()?;
        Ok(sites)
    }

    /// [`Sites::new`] from plain numbers.
    ///
    /// # Errors
    /// As [`Sites::check`].
    ///
    /// ```
    /// use deepmill::geom::Sites;
    /// let points = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0]];
    /// assert_eq!(Sites::from_slices(&points, &[[0.0, 0.0, 1.0]; 2])?.len(), 2);
    /// assert!(Sites::from_slices(&points, &[[0.0, 0.0, 1.0]]).is_err());
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    pub fn from_slices(points: &[[f32; 3]], normals: &[[f32; 3]]) -> Result<Self> {
        let vectors = |list: &[[f32; 3]]| list.iter().map(|v| Vec3::from_array(*v)).collect();
        Sites::new(vectors(points), vectors(normals))
    }

    /// Number of sites.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Checks that every site has a finite position within 1 km and a unit normal (to a thousandth), and
    /// that there are as many faces as sites, or none.
    ///
    /// # Errors
    /// Names the first site that has not.
    pub fn check(&self) -> Result<()> {
        check_sites("site", &self.points, &self.normals)?;
        if !self.faces.is_empty() && self.faces.len() != self.len() {
            let found = format!("{} faces for {} sites", self.faces.len(), self.len());
            return Err(Error::geometry("sites", found, "give every site its face, or none"));
        }
        Ok(())
    }

    /// Number of sites at the same place as one before them; they stand for no surface.
    pub fn n_coincident(&self) -> usize {
        let bits = |p: &Vec3| (*p + Vec3::ZERO).to_array().map(f32::to_bits);
        self.len() - self.points.iter().map(bits).collect::<HashSet<_>>().len()
    }
}

/// Coordinates beyond this, mm, are refused: squares of distances must stay far inside `f32`.
const MAX_COORDINATE_MM: f32 = 1e6;

/// [`Sites::check`] of sites without faces, which a message calls `what`.
pub(crate) fn check_sites(what: &str, points: &[Vec3], normals: &[Vec3]) -> Result<()> {
    check_points(what, points)?;
    if normals.len() != points.len() {
        let found = format!("{} normals for {} sites", normals.len(), points.len());
        return Err(Error::geometry("sites", found, "give every site its outward unit normal"));
    }
    let unit = |n: &Vec3| n.is_finite() && (n.length_squared() - 1.0).abs() < 1e-3;
    let Some(i) = normals.iter().position(|n| !unit(n)) else { return Ok(()) };
    let found = format!("normal {} is not a unit vector", normals[i]);
    Err(Error::geometry(format!("{what} {i}"), found, "normalize the normals or resample the part"))
}

/// Finite positions within 1 km; `what` they are in a message.
pub(crate) fn check_points(what: &str, points: &[Vec3]) -> Result<()> {
    let usable = |p: &Vec3| p.is_finite() && p.abs().max_element() <= MAX_COORDINATE_MM;
    let Some(i) = points.iter().position(|p| !usable(p)) else { return Ok(()) };
    let remedy = "coordinates must be finite and within 1 km; check the file and its unit";
    Err(Error::geometry(format!("{what} {i}"), format!("position {}", points[i]), remedy))
}

/// Which normal a sampled site carries.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Normals {
    /// The outward normal of the face the site lies on.
    #[default]
    Face,
    /// For smooth parts: corner normals interpolated over the face. A corner's normal is the
    /// angle-weighted mean over the faces around it that are turned by less than `crease_rad`
    /// from the site's face, so edges sharper than that stay sharp.
    Smooth {
        /// Greatest angle between two faces that count as one smooth surface.
        crease_rad: f64,
    },
}

impl AsRef<Sites> for Sites {
    fn as_ref(&self) -> &Sites {
        self
    }
}

/// How [`sample`] places its sites.
///
/// ```
/// use deepmill::geom::sites::{Normals, SiteOptions, sample};
/// use deepmill::geom::solids;
/// let options = SiteOptions::default().with_n_sites(500).with_normals(Normals::Smooth { crease_rad: 0.52 });
/// assert_eq!(sample(&solids::torus(40.0, 15.0, 60, 30), &options)?.len(), 500);
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct SiteOptions {
    /// Number of sites, at least 1.
    pub n_sites: usize,
    /// Seed of the random stream (purpose [`Sites`](crate::numeric::rng::Purpose::Sites)).
    pub seed: u64,
    /// Which normal each site carries.
    pub normals: Normals,
}

setters!(SiteOptions {
    with_n_sites(n_sites: usize),
    with_seed(seed: u64),
    with_normals(normals: Normals),
});

impl Default for SiteOptions {
    /// 7,000 sites as in the paper, seed 0, face normals.
    fn default() -> Self {
        SiteOptions { n_sites: 7000, seed: 0, normals: Normals::Face }
    }
}

/// Most sites that [`sample`] accepts.
pub(crate) const MAX_SITES: usize = 10_000_000;
/// Upper estimate for relaxing and writing them.
const BYTES_OF_SITE: usize = 512;

/// Near-uniform sites on `mesh`, the same for every thread count.
///
/// Normals point to the side that faces look to: outward if the mesh is closed and faces outward, which
/// [`require_labelable`](super::check::require_labelable) checks.
///
/// # Errors
/// If `n_sites` is 0 or above ten million, a crease is not an angle from 0 to π, a face names a missing vertex, a
/// vertex is not finite or beyond 1 km, the mesh has no area, or so many sites do not fit into the memory.
pub fn sample(mesh: &Mesh, options: &SiteOptions) -> Result<Sites> {
    let _floats = par::DefaultFloats::set();
    if options.n_sites == 0 || options.n_sites > MAX_SITES {
        let expected = format!("1 to {MAX_SITES}");
        return Err(Error::argument("sites", options.n_sites, expected, "choose another number"));
    }
    let needed = memory::product([options.n_sites, BYTES_OF_SITE]);
    memory::require("sampling the sites", needed, "ask for fewer sites")?;
    if let Normals::Smooth { crease_rad } = options.normals
        && !(0.0..=std::f64::consts::PI).contains(&crease_rad)
    {
        let remedy = "0.52, which is 30 degrees, suits most parts";
        return Err(Error::argument("crease_rad", crease_rad, "an angle from 0 to pi", remedy));
    }
    let surface = Surface::build(mesh)?;
    let mut places = start::place(&surface, options.n_sites, options.seed);
    relax::relax(&surface, &mut places);
    let normals = match options.normals {
        Normals::Face => places.iter().map(|p| surface.normals[p.face as usize]).collect(),
        Normals::Smooth { crease_rad } => normals::smooth(&surface, &places, crease_rad),
    };
    Ok(Sites {
        points: places.iter().map(|p| p.point.as_vec3()).collect(),
        normals: normals.iter().map(|n| n.as_vec3().normalize()).collect(),
        faces: places.iter().map(|p| p.face).collect(),
    })
}

/// The vertices of `mesh` as sites, in their order, for users who remesh themselves.
///
/// The normal is the mean of the normals of the faces around the vertex, weighted by their angle
/// there; the face is the one among these whose normal is nearest to it (ties: lowest index).
/// Vertices that no face with area uses are left out.
///
/// # Errors
/// As [`sample`].
pub fn from_vertices(mesh: &Mesh) -> Result<Sites> {
    at_vertices(mesh, VertexNormals::Angle).map(|(sites, _)| sites)
}

/// How the faces around a vertex weigh in its normal.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[doc(hidden)] // of the program
pub enum VertexNormals {
    /// By their angle at the vertex: the normal does not depend on how faces are cut into triangles.
    #[default]
    Angle,
    /// By their area, as many programs have it.
    Area,
}

impl std::fmt::Display for VertexNormals {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            VertexNormals::Angle => "angle",
            VertexNormals::Area => "area",
        })
    }
}

/// Reads `angle` or `area`.
impl std::str::FromStr for VertexNormals {
    type Err = Error;

    /// # Errors
    /// If it is neither.
    fn from_str(name: &str) -> Result<Self> {
        match name {
            "angle" => Ok(VertexNormals::Angle),
            "area" => Ok(VertexNormals::Area),
            _ => {
                let remedy = "angle is the default; other programs weigh by area";
                Err(Error::argument("normals", format!("`{name}`"), "angle or area", remedy))
            }
        }
    }
}

/// [`from_vertices`] with a choice of normals, and the vertex of every site.
///
/// # Errors
/// As [`from_vertices`].
#[doc(hidden)] // of the program
pub fn at_vertices(mesh: &Mesh, normals: VertexNormals) -> Result<(Sites, Vec<u32>)> {
    let surface = Surface::build(mesh)?;
    Ok(normals::vertex_sites(&surface, normals))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exec::par;
    use crate::geom::solids::{cuboid, torus};
    use crate::geom::spacing::Spacing;
    use glam::{DVec3, dvec3};
    use proptest::prelude::*;

    fn options(n_sites: usize) -> SiteOptions {
        SiteOptions { n_sites, ..SiteOptions::default() }
    }

    /// Greatest distance of a site from its face, and whether it carries that face's normal.
    fn on_faces(mesh: &Mesh, sites: &Sites) -> (f64, bool) {
        let surface = Surface::build(mesh).unwrap();
        let sites = sites.points.iter().zip(&sites.normals).zip(&sites.faces);
        sites.fold((0.0, true), |(worst, right), ((point, normal), &face)| {
            let point = point.as_dvec3();
            let face = face as usize;
            let off = surface::nearest_in_triangle(point, mesh.corners(face)).distance(point);
            let error = normal.as_dvec3().distance(surface.normals[face]);
            (off.max(worst), right && error < 1e-6)
        })
    }

    #[test]
    fn sites_are_even_on_faces_edges_and_curves() {
        for mesh in [cuboid(dvec3(30.0, 20.0, 10.0)), torus(20.0, 8.0, 80, 40)] {
            let sites = sample(&mesh, &options(3000)).unwrap();
            let spacing = Spacing::measure(&sites).unwrap();
            assert!(spacing.n_sites == 3000 && spacing.cv < 0.06, "{spacing:?}");
            assert!(spacing.min_mm > 0.7 * spacing.mean_mm, "{spacing:?}");
            let (off, right) = on_faces(&mesh, &sites);
            assert!(off <= 1e-6 * mesh.diagonal() && right, "{off}");
        }
    }

    #[test]
    fn sites_are_the_same_for_any_thread_count_and_differ_by_seed() {
        let mesh = torus(20.0, 8.0, 50, 30);
        let with = |n_threads, seed| {
            let options = SiteOptions { seed, ..options(1000) };
            par::with_threads(n_threads, || sample(&mesh, &options).unwrap()).unwrap()
        };
        let one = with(1, 4);
        assert_eq!(one, with(2, 4));
        assert_eq!(one, with(7, 4));
        assert_ne!(one, with(1, 5));
    }

    #[test]
    fn sites_repel_over_a_right_angled_edge_but_not_through_a_wall() {
        let plate = cuboid(dvec3(40.0, 40.0, 0.1));
        let sites = sample(&plate, &options(900)).unwrap();
        let sheet = Spacing::measure_on_sheet(&sites).unwrap();
        assert!(sheet.cv < 0.12 && sheet.min_mm > 0.2 * sheet.mean_mm, "{sheet:?}");
        assert!(Spacing::measure(&sites).unwrap().mean_mm < 0.9 * sheet.mean_mm);
    }

    #[test]
    fn sites_that_are_none_are_named() {
        let good = sample(&cuboid(DVec3::ONE), &options(20)).unwrap();
        good.check().unwrap();
        let broken = |change: &dyn Fn(&mut Sites)| {
            let mut sites = good.clone();
            change(&mut sites);
            sites.check().unwrap_err().to_string()
        };
        for (x, shown) in [(f32::NAN, "NaN"), (f32::INFINITY, "inf"), (1e30, "1000000")] {
            let message = broken(&|sites| sites.points[7].x = x);
            assert!(
                message.starts_with("site 7: position") && message.contains(shown),
                "{message}"
            );
        }
        for normal in [Vec3::ZERO, Vec3::splat(1.0), Vec3::NAN] {
            let message = broken(&|sites| sites.normals[3] = normal);
            assert!(message.starts_with("site 3: normal"), "{message}");
        }
        assert!(broken(&|sites| sites.normals.truncate(19)).contains("19 normals for 20 sites"));
        assert!(broken(&|sites| sites.faces.truncate(19)).contains("19 faces for 20 sites"));
        let mut twice = good.clone();
        (twice.points[4], twice.points[9]) = (twice.points[0], twice.points[0]);
        assert_eq!((good.n_coincident(), twice.n_coincident()), (0, 2));
    }

    #[test]
    fn counts_outside_the_domain_are_refused() {
        let mesh = cuboid(DVec3::ONE);
        for n_sites in [0, MAX_SITES + 1] {
            assert!(sample(&mesh, &options(n_sites)).is_err());
        }
        assert!(sample(&Mesh::default(), &options(5)).is_err());
    }

    #[test]
    fn smooth_normals_follow_the_curve_and_keep_sharp_edges() {
        let crease_rad = 0.7;
        let smooth = |mesh: &Mesh| {
            let normals = Normals::Smooth { crease_rad };
            sample(mesh, &SiteOptions { normals, ..options(500) }).unwrap()
        };
        let ring = smooth(&torus(20.0, 8.0, 60, 30));
        for (point, normal) in ring.points.iter().zip(&ring.normals) {
            let point = point.as_dvec3();
            let core = dvec3(point.x, point.y, 0.0).normalize() * 20.0;
            assert!(normal.as_dvec3().angle_between(point - core) < 0.01);
        }
        let cube = smooth(&cuboid(DVec3::ONE));
        assert!(cube.normals.iter().all(|n| (n.abs().max_element() - 1.0).abs() < 1e-6));
    }

    #[test]
    fn vertex_sites_are_the_vertices_with_angle_weighted_normals() {
        let mut mesh = cuboid(DVec3::splat(2.0));
        mesh.vertices.push(dvec3(9.0, 9.0, 9.0));
        let sites = from_vertices(&mesh).unwrap();
        assert_eq!(sites.len(), 8);
        for i in 0..8 {
            let corner = mesh.vertices[i];
            assert_eq!(sites.points[i].as_dvec3(), corner);
            let outward = (corner - DVec3::ONE).normalize();
            assert!(sites.normals[i].as_dvec3().distance(outward) < 1e-6);
            assert!(mesh.triangles[sites.faces[i] as usize].contains(&(i as u32)));
        }
    }

    /// At the corner of a box 1 × 2 × 3 mm each face has an angle of 90°; where its quad is cut the corner belongs to
    /// one triangle or two, of half the quad's area each.
    #[test]
    fn normals_at_vertices_weigh_faces_by_angle_or_by_area() {
        let mesh = cuboid(dvec3(1.0, 2.0, 3.0));
        let (by_angle, rows) = at_vertices(&mesh, VertexNormals::Angle).unwrap();
        assert_eq!((by_angle, rows), (from_vertices(&mesh).unwrap(), (0..8).collect()));
        let (by_area, _) = at_vertices(&mesh, VertexNormals::Area).unwrap();
        for v in 0..8u32 {
            let halves = |axis: usize| {
                let faces = (0..12).filter(|&f| mesh.triangles[f].contains(&v));
                let along = faces.filter(|&f| mesh.area_vector(f)[axis] != 0.0);
                along.count() as f64
            };
            // Half of the quad's area is 3, 1.5 and 1 mm².
            let [x, y, z] = [3.0, 1.5, 1.0].map(f64::from);
            let sum = dvec3(x * halves(0), y * halves(1), z * halves(2));
            let outward = (mesh.vertices[v as usize] - dvec3(0.5, 1.0, 1.5)).signum();
            let expected = (sum * outward).normalize();
            assert!(by_area.normals[v as usize].as_dvec3().distance(expected) < 1e-6, "{v}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]
        #[test]
        fn sites_of_any_triangle_soup_lie_on_their_faces(
            corners in prop::collection::vec([0i8..5, 0i8..5, 0i8..3], 3..12),
            faces in prop::collection::vec([0usize..12, 0usize..12, 0usize..12], 1..20),
            n_sites in 1usize..150,
            seed: u64,
        ) {
            let vertices: Vec<DVec3> =
                corners.iter().map(|c| DVec3::from_array(c.map(f64::from))).collect();
            let n = vertices.len();
            let triangles = faces.iter().map(|f| f.map(|v| (v % n) as u32)).collect();
            let mesh = Mesh { vertices, triangles };
            let Ok(sites) = sample(&mesh, &SiteOptions { seed, ..options(n_sites) }) else {
                prop_assert!(mesh.area() < 1e-9);
                return Ok(());
            };
            prop_assert_eq!(sites.len(), n_sites);
            let (off, right) = on_faces(&mesh, &sites);
            prop_assert!(off <= 1e-6 * mesh.diagonal() && right, "{}", off);
        }
    }
}

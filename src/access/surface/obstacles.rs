//! The triangles that block, ready for any cutter and any directions.

use super::bvh::Bvh;
use super::cells::Domain;
use super::chords::Chords;
use super::labels::{SurfaceLabels, SurfaceOptions};
use super::problem::Problem;
use super::profile::{self, ProfileTool};
use super::tool::{Contact, Outline};
use crate::access::{Counted, Extent, Labels, Obstacles, Queries, count_for, occlusion_points};
use crate::answers::SiteAnswer;
use crate::answers::n_of_share;
use crate::exec::{memory, par};
use crate::geom::mesh::WITHIN_1_KM;
use crate::geom::{Mesh, Sites};
use crate::tool::cutter::{Cutter, require_steps};
use crate::tool::directions::Directions;
use crate::{Error, Result};
use glam::{DVec3, Vec3};

/// Triangles that a tool must not penetrate: those of the part, then those of fixtures. Triangles without area
/// ([`Mesh::has_area`]) bound nothing and are no obstacles.
///
/// ```
/// use deepmill::access::surface::{SurfaceOptions, TriangleObstacles};
/// use deepmill::answers::SiteAnswer;
/// use deepmill::cutter::{Cutter, CutterParams};
/// use deepmill::directions::Directions;
/// use deepmill::geom::{sites, solids};
///
/// let part = solids::cuboid(deepmill::glam::DVec3::new(30.0, 20.0, 10.0));
/// let sites = sites::sample(&part, &sites::SiteOptions::default().with_n_sites(200))?;
/// let cutter = Cutter::ball_end(CutterParams::from_array([1.5, 20.0, 20.0, 5.0]))?;
/// let obstacles = TriangleObstacles::new(&part, &[])?;
/// let labels = obstacles.label(&sites, &cutter, &Directions::up(), &SurfaceOptions::default())?;
/// // From above, all but the underside can be reached.
/// for (answer, normal) in labels.answers.of_sites().iter().zip(&sites.normals) {
///     assert_eq!(*answer == SiteAnswer::Accessible, normal.z > -0.5);
/// }
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug)]
pub struct TriangleObstacles {
    pub(super) bvh: Bvh,
    pub(super) chords: Chords,
    pub(super) triangles: Vec<[DVec3; 3]>,
}

/// Upper estimate of corners, search tree and edges.
const BYTES_OF_TRIANGLE: usize = 512;

impl TriangleObstacles {
    /// The triangles of `part` and of `fixtures`; builds the search tree, about a second per million of them.
    ///
    /// Triangles block from both sides, so nothing depends on which side they face, and open meshes are taken as they
    /// are: a tool can be inside of one, and no answer says so. Where only solids make sense, check them before:
    ///
    /// ```
    /// use deepmill::access::surface::TriangleObstacles;
    /// use deepmill::geom::{check, solids};
    ///
    /// let mut part = solids::cuboid(deepmill::glam::DVec3::ONE);
    /// check::require_labelable(&part)?;
    /// part.triangles.pop();
    /// assert!(check::require_labelable(&part).is_err() && TriangleObstacles::new(&part, &[]).is_ok());
    /// # Ok::<(), deepmill::Error>(())
    /// ```
    ///
    /// # Errors
    /// If no face of the part has an area, a face names a missing vertex, a vertex is not finite or beyond 1 km, or
    /// there are more than two thousand million triangles.
    pub fn new(part: &Mesh, fixtures: &[Mesh]) -> Result<Self> {
        let meshes = || std::iter::once(part).chain(fixtures);
        let needed =
            memory::product([meshes().map(|mesh| mesh.triangles.len()).sum(), BYTES_OF_TRIANGLE]);
        memory::require("the search tree of triangles", needed, "simplify the mesh")?;
        let mut triangles = Vec::new();
        for mesh in meshes() {
            mesh.check_within(&WITHIN_1_KM)?;
            triangles.extend((0..mesh.triangles.len()).map(|f| mesh.corners(f)));
        }
        if !(0..part.triangles.len()).any(|f| part.has_area(f)) {
            let remedy = "give the triangles of the part's surface";
            return Err(Error::geometry("part", "no face has an area", remedy));
        }
        if triangles.len() > u32::MAX as usize / 2 {
            let found = format!("{} triangles", triangles.len());
            return Err(Error::geometry("mesh", found, "label in parts"));
        }
        Ok(TriangleObstacles { bvh: Bvh::new(&triangles), chords: Chords::of(part), triangles })
    }

    /// Number of triangles that block.
    pub fn n_triangles(&self) -> usize {
        self.bvh.n_triangles()
    }

    /// Number of triangles without area, which block nothing.
    pub fn n_without_area(&self) -> usize {
        self.triangles.len() - self.bvh.n_triangles()
    }

    /// Answers for `queries`, sites of the part or points of space, by the [module](super)'s definition; of sites with
    /// β and occlusion points, if wanted: β counts, as in [`access`](crate::access), the pairs (inaccessible site,
    /// direction tested) in which a site is in the steps of the shrunk tool.
    ///
    /// # Errors
    /// If a coordinate is not finite or beyond 1 km, a site lacks a unit normal, the tolerance is not positive or not
    /// below the cutter's radius, an option is outside its domain, β of a tool given by its profile is wanted, or the
    /// answers would not fit into the memory.
    pub fn label<'a>(
        &self,
        queries: impl Into<Queries<'a>>,
        cutter: &Cutter,
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> Result<Labels> {
        let _floats = par::DefaultFloats::set();
        let queries = queries.into();
        let (Queries::Sites(sites), true) = (queries, options.occlusion) else {
            return Ok(self.surface_labels(queries, cutter, directions, options)?.into_labels());
        };
        require_steps(cutter.profile(), "turn occlusion off")?;
        let labels = self.surface_labels(queries, cutter, directions, options)?;
        let greatest = labels.evidence.tolerance_mm.iter().fold(0.0, |a: f64, b| a.max(*b));
        let shrunk = (cutter, greatest);
        let which = match options.beta {
            true => Counted::All,
            false => Counted::Greatest(n_of_share(options.share, sites.len())),
        };
        let beta = count_beta((sites, which), shrunk, directions, &labels.inaccessible())?;
        let mut labels = labels.into_labels();
        labels.answers.occlusion = occlusion_points(&beta, options.share);
        if options.beta {
            labels.beta = beta;
        }
        Ok(labels)
    }

    /// [`TriangleObstacles::label`] without β.
    pub(crate) fn surface_labels<'a>(
        &self,
        queries: impl Into<Queries<'a>>,
        cutter: &Cutter,
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> Result<SurfaceLabels> {
        let _floats = par::DefaultFloats::set();
        options.check()?;
        let (queries, tested, domain) =
            (queries.into(), tested(directions)?, Domain::of(directions));
        extent(queries.len(), 1, &tested, options).require_surface()?;
        let problem = self.problem(queries, cutter, options)?;
        if let Some(profile) = cutter.profile() {
            if options.clearance_limit_mm.is_some() {
                require_steps(Some(profile), "leave the clearance limit out")?;
            }
            let tool = ProfileTool::new(&self.bvh, &problem.tolerances, profile, options.finish_mm);
            let part = (problem.part, problem.own_tolerances);
            let domain = domain.filter(|_| options.refinement.is_some());
            return Ok(profile::label(&tool, &problem.contacts, (&tested, domain), part));
        }
        let tallies = problem.by_triangles(cutter, &tested, domain, options)?;
        let clearance = options.clearance_limit_mm.map(|limit| {
            let (answers, witness): (Vec<_>, Vec<_>) =
                tallies.iter().map(|(tally, _)| (tally.answer(), tally.witness)).unzip();
            let inaccessible: Vec<_> =
                answers.iter().map(|answer| *answer == SiteAnswer::Inaccessible).collect();
            problem.clearance(&tested, &witness, &inaccessible, limit)
        });
        let labels = problem.labels(tallies, &tested, options);
        Ok(SurfaceLabels { clearance_mm: clearance.unwrap_or_default(), ..labels })
    }

    pub(super) fn problem(
        &self,
        queries: Queries,
        cutter: &Cutter,
        options: &SurfaceOptions,
    ) -> Result<Problem<'_>> {
        let outline = Outline::new(cutter, options.finish_mm);
        let tolerances = options.tolerance.of_triangles(&outline, &self.chords, &self.bvh)?;
        let contacts = match queries {
            Queries::Sites(sites) => contacts(sites)?,
            Queries::Volume(points) => {
                check_points("query", points)?;
                let contact = |p: &Vec3| Contact { point: p.as_dvec3(), normal: None };
                points.iter().map(contact).collect()
            }
        };
        let part = &self.triangles[..self.chords.len()];
        Ok(Problem::new(&self.bvh, part, contacts, tolerances, outline))
    }
}

/// β for the `marked` sites, for the cutter shrunk by a tolerance.
pub(super) fn count_beta(
    (sites, counted): (&Sites, Counted),
    (cutter, tolerance): (&Cutter, f64),
    directions: &Directions,
    marked: &[bool],
) -> Result<Vec<u64>> {
    let shrunk = cutter.grown(-tolerance)?;
    let obstacles = (Obstacles::Queries, counted);
    count_for(Queries::Sites(sites), obstacles, &shrunk, &tested(directions)?, marked)
}

/// What is to be labeled.
pub(super) fn extent(
    n_queries: usize,
    n_cutters: usize,
    tested: &Directions,
    options: &SurfaceOptions,
) -> Extent {
    let (n_obstacles, n_directions) = (options.n_samples, tested.len());
    Extent { n_queries, n_obstacles, n_cutters, n_directions, occlusion: options.occlusion }
}

/// The directions of a set, after +z if it stands for all within an angle that +z is among.
pub(crate) fn tested(directions: &Directions) -> Result<Directions> {
    let above = Domain::of(directions).is_some_and(|domain| domain.holds(DVec3::Z));
    if !above || directions.vectors().contains(&Vec3::Z) {
        return Ok(directions.clone());
    }
    directions.after_up()
}

pub(super) fn contacts(sites: &Sites) -> Result<Vec<Contact>> {
    let Sites { points, normals, .. } = sites;
    if normals.len() != points.len() {
        let found = format!("{} normals for {} sites", normals.len(), points.len());
        let remedy = "give every site its outward unit normal";
        return Err(Error::geometry("query sites", found, remedy));
    }
    check_points("query", points)?;
    let unit = |n: &Vec3| n.is_finite() && (n.length_squared() - 1.0).abs() < 1e-3;
    if let Some(i) = normals.iter().position(|n| !unit(n)) {
        let found = format!("normal {} is not a unit vector", normals[i]);
        let remedy = "normalize the normals or resample the part";
        return Err(Error::geometry(format!("query {i}"), found, remedy));
    }
    let touch = |(point, normal): (&Vec3, &Vec3)| Contact {
        point: point.as_dvec3(),
        normal: Some(normal.as_dvec3().normalize()),
    };
    Ok(points.iter().zip(normals).map(touch).collect())
}

fn check_points(what: &str, points: &[Vec3]) -> Result<()> {
    let usable = |p: &Vec3| p.is_finite() && f64::from(p.abs().max_element()) <= WITHIN_1_KM.mm;
    let Some(i) = points.iter().position(|p| !usable(p)) else { return Ok(()) };
    let remedy = "coordinates must be finite and within 1 km; check the file and its unit";
    Err(Error::geometry(format!("{what} {i}"), format!("position {}", points[i]), remedy))
}

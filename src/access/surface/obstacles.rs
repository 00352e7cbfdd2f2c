//! The triangles that block, ready for any cutter and any directions.

use super::bvh::Bvh;
use super::cells::Domain;
use super::labels::{SurfaceLabels, SurfaceOptions, SurfaceStats, Tally};
use super::query::{Probe, Scratch};
use super::refine::{Hints, Place, Refinement};
use super::samples;
use super::tolerance::Bends;
use super::tool::{Contact, Outline, Stand, axes};
use super::verdict::{Verdict, raise_at};
use crate::access::driver::count_for;
use crate::access::{self, LabelOptions, Labels, Obstacles, Queries, Reach, occlusion_points};
use crate::cutter::Cutter;
use crate::directions::{DirectionSet, Directions};
use crate::geom::{Mesh, Sites};
use crate::{Error, Result, par};
use glam::{DVec3, Vec3};

/// Triangles that a tool must not penetrate: those of the part, then those of fixtures.
///
/// ```
/// use deepmill::access::surface::{SiteAnswer, SurfaceOptions, TriangleObstacles};
/// use deepmill::cutter::{Cutter, CutterParams};
/// use deepmill::directions::Directions;
/// use deepmill::geom::{sites, solids};
///
/// let part = solids::cuboid(glam::DVec3::new(30.0, 20.0, 10.0));
/// let sites = sites::sample(&part, &sites::SiteOptions { n_sites: 200, ..Default::default() })?;
/// let cutter = Cutter::ball_end(CutterParams::from_array([1.5, 20.0, 20.0, 5.0]))?;
/// let obstacles = TriangleObstacles::new(&part, &[])?;
/// let labels = obstacles.label(&sites, &cutter, &Directions::up(), &SurfaceOptions::default())?;
/// // From above, all but the underside can be reached.
/// for (answer, normal) in labels.answers.iter().zip(&sites.normals) {
///     assert_eq!(*answer == SiteAnswer::Accessible, normal.z > -0.5);
/// }
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug)]
pub struct TriangleObstacles {
    bvh: Bvh,
    bends: Bends,
    triangles: Vec<[DVec3; 3]>,
}

/// Coordinates beyond this are refused, as in [`label`](crate::access::label()).
const MAX_COORDINATE_MM: f64 = 1e6;

/// What separates a collision that a point proves from one that is left to the triangles, as a share of all lengths:
/// several times what `f32` can round.
const MARGIN: f64 = 2e-6;

impl TriangleObstacles {
    /// The triangles of `part` and of `fixtures`; builds the search tree, about a second per million of them.
    ///
    /// # Errors
    /// If a face names a missing vertex, a vertex is not finite or beyond 1 km, or there are more than two thousand
    /// million triangles.
    pub fn new(part: &Mesh, fixtures: &[Mesh]) -> Result<Self> {
        let mut triangles = Vec::new();
        for mesh in std::iter::once(part).chain(fixtures) {
            check(mesh)?;
            triangles.extend((0..mesh.triangles.len()).map(|f| mesh.corners(f)));
        }
        if triangles.len() > u32::MAX as usize / 2 {
            let found = format!("{} triangles", triangles.len());
            return Err(Error::geometry("mesh", found, "label in parts"));
        }
        Ok(TriangleObstacles {
            bvh: Bvh::new(triangles.clone()),
            bends: Bends::of(part),
            triangles,
        })
    }

    /// Number of triangles.
    pub fn n_triangles(&self) -> usize {
        self.bvh.n_triangles()
    }

    /// Answers for `queries`, sites of the part or points of space, by the [module](super)'s definition.
    ///
    /// # Errors
    /// If a coordinate is not finite or beyond 1 km, a site lacks a unit normal, the tolerance is not positive or not below
    /// the cutter's radius, or an option is outside its domain.
    pub fn label<'a>(
        &self,
        queries: impl Into<Queries<'a>>,
        cutter: &Cutter,
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> Result<SurfaceLabels> {
        options.check()?;
        let problem = self.problem(queries.into(), cutter, options)?;
        let (asked, domain) = (asked(directions)?, Domain::of(directions));
        let reach = problem.by_points(cutter, &asked, options)?;
        let tallies = problem.by_triangles(&reach, &asked, domain, options);
        Ok(problem.labels(tallies, &asked, options))
    }

    /// As [`TriangleObstacles::label`], for sites, and with β and occlusion points if asked for: β counts, as in
    /// [`access`](crate::access), the pairs (inaccessible site, direction asked) in which a site is in the steps of the shrunk tool.
    ///
    /// # Errors
    /// As [`TriangleObstacles::label`].
    pub fn label_sites(
        &self,
        sites: &Sites,
        cutter: &Cutter,
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> Result<Labels> {
        let surface = self.label(sites, cutter, directions, options)?;
        let inaccessible = surface.inaccessible();
        let mut labels = Labels {
            witness: vec![None; sites.len()],
            accessible_directions: surface.accessible_directions.clone(),
            ..Labels::default()
        };
        if options.occlusion {
            let tolerance = surface.tolerance_mm.iter().fold(0.0, |a: f64, b| a.max(*b));
            let shrunk = cutter.with_clearance(-tolerance)?;
            let (queries, asked) = (Queries::Sites(sites), asked(directions)?);
            labels.beta = count_for(queries, Obstacles::Queries, &shrunk, &asked, &inaccessible)?;
            labels.occlusion = occlusion_points(&labels.beta, options.share);
        }
        Ok(Labels { inaccessible, surface: Some(surface), ..labels })
    }

    /// As [`TriangleObstacles::label`], by the plain loops of [`raise`](super::raise): slow, the law.
    ///
    /// # Errors
    /// As [`TriangleObstacles::label`].
    pub fn label_by_drop_heights<'a>(
        &self,
        queries: impl Into<Queries<'a>>,
        cutter: &Cutter,
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> Result<SurfaceLabels> {
        options.check()?;
        let problem = self.problem(queries.into(), cutter, options)?;
        let asked = asked(directions)?;
        let tally = |i: usize| {
            let verdict = |d: Vec3| {
                let (contact, tolerance) = (&problem.contacts[i], problem.tolerances[i]);
                Verdict::of(raise_at(&self.triangles, &problem.outline, tolerance, contact, d))
            };
            let mut tally = Tally::default();
            asked.vectors().iter().for_each(|&d| tally.add(d, verdict(d)));
            (tally, SurfaceStats::default())
        };
        let tallies = par::map(problem.contacts.len(), |i| vec![tally(i)]);
        Ok(problem.labels(tallies, &asked, options))
    }

    fn problem(
        &self,
        queries: Queries,
        cutter: &Cutter,
        options: &SurfaceOptions,
    ) -> Result<Problem<'_>> {
        let outline = Outline::new(cutter);
        let (contacts, tolerances) = match queries {
            Queries::Sites(sites) => {
                let contacts = contacts(sites)?;
                (contacts, options.tolerance.at_sites(&outline, &self.bends, &self.bvh, sites)?)
            }
            Queries::Volume(points) => {
                check_points("query", points)?;
                let tips = points.iter().map(|p| Contact::Volume { tip: p.as_dvec3() });
                (tips.collect(), vec![options.tolerance.least(&outline)?; points.len()])
            }
        };
        let far = contacts.iter().map(|contact| contact.point().distance(self.bvh.origin()));
        let reach = far.fold(self.bvh.radius(), f64::max) + outline.radius();
        Ok(Problem { obstacles: self, contacts, tolerances, outline, reach })
    }
}

/// The directions of a set, after +z if it stands for all within an angle that +z is among.
fn asked(directions: &Directions) -> Result<Directions> {
    let above = Domain::of(directions).is_some_and(|domain| domain.holds(DVec3::Z));
    if !above || directions.vectors().contains(&Vec3::Z) {
        return Ok(directions.clone());
    }
    let vectors = std::iter::once(&Vec3::Z).chain(directions.vectors());
    let vectors = vectors.map(|d| d.as_dvec3().to_array()).collect();
    Directions::new(DirectionSet::List { vectors })
}

fn contacts(sites: &Sites) -> Result<Vec<Contact>> {
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
        let remedy = "normalise the normals or resample the part";
        return Err(Error::geometry(format!("query {i}"), found, remedy));
    }
    let touch = |(point, normal): (&Vec3, &Vec3)| Contact::Surface {
        point: point.as_dvec3(),
        normal: normal.as_dvec3().normalize(),
    };
    Ok(points.iter().zip(normals).map(touch).collect())
}

fn check_points(what: &str, points: &[Vec3]) -> Result<()> {
    let usable = |p: &Vec3| p.is_finite() && f64::from(p.abs().max_element()) <= MAX_COORDINATE_MM;
    let Some(i) = points.iter().position(|p| !usable(p)) else { return Ok(()) };
    let remedy = "coordinates must be finite and within 1 km; check the file and its unit";
    Err(Error::geometry(format!("{what} {i}"), format!("position {}", points[i]), remedy))
}

fn check(mesh: &Mesh) -> Result<()> {
    let n = mesh.vertices.len();
    if let Some(f) = mesh.triangles.iter().position(|t| t.iter().any(|&v| v as usize >= n)) {
        let found = format!("names a vertex beyond the last of {n}");
        return Err(Error::geometry(format!("face {f}"), found, "check the file"));
    }
    let usable = |v: &DVec3| v.is_finite() && v.abs().max_element() <= MAX_COORDINATE_MM;
    let Some(v) = mesh.vertices.iter().position(|v| !usable(v)) else { return Ok(()) };
    let remedy = "coordinates must be finite and within 1 km; check the file and its unit";
    Err(Error::geometry(format!("vertex {v}"), format!("position {}", mesh.vertices[v]), remedy))
}

/// One cutter at all queries.
struct Problem<'a> {
    obstacles: &'a TriangleObstacles,
    contacts: Vec<Contact>,
    tolerances: Vec<f64>,
    outline: Outline,
    /// Greatest distance of a reference point from the middle of the triangles, mm.
    reach: f64,
}

/// A block of queries shares a word of the answers by points.
const WORD: usize = 64;

impl Problem<'_> {
    /// Where points of the surface prove a collision. The tool is shrunk by the greatest tolerance and by more than all
    /// roundings, and all is about the middle of the triangles, where `f32` is finest.
    fn by_points(
        &self,
        cutter: &Cutter,
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> Result<Reach> {
        let TriangleObstacles { bvh, triangles, .. } = self.obstacles;
        let origin = bvh.origin();
        let margin = MARGIN * (bvh.radius() + self.reach + self.outline.size());
        let tolerance = self.tolerances.iter().fold(0.0, |a: f64, b| a.max(*b));
        let shrunk = cutter.with_clearance(-(tolerance + margin))?;
        // A table would take nearly all points for itself.
        let part = &triangles[..self.obstacles.bends.len()];
        let samples = samples::points(part, options.n_samples, origin);
        let samples: Vec<Vec3> = samples.into_iter().map(|p| p.as_vec3()).collect();
        let mut sites = Sites::default();
        for contact in &self.contacts {
            sites.points.push((contact.point() - origin).as_vec3());
            sites.normals.extend(contact.normal().map(|normal| normal.as_vec3()));
        }
        let volume = sites.normals.is_empty();
        let queries = if volume { Queries::Volume(&sites.points) } else { Queries::Sites(&sites) };
        let obstacles = Obstacles::Points(&samples);
        let options = LabelOptions { occlusion: false, matrix: true, ..LabelOptions::default() };
        let labels = access::label(queries, obstacles, &shrunk, directions, &options)?;
        Ok(labels.reach.expect("the matrix was asked for"))
    }

    /// Asks the triangles about the pairs that points leave open.
    fn by_triangles(
        &self,
        reach: &Reach,
        directions: &Directions,
        domain: Option<Domain>,
        options: &SurfaceOptions,
    ) -> Vec<Vec<(Tally, SurfaceStats)>> {
        let axes: Vec<_> = directions.vectors().iter().map(|&d| axes(d)).collect();
        let refinement = options.refinement.zip(domain).map(|(options, domain)| {
            Refinement::new(domain, options.n_tests, options.resolution_rad)
        });
        par::map_blocks(self.contacts.len(), WORD, |range| {
            let (mut scratch, mut hints) = (Scratch::default(), Hints::default());
            let word = range.start / WORD;
            let column: Vec<u64> = (0..axes.len()).map(|k| reach.words(k)[word]).collect();
            let mut probe: Option<(f64, Probe)> = None;
            range
                .map(|i| {
                    let tolerance = self.tolerances[i];
                    let (_, probe) = match probe.take().filter(|probe| probe.0 == tolerance) {
                        Some(known) => probe.insert(known),
                        None => probe.insert((tolerance, self.probe(tolerance))),
                    };
                    scratch = Scratch::renewed(std::mem::take(&mut scratch));
                    let mut tally =
                        self.tally(i, probe, &axes, &column, options.counts, &mut scratch);
                    if let Some(refinement) = &refinement {
                        self.refine(i, probe, refinement, &mut tally, &mut hints, &mut scratch);
                    }
                    tally
                })
                .collect()
        })
    }

    fn probe(&self, tolerance: f64) -> Probe {
        Probe::new(&self.outline, tolerance, &self.obstacles.bvh, self.reach)
    }

    fn tally(
        &self,
        i: usize,
        probe: &Probe,
        axes: &[[DVec3; 3]],
        column: &[u64],
        counts: bool,
        scratch: &mut Scratch,
    ) -> (Tally, SurfaceStats) {
        let mut tally = Tally { open: 1.0, ..Tally::default() };
        let mut stats = SurfaceStats { pairs: axes.len() as u64, ..SurfaceStats::default() };
        for (axes, word) in axes.iter().zip(column) {
            let trusted = self.contacts[i].is_steady(&self.outline, axes[2]);
            if trusted && word >> (i % WORD) & 1 == 1 {
                stats.by_points += 1;
                continue;
            }
            let reference = self.contacts[i].reference_point(&self.outline, axes[2]);
            let stand = Stand { reference, axes: *axes };
            tally.add(axes[2].as_vec3(), probe.verdict(&self.obstacles.bvh, &stand, scratch));
            if tally.witness.is_some() && !counts {
                break;
            }
        }
        stats.tools_tested = scratch.n_queries;
        stats.triangles_tested = scratch.n_triangles;
        (tally, stats)
    }

    /// Searches between the directions if none of them reaches the query.
    fn refine(
        &self,
        i: usize,
        probe: &Probe,
        refinement: &Refinement,
        (tally, stats): &mut (Tally, SurfaceStats),
        hints: &mut Hints,
        scratch: &mut Scratch,
    ) {
        if tally.witness.is_some() {
            return;
        }
        let bvh = &self.obstacles.bvh;
        let place = Place { contact: &self.contacts[i], outline: &self.outline, probe, bvh };
        let found = refinement.search(&place, tally.collision_free > 0, hints, scratch);
        tally.witness = found.witness.map(|direction| direction.as_vec3());
        tally.free_between = found.collision_free;
        tally.open = found.open as f32;
        stats.found_between = u64::from(found.witness.is_some());
        stats.tools_tested = scratch.n_queries;
        stats.triangles_tested = scratch.n_triangles;
    }

    fn labels(
        self,
        tallies: Vec<Vec<(Tally, SurfaceStats)>>,
        directions: &Directions,
        options: &SurfaceOptions,
    ) -> SurfaceLabels {
        let mut labels = SurfaceLabels {
            tolerance_mm: self.tolerances,
            n_directions: directions.len(),
            ..SurfaceLabels::default()
        };
        for (tally, stats) in tallies.into_iter().flatten() {
            labels.answers.push(tally.answer());
            labels.witness.push(tally.witness);
            labels.open_directions.push(if tally.witness.is_some() { 0.0 } else { tally.open });
            if options.counts {
                labels.collision_free_directions.push(tally.collision_free);
                labels.accessible_directions.push(tally.accessible);
            }
            labels.stats += stats;
        }
        labels
    }
}

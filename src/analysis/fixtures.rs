//! Fixtures and the table: what is wrong with them, and what they keep out of reach.

use crate::access::Labels;
use crate::access::surface::{SurfaceOptions, TriangleObstacles};
use crate::answers::SiteAnswer;
use crate::data::files::tools::Tool;
use crate::findings::{Findings, add_fixtures};
use crate::geom::check::{self, Fault};
use crate::geom::{Mesh, Sites, bodies};
use crate::tool::directions::Directions;
use crate::{Error, Result};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// A fixture may share this of the part's volume: roundings of faces that lie on each other.
const ROUNDING: f64 = 1e-6;
/// Coordinates beyond this are refused.
const MAX_COORDINATE_MM: f64 = 1e6;

/// A mesh that blocks beside the part, such as a clamp or a vise.
///
/// A clamp lies on the right half of a block, and beyond:
///
/// ```
/// use deepmill::analysis::{Analysis, Fixture};
/// use deepmill::data::files::tools::Tool;
/// use deepmill::{geom::solids, glam::DVec3};
///
/// let block = solids::cuboid(DVec3::new(40.0, 30.0, 20.0));
/// let mut clamp = solids::cuboid(DVec3::new(30.0, 30.0, 5.0));
/// clamp.vertices.iter_mut().for_each(|v| *v += DVec3::new(20.0, 0.0, 20.0));
/// let tool = Tool::new("3,30,20,20".parse()?, Some(0.0), 0.0)?;
/// let outcome = Analysis::new("block", block, vec![tool])
///     .n_sites(300)
///     .directions("up".parse()?)
///     .fixture(Fixture::new("clamp", clamp))
///     .run(&mut ())?;
/// let (sites, accessible) = (outcome.sites(), &outcome.accessible()[0]);
/// for i in (0..sites.len()).filter(|&i| sites.normals[i].z > 0.5) {
///     // A flat end touches with its rim too: it comes up to the clamp.
///     assert_eq!(accessible[i], sites.points[i].x < 20.0);
/// }
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Fixture {
    /// Name for findings and files.
    pub name: String,
    /// Its surface in the part's coordinates, mm.
    pub mesh: Mesh,
}

impl Fixture {
    /// A mesh with a name.
    pub fn new(name: impl Into<String>, mesh: Mesh) -> Self {
        Fixture { name: name.into(), mesh }
    }

    /// The fixtures of a part, with a table at a height if there is one; what is wrong with them, a sentence each.
    ///
    /// # Errors
    /// If a corner or the height is not finite or beyond 1 km, or as [`bodies::overlap`].
    pub fn around(
        part: &Mesh,
        mut fixtures: Vec<Fixture>,
        table_z_mm: Option<f64>,
    ) -> Result<(Vec<Fixture>, Vec<String>)> {
        let mut warnings = Vec::new();
        for fixture in &fixtures {
            fixture.require_finite()?;
            warnings.extend(fixture.warnings(part)?);
        }
        if let Some(z_mm) = table_z_mm {
            fixtures.push(Fixture::table(part, z_mm)?);
            warnings.extend(Fixture::table_warning(part, z_mm));
        }
        Ok((fixtures, warnings))
    }

    /// A square at a height, far wider than the part: a table.
    fn table(part: &Mesh, z_mm: f64) -> Result<Self> {
        if !z_mm.is_finite() || z_mm.abs() > MAX_COORDINATE_MM {
            let remedy = "give the height of its surface in the part's coordinates";
            return Err(Error::argument("table", z_mm, "a height in mm within 1 km", remedy));
        }
        let (low, high) = part.bounds().unwrap_or_default();
        let width = 4.0 * (high - low).length() + 1000.0;
        Ok(Fixture::square(part, [DVec3::X, DVec3::Y, DVec3::Z], (z_mm, width)))
    }

    /// A table along x' and y' of a setup, so far below the lowest place of the part and below its middle; twice as
    /// wide as the diagonal of its box, if it has no width: against a wide one no tool can tilt whose spindle is a half
    /// space.
    pub(super) fn table_below(
        part: &Mesh,
        turn: [DVec3; 3],
        mm: f64,
        width_mm: Option<f64>,
    ) -> Self {
        let lowest = part.vertices.iter().map(|p| p.dot(turn[2])).fold(f64::INFINITY, f64::min);
        let (low, high) = part.bounds().unwrap_or_default();
        let width = width_mm.unwrap_or(2.0 * (high - low).length());
        Fixture::square(part, turn, (lowest - mm, width))
    }

    /// A table across the last of the axes, at a height along it, below or above the middle of the part.
    fn square(part: &Mesh, [u, v, w]: [DVec3; 3], (height_mm, width_mm): (f64, f64)) -> Self {
        let (low, high) = part.bounds().unwrap_or_default();
        let half = 0.5 * width_mm;
        let middle = 0.5 * (low + high);
        let middle = middle.reject_from_normalized(w) + height_mm * w;
        let vertices = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let vertices = vertices.into_iter().map(|(x, y)| middle + half * (x * u + y * v)).collect();
        Fixture::new("table", Mesh { vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] })
    }

    /// What is wrong with a table that cuts through the part.
    fn table_warning(part: &Mesh, z_mm: f64) -> Option<String> {
        let (low, high) = part.bounds()?;
        (z_mm > low.z).then(|| {
            format!(
                "the table at z = {z_mm} mm is not below the part, which reaches from {:.3} to {:.3} mm",
                low.z, high.z
            )
        })
    }

    /// An error if a corner is not finite or beyond 1 km.
    fn require_finite(&self) -> Result<()> {
        let usable = |v: &DVec3| v.is_finite() && v.abs().max_element() <= MAX_COORDINATE_MM;
        let vertices = &self.mesh.vertices;
        let Some(k) = vertices.iter().position(|v| !usable(v)) else { return Ok(()) };
        let found = format!("position {}", vertices[k]);
        let remedy = "coordinates of a fixture must be finite and within 1 km; check the file and its unit (`--unit` at the command line)";
        Err(Error::file(&self.name, format!("vertex {k}"), found, remedy))
    }

    /// What is wrong with one that is open, overlaps the part, or encloses it; a sentence each.
    fn warnings(&self, part: &Mesh) -> Result<Vec<String>> {
        let Fixture { name, mesh } = self;
        let n_open = check::check(mesh).count(Fault::OpenEdge);
        if n_open > 0 {
            return Ok(vec![format!(
                "{name} is open ({n_open} edges with one triangle): it blocks where its triangles are, its inside does \
                 not, and whether it overlaps the part is not known"
            )]);
        }
        let Some(overlap) = bodies::overlap(part, mesh)? else { return Ok(Vec::new()) };
        let mut warnings = Vec::new();
        if overlap.encloses {
            warnings.push(format!(
                "{name} encloses the part: no tool reaches it; check its place and unit"
            ));
        }
        let (common, share) = (overlap.common_mm3, overlap.share_of_part);
        if share > ROUNDING {
            warnings.push(format!(
                "{name} overlaps the part by {common:.2} mm³ ({:.3} % of it): what is inside the fixture counts as out \
                 of reach; check its place and unit",
                100.0 * share
            ));
        }
        Ok(warnings)
    }
}

/// What fixtures keep each tool from.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct KeptOut {
    /// Names of what keeps tools off: each fixture, the table, and if there are more than one, `several fixtures`.
    pub names: Vec<String>,
    /// Per tool and site: the number of the name of what keeps the tool off, if the part alone does not.
    pub by_tool: Vec<Vec<Option<usize>>>,
}

impl KeptOut {
    /// Labels what is not accessible again without each of the fixtures, and without all.
    pub(super) fn find(
        (mesh, fixtures): (&Mesh, &[Fixture]),
        (sites, labels): (&Sites, &[&Labels]),
        tools: &[Tool],
        (directions, options): (&Directions, &SurfaceOptions),
    ) -> Result<Self> {
        let mut names: Vec<String> = fixtures.iter().map(|fixture| fixture.name.clone()).collect();
        let options = SurfaceOptions { occlusion: false, clearance_limit_mm: None, ..*options };
        let mut without: Vec<TriangleObstacles> = Vec::new();
        if fixtures.len() > 1 {
            for k in 0..fixtures.len() {
                let others = fixtures[..k].iter().chain(&fixtures[k + 1..]);
                let others: Vec<Mesh> = others.map(|fixture| fixture.mesh.clone()).collect();
                without.push(TriangleObstacles::new(mesh, &others)?);
            }
            names.push("several fixtures".into());
        }
        if !fixtures.is_empty() {
            without.push(TriangleObstacles::new(mesh, &[])?);
        }
        let of_tool = |(tool, labels): (&Tool, &&Labels)| {
            let mut kept_by = vec![None; sites.len()];
            let accessible = labels.answers.accessible();
            for (k, obstacles) in without.iter().enumerate() {
                let rows = (0..sites.len()).filter(|&i| !accessible[i] && kept_by[i].is_none());
                let rows: Vec<usize> = rows.collect();
                if rows.is_empty() {
                    break;
                }
                let points = rows.iter().map(|&i| sites.points[i]).collect();
                let left = Sites::new(points, rows.iter().map(|&i| sites.normals[i]).collect())?;
                let again = obstacles.surface_labels(&left, &tool.cutter, directions, &options)?;
                for (row, answer) in rows.into_iter().zip(again.answers) {
                    if answer == SiteAnswer::Accessible {
                        kept_by[row] = Some(k);
                    }
                }
            }
            Ok(kept_by)
        };
        let by_tool = tools.iter().zip(labels).map(of_tool).collect::<Result<_>>()?;
        Ok(KeptOut { names, by_tool })
    }

    /// Names the fixtures in the findings of each tool.
    pub(super) fn add_to<'a>(&self, findings: impl Iterator<Item = &'a mut Findings>) {
        for (found, kept_by) in findings.zip(&self.by_tool) {
            add_fixtures(found, &self.names, kept_by);
        }
    }
}

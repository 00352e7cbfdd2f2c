//! Triangles of one solid, and whether they are those of the whole solid.

use super::guarded;
use super::parts::Body;
use crate::geom::{Mesh, check, weld};
use glam::DVec3;
use monstertruck::meshing::prelude::*;
use monstertruck::step::load::step_geometry::{Curve3D, Surface};
use monstertruck::step::load::step_p21::ast::Name;
use monstertruck::step::load::step_p21::tables::PlaceHolder;
use monstertruck::step::load::{LossCategory, ShellLoadReport, Table};
use monstertruck::topology::compress::CompressedShell;

/// A body with a triangle whose middle is further from the surface of its face, in chord errors, is refused.
const MOST_CHORDS: f64 = 4.0;
/// The chord error that is required, and finer ones: those of doubly curved faces come out greater than required.
const FINER: [f64; 3] = [1.0, 2.0, 4.0];
/// Middles that are tested of every face.
const N_TESTED: usize = 100;
/// Steps of a search for the nearest place of a surface.
const N_TRIALS: usize = 100;

type Shell = CompressedShell<Point3, Curve3D, Surface>;
type Meshed = CompressedShell<Point3, PolylineCurve<Point3>, Option<PolygonMesh>>;

/// Why a body is refused.
pub struct Refused {
    /// The face that is in the way, if it is one.
    pub face: Option<String>,
    pub found: String,
}

impl Refused {
    fn of_body(found: impl Into<String>) -> Self {
        Refused { face: None, found: found.into() }
    }
}

/// The triangles of a body.
pub struct Triangles {
    /// In its own coordinates, outward.
    pub mesh: Mesh,
    /// How far the middle of one is from the surface of its face, at most of those tested.
    pub off: f64,
}

/// The triangles of a body, of the first way that gives them all; `chord` in the unit of the file. Where they are
/// further than that from the surface, they are cut again, finer.
pub fn triangles(table: &Table, body: Body, chord: f64) -> Result<Triangles, Refused> {
    let (shells, ids) = guarded(|| shells(table, body)).map_err(Refused::of_body).flatten()?;
    let mut first = None;
    for way in [Way::Plain, Way::Robust, Way::Trimmed] {
        let mut best: Option<Triangles> = None;
        for finer in FINER {
            let meshed = guarded(|| way.meshed(table, body, &shells, chord / finer));
            let meshed = meshed.map_err(Refused::of_body).flatten();
            match meshed.and_then(|meshed| whole(&shells, &meshed, &ids, chord)) {
                Ok(found) if found.off <= chord => return Ok(found),
                Ok(found) if best.as_ref().is_none_or(|best| found.off < best.off) => {
                    best = Some(found);
                }
                Ok(_) => {}
                Err(why) => {
                    first = first.or(Some(why));
                    break;
                }
            }
        }
        if let Some(best) = best {
            return Ok(best);
        }
    }
    Err(first.unwrap_or_else(|| Refused::of_body("it has no faces")))
}

/// How faces are cut into triangles.
#[derive(Clone, Copy)]
enum Way {
    Plain,
    /// With a wider search for places of edges on surfaces.
    Robust,
    /// With the curves that the file has in the coordinates of its surfaces.
    Trimmed,
}

impl Way {
    fn meshed(
        self,
        table: &Table,
        body: Body,
        shells: &[Shell],
        chord: f64,
    ) -> Result<Vec<Meshed>, Refused> {
        Ok(match (self, body) {
            (Way::Plain, _) => shells.iter().map(|shell| shell.triangulation(chord)).collect(),
            (Way::Robust, _) => {
                shells.iter().map(|shell| shell.robust_triangulation(chord)).collect()
            }
            (Way::Trimmed, Body::Solid(id)) => {
                let solid = table.to_compressed_trimmed_solid(&table.manifold_solid_brep[&id]);
                let solid = solid.map_err(|error| Refused::of_body(error.to_string()))?;
                solid.boundaries.iter().map(|shell| shell.robust_triangulation(chord)).collect()
            }
            (Way::Trimmed, Body::Shells(id)) => {
                let model = &table.shell_based_surface_model[&id];
                let shells = table.to_compressed_trimmed_shells(model);
                let shells = shells.map_err(|error| Refused::of_body(error.to_string()))?;
                shells.iter().map(|shell| shell.robust_triangulation(chord)).collect()
            }
        })
    }
}

/// The shells of a body, the outer one of a solid first, and the numbers of their faces.
fn shells(table: &Table, body: Body) -> Result<(Vec<Shell>, Vec<Vec<u64>>), Refused> {
    let unread = |error: &dyn std::fmt::Display| Refused::of_body(super::one_line(error));
    let (shells, of_shells, reports) = match body {
        Body::Solid(id) => {
            let solid = &table.manifold_solid_brep[&id];
            let read = table.to_compressed_solid_reported(solid);
            let (read, reports) = read.map_err(|error| unread(&error))?;
            let numbers = std::iter::once(reference(&solid.outer))
                .chain(solid.voids.iter().map(reference))
                .collect::<Vec<_>>();
            (read.boundaries, numbers, reports)
        }
        Body::Shells(id) => {
            let model = &table.shell_based_surface_model[&id];
            let numbers: Vec<_> = model.sbsm_boundary.iter().map(reference).collect();
            let (mut shells, mut reports) = (Vec::new(), Vec::new());
            for number in numbers.iter().flatten() {
                let read = match (table.shell.get(number), table.oriented_shell.get(number)) {
                    (Some(shell), _) => table.to_compressed_shell_reported(shell),
                    (None, Some(shell)) => table.to_compressed_shell_reported(shell),
                    (None, None) => return Err(unread(&format!("shell #{number} is missing"))),
                };
                let (shell, report) = read.map_err(|error| unread(&error))?;
                shells.push(shell);
                reports.push(report);
            }
            (shells, numbers, reports)
        }
    };
    for report in &reports {
        require_all(report)?;
    }
    let faces = |number: &Option<u64>| number.map(|id| faces_of(table, id)).unwrap_or_default();
    Ok((shells, of_shells.iter().map(faces).collect()))
}

/// Nothing was lost but loops that are one point: poles and tips have no edge.
fn require_all(report: &ShellLoadReport) -> Result<(), Refused> {
    use monstertruck::step::load::LossReason::DegenerateVertexLoop;
    let n_points = report.lost_for(DegenerateVertexLoop);
    for category in LossCategory::SHELL {
        let count = report.count(category);
        let of_points = if category == LossCategory::Wire { n_points } else { 0 };
        if count.listed - count.kept > of_points {
            return Err(Refused::of_body(format!("it cannot be read as a whole: {report}")));
        }
    }
    Ok(())
}

fn reference<T>(holder: &PlaceHolder<T>) -> Option<u64> {
    match holder {
        PlaceHolder::Ref(Name::Entity(id)) => Some(*id),
        _ => None,
    }
}

fn faces_of(table: &Table, shell: u64) -> Vec<u64> {
    let of_oriented = table.oriented_shell.get(&shell);
    let of_oriented = of_oriented.and_then(|oriented| reference(&oriented.shell_element));
    let shell = table.shell.get(&of_oriented.unwrap_or(shell));
    shell.iter().flat_map(|shell| shell.cfs_faces.iter().filter_map(reference)).collect()
}

/// The mesh of all faces, if it is that of the whole body.
fn whole(
    shells: &[Shell],
    meshed: &[Meshed],
    ids: &[Vec<u64>],
    chord: f64,
) -> Result<Triangles, Refused> {
    let mut mesh = Mesh { vertices: Vec::new(), triangles: Vec::new() };
    let mut off = 0.0f64;
    for (k, (shell, meshed)) in shells.iter().zip(meshed).enumerate() {
        let first = mesh.triangles.len();
        for (f, (face, cut)) in shell.faces.iter().zip(&meshed.faces).enumerate() {
            let named = |found: &str| {
                let number = ids[k].get(f).map_or("?".into(), |id| id.to_string());
                let face = Some(format!("face #{number}, a {}", kind(&face.surface)));
                Refused { face, found: found.into() }
            };
            let Some(surface) = &cut.surface else {
                return Err(named("it cannot be cut into triangles"));
            };
            let before = mesh.triangles.len();
            add(&mut mesh, surface, cut.orientation)?;
            if mesh.triangles.len() == before {
                return Err(named("it has no triangles"));
            }
            match distance(&mesh, before, &face.surface) {
                Some(of_face) if of_face <= MOST_CHORDS * chord => off = off.max(of_face),
                _ => return Err(named("its triangles are not on its surface")),
            }
        }
        // Outward, and of a void into it.
        let turned = (volume(&mesh, first) < 0.0) != (k > 0 && shells.len() > 1);
        if turned {
            mesh.triangles[first..].iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
    }
    let welded = weld::weld(&mesh, weld::DEFAULT_TOLERANCE);
    let report = check::check(&welded.map_err(|error| Refused::of_body(error.to_string()))?);
    match report.blocking_bodies() {
        None if report.volume_mm3 > 0.0 => Ok(Triangles { mesh, off }),
        None => Err(Refused::of_body("it has no volume")),
        Some(fault) => Err(Refused::of_body(format!(
            "its triangles do not bound a solid ({}: {})",
            fault.fault.name(),
            fault.count
        ))),
    }
}

fn add(mesh: &mut Mesh, cut: &PolygonMesh, orientation: bool) -> Result<(), Refused> {
    let first = mesh.vertices.len();
    if u32::try_from(first + cut.positions().len()).is_err() {
        return Err(Refused::of_body(
            "it has too many triangles: give a greater chord error (`chord_mm`; `--chord` at the command line)",
        ));
    }
    mesh.vertices.extend(cut.positions().iter().map(|p| DVec3::new(p.x, p.y, p.z)));
    for corners in cut.faces().triangle_iter() {
        let [a, b, c] = corners.map(|corner| (first + corner.pos) as u32);
        // At poles and tips two corners are one.
        let [p, q, r] = [a, b, c].map(|i| mesh.vertices[i as usize]);
        if p == q || q == r || r == p {
            continue;
        }
        mesh.triangles.push(if orientation { [a, b, c] } else { [a, c, b] });
    }
    Ok(())
}

/// How far middles of the triangles from `first` on are from a surface, of [`N_TESTED`] of them or all, at most; none
/// if that cannot be computed. Those of a plane are on it if their corners are.
fn distance(mesh: &Mesh, first: usize, surface: &Surface) -> Option<f64> {
    if kind(surface) == "plane" {
        return Some(0.0);
    }
    let n = mesh.triangles.len() - first;
    let step = n.div_ceil(N_TESTED).max(1);
    let mut off = 0.0f64;
    for t in (first..mesh.triangles.len()).step_by(step) {
        let [a, b, c] = mesh.corners(t);
        let middle = (a + b + c) / 3.0;
        let point = Point3::new(middle.x, middle.y, middle.z);
        let (u, v) = surface.search_nearest_parameter(point, None, N_TRIALS)?;
        off = off.max(surface.subs(u, v).distance(point));
    }
    Some(off)
}

fn volume(mesh: &Mesh, first: usize) -> f64 {
    let of = |t: usize| {
        let [a, b, c] = mesh.corners(t);
        a.dot(b.cross(c)) / 6.0
    };
    (first..mesh.triangles.len()).map(of).sum()
}

fn kind(surface: &Surface) -> &'static str {
    use monstertruck::step::load::step_geometry::{ElementarySurface, SweepSurface};
    match surface {
        Surface::ElementarySurface(ElementarySurface::Plane(_)) => "plane",
        Surface::ElementarySurface(ElementarySurface::Sphere(_)) => "sphere",
        Surface::ElementarySurface(ElementarySurface::CylindricalSurface(_)) => "cylinder",
        Surface::ElementarySurface(ElementarySurface::ToroidalSurface(_)) => "torus",
        Surface::ElementarySurface(ElementarySurface::ConicalSurface(_)) => "cone",
        Surface::SweepSurface(SweepSurface::ExtrusionSurface(_)) => "extruded surface",
        Surface::SweepSurface(SweepSurface::RevolutionSurface(_)) => "surface of revolution",
        Surface::BsplineSurface(_) | Surface::NurbsSurface(_) => "spline surface",
    }
}

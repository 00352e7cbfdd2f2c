//! Arguments of all commands that read a mesh: unit, welding, repair, checks.

use crate::args::name_of;
use crate::output::Output;
use deepmill::data::files::tools::Tool;
use deepmill::geom::check::{Fault, MeshReport};
use deepmill::geom::file_vertices::FileVertices;
use deepmill::geom::formats::{self, KeepVertices, MeshOrCloud, PartFile, ReadOptions};
use deepmill::geom::units::{Unit, inch_warning, size_line, size_warning};
use deepmill::geom::{Mesh, bodies, check, origin, repair, weld};
use deepmill::{Error, Result};
use glam::DVec3;
use serde_json::{Value, json};
use std::path::Path;
use std::sync::OnceLock;

/// Which meshes are labeled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Accept {
    /// Those that bound solids.
    Bodies,
    /// All, with a warning.
    Faults,
}

impl Accept {
    /// [`Accept::Faults`] if forced.
    pub fn bodies_or(force: bool) -> Self {
        if force { Accept::Faults } else { Accept::Bodies }
    }
}

/// Points of a cloud are single precision: far from the origin that is too coarse.
fn refuse_far(low: DVec3, high: DVec3, path: &Path) -> Result<()> {
    for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
        let x = if low[k] > 0.0 { low[k] } else { high[k] };
        if x.abs() > origin::FAR_MM && low[k] * high[k] > 0.0 {
            let far = origin::single_spacing(x);
            let found =
                format!("{axis} is {x} mm, where numbers of single precision are {far} mm apart");
            let remedy = "move the cloud near the origin, within 4 m, or give the mesh";
            return Err(Error::file(path, "points", found, remedy));
        }
    }
    Ok(())
}

/// Names the file that unusable geometry comes from.
fn in_file(path: &Path) -> impl FnOnce(Error) -> Error + use<'_> {
    move |error| match error {
        Error::Geometry { place, found, remedy } => Error::file(path, place, found, remedy),
        other => other,
    }
}

/// Joins bodies of a file that overlap, and says so.
pub fn join_bodies(mesh: &mut Mesh, path: &Path, output: &Output) -> Result<Vec<repair::Change>> {
    // What names missing vertices is reported by the check.
    if mesh.check().is_err() {
        return Ok(Vec::new());
    }
    let changes = bodies::join(mesh).map_err(in_file(path))?;
    changes.iter().for_each(|change| output.warn(change));
    Ok(changes)
}

/// Says volume and area of the bodies of a STEP file, to be compared with those of the program that wrote it.
#[cfg(feature = "step")]
fn say_size_of_step(mesh: &Mesh, path: &Path, output: &Output) {
    if matches!(formats::Format::of(path), Ok(formats::Format::Step)) {
        let (volume, area) = (mesh.volume(), mesh.area());
        output.say(format!(
            "volume {volume:.1} mm³, area {area:.1} mm², of the triangles of all bodies: compare them with the CAD program's"
        ));
    }
}

/// Warns if a part in millimeters may be one in inches.
pub fn warn_if_in_inches(mesh: &Mesh, output: &Output) {
    let warning = mesh.bounds().and_then(|(low, high)| inch_warning(low, high));
    warning.iter().for_each(|warning| output.warn(warning));
}

/// Warns, before the work, of tools that are wider than the part is long: the unit of one of them may be wrong.
pub fn warn_wide_tools(mesh: &Mesh, tools: &[Tool], output: &Output) {
    let longest = mesh.bounds().map_or(0.0, |(low, high)| (high - low).max_element());
    let diameter = |tool: &Tool| 2.0 * tool.params.cr_mm;
    let wide: Vec<&Tool> = tools.iter().filter(|tool| diameter(tool) > longest).collect();
    let Some(first) = wide.first() else { return };
    output.warn(format!(
        "{} of {} tools are wider than the part is long ({longest:.3} mm), {} with {} mm: check --unit and the tools",
        wide.len(),
        tools.len(),
        first.name,
        diameter(first)
    ));
}

/// Options that say how a mesh file is read.
#[derive(Clone, clap::Args)]
pub struct MeshArgs {
    /// Unit of the file's numbers: mm, cm, m or in.
    #[arg(long, default_value_t, value_name = "UNIT")]
    unit: Unit,
    /// Factor on top of the unit.
    #[arg(long, default_value_t = 1.0, value_name = "FACTOR", allow_negative_numbers = true)]
    scale: f64,
    /// Join corners closer than this fraction of the bounding box's diagonal.
    #[arg(
        long, default_value_t = weld::DEFAULT_TOLERANCE, value_name = "FRACTION",
        allow_negative_numbers = true
    )]
    weld: f64,
    /// Of a STEP file: how far triangles may be from the surfaces that they stand for.
    #[cfg(feature = "step")]
    #[arg(
        long, default_value_t = formats::DEFAULT_CHORD_MM, value_name = "MM",
        allow_negative_numbers = true, value_parser = crate::args::millimeters
    )]
    chord: f64,
    /// Mend small faults: weld gaps, drop doubled and collapsed triangles, orient.
    #[arg(long)]
    pub repair: bool,
    /// The local origin of the part that was read, if it is far from that of its file.
    #[arg(skip)]
    origin: OnceLock<DVec3>,
}

impl MeshArgs {
    fn options(&self) -> ReadOptions {
        let options = ReadOptions::new(self.unit.millimeters() * self.scale, self.weld);
        #[cfg(feature = "step")]
        let options = options.with_chord_mm(self.chord);
        options
    }

    /// Reads a mesh or a cloud to be labeled, says its size, and applies the chosen repairs; an inward-facing mesh is
    /// turned with a notice, and bodies that overlap are joined. A mesh that does not bound solids is refused, or with
    /// [`Accept::Faults`] warned about.
    pub fn read_part(&self, path: &Path, accept: Accept, output: &Output) -> Result<MeshOrCloud> {
        self.read_file(path, (accept, KeepVertices::No), output).map(|(part, _)| part)
    }

    /// As [`MeshArgs::read_part`], and the vertices of the file if they are kept.
    pub fn read_file(
        &self,
        path: &Path,
        (accept, keep): (Accept, KeepVertices),
        output: &Output,
    ) -> Result<(MeshOrCloud, Option<FileVertices>)> {
        let PartFile { mut part, notices, mut vertices } =
            formats::read_part_file(path, &self.options(), keep)?;
        notices.iter().for_each(|notice| output.warn(notice));
        match &mut part {
            MeshOrCloud::Mesh(mesh) => {
                self.take_near(mesh, path, output);
                if let (Some(at), Some(vertices)) = (self.origin(), &mut vertices) {
                    vertices.make_relative(at);
                }
                self.prepare(mesh, output)?;
                #[cfg(feature = "step")]
                say_size_of_step(mesh, path, output);
                match join_bodies(mesh, path, output) {
                    Err(fault) if accept == Accept::Faults => output.warn(fault),
                    joined => {
                        joined?;
                    }
                }
                match self.require(check::check(mesh).blocking_bodies(), path) {
                    Err(fault) if accept == Accept::Faults => output.warn(fault),
                    verdict => verdict?,
                }
            }
            MeshOrCloud::Cloud(sites) => {
                let n_coincident = sites.n_coincident();
                if n_coincident > 0 {
                    let n = sites.len();
                    output.warn(format!(
                        "{n_coincident} of {n} points coincide with others: leave them out"
                    ));
                }
                let points = sites.points.iter().map(|p| p.as_dvec3());
                let low = points.clone().fold(DVec3::INFINITY, DVec3::min);
                let high = points.fold(DVec3::NEG_INFINITY, DVec3::max);
                refuse_far(low, high, path)?;
                self.echo(low, high, output);
            }
        }
        Ok((part, vertices))
    }

    /// A mesh to hold tools against; with `force` also one that does not bound solids.
    pub fn read_bodies(&self, path: &Path, force: bool, output: &Output) -> Result<Mesh> {
        match self.read_part(path, Accept::bodies_or(force), output)? {
            MeshOrCloud::Mesh(mesh) => Ok(mesh),
            MeshOrCloud::Cloud(_) => {
                let remedy = "a cloud has no triangles to hold a tool against: give the mesh";
                Err(Error::argument("part", name_of(path), "a mesh", remedy))
            }
        }
    }

    /// Passes if the mesh bounds solids; does not propose a repair that was made.
    pub fn require_labelable(&self, report: &MeshReport, path: &Path) -> Result<()> {
        self.require(report.blocking_bodies(), path)
    }

    fn require(&self, blocking: Option<&check::Finding>, path: &Path) -> Result<()> {
        match blocking {
            None => Ok(()),
            Some(finding) => Err(Error::file(
                path,
                finding.places[0].to_string(),
                finding.to_string(),
                self.remedy(finding.fault),
            )),
        }
    }

    /// What the user can do about a fault that is still there.
    pub fn remedy(&self, fault: Fault) -> &'static str {
        if self.repair { fault.remedy_beyond_repair() } else { fault.remedy() }
    }

    /// As [`MeshArgs::read_mesh`], about a local origin as [`MeshArgs::read_part`].
    pub fn read_near(&self, path: &Path, output: &Output) -> Result<Mesh> {
        let (mut mesh, notices) = formats::read_mesh_with_notices(path, &self.options())?;
        notices.iter().for_each(|notice| output.warn(notice));
        self.take_near(&mut mesh, path, output);
        self.prepare(&mut mesh, output)?;
        join_bodies(&mut mesh, path, output)?;
        Ok(mesh)
    }

    /// Selected faces of the part, in the coordinates of that which was read.
    pub fn read_selected(&self, path: &Path, output: &Output) -> Result<Mesh> {
        let (mut mesh, notices) = formats::read_mesh_with_notices(path, &self.options())?;
        notices.iter().for_each(|notice| output.warn(notice));
        self.origin.get().iter().for_each(|at| origin::make_relative(&mut mesh, **at));
        Ok(mesh)
    }

    /// A fixture, in the coordinates of the part that was read.
    pub fn read_fixture(&self, path: &Path, output: &Output) -> Result<Mesh> {
        let (mut mesh, _) = self.read_mesh(path, output)?;
        self.origin.get().iter().for_each(|at| origin::make_relative(&mut mesh, **at));
        Ok(mesh)
    }

    /// A part far from the origin is taken about a local one.
    fn take_near(&self, mesh: &mut Mesh, path: &Path, output: &Output) {
        let Some(at) = origin::local_origin(mesh) else { return };
        origin::make_relative(mesh, at);
        let _ = self.origin.set(at);
        let [x, y, z] = at.to_array();
        let far = origin::single_spacing(at.abs().max_element());
        let stl = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("stl"));
        let rounded = match stl {
            true => format!(
                "; in a binary STL its corners are already rounded to {far} mm: export it near the origin"
            ),
            false => String::new(),
        };
        output.warn(format!(
            "the part is far from the origin: results and files are relative to ({x}, {y}, {z}) mm, their origin_mm{rounded}"
        ));
    }

    /// The local origin in use, mm.
    pub fn origin(&self) -> Option<DVec3> {
        self.origin.get().copied()
    }

    /// Adds the local origin in use to results.
    pub fn add_origin(&self, result: &mut Value) {
        if let Some(at) = self.origin() {
            result["origin_mm"] = json!(at.to_array());
        }
    }

    /// Reads a mesh as it is, with the chosen repairs; whether it can be labeled is not checked.
    pub fn read_mesh(&self, path: &Path, output: &Output) -> Result<(Mesh, Vec<repair::Change>)> {
        let (mut mesh, notices) = formats::read_mesh_with_notices(path, &self.options())?;
        notices.iter().for_each(|notice| output.warn(notice));
        let changes = self.prepare(&mut mesh, output)?;
        Ok((mesh, changes))
    }

    fn prepare(&self, mesh: &mut Mesh, output: &Output) -> Result<Vec<repair::Change>> {
        let mut changes: Vec<repair::Change> = repair::drop_loose(mesh).into_iter().collect();
        if let Some((low, high)) = mesh.bounds() {
            self.echo(low, high, output);
        }
        match self.repair {
            true => changes.extend(repair::repair(mesh)?),
            false => changes.extend(repair::face_outward(mesh)),
        }
        changes.iter().for_each(|change| output.warn(change));
        Ok(changes)
    }

    fn echo(&self, low: DVec3, high: DVec3, output: &Output) {
        output.say(format!("size {}", size_line(low, high)));
        let scale = self.options().scale;
        let in_inches = || inch_warning(low, high).filter(|_| scale == 1.0);
        if let Some(warning) = size_warning(low, high, scale).or_else(in_inches) {
            output.warn(warning);
        }
    }
}

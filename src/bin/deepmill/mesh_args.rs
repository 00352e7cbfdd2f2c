//! Arguments of all commands that read a mesh: unit, welding, repair, checks.

use crate::args::name_of;
use crate::output::Output;
use deepmill::data::files::tools::Tool;
use deepmill::geom::check::{Fault, MeshReport};
use deepmill::geom::formats::{self, MeshOrCloud, ReadOptions};
use deepmill::geom::units::{Unit, inch_warning, size_line, size_warning};
use deepmill::geom::{Mesh, check, repair, weld};
use deepmill::{Error, Result};
use glam::DVec3;
use std::path::Path;

/// Which meshes are labeled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Accept {
    /// Those that bound one solid.
    OneBody,
    /// Those that bound several solids too.
    Bodies,
    /// All, with a warning.
    Faults,
}

impl Accept {
    /// [`Accept::Faults`] if forced.
    pub fn one_body_or(force: bool) -> Self {
        if force { Accept::Faults } else { Accept::OneBody }
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
#[derive(clap::Args)]
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
    /// Mend small faults: weld gaps, drop doubled and collapsed triangles, orient.
    #[arg(long)]
    pub repair: bool,
}

impl MeshArgs {
    fn options(&self) -> ReadOptions {
        ReadOptions { scale: self.unit.millimeters() * self.scale, weld: self.weld }
    }

    /// Reads a mesh or a cloud to be labeled, says its size, and applies the chosen repairs; an
    /// inward-facing mesh is turned with a notice. A mesh that does not bound one solid, or with
    /// [`Accept::Bodies`] several, is refused, or with [`Accept::Faults`] warned about.
    pub fn read_part(&self, path: &Path, accept: Accept, output: &Output) -> Result<MeshOrCloud> {
        let (mut part, notices) = formats::read_part_with_notices(path, &self.options())?;
        notices.iter().for_each(|notice| output.warn(notice));
        match &mut part {
            MeshOrCloud::Mesh(mesh) => {
                self.prepare(mesh, output)?;
                let report = check::check(mesh);
                let blocking = match accept {
                    Accept::Bodies => report.blocking_bodies(),
                    Accept::OneBody | Accept::Faults => report.blocking(),
                };
                match self.require(blocking) {
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
                self.echo(low, points.fold(DVec3::NEG_INFINITY, DVec3::max), output);
            }
        }
        Ok(part)
    }

    /// A mesh to hold tools against; with `force` also one that does not bound solids.
    pub fn read_bodies(&self, path: &Path, force: bool, output: &Output) -> Result<Mesh> {
        let accept = if force { Accept::Faults } else { Accept::Bodies };
        match self.read_part(path, accept, output)? {
            MeshOrCloud::Mesh(mesh) => Ok(mesh),
            MeshOrCloud::Cloud(_) => {
                let remedy = "a cloud has no triangles to hold a tool against: give the mesh";
                Err(Error::argument("part", name_of(path), "a mesh", remedy))
            }
        }
    }

    /// As [`Report::require_labelable`]; does not propose a repair that was made.
    pub fn require_labelable(&self, report: &MeshReport) -> Result<()> {
        self.require(report.blocking())
    }

    fn require(&self, blocking: Option<&check::Finding>) -> Result<()> {
        match blocking {
            None => Ok(()),
            Some(finding) => Err(Error::geometry(
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

    /// Reads a mesh as it is, with the chosen repairs; whether it can be labeled is not checked.
    pub fn read_mesh(&self, path: &Path, output: &Output) -> Result<(Mesh, Vec<repair::Change>)> {
        let (mut mesh, notices) = formats::read_mesh_with_notices(path, &self.options())?;
        notices.iter().for_each(|notice| output.warn(notice));
        let changes = self.prepare(&mut mesh, output)?;
        Ok((mesh, changes))
    }

    fn prepare(&self, mesh: &mut Mesh, output: &Output) -> Result<Vec<repair::Change>> {
        if let Some((low, high)) = mesh.bounds() {
            self.echo(low, high, output);
        }
        let changes = match self.repair {
            true => repair::repair(mesh)?,
            false => repair::face_outward(mesh).into_iter().collect(),
        };
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

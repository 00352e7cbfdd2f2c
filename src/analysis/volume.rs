//! Where in the space around a part the tip of a tool can be.

use super::Analysis;
use super::fixtures::Fixture;
use super::observer::{Observer, Stage, report};
use super::placed::{or_usual, without_area};
use super::write::Files;
use crate::access::Queries;
use crate::access::surface::{SurfaceOptions, TriangleObstacles, retreats};
use crate::answers::Definition;
use crate::data::files::settings::{Blocking, ToolSettings};
use crate::data::files::volume::{PointAnswer, Said, VolumeFile};
use crate::data::files::{AnalysisSettings, Provenance};
use crate::geom::Mesh;
use crate::geom::formats::MeshOrCloud;
use crate::geom::inside::{Lattice, lattice_inside};
use crate::render::section;
use crate::{Error, Result};
use glam::Vec3;
use std::mem;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Its file.
const VOLUME: &str = "volume.npz";

/// The answers about the points of a lattice. Two are equal whatever [`VolumeOutcome::seconds`] they took.
#[derive(Debug)]
pub struct VolumeOutcome {
    file: VolumeFile,
    seconds: [f64; 2],
}

impl PartialEq for VolumeOutcome {
    fn eq(&self, other: &Self) -> bool {
        self.file == other.file
    }
}

impl Analysis {
    /// Labels the points of a lattice of this step, mm, in the part's box that are outside the part (roughing): with
    /// the tip at the point. Sites and regions are not of it.
    ///
    /// # Errors
    /// If the part is no mesh, there is not one tool, the tool leaves stock, the lattice would not fit into memory, the
    /// observer stops it, or as [`TriangleObstacles::label`].
    pub fn volume(self, step_mm: f64, observer: &mut dyn Observer) -> Result<VolumeOutcome> {
        let Analysis { mut request, shape, directions, .. } = self;
        request.options.check()?;
        let tools = mem::take(&mut request.tools);
        let (MeshOrCloud::Mesh(mesh), [tool]) = (&shape, &tools[..]) else {
            let found = format!("{}, {} tools", request.part, tools.len());
            let remedy = "leave it out for a cloud, and name one tool at a time";
            return Err(Error::argument("volume", found, "a mesh and one tool", remedy));
        };
        let allowance = tool.assembly.allowance_mm();
        if allowance > 0.0 {
            let remedy = "leave it out: what the tool itself removes is labeled";
            return Err(Error::argument("allowance", allowance, "0 with a volume", remedy));
        }
        report(observer, Stage::Sites, (0, 1))?;
        let start = Instant::now();
        let directions = or_usual(directions, Blocking::Part)?;
        let (low, high) = mesh.bounds().unwrap_or_default();
        let lattice = Lattice::covering(low, high, step_mm)?;
        let inside = lattice_inside(mesh, &lattice)?;
        let outside = (0..lattice.len()).filter(|&n| !inside[n]);
        let mut points: Vec<Vec3> = Vec::with_capacity(outside.clone().count());
        points.extend(outside.map(|n| lattice.point(n).as_vec3()));
        report(observer, Stage::Sites, (1, 1))?;
        let points_s = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let fixtures = mem::take(&mut request.fixtures);
        let (fixtures, warnings) = Fixture::around(mesh, fixtures, request.table_z_mm)?;
        let meshes: Vec<Mesh> = fixtures.iter().map(|fixture| fixture.mesh.clone()).collect();
        let obstacles = TriangleObstacles::new(mesh, &meshes)?;
        request.fixtures = fixtures;
        report(observer, Stage::Labels, (0, 1))?;
        let options = SurfaceOptions { occlusion: false, ..request.options };
        let queries = Queries::Volume(&points);
        let labels = obstacles.label(queries, &tool.cutter, &directions, &options)?;
        report(observer, Stage::Labels, (1, 1))?;
        let settings = AnalysisSettings {
            tool: Some(ToolSettings::of(tool)),
            directions: Some(directions.set().clone()),
            n_directions: labels.surface.as_ref().map(|evidence| evidence.n_directions),
            definition: Some(Definition::PartInSpace),
            part_itself: Some(request.part_settings()),
            origin_mm: request.origin.map(|at| at.to_array()),
            ..AnalysisSettings::default()
        };
        let (part, words) = (request.part, tool.words());
        let provenance = Provenance { part, cutter: tool.params, tool: words, settings };
        let mut file = VolumeFile::new(provenance, lattice, &inside, &labels)?;
        let retreats = file.unproven_share().map(|share| {
            let retreats = retreats(share, "points");
            format!("the tool is given by its profile: directions are not counted; {retreats}")
        });
        let notices = without_area(&obstacles).into_iter().chain(retreats).collect();
        file.said = Said { warnings, notices };
        Ok(VolumeOutcome { file, seconds: [points_s, start.elapsed().as_secs_f64()] })
    }
}

impl VolumeOutcome {
    /// An answer for every point of the lattice.
    pub fn file(&self) -> &VolumeFile {
        &self.file
    }

    /// Reads what [`VolumeOutcome::write`] has written: an equal outcome, but for [`VolumeOutcome::seconds`], which no
    /// file has.
    ///
    /// # Errors
    /// As [`VolumeFile::read`].
    pub fn read(folder: &Path) -> Result<Self> {
        Ok(VolumeOutcome { file: VolumeFile::read(&folder.join(VOLUME))?, seconds: [0.0; 2] })
    }

    /// Points outside the part.
    pub fn n_points(&self) -> usize {
        self.file.answers.iter().filter(|answer| **answer != PointAnswer::Inside).count()
    }

    /// What is wrong with fixtures and table, a sentence each.
    pub fn warnings(&self) -> &[String] {
        &self.file.said.warnings
    }

    /// What was left out, a sentence each.
    pub fn notices(&self) -> &[String] {
        &self.file.said.notices
    }

    /// Seconds that points and labels took.
    pub fn seconds(&self) -> [f64; 2] {
        self.seconds
    }

    /// Writes `volume.npz` and, if there are pictures, `volume.png`, a section; returns the paths.
    ///
    /// # Errors
    /// If the system refuses a file.
    pub fn write(&self, folder: &Path, files: &Files) -> Result<Vec<PathBuf>> {
        let mut paths = vec![folder.join(VOLUME)];
        self.file.write(&paths[0])?;
        if files.pictures {
            let path = folder.join("volume.png");
            let layer = section::most_mixed_layer(&self.file);
            section::draw(&self.file, layer).write_png(&path)?;
            paths.push(path);
        }
        Ok(paths)
    }
}

//! What the settings of a file of labels state, and what lies beside it.

use super::super::Provenance;
use super::super::settings::{AnalysisSettings, Blocking, PartSettings, ToolSettings};
use super::super::tools::{Tool, steps_of_words};
use super::{FIXTURES, SURFACE, another};
use crate::access::surface::explain::Remedies;
use crate::access::surface::{ContactTolerance, FINISH_MM, RefinementOptions, SurfaceOptions};
use crate::answers::Definition;
use crate::data::files::hash;
use crate::geom::Mesh;
use crate::geom::formats::{self, ReadOptions};
use crate::geom::sites::{self, SiteOptions};
use crate::storage::input_file;
use crate::tool::cutter::Assembly;
use crate::tool::directions::Directions;
use crate::{Error, Result};
use glam::Vec3;
use std::path::{Path, PathBuf};

pub(super) const LABEL_AGAIN: &str = "label the part again with this version";

/// The settings of a file.
pub(super) struct Stated<'a> {
    pub path: &'a Path,
    pub provenance: &'a Provenance,
}

impl Stated<'_> {
    pub fn fault(&self, place: &str, found: impl Into<String>, remedy: &str) -> Error {
        Error::file(self.path, place, found, remedy)
    }

    fn settings(&self) -> &AnalysisSettings {
        &self.provenance.settings
    }

    pub fn definition(&self) -> Result<Definition> {
        match self.settings().definition {
            Some(known @ (Definition::Part | Definition::Sites)) => Ok(known),
            other => {
                let words = other.map_or_else(String::new, |other| other.to_string());
                let found = format!("the definition is `{words}`");
                Err(self.fault("settings.definition", found, LABEL_AGAIN))
            }
        }
    }

    pub fn remedies(&self) -> Remedies {
        let tool = self.settings().tool.as_ref();
        let only_this_tool = tool.and_then(|tool| tool.of_library) == Some(true);
        Remedies { only_this_tool, ..Remedies::default() }
    }

    pub fn directions(&self) -> Result<Directions> {
        let Some(set) = &self.settings().directions else {
            return Err(self.fault("settings.directions", "no set of directions", LABEL_AGAIN));
        };
        self.stated("settings.directions", Directions::new(set.clone()))
    }

    /// What the settings at `place` make, or why they make nothing.
    fn stated<T>(&self, place: &str, made: Result<T>) -> Result<T> {
        made.map_err(|e| self.fault(place, e.to_string(), LABEL_AGAIN))
    }

    /// What a tool must state.
    fn of_tool<T>(&self, stated: Option<T>, key: &str) -> Result<T> {
        let place = || format!("settings.tool.{key}");
        stated.ok_or_else(|| self.fault(&place(), "it is missing", LABEL_AGAIN))
    }

    pub fn tool(&self) -> Result<Tool> {
        let none = ToolSettings::default();
        let stated = self.settings().tool.as_ref().unwrap_or(&none);
        let allowance = stated.allowance_mm.unwrap_or(0.0);
        let tool = self.tool_of_any_length(stated)?.with_allowance(allowance);
        let tool = self.stated("settings.tool", tool)?;
        match stated.overall_mm {
            Some(overall) => self.stated("settings.tool", tool.of_overall_length(overall)),
            None => Ok(tool),
        }
    }

    fn tool_of_any_length(&self, stated: &ToolSettings) -> Result<Tool> {
        let corner_mm = self.of_tool(stated.corner_mm, "corner_mm")?;
        let clearance_mm = self.of_tool(stated.clearance_mm, "clearance_mm")?;
        let Some(body) = &stated.body else {
            let tool = Tool::new(self.provenance.cutter, Some(corner_mm), clearance_mm);
            return self.stated("settings.tool", tool);
        };
        let steps = |words: &str, key: &str| {
            let place = || format!("settings.tool.{key}");
            steps_of_words(words).ok_or_else(|| self.fault(&place(), "no steps", LABEL_AGAIN))
        };
        let end = [corner_mm, self.of_tool(stated.side_mm, "side_mm")?];
        let stick_out_mm = self.of_tool(stated.stick_out_mm, "stick_out_mm")?;
        let holder = stated.holder.as_deref().unwrap_or_default();
        let (body, holder) = (steps(body, "body")?, steps(holder, "holder")?);
        let assembly = Assembly::from_steps(end, body, holder, stick_out_mm);
        let mut assembly = self.stated("settings.tool", assembly)?;
        if let Some(words) = stated.neck_and_shank.as_deref().filter(|words| !words.is_empty()) {
            let upper = steps(words, "neck_and_shank")?;
            assembly = self.stated("settings.tool", assembly.with_neck_and_shank(upper))?;
        }
        if let Some(words) = &stated.profile {
            let profile = words.parse().and_then(|profile| assembly.of_same_lengths(profile));
            assembly = self.stated("settings.tool.profile", profile)?;
        }
        let words = self.provenance.tool.clone();
        self.stated("settings.tool", Tool::of_assembly("tool", assembly, clearance_mm, words))
    }

    pub fn options(&self) -> Result<SurfaceOptions> {
        let none = PartSettings::default();
        let stated = self.settings().part_itself.as_ref().unwrap_or(&none);
        let Some(n_kept) = stated.search else {
            let found = "it does not say how the directions between were searched";
            return Err(self.fault("settings.part_itself", found, LABEL_AGAIN));
        };
        let refinement = match stated.prove {
            true => RefinementOptions::proving(),
            false => {
                let n_kept = n_kept.min(RefinementOptions::proving().n_kept);
                RefinementOptions { n_kept, ..RefinementOptions::default() }
            }
        };
        Ok(SurfaceOptions {
            tolerance: stated
                .tolerance_mm
                .map_or(ContactTolerance::Tessellation, ContactTolerance::Millimeters),
            finish_mm: stated.finish_mm.unwrap_or(FINISH_MM),
            refinement: (n_kept > 0).then_some(refinement),
            ..SurfaceOptions::default()
        })
    }

    /// A file beside the labels, or above them.
    fn beside(&self, name: &str) -> Option<PathBuf> {
        let folder = self.path.parent().unwrap_or(Path::new(""));
        [folder.join(name), folder.join("..").join(name)].into_iter().find(|path| path.is_file())
    }

    pub fn mesh(&self, given: Option<Mesh>, is_needed: bool) -> Result<Option<Mesh>> {
        let stated = self.settings().surface.as_ref();
        let stated = stated.and_then(|surface| surface.sha256.as_deref());
        if let Some(mesh) = given {
            let remedy = "name the mesh that was labeled, with the same options";
            return match stated {
                Some(hash) if hash::of_mesh(&mesh)? != hash => {
                    Err(self.fault("settings.surface", "the part given is another one", remedy))
                }
                _ => Ok(Some(mesh)),
            };
        }
        if !is_needed {
            return Ok(None);
        }
        let Some(hash) = stated else {
            let found = "it does not say which surface the labels are about";
            let remedy = "label the part again with this version, or give its mesh, with --part FILE at the command line";
            return Err(self.fault("settings.surface", found, remedy));
        };
        self.read_stated(SURFACE, hash).map(Some)
    }

    pub fn fixtures(&self) -> Result<Option<Mesh>> {
        let stated = self.settings();
        let hash = stated.surface.as_ref().and_then(|surface| surface.fixtures_sha256.as_deref());
        if let Some(hash) = hash {
            return self.read_stated(FIXTURES, hash).map(Some);
        }
        let blocks = |part: &PartSettings| !part.fixtures.is_empty() || part.table_z_mm.is_some();
        match stated.part_itself.as_ref().is_some_and(blocks) {
            false => Ok(None),
            true => {
                let found = "fixtures or a table blocked, and their triangles are not kept";
                Err(self.fault("settings.part_itself", found, LABEL_AGAIN))
            }
        }
    }

    fn read_stated(&self, name: &str, hash: &str) -> Result<Mesh> {
        let Some(path) = self.beside(name) else {
            let found = format!("there is no {name} beside it");
            let remedy = match name == SURFACE {
                true => {
                    "keep the folder whole, or give the part's mesh, with --part FILE at the command line"
                }
                false => "keep the folder whole, or label the part again",
            };
            return Err(self.fault("folder", found, remedy));
        };
        let bytes = input_file::read(&path, input_file::DATA)?;
        if hash::hex(&bytes) != hash {
            return Err(another(&path, self.path, "SHA-256"));
        }
        formats::read_mesh(&path, &ReadOptions::default())
    }

    /// `--obstacles centroids`.
    pub fn centroids_block(&self) -> bool {
        self.settings().obstacles == Some(Blocking::Centroids)
    }

    /// What `--obstacles COUNT` adds to the sites.
    pub fn further_points(&self, mesh: Option<&Mesh>) -> Result<Vec<Vec3>> {
        let stated = self.settings();
        let (Some(Blocking::Points(Some(n_sites))), Some(mesh)) = (stated.obstacles, mesh) else {
            return Ok(Vec::new());
        };
        let Some(seed) = stated.sites.as_ref().and_then(|sites| sites.seed) else {
            return Err(self.fault("settings.sites.seed", "it is missing", LABEL_AGAIN));
        };
        let seed = seed.wrapping_add(1);
        let options = SiteOptions { n_sites, seed, ..SiteOptions::default() };
        Ok(self.stated("settings.obstacles", sites::sample(mesh, &options))?.points)
    }
}

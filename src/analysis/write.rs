//! The folder of an outcome.

use super::observer::{Observer, Stage, report};
use super::outcome::Outcome;
use super::placed::Placed;
use crate::Result;
use crate::geom::units::Unit;
use crate::geom::{Mesh, formats};
use crate::report::export::Extra;
use crate::report::folder::{self, Former, REGION, SURFACE, Show};
use crate::report::page::{LivePage, Page, View};
use crate::report::{PartView, Scene};
use std::path::{Path, PathBuf};

/// Which files an outcome's folder gets beside numbers and colored points.
///
/// ```no_run
/// use deepmill::analysis::{Analysis, Files};
/// use deepmill::data::files::tools::Tool;
/// use deepmill::{geom::solids, glam::DVec3};
/// use std::path::Path;
///
/// let tool = Tool::new("3,20,20,30".parse()?, None, 0.0)?; // a ball end
/// let outcome = Analysis::new("block", solids::cuboid(DVec3::splat(30.0)), vec![tool]).run(&mut ())?;
/// outcome.write(Path::new("block"), &Files::shown(true), &mut ())?; // pictures and report.html beside the answers
/// # Ok::<(), deepmill::Error>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Files {
    /// Whether pictures are drawn (PNG).
    pub pictures: bool,
    /// Whether there is a page, `report.html`.
    pub report: bool,
    /// Further forms of the answers.
    pub also: Vec<Extra>,
    /// Of lengths and areas in tables and on the page.
    pub unit: Unit,
}

impl Files {
    /// Pictures, and with `report` a page.
    pub fn shown(report: bool) -> Self {
        Files { pictures: true, report, ..Files::default() }
    }

    /// Whether pictures are drawn, as `report::folder` has it.
    #[doc(hidden)] // of the program
    pub fn show(&self) -> Show {
        Show::pictures_unless(!self.pictures)
    }
}

impl Placed {
    /// Writes `part.stl` and, if there is a region, `region.stl`; returns their paths.
    ///
    /// # Errors
    /// If the system refuses a file.
    pub fn write_surfaces(&self, folder: &Path) -> Result<Vec<PathBuf>> {
        let part = self.mesh().map(|mesh| (folder.join(SURFACE), mesh));
        let region = self.region.as_ref().map(|(region, _)| (folder.join(REGION), &region.mesh));
        let write = |(path, mesh): (PathBuf, &Mesh)| formats::write_stl(&path, mesh).map(|()| path);
        part.into_iter().chain(region).map(write).collect()
    }
}

impl Outcome {
    /// Writes what `deepmill label` writes; returns the paths. Every file is written under another name and then
    /// renamed: one that is there is whole. Files of former results in these folders that are not written again are
    /// removed: they are about another part, or other tools.
    ///
    /// Of each tool, in `folder` or in a folder of its own: `labels.npz`, `labels.ply`, `labels.png`, `findings.json`,
    /// `findings.csv`. In `folder`: of several tools `tools.csv`, `tools.ply`, `tools.png` and the findings that no
    /// tool reaches; `part.stl`, `region.stl`, `fixtures.stl`, `report.html`, and `outcome.npz`, with which
    /// [`Outcome::read`] reads it all back.
    ///
    /// # Errors
    /// If the system refuses a file, or the observer stops it.
    pub fn write(
        &self,
        folder: &Path,
        files: &Files,
        observer: &mut dyn Observer,
    ) -> Result<Vec<PathBuf>> {
        let (mesh, sites) = self.shown();
        let outlines = self.placed.outlines();
        let outlines = &outlines[..];
        let (show, unit, n_tools) = (files.show(), files.unit, self.tools().len());
        let (mut paths, former) = (Vec::new(), Former::of(folder));
        report(observer, Stage::Writing, (0, n_tools))?;
        for (k, (tool, answer)) in self.tools().iter().zip(self.answers()).enumerate() {
            let of_tool = match self.has_folders() {
                false => folder.to_path_buf(),
                true => folder.join(tool.folder()),
            };
            let former = self.has_folders().then(|| Former::of(&of_tool));
            let file = self.file(k)?;
            paths.extend(folder::write_labels(&of_tool, &file, Scene { mesh, outlines }, show)?);
            for extra in &files.also {
                paths.push(folder::export_labels(&of_tool, &file, mesh, *extra)?);
            }
            let about = (&*file.provenance.part, &*file.provenance.tool);
            paths.extend(answer.findings.write(&of_tool, about, unit)?);
            former.map_or(Ok(()), |former| former.remove_but(&paths))?;
            report(observer, Stage::Writing, (k + 1, n_tools))?;
        }
        let part = self.part();
        if self.has_folders() {
            let areas = self.areas()?;
            let coverage = self.coverage(&areas);
            let cutter = &*format!("{n_tools} tools");
            let view = PartView { name: part, mesh, sites, cutter, outlines };
            paths.extend(coverage.write(folder, view, show, unit)?);
            paths.extend(self.findings().write(folder, (part, cutter), unit)?);
        }
        if files.report {
            paths.push(self.with_page(unit, |page| page.write(folder))?);
        }
        paths.extend(self.placed.write_surfaces(folder)?);
        if let Some(fixtures) = &self.placed.fixtures() {
            paths.push(folder::write_fixtures(folder, fixtures)?);
        }
        paths.push(self.write_record(folder)?);
        former.remove_but(&paths)?;
        Ok(paths)
    }

    /// Draws what was read from a folder again: of one tool its pictures and colored points, of any number the page.
    /// Names of findings, and what a baseline made of them, are those that the folder has. Returns the paths.
    ///
    /// # Errors
    /// If the system refuses a file.
    #[doc(hidden)] // of the program
    pub fn draw_again(
        mut self,
        from: &Path,
        to: &Path,
        unit: Unit,
    ) -> Result<(Self, Vec<PathBuf>)> {
        for k in 0..self.answers.len() {
            let of_tool = from.join(self.tools()[k].folder());
            let beside = if self.has_folders() { of_tool } else { from.into() };
            self.answers[k].findings.take_ids(&beside);
        }
        self.of_all.iter_mut().for_each(|findings| findings.take_ids(from));
        let mut paths = Vec::new();
        if !self.has_folders() {
            let ((mesh, _), outlines) = (self.shown(), &self.placed.outlines()[..]);
            let (file, scene) = (self.file(0)?, Scene { mesh, outlines });
            paths.extend(folder::draw_labels(to, &file, scene, Show::Pictures)?);
        }
        paths.push(self.with_page(unit, |page| page.write(to))?);
        Ok((self, paths))
    }

    /// The tabs of the page: of several tools one of all of them, then one of each.
    fn views(&self) -> Result<Vec<View>> {
        let mut views = Vec::new();
        if self.has_folders() {
            let areas = self.areas()?;
            views.push(self.coverage(&areas).view(self.findings().clone()));
        }
        for (k, (tool, answer)) in self.tools().iter().zip(self.answers()).enumerate() {
            let name = if self.has_folders() { &*tool.name } else { "exact" };
            views.extend(View::tabs_of_labels(name, &self.file(k)?, answer.findings.clone()));
        }
        Ok(views)
    }

    /// Gives the page to a function.
    fn with_page<T>(&self, unit: Unit, with: impl FnOnce(Page) -> Result<T>) -> Result<T> {
        let ((mesh, sites), outlines) = (self.shown(), &self.placed.outlines()[..]);
        let views = &self.views()?[..];
        with(Page { part: self.part(), mesh, sites, views, unit, outlines })
    }

    /// The page alone, as HTML.
    #[cfg(any(feature = "python", feature = "capi"))]
    pub(crate) fn html(&self, unit: Unit) -> Result<String> {
        self.with_page(unit, |page| page.html())
    }

    /// The page as one that follows edits; lengths in this unit.
    ///
    /// # Errors
    /// As [`Outcome::write`].
    #[doc(hidden)] // of the program
    pub fn live_page(&self, unit: Unit) -> Result<LivePage> {
        self.with_page(unit, |page| Ok(LivePage::of(page)))
    }
}
